//! kpi: read every observable off the final state and the trace of every run.

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, design, never, no_runs};
use crate::campaign::KPI_VERSION;
use crate::config::Config;
use crate::settings::Scope;
use crate::tables::Row;
use crate::tables::list::{KpiRow, ReplicationRow, RunRow, SampleRow};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "kpi",
    version: 1,
    purpose: "read KPIs and extra observables off every run",
    reads: &[SampleRow::SPEC, ReplicationRow::SPEC, RunRow::SPEC],
    writes: &[KpiRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("kpi_version", KPI_VERSION.to_string())]);
    settings.extend(config.settings_text(&["experiments"]));
    settings.extend(config.active_text());
    settings.extend(config.setup_text(&config.experiments(), Scope::Measure));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let requests = design::requests(context, &context.read::<SampleRow>()?, &context.read::<ReplicationRow>()?)?;
    let mut by_key = context.read::<RunRow>()?;
    let order = |row: &RunRow| (row.experiment.clone(), row.point, row.repetition);
    by_key.sort_by_key(order);
    let runs = requests
        .iter()
        .map(|request| {
            let key = (request.experiment.name().to_owned(), request.point.number, request.repetition);
            by_key.binary_search_by_key(&key, order).map(|index| by_key[index].clone()).map_err(|_| StageError::Input {
                what: format!("table runs lacks point {} of {}, repetition {}", key.1, key.0, key.2),
                remedy: "run `granulake repro simulate`",
            })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut outputs = Outputs::default();
    outputs.table(context.campaign.measure(&requests, &runs)?)?;
    Ok(outputs)
}
