//! Generalised least squares: the parameters of a model whose predictions have a full covariance.
//!
//! Takes a function that gives f(θ) and J(θ), the data with Σ, and parameters with bounds and priors; gives θ̂ with its
//! covariance. Newton's method on the whitened problem: to JᵀJ comes what Gauss and Newton leave out, the curvature of f weighed
//! by the residual, as secants tell it (NL2SOL: Dennis, Gay & Welsch 1981), since without it a fit with a large residual
//! creeps towards its minimum; Levenberg and Marquardt's damping; bounds by an active set inside each step.
//! Finds the minimum near its start: starting from many points, and choosing Σ, are the caller's business.

use super::geometry::{whiten, whiten_vector};
use super::{AttributionError, Parameter, check};
use nalgebra::{DMatrix, DVector};

/// Relative singular value below which a direction of the parameters is not determined at all.
const RANK_TOLERANCE: f64 = 1e-12;
/// Least damping that is not none: with more, a fit creeps along a valley whose sides are a hundred thousand times as steep.
const LEAST_DAMPING: f64 = 1e-5;
/// Largest damping tried before a step counts as impossible.
const LARGEST_DAMPING: f64 = 1e12;
/// Factor by which damping grows after a step that failed and shrinks after one that did not.
const DAMPING_FACTOR: f64 = 10.0;
/// Eigenvalue of the curvature, relative to the largest, below which a direction is left alone in a step.
const FLAT: f64 = 1e-14;
/// Curvature along a step, relative to that of JᵀJ, below which the change of the slope is no measure for the rest of the
/// curvature: dividing by it, one fit in a thousand crept.
const LEAST_CURVATURE: f64 = 0.5;
/// Relative change of the sum of squares that is as good as none.
const NOISE: f64 = 1e-13;

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
    /// Step, relative to the width of the bounds, below which the fit has converged (1e-9), if the sum of squares has not stopped
    /// changing before.
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
    let (mut bend, mut damping) = (DMatrix::zeros(parameters.len(), parameters.len()), 0.0);
    while iterations < options.max_iterations && !converged {
        let Some((next, used)) = fit.improve(&state, &bend, damping, options.tolerance)? else {
            converged = true;
            break;
        };
        iterations += 1;
        converged = same(&next, &state);
        bend = fit.bend(bend, &state, &next);
        damping = if used > LEAST_DAMPING { used / DAMPING_FACTOR } else { 0.0 };
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

    /// The next point and the damping that led there from `start` on: one with a smaller sum of squares, or the last, whose sum is
    /// the same as far as can be told. `None` where no step of the tolerance or more leads on.
    fn improve(
        &self,
        state: &State,
        bend: &DMatrix<f64>,
        start: f64,
        tolerance: f64,
    ) -> Result<Option<(State, f64)>, AttributionError> {
        let (mut damping, mut failed) = (start, false);
        while damping < LARGEST_DAMPING {
            let theta = self.step(state, bend, damping);
            let change = (0..theta.len()).map(|i| (theta[i] - state.theta[i]).abs() / self.width(i));
            let moves = change.fold(0.0, f64::max) >= tolerance;
            let next = if moves { Some(self.state(theta)?) } else { None };
            let ends = next.as_ref().is_none_or(|next| same(next, state));
            match next {
                // Damping that nothing has asked for yet may be all that keeps the step small.
                _ if ends && damping > 0.0 && !failed => damping = 0.0,
                Some(next) if ends || next.chi2 < state.chi2 => return Ok(Some((next, damping))),
                Some(_) => (damping, failed) = ((DAMPING_FACTOR * damping).max(LEAST_DAMPING), true),
                None => return Ok(None),
            }
        }
        Ok(None)
    }

    /// The curvature Σ r ∇²r after a step (NL2SOL's secant, sized): the symmetric matrix nearest to the last one that changes
    /// J as the step did. Near is measured by the whole curvature or, where there is little of that along the step, by JᵀJ.
    fn bend(&self, last: DMatrix<f64>, from: &State, to: &State) -> DMatrix<f64> {
        let step = DVector::from_fn(from.theta.len(), |i, _| (to.theta[i] - from.theta[i]) / self.width(i));
        let slope = from.tangent.tr_mul(&from.white_residual) - to.tangent.tr_mul(&to.white_residual);
        let of_bend = (&from.tangent - &to.tangent).tr_mul(&to.white_residual);
        let linear = to.tangent.tr_mul(&(&to.tangent * &step));
        let measure = if slope.dot(&step) < LEAST_CURVATURE * linear.dot(&step) { linear } else { slope };
        let along = measure.dot(&step);
        if along.is_nan() || along <= 0.0 {
            return last;
        }
        let known = step.dot(&(&last * &step)).abs();
        let size = if known > 0.0 { (step.dot(&of_bend).abs() / known).min(1.0) } else { 1.0 };
        let sized = last * size;
        let missing = of_bend - &sized * &step;
        let (cross, share) = (&missing * measure.transpose() / along, missing.dot(&step) / (along * along));
        sized + &cross + cross.transpose() - &measure * measure.transpose() * share
    }

    /// Damped Newton step within the bounds: what would leave is set on its bound and the rest solved again.
    fn step(&self, state: &State, bend: &DMatrix<f64>, damping: f64) -> DVector<f64> {
        let p = self.parameters.len();
        let pressing = self.pressing(state);
        let mut fixed: Vec<Option<f64>> = pressing.iter().map(|bound| bound.map(|_| 0.0)).collect();
        loop {
            let free: Vec<usize> = (0..p).filter(|i| fixed[*i].is_none()).collect();
            let moved = DVector::from_fn(p, |i, _| fixed[i].unwrap_or(0.0));
            let solution = solve(state, bend, &free, &moved, damping);
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

/// Whether two points have the same sum of squares as far as can be told.
fn same(a: &State, b: &State) -> bool {
    (a.chi2 - b.chi2).abs() <= NOISE * b.chi2
}

/// Solves (JᵀJ + S + damping·diag JᵀJ)δ = Jᵀ(r − J·moved) − S·moved over the free columns, S being the `bend`. Directions in which
/// the sum of squares is curved downwards are taken as if it were curved upwards, so that every step leads down.
fn solve(state: &State, bend: &DMatrix<f64>, free: &[usize], moved: &DVector<f64>, damping: f64) -> DVector<f64> {
    if free.is_empty() {
        return DVector::zeros(0);
    }
    let tangent = state.tangent.select_columns(free);
    let downhill = state.tangent.tr_mul(&(&state.white_residual - &state.tangent * moved)) - bend * moved;
    let norm = |column: usize| Some(tangent.column(column).norm()).filter(|norm| *norm > 0.0).unwrap_or(1.0);
    let norms = DVector::from_fn(free.len(), |a, _| norm(a));
    let squares = tangent.tr_mul(&tangent);
    let scaled = DMatrix::from_fn(free.len(), free.len(), |a, b| {
        let curvature = (squares[(a, b)] + bend[(free[a], free[b])]) / (norms[a] * norms[b]);
        if a == b { curvature + damping } else { curvature }
    });
    let eigen = scaled.symmetric_eigen();
    let floor = FLAT * eigen.eigenvalues.amax();
    let target = DVector::from_fn(free.len(), |a, _| downhill[free[a]] / norms[a]);
    let shares = eigen.eigenvectors.tr_mul(&target);
    let turned = DVector::from_fn(free.len(), |k, _| {
        let curvature = eigen.eigenvalues[k].abs();
        if curvature > floor { shares[k] / curvature } else { 0.0 }
    });
    (eigen.eigenvectors * turned).component_div(&norms)
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
