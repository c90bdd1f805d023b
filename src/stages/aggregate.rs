//! aggregate: mean and standard deviation of every observable over the first n repetitions, for every n.
//!
//! Runs beyond those that every point gets count at the largest n, where `count` says how many there are.

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs};
use crate::config::Config;
use crate::stats::summary::summarise;
use crate::tables::Row;
use crate::tables::list::{AggregateRow, KpiRow};
use std::collections::BTreeMap;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "aggregate",
    version: 1,
    purpose: "mean, standard deviation and intervals for every number of repetitions",
    reads: &[KpiRow::SPEC],
    writes: &[AggregateRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("study.repetitions", config.study.repetitions.to_string())]);
    settings.extend(config.settings_text(&["statistics"]));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let mut outputs = Outputs::default();
    outputs.table(aggregate(&context.read()?, context.config))?;
    Ok(outputs)
}

/// One row per observable, point and n = 1..repetitions; a repetition without a value is counted out, not replaced.
fn aggregate(kpis: &[KpiRow], config: &Config) -> Vec<AggregateRow> {
    let mut groups: BTreeMap<(&str, &str, u32), Vec<&KpiRow>> = BTreeMap::new();
    for row in kpis {
        groups.entry((&row.experiment, &row.kpi, row.point)).or_default().push(row);
    }
    groups.values_mut().for_each(|rows| rows.sort_by_key(|row| row.repetition));
    let each_n = |rows: &Vec<&KpiRow>| -> Vec<AggregateRow> {
        (1..=config.study.repetitions).map(|n| first_repetitions(rows, n, config)).collect()
    };
    groups.values().flat_map(each_n).collect()
}

fn first_repetitions(rows: &[&KpiRow], n: u32, config: &Config) -> AggregateRow {
    let values: Vec<f64> = rows
        .iter()
        .filter(|row| row.repetition <= n || n == config.study.repetitions)
        .filter_map(|row| row.value)
        .collect();
    let summary = summarise(&values, config.statistics.confidence, config.statistics.convention);
    let finite = |value: f64| value.is_finite().then_some(value);
    let first = rows[0];
    AggregateRow {
        experiment: first.experiment.clone(),
        kpi: first.kpi.clone(),
        point: first.point,
        parameter_hash: first.parameter_hash.clone(),
        n,
        count: values.len() as u32,
        mean: finite(summary.mean),
        mean_lower: finite(summary.mean_interval.lower),
        mean_upper: finite(summary.mean_interval.upper),
        sd: finite(summary.sd),
        sd_lower: finite(summary.sd_interval.lower),
        sd_upper: finite(summary.sd_interval.upper),
        unit: first.unit.clone(),
    }
}
