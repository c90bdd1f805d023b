//! How well a metamodel meets observations: NRMSE (eq. 15) in training, on validation points and leave-one-out.

use super::{Metamodel, Observations, mean_of};

/// Root mean square difference, absolute and by eq. 15.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Error {
    /// √(Σ (f*_i − f_i)²/N), in the unit of the KPI.
    pub rmse: f64,
    /// The same over |f̄|, eq. 15; infinite where the observed mean vanishes.
    pub nrmse: f64,
}

/// Errors of a metamodel on a set of observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Number of points compared.
    pub points: usize,
    /// Error of the mean.
    pub mean: Error,
    /// Errors that involve the standard deviation; none where model or observations have none.
    pub scatter: Option<ScatterScore>,
}

/// Errors that involve the standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScatterScore {
    /// Number of points with an observed sd.
    pub points: usize,
    /// Error of the sd.
    pub sd: Error,
    /// Error of mean + sd, as in the paper's Figs 11 and 12.
    pub mean_plus_sd: Error,
    /// Error of mean − sd.
    pub mean_minus_sd: Error,
}

/// √(Σ (predicted − observed)²/N), and that over |mean of observed| (eq. 15).
///
/// # Panics
/// If the lengths differ or are zero.
pub fn error(predicted: &[f64], observed: &[f64]) -> Error {
    assert!(predicted.len() == observed.len() && !observed.is_empty(), "one prediction per observation");
    let squares: Vec<f64> = predicted.iter().zip(observed).map(|(p, o)| (p - o) * (p - o)).collect();
    let rmse = mean_of(&squares).sqrt();
    Error { rmse, nrmse: rmse / mean_of(observed).abs() }
}

/// Errors of `model` on `observations`: on those it was trained with, the training error; on others, the validation
/// error. None where no point has an observation.
pub fn score(model: &Metamodel, observations: &Observations) -> Option<Score> {
    let seen: Vec<usize> = (0..observations.counts.len()).filter(|&i| observations.counts[i] > 0).collect();
    let predictions: Vec<_> = seen.iter().map(|&i| model.predict(observations.points.row(i))).collect();
    let predicted: Vec<f64> = predictions.iter().map(|prediction| prediction.mean.value).collect();
    let observed: Vec<f64> = seen.iter().map(|&i| observations.means[i]).collect();
    let spread: Vec<Compared> = seen
        .iter()
        .zip(&predictions)
        .filter(|(i, _)| observations.counts[**i] > 1)
        .filter_map(|(&i, prediction)| {
            let sd = prediction.sd.as_ref()?.value;
            Some(Compared { mean: (prediction.mean.value, observations.means[i]), sd: (sd, observations.sds[i]) })
        })
        .collect();
    (!seen.is_empty()).then(|| Score {
        points: seen.len(),
        mean: error(&predicted, &observed),
        scatter: (!spread.is_empty()).then(|| scatter_score(&spread)),
    })
}

/// Predicted and observed mean and sd of one point.
struct Compared {
    mean: (f64, f64),
    sd: (f64, f64),
}

fn scatter_score(points: &[Compared]) -> ScatterScore {
    let of = |combine: fn(f64, f64) -> f64| {
        let predicted: Vec<f64> = points.iter().map(|point| combine(point.mean.0, point.sd.0)).collect();
        let observed: Vec<f64> = points.iter().map(|point| combine(point.mean.1, point.sd.1)).collect();
        error(&predicted, &observed)
    };
    ScatterScore {
        points: points.len(),
        sd: of(|_, sd| sd),
        mean_plus_sd: of(|mean, sd| mean + sd),
        mean_minus_sd: of(|mean, sd| mean - sd),
    }
}

/// Error of the leave-one-out means of `model`, which was trained on `observations`.
pub fn leave_one_out_error(model: &Metamodel, observations: &Observations) -> Error {
    let predicted: Vec<f64> = model.leave_one_out().into_iter().map(|(mean, _)| mean).collect();
    let seen = (0..observations.counts.len()).filter(|&i| observations.counts[i] > 0);
    let observed: Vec<f64> = seen.map(|i| observations.means[i]).collect();
    error(&predicted, &observed)
}
