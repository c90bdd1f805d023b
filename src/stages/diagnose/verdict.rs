//! One data set from its evidence to its verdict.

use super::anchors::Anchors;
use super::before_after;
use super::closer::{Look, Run, Seen, Stood};
use super::controls::Offset;
use super::doubts::Doubt;
use super::evidence::{Evidence, Noise, statistic};
use super::fit::{self, Slopes, Surface, Weights};
use super::joint::Contender;
use super::lab::Lab;
use super::moments::{Batch, Moment, Moments, Shape, Statistic};
use super::{Tables, along, proposals, rows};
use crate::config::{Accept, Measured, MeasuredSource, Resolution};
use crate::stages::models::Models;
use crate::stages::{Context, StageError};
use crate::stats::attribution::{
    Attribution, Candidate, Correlations, GlsFit, Options, Problem, Proposal, Row, RowKind, Verdict, attribute,
};
use nalgebra::{DMatrix, DVector};

/// How many candidates must stand on direct runs before there is a verdict.
const LEADERS: usize = 3;
/// How much worse, in −2 ln likelihood, the metamodels may fit with a candidate than with the best one for it to be run:
/// far more than their errors can be wrong by.
pub const HOPELESS: f64 = 50.0;

/// Everything known of one data set before its attribution.
pub struct Case<'a> {
    /// The study.
    pub context: &'a Context<'a>,
    /// The data set.
    pub set: &'a Measured,
    /// Its statistics.
    pub evidence: Evidence,
    /// How well they are known.
    pub noise: Noise,
    /// Slopes of the statistics around the optimum.
    pub slopes: Slopes,
    /// Optimum of the plain model in the unit cube.
    pub optimum: DVector<f64>,
    /// Covariance of the optimum.
    pub optimum_covariance: DMatrix<f64>,
    /// Which parameters a bound holds.
    pub at_bound: Vec<bool>,
    /// Runs at the optimum.
    pub before: Batch,
    /// Runs around the optimum, and where it was thought to be before.
    pub runs: Vec<Run>,
    /// Statistics of those runs.
    pub model: Moments,
    /// How the repetitions near the optimum scatter.
    pub shape: Shape,
    /// A candidate that may not be named.
    pub left_out: Option<String>,
}

/// A data set with all that was found out about it.
pub struct Examined<'a> {
    /// Evidence, optimum and runs of the plain model.
    pub case: Case<'a>,
    /// Metamodels over the parameters, which know the runs at the optimum.
    pub surface: Surface,
    /// The candidate effects with their models.
    pub contenders: Vec<Contender>,
    /// What the attribution judged, one per contender.
    pub candidates: Vec<Candidate>,
    /// Its result.
    pub attribution: Attribution,
}

/// A fitted data set with the metamodels it was fitted by, or why there can be no comparison.
pub type Prepared<'a> = Result<(Case<'a>, Surface), String>;

/// Diagnoses one data set and adds its rows; what of it no fit has seen enters the comparison before and after alone.
pub fn diagnose(
    models: &Models,
    anchors: &Anchors,
    lab: &mut Lab,
    ((set, unseen), prepared): ((&Measured, &Measured), Prepared),
    tables: &mut Tables,
) -> Result<(), StageError> {
    let prepared = match prepared {
        Ok(prepared) => prepared,
        Err(why) => {
            tables.verdicts.push(rows::no_verdict(&set.name, why));
            return Ok(());
        }
    };
    let Examined { case, mut contenders, candidates, mut attribution, .. } = examine(models, anchors, lab, prepared)?;
    let accepted = accepted(&case, &attribution);
    for contender in &mut contenders {
        match accepted.as_deref() == Some(contender.name()) {
            true => along::follow(&case, contender, lab)?,
            false => contender.sample(&case)?,
        }
        state_strength(contender, &mut attribution);
    }
    rows::write(&case, &contenders, &candidates, &attribution, tables);
    let added = accepted.and_then(|name| contenders.iter().find(|contender| contender.name() == name));
    before_after::compare((&case, unseen), lab, added, tables)
}

/// Runs the candidates of a fitted data set and attributes its residual.
pub fn examine<'a>(
    models: &Models,
    anchors: &Anchors,
    lab: &mut Lab,
    (case, surface): (Case<'a>, Surface),
) -> Result<Examined<'a>, StageError> {
    let names = &case.context.config.diagnose.candidates;
    let mut contenders: Vec<Contender> = case
        .context
        .campaign
        .install(|| names.iter().map(|name| Contender::new(&case, models, anchors, name)).collect::<Result<_, _>>())?;
    loop {
        let candidates = contenders.iter().map(|c| c.candidate(&case)).collect::<Result<Vec<_>, _>>()?;
        let mut attribution = attributed(&case, candidates.clone(), Vec::new(), options(&case))?;
        match next_leader(&case, &attribution, &mut contenders) {
            Some(leader) => leader.tie(&case, lab)?,
            None => {
                if matches!(attribution.verdict, Verdict::Class { .. }) {
                    let proposals = proposals::all(&case, models, anchors, &candidates, &attribution.verdict.names());
                    attribution = attributed(&case, candidates.clone(), proposals, options(&case))?;
                }
                return Ok(Examined { case, surface, contenders, candidates, attribution });
            }
        }
    }
}

/// States the strength of an effect as the model with it has it given the data, where direct runs stand behind that model:
/// the attribution's own is that of a path around the optimum without the effect.
fn state_strength(contender: &Contender, attribution: &mut Attribution) {
    let Some((strength, sd)) = contender.strength() else { return };
    for effect in attribution.effects.iter_mut().filter(|effect| effect.name == contender.name()) {
        (effect.strength, effect.strength_sd) = (strength, sd);
    }
    for member in attribution.verdict.alone_mut().into_iter().filter(|member| member.name == contender.name()) {
        (member.strength, member.sd) = (strength, sd);
    }
}

/// Evidence, optimum and runs of a data set less the model's own `offset`.
pub fn prepare<'a>(
    context: &'a Context<'a>,
    models: &Models,
    anchors: &Anchors,
    lab: &mut Lab,
    set: &'a Measured,
    offset: Option<&Offset>,
) -> Result<Prepared<'a>, StageError> {
    let evidence = Evidence::new(context.config, set, anchors.centre()).less(offset);
    if evidence.statistics.len() <= context.config.parameters.len() {
        return Ok(Err(format!(
            "only {} statistics are comparable, {} parameters are fitted: measure more observables",
            evidence.statistics.len(),
            context.config.parameters.len()
        )));
    }
    let Some(surface) = Surface::plain(context, models, anchors.centre(), &evidence.statistics) else {
        return Ok(Err("a metamodel of an observable is missing, see table metamodels".to_owned()));
    };
    let near = [anchors.centre().clone()];
    let parameters = |start: &[f64]| fit::parameters(context.config, set, start);
    let starts = fit::starts(context.config.parameters.len());
    let first = |evidence: &Evidence| -> Result<Option<(Shape, Noise, GlsFit)>, StageError> {
        let Some((shape, noise)) = evidence.scatter(&near) else { return Ok(None) };
        let weights = Weights { noise: &noise.covariance, correlation: &shape.correlation };
        let fit = fit::two_passes(&surface, evidence, weights, (&noise.covariance, &starts), parameters)?.fit;
        Ok(Some((shape, noise, fit)))
    };
    let Some((_, _, fit)) = first(&evidence)? else { return Ok(Err(UNMEASURED.to_owned())) };
    let Some(doubts) = doubts(context, lab, set, (&evidence, &fit))? else { return Ok(Err(UNMEASURED.to_owned())) };
    let evidence = evidence.doubting(doubts);
    let Some((shape, noise, fit)) = first(&evidence)? else { return Ok(Err(UNMEASURED.to_owned())) };
    let weights = Weights { noise: &noise.covariance, correlation: &shape.correlation };
    let look = Look {
        context,
        evidence: &evidence,
        label: format!("{}/around", set.name),
        effect: None,
        weights,
        parameters: &parameters,
        starts,
    };
    // Where a verdict is to follow, here or for another set, runs around the optimum correct it.
    let seen = match comparable(context, set) || is_control(context, set) {
        true => look.settle(lab, surface, fit)?,
        false => Seen { surface, fit, runs: Vec::new() },
    };
    let [centre] = &near;
    let Some(stood) = look.stand(lab, &format!("{}/before", set.name), seen, Some(centre))? else {
        return Ok(Err(UNMEASURED.to_owned()));
    };
    let Stood { surface, optimum, covariance, batch: before, runs, shape, noise } = stood;
    let Some(model) = before.moments(&evidence.statistics, &shape) else { return Ok(Err(UNMEASURED.to_owned())) };
    let case = Case {
        context,
        set,
        slopes: surface.slopes(&optimum, &shape.correlation),
        model: without_trends(&evidence, model),
        evidence,
        noise,
        at_bound: fit::at_bound(&optimum),
        optimum,
        optimum_covariance: covariance,
        before,
        runs,
        shape,
        left_out: context.config.diagnose.left_out.clone(),
    };
    Ok(Ok((case, surface)))
}

/// What uncertain settings may shift, of the held-out experiment too; `None` where an observable could not be measured.
fn doubts(
    context: &Context,
    lab: &mut Lab,
    set: &Measured,
    (evidence, fit): (&Evidence, &GlsFit),
) -> Result<Option<Vec<Doubt>>, StageError> {
    let validate = context.config.validate.experiment.name();
    let summaries = set.statistics();
    let held_out = summaries.iter().filter(|summary| summary.experiment == validate);
    let held_out = held_out.flat_map(|summary| [Moment::Mean, Moment::LnSd].map(|moment| statistic(summary, moment)));
    let statistics: Vec<Statistic> = evidence.statistics.iter().cloned().chain(held_out).collect();
    let own = context.config.uncertain.iter().filter(|uncertain| uncertain.measured == set.name);
    own.map(|uncertain| Doubt::see(context, lab, (uncertain, fit.parameters.as_slice()), &statistics)).collect()
}

/// Statistics of the plain model: its repetitions are independent, so that its trends are zero and known to be. What is
/// left of their variance only keeps the correlations.
fn without_trends(evidence: &Evidence, mut model: Moments) -> Moments {
    for (i, _) in evidence.statistics.iter().enumerate().filter(|(_, s)| s.moment == Moment::Trend) {
        model.values[i] = 0.0;
        model.covariance.row_mut(i).scale_mut(KNOWN);
        model.covariance.column_mut(i).scale_mut(KNOWN);
    }
    model
}

/// Factor on standard deviations that makes them negligible.
const KNOWN: f64 = 1e-4;

const UNMEASURED: &str = "an observable could not be measured at the optimum, see table diagnose_kpis";

impl Case<'_> {
    /// Measured minus simulated at the optimum.
    pub fn residual(&self) -> DVector<f64> {
        &self.evidence.values - DVector::from_column_slice(&self.model.values)
    }

    /// Covariance of the residual.
    pub fn covariance(&self) -> DMatrix<f64> {
        &self.noise.covariance + &self.model.covariance
    }

    /// Whether a candidate was left out of the library.
    pub fn leaves_out(&self, name: &str) -> bool {
        self.left_out.as_deref() == Some(name)
    }

    /// Whether the set-up resolves the data, else why not.
    fn attributable(&self) -> Result<(), String> {
        if comparable(self.context, self.set) {
            return Ok(());
        }
        Err(match self.context.config.study.resolution {
            Resolution::Coarse => {
                "a coarse set-up is its own model, and its offset to the full one is not in the store"
            }
            Resolution::Full => "the study says that its set-up does not resolve these data",
        }
        .to_owned())
    }
}

/// Whether the study says that its set-up resolves the data, or that its offset is known.
fn comparable(context: &Context, set: &Measured) -> bool {
    let resolved = |source: &MeasuredSource| source.comparable || !source.controls.is_empty();
    context.config.measured.iter().any(|source| source.name == set.name && resolved(source))
}

/// Whether the offset of another set is seen in this one.
fn is_control(context: &Context, set: &Measured) -> bool {
    context.config.measured.iter().any(|source| source.controls.contains(&set.name))
}

/// What the attribution finds in a case, and what each proposal would add where effects stand side by side.
pub fn attributed(
    case: &Case,
    candidates: Vec<Candidate>,
    proposals: Vec<Proposal>,
    options: Options,
) -> Result<Attribution, StageError> {
    let statistics = case.evidence.statistics.iter().enumerate();
    let row = |(index, statistic): (usize, &super::moments::Statistic)| Row {
        name: rows::name(statistic),
        kind: match statistic.moment {
            Moment::Mean => RowKind::Mean,
            Moment::LnSd => RowKind::LnSd,
            Moment::Trend => RowKind::Trend,
        },
        count: case.evidence.counts[index],
        measured_share: case.noise.measured_share[index] * case.noise.covariance[(index, index)]
            / case.covariance()[(index, index)],
        group: index,
        // Tests are independent of each other.
        correlations: Some(Correlations {
            group: case
                .evidence
                .statistics
                .iter()
                .position(|other| other.experiment == statistic.experiment)
                .unwrap_or(index),
            dof: case.shape.correlated[index],
        }),
    };
    let problem = Problem {
        rows: statistics.map(row).collect(),
        residual: case.residual(),
        covariance: case.covariance(),
        parameters: fit::parameters(case.context.config, case.set, case.optimum.as_slice()),
        jacobian: case.slopes.jacobian.clone(),
        jacobian_covariance: case.slopes.covariance.clone(),
        candidates,
        proposals,
        attributable: case.attributable(),
    };
    attribute(&problem, &options).map_err(|error| StageError::Input {
        what: format!("the attribution of {} failed: {error}", case.set.name),
        remedy: "raise [diagnose] refine_repetitions, or leave out observables that repeat each other",
    })
}

/// Thresholds and sizes of the study.
pub fn options(case: &Case) -> Options {
    let diagnose = &case.context.config.diagnose;
    let thresholds = diagnose.thresholds;
    Options {
        adequacy_level: thresholds.adequacy,
        leftover_level: thresholds.leftover,
        signature_level: thresholds.resolved,
        class_rule: thresholds.class_delta,
        largest_class: thresholds.class_size as usize,
        odds: thresholds.odds,
        visibility: thresholds.visibility,
        pair_level: thresholds.pair_level,
        pair_evidence: thresholds.pair_freedom as usize,
        small_count: thresholds.sd_from as usize,
        null_draws: diagnose.bootstrap as usize,
        power_draws: diagnose.bootstrap as usize,
        power: thresholds.detection,
        largest_condition: thresholds.condition,
        seed: case.context.seed(&format!("attribution {}", case.set.name)),
        ..Options::default()
    }
}

/// The next candidate to be run directly: nobody is named on the word of metamodels, and the likeliest few compete on
/// equal terms. Nothing is run where there is nothing to explain.
fn next_leader<'a>(
    case: &Case,
    attribution: &Attribution,
    contenders: &'a mut [Contender],
) -> Option<&'a mut Contender> {
    if case.attributable().is_err() || attribution.t0_p > options(case).adequacy_level {
        return None;
    }
    let named = attribution.verdict.names();
    let forced = |name: &str| case.context.config.effects.accept == Accept::Effect(name.to_owned());
    let wanted = |c: &Contender| named.contains(&c.name()) || forced(c.name());
    let rivals = contenders.iter().enumerate().filter(|(_, c)| !case.leaves_out(c.name()));
    let mut ranked: Vec<(f64, usize)> = rivals.filter_map(|(i, c)| Some((c.misfit()?, i))).collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let hopeless = ranked.first().map_or(0.0, |(best, _)| best + HOPELESS);
    let likeliest = ranked.into_iter().filter(|(misfit, _)| *misfit < hopeless).take(LEADERS).map(|(_, i)| i);
    let all = contenders.iter().enumerate().filter(|(_, c)| wanted(c)).map(|(i, _)| i).chain(likeliest);
    let next = all.collect::<Vec<_>>().into_iter().find(|i| !contenders[*i].was_run())?;
    contenders.get_mut(next)
}

/// The effect to add: the one that the study demands, or the one that the verdict names.
fn accepted(case: &Case, attribution: &Attribution) -> Option<String> {
    case.attributable().ok()?;
    match (&case.context.config.effects.accept, &attribution.verdict) {
        (Accept::None, _) => None,
        (Accept::Effect(name), _) => Some(name.clone()),
        (Accept::Auto, Verdict::Effect(member)) => Some(member.name.clone()),
        (Accept::Auto, _) => None,
    }
}
