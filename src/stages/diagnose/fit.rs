//! Calibration of the diagnosis: all statistics at once, weighed by what is known of them.
//!
//! First over the metamodels, from several starts; then once more with slopes taken from direct differences of DEM runs
//! around that optimum. Parameters are coordinates of the unit cube here.

use super::evidence::Evidence;
use super::moments::{Moment, Statistic};
use crate::config::Config;
use crate::stages::models::{Models, kind};
use crate::stages::{Context, StageError};
use crate::stats::attribution::{GlsFit, GlsOptions, Parameter, Prior, gls_fit};
use crate::stats::metamodel::Metamodel;
use nalgebra::{DMatrix, DVector};

/// Metamodels of every statistic of the evidence.
pub struct Surface {
    models: Vec<(Metamodel, Moment)>,
}

impl Surface {
    /// The metamodels behind `statistics`; `None` where one was not trained.
    pub fn new(context: &Context, models: &Models, statistics: &[Statistic]) -> Option<Self> {
        let (kind, n) = (kind(context.config.diagnose.kind), context.config.study.repetitions);
        let models: Option<Vec<_>> =
            statistics.iter().map(|s| Some((models.restore(&s.kpi, kind, n)?, s.moment))).collect();
        Some(Self { models: models? })
    }

    /// f(u) and J(u) of all statistics, shapes (m) and (m × p).
    pub fn predict(&self, u: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let rows: Vec<(f64, Vec<f64>)> =
            self.models.iter().map(|(model, moment)| row(model, *moment, u.as_slice())).collect();
        let values = DVector::from_iterator(rows.len(), rows.iter().map(|(value, _)| *value));
        (values, DMatrix::from_fn(rows.len(), u.len(), |i, j| rows[i].1[j]))
    }

    /// Variance of the metamodels' own uncertainty at `u`, on the diagonal.
    pub fn uncertainty(&self, u: &DVector<f64>) -> DMatrix<f64> {
        let variance = |(model, moment): &(Metamodel, Moment)| {
            let prediction = model.predict(u.as_slice());
            let sd = match moment {
                Moment::Mean => prediction.epistemic_sd,
                Moment::LnSd => prediction.log_sd_error,
            };
            sd * sd
        };
        DMatrix::from_diagonal(&DVector::from_iterator(self.models.len(), self.models.iter().map(variance)))
    }
}

fn row(model: &Metamodel, moment: Moment, u: &[f64]) -> (f64, Vec<f64>) {
    let prediction = model.predict(u);
    match (moment, prediction.sd) {
        (Moment::LnSd, Some(sd)) if sd.value > 0.0 => {
            (libm::log(sd.value), sd.gradient.iter().map(|slope| slope / sd.value).collect())
        }
        (Moment::LnSd, _) => (0.0, vec![0.0; u.len()]),
        (Moment::Mean, _) => (prediction.mean.value, prediction.mean.gradient),
    }
}

/// The parameters of the study in the unit cube with the priors of a data set, starting at `start`.
pub fn parameters(config: &Config, measured: &str, start: &[f64]) -> Vec<Parameter> {
    let prior = |name: &str| config.priors_of(measured).find(|prior| prior.parameter == name);
    let parameter = |(parameter, value): (&crate::config::Parameter, &f64)| Parameter {
        name: parameter.name.to_owned(),
        value: *value,
        lower: 0.0,
        upper: 1.0,
        prior: prior(parameter.name).map(|prior| {
            let error = prior.sd / f64::from(prior.n).sqrt();
            let width = parameter.to_unit(prior.mean + 0.5 * error) - parameter.to_unit(prior.mean - 0.5 * error);
            Prior { mean: parameter.to_unit(prior.mean), sd: width }
        }),
    };
    config.parameters.iter().zip(start).map(parameter).collect()
}

/// The best fit over the metamodels, from the centre and from points towards every corner.
///
/// The uncertainty of the metamodels is taken at the optimum of a first pass and enters a second one.
pub fn over_metamodels(
    context: &Context,
    measured: &str,
    evidence: &Evidence,
    noise: &DMatrix<f64>,
    surface: &Surface,
) -> Result<GlsFit, StageError> {
    let p = context.config.parameters.len();
    let best = |covariance: &DMatrix<f64>, starts: &[Vec<f64>]| -> Result<GlsFit, StageError> {
        let mut best: Option<GlsFit> = None;
        for start in starts {
            let parameters = parameters(context.config, measured, start);
            let fit = gls(|u| surface.predict(u), &evidence.values, covariance, &parameters)?;
            if best.as_ref().is_none_or(|best| fit.chi2 < best.chi2) {
                best = Some(fit);
            }
        }
        best.ok_or(StageError::Input { what: "there is no start for the fit".into(), remedy: "report this" })
    };
    let corner = |index: usize| (0..p).map(|d| if index >> d & 1 == 1 { 0.8 } else { 0.2 }).collect::<Vec<f64>>();
    let corners = if p <= 6 { 1 << p } else { 0 };
    let starts: Vec<Vec<f64>> = std::iter::once(vec![0.5; p]).chain((0..corners).map(corner)).collect();
    let first = best(noise, &starts)?;
    let wider = noise + surface.uncertainty(&first.parameters);
    best(&wider, &[first.parameters.as_slice().to_vec(), vec![0.5; p]])
}

/// The best fit of a model that is linear around `centre`: f + J (u − centre), columns in the order of `parameters`.
pub fn linear(
    value: &DVector<f64>,
    jacobian: &DMatrix<f64>,
    centre: &DVector<f64>,
    data: &DVector<f64>,
    covariance: &DMatrix<f64>,
    parameters: &[Parameter],
) -> Result<GlsFit, StageError> {
    gls(|u| (value + jacobian * (u - centre), jacobian.clone()), data, covariance, parameters)
}

fn gls(
    model: impl Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
    data: &DVector<f64>,
    covariance: &DMatrix<f64>,
    parameters: &[Parameter],
) -> Result<GlsFit, StageError> {
    gls_fit(model, data, covariance, parameters, &GlsOptions::default()).map_err(|error| StageError::Input {
        what: format!("the fit of all statistics failed: {error}"),
        remedy: "check the measured data for observables without scatter, or raise study.repetitions",
    })
}
