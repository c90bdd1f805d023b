//! What could be measured to tell the effects of a class apart, and what it would be worth.
//!
//! Two kinds of measurement need no new simulation: observables that the fitted tests show but nobody read off, and more
//! repetitions of what was measured. Both are taken to come from repetitions of their own, so independent of the data.

use super::anchors::{Anchors, place_of};
use super::fit::Surface;
use super::moments::{Moment, Shape, Statistic};
use super::verdict::Case;
use crate::experiments::{Experiment, Observable};
use crate::stages::models::Models;
use crate::stats::attribution::{Candidate, Proposal};
use crate::stats::summary::sd;
use nalgebra::DVector;

/// All proposals for telling the candidates `members` apart.
pub fn all(
    case: &Case,
    models: &Models,
    anchors: &Anchors,
    candidates: &[Candidate],
    members: &[&str],
) -> Vec<Proposal> {
    let experiments = case.context.config.experiments();
    let again = experiments.iter().filter_map(|experiment| again(case, *experiment, candidates));
    let unread = experiments.iter().flat_map(|experiment| {
        let measured = case.set.statistics();
        let unread = |observable: &&Observable| measured.iter().all(|summary| summary.kpi != observable.name);
        let wish = Wish { case, models, anchors, candidates, members };
        let found: Vec<Proposal> =
            experiment.observables().iter().filter(unread).filter_map(|o| wish.observable(*experiment, o)).collect();
        found
    });
    again.chain(unread).collect()
}

/// As many repetitions again of what was measured in a test.
fn again(case: &Case, experiment: &dyn Experiment, candidates: &[Candidate]) -> Option<Proposal> {
    let statistics = case.evidence.statistics.iter().enumerate();
    let own = statistics.filter(|(_, s)| s.experiment == experiment.name() && s.moment != Moment::Trend);
    let rows: Vec<usize> = own.map(|(row, _)| row).collect();
    let n = rows.iter().map(|row| case.evidence.counts[*row]).max()?;
    Some(Proposal {
        name: format!("everything in {} another {n} times", experiment.name()),
        jacobian: case.slopes.jacobian.select_rows(&rows),
        covariance: case.noise.covariance.select_rows(&rows).select_columns(&rows),
        signatures: candidates
            .iter()
            .map(|candidate| Some(candidate.local()?.per_unit.select_rows(&rows)))
            .collect::<Option<_>>()?,
    })
}

struct Wish<'a> {
    case: &'a Case<'a>,
    models: &'a Models<'a>,
    anchors: &'a Anchors,
    candidates: &'a [Candidate],
    members: &'a [&'a str],
}

impl Wish<'_> {
    /// An observable that the data lack, read off as many repetitions as the test has; `None` where it has no scatter or no
    /// metamodel.
    fn observable(&self, experiment: &dyn Experiment, observable: &Observable) -> Option<Proposal> {
        let case = self.case;
        let counted = case.evidence.statistics.iter().zip(&case.evidence.counts);
        let n = counted.filter(|(s, _)| s.experiment == experiment.name()).map(|(_, n)| *n).max()?;
        let least = case.context.config.diagnose.thresholds.sd_from as usize;
        let moments = [Moment::Mean, Moment::LnSd];
        let statistics: Vec<Statistic> = moments
            .into_iter()
            .filter(|moment| *moment == Moment::Mean || n >= least)
            .map(|moment| Statistic {
                experiment: experiment.name().to_owned(),
                kpi: observable.name.to_owned(),
                unit: observable.unit.to_owned(),
                moment,
            })
            .collect();
        let shape = Shape::pooled(&[&case.before], &statistics)?;
        let values: Vec<f64> = case.before.series(&statistics[0])?.values().copied().collect();
        let variance = |(i, statistic): (usize, &Statistic)| match statistic.moment {
            Moment::LnSd => shape.ln_sd_variance(i, n),
            Moment::Mean | Moment::Trend => sd(&values) * sd(&values) / n as f64,
        };
        let variances: Vec<f64> = statistics.iter().enumerate().map(variance).collect();
        let plain = Surface::plain(case.context, self.models, self.anchors.centre(), &statistics)?;
        let zero = DVector::zeros(statistics.len());
        let signature = |candidate: &Candidate| match self.members.contains(&candidate.name.as_str()) {
            true => self.signature(candidate, &statistics),
            // Nobody asks how the others would stand.
            false => Some(zero.clone()),
        };
        Some(Proposal {
            name: format!("{} ({n} repetitions of {})", observable.name, experiment.name()),
            jacobian: plain.predict(&case.optimum).1,
            covariance: shape.covariance(&variances),
            signatures: self.candidates.iter().map(signature).collect::<Option<_>>()?,
        })
    }

    /// [f(θ̂, η) − f(θ̂, 0)]/η by metamodels over parameters and strength.
    fn signature(&self, candidate: &Candidate, statistics: &[Statistic]) -> Option<DVector<f64>> {
        let strength = candidate.local()?.strength;
        let effect = (candidate.name.as_str(), candidate.range);
        let surface = Surface::joint(self.case.context, self.models, self.anchors, effect, statistics).ok()?;
        let at =
            |strength: f64| surface.predict(&self.case.optimum.clone().push(place_of(candidate.range, strength))).0;
        Some((at(strength) - at(0.0)) / strength)
    }
}
