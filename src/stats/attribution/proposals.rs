//! Confusion of candidates, and the measurement that would tell them apart.
//!
//! Takes whitened signatures; gives cosines and expected separations, also with the rows of a proposed measurement
//! appended first, which is the only way its value shows. Decides nothing.

use super::effect::dot;
use super::geometry::{Whitened, complement_of, per_width, whiten, whiten_vector};
use super::judge::Rule;
use super::{Problem, Proposal};
use nalgebra::{DMatrix, DVector};

/// c_kl of projected signatures; 0 where one of them vanishes.
pub(super) fn cosine(a: &[f64], b: &[f64]) -> f64 {
    let size = (dot(a, a) * dot(b, b)).sqrt();
    if size > 0.0 { (dot(a, b) / size).clamp(-1.0, 1.0) } else { 0.0 }
}

/// The part of a cosine that a rival can use to imitate an effect of the given sign: a two-sided rival flips its sign.
pub(super) fn usable(cosine: f64, sign: f64, rival: &Rule) -> f64 {
    if rival.one_sided() { (cosine * sign * rival.side()).max(0.0) } else { cosine.abs() }
}

/// ½A²(1 − c²).
pub(super) fn separation(size2: f64, confusion: f64) -> f64 {
    0.5 * size2 * (1.0 - confusion * confusion)
}

/// Expected separation of a truth at a strength from a rival once a proposal is measured; `None` if its covariance is
/// not positive definite.
pub(super) fn with_proposal(
    problem: &Problem,
    whitened: &Whitened,
    proposal: &Proposal,
    (truth, strength): (usize, f64),
    (rival, rule): (usize, &Rule),
) -> Option<f64> {
    let factor = proposal.covariance.clone().cholesky()?.l();
    let basis = complement_of(&appended_tangent(problem, whitened, proposal, &factor));
    let project = |k: usize| -> Vec<f64> {
        let nearest = problem.candidates[k].local();
        let old = nearest.map_or_else(|| DVector::zeros(whitened.len()), |s| whitened.vector(&s.per_unit));
        let new = whiten_vector(&factor, proposal.signatures[k].as_slice());
        let rows = old.len() + new.len();
        let all = DVector::from_iterator(rows, old.iter().chain(new.iter()).copied());
        basis.tr_mul(&all).as_slice().to_vec()
    };
    let (g, h) = (project(truth), project(rival));
    let confusion = usable(cosine(&g, &h), strength.signum(), rule);
    Some(separation(strength * strength * dot(&g, &g), confusion))
}

/// J̃ with the whitened rows of a proposal below it.
fn appended_tangent(
    problem: &Problem,
    whitened: &Whitened,
    proposal: &Proposal,
    factor: &DMatrix<f64>,
) -> DMatrix<f64> {
    let (new, rows) = (whiten(factor, &per_width(&proposal.jacobian, &problem.parameters)), whitened.len());
    DMatrix::from_fn(rows + new.nrows(), new.ncols(), |i, j| {
        if i < rows { whitened.tangent[(i, j)] } else { new[(i - rows, j)] }
    })
}
