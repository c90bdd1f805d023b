//! The model with one effect in it: parameters and strength together.
//!
//! Metamodels over both are fitted to all statistics; where it matters, direct runs at the optimum join what they predict
//! from, which **ties** them to the simulation, and the fit is repeated until it stays. From the same model comes the signature that the attribution
//! judges: the change of every statistic along the path on which the parameters follow the strength, less what the
//! slopes at θ̂ predict for that move,
//!
//! g(η) = [F(θ(η), η) − F(θ̂, 0)]/η − J (θ(η) − θ̂)/η.
//!
//! With it the linear model of the attribution equals F along the path, however an effect bends or saturates and
//! however far the parameters move.

use super::anchors::{Anchors, place_of, strength_at};
use super::closer::{Look, Run, Seen, Stood};
use super::direct::Axis;
use super::fit::{self, Fitted, Surface, Weights};
use super::lab::Lab;
use super::moments::{Batch, Moment, Shape};
use super::scatter::Scatter;
use super::verdict::Case;
use crate::campaign::CampaignError;
use crate::effects::{self, Handle};
use crate::experiments::Experiment;
use crate::rng::Stream;
use crate::settings::{Scope, Settings};
use crate::stages::StageError;
use crate::stages::models::Models;
use crate::stats::attribution::{Candidate, GlsFit, Parameter, Presence, Profile, Signature};
use crate::stats::ensemble::{Length, Sample, around, sample, walkers};
use nalgebra::{DMatrix, DVector};

/// Share of its range below which a strength is as good as zero, and says nothing per unit.
const NOTHING: f64 = 0.01;
/// Strengths at which a signature is taken, as shares of an end of the range.
const SHARES: [f64; 5] = [0.125, 0.25, 0.5, 0.75, 1.0];
/// The least share used of metamodels alone, whose error per unit of strength grows towards zero.
const LEAST_UNTIED: f64 = 0.25;
/// The least share at which direct runs give a signature: below, the change is mostly the scatter of these runs.
const LEAST_TIED: f64 = 0.125;
/// Standard errors from zero within which direct runs do not tell a strength from it (two-sided, 5 %).
const TOLD: f64 = 1.96;

/// The largest share of feigned information that draws are widened for, to twice their width.
const MOST_FEIGNED: f64 = 0.5;

/// The least standard deviation from which a walker starts, for parameters that a bound holds.
const LEAST_START: f64 = 0.02;

/// Why a candidate that was left out of the library cannot be named.
const LEFT_OUT: &str = "it was left out of the library";

/// A candidate effect with its model, if it has one.
#[derive(Clone)]
pub struct Contender {
    /// The effect.
    effect: Handle,
    /// Metamodels over parameters and strength, or why there are none.
    surface: Result<Surface, String>,
    /// −2 ln likelihood at the optimum of the metamodels, up to a constant.
    misfit: Option<f64>,
    /// Repetitions with it, where it is drawn anew for each.
    scatter: Option<Scatter>,
    tie: Option<Tie>,
    was_run: bool,
    /// Whether the runs left it no strength.
    absent: bool,
    open: Option<Open>,
}

/// What the data leave open.
#[derive(Clone)]
struct Open {
    /// Draws of the parameters and the place of the strength by the likelihood of the metamodels.
    draws: Sample,
    /// Share of the information along every one of [`Sample::steps`] that errors of the metamodels can feign; that on the strength
    /// comes last.
    feigned: Vec<f64>,
}

impl Open {
    /// The draws as wide as the metamodels' errors make them.
    ///
    /// These errors also make places look different that are not, and move the optimum among them. Where they feign a share ν of
    /// the information along a step, 1 − ν of it is real, and the optimum has a variance of 1 − ν from the noise and of ν from the
    /// errors, over (1 − ν)²: the draws are as wide as that, 1/(1 − ν) times, along the line on which the parameters follow the
    /// strength and along the principal axes across it. Assumes that all statistics are linear along a step and that errors a standard
    /// deviation apart are independent of each other.
    fn widened(&self) -> Sample {
        let factors: Vec<f64> = self.feigned.iter().map(|share| 1.0 / (1.0 - share.min(MOST_FEIGNED))).collect();
        self.draws.stretched(&factors)
    }
}

/// What direct runs around the joint optimum and at it tell.
#[derive(Clone)]
struct Tie {
    /// Where the runs at the optimum were made.
    x: DVector<f64>,
    /// These runs.
    batch: Batch,
    /// How repetitions scatter there and around it.
    shape: Shape,
}

/// The optimum with the effect in the model.
pub struct JointFit {
    /// Fit over the parameters in the unit cube and the place of the strength in its range.
    pub fit: GlsFit,
    /// Parameters in the unit cube.
    pub u: DVector<f64>,
    /// Strength in its unit.
    pub strength: f64,
}

/// Parameters and strength of the model with the effect.
pub struct Estimate {
    /// Parameters in the unit cube.
    pub u: DVector<f64>,
    /// Strength in its unit.
    pub strength: f64,
    /// Covariance of the parameters and of the place of the strength in its range.
    pub covariance: DMatrix<f64>,
    /// Whether the joint optimum lies on a bound, of the parameters and of the strength.
    pub at_bound: Vec<bool>,
}

impl Contender {
    /// Trains the model of a candidate for the statistics of a case.
    pub fn new(case: &Case, models: &Models, anchors: &Anchors, name: &str) -> Result<Self, StageError> {
        let effect = case.context.config.effects.library.find(name).map_err(CampaignError::from)?;
        let trained = Surface::joint(case.context, models, anchors, (name, effect.range()), &case.evidence.statistics);
        let without = |(u, batch): &Run| (u.clone().push(place_of(effect.range(), 0.0)), batch.clone());
        let mut runs: Vec<Run> = case.runs.iter().map(without).collect();
        runs.push(without(&(case.optimum.clone(), case.before.clone())));
        let surface = trained.map(|surface| surface.knowing(&runs));
        let scattering = surface.as_ref().ok().filter(|_| effect.is_scatter());
        let scatter = scattering.map(|known| Scatter::of(known, anchors, (name, effect.range().1)));
        let mut contender =
            Self { effect, surface, misfit: None, scatter, tie: None, was_run: false, absent: false, open: None };
        contender.misfit = match &contender.surface {
            Ok(surface) => Some(contender.optimum(case, surface)?.misfit),
            Err(_) => None,
        };
        Ok(contender)
    }

    /// Name of the effect.
    pub fn name(&self) -> &str {
        self.effect.name()
    }

    /// Unit of the strength.
    pub fn unit(&self) -> &str {
        self.effect.unit()
    }

    /// How badly the metamodels fit with this effect, −2 ln likelihood up to a constant; none without metamodels.
    pub fn misfit(&self) -> Option<f64> {
        self.misfit
    }

    /// Whether direct runs were asked for.
    pub fn was_run(&self) -> bool {
        self.was_run
    }

    /// Whether direct runs stand behind the model.
    pub fn is_tied(&self) -> bool {
        self.tie.is_some()
    }

    /// Runs the simulation around the joint optimum and at it. Nothing is run where the strength comes out as zero.
    pub fn tie(&mut self, case: &Case, lab: &mut Lab) -> Result<(), StageError> {
        self.was_run = true;
        let Some(found) = self.fit(case)? else { return Ok(()) };
        self.absent = !self.has_strength(&found);
        if self.absent {
            return Ok(());
        }
        let Some(seen) = self.seen(case, lab, found)? else { return Ok(()) };
        self.absent = !self.has_strength(&self.joint(case, seen.fit.clone()));
        if self.absent {
            self.surface = Ok(seen.surface);
            return Ok(());
        }
        self.stand(case, lab, seen)
    }

    /// The same where the strength comes out as zero, for other data sets of the same truth.
    pub fn tie_anyway(&mut self, case: &Case, lab: &mut Lab) -> Result<(), StageError> {
        let Some(found) = self.fit(case)? else { return Ok(()) };
        let Some(seen) = self.seen(case, lab, found)? else { return Ok(()) };
        self.absent = false;
        self.stand(case, lab, seen)
    }

    /// Runs around the joint optimum; `None` without a model.
    fn seen(&self, case: &Case, lab: &mut Lab, found: JointFit) -> Result<Option<Seen>, StageError> {
        let Ok(global) = &self.surface else { return Ok(None) };
        let parameters = |start: &[f64]| self.parameters(case, start);
        self.look(case, &parameters).settle(lab, global.clone(), found.fit).map(Some)
    }

    /// Runs at the joint optimum, which tie the metamodels there. They stay as they are where an observable could not be measured.
    fn stand(&mut self, case: &Case, lab: &mut Lab, seen: Seen) -> Result<(), StageError> {
        let parameters = |start: &[f64]| self.parameters(case, start);
        let label = format!("{}/with {}", case.set.name, self.name());
        if let Some(Stood { surface, optimum: x, batch, shape, .. }) =
            self.look(case, &parameters).stand(lab, &label, seen, None)?
        {
            self.surface = Ok(surface);
            self.tie = Some(Tie { x, batch, shape });
        }
        Ok(())
    }

    fn look<'a>(&'a self, case: &'a Case, parameters: &'a dyn Fn(&[f64]) -> Vec<Parameter>) -> Look<'a> {
        Look {
            context: case.context,
            evidence: &case.evidence,
            label: format!("{}/around {}", case.set.name, self.name()),
            effect: Some(self.axis()),
            weights: Weights { noise: &case.noise.covariance, correlation: &case.shape.correlation },
            parameters,
            starts: self.starts(case),
        }
    }

    /// How repetitions scatter with the effect as it is fitted; without runs of it, as they do without it.
    fn shape<'a>(&'a self, case: &'a Case) -> &'a Shape {
        self.tie.as_ref().map_or(&case.shape, |tie| &tie.shape)
    }

    /// The runs at the tie with their strength.
    fn direct(&self) -> Option<(f64, &Batch)> {
        let at = |tie: &Tie| strength_at(self.effect.range(), tie.x[tie.x.len() - 1]);
        self.tie.as_ref().map(|tie| (at(tie), &tie.batch))
    }

    /// Covariance of the measured values, with the scatter of the runs at the tie.
    fn noise(&self, case: &Case) -> DMatrix<f64> {
        let known = self.tie.as_ref().and_then(|tie| case.evidence.noise(&tie.batch, &tie.shape));
        known.map_or_else(|| case.noise.covariance.clone(), |noise| noise.covariance)
    }

    /// What the runs with the effect say of its strength. One that gives a signature is told by the attribution itself; a smaller
    /// one is judged by metamodels at larger strengths, which must not see more than the runs do.
    fn presence(&self, found: &JointFit) -> Presence {
        let sd = || self.width() * sds(&found.fit.covariance).last().copied().unwrap_or(0.0);
        if self.absent || (self.is_tied() && !self.has_strength(found)) {
            Presence::Absent
        } else if self.is_tied() && !self.gives_signature(found) && found.strength.abs() < TOLD * sd() {
            Presence::Untold
        } else {
            Presence::Present
        }
    }

    /// Whether the direct runs at a strength give a signature.
    fn gives_signature(&self, found: &JointFit) -> bool {
        self.share(found.strength) >= LEAST_TIED
    }

    fn has_strength(&self, found: &JointFit) -> bool {
        found.strength.abs() >= NOTHING * self.width()
    }

    /// The joint optimum over the model as it stands; `None` without a model.
    pub fn fit(&self, case: &Case) -> Result<Option<JointFit>, StageError> {
        let Ok(surface) = &self.surface else { return Ok(None) };
        Ok(Some(self.joint(case, self.optimum(case, surface)?.fit)))
    }

    /// Tells the metamodels of further runs.
    pub fn learn(&mut self, runs: &[Run]) {
        if let Ok(surface) = &mut self.surface {
            *surface = surface.knowing(runs);
        }
    }

    /// Samples parameters and strength given the data. The optimum alone would be judged by the metamodels' error there,
    /// where direct runs make it small. Nothing is sampled without such runs.
    pub fn sample(&mut self, case: &Case) -> Result<(), StageError> {
        let (true, Ok(surface), Some(JointFit { fit, .. })) = (self.is_tied(), &self.surface, self.fit(case)?) else {
            return Ok(());
        };
        let noise = self.noise(case);
        let weights = Weights { noise: &noise, correlation: &self.shape(case).correlation };
        let parameters = self.parameters(case, fit.parameters.as_slice());
        let ln_density = |x: &[f64]| {
            weights.ln_posterior(surface, &case.evidence.values, &parameters, &DVector::from_column_slice(x))
        };
        let sd: Vec<f64> = sds(&fit.covariance).into_iter().map(|sd| sd.max(LEAST_START)).collect();
        let mut stream = Stream::new(case.context.seed(&format!("strength {}", self.name())), "posterior walkers");
        let start = around(fit.parameters.as_slice(), &sd, walkers(sd.len()), &mut stream);
        let draws = sample(start, ln_density, Length::default(), stream);
        let feigned = feigned(surface, weights, &draws);
        self.open = Some(Open { draws, feigned });
        Ok(())
    }

    /// Share of the information on the strength that errors of the metamodels can feign; none where nothing was sampled.
    pub fn feigned(&self) -> Option<f64> {
        self.open.as_ref()?.feigned.last().copied()
    }

    /// Draws of the parameters and the place of the strength by the likelihood of the metamodels, if they were sampled.
    pub fn draws(&self) -> Option<&Sample> {
        self.open.as_ref().map(|open| &open.draws)
    }

    /// What the last coordinate of its model means.
    pub fn axis(&self) -> Axis<'_> {
        (self.effect.name(), self.effect.range())
    }

    /// Mean and standard deviation of the strength given the data, if it was sampled.
    pub fn strength(&self) -> Option<(f64, f64)> {
        let marginal = self.open.as_ref()?.widened().marginals().pop()?;
        Some((strength_at(self.effect.range(), marginal.mean), marginal.sd * self.width()))
    }

    /// Parameters and strength given the data: mean and standard deviation of the draws, or the joint optimum with its
    /// errors where nothing was sampled; `None` without a model.
    pub fn estimate(&self, case: &Case) -> Result<Option<Estimate>, StageError> {
        let Some(JointFit { fit, u, strength }) = self.fit(case)? else { return Ok(None) };
        let at_bound = fit.at_bound.iter().map(Option::is_some).collect();
        let Some(draws) = self.open.as_ref().map(Open::widened) else {
            return Ok(Some(Estimate { u, strength, covariance: fit.covariance, at_bound }));
        };
        let means: Vec<f64> = draws.marginals().iter().map(|marginal| marginal.mean).collect();
        let (u, place) = means.split_at(u.len());
        let strength = strength_at(self.effect.range(), place[0]);
        let covariance = draws.covariance();
        Ok(Some(Estimate { u: DVector::from_column_slice(u), strength, covariance, at_bound }))
    }

    /// Slopes of the statistics over the parameters and the strength at an estimate (m × (p + 1)); `None` without a model.
    pub fn slopes(&self, found: &Estimate) -> Option<DMatrix<f64>> {
        let x = found.u.clone().push(self.place(found.strength));
        Some(self.surface.as_ref().ok()?.predict(&x).1)
    }

    /// The place of a strength in its range.
    pub fn place(&self, strength: f64) -> f64 {
        place_of(self.effect.range(), strength)
    }

    /// Width of the range of the strength.
    pub fn width(&self) -> f64 {
        let (lower, upper) = self.effect.range();
        upper - lower
    }

    fn joint(&self, case: &Case, fit: GlsFit) -> JointFit {
        let (p, range) = (case.optimum.len(), self.effect.range());
        let (u, strength) = (fit.parameters.rows(0, p).into_owned(), strength_at(range, fit.parameters[p]));
        JointFit { fit, u, strength }
    }

    /// The optimum of the metamodels.
    fn optimum(&self, case: &Case, surface: &Surface) -> Result<Fitted, StageError> {
        let noise = self.noise(case);
        let weights = Weights { noise: &noise, correlation: &self.shape(case).correlation };
        let typical = self.tie.as_ref().map_or_else(|| case.covariance(), |tie| weights.at(surface, &tie.x));
        let parameters = |start: &[f64]| self.parameters(case, start);
        fit::two_passes(surface, &case.evidence, weights, (&typical, &self.starts(case)), parameters)
    }

    /// The optimum of the plain model and the centre, with a few strengths on either side of zero.
    fn starts(&self, case: &Case) -> Vec<Vec<f64>> {
        let range = self.effect.range();
        let from = |u: &[f64], strength: f64| [u, &[place_of(range, strength)]].concat();
        let centre = vec![0.5; case.optimum.len()];
        let nodes = self.nodes(&[0.1, 0.4, 0.8]);
        let free = nodes.into_iter().flat_map(|node| [from(case.optimum.as_slice(), node), from(&centre, node)]);
        self.tie.iter().map(|tie| tie.x.as_slice().to_vec()).chain(free).collect()
    }

    /// A strength as a share of the end of the range on its side.
    fn share(&self, strength: f64) -> f64 {
        let (lower, upper) = self.effect.range();
        strength / if strength < 0.0 { lower } else { upper }
    }

    /// Strengths at given shares of both ends of the range, ascending.
    fn nodes(&self, shares: &[f64]) -> Vec<f64> {
        let (lower, upper) = self.effect.range();
        let ends = [lower, upper].into_iter().filter(|end| *end != 0.0);
        let mut all: Vec<f64> = ends.flat_map(|end| shares.iter().map(move |share| share * end)).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    fn parameters(&self, case: &Case, start: &[f64]) -> Vec<Parameter> {
        let p = start.len() - 1;
        let mut parameters = fit::parameters(case.context.config, case.set, &start[..p]);
        let name = self.name().to_owned();
        parameters.push(Parameter { name, value: start[p], lower: 0.0, upper: 1.0, prior: None });
        parameters
    }

    /// Whether the data hold the kind of evidence in which the effect shows itself, else what is missing.
    fn shown_by(&self, case: &Case) -> Result<(), String> {
        let config = case.context.config;
        let changed = |experiment: &&dyn Experiment| {
            let read = |settings: &Settings| {
                [Scope::Simulate, Scope::Measure].map(|scope| settings.for_experiment(experiment.name(), scope))
            };
            let mut settings = config.base_settings().clone();
            let (lower, upper) = self.effect.range();
            let end = if upper > 0.0 { upper } else { lower };
            let applied = effects::apply(&*self.effect, end, &mut settings, 1, 1);
            applied.is_err() || read(&settings) != read(config.base_settings())
        };
        let least = config.diagnose.thresholds.sd_from;
        if !config.experiments().iter().any(changed) {
            Err("it changes nothing that the fitted experiments read".to_owned())
        } else if self.effect.is_drift() && !case.evidence.has(Moment::Trend) {
            Err(format!("there are no trends; give single values of {least} repetitions or more"))
        } else if self.effect.is_scatter() && !case.evidence.has(Moment::LnSd) {
            Err(format!("there are no standard deviations from {least} repetitions or more"))
        } else {
            Ok(())
        }
    }

    /// The joint fit as the likelihood has it.
    fn profile(&self, case: &Case, fitted: &Fitted, found: &JointFit) -> Option<Profile> {
        let without = fit::ln_det(&case.covariance().cholesky()?);
        let sd = self.width() * sds(&found.fit.covariance).last()?;
        Some(Profile {
            strength: if self.has_strength(found) { found.strength } else { 0.0 },
            sd: (sd > 0.0).then_some(sd),
            leaves: found.fit.chi2,
            misfit: fitted.misfit - without,
        })
    }

    /// What the attribution judges.
    pub fn candidate(&self, case: &Case) -> Result<Candidate, StageError> {
        let (m, p) = (case.model.values.len(), case.optimum.len());
        // A placeholder keeps an effect without a model in the list, where it is reported as not testable.
        let strength = self.nodes(&[1.0])[0];
        let nothing = Signature { strength, per_unit: DVector::zeros(m), shift: DVector::zeros(p) };
        let mut candidate = Candidate {
            name: self.name().to_owned(),
            unit: self.unit().to_owned(),
            range: self.effect.range(),
            signatures: vec![nothing],
            fitted: 0.0,
            covariance: DMatrix::zeros(m, m),
            testable: self.surface.as_ref().map(|_| ()).map_err(String::clone),
            presence: Presence::Present,
            leaves: 0.0,
            profile: None,
            scatter: self.scatter.as_ref().and_then(|scatter| scatter.in_case(case, self.direct())),
        };
        let Ok(surface) = &self.surface else { return Ok(candidate) };
        let fitted = self.optimum(case, surface)?;
        let found = self.joint(case, fitted.fit.clone());
        if let Err(why) = self.shown_by(case) {
            candidate.testable = Err(why);
            return Ok(candidate);
        }
        if case.leaves_out(self.name()) {
            candidate.testable = Err(LEFT_OUT.to_owned());
        }
        candidate.presence = self.presence(&found);
        if self.was_run && candidate.presence != Presence::Absent && !self.is_tied() {
            candidate.testable = Err("an observable could not be measured in the runs with it".to_owned());
            return Ok(candidate);
        }
        let tied = self.is_tied() && self.gives_signature(&found);
        if self.is_tied() && !tied {
            candidate.leaves = found.fit.chi2;
        }
        candidate.profile = self.profile(case, &fitted, &found);
        let path = Path { contender: self, case, surface, tied };
        candidate.signatures = path.signatures(&found)?;
        candidate.fitted = found.strength;
        candidate.covariance = path.error(&found);
        Ok(candidate)
    }
}

/// Share of the information along every step of the draws that errors of the metamodels can feign: tr Σ⁻¹C/4 with C the covariance
/// of their error in the change between the places one step to either side of the mean, where the information is 1 by the draws'
/// width. Between 0 and 1.
fn feigned(surface: &Surface, weights: Weights, draws: &Sample) -> Vec<f64> {
    let at = |step: &[f64], k: f64| DVector::from_vec(draws.at(step, k));
    let steps = draws.steps();
    let factor = weights.at(surface, &at(&steps[0], 0.0)).cholesky();
    let share = |step: &Vec<f64>| {
        let change = surface.uncertainty_of_change(&at(step, -1.0), &at(step, 1.0), weights.correlation);
        factor.as_ref().map_or(1.0, |factor| (factor.solve(&change).trace() / 4.0).min(1.0))
    };
    steps.iter().map(share).collect()
}

/// Standard deviations behind a covariance.
pub fn sds(covariance: &DMatrix<f64>) -> Vec<f64> {
    covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
}

/// The way of the parameters as the strength grows.
struct Path<'a> {
    contender: &'a Contender,
    case: &'a Case<'a>,
    surface: &'a Surface,
    /// Whether direct runs stand behind the fitted strength and tell it from zero.
    tied: bool,
}

impl Path<'_> {
    /// Signatures at ascending strengths, the fitted one among them when it is tied.
    fn signatures(&self, found: &JointFit) -> Result<Vec<Signature>, StageError> {
        let shares: Vec<f64> = SHARES.into_iter().filter(|share| self.tied || *share >= LEAST_UNTIED).collect();
        let mut nodes = self.contender.nodes(&shares);
        if self.tied {
            nodes.retain(|node| (node - found.strength).abs() > 0.2 * found.strength.abs());
            nodes.push(found.strength);
            nodes.sort_by(f64::total_cmp);
        }
        nodes.into_iter().map(|strength| self.signature(strength, found)).collect()
    }

    fn signature(&self, strength: f64, found: &JointFit) -> Result<Signature, StageError> {
        let is_fitted = strength == found.strength;
        let u = if is_fitted { found.u.clone() } else { self.parameters_at(strength, found)? };
        let without = match is_fitted && self.tied {
            true => DVector::from_column_slice(&self.case.model.values),
            false => self.surface.predict(&self.at(&self.case.optimum, 0.0)).0,
        };
        let change = self.surface.predict(&self.at(&u, strength)).0 - without;
        let shift = (&u - &self.case.optimum) / strength;
        let per_unit = change / strength - &self.case.slopes.jacobian * &shift;
        Ok(Signature { strength, per_unit, shift })
    }

    fn at(&self, u: &DVector<f64>, strength: f64) -> DVector<f64> {
        u.clone().push(place_of(self.contender.effect.range(), strength))
    }

    /// The best parameters at another strength than the fitted one.
    fn parameters_at(&self, strength: f64, found: &JointFit) -> Result<DVector<f64>, StageError> {
        let model = |u: &DVector<f64>| {
            let (values, slopes) = self.surface.predict(&self.at(u, strength));
            (values, slopes.columns(0, u.len()).into_owned())
        };
        let start = fit::parameters(self.case.context.config, self.case.set, found.u.as_slice());
        Ok(fit::gls(model, &self.case.evidence.values, &self.case.covariance(), &start)?.parameters)
    }

    /// Covariance of a signature's error per unit of strength.
    ///
    /// Direct runs make the model as good at the tie as it is at the optimum without the effect, whose error the
    /// residual has already; of metamodels alone both errors count.
    fn error(&self, found: &JointFit) -> DMatrix<f64> {
        let (lower, upper) = self.contender.effect.range();
        let m = self.case.model.values.len();
        if self.tied {
            return DMatrix::zeros(m, m);
        }
        let half = if upper > 0.0 { 0.5 * upper } else { 0.5 * lower };
        let known = found.strength.abs() >= LEAST_UNTIED * half.abs();
        let (u, strength) = if known { (&found.u, found.strength) } else { (&self.case.optimum, half) };
        let error = |x: &DVector<f64>| self.surface.uncertainty(x, &self.case.shape.correlation);
        let both = error(&self.at(u, strength)) + error(&self.at(&self.case.optimum, 0.0));
        both / (strength * strength)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::points::Points;

    /// By its own share along the line, and by the other's across it.
    #[test]
    fn draws_are_widened_by_what_errors_feign_to_twice_their_width_at_most() {
        let points = Points::from_rows(&[[0.6, 0.4], [0.5, 0.4], [0.5, 0.6], [0.4, 0.6]], 2).expect("pairs");
        let draws = Sample { points, ln_density: vec![0.0; 4], acceptance: 0.5, autocorrelation_time: 1.0 };
        let variance = |line: f64, across: f64| 0.0025 * (line * line + across * across);
        for (feigned, factor) in [(0.0, 1.0), (0.2, 1.25), (0.5, 2.0), (0.9, 2.0)] {
            for (shares, expected) in [(vec![0.0, feigned], [1.0, factor]), (vec![feigned, 0.0], [factor, 1.0])] {
                let wide = Open { draws: draws.clone(), feigned: shares }.widened().covariance();
                let [across, line] = expected;
                let whole = [variance(line, across), -0.005 * line * line, 0.01 * line * line];
                let seen = [wide[(0, 0)], wide[(0, 1)], wide[(1, 1)]];
                assert!(seen.iter().zip(whole).all(|(seen, whole)| (seen - whole).abs() < 1e-12), "{wide}");
            }
        }
    }
}
