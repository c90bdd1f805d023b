//! Measured statistics of every data set as rows.

use super::Context;
use crate::config::{Measured, MeasuredSummary};
use crate::stats::summary::{lilliefors_distance, lilliefors_p, mean_interval, sd_interval};
use crate::tables::list::TargetRow;

/// Fewest single values for a test of normality.
const LEAST_FOR_LILLIEFORS: usize = 4;

/// One row per data set and observable.
pub fn rows(context: &Context) -> Vec<TargetRow> {
    context
        .measured
        .iter()
        .flat_map(|set| set.statistics().into_iter().map(|summary| row(context, set, &summary)))
        .collect()
}

fn row(context: &Context, set: &Measured, summary: &MeasuredSummary) -> TargetRow {
    let statistics = context.config.statistics;
    let (n, level, convention) = (summary.n as usize, statistics.confidence, statistics.convention);
    let mean = mean_interval(summary.mean, summary.sd, n, level, convention);
    let sd = sd_interval(summary.sd, n, level, convention);
    let values = set.values_of(summary.kpi);
    let testable = values.len() >= LEAST_FOR_LILLIEFORS && summary.sd > 0.0;
    TargetRow {
        measured: set.name.clone(),
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        n: summary.n,
        mean: summary.mean,
        mean_lower: mean.lower,
        mean_upper: mean.upper,
        sd: summary.sd,
        sd_lower: sd.lower,
        sd_upper: sd.upper,
        lilliefors_p: testable.then(|| lilliefors_p(lilliefors_distance(&values), values.len())),
        unit: summary.unit.to_owned(),
        fitted: summary.experiment != context.config.validate.experiment.name(),
    }
}
