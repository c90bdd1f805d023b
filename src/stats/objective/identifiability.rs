//! Which directions of the parameter space the measurements fix, and which they leave open.
//!
//! Gauss–Newton information I = Σ_rows ∇m ∇mᵀ/S + priors, at a point of the unit cube, with the rows of
//! [`super::posterior`]. An eigenvector with eigenvalue λ is known to 1/√λ. A direction is called flat where that is
//! no better than what the bounds say alone, 1/√12 for a uniform distribution over the cube's edge.

use super::Problem;
use super::posterior::rows;
use crate::stats::linalg::symmetric_eigen;

/// Variance of a uniform distribution on [0, 1]: all that is known of a coordinate without data.
const UNIFORM_VARIANCE: f64 = 1.0 / 12.0;

/// A direction in the unit cube and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// Unit vector, largest component positive, shape (n_parameters).
    pub vector: Vec<f64>,
    /// Information λ along it.
    pub information: f64,
    /// 1/√λ; infinite where the data say nothing.
    pub sd: f64,
    /// Whether the bounds alone say as much as the data.
    pub flat: bool,
}

impl Direction {
    /// The direction in words, such as `0.71 sliding_friction - 0.70 rolling_friction`; components below 0.1 are
    /// left out.
    pub fn label(&self, names: &[&str]) -> String {
        let mut parts: Vec<(f64, &str)> = self.vector.iter().copied().zip(names.iter().copied()).collect();
        parts.retain(|(component, _)| component.abs() >= 0.1);
        parts.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        let term = |(index, (component, name)): (usize, &(f64, &str))| {
            let sign = ["", " + ", "-", " - "][usize::from(index > 0) + 2 * usize::from(*component < 0.0)];
            format!("{sign}{:.2} {name}", component.abs())
        };
        parts.iter().enumerate().map(term).collect()
    }
}

/// What the measurements say of the parameters near one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Identifiability {
    /// Directions from the least to the best known.
    pub directions: Vec<Direction>,
    /// Covariance of the parameters, shape (n_parameters, n_parameters), in which no direction has more than the
    /// variance of a uniform distribution over the cube.
    pub covariance: Vec<Vec<f64>>,
}

/// Information of the measurements at `x`, its directions, and the covariance that follows.
pub fn identify(problem: &Problem, x: &[f64]) -> Identifiability {
    let directions: Vec<Direction> =
        symmetric_eigen(&information(problem, x)).into_iter().map(|(value, vector)| direction(value, vector)).collect();
    let entry = |i: usize, j: usize| {
        let share = |d: &Direction| d.vector[i] * d.vector[j] * (d.sd * d.sd).min(UNIFORM_VARIANCE);
        directions.iter().map(share).sum()
    };
    let p = x.len();
    Identifiability { covariance: (0..p).map(|i| (0..p).map(|j| entry(i, j)).collect()).collect(), directions }
}

fn direction(value: f64, vector: Vec<f64>) -> Direction {
    // Rounding may leave a vanishing eigenvalue slightly negative.
    let information = value.max(0.0);
    let sd = 1.0 / information.sqrt();
    Direction { vector, information, sd, flat: sd * sd >= UNIFORM_VARIANCE }
}

fn information(problem: &Problem, x: &[f64]) -> Vec<Vec<f64>> {
    let p = x.len();
    let mut sum = vec![vec![0.0; p]; p];
    for (target, prediction) in problem.targets.iter().zip(problem.predict(x)) {
        for row in rows(problem.mode, target, &prediction) {
            for (line, own) in sum.iter_mut().zip(&row.gradient) {
                line.iter_mut().zip(&row.gradient).for_each(|(entry, other)| *entry += own * other / row.variance);
            }
        }
    }
    for prior in &problem.priors {
        sum[prior.parameter][prior.parameter] += 1.0 / (prior.sd * prior.sd);
    }
    sum
}
