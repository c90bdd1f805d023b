//! A panel: one diagnosis with its direct runs, kept and applied to any number of data sets without a simulation.
//!
//! Error rates need thousands of diagnoses of data from one truth. Their optima lie within the noise of each other, so
//! the direct runs of one of them serve all: metamodels that know these runs stand where a diagnosis of its own would make
//! new ones. Fits, residual, signatures, tests and verdict are those of the stage, anew for every data set.

use super::anchors::{Anchors, strength_at};
use super::fit::{self, Weights};
use super::joint::Contender;
use super::lab::Lab;
use super::moments::{Moment, Moments};
use super::rows;
use super::verdict::{Case, Examined, HOPELESS, attributed, examine, options, prepare};
use crate::config::Measured;
use crate::stages::models::Models;
use crate::stages::{Context, StageError};
use crate::stats::attribution::{Attribution, Options};
use crate::tables::list::{AttributionRow, ConfusionRow, VerdictRow};
use nalgebra::DMatrix;

/// A prepared diagnosis.
pub struct Panel<'a> {
    examined: Examined<'a>,
}

/// The rows that a score needs.
pub type PanelRows = (VerdictRow, Vec<AttributionRow>, Vec<ConfusionRow>);

impl<'a> Panel<'a> {
    /// Diagnoses `reference` with all its simulations and the library that the study leaves, for data sets of the same
    /// observables and at least `least` repetitions; the inner error says why there can be no verdict on it.
    ///
    /// # Errors
    /// Tables that are missing, or runs that cannot be made.
    pub fn new(
        context: &'a Context<'a>,
        reference: &'a Measured,
        least: u32,
    ) -> Result<Result<Self, String>, StageError> {
        let models = Models::read(context)?;
        let mut lab = Lab::new(context);
        let anchors = Anchors::simulate(context, &mut lab)?;
        let prepared = match prepare(context, &models, &anchors, &mut lab, reference, None)? {
            Ok(prepared) => prepared,
            Err(why) => return Ok(Err(why)),
        };
        let mut examined = examine(&models, &anchors, &mut lab, prepared)?;
        // Another data set may lead to any candidate that is not hopeless by far, so all of these stand on runs. What few
        // repetitions leave open, the reference may rule out: a misfit grows with their number.
        let case = &examined.case;
        let mut rivals: Vec<&mut Contender> =
            examined.contenders.iter_mut().filter(|contender| !case.leaves_out(contender.name())).collect();
        let misfits = rivals.iter().filter_map(|contender| contender.misfit());
        let most = case.evidence.counts.iter().copied().max().unwrap_or(0) as f64;
        let hopeless = misfits.fold(f64::INFINITY, f64::min) + HOPELESS * (most / f64::from(least)).max(2.0);
        for contender in rivals.iter_mut().filter(|contender| !contender.is_tied()) {
            if contender.misfit().is_some_and(|misfit| misfit < hopeless) {
                contender.tie_anyway(case, &mut lab)?;
            }
        }
        Ok(Ok(Self { examined }))
    }

    /// The verdict on another data set, which must hold the same observables, with detection limits as of `limits`
    /// simulated draws. `None` where an observable is missing.
    ///
    /// # Errors
    /// A fit or an attribution that fails.
    pub fn judge(&self, set: &Measured, limits: usize) -> Result<Option<PanelRows>, StageError> {
        let Some(case) = self.case(set)? else { return Ok(None) };
        let candidates = self.examined.contenders.iter().map(|c| c.candidate(&case)).collect::<Result<Vec<_>, _>>()?;
        let options = Options { power_draws: limits, ..options(&case) };
        let attribution: Attribution = attributed(&case, candidates, Vec::new(), options)?;
        Ok(Some(rows::of(&case, &attribution)))
    }

    /// Mean and standard deviation of the strength of a candidate given another data set, in its unit, as parameters and strength are
    /// drawn by the metamodels as they stand: without runs of its own along what that set leaves open, and not widened for
    /// the errors that such runs would take away. `None` where an observable is missing or no direct runs stand behind the candidate.
    ///
    /// # Errors
    /// A fit that fails.
    pub fn strength(&self, set: &Measured, candidate: &str) -> Result<Option<(f64, f64)>, StageError> {
        let known = self.examined.contenders.iter().find(|contender| contender.name() == candidate);
        let (Some(case), Some(known)) = (self.case(set)?, known) else { return Ok(None) };
        let mut contender = known.clone();
        contender.sample(&case)?;
        let (_, range) = contender.axis();
        let marginal = contender.draws().and_then(|draws| draws.marginals().pop());
        Ok(marginal.map(|marginal| (strength_at(range, marginal.mean), marginal.sd * (range.1 - range.0))))
    }

    /// Another data set beside the runs of the reference.
    fn case<'s>(&'s self, set: &'s Measured) -> Result<Option<Case<'s>>, StageError> {
        let Examined { case: known, surface, .. } = &self.examined;
        let Some(evidence) = known.evidence.of(set) else { return Ok(None) };
        let shape = known.shape.clone();
        let Some(noise) = evidence.noise(&known.before, &shape) else { return Ok(None) };
        let weights = Weights { noise: &noise.covariance, correlation: &shape.correlation };
        let start = [known.optimum.as_slice().to_vec()];
        let parameters = |start: &[f64]| fit::parameters(known.context.config, set, start);
        let first = weights.at(surface, &known.optimum);
        let fitted = fit::two_passes(surface, &evidence, weights, (&first, &start), parameters)?.fit;
        let trends = |i: usize| if evidence.statistics[i].moment == Moment::Trend { 0.0 } else { 1.0 };
        let all = surface.uncertainty(&fitted.parameters, &shape.correlation);
        let covariance = DMatrix::from_fn(all.nrows(), all.ncols(), |i, j| trends(i) * trends(j) * all[(i, j)]);
        let values = surface.predict(&fitted.parameters).0.as_slice().to_vec();
        Ok(Some(Case {
            context: known.context,
            set,
            noise,
            slopes: surface.slopes(&fitted.parameters, &shape.correlation),
            optimum_covariance: fitted.covariance,
            at_bound: fit::at_bound(&fitted.parameters),
            before: known.before.clone(),
            runs: known.runs.clone(),
            model: Moments { values, covariance },
            optimum: fitted.parameters,
            evidence,
            shape,
            left_out: known.left_out.clone(),
        }))
    }
}
