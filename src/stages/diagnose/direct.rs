//! Direct runs: DEM runs at a point of the diagnosis, where the metamodels' word is not enough.

use super::anchors::{point_at, strength_at, with_more};
use super::lab::{Job, Lab};
use super::moments::Batch;
use crate::experiments::Experiment;
use crate::stages::{Context, StageError};
use nalgebra::DVector;

/// An effect with the range of its strength: what the last coordinate of a point means.
pub type Axis<'a> = (&'a str, (f64, f64));

/// Runs of the fitted experiments at `x`, the parameters in the unit cube and, with an axis, the place of the strength.
pub fn job(
    context: &Context,
    (label, number): (String, u32),
    x: &[f64],
    axis: Option<Axis>,
    repetitions: u32,
) -> Result<Job, StageError> {
    let p = context.config.parameters.len();
    let strength = axis.map(|(name, range)| (name.to_owned(), strength_at(range, x[p])));
    let point = with_more(context, &point_at(context, number, &x[..p])?, strength.as_slice());
    Ok(Job { label, point, experiments: context.config.experiments(), repetitions })
}

/// Runs of the fitted experiments at `u` with packings of their own, which no fit has seen.
pub fn confirmation(
    context: &Context,
    lab: &mut Lab,
    label: String,
    u: &DVector<f64>,
    effects: &[(String, f64)],
) -> Result<Batch, StageError> {
    let point = with_more(context, &point_at(context, 1, u.as_slice())?, effects);
    let repetitions = context.config.diagnose.refine_repetitions;
    Ok(lab.confirm(&[Job { label, point, experiments: context.config.experiments(), repetitions }])?.remove(0))
}

/// Runs of the held-out experiment at `x`, as [`job`].
pub fn held_out_job(context: &Context, named: (String, u32), x: &[f64], axis: Option<Axis>) -> Result<Job, StageError> {
    let validate = context.config.validate;
    Ok(Job { experiments: vec![validate.experiment], ..job(context, named, x, axis, validate.repetitions)? })
}

/// Runs of the held-out experiment at `u`; a place that the label knows keeps its number.
pub fn held_out(
    context: &Context,
    lab: &mut Lab,
    label: String,
    u: &DVector<f64>,
    effects: &[(String, f64)],
) -> Result<Batch, StageError> {
    let validate = context.config.validate;
    let mut point = with_more(context, &point_at(context, 1, u.as_slice())?, effects);
    point.number = lab.number(&label, &point)?;
    let experiments: Vec<&'static dyn Experiment> = vec![validate.experiment];
    Ok(lab.run(&[Job { label, point, experiments, repetitions: validate.repetitions }])?.remove(0))
}
