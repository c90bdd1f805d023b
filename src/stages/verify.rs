//! verify: new DEM runs at the optima, against the metamodel's prediction and the measured value.

use super::context::{run_settings, text};
use super::optima::{self, Name, Results, finite, percent};
use super::{Context, Demand, Outputs, SettingsText, Stage, StageError, never};
use crate::campaign::Request;
use crate::config::Config;
use crate::tables::Row;
use crate::tables::list::{OptimumRow, PredictionRow, TargetRow, VERIFY_KPIS, VERIFY_RUNS, VerificationRow};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "verify",
    version: 2,
    purpose: "new DEM runs at the optima",
    reads: &[OptimumRow::SPEC, PredictionRow::SPEC, TargetRow::SPEC],
    writes: &[&VERIFY_RUNS, &VERIFY_KPIS, VerificationRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = run_settings(config, &config.experiments());
    settings.extend(text([("verify.counts", format!("{:?}", config.verify.counts))]));
    settings.extend(config.settings_text(&["experiments", "statistics"]));
    settings
}

fn requests(context: &Context) -> Result<Vec<Request>, StageError> {
    let points = optima::points(context, &context.read::<OptimumRow>()?)?;
    optima::requests(context, &points, &context.config.experiments(), |name| name.n)
}

fn demand(context: &Context) -> Result<Demand, StageError> {
    if context.has(OptimumRow::SPEC) {
        return requests(context).map(Demand::Runs);
    }
    Ok(optima::foreseen(context, &context.config.experiments(), |n| n))
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let requests = requests(context)?;
    let runs = context.campaign.simulate(&requests)?;
    let kpis = context.campaign.measure(&requests, &runs)?;
    let results = Results::new(&kpis);
    let targets = context.read::<TargetRow>()?;
    let rows = context.read::<PredictionRow>()?;
    let rows = rows.iter().filter(|row| context.config.verify.counts.contains(&row.n));
    let verified: Vec<VerificationRow> = rows.filter_map(|row| verified(context, &results, &targets, row)).collect();
    let mut outputs = Outputs::default();
    outputs.table_as(&VERIFY_RUNS, runs)?;
    outputs.table_as(&VERIFY_KPIS, kpis.clone())?;
    outputs.table(verified)?;
    Ok(outputs)
}

fn verified(
    context: &Context,
    results: &Results,
    targets: &[TargetRow],
    prediction: &PredictionRow,
) -> Option<VerificationRow> {
    let target = targets.iter().find(|row| row.measured == prediction.measured && row.kpi == prediction.kpi)?;
    let name = Name {
        measured: prediction.measured.clone(),
        kind: prediction.kind.clone(),
        approach: prediction.approach.clone(),
        n: prediction.n,
    };
    let found = results.summary(context, &name.label(), &prediction.kpi);
    let (up, down) = (found.mean + found.sd, found.mean - found.sd);
    Some(VerificationRow {
        measured: name.measured,
        kind: name.kind,
        approach: name.approach,
        n: name.n,
        kpi: prediction.kpi.clone(),
        count: found.n as u32,
        mean: finite(found.mean),
        mean_lower: finite(found.mean_interval.lower),
        mean_upper: finite(found.mean_interval.upper),
        sd: finite(found.sd),
        predicted_mean: prediction.mean,
        predicted_sd: prediction.sd,
        target_mean: target.mean,
        target_sd: target.sd,
        prediction_error_percent: percent(found.mean, prediction.mean),
        target_error_percent: percent(found.mean, target.mean),
        target_error_upper_percent: percent(up, target.mean + target.sd),
        target_error_lower_percent: percent(down, target.mean - target.sd),
        unit: prediction.unit.clone(),
    })
}
