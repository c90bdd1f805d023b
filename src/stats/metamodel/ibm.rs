//! Kind `ibm`: noiseless processes for the mean and for the scatter (paper, section 4.3).

use super::part::Frame;
use super::{Differentiable, Kind, MetamodelError, Options, Part, PartRecord, Prediction, Role, Scatter, Usable};
use crate::stats::gp::TrainingSet;

/// Interpolation-based metamodel.
#[derive(Debug, Clone)]
pub struct Ibm {
    mean: Part,
    scatter: Option<Part>,
}

impl Ibm {
    pub(super) fn fit(data: &Usable, options: &Options) -> Result<Self, MetamodelError> {
        let scale = data.design_mean(Kind::Ibm)?;
        let mean = frame(Role::Mean, scale);
        let mean = Part::fit(mean, options, |jitter| mean_training(data, &Frame { jitter, ..mean }))?;
        let scatter = frame(Role::Scatter, scatter_scale(options.reading.scatter, scale));
        let kind = options.reading.scatter;
        let scatter = if data.require_replicates(Kind::Ibm).is_ok() {
            let training = |jitter| scatter_training(data, kind, &Frame { jitter, ..scatter });
            Some(Part::fit(scatter, options, training)?)
        } else {
            None
        };
        Ok(Self { mean, scatter })
    }

    pub(super) fn restore(
        data: &Usable,
        mean: &PartRecord,
        scatter: Option<&PartRecord>,
    ) -> Result<Self, MetamodelError> {
        let part = |record: &PartRecord| {
            Part::restore(record, scatter_training(data, record.reading.scatter, &record.frame()))
        };
        Ok(Self {
            mean: Part::restore(mean, mean_training(data, &mean.frame()))?,
            scatter: scatter.map(part).transpose()?,
        })
    }

    pub(super) fn mean(&self) -> &Part {
        &self.mean
    }

    pub(super) fn parts(&self) -> Vec<&Part> {
        std::iter::once(&self.mean).chain(&self.scatter).collect()
    }

    /// Mean by eq. 8; sd = cv·|mean| or the interpolated sd, at least 0; uncertainty by eq. 9.
    pub(super) fn predict(&self, x: &[f64]) -> Prediction {
        let mean = self.mean.mean_with_gradient(x);
        let scatter = self.scatter.as_ref().map(|scatter| sd(scatter, &mean, x));
        let log_sd_error = scatter.as_ref().map_or(0.0, |(_, error)| *error);
        let sd = scatter.map(|(sd, _)| sd);
        Prediction { sd, epistemic_sd: self.mean.variance(x).sqrt(), log_sd_error, mean }
    }
}

fn frame(role: Role, scale: f64) -> Frame {
    Frame { kind: Kind::Ibm, role, offset: 0.0, scale, jitter: 0.0 }
}

/// A coefficient of variation is not scaled, a standard deviation is scaled like the mean.
fn scatter_scale(scatter: Scatter, scale: f64) -> f64 {
    match scatter {
        Scatter::Cv => 1.0,
        Scatter::Sd => scale.abs(),
    }
}

fn mean_training(data: &Usable, frame: &Frame) -> TrainingSet {
    TrainingSet {
        points: data.points.clone(),
        targets: data.means.iter().map(|mean| mean / frame.scale).collect(),
        noise: vec![frame.jitter; data.means.len()],
    }
}

fn scatter_training(data: &Usable, scatter: Scatter, frame: &Frame) -> TrainingSet {
    let replicated = data.replicated();
    let target = |&i: &usize| match scatter {
        Scatter::Cv => data.cv(i) / frame.scale,
        Scatter::Sd => data.sds[i] / frame.scale,
    };
    TrainingSet {
        points: data.points.select(&replicated),
        targets: replicated.iter().map(target).collect(),
        noise: vec![frame.jitter; replicated.len()],
    }
}

/// Standard deviation of the KPI, and that of its logarithm's uncertainty.
///
/// The interpolant may swing below zero between points; an sd may not.
fn sd(scatter: &Part, mean: &Differentiable, x: &[f64]) -> (Differentiable, f64) {
    let raw = scatter.mean_with_gradient(x);
    if raw.value <= 0.0 {
        return (Differentiable { value: 0.0, gradient: vec![0.0; x.len()] }, 0.0);
    }
    let error = scatter.variance(x).sqrt() / raw.value;
    match scatter.record().reading.scatter {
        Scatter::Sd => (raw, error),
        Scatter::Cv => (times_mean(&raw, mean), error),
    }
}

/// cv·|mean|.
fn times_mean(cv: &Differentiable, mean: &Differentiable) -> Differentiable {
    let sign = mean.value.signum();
    let slope = |(of_cv, of_mean): (&f64, &f64)| sign * (of_cv * mean.value + cv.value * of_mean);
    Differentiable {
        value: cv.value * mean.value.abs(),
        gradient: cv.gradient.iter().zip(&mean.gradient).map(slope).collect(),
    }
}
