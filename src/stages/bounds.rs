//! bounds: bounds of the particle density from the measured bulk density, by simulation (paper, section 4.1, eqs 2, 3).
//!
//! The bulk density test is simulated with the measured particle density, once with every other parameter on its lower
//! and once on its upper bound; in between the bulk density is taken as proportional to the particle density. The driver
//! puts the bounds of the table into the study that all later stages see. Where the study gives bounds there is nothing
//! to do. Nothing here depends on `study.repetitions`, and bounds are rounded outward, so that a campaign that grows
//! keeps its design and every run.

use super::context::{run_settings, text};
use super::optima::finite;
use super::{Context, Demand, Outputs, SettingsText, Stage, StageError};
use crate::campaign::{Point, Request, Values};
use crate::config::{Config, DENSITY, DensityBounds, Measured, Parameter};
use crate::experiments::{self, Experiment};
use crate::settings;
use crate::stats::summary::{Summary, summarise};
use crate::tables::Row;
use crate::tables::list::{BOUNDS_KPIS, BOUNDS_RUNS, BoundRow, KpiRow, RunRow};
use std::sync::Arc;

/// The test and its KPI.
const TEST: &str = "bulk_density";
/// Label of the runs.
const LABEL: &str = "bounds";
/// Significant digits of a bound, rounded outward.
const DIGITS: i32 = 3;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "bounds",
    version: 1,
    purpose: "bounds of the particle density from the measured bulk density",
    reads: &[],
    writes: &[&BOUNDS_RUNS, &BOUNDS_KPIS, BoundRow::SPEC],
    files: &[],
    measured: true,
    settings,
    skipped,
    run,
    demand,
};

fn skipped(config: &Config) -> Option<&'static str> {
    match config.bounds.density {
        DensityBounds::NotCalibrated => Some("particle_density is no parameter"),
        DensityBounds::Given => Some("the study gives the bounds of particle_density"),
        DensityBounds::Sought | DensityBounds::Found => None,
    }
}

fn settings(config: &Config) -> SettingsText {
    let experiments: Vec<&dyn Experiment> = config.experiments().into_iter().filter(|e| e.name() == TEST).collect();
    let mut settings = run_settings(config, &experiments);
    // The first data set that knows both densities is taken.
    let sets: Vec<&str> = config.measured.iter().map(|set| set.name.as_str()).collect();
    settings.extend(text([("measured", sets.join(", "))]));
    let ends =
        others(config).flat_map(|other| ["lower", "upper"].map(|key| format!("parameters.{}.{key}", other.name)));
    let priors = sets.iter().map(|set| format!("prior.{set}.{DENSITY}"));
    let paths: Vec<String> = ends.chain(priors).chain(["bounds", "statistics"].map(str::to_owned)).collect();
    settings.extend(config.settings_text(&paths.iter().map(String::as_str).collect::<Vec<_>>()));
    settings
}

fn others(config: &Config) -> impl Iterator<Item = &Parameter> {
    config.parameters.iter().filter(|parameter| parameter.name != DENSITY)
}

/// A measured mean with what is known of its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Mean [kg/m³].
    pub mean: f64,
    /// Standard error of the mean [kg/m³].
    pub standard_error: f64,
}

impl Known {
    fn new(mean: f64, sd: f64, n: u32) -> Self {
        Self { mean, standard_error: sd / f64::from(n).sqrt() }
    }
}

/// What eqs 2 and 3 take from the laboratory.
#[derive(Debug, Clone, PartialEq)]
pub struct Densities {
    /// Name of the data set.
    pub measured: String,
    /// Bulk density.
    pub bulk: Known,
    /// Density of the grains.
    pub particle: Known,
}

/// Which of the two densities nobody measured.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Unmeasured {
    /// The bulk density.
    #[error("no measured data set holds a bulk density")]
    Bulk,
    /// The density of the grains.
    #[error(
        "neither a row `grains,…,particle_density` nor a [[prior]] tells the density of the grains of a data set that \
         holds a bulk density ({0})"
    )]
    Particle(String),
}

/// The densities of the first of `sets` that knows both; that of the grains may be `given`.
///
/// # Errors
/// Which of them is not known.
pub fn densities<'m>(
    config: &Config,
    sets: impl Iterator<Item = &'m Measured>,
    given: Option<Known>,
) -> Result<Densities, Unmeasured> {
    let mut known = Vec::new();
    for set in sets {
        let Some(bulk) = set.statistic(TEST) else { continue };
        let prior = config.priors_of(set).into_iter().find(|prior| prior.parameter == DENSITY);
        let weighed = prior.map(|prior| Known::new(prior.mean, prior.sd, prior.n));
        if let Some(particle) = given.or(weighed) {
            return Ok(Densities {
                measured: set.name.clone(),
                bulk: Known::new(bulk.mean, bulk.sd, bulk.n),
                particle,
            });
        }
        known.push(set.name.as_str());
    }
    Err(if known.is_empty() { Unmeasured::Bulk } else { Unmeasured::Particle(known.join(", ")) })
}

/// One of the two bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// ρ_p = ρ_b measured / ρ_b simulated · ρ_p measured (eqs 2 and 3) [kg/m³].
    pub value: f64,
    /// The same rounded outward to three significant digits: the bound [kg/m³].
    pub rounded: f64,
    /// Standard error of `value`: both measurements and the simulations, as relative errors [kg/m³].
    pub standard_error: f64,
    /// The other parameters as `name=value`.
    pub others: String,
    /// The simulated bulk densities behind it [kg/m³].
    pub simulated: Summary,
}

/// Both bounds with the runs behind them.
pub struct Found {
    /// The lower and the upper one.
    pub bounds: [Bound; 2],
    runs: Vec<RunRow>,
    kpis: Vec<KpiRow>,
}

/// The bounds from `repetitions` simulations at either end, runs that are known looked up.
///
/// # Errors
/// Simulations that cannot be set up or that give no bulk density at one end, and bounds that are none.
pub fn density_bounds(context: &Context, known: &Densities, repetitions: u32) -> Result<Found, StageError> {
    let points = points(context, known)?;
    let requests = requests(context, &points, repetitions)?;
    let runs = context.campaign.simulate(&requests)?;
    let kpis = context.campaign.measure(&requests, &runs)?;
    let [one, other] = points.map(|point| bound(context, known, &point, &kpis));
    let (one, other) = (one?, other?);
    let (lower, upper) = if one.value <= other.value { (one, other) } else { (other, one) };
    let lower = Bound { rounded: outward(lower.value, libm::floor), ..lower };
    let upper = Bound { rounded: outward(upper.value, libm::ceil), ..upper };
    let accepts = |bound: &Bound| settings::spec(DENSITY).is_ok_and(|spec| spec.accepts(bound.rounded));
    if lower.rounded >= upper.rounded || !accepts(&lower) || !accepts(&upper) {
        let what = format!("{} to {} kg/m3 can be no bounds of {DENSITY}", lower.rounded, upper.rounded);
        return Err(StageError::Input { what, remedy: "check the units of the measured densities" });
    }
    Ok(Found { bounds: [lower, upper], runs, kpis })
}

/// The measured density with the other parameters on their lower, then on their upper bounds.
fn points(context: &Context, known: &Densities) -> Result<[Arc<Point>; 2], StageError> {
    let config = context.config;
    let point = |number: u32, end: fn(&Parameter) -> f64| -> Result<Arc<Point>, StageError> {
        let mut values: Values = others(config).map(|other| (other.name.to_owned(), end(other))).collect();
        values.push((DENSITY.to_owned(), known.particle.mean));
        let point = Point::new(number, config.base_settings(), &values)?.knowing(&config.effects.library);
        Ok(Arc::new(point.with_effects(&config.effects.active)))
    };
    Ok([point(1, |parameter| parameter.lower)?, point(2, |parameter| parameter.upper)?])
}

fn requests(context: &Context, points: &[Arc<Point>; 2], repetitions: u32) -> Result<Vec<Request>, StageError> {
    let test = experiments::find(TEST)
        .map_err(|error| StageError::Input { what: error.to_string(), remedy: "register the bulk density test" })?;
    let mut requests = Vec::new();
    for point in points {
        requests.extend(Request::batch(LABEL, test, point, 1..=repetitions, context.config.study.seed)?);
    }
    Ok(requests)
}

/// Eqs 2 and 3 at one end.
fn bound(context: &Context, known: &Densities, point: &Point, kpis: &[KpiRow]) -> Result<Bound, StageError> {
    let own = || kpis.iter().filter(|row| row.point == point.number && row.kpi == TEST);
    let values: Vec<f64> = own().filter_map(|row| row.value).collect();
    let others = point.parameters.iter().filter(|(name, _)| name != DENSITY);
    let others = others.map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ");
    if values.is_empty() {
        let reason = own().find_map(|row| row.reason.clone()).unwrap_or_default();
        let what = format!("no simulation of {TEST} at {others} gave a value ({reason})");
        return Err(StageError::Input {
            what,
            remedy: "look at one with `granulake sim bulk_density --set NAME=VALUE`",
        });
    }
    let statistics = context.config.statistics;
    let simulated = summarise(&values, statistics.confidence, statistics.convention);
    let share = |error: f64, mean: f64| if error.is_finite() { error * error / (mean * mean) } else { 0.0 };
    let value = known.bulk.mean / simulated.mean * known.particle.mean;
    let variance = share(known.bulk.standard_error, known.bulk.mean)
        + share(known.particle.standard_error, known.particle.mean)
        + share(simulated.sd / (values.len() as f64).sqrt(), simulated.mean);
    Ok(Bound { value, rounded: value, standard_error: value * variance.sqrt(), others, simulated })
}

/// `value` with [`DIGITS`] significant digits, whole from 100 downward, rounded by `round`.
fn outward(value: f64, round: fn(f64) -> f64) -> f64 {
    let before_point = libm::floor(libm::log10(value)) as i32 + 1;
    let step: f64 = (DIGITS..before_point).map(|_| 10.0).product();
    round(value / step) * step
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let known = known(context)?;
    let repetitions = context.config.bounds.repetitions;
    let found = density_bounds(context, &known, repetitions)?;
    let rows = ["lower", "upper"].into_iter().zip(&found.bounds).map(|(name, bound)| row(&known, name, bound));
    let rows = rows.collect();
    let mut outputs = Outputs::default();
    outputs.table_as(&BOUNDS_RUNS, found.runs)?;
    outputs.table_as(&BOUNDS_KPIS, found.kpis)?;
    outputs.table::<BoundRow>(rows)?;
    Ok(outputs)
}

fn known(context: &Context) -> Result<Densities, StageError> {
    densities(context.config, context.measured.iter(), None)
        .map_err(|error| StageError::Input { what: error.to_string(), remedy: "measure it, or give the bounds" })
}

fn row(known: &Densities, name: &str, bound: &Bound) -> BoundRow {
    BoundRow {
        parameter: DENSITY.to_owned(),
        bound: name.to_owned(),
        value: bound.rounded,
        unrounded: bound.value,
        standard_error: bound.standard_error,
        others: bound.others.clone(),
        simulated_mean: bound.simulated.mean,
        simulated_mean_lower: finite(bound.simulated.mean_interval.lower),
        simulated_mean_upper: finite(bound.simulated.mean_interval.upper),
        simulated_sd: finite(bound.simulated.sd),
        count: bound.simulated.n as u32,
        measured: known.measured.clone(),
        measured_bulk_density: known.bulk.mean,
        measured_bulk_density_error: known.bulk.standard_error,
        measured_particle_density: known.particle.mean,
        measured_particle_density_error: known.particle.standard_error,
        unit: "kg/m3".to_owned(),
    }
}

/// The bounds in the rows of the table, if both are there.
pub fn of_rows(rows: &[BoundRow]) -> Option<(f64, f64)> {
    let value = |name: &str| rows.iter().find(|row| row.bound == name).map(|row| row.value);
    value("lower").zip(value("upper"))
}

fn demand(context: &Context) -> Result<Demand, StageError> {
    let points = points(context, &known(context)?)?;
    Ok(Demand::Runs(requests(context, &points, context.config.bounds.repetitions)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_rounded_outward_to_three_digits() {
        assert_eq!(
            [2542.9, 12_345.6, 987.6, 99.5].map(|value| outward(value, libm::floor)),
            [2540.0, 12_300.0, 987.0, 99.0]
        );
        assert_eq!([2834.7, 2840.0, 999.2].map(|value| outward(value, libm::ceil)), [2840.0, 2840.0, 1000.0]);
    }
}
