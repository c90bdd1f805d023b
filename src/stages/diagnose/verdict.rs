//! One data set from its evidence to its verdict.

use super::anchors::{Anchors, Secants};
use super::before_after::{self, Model};
use super::direct;
use super::evidence::{Evidence, Noise};
use super::fit::{self, Surface};
use super::lab::Lab;
use super::moments::{Batch, Moment, Moments};
use super::{Tables, rows};
use crate::campaign::CampaignError;
use crate::config::{Accept, Measured, Resolution};
use crate::effects;
use crate::stages::models::Models;
use crate::stages::{Context, StageError};
use crate::stats::attribution::{
    Attribution, Candidate, EffectReport, Options, Problem, Row, RowKind, Signature, Status, Verdict, attribute,
};
use nalgebra::{DMatrix, DVector};

/// How many candidates get a signature of their own at the optimum.
const LEADERS: usize = 2;

/// Most rounds in which a signature follows its own strength.
const ROUNDS: usize = 3;

/// Relative change of the strength below which the signature counts as taken at the strength itself.
const SETTLED: f64 = 0.15;

/// Standard errors that a strength must exceed for its candidate to be a leader: a secant over a strength near zero is
/// all noise.
const SIGNIFICANT: f64 = 3.0;

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
    /// Statistics of those runs.
    pub model: Moments,
}

/// Slopes of the statistics with respect to the parameters in the unit cube.
pub struct Slopes {
    /// Slopes (m × p).
    pub jacobian: DMatrix<f64>,
    /// Covariance of the error of every column; empty where the slopes are those of the metamodels.
    pub covariance: Vec<DMatrix<f64>>,
}

/// Diagnoses one data set and adds its rows.
pub fn diagnose(
    context: &Context,
    models: &Models,
    anchors: &Anchors,
    lab: &mut Lab,
    set: &Measured,
    tables: &mut Tables,
) -> Result<(), StageError> {
    let case = match prepare(context, models, anchors, lab, set)? {
        Ok(case) => case,
        Err(why) => {
            tables.verdicts.push(rows::no_verdict(&set.name, why));
            return Ok(());
        }
    };
    let mut candidates = candidates(&case, anchors)?;
    let first = attributed(&case, candidates.clone())?;
    for name in leaders(&case, &first) {
        sharpen(&case, lab, &mut candidates, &name)?;
    }
    let attribution = attributed(&case, candidates.clone())?;
    rows::write(&case, &candidates, &attribution, tables);
    let accepted = accepted(&case, &attribution);
    let added = accepted.and_then(|name| candidates.into_iter().find(|candidate| candidate.name == name));
    before_after::compare(&case, lab, Model { candidate: added.as_ref() }, tables)
}

/// Evidence, optimum and runs of a data set; the inner error says why there can be none.
fn prepare<'a>(
    context: &'a Context<'a>,
    models: &Models,
    anchors: &Anchors,
    lab: &mut Lab,
    set: &'a Measured,
) -> Result<Result<Case<'a>, String>, StageError> {
    let evidence = Evidence::new(context.config, set, anchors.centre());
    if evidence.statistics.len() <= context.config.parameters.len() {
        return Ok(Err(format!(
            "only {} statistics are comparable, {} parameters are fitted: measure more observables",
            evidence.statistics.len(),
            context.config.parameters.len()
        )));
    }
    let Some(surface) = Surface::new(context, models, &evidence.statistics) else {
        return Ok(Err("a metamodel of an observable is missing, see table metamodels".to_owned()));
    };
    let Some(noise) = evidence.noise(anchors.centre()) else { return Ok(Err(UNMEASURED.to_owned())) };
    // A few runs give variances but no trustworthy correlations, so the first fit takes the variances alone.
    let variances = DMatrix::from_diagonal(&noise.covariance.diagonal());
    let first = fit::over_metamodels(context, &set.name, &evidence, &variances, &surface)?;
    let refined = if comparable(context, set) {
        let Some(direct) = direct::simulate(context, lab, &set.name, &evidence.statistics, &first.parameters)? else {
            return Ok(Err(UNMEASURED.to_owned()));
        };
        let Some(noise) = evidence.noise(&direct.batch) else { return Ok(Err(UNMEASURED.to_owned())) };
        let start = fit::parameters(context.config, &set.name, first.parameters.as_slice());
        let covariance = &noise.covariance + &direct.value.covariance;
        let value = DVector::from_column_slice(&direct.value.values);
        let fitted = fit::linear(&value, &direct.jacobian, &first.parameters, &evidence.values, &covariance, &start)?;
        (fitted, Slopes { jacobian: direct.jacobian, covariance: direct.jacobian_covariance })
    } else {
        // No verdict follows, so the metamodel's slopes are good enough to print the residual.
        let jacobian = surface.predict(&first.parameters).1;
        (first, Slopes { jacobian, covariance: Vec::new() })
    };
    let (fitted, slopes) = refined;
    let before = direct::batch(context, lab, format!("{}/before", set.name), &fitted.parameters, &[])?;
    let (Some(noise), Some(model)) = (evidence.noise(&before), before.moments(&evidence.statistics)) else {
        return Ok(Err(UNMEASURED.to_owned()));
    };
    Ok(Ok(Case {
        context,
        set,
        evidence,
        noise,
        slopes,
        optimum: fitted.parameters,
        optimum_covariance: fitted.covariance,
        at_bound: fitted.at_bound.iter().map(Option::is_some).collect(),
        before,
        model,
    }))
}

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

/// Whether the study says that its set-up resolves the data.
fn comparable(context: &Context, set: &Measured) -> bool {
    context.config.measured.iter().any(|source| source.name == set.name && source.comparable)
}

fn candidates(case: &Case, anchors: &Anchors) -> Result<Vec<Candidate>, StageError> {
    let names = &case.context.config.diagnose.candidates;
    names.iter().map(|name| candidate(case, anchors, name)).collect()
}

fn candidate(case: &Case, anchors: &Anchors, name: &str) -> Result<Candidate, StageError> {
    let effect = effects::find(name).map_err(CampaignError::from)?;
    let m = case.evidence.statistics.len();
    let secants = anchors.secants(name, &case.evidence.statistics, case.optimum.as_slice());
    let testable = match &secants {
        Some(_) => Ok(()),
        None => Err("an observable could not be measured at the anchors".to_owned()),
    };
    // A placeholder of size zero keeps the candidate in the list, where it is reported as not testable.
    let secants = secants.unwrap_or_else(|| Secants {
        at: vec![(effect.range().1, DVector::zeros(m))],
        covariance: DMatrix::zeros(m, m),
    });
    Ok(Candidate {
        name: name.to_owned(),
        unit: effect.unit().to_owned(),
        range: effect.range(),
        signatures: secants.at.into_iter().map(|(strength, per_unit)| Signature { strength, per_unit }).collect(),
        covariance: secants.covariance,
        testable,
    })
}

fn attributed(case: &Case, candidates: Vec<Candidate>) -> Result<Attribution, StageError> {
    let statistics = case.evidence.statistics.iter().enumerate();
    let row = |(index, statistic): (usize, &super::moments::Statistic)| Row {
        name: rows::name(statistic),
        kind: if statistic.moment == Moment::Mean { RowKind::Mean } else { RowKind::LnSd },
        count: case.evidence.counts[index],
        measured_share: case.noise.measured_share[index] * case.noise.covariance[(index, index)]
            / case.covariance()[(index, index)],
        // Correlations come from the many simulated repetitions, so every row stands for itself.
        group: index,
    };
    let problem = Problem {
        rows: statistics.map(row).collect(),
        residual: case.residual(),
        covariance: case.covariance(),
        parameters: fit::parameters(case.context.config, &case.set.name, case.optimum.as_slice()),
        jacobian: case.slopes.jacobian.clone(),
        jacobian_covariance: case.slopes.covariance.clone(),
        nuisances: Vec::new(),
        candidates,
        proposals: Vec::new(),
        attributable: case.attributable(),
    };
    attribute(&problem, &options(case)).map_err(|error| StageError::Input {
        what: format!("the attribution of {} failed: {error}", case.set.name),
        remedy: "raise [diagnose] refine_repetitions, or leave out observables that repeat each other",
    })
}

fn options(case: &Case) -> Options {
    let diagnose = &case.context.config.diagnose;
    let thresholds = diagnose.thresholds;
    Options {
        adequacy_level: thresholds.adequacy,
        leftover_level: thresholds.leftover,
        signature_level: thresholds.resolved,
        class_rule: thresholds.class_delta,
        largest_class: thresholds.class_size as usize,
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

/// Candidates whose signature is taken anew before the verdict: the likeliest few, where there is
/// something to explain. Signatures bend, and a leftover judged with the wrong secant rejects the right effect.
fn leaders(case: &Case, attribution: &Attribution) -> Vec<String> {
    let options = options(case);
    if case.attributable().is_err() || attribution.t0_p > options.adequacy_level {
        return Vec::new();
    }
    let forced = |name: &str| case.context.config.effects.accept == Accept::Effect(name.to_owned());
    let mut effects: Vec<&EffectReport> = attribution
        .effects
        .iter()
        .filter(|effect| effect.strength.abs() > SIGNIFICANT * effect.strength_sd)
        .filter(|effect| effect.status == Status::Testable || forced(&effect.name))
        .collect();
    effects.sort_by(|a, b| b.ln_bayes.total_cmp(&a.ln_bayes));
    effects.into_iter().take(LEADERS).map(|effect| effect.name.clone()).collect()
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

/// Takes the signature of an effect anew where parameters and strength would go together, until the strength stays.
fn sharpen(case: &Case, lab: &mut Lab, candidates: &mut [Candidate], name: &str) -> Result<(), StageError> {
    let Some(candidate) = candidates.iter_mut().find(|candidate| candidate.name == name) else { return Ok(()) };
    let p = case.optimum.len();
    let mut last = 0.0;
    for round in 1..=ROUNDS {
        let fitted = before_after::recalibrate(case, candidate)?.parameters;
        let strength = fitted[p];
        if strength == 0.0 || (strength - last).abs() <= SETTLED * strength.abs() {
            break;
        }
        let label = format!("{}/{name} {round}", case.set.name);
        let u = fitted.rows(0, p).into_owned();
        let Some(secant) = secant(case, lab, label, name, &u, strength)? else { break };
        candidate.signatures = vec![Signature { strength, per_unit: DVector::from_vec(secant.values) }];
        candidate.covariance = secant.covariance;
        last = strength;
    }
    Ok(())
}

/// The secant of an effect at (θ₁, η₁) = (`u`, `strength`), [f(θ₁, η₁) − f(θ̂, 0) − J (θ₁ − θ̂)]/η₁, with the covariance of
/// its error.
///
/// With it the linear model of the attribution meets the simulation at that point exactly, however the effect bends and
/// however far the parameters move: an error of J cancels there and is no error of the secant. Runs share their packings
/// with those at the optimum.
fn secant(
    case: &Case,
    lab: &mut Lab,
    label: String,
    name: &str,
    u: &DVector<f64>,
    strength: f64,
) -> Result<Option<Moments>, StageError> {
    let with = direct::paired_batch(case.context, lab, label, u, &[(name.to_owned(), strength)], &case.optimum)?;
    let Some(difference) = with.paired_difference(&case.before, &case.evidence.statistics) else { return Ok(None) };
    let secant = (DVector::from_vec(difference.values) - &case.slopes.jacobian * (u - &case.optimum)) / strength;
    Ok(Some(Moments { values: secant.as_slice().to_vec(), covariance: difference.covariance / (strength * strength) }))
}
