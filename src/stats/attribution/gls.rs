//! Generalised least squares: the parameters of a model whose predictions have a full covariance.
//!
//! Takes a function that gives f(θ) and J(θ), the data with Σ, and parameters with bounds and priors; gives θ̂ with its
//! covariance. Levenberg and Marquardt's damping on the whitened problem; bounds by an active set inside each step.
//! Finds the minimum near its start: starting from many points, and choosing Σ, are the caller's business.

use super::geometry::{whiten, whiten_vector};
use super::{AttributionError, Parameter, check};
use nalgebra::{DMatrix, DVector};

/// Relative singular value below which a direction of the parameters is not determined at all.
const RANK_TOLERANCE: f64 = 1e-12;
/// Largest damping tried before a step counts as impossible.
const LARGEST_DAMPING: f64 = 1e12;

/// A bound of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The lower one.
    Lower,
    /// The upper one.
    Upper,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlsOptions {
    /// Largest number of accepted steps (100).
    pub max_iterations: usize,
    /// Step, relative to the width of the bounds, below which the fit has converged (1e-9).
    pub tolerance: f64,
}

impl Default for GlsOptions {
    fn default() -> Self {
        Self { max_iterations: 100, tolerance: 1e-9 }
    }
}

/// Result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct GlsFit {
    /// θ̂ (p).
    pub parameters: DVector<f64>,
    /// Covariance of θ̂ (p × p): (J̃ᵀJ̃)⁻¹ over the parameters that are not held by a bound, zero for those that are.
    /// Directions that the data do not determine are left out; `condition` is infinite then.
    pub covariance: DMatrix<f64>,
    /// Sum of squares of the whitened residual, priors included.
    pub chi2: f64,
    /// Rows (priors included) minus free parameters; negative if there are too few rows.
    pub dof: isize,
    /// Which bound holds each parameter, pressing outwards.
    pub at_bound: Vec<Option<Bound>>,
    /// Condition number of J̃ with columns per width of the bounds, free parameters only.
    pub condition: f64,
    /// y − f(θ̂) (m).
    pub residual: DVector<f64>,
    /// J at θ̂ (m × p).
    pub jacobian: DMatrix<f64>,
    /// Accepted steps.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
}

/// Minimises (y − f)ᵀΣ⁻¹(y − f) + Σ (θ − prior)²/sd² within the bounds, from `parameters[..].value`.
///
/// # Errors
/// [`AttributionError`] if sizes disagree, a value is not finite, bounds are reversed or Σ is not positive definite.
pub fn gls_fit(
    model: impl Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
    data: &DVector<f64>,
    covariance: &DMatrix<f64>,
    parameters: &[Parameter],
    options: &GlsOptions,
) -> Result<GlsFit, AttributionError> {
    let fit = Fit::new(model, data, covariance, parameters)?;
    let start = DVector::from_fn(parameters.len(), |i, _| fit.inside(i, parameters[i].value));
    let mut state = fit.state(start)?;
    let (mut iterations, mut converged) = (0, false);
    while iterations < options.max_iterations && !converged {
        let Some((next, step)) = fit.improve(&state)? else {
            converged = true;
            break;
        };
        iterations += 1;
        converged = step < options.tolerance;
        state = next;
    }
    Ok(fit.finish(state, iterations, converged))
}

/// The fixed parts of a fit. Parameters are measured in widths of their bounds inside.
struct Fit<'a, M> {
    model: M,
    data: &'a DVector<f64>,
    factor: DMatrix<f64>,
    parameters: &'a [Parameter],
}

/// A point of the search.
struct State {
    theta: DVector<f64>,
    residual: DVector<f64>,
    jacobian: DMatrix<f64>,
    white_residual: DVector<f64>,
    tangent: DMatrix<f64>,
    chi2: f64,
}

impl<'a, M: Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>)> Fit<'a, M> {
    fn new(
        model: M,
        data: &'a DVector<f64>,
        covariance: &DMatrix<f64>,
        parameters: &'a [Parameter],
    ) -> Result<Self, AttributionError> {
        let m = data.len();
        check("the data", data.shape(), (m, 1), data.iter())?;
        check("the covariance", covariance.shape(), (m, m), covariance.iter())?;
        parameters.iter().try_for_each(Parameter::validate)?;
        let not_definite = || AttributionError::NotPositiveDefinite("the covariance".into());
        let factor = covariance.clone().cholesky().ok_or_else(not_definite)?.l();
        Ok(Self { model, data, factor, parameters })
    }

    fn width(&self, i: usize) -> f64 {
        self.parameters[i].upper - self.parameters[i].lower
    }

    fn inside(&self, i: usize, value: f64) -> f64 {
        value.clamp(self.parameters[i].lower, self.parameters[i].upper)
    }

    fn state(&self, theta: DVector<f64>) -> Result<State, AttributionError> {
        let (predicted, jacobian) = (self.model)(&theta);
        let (m, p) = (self.data.len(), self.parameters.len());
        check("the model's prediction", predicted.shape(), (m, 1), predicted.iter())?;
        check("the model's sensitivity", jacobian.shape(), (m, p), jacobian.iter())?;
        let residual = self.data - predicted;
        let priors: Vec<(usize, f64, f64)> = self
            .parameters
            .iter()
            .enumerate()
            .filter_map(|(i, parameter)| parameter.prior.map(|prior| (i, prior.mean, prior.sd)))
            .collect();
        let scaled = DMatrix::from_fn(m, p, |i, j| jacobian[(i, j)] * self.width(j));
        let data_tangent = whiten(&self.factor, &scaled);
        let data_residual = whiten_vector(&self.factor, residual.as_slice());
        let rows = m + priors.len();
        let white_residual = DVector::from_fn(rows, |i, _| {
            if i < m { data_residual[i] } else { (priors[i - m].1 - theta[priors[i - m].0]) / priors[i - m].2 }
        });
        let tangent = DMatrix::from_fn(rows, p, |i, j| {
            if i < m {
                data_tangent[(i, j)]
            } else if priors[i - m].0 == j {
                self.width(j) / priors[i - m].2
            } else {
                0.0
            }
        });
        let chi2 = white_residual.norm_squared();
        Ok(State { theta, residual, jacobian, white_residual, tangent, chi2 })
    }

    /// A point with a smaller sum of squares and the size of the step to it; `None` at a minimum.
    fn improve(&self, state: &State) -> Result<Option<(State, f64)>, AttributionError> {
        let mut damping = 0.0;
        while damping < LARGEST_DAMPING {
            let theta = self.step(state, damping);
            let change = (0..theta.len()).map(|i| (theta[i] - state.theta[i]).abs() / self.width(i));
            let size = change.fold(0.0, f64::max);
            if size == 0.0 {
                return Ok(None);
            }
            let next = self.state(theta)?;
            if next.chi2 < state.chi2 {
                return Ok(Some((next, size)));
            }
            damping = if damping == 0.0 { 1e-3 } else { 10.0 * damping };
        }
        Ok(None)
    }

    /// Damped Gauss–Newton step within the bounds: what would leave is set on its bound and the rest solved again.
    fn step(&self, state: &State, damping: f64) -> DVector<f64> {
        let p = self.parameters.len();
        let pressing = self.pressing(state);
        let mut fixed: Vec<Option<f64>> = pressing.iter().map(|bound| bound.map(|_| 0.0)).collect();
        loop {
            let free: Vec<usize> = (0..p).filter(|i| fixed[*i].is_none()).collect();
            let moved = DVector::from_fn(p, |i, _| fixed[i].unwrap_or(0.0));
            let solution = solve(state, &free, &moved, damping);
            let mut step = moved;
            free.iter().zip(solution.iter()).for_each(|(i, value)| step[*i] = *value);
            let target = |i: usize| state.theta[i] + step[i] * self.width(i);
            let outside = |i: &usize| self.inside(*i, target(*i)) != target(*i);
            let Some(leaves) = free.iter().copied().find(outside) else {
                return DVector::from_fn(p, |i, _| self.inside(i, target(i)));
            };
            let bound = self.inside(leaves, target(leaves));
            fixed[leaves] = Some((bound - state.theta[leaves]) / self.width(leaves));
        }
    }

    /// Parameters on a bound whose improvement points outwards.
    fn pressing(&self, state: &State) -> Vec<Option<Bound>> {
        let downhill = state.tangent.tr_mul(&state.white_residual);
        let bound = |(i, parameter): (usize, &Parameter)| {
            if state.theta[i] <= parameter.lower && downhill[i] < 0.0 {
                Some(Bound::Lower)
            } else if state.theta[i] >= parameter.upper && downhill[i] > 0.0 {
                Some(Bound::Upper)
            } else {
                None
            }
        };
        self.parameters.iter().enumerate().map(bound).collect()
    }

    fn finish(&self, state: State, iterations: usize, converged: bool) -> GlsFit {
        let at_bound = self.pressing(&state);
        let free: Vec<usize> = (0..at_bound.len()).filter(|i| at_bound[*i].is_none()).collect();
        let (inverse, condition) = normal_inverse(&state.tangent.select_columns(&free));
        let mut covariance = DMatrix::zeros(at_bound.len(), at_bound.len());
        for (a, i) in free.iter().enumerate() {
            for (b, j) in free.iter().enumerate() {
                covariance[(*i, *j)] = inverse[(a, b)] * self.width(*i) * self.width(*j);
            }
        }
        GlsFit {
            dof: state.white_residual.len() as isize - free.len() as isize,
            parameters: state.theta,
            covariance,
            chi2: state.chi2,
            at_bound,
            condition,
            residual: state.residual,
            jacobian: state.jacobian,
            iterations,
            converged,
        }
    }
}

/// Solves (JᵀJ + damping·diag JᵀJ)δ = Jᵀ(r − J·moved) over the free columns.
fn solve(state: &State, free: &[usize], moved: &DVector<f64>, damping: f64) -> DVector<f64> {
    let tangent = state.tangent.select_columns(free);
    let target = &state.white_residual - &state.tangent * moved;
    let (rows, p) = tangent.shape();
    let norms: Vec<f64> = tangent.column_iter().map(|column| column.norm()).collect();
    // Damping as extra rows keeps the condition number instead of squaring it.
    let damped = DMatrix::from_fn(rows + p, p, |i, j| {
        if i < rows {
            tangent[(i, j)]
        } else if i - rows == j {
            damping.sqrt() * norms[j]
        } else {
            0.0
        }
    });
    let padded = DVector::from_fn(rows + p, |i, _| if i < rows { target[i] } else { 0.0 });
    if p == 0 {
        return DVector::zeros(0);
    }
    let svd = damped.svd(true, true);
    let floor = RANK_TOLERANCE * svd.singular_values.max();
    svd.solve(&padded, floor).unwrap_or_else(|_| DVector::zeros(p))
}

/// (JᵀJ)⁻¹ over the determined directions, and the condition number of J.
fn normal_inverse(tangent: &DMatrix<f64>) -> (DMatrix<f64>, f64) {
    if tangent.ncols() == 0 {
        return (DMatrix::zeros(0, 0), 1.0);
    }
    let svd = tangent.clone().svd(false, true);
    let (largest, p) = (svd.singular_values.max(), tangent.ncols());
    let determined = |value: f64| value > RANK_TOLERANCE * largest;
    let rank = svd.singular_values.iter().filter(|value| determined(**value)).count();
    let smallest = if rank < p { 0.0 } else { svd.singular_values.min() };
    let inverse_squares = svd.singular_values.map(|value| if determined(value) { 1.0 / (value * value) } else { 0.0 });
    let covariance = svd
        .v_t
        .map_or_else(|| DMatrix::zeros(p, p), |vt| vt.transpose() * DMatrix::from_diagonal(&inverse_squares) * vt);
    (covariance, largest / smallest)
}
