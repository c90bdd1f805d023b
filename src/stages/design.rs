//! The runs of the design: every sample point in every fitted experiment, as often as the study repeats.

use super::{Context, StageError};
use crate::campaign::{Point, Request, Values};
use crate::tables::list::{ReplicationRow, SampleRow};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Label of the runs of the design.
pub const LABEL: &str = "design";

/// Parameter values of every point, by number.
pub fn points(samples: &[SampleRow]) -> BTreeMap<u32, Values> {
    let mut points: BTreeMap<u32, Values> = BTreeMap::new();
    for row in samples {
        points.entry(row.point).or_default().push((row.parameter.clone(), row.value));
    }
    points
}

/// Runs beyond `study.repetitions`, by point.
pub fn extra(context: &Context) -> Result<BTreeMap<u32, u32>, StageError> {
    Ok(context.read::<ReplicationRow>()?.into_iter().map(|row| (row.point, row.extra)).collect())
}

/// All repetitions of every point in every experiment, by experiment, point and repetition.
pub fn requests(context: &Context, samples: &[SampleRow]) -> Result<Vec<Request>, StageError> {
    let config = context.config;
    let (base, extra) = (config.base_settings(), extra(context)?);
    let mut points = points(samples)
        .into_iter()
        .map(|(number, values)| {
            Ok(Arc::new(
                Point::new(number, base, &values)?
                    .knowing(&config.effects.library)
                    .with_effects(&config.effects.active),
            ))
        })
        .collect::<Result<Vec<_>, StageError>>()?;
    points.sort_by_key(|point| point.number);
    let mut requests = Vec::new();
    for experiment in config.experiments() {
        for point in &points {
            let repetitions = 1..=config.study.repetitions + extra.get(&point.number).copied().unwrap_or(0);
            requests.extend(Request::batch(LABEL, experiment, point, repetitions, config.study.seed)?);
        }
    }
    Ok(requests)
}
