//! How repetitions scatter with an effect that is itself drawn anew for each of them.
//!
//! Such an effect is a cause that all observables of a run share. It makes their tails heavier and their scatters follow one
//! another, so that ln s of few repetitions is worth less with it than without. Takes the runs with the effect: its anchors and,
//! where there are any, the direct ones; gives the change of the noise by which η₉₀ is searched.

use super::anchors::Anchors;
use super::fit::Surface;
use super::moments::{Batch, Moment, Shape};
use super::verdict::Case;
use crate::stats::attribution;

/// Share of the end of its range from which the runs with an effect show how it scatters.
const LEAST: f64 = 0.5;

/// Repetitions with an effect, each batch about its own mean.
#[derive(Clone)]
pub struct Scatter {
    /// Upper end of the range of the strength.
    upper: f64,
    /// Strengths of the anchors.
    strengths: Vec<f64>,
    /// Their repetitions together, over the scatter that the metamodels give at each anchor.
    anchors: Batch,
}

impl Scatter {
    /// Of the anchors in the upper half of the range.
    pub fn of(surface: &Surface, anchors: &Anchors, (effect, upper): (&str, f64)) -> Self {
        let strong = anchors.runs(effect).filter(|(x, _)| surface.strength(x) >= LEAST * upper);
        let (strengths, points): (Vec<f64>, Vec<Batch>) =
            strong.map(|(x, batch)| (surface.strength(x), batch.over(surface.scatters(x)))).unzip();
        Self { upper, strengths, anchors: Batch::deviations(&points.iter().collect::<Vec<_>>()) }
    }

    /// The change of the noise of a case, by the anchors and by direct runs at a strength in the upper half. Variances of means
    /// are left as they are, since measured repetitions with the effect would bring their own. `None` where an observable has
    /// no scatter in these runs.
    pub fn in_case(&self, case: &Case, direct: Option<(f64, &Batch)>) -> Option<attribution::Scatter> {
        let statistics = &case.evidence.statistics;
        let direct = direct.filter(|(strength, _)| *strength >= LEAST * self.upper);
        let batches: Vec<&Batch> = [&self.anchors].into_iter().chain(direct.map(|(_, batch)| batch)).collect();
        let shape = Shape::pooled(&batches, statistics)?;
        let first = statistics.first()?;
        let runs = |batch: &Batch| batch.count(first) as f64;
        let each = runs(&self.anchors) / self.strengths.len() as f64;
        let known = self.strengths.iter().map(|strength| (each, *strength));
        let known: Vec<(f64, f64)> = known.chain(direct.map(|(strength, batch)| (runs(batch), strength))).collect();
        let square: f64 = known.iter().map(|(runs, strength)| runs * strength * strength).sum();
        let all: f64 = known.iter().map(|(runs, _)| runs).sum();
        let without: Vec<f64> = case.noise.covariance.diagonal().iter().copied().collect();
        let with = |i: usize| match statistics[i].moment {
            Moment::LnSd => shape.ln_sd_variance(i, case.evidence.counts[i]),
            Moment::Mean | Moment::Trend => without[i],
        };
        let with: Vec<f64> = (0..without.len()).map(with).collect();
        let change = shape.covariance(&with) - case.shape.covariance(&without);
        Some(attribution::Scatter { strength: (square / all).sqrt(), change })
    }
}
