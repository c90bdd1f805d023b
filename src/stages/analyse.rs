//! analyse: mean and scatter of the measured data for every number of repetitions, and what they are worth.
//!
//! Needs no simulation: `granulake repro analyse` tells a laboratory whether it has repeated often enough (paper, section
//! 2.4 and Fig. 6).

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs};
use crate::config::{Config, Measured, MeasuredSummary};
use crate::stats::summary::{
    Summary, cumulative, lilliefors_distance, lilliefors_p, lilliefors_p_monte_carlo, mean_interval, plan_repetitions,
    sd_interval, stability_count,
};
use crate::tables::Row;
use crate::tables::list::{MeasuredAnalysisRow, MeasuredStatisticRow};
use rayon::prelude::*;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "analyse",
    version: 2,
    purpose: "measured means and scatter for every number of repetitions, normality, repetitions needed",
    reads: &[],
    writes: &[MeasuredStatisticRow::SPEC, MeasuredAnalysisRow::SPEC],
    files: &[],
    measured: true,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("study.seed", config.study.seed.to_string())]);
    settings.extend(config.settings_text(&["statistics", "analysis"]));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let sets = context.measured.iter();
    let observables: Vec<(&Measured, MeasuredSummary)> =
        sets.flat_map(|set| set.statistics().into_iter().map(move |summary| (set, summary))).collect();
    let seed = context.seed("analyse");
    let judge = |(set, summary): &(&Measured, MeasuredSummary)| analysis(context.config, set, summary, seed);
    let analysed: Vec<MeasuredAnalysisRow> = context.campaign.install(|| observables.par_iter().map(judge).collect());
    let statistics = observables.iter().flat_map(|(set, summary)| statistics(context.config, set, summary));
    let mut outputs = Outputs::default();
    outputs.table(statistics.collect::<Vec<_>>())?;
    outputs.table(analysed)?;
    Ok(outputs)
}

/// One row per n: of single values every n, of a published summary its own.
fn statistics(config: &Config, set: &Measured, summary: &MeasuredSummary) -> Vec<MeasuredStatisticRow> {
    let (level, convention) = (config.statistics.confidence, config.statistics.convention);
    let values = set.values_of(summary.kpi);
    let published = || {
        let n = summary.n as usize;
        vec![Summary {
            n,
            mean: summary.mean,
            sd: summary.sd,
            mean_interval: mean_interval(summary.mean, summary.sd, n, level, convention),
            sd_interval: sd_interval(summary.sd, n, level, convention),
        }]
    };
    let all = if values.is_empty() { published() } else { cumulative(&values, level, convention) };
    let finite = |value: f64| value.is_finite().then_some(value);
    let row = |found: &Summary| MeasuredStatisticRow {
        measured: set.name.clone(),
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        n: found.n as u32,
        mean: found.mean,
        mean_lower: finite(found.mean_interval.lower),
        mean_upper: finite(found.mean_interval.upper),
        sd: finite(found.sd),
        sd_lower: finite(found.sd_interval.lower),
        sd_upper: finite(found.sd_interval.upper),
        unit: summary.unit.to_owned(),
    };
    all.iter().map(row).collect()
}

fn analysis(config: &Config, set: &Measured, summary: &MeasuredSummary, seed: u64) -> MeasuredAnalysisRow {
    let (level, convention) = (config.statistics.confidence, config.statistics.convention);
    let wished = config.analysis.precision;
    let plan = plan_repetitions(summary.mean, summary.sd, summary.n as usize, wished, level, convention);
    let whole = |n: Option<usize>| n.and_then(|n| u32::try_from(n).ok());
    let values = set.values_of(summary.kpi);
    let distance = Some(lilliefors_distance(&values)).filter(|distance| distance.is_finite());
    let draws = config.analysis.lilliefors_draws as usize;
    MeasuredAnalysisRow {
        measured: set.name.clone(),
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        n: summary.n,
        stable_from: stability_count(&values, config.analysis.stability).map(|n| n as u32),
        precision: Some(plan.reached).filter(|precision| precision.is_finite()),
        precision_wished: wished,
        needed: whole(plan.needed),
        needed_lower: whole(plan.range.0),
        needed_upper: whole(plan.range.1),
        lilliefors_d: distance,
        lilliefors_p: distance.map(|distance| lilliefors_p(distance, values.len())),
        lilliefors_p_simulated: distance.map(|distance| lilliefors_p_monte_carlo(distance, values.len(), draws, seed)),
    }
}
