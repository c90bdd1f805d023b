//! Kind `rbm`: one process for the mean, with a noise at every point (paper, section 4.3).

use super::part::{Frame, square_root};
use super::{Kind, MetamodelError, Noise, Options, Part, PartRecord, Prediction, Role, Usable, mean_of};
use crate::stats::gp::TrainingSet;

/// Regression-based metamodel.
#[derive(Debug, Clone)]
pub struct Rbm {
    part: Part,
}

impl Rbm {
    pub(super) fn fit(data: &Usable, options: &Options) -> Result<Self, MetamodelError> {
        let scale = data.design_mean(Kind::Rbm)?;
        data.require_replicates(Kind::Rbm)?;
        let frame = Frame { kind: Kind::Rbm, role: Role::Mean, offset: 0.0, scale, jitter: 0.0 };
        let training = |jitter| training(data, options.reading.noise, &Frame { jitter, ..frame });
        Ok(Self { part: Part::fit(frame, options, training)? })
    }

    pub(super) fn restore(data: &Usable, record: &PartRecord) -> Result<Self, MetamodelError> {
        data.require_replicates(Kind::Rbm)?;
        Ok(Self { part: Part::restore(record, training(data, record.reading.noise, &record.frame()))? })
    }

    pub(super) fn part(&self) -> &Part {
        &self.part
    }

    /// Mean by eq. 8. The sd is √(eq. 9), brought back by the factor that normalised the mean: the latent
    /// uncertainty, which this kind also offers as the scatter of the KPI.
    pub(super) fn predict(&self, x: &[f64]) -> Prediction {
        let (mean, variance) = self.part.predict(x);
        let sd = square_root(&variance);
        Prediction { mean, epistemic_sd: sd.value, log_sd_error: 0.0, sd: Some(sd) }
    }
}

/// The jitter is a lower bound of the noise: runs that agree exactly would make the covariance singular.
fn training(data: &Usable, noise: Noise, frame: &Frame) -> TrainingSet {
    let squares: Vec<f64> = data.replicated().into_iter().map(|i| data.cv(i) * data.cv(i)).collect();
    let pooled = mean_of(&squares).sqrt();
    let variance = |i: usize| {
        // A single run has no scatter of its own and takes that of the design.
        let cv = if data.counts[i] > 1 { data.cv(i) } else { pooled };
        let relative_sd = cv * data.means[i] / frame.scale;
        match noise {
            Noise::CvSquared => cv * cv,
            Noise::Cv => cv,
            Noise::VarOfMean => relative_sd * relative_sd / data.counts[i] as f64,
        }
    };
    TrainingSet {
        points: data.points.clone(),
        targets: data.means.iter().map(|mean| mean / frame.scale).collect(),
        noise: (0..data.means.len()).map(|i| variance(i).max(frame.jitter)).collect(),
    }
}
