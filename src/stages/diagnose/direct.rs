//! Direct differences: DEM runs around an optimum, which replace the metamodel's values and slopes there.

use super::anchors::{point_at, with_more};
use super::lab::{Job, Lab};
use super::moments::{Batch, Moments, Statistic};
use crate::campaign::Point;
use crate::experiments::Experiment;
use crate::stages::{Context, StageError};
use nalgebra::{DMatrix, DVector};

/// Half width of the central differences in the unit cube: wide enough that the difference stands out of the scatter
/// of the angles, narrow enough that the third derivative does not matter.
const HALF_STEP: f64 = 0.15;

/// Values and slopes of the statistics at a point of the unit cube, from DEM runs.
pub struct Direct {
    /// Runs at the point itself.
    pub batch: Batch,
    /// Statistics of those runs with their covariance.
    pub value: Moments,
    /// Slopes (m × p).
    pub jacobian: DMatrix<f64>,
    /// Covariance of the error of every column of the slopes.
    pub jacobian_covariance: Vec<DMatrix<f64>>,
}

/// Runs the centre and a pair of points per parameter; `None` where a statistic could not be measured.
pub fn simulate(
    context: &Context,
    lab: &mut Lab,
    measured: &str,
    statistics: &[Statistic],
    centre: &DVector<f64>,
) -> Result<Option<Direct>, StageError> {
    let plain = point_at(context, 1, centre.as_slice())?;
    let mut jobs = vec![job(context, format!("{measured}/centre"), plain.clone())];
    let mut spacing = Vec::new();
    for (index, parameter) in context.config.parameters.iter().enumerate() {
        let moved = |step: f64| (centre[index] + step).clamp(0.0, 1.0);
        for (sign, position) in [("-", moved(-HALF_STEP)), ("+", moved(HALF_STEP))] {
            let mut u = centre.clone();
            u[index] = position;
            let point = point_at(context, 1, u.as_slice())?.paired_with(&plain);
            jobs.push(job(context, format!("{measured}/{}{sign}", parameter.name), point));
        }
        spacing.push(moved(HALF_STEP) - moved(-HALF_STEP));
    }
    let batches = lab.run(&jobs)?;
    let slope = |index: usize| batches[2 * index + 2].paired_difference(&batches[2 * index + 1], statistics);
    let slopes: Option<Vec<Moments>> = (0..spacing.len()).map(slope).collect();
    let (Some(value), Some(slopes)) = (batches[0].moments(statistics), slopes) else { return Ok(None) };
    Ok(Some(Direct {
        batch: batches[0].clone(),
        value,
        jacobian: DMatrix::from_fn(statistics.len(), spacing.len(), |i, j| slopes[j].values[i] / spacing[j]),
        jacobian_covariance: slopes.iter().zip(&spacing).map(|(m, h)| &m.covariance / (h * h)).collect(),
    }))
}

/// Runs of the fitted experiments at `u`, with `effects` switched on besides.
pub fn batch(
    context: &Context,
    lab: &mut Lab,
    label: String,
    u: &DVector<f64>,
    effects: &[(String, f64)],
) -> Result<Batch, StageError> {
    paired_batch(context, lab, label, u, effects, u)
}

/// The same with the packings of the runs at `pair`.
pub fn paired_batch(
    context: &Context,
    lab: &mut Lab,
    label: String,
    u: &DVector<f64>,
    effects: &[(String, f64)],
    pair: &DVector<f64>,
) -> Result<Batch, StageError> {
    let point = with_more(context, &point_at(context, 1, u.as_slice())?, effects);
    let point = point.paired_with(&point_at(context, 1, pair.as_slice())?);
    Ok(lab.run(&[job(context, label, point)])?.remove(0))
}

/// Runs of the held-out experiment at `u`.
pub fn held_out(
    context: &Context,
    lab: &mut Lab,
    label: String,
    u: &DVector<f64>,
    effects: &[(String, f64)],
) -> Result<Batch, StageError> {
    let validate = context.config.validate;
    let point = with_more(context, &point_at(context, 1, u.as_slice())?, effects);
    let experiments: Vec<&'static dyn Experiment> = vec![validate.experiment];
    Ok(lab.run(&[Job { label, point, experiments, repetitions: validate.repetitions }])?.remove(0))
}

fn job(context: &Context, label: String, point: Point) -> Job {
    let repetitions = context.config.diagnose.refine_repetitions;
    Job { label, point, experiments: context.config.experiments(), repetitions }
}
