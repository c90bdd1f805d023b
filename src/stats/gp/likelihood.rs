//! The log marginal likelihood of a Gaussian process as a function of its hyperparameters, and its maximum.
//!
//! Squared coordinate differences are computed once; one evaluation costs a Cholesky factorisation, one gradient
//! also an inverse. Where β is estimated the likelihood is that at β̂; its gradient needs no extra term, because the
//! derivative with respect to β vanishes there.

use super::{Conditioned, Form, GaussianProcess, Hyperparameters, TrainingSet, Trend};
use crate::stats::linalg::{LinalgError, SpdFactor, dot};
use crate::stats::optimise::{Bounds, Objective, Search, Starts, Stopping, multi_start};
use nalgebra::DMatrix;
use std::f64::consts::{LN_10, PI};

/// Whether the process variance σ_f² is known or chosen by likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Variance {
    /// σ_f² is given, in squared units of the targets.
    Fixed(f64),
    /// log10 σ_f² is sought within these bounds.
    Estimated {
        /// Lower bound of log10 σ_f².
        lower: f64,
        /// Upper bound of log10 σ_f².
        upper: f64,
    },
}

/// How the most likely hyperparameters are sought.
#[derive(Debug, Clone, PartialEq)]
pub struct LikelihoodSearch {
    /// Bounds of every log10 a_d; the paper's "[−1, 1]³".
    pub log10_a: (f64, f64),
    /// Process variance.
    pub variance: Variance,
    /// Starts; a warm start holds log10 a, then log10 σ_f² where that is estimated.
    pub starts: Starts,
}

/// The likelihood of one training set, ready for many evaluations.
pub struct Likelihood<'a> {
    training: &'a TrainingSet,
    form: Form,
    /// Per parameter the squared differences of all pairs i > j, column after column.
    squares: Vec<Vec<f64>>,
}

impl<'a> Likelihood<'a> {
    /// Prepares the likelihood of `training`.
    ///
    /// # Panics
    /// If points, targets and noise disagree in number.
    pub fn new(training: &'a TrainingSet, form: Form) -> Self {
        let (points, n) = (&training.points, training.points.len());
        assert!(n == training.targets.len() && n == training.noise.len(), "one target and noise per point");
        let square = |d: usize, i: usize, j: usize| {
            let difference = points.row(i)[d] - points.row(j)[d];
            difference * difference
        };
        let pairs = || (0..n).flat_map(|j| (j + 1..n).map(move |i| (i, j)));
        let of_parameter = |d: usize| pairs().map(|(i, j)| square(d, i, j)).collect();
        Self { training, form, squares: (0..points.dimension()).map(of_parameter).collect() }
    }

    /// −½ Σ_d a_d (Δ_d)² of all pairs i > j, column after column.
    fn exponents(&self, hyper: &Hyperparameters) -> Vec<f64> {
        let n = self.training.targets.len();
        let mut exponents = vec![0.0; n * n.saturating_sub(1) / 2];
        for (a, squares) in hyper.inverse_squared_lengths().into_iter().zip(&self.squares) {
            for (exponent, square) in exponents.iter_mut().zip(squares) {
                *exponent -= 0.5 * a * square;
            }
        }
        exponents
    }

    /// k(x_i, x_j) of all pairs i > j, column after column.
    fn correlations(&self, hyper: &Hyperparameters) -> Vec<f64> {
        let mut correlations = self.exponents(hyper);
        self.form.kernel.correlate(&mut correlations);
        correlations
    }

    /// K = σ_f² C + diag(v), lower triangle.
    fn covariance(&self, correlations: &[f64], variance: f64) -> DMatrix<f64> {
        let n = self.training.targets.len();
        let mut matrix = DMatrix::zeros(n, n);
        let mut rest = correlations;
        for (j, column) in matrix.as_mut_slice().chunks_exact_mut(n).enumerate() {
            let (here, later) = rest.split_at(n - 1 - j);
            column[j] = variance + self.training.noise[j];
            column[j + 1..].iter_mut().zip(here).for_each(|(entry, correlation)| *entry = variance * correlation);
            rest = later;
        }
        matrix
    }

    /// Conditions the process on the data.
    pub(super) fn condition(&self, hyper: &Hyperparameters) -> Result<Conditioned, LinalgError> {
        self.condition_with(&self.correlations(hyper), hyper.variance)
    }

    fn condition_with(&self, correlations: &[f64], variance: f64) -> Result<Conditioned, LinalgError> {
        let factor = SpdFactor::new(self.covariance(correlations, variance))?;
        let n = self.training.targets.len();
        let mut residual = factor.half_solve(&self.training.targets);
        let (mut beta, mut weights) = (0.0, Vec::new());
        if self.form.trend == Trend::Constant {
            let ones = factor.half_solve(&vec![1.0; n]);
            beta = dot(&ones, &residual) / dot(&ones, &ones);
            residual.iter_mut().zip(&ones).for_each(|(value, one)| *value -= beta * one);
            weights = factor.transposed_half_solve(&ones);
        }
        let log_likelihood = -0.5 * (dot(&residual, &residual) + factor.log_det() + n as f64 * libm::log(2.0 * PI));
        let alpha = factor.transposed_half_solve(&residual);
        Ok(Conditioned { factor, beta, alpha, weights, log_likelihood })
    }

    /// ln p(y | X); −∞ where the covariance cannot be factorised.
    pub fn value(&self, hyper: &Hyperparameters) -> f64 {
        self.condition(hyper).map_or(f64::NEG_INFINITY, |fit| fit.log_likelihood)
    }

    /// ln p(y | X) and its derivatives with respect to log10 a_1 … log10 a_p, log10 σ_f².
    ///
    /// ∂/∂t = ½ tr((ααᵀ − K⁻¹) ∂K/∂t), ∂K/∂log10 a_d = −½ ln10 a_d (Δ_d)² σ_f² H, ∂K/∂log10 σ_f² = ln10 σ_f² C, where
    /// H = −2 dC/ds is C itself for the squared exponential.
    pub fn value_and_gradient(&self, hyper: &Hyperparameters) -> (f64, Vec<f64>) {
        let kernel = self.form.kernel;
        let mut correlations = self.exponents(hyper);
        let mut slopes = kernel.correlate_with_steepness(&mut correlations);
        let Ok(fit) = self.condition_with(&correlations, hyper.variance) else {
            return (f64::NEG_INFINITY, vec![0.0; hyper.log10_a.len() + 1]);
        };
        let inverse = fit.factor.inverse();
        let diagonal = fit.alpha.iter().enumerate().map(|(i, alpha)| alpha * alpha - inverse[(i, i)]);
        let diagonal: f64 = diagonal.sum();
        weigh(&mut correlations, &fit.alpha, inverse.as_slice());
        slopes.iter_mut().zip(&correlations).for_each(|(slope, weighed)| *slope *= weighed);
        let lengths = hyper.inverse_squared_lengths().into_iter().zip(&self.squares);
        let mut gradient: Vec<f64> =
            lengths.map(|(a, squares)| -0.5 * LN_10 * a * hyper.variance * dot(&slopes, squares)).collect();
        let pairs: f64 = correlations.iter().sum();
        gradient.push(LN_10 * hyper.variance * (pairs + 0.5 * diagonal));
        (fit.log_likelihood, gradient)
    }
}

/// Turns C_ij of all pairs i > j into (α_i α_j − K⁻¹_ij) C_ij.
fn weigh(correlations: &mut [f64], alpha: &[f64], inverse: &[f64]) {
    let (n, mut rest) = (alpha.len(), correlations);
    for j in 0..n {
        let (here, later) = rest.split_at_mut(n - 1 - j);
        let column = &inverse[j * n + j + 1..(j + 1) * n];
        for ((entry, inverse), other) in here.iter_mut().zip(column).zip(&alpha[j + 1..]) {
            *entry *= alpha[j] * other - inverse;
        }
        rest = later;
    }
}

/// −ln p(y | X) over (log10 a, and log10 σ_f² where that is estimated).
struct NegativeLogLikelihood<'a> {
    likelihood: Likelihood<'a>,
    variance: Variance,
}

impl NegativeLogLikelihood<'_> {
    fn hyperparameters(&self, theta: &[f64]) -> Hyperparameters {
        let p = self.likelihood.squares.len();
        let variance = match self.variance {
            Variance::Fixed(variance) => variance,
            Variance::Estimated { .. } => libm::exp10(theta[p]),
        };
        Hyperparameters { log10_a: theta[..p].to_vec(), variance }
    }
}

impl Objective for NegativeLogLikelihood<'_> {
    fn dimension(&self) -> usize {
        self.likelihood.squares.len() + usize::from(matches!(self.variance, Variance::Estimated { .. }))
    }

    fn value(&self, theta: &[f64]) -> f64 {
        -self.likelihood.value(&self.hyperparameters(theta))
    }

    fn value_and_gradient(&self, theta: &[f64]) -> (f64, Vec<f64>) {
        let (value, mut gradient) = self.likelihood.value_and_gradient(&self.hyperparameters(theta));
        gradient.truncate(theta.len());
        gradient.iter_mut().for_each(|slope| *slope = -*slope);
        (-value, gradient)
    }
}

/// A process with its most likely hyperparameters, and the search that found them (values are −ln p).
#[derive(Debug, Clone)]
pub struct MostLikely {
    /// The process at the optimum.
    pub process: GaussianProcess,
    /// All descents.
    pub search: Search,
}

/// A slope of 10⁻⁵ per decade of a_d is far below what a likelihood can tell, yet fixes log10 a_d to about 10⁻⁵.
const STOPPING: Stopping = Stopping { gradient: 1e-5, decrease: 10.0 * f64::EPSILON, iterations: 400 };

/// Seeks the hyperparameters of largest likelihood within bounds and conditions the process on the data.
///
/// # Errors
/// [`LinalgError`] where the covariance could not be factorised anywhere it was tried.
pub fn maximise_likelihood(
    training: TrainingSet,
    form: Form,
    plan: &LikelihoodSearch,
) -> Result<MostLikely, LinalgError> {
    let (p, size) = (training.points.dimension(), training.targets.len());
    let mut bounds = (vec![plan.log10_a.0; p], vec![plan.log10_a.1; p]);
    if let Variance::Estimated { lower, upper } = plan.variance {
        bounds.0.push(lower);
        bounds.1.push(upper);
    }
    let objective = NegativeLogLikelihood { likelihood: Likelihood::new(&training, form), variance: plan.variance };
    let search = multi_start(&objective, &Bounds::new(bounds.0, bounds.1), &plan.starts, &STOPPING);
    if !search.best.value.is_finite() {
        return Err(LinalgError::NotPositiveDefinite { size, jitter: 0.0 });
    }
    let hyper = objective.hyperparameters(&search.best.x);
    Ok(MostLikely { process: GaussianProcess::new(training, hyper, form)?, search })
}
