//! validate: runs of the held-out equipment at the optima, against a measurement that the calibration never saw.

use super::context::{run_settings, text};
use super::optima::{self, Name, Results, finite, percent};
use super::{Context, Demand, Outputs, SettingsText, Stage, StageError, never};
use crate::campaign::Request;
use crate::config::Config;
use crate::stats::special::student_t_quantile;
use crate::stats::summary::{Summary, variance_of_mean, welch};
use crate::tables::Row;
use crate::tables::list::{OptimumRow, TargetRow, VALIDATE_KPIS, VALIDATE_RUNS, ValidationRow};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "validate",
    version: 2,
    purpose: "runs of the held-out equipment at the optima",
    reads: &[OptimumRow::SPEC, TargetRow::SPEC],
    writes: &[&VALIDATE_RUNS, &VALIDATE_KPIS, ValidationRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = run_settings(config, &[config.validate.experiment]);
    settings.extend(text([("verify.counts", format!("{:?}", config.verify.counts))]));
    settings.extend(config.settings_text(&["validate", "statistics"]));
    settings
}

fn requests(context: &Context) -> Result<Vec<Request>, StageError> {
    let validate = context.config.validate;
    let points = optima::points(context, &context.read::<OptimumRow>()?)?;
    optima::requests(context, &points, &[validate.experiment], |_| validate.repetitions)
}

fn demand(context: &Context) -> Result<Demand, StageError> {
    if context.has(OptimumRow::SPEC) {
        return requests(context).map(Demand::Runs);
    }
    let validate = context.config.validate;
    Ok(optima::foreseen(context, &[validate.experiment], |_| validate.repetitions))
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let requests = requests(context)?;
    let runs = context.campaign.simulate(&requests)?;
    let kpis = context.campaign.measure(&requests, &runs)?;
    let results = Results::new(&kpis);
    let targets: Vec<TargetRow> = context.read()?;
    let points = optima::points(context, &context.read::<OptimumRow>()?)?;
    let mut validated = Vec::new();
    for name in points.keys() {
        let held_out = targets.iter().filter(|row| row.measured == name.measured && !row.fitted);
        validated.extend(held_out.map(|target| row(context, &results, name, target)));
    }
    let mut outputs = Outputs::default();
    outputs.table_as(&VALIDATE_RUNS, runs)?;
    outputs.table_as(&VALIDATE_KPIS, kpis.clone())?;
    outputs.table(validated)?;
    Ok(outputs)
}

fn row(context: &Context, results: &Results, name: &Name, target: &TargetRow) -> ValidationRow {
    let label = name.label();
    let found = results.summary(context, &label, &target.kpi);
    let error = percent(found.mean, target.mean);
    let half_width = half_width_percent(&found, target, context.config.statistics.confidence);
    ValidationRow {
        measured: name.measured.clone(),
        kind: name.kind.clone(),
        approach: name.approach.clone(),
        n: name.n,
        kpi: target.kpi.clone(),
        repetitions: context.config.validate.repetitions,
        count: found.n as u32,
        mean: finite(found.mean),
        mean_lower: finite(found.mean_interval.lower),
        mean_upper: finite(found.mean_interval.upper),
        sd: finite(found.sd),
        target_mean: target.mean,
        target_sd: target.sd,
        target_n: target.n,
        error_percent: error,
        error_lower_percent: error.zip(half_width).map(|(error, half)| error - half),
        error_upper_percent: error.zip(half_width).map(|(error, half)| error + half),
        reason: if error.is_none() { results.reason(&label, &target.kpi) } else { None },
        unit: target.unit.clone(),
    }
}

/// Half width of the interval of the error: both means are uncertain, degrees of freedom after Welch and Satterthwaite.
fn half_width_percent(found: &Summary, target: &TargetRow, confidence: f64) -> Option<f64> {
    let (variance, dof) = welch(&[variance_of_mean(found.sd, found.n), variance_of_mean(target.sd, target.n as usize)]);
    let t = student_t_quantile(0.5 + 0.5 * confidence, dof);
    finite(100.0 * t * variance.sqrt() / target.mean.abs())
}
