//! One Gaussian process of a metamodel together with the scaling of its targets, and its storable record.
//!
//! The process works on y = (observed − offset)/scale; predictions leave here in the unit of the observed quantity.

use super::{Differentiable, Kind, MetamodelError, Options, Reading};
use crate::stats::gp::likelihood::{LikelihoodSearch, Variance, maximise_likelihood};
use crate::stats::gp::{Form, GaussianProcess, Hyperparameters, TrainingSet, Trend};
use crate::stats::linalg::LinalgError;
use crate::stats::naming::named;
use crate::stats::optimise::Starts;

/// What a process of a metamodel describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The mean of the KPI.
    Mean,
    /// Its scatter: coefficient of variation, sd, or log variance.
    Scatter,
}

named!(Role, "process of a metamodel", Mean => "mean", Scatter => "scatter");

/// One trained process as plain numbers: what a table holds, and what restores it together with the observations.
#[derive(Debug, Clone, PartialEq)]
pub struct PartRecord {
    /// Kind of the metamodel.
    pub kind: Kind,
    /// What the process describes.
    pub role: Role,
    /// How the observations were read.
    pub reading: Reading,
    /// Subtracted from the observed quantity.
    pub offset: f64,
    /// By which the difference was divided.
    pub scale: f64,
    /// Added to the diagonal, in squared units of the scaled targets.
    pub jitter: f64,
    /// log10 a_d, shape (n_parameters).
    pub log10_a: Vec<f64>,
    /// Process variance σ_f², in squared units of the scaled targets.
    pub variance: f64,
    /// Estimated constant mean of the scaled targets; 0 for kinds `ibm` and `rbm`.
    pub beta: f64,
    /// Log marginal likelihood of the scaled targets (eq. 7).
    pub log_likelihood: f64,
    /// Whether log10 a_d lies on a bound, shape (n_parameters).
    pub at_bound: Vec<bool>,
    /// Descents made in the search for the hyperparameters.
    pub descents: usize,
    /// How many of them ended within 10⁻⁴ of the best log likelihood.
    pub agreeing: usize,
}

/// One process of a metamodel.
#[derive(Debug, Clone)]
pub struct Part {
    process: GaussianProcess,
    record: PartRecord,
}

/// The fixed choices of a process; `jitter` is the amount in use.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub kind: Kind,
    pub role: Role,
    pub offset: f64,
    pub scale: f64,
    pub jitter: f64,
}

/// Bounds of log10 σ_f² where it is estimated, on targets scaled to order one. A linear response with the longest
/// length scales allowed needs about 10²; a constant one is served by the lower end.
const LOG10_VARIANCE: (f64, f64) = (-3.0, 3.0);

/// Descents within this much of the best log likelihood count as agreeing.
const AGREEMENT: f64 = 1e-4;

impl Frame {
    /// The paper's form; stochastic kriging estimates mean and σ_f and has a kernel of its own.
    fn form(&self, reading: &Reading) -> Form {
        match self.kind {
            Kind::Sk => Form { trend: Trend::Constant, kernel: reading.kernel },
            Kind::Ibm | Kind::Rbm => Form::PAPER,
        }
    }

    fn search(&self, options: &Options) -> LikelihoodSearch {
        let estimated = Variance::Estimated { lower: LOG10_VARIANCE.0, upper: LOG10_VARIANCE.1 };
        let variance = if self.kind == Kind::Sk { estimated } else { Variance::Fixed(1.0) };
        let same = |record: &&_| is_predecessor(record, self.kind, self.role);
        let warm = options.warm.iter().filter(same).map(|record| warm_start(record, variance)).collect();
        let (seed, number, refined) = (options.seed, options.starts, options.refined);
        LikelihoodSearch { log10_a: options.log10_a, variance, starts: Starts { seed, number, refined, warm } }
    }
}

fn is_predecessor(record: &PartRecord, kind: Kind, role: Role) -> bool {
    record.kind == kind && record.role == role
}

fn warm_start(record: &PartRecord, variance: Variance) -> Vec<f64> {
    let mut start = record.log10_a.clone();
    if matches!(variance, Variance::Estimated { .. }) {
        start.push(libm::log10(record.variance));
    }
    start
}

impl Part {
    /// Chooses the hyperparameters by likelihood; `training` is made for a given jitter, which grows where it must.
    pub(super) fn fit(
        frame: Frame,
        options: &Options,
        training: impl Fn(f64) -> TrainingSet,
    ) -> Result<Self, MetamodelError> {
        let (search, form) = (frame.search(options), frame.form(&options.reading));
        let attempt = |jitter| maximise_likelihood(training(jitter), form, &search).map_err(tried(jitter));
        let (found, jitter) = options.jitter.escalate(attempt)?;
        let hyper = found.process.hyperparameters();
        let record = PartRecord {
            kind: frame.kind,
            role: frame.role,
            reading: options.reading,
            offset: frame.offset,
            scale: frame.scale,
            jitter,
            log10_a: hyper.log10_a.clone(),
            variance: hyper.variance,
            beta: found.process.beta(),
            log_likelihood: found.process.log_likelihood(),
            at_bound: found.search.best.active[..hyper.log10_a.len()].to_vec(),
            descents: found.search.minima.len(),
            agreeing: found.search.agreeing(AGREEMENT),
        };
        Ok(Self { process: found.process, record })
    }

    /// The process that `record` describes, on the same training set.
    pub(super) fn restore(record: &PartRecord, training: TrainingSet) -> Result<Self, MetamodelError> {
        let hyper = Hyperparameters { log10_a: record.log10_a.clone(), variance: record.variance };
        let process = GaussianProcess::new(training, hyper, record.frame().form(&record.reading))
            .map_err(tried(record.jitter))?;
        Ok(Self { process, record: record.clone() })
    }

    /// The underlying process, in scaled units.
    pub fn process(&self) -> &GaussianProcess {
        &self.process
    }

    /// What is to be stored of it.
    pub fn record(&self) -> &PartRecord {
        &self.record
    }

    /// Mean at `x`, in the unit of the observed quantity.
    pub fn mean(&self, x: &[f64]) -> f64 {
        self.record.offset + self.record.scale * self.process.mean(x)
    }

    /// Mean at `x` with its gradient, in the unit of the observed quantity.
    pub(super) fn mean_with_gradient(&self, x: &[f64]) -> Differentiable {
        let (mean, gradient) = self.process.mean_with_gradient(x);
        let PartRecord { offset, scale, .. } = self.record;
        Differentiable {
            value: offset + scale * mean,
            gradient: gradient.into_iter().map(|slope| scale * slope).collect(),
        }
    }

    /// Latent variance at `x`, in the square of the unit of the observed quantity.
    pub(super) fn variance(&self, x: &[f64]) -> f64 {
        self.record.scale * self.record.scale * self.process.variance(x)
    }

    /// Mean and latent variance at `x` with gradients, in the unit of the observed quantity and its square.
    pub(super) fn predict(&self, x: &[f64]) -> (Differentiable, Differentiable) {
        let (latent, scale) = (self.process.predict(x), self.record.scale);
        let times = |factor: f64, gradient: Vec<f64>| gradient.into_iter().map(|slope| factor * slope).collect();
        let mean = Differentiable {
            value: self.record.offset + scale * latent.mean,
            gradient: times(scale, latent.mean_gradient),
        };
        let variance = Differentiable {
            value: scale * scale * latent.variance,
            gradient: times(scale * scale, latent.variance_gradient),
        };
        (mean, variance)
    }

    /// Standard deviation of the uncertainty of every slope at `x`, in the unit of the observed quantity.
    pub(super) fn slope_sd(&self, x: &[f64]) -> Vec<f64> {
        let variances = self.process.gradient_variance(x);
        variances.into_iter().map(|variance| self.record.scale.abs() * variance.sqrt()).collect()
    }

    /// Standard deviation of the uncertainty of the difference between `x` and `y`, in the unit of the observed quantity.
    pub(super) fn difference_sd(&self, x: &[f64], y: &[f64]) -> f64 {
        self.record.scale.abs() * self.process.difference_variance(x, y).sqrt()
    }

    /// Leave-one-out mean and sd at each training point, in the unit of the observed quantity.
    pub(super) fn leave_one_out(&self) -> Vec<(f64, f64)> {
        let PartRecord { offset, scale, .. } = self.record;
        let unscaled = |(mean, variance): (f64, f64)| (offset + scale * mean, scale.abs() * variance.sqrt());
        self.process.leave_one_out().into_iter().map(unscaled).collect()
    }
}

impl PartRecord {
    pub(super) fn frame(&self) -> Frame {
        Frame { kind: self.kind, role: self.role, offset: self.offset, scale: self.scale, jitter: self.jitter }
    }
}

/// Writes the jitter that was tried into a failure.
fn tried(jitter: f64) -> impl Fn(LinalgError) -> LinalgError {
    move |LinalgError::NotPositiveDefinite { size, .. }| LinalgError::NotPositiveDefinite { size, jitter }
}

/// √variance with its gradient; a vanishing variance has none.
pub(super) fn square_root(variance: &Differentiable) -> Differentiable {
    let value = variance.value.sqrt();
    let slope = |slope: &f64| if value > 0.0 { 0.5 * slope / value } else { 0.0 };
    Differentiable { value, gradient: variance.gradient.iter().map(slope).collect() }
}
