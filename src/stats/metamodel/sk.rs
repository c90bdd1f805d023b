//! Kind `sk`: stochastic kriging with a smoothed variance.
//!
//! 1. z_i = ln s_i² − ψ(ν_i/2) + ln(ν_i/2), ν_i = n_i − 1, is an unbiased observation of ln V(x_i) with the known
//!    variance ψ₁(ν_i/2), whatever V is (normal runs). A process with estimated mean and variance smooths it.
//! 2. The mean has noise V̂(x_i)/n_i; process variance and constant mean are estimated.
//!
//! The sd of the KPI is √V̂(x), apart from the uncertainty of the mean. Nothing is divided by the mean.

use super::part::Frame;
use super::{
    Differentiable, Kind, MetamodelError, Options, Part, PartRecord, Prediction, Response, Role, Usable, mean_of,
};
use crate::stats::gp::TrainingSet;
use crate::stats::special::{digamma, trigamma};

/// Stochastic kriging metamodel.
#[derive(Debug, Clone)]
pub struct Sk {
    mean: Part,
    /// Absent where all runs of every point agree exactly.
    scatter: Option<Part>,
    /// V̂(x_i), s_i² and n_i at the training points.
    variances: Vec<f64>,
    observed: Vec<f64>,
    counts: Vec<usize>,
}

impl Sk {
    pub(super) fn fit(data: &Usable, options: &Options) -> Result<Self, MetamodelError> {
        let replicated = data.require_replicates(Kind::Sk)?;
        let scatter = if replicated.iter().any(|&i| data.sds[i] > 0.0) {
            let frame = Frame { kind: Kind::Sk, role: Role::Scatter, offset: 0.0, scale: 1.0, jitter: 0.0 };
            let training = |jitter| scatter_training(data, options.reading.variance_floor, jitter);
            Some(Part::fit(frame, options, training)?)
        } else {
            None
        };
        let variances = variances(data, scatter.as_ref());
        let frame = mean_frame(data, &variances);
        let training = |jitter| mean_training(data, &variances, &Frame { jitter, ..frame });
        Ok(Self::assemble(Part::fit(frame, options, training)?, scatter, variances.clone(), data))
    }

    pub(super) fn restore(
        data: &Usable,
        mean: &PartRecord,
        scatter: Option<&PartRecord>,
    ) -> Result<Self, MetamodelError> {
        data.require_replicates(Kind::Sk)?;
        let floor = mean.reading.variance_floor;
        let part = |record: &PartRecord| Part::restore(record, scatter_training(data, floor, record.jitter));
        let scatter = scatter.map(part).transpose()?;
        let variances = variances(data, scatter.as_ref());
        let mean = Part::restore(mean, mean_training(data, &variances, &mean.frame()))?;
        Ok(Self::assemble(mean, scatter, variances, data))
    }

    fn assemble(mean: Part, scatter: Option<Part>, variances: Vec<f64>, data: &Usable) -> Self {
        // Where there is one run, s² is not defined and enters nothing.
        let observed = (0..data.means.len()).map(|i| if data.counts[i] > 1 { data.sds[i] * data.sds[i] } else { 0.0 });
        Self { mean, scatter, variances, observed: observed.collect(), counts: data.counts.clone() }
    }

    pub(super) fn parts(&self) -> Vec<&Part> {
        std::iter::once(&self.mean).chain(&self.scatter).collect()
    }

    /// V̂(x_i), s_i² and n_i at the training points, in squared units of the KPI.
    pub(super) fn run_variances(&self) -> (&[f64], &[f64], &[usize]) {
        (&self.variances, &self.observed, &self.counts)
    }

    pub(super) fn mean(&self) -> &Part {
        &self.mean
    }

    /// Standard deviations of the slopes of ln sd = ½ ln V.
    pub(super) fn log_sd_slope_sd(&self, x: &[f64]) -> Vec<f64> {
        let half = |scatter: &Part| scatter.slope_sd(x).into_iter().map(|sd| 0.5 * sd).collect();
        self.scatter.as_ref().map_or_else(|| vec![0.0; x.len()], half)
    }

    /// Standard deviation of the difference of ln sd between two points.
    pub(super) fn log_sd_difference_sd(&self, x: &[f64], y: &[f64]) -> f64 {
        self.scatter.as_ref().map_or(0.0, |scatter| 0.5 * scatter.difference_sd(x, y))
    }

    pub(super) fn response(&self, x: &[f64]) -> Response {
        let scatter = self.scatter.as_ref();
        let sd = scatter.map_or_else(|| no_scatter(x), |scatter| sd(&scatter.mean_with_gradient(x)));
        Response { mean: self.mean.mean_with_gradient(x), sd: Some(sd) }
    }

    pub(super) fn predict(&self, x: &[f64]) -> Prediction {
        let Response { mean, sd } = self.response(x);
        let log_sd_error = self.scatter.as_ref().map_or(0.0, |scatter| 0.5 * scatter.variance(x).sqrt());
        Prediction { mean, sd, epistemic_sd: self.mean.variance(x).sqrt(), log_sd_error }
    }
}

fn no_scatter(x: &[f64]) -> Differentiable {
    Differentiable { value: 0.0, gradient: vec![0.0; x.len()] }
}

/// sd = exp(½ ln V).
fn sd(log_variance: &Differentiable) -> Differentiable {
    let value = libm::exp(0.5 * log_variance.value);
    Differentiable { value, gradient: log_variance.gradient.iter().map(|slope| 0.5 * value * slope).collect() }
}

/// The jitter guards against points that are repeated with very many runs.
fn scatter_training(data: &Usable, floor: f64, jitter: f64) -> TrainingSet {
    let replicated = data.replicated();
    let squares: Vec<f64> = replicated.iter().map(|&i| data.sds[i] * data.sds[i]).collect();
    let least = floor * mean_of(&squares);
    let half_dof = |i: usize| 0.5 * (data.counts[i] as f64 - 1.0);
    let unbiased =
        |(&i, &square): (&usize, &f64)| libm::log(square.max(least)) - digamma(half_dof(i)) + libm::log(half_dof(i));
    TrainingSet {
        points: data.points.select(&replicated),
        targets: replicated.iter().zip(&squares).map(unbiased).collect(),
        noise: replicated.iter().map(|&i| trigamma(half_dof(i)) + jitter).collect(),
    }
}

/// V̂ at every training point.
fn variances(data: &Usable, scatter: Option<&Part>) -> Vec<f64> {
    let at = |x: &[f64]| scatter.map_or(0.0, |part| libm::exp(part.mean(x)));
    data.points.rows().map(at).collect()
}

/// The means are centred and brought to unit spread over the design, so that the bounds of σ_f² have one meaning.
fn mean_frame(data: &Usable, variances: &[f64]) -> Frame {
    let offset = mean_of(&data.means);
    let squares: Vec<f64> = data.means.iter().map(|mean| (mean - offset) * (mean - offset)).collect();
    let (spread, scatter) = (mean_of(&squares).sqrt(), mean_of(variances).sqrt());
    // A constant response has no spread; its scatter, or one unit, then sets the scale.
    let scale = [spread, scatter].into_iter().find(|&size| size > 1e-12 * offset.abs()).unwrap_or(1.0);
    Frame { kind: Kind::Sk, role: Role::Mean, offset, scale, jitter: 0.0 }
}

fn mean_training(data: &Usable, variances: &[f64], frame: &Frame) -> TrainingSet {
    let noise = |i: usize| variances[i] / (data.counts[i] as f64 * frame.scale * frame.scale) + frame.jitter;
    TrainingSet {
        points: data.points.clone(),
        targets: data.means.iter().map(|mean| (mean - frame.offset) / frame.scale).collect(),
        noise: (0..data.means.len()).map(noise).collect(),
    }
}
