//! kpi: read every observable off the final state and the trace of every run.

use super::context::text;
use super::{Context, Outputs, Parts, SettingsText, Stage, StageError, design, never, no_runs};
use crate::campaign::{KPI_VERSION, Request};
use crate::canonical::Encoder;
use crate::config::Config;
use crate::settings::Scope;
use crate::tables::Row;
use crate::tables::list::{KpiRow, RunRow, SampleRow};
use std::sync::Arc;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "kpi",
    version: 3,
    purpose: "read KPIs and extra observables off every run",
    reads: &[SampleRow::SPEC, RunRow::SPEC],
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

/// A part of the table is read off one part of the runs.
fn run(context: &Context) -> Result<Outputs, StageError> {
    let points = design::points(context.config, &context.read()?)?;
    let samples = context.digest(SampleRow::SPEC)?;
    let mut table = Parts::new(context, KpiRow::SPEC);
    for part in context.parts(RunRow::SPEC)? {
        let mut inputs = Encoder::new();
        inputs.bytes(&samples.0).bytes(&part.digest.0);
        let experiment = context.config.experiments().into_iter().find(|experiment| experiment.name() == part.value);
        let experiment = experiment.ok_or_else(|| mismatch(&part.value))?;
        table.add(&part.value, &inputs, || {
            let runs: Vec<RunRow> = context.read_part(&part)?;
            let request = |run: &RunRow| {
                let point = points.get(&run.point).ok_or_else(|| mismatch(&format!("point {}", run.point)))?;
                let (label, point) = (run.label.clone(), Arc::clone(point));
                Ok(Request { label, experiment, point, repetition: run.repetition, seed: run.seed })
            };
            let requests = runs.iter().map(request).collect::<Result<Vec<_>, StageError>>()?;
            Ok(context.campaign.measure(&requests, &runs)?)
        })?;
    }
    Ok(table.finish())
}

fn mismatch(what: &str) -> StageError {
    let what = format!("table runs holds {what}, which the design lacks");
    StageError::Input { what, remedy: "run `granulake repro simulate`" }
}
