//! Gaussian process regression with known noise at every point.
//!
//! Model: y_i = β + f(x_i) + ε_i, f ~ GP(0, σ_f² k(Σ_d a_d (x_d − x'_d)²)) with one of the correlation functions k of
//! [`kernel`], ε_i ~ N(0, v_i) independent (Fransen et al. 2022, eqs 4–9, where k is the squared exponential, β = 0 and
//! σ_f = 1; Rasmussen & Williams 2006, chapters 2 and 5; Ankenman, Nelson & Staum 2010 for the case v_i =
//! variance / repetitions). Points live in the unit cube.
//! Takes points, targets and noise variances; gives predictions with gradients, leave-one-out values and, in
//! [`likelihood`], the most likely hyperparameters. Deliberately knows nothing of KPIs and of how noise comes about.

pub mod kernel;
pub mod likelihood;

use super::kernels::{apply, apply_to_both, squared_distances, weighted_differences};
use super::linalg::{LinalgError, SpdFactor, dot};
use super::points::Points;
use kernel::Kernel;

/// What a Gaussian process is trained on.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    /// Points in the unit cube, shape (n_points, n_parameters).
    pub points: Points,
    /// Value at each point.
    pub targets: Vec<f64>,
    /// Variance v_i ≥ 0 of the error of each value, in squared units of the targets. Jitter is part of it.
    pub noise: Vec<f64>,
}

/// The mean function β.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trend {
    /// β = 0, known.
    Zero,
    /// β constant and estimated by generalised least squares (ordinary kriging).
    Constant,
}

/// What is assumed of a process before it sees data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Form {
    /// Mean function.
    pub trend: Trend,
    /// Correlation function.
    pub kernel: Kernel,
}

impl Form {
    /// The paper's: zero mean, squared exponential.
    pub const PAPER: Self = Self { trend: Trend::Zero, kernel: Kernel::SquaredExponential };
}

/// What likelihood maximisation chooses.
#[derive(Debug, Clone, PartialEq)]
pub struct Hyperparameters {
    /// Decimal logarithm of the inverse squared length scale a_d of each parameter.
    pub log10_a: Vec<f64>,
    /// Process variance σ_f², in squared units of the targets.
    pub variance: f64,
}

impl Hyperparameters {
    /// a_d = 10^(log10 a_d).
    pub fn inverse_squared_lengths(&self) -> Vec<f64> {
        self.log10_a.iter().map(|&exponent| libm::exp10(exponent)).collect()
    }
}

/// A trained Gaussian process.
#[derive(Debug, Clone)]
pub struct GaussianProcess {
    training: TrainingSet,
    /// Coordinates of the points, one parameter after the other.
    columns: Vec<f64>,
    hyper: Hyperparameters,
    a: Vec<f64>,
    form: Form,
    fit: Conditioned,
}

/// The training data conditioned on: K = L Lᵀ and what follows from it.
#[derive(Debug, Clone)]
struct Conditioned {
    factor: SpdFactor,
    /// β̂, 0 where the trend is zero.
    beta: f64,
    /// K⁻¹ (y − β̂).
    alpha: Vec<f64>,
    /// K⁻¹ 1, empty where the trend is zero.
    weights: Vec<f64>,
    log_likelihood: f64,
}

/// Prediction of the latent f at one point, without the noise of an observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Latent {
    /// E f(x), eq. 8.
    pub mean: f64,
    /// Var f(x), eq. 9, with the share of an estimated β; never negative.
    pub variance: f64,
    /// ∂ mean / ∂x_d.
    pub mean_gradient: Vec<f64>,
    /// ∂ variance / ∂x_d.
    pub variance_gradient: Vec<f64>,
}

impl GaussianProcess {
    /// Conditions the process on `training` with given hyperparameters.
    ///
    /// # Errors
    /// [`LinalgError`] where the covariance cannot be factorised.
    ///
    /// # Panics
    /// If points, targets, noise and hyperparameters disagree in number.
    pub fn new(training: TrainingSet, hyper: Hyperparameters, form: Form) -> Result<Self, LinalgError> {
        assert_eq!(hyper.log10_a.len(), training.points.dimension(), "one length scale per parameter");
        let likelihood = likelihood::Likelihood::new(&training, form);
        let fit = likelihood.condition(&hyper)?;
        Ok(Self { columns: training.points.columns(), training, a: hyper.inverse_squared_lengths(), hyper, form, fit })
    }

    /// Data the process was conditioned on.
    pub fn training(&self) -> &TrainingSet {
        &self.training
    }

    /// Hyperparameters in use.
    pub fn hyperparameters(&self) -> &Hyperparameters {
        &self.hyper
    }

    /// Mean and correlation function in use.
    pub fn form(&self) -> Form {
        self.form
    }

    /// β̂, in units of the targets.
    pub fn beta(&self) -> f64 {
        self.fit.beta
    }

    /// ln p(y | X) = −½ (y − β̂)ᵀK⁻¹(y − β̂) − ½ ln det K − (n/2) ln 2π (eq. 7).
    pub fn log_likelihood(&self) -> f64 {
        self.fit.log_likelihood
    }

    /// σ_f² k(x, p_j) of points p_j whose coordinates stand one parameter after the other.
    pub fn covariances_with(&self, columns: &[f64], x: &[f64]) -> Vec<f64> {
        let mut covariances = squared_distances(columns, x, &self.a);
        self.form.kernel.correlate(&mut covariances);
        apply(&mut covariances, |value| value * self.hyper.variance);
        covariances
    }

    /// σ_f² k(x, x_j) for every training point.
    fn covariances(&self, x: &[f64]) -> Vec<f64> {
        self.covariances_with(&self.columns, x)
    }

    /// The same and h = −2 σ_f² dk/ds, of which slopes are made.
    fn covariances_and_slopes(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut covariances = squared_distances(&self.columns, x, &self.a);
        let mut slopes = self.form.kernel.correlate_with_steepness(&mut covariances);
        apply_to_both(&mut covariances, &mut slopes, |value, steepness| {
            let value = value * self.hyper.variance;
            (value, value * steepness)
        });
        (covariances, slopes)
    }

    /// Σ_j weights_j ∂k(x, x_j)/∂x_d for every d, with ∂k_j/∂x_d = −a_d (x_d − x_jd) h_j.
    fn slopes(&self, x: &[f64], h: &[f64], weights: &[f64]) -> Vec<f64> {
        let sums = weighted_differences(&self.columns, x, weights, h);
        sums.iter().zip(&self.a).map(|(sum, a)| -a * sum).collect()
    }

    /// E f(x) alone, eq. 8: a tenth of the work of [`GaussianProcess::predict`].
    pub fn mean(&self, x: &[f64]) -> f64 {
        self.fit.beta + dot(&self.covariances(x), &self.fit.alpha)
    }

    /// E f(x) and its gradient, eq. 8: also a small part of the work of [`GaussianProcess::predict`].
    pub fn mean_with_gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let (k, h) = self.covariances_and_slopes(x);
        (self.fit.beta + dot(&k, &self.fit.alpha), self.slopes(x, &h, &self.fit.alpha))
    }

    /// Var f(x) alone, eq. 9: half of the work of [`GaussianProcess::predict`].
    pub fn variance(&self, x: &[f64]) -> f64 {
        let k = self.covariances(x);
        self.variance_of(&self.fit.factor.half_solve(&k), self.trend_gap(&k))
    }

    /// σ_f² − kᵀK⁻¹k from L⁻¹k, with the share of an estimated β.
    fn variance_of(&self, half: &[f64], (gap, information): (f64, f64)) -> f64 {
        let trend = if information > 0.0 { gap * gap / information } else { 0.0 };
        (self.hyper.variance - dot(half, half) + trend).max(0.0)
    }

    /// Var[f(x) − f(y)] = 2σ_f²(1 − k(x, y)) − (k_x − k_y)ᵀK⁻¹(k_x − k_y), with the share of an estimated β: less than the sum of
    /// both variances where their errors go together.
    pub fn difference_variance(&self, x: &[f64], y: &[f64]) -> f64 {
        let prior = 2.0 * (self.hyper.variance - self.covariances_with(y, x)[0]);
        let [at_x, at_y] = [x, y].map(|place| self.covariances(place));
        let apart: Vec<f64> = at_x.iter().zip(&at_y).map(|(x, y)| x - y).collect();
        let half = self.fit.factor.half_solve(&apart);
        let ((gap_x, information), (gap_y, _)) = (self.trend_gap(&at_x), self.trend_gap(&at_y));
        let trend = if information > 0.0 { (gap_x - gap_y) * (gap_x - gap_y) / information } else { 0.0 };
        (prior - dot(&half, &half) + trend).max(0.0)
    }

    /// Mean and variance of the latent f at `x`, with their gradients.
    pub fn predict(&self, x: &[f64]) -> Latent {
        let (k, h) = self.covariances_and_slopes(x);
        let half = self.fit.factor.half_solve(&k);
        let solved = self.fit.factor.transposed_half_solve(&half);
        let (gap, information) = self.trend_gap(&k);
        let of_solved = self.slopes(x, &h, &solved);
        let of_trend = if information > 0.0 { self.slopes(x, &h, &self.fit.weights) } else { vec![0.0; x.len()] };
        let trend = |slope: f64| if information > 0.0 { gap * slope / information } else { 0.0 };
        Latent {
            mean: self.fit.beta + dot(&k, &self.fit.alpha),
            variance: self.variance_of(&half, (gap, information)),
            mean_gradient: self.slopes(x, &h, &self.fit.alpha),
            variance_gradient: of_solved.iter().zip(of_trend).map(|(s, t)| -2.0 * (s + trend(t))).collect(),
        }
    }

    /// Var ∂f/∂x_d, shape (n_parameters): h(0) a_d σ_f² − (∂k/∂x_d)ᵀK⁻¹(∂k/∂x_d), with the share of an estimated β (the
    /// derivative of a Gaussian process is one: Rasmussen & Williams 2006, section 9.4).
    pub fn gradient_variance(&self, x: &[f64]) -> Vec<f64> {
        let (k, h) = self.covariances_and_slopes(x);
        let (_, information) = self.trend_gap(&k);
        let prior = self.form.kernel.correlate_with_steepness(&mut [0.0])[0] * self.hyper.variance;
        let one = |d: usize| {
            let slope = |(j, h): (usize, &f64)| -self.a[d] * (x[d] - self.training.points.row(j)[d]) * h;
            let slopes: Vec<f64> = h.iter().enumerate().map(slope).collect();
            let half = self.fit.factor.half_solve(&slopes);
            let gap = if information > 0.0 { dot(&self.fit.weights, &slopes) } else { 0.0 };
            let trend = if information > 0.0 { gap * gap / information } else { 0.0 };
            (self.a[d] * prior - dot(&half, &half) + trend).max(0.0)
        };
        (0..x.len()).map(one).collect()
    }

    /// u = 1 − 1ᵀK⁻¹k and 1ᵀK⁻¹1, whose u²/(1ᵀK⁻¹1) is the variance that an estimated β adds; (0, 0) without one.
    fn trend_gap(&self, k: &[f64]) -> (f64, f64) {
        match self.form.trend {
            Trend::Zero => (0.0, 0.0),
            Trend::Constant => (1.0 - dot(&self.fit.weights, k), self.fit.weights.iter().sum()),
        }
    }

    /// Mean and latent variance at each training point from all others, hyperparameters held.
    ///
    /// With Q = K⁻¹ − K⁻¹11ᵀK⁻¹/(1ᵀK⁻¹1) (Q = K⁻¹ for zero trend): mean_i = y_i − (Qy)_i/Q_ii,
    /// variance_i = 1/Q_ii − v_i (Dubrule 1983).
    pub fn leave_one_out(&self) -> Vec<(f64, f64)> {
        let inverse = self.fit.factor.inverse();
        let total: f64 = self.fit.weights.iter().sum();
        let one = |i: usize| {
            let share = self.fit.weights.get(i).map_or(0.0, |weight| weight * weight / total);
            let precision = inverse[(i, i)] - share;
            let mean = self.training.targets[i] - self.fit.alpha[i] / precision;
            (mean, (1.0 / precision - self.training.noise[i]).max(0.0))
        };
        (0..self.training.targets.len()).map(one).collect()
    }
}

/// Log likelihood of all single runs, from that of the means: the Woodbury identity for replicated points.
///
/// ln p(runs) = ln p(means; v_i = V_i/n_i) + Σ_i [−½(n_i − 1) ln 2πV_i − ½ ln n_i − (n_i − 1) s_i²/(2V_i)] with
/// V_i the variance of one run at point i, s_i² the observed one and n_i the number of runs (Binois, Gramacy &
/// Ludkovski 2018, section 3). Makes models with different variance functions comparable.
pub fn log_likelihood_of_runs(of_means: f64, variances: &[f64], observed: &[f64], counts: &[usize]) -> f64 {
    let within = |((&variance, &observed), &count): ((&f64, &f64), &usize)| {
        let dof = count as f64 - 1.0;
        let spread =
            if count > 1 { observed / variance + libm::log(2.0 * std::f64::consts::PI * variance) } else { 0.0 };
        -0.5 * (dof * spread + libm::log(count as f64))
    };
    of_means + variances.iter().zip(observed).zip(counts).map(within).sum::<f64>()
}

#[cfg(test)]
mod tests;
