//! Signatures over the whole parameter space: every candidate at a few anchor points, shared by all diagnoses.
//!
//! At each anchor every effect is run at two strengths with the packings of the plain model. The secant
//! [f(θ, η) − f(θ, 0)]/η of every statistic is then a linear function of the parameters and of the strength,
//! g(u, η) = b₀ + b·(u − ½) + c η, fitted by least squares with weights η². Its error comes from the scatter of the
//! paired differences, and is enlarged where the plane does not fit.

use super::lab::{Job, Lab};
use super::moments::{Batch, Statistic};
use crate::campaign::Point;
use crate::effects::{self, Effect};
use crate::stages::{Context, StageError};
use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
use crate::stats::points::Points;
use nalgebra::{DMatrix, DVector};

/// Label of the runs at the anchors.
pub const LABEL: &str = "anchors";

/// Runs at the anchors.
pub struct Anchors {
    unit: Points,
    plain: Vec<Batch>,
    effects: Vec<EffectRuns>,
}

struct EffectRuns {
    name: String,
    strengths: Vec<f64>,
    /// Batches by anchor, then strength.
    batches: Vec<Vec<Batch>>,
}

/// Secants of one effect at one point, with the covariance of their error.
pub struct Secants {
    /// Strengths in increasing order with the change of every statistic per unit of strength.
    pub at: Vec<(f64, DVector<f64>)>,
    /// Covariance of a secant, the largest over the strengths.
    pub covariance: DMatrix<f64>,
}

/// Strengths at which an effect is run: the given shares of its range; both ends where it has two signs.
pub fn strengths(effect: &dyn Effect, shares: &[f64]) -> Vec<f64> {
    let (lower, upper) = effect.range();
    if effect.one_sided() {
        return shares.iter().map(|share| share * upper).collect();
    }
    let largest = shares.iter().copied().fold(0.0, f64::max);
    vec![lower * largest, upper * largest]
}

impl Anchors {
    /// Simulates the anchors, or looks them up.
    pub fn simulate(context: &Context, lab: &mut Lab) -> Result<Self, StageError> {
        let diagnose = &context.config.diagnose;
        let unit = anchor_points(context);
        let points = plain_points(context, &unit)?;
        let mut jobs: Vec<Job> = points.iter().map(|point| job(context, point, 0, &[])).collect();
        let mut plan = Vec::new();
        for name in &diagnose.candidates {
            let strengths =
                strengths(effects::find(name).map_err(crate::campaign::CampaignError::from)?, &diagnose.amplitudes);
            for point in &points {
                for strength in &strengths {
                    jobs.push(job(context, point, jobs.len(), &[(name.clone(), *strength)]));
                }
            }
            plan.push((name.clone(), strengths));
        }
        let mut batches = lab.run(&jobs)?.into_iter();
        let plain = batches.by_ref().take(points.len()).collect();
        let effects = plan
            .into_iter()
            .map(|(name, strengths)| {
                let batches = points.iter().map(|_| batches.by_ref().take(strengths.len()).collect()).collect();
                EffectRuns { name, strengths, batches }
            })
            .collect();
        Ok(Self { unit, plain, effects })
    }

    /// The runs of the plain model in the centre of the parameter space, which is the first anchor.
    pub fn centre(&self) -> &Batch {
        &self.plain[0]
    }

    /// Secants of an effect at `u` in the unit cube; `None` where a statistic could not be measured at the anchors.
    pub fn secants(&self, effect: &str, statistics: &[Statistic], u: &[f64]) -> Option<Secants> {
        let runs = self.effects.iter().find(|runs| runs.name == effect)?;
        let mut rows: Vec<(Vec<f64>, f64)> = Vec::new();
        let mut differences: Vec<DVector<f64>> = Vec::new();
        let mut scatter = DMatrix::zeros(statistics.len(), statistics.len());
        for (anchor, batches) in runs.batches.iter().enumerate() {
            for (strength, batch) in runs.strengths.iter().zip(batches) {
                let difference = batch.paired_difference(&self.plain[anchor], statistics)?;
                differences.push(DVector::from_vec(difference.values) / *strength);
                scatter += difference.covariance;
                rows.push((basis(self.unit.row(anchor), *strength), strength * strength));
            }
        }
        scatter /= rows.len() as f64;
        let plane = Plane::fit(&rows, &differences, &scatter)?;
        let at = runs.strengths.iter().map(|&strength| (strength, plane.value(&basis(u, strength)))).collect();
        let largest = runs.strengths.iter().map(|&strength| plane.leverage(&basis(u, strength))).fold(0.0, f64::max);
        Some(Secants { at, covariance: plane.covariance(&scatter, largest) })
    }
}

/// 1, u − ½, η.
fn basis(u: &[f64], strength: f64) -> Vec<f64> {
    std::iter::once(1.0).chain(u.iter().map(|x| x - 0.5)).chain([strength]).collect()
}

/// Weighted least squares of every statistic on the basis.
struct Plane {
    /// Coefficients, shape (n_basis, n_statistics).
    coefficients: DMatrix<f64>,
    /// (XᵀWX)⁻¹.
    inverse: DMatrix<f64>,
    /// Factor on the standard error of every statistic where the plane does not fit, at least 1.
    inflation: Vec<f64>,
}

impl Plane {
    fn fit(rows: &[(Vec<f64>, f64)], values: &[DVector<f64>], scatter: &DMatrix<f64>) -> Option<Self> {
        let (n, k, m) = (rows.len(), rows.first()?.0.len(), scatter.nrows());
        let mut normal = DMatrix::zeros(k, k);
        let mut right = DMatrix::zeros(k, m);
        for ((basis, weight), value) in rows.iter().zip(values) {
            let x = DVector::from_column_slice(basis);
            normal += &x * x.transpose() * *weight;
            right += &x * value.transpose() * *weight;
        }
        let inverse = normal.cholesky()?.inverse();
        let mut plane = Self { coefficients: &inverse * right, inverse, inflation: vec![1.0; m] };
        plane.inflation = (0..m).map(|row| plane.misfit(rows, values, row, scatter[(row, row)], n, k)).collect();
        Some(plane)
    }

    /// √max(1, χ²/(n − k)) of one statistic.
    fn misfit(
        &self,
        rows: &[(Vec<f64>, f64)],
        values: &[DVector<f64>],
        row: usize,
        variance: f64,
        n: usize,
        k: usize,
    ) -> f64 {
        if n <= k || variance <= 0.0 {
            return 1.0;
        }
        let squares = rows.iter().zip(values).map(|((basis, weight), value)| {
            let residual = value[row] - self.value(basis)[row];
            weight * residual * residual / variance
        });
        (squares.sum::<f64>() / (n - k) as f64).max(1.0).sqrt()
    }

    fn value(&self, basis: &[f64]) -> DVector<f64> {
        self.coefficients.transpose() * DVector::from_column_slice(basis)
    }

    fn leverage(&self, basis: &[f64]) -> f64 {
        let x = DVector::from_column_slice(basis);
        (x.transpose() * &self.inverse * &x)[(0, 0)]
    }

    fn covariance(&self, scatter: &DMatrix<f64>, leverage: f64) -> DMatrix<f64> {
        let entry = |i: usize, j: usize| scatter[(i, j)] * leverage * self.inflation[i] * self.inflation[j];
        DMatrix::from_fn(scatter.nrows(), scatter.ncols(), entry)
    }
}

/// The centre, and a Latin hypercube spread around it.
fn anchor_points(context: &Context) -> Points {
    let p = context.config.parameters.len();
    let mut centre = Points::empty(p);
    centre.push(&vec![0.5; p]);
    let others = context.config.diagnose.anchors as usize - 1;
    if others == 0 {
        return centre;
    }
    let annealing = Annealing { seed: context.seed("anchors"), ..Annealing::default() };
    centre.joined(&conditional_latin_hypercube(others, &centre, &annealing).points)
}

fn plain_points(context: &Context, unit: &Points) -> Result<Vec<Point>, StageError> {
    let point = |(index, row): (usize, &[f64])| point_at(context, index as u32 + 1, row);
    unit.rows().enumerate().map(point).collect()
}

/// The point at `u` in the unit cube, with the effects the model already has.
pub fn point_at(context: &Context, number: u32, u: &[f64]) -> Result<Point, StageError> {
    let parameters = context.config.parameters.iter().zip(u);
    let values: Vec<_> =
        parameters.map(|(parameter, x)| (parameter.name.to_owned(), parameter.from_unit(*x))).collect();
    let point = Point::new(number, context.config.base_settings(), &values)?;
    Ok(point.with_effects(&context.config.effects.active))
}

/// The point with further effects on.
pub fn with_more(context: &Context, point: &Point, more: &[(String, f64)]) -> Point {
    let effects: Vec<_> = context.config.effects.active.iter().chain(more).cloned().collect();
    point.clone().with_effects(&effects)
}

fn job(context: &Context, point: &Point, offset: usize, effect: &[(String, f64)]) -> Job {
    let mut point = with_more(context, point, effect);
    if offset > 0 {
        point.number = offset as u32 + 1;
    }
    Job {
        label: LABEL.to_owned(),
        point,
        experiments: context.config.experiments(),
        repetitions: context.config.diagnose.anchor_repetitions,
    }
}
