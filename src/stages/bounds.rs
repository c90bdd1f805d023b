//! Bounds of the particle density from the measured bulk density, by simulation (paper, section 4.1, eqs 2 and 3).
//!
//! No stage: bounds stand in the study, and this says what they should be. The bulk density test is simulated with the
//! measured particle density, once with every other parameter on its lower and once on its upper bound; in between the
//! bulk density is taken as proportional to the particle density.

use super::{Context, StageError};
use crate::campaign::{Point, Request, Values};
use crate::config::Parameter;
use crate::experiments;
use crate::stats::summary::{Interval, Summary, mean_interval, summarise};
use std::sync::Arc;

/// The calibrated parameter whose bounds are sought.
pub const PARAMETER: &str = "particle_density";
/// The test and its KPI.
const TEST: &str = "bulk_density";
/// Label of the runs.
const LABEL: &str = "bounds";

/// A measured mean with what is known of its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// Mean [kg/m³].
    pub mean: f64,
    /// Standard error of the mean [kg/m³].
    pub standard_error: f64,
}

/// One of the two bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// ρ_p = ρ_b measured / ρ_b simulated · ρ_p measured [kg/m³].
    pub value: f64,
    /// Its standard error: both measurements and the simulations, as relative errors [kg/m³].
    pub standard_error: f64,
    /// The simulated bulk densities behind it [kg/m³].
    pub simulated: Summary,
    /// Interval of their mean [kg/m³].
    pub interval: Interval,
}

/// The lower and the upper bound from `repetitions` simulations each, runs that are known looked up.
///
/// # Errors
/// Simulations that cannot be set up or that give no bulk density at all.
pub fn density_bounds(
    context: &Context,
    bulk: Known,
    particle: Known,
    repetitions: u32,
) -> Result<[Bound; 2], StageError> {
    let ends: [fn(&Parameter) -> f64; 2] = [|parameter| parameter.lower, |parameter| parameter.upper];
    let mut requests = Vec::new();
    for (number, end) in (1..).zip(ends) {
        let others = context.config.parameters.iter().filter(|parameter| parameter.name != PARAMETER);
        let mut values: Values = others.map(|parameter| (parameter.name.to_owned(), end(parameter))).collect();
        values.push((PARAMETER.to_owned(), particle.mean));
        let point = Point::new(number, context.config.base_settings(), &values)?;
        let point = Arc::new(point.with_effects(&context.config.effects.active));
        let test = experiments::find(TEST)
            .map_err(|error| StageError::Input { what: error.to_string(), remedy: "register the bulk density test" })?;
        requests.extend(Request::batch(LABEL, test, &point, 1..=repetitions, context.config.study.seed)?);
    }
    let runs = context.campaign.simulate(&requests)?;
    let kpis = context.campaign.measure(&requests, &runs)?;
    let statistics = context.config.statistics;
    let bound = |number: u32| {
        let own = kpis.iter().filter(|row| row.point == number && row.kpi == TEST);
        let values: Vec<f64> = own.filter_map(|row| row.value).collect();
        let simulated = summarise(&values, statistics.confidence, statistics.convention);
        let interval =
            mean_interval(simulated.mean, simulated.sd, values.len(), statistics.confidence, statistics.convention);
        let share = |error: f64, mean: f64| if error.is_finite() { error * error / (mean * mean) } else { 0.0 };
        let value = bulk.mean / simulated.mean * particle.mean;
        let variance = share(bulk.standard_error, bulk.mean)
            + share(particle.standard_error, particle.mean)
            + share(simulated.sd / (values.len() as f64).sqrt(), simulated.mean);
        Bound { value, standard_error: value * variance.sqrt(), simulated, interval }
    };
    let bounds = [bound(1), bound(2)];
    if bounds.iter().any(|bound| !bound.value.is_finite()) {
        let what = "no simulation at a corner gave a bulk density".to_owned();
        return Err(StageError::Input { what, remedy: "see `granulake sim bulk_density` there" });
    }
    Ok(bounds)
}
