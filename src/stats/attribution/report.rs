//! From a problem to a full [`Attribution`]: the order of the steps, and nothing that a decision depends on.

use super::draws::{self, Null, World};
use super::effect::{Curve, Errors, dot, significance};
use super::geometry::{Geometry, Whitened};
use super::judge::{Found, Machine, Outcome, Rule, Seen};
use super::noise::Noise;
use super::outcome::{
    Attribution, EffectReport, Member, ResidualRow, Sensitivity, Separation, Status, TestMethod, Verdict,
};
use super::proposals::{cosine, separation, usable, with_proposal};
use super::{AttributionError, Candidate, Options, Problem, Profile, RowKind, Signature};
use crate::stats::special;
use nalgebra::{DMatrix, DVector};

/// An effect that shifts what calibration leaves by less than this many standard deviations at its most visible strength is
/// out of reach.
const REACH: f64 = 3.0;

/// Runs the whole attribution. The same problem and options give the same bits.
///
/// # Errors
/// [`AttributionError`] if an input does not fit or Σ is not positive definite.
pub fn attribute(problem: &Problem, options: &Options) -> Result<Attribution, AttributionError> {
    problem.validate()?;
    let whitened = Whitened::new(problem, options)?;
    let geometries = whitened.geometries();
    let signatures: Vec<Curve> = problem.candidates.iter().map(|candidate| curve(&whitened, candidate)).collect();
    let is_profiled = !whitened.held.is_empty() || whitened.condition > options.largest_condition;
    let profile = |candidate: &Candidate| candidate.profile.filter(|_| is_profiled);
    let slopes: Vec<DMatrix<f64>> = problem.jacobian_covariance.iter().map(|c| whitened.covariance(c)).collect();
    let errors = signature_errors(problem, &whitened, (&geometries[0], &slopes, is_profiled), &signatures);
    let rule = |c: &Candidate| Rule {
        testable: false,
        presence: c.presence,
        leaves: c.leaves,
        profile: profile(c),
        range: c.range,
        tau: c.scale(),
    };
    let rules = problem.candidates.iter().map(rule).collect();
    let mut machine = Machine::new(geometries, &whitened.held, &signatures, &errors, rules, *options);
    let seen = machine.see(&whitened.residual);
    let visible: Vec<Visible> = (0..signatures.len())
        .map(|k| {
            let visible = Visible::new((problem, &whitened, &slopes), &machine, (&signatures[k], &errors[k]), k);
            visible.or_seen(machine.rules[k].profile, seen.t0, machine.options.signature_level)
        })
        .collect();
    machine.rules.iter_mut().zip(&visible).for_each(|(rule, v)| rule.testable = v.status == Status::Testable);
    machine.s2 = relative_variance(&machine);
    let world = |(k, candidate): (usize, &Candidate)| {
        let size = machine.effects[0][k].judged_by(errors[k].fitted);
        let scatter = candidate.scatter.as_ref().map(|s| (s.strength, whitened.covariance(&s.change)));
        World::new(&signatures[k], errors[k].of_fit(), size, scatter)
    };
    let worlds: Vec<World> = problem.candidates.iter().enumerate().map(world).collect();
    let noise = Noise::new(problem, &whitened, options);
    let null = draws::calibrate(&mut machine, &noise, &worlds);
    let fits = machine.fits_as_known(&seen);
    let leads = leads(&machine, &worlds, &fits);
    let (whitened, machine, noise) = (&whitened, &machine, &noise);
    Ok(Report { problem, whitened, machine, noise, null: &null, seen: &seen, fits: &fits, leads: &leads }
        .assemble(&visible, &worlds))
}

/// Expected leads, see [`Attribution::leads`].
fn leads(machine: &Machine, worlds: &[World], fits: &[Found]) -> DMatrix<f64> {
    let (basis, effects) = (&machine.geometries[0].basis, &machine.effects[0]);
    let truths = worlds.iter().zip(fits);
    let shifts: Vec<DVector<f64>> =
        truths.map(|(world, found)| basis.tr_mul(&world.shift(found.fit.strength))).collect();
    let mut rotated = Vec::new();
    DMatrix::from_fn(shifts.len(), shifts.len(), |k, l| {
        effects[l].rotate(shifts[k].as_slice(), &mut rotated);
        if k == l { 0.0 } else { 0.5 * effects[l].fit(&rotated).leftover }
    })
}

/// Whitened signatures of a candidate.
fn curve(whitened: &Whitened, candidate: &Candidate) -> Curve {
    let vectors: Vec<DVector<f64>> = candidate.signatures.iter().map(|s| whitened.vector(&s.per_unit)).collect();
    Curve::new(candidate.signatures.iter().map(|s| s.strength).collect(), &vectors)
}

/// Σ_g whitened, plus what the error of J adds: with the effect in, θ̂ moves by −J⁺g per unit, and an error δJ of the
/// sensitivities then shifts the prediction by −δJ(J⁺g + δ), δ being the move at which that signature was taken. The two moves
/// all but cancel at the fitted strength, however far they lead; along a bent path they do so only there. A full model
/// that decides does without the sensitivities.
fn signature_errors(
    problem: &Problem,
    whitened: &Whitened,
    (geometry, slopes, is_profiled): (&Geometry, &[DMatrix<f64>], bool),
    signatures: &[Curve],
) -> Vec<Errors> {
    let of = |(candidate, curve): (&Candidate, &Curve)| {
        let known = whitened.covariance(&candidate.covariance);
        let slopes = if is_profiled && candidate.profile.is_some() { &[] } else { slopes };
        let at = |(signature, vector): (&Signature, &Vec<f64>)| {
            let moves = &geometry.inverse * DVector::from_column_slice(vector);
            with_slopes(&known, slopes, |column| {
                let parameter = &problem.parameters[column];
                moves[column] * (parameter.upper - parameter.lower) + signature.shift[column]
            })
        };
        Errors {
            each: candidate.signatures.iter().zip(&curve.vectors).map(at).collect(),
            fitted: curve.nearest(candidate.fitted),
        }
    };
    problem.candidates.iter().zip(signatures).map(of).collect()
}

/// The covariance of a signature and, over the step from where it was taken to where the parameters end up, that of the slopes.
fn with_slopes(known: &DMatrix<f64>, slopes: &[DMatrix<f64>], step: impl Fn(usize) -> f64) -> DMatrix<f64> {
    slopes.iter().enumerate().fold(known.clone(), |error, (column, covariance)| {
        let step = step(column);
        error + covariance * (step * step)
    })
}

/// s² of "other": the mean of τ²a² over the testable candidates, per direction.
fn relative_variance(machine: &Machine) -> f64 {
    let sizes = machine.rules.iter().zip(&machine.effects[0]).filter(|(rule, _)| rule.testable);
    let (sum, count) = sizes
        .fold((0.0, 0), |(sum, count), (rule, effect)| (sum + rule.tau * rule.tau * effect.local_norm2(), count + 1));
    if count == 0 || machine.evidence() == 0 { 0.0 } else { sum / f64::from(count) / machine.evidence() as f64 }
}

/// How much of a signature is left after calibration, and whether it can be trusted.
struct Visible {
    status: Status,
    visibility: f64,
    p: f64,
}

impl Visible {
    fn new(
        (problem, whitened, slopes): (&Problem, &Whitened, &[DMatrix<f64>]),
        machine: &Machine,
        (curve, errors): (&Curve, &Errors),
        k: usize,
    ) -> Self {
        let (candidate, effect) = (&problem.candidates[k], &machine.effects[0][k]);
        let (size, raw_error) = (effect.judged_by(errors.fitted), whitened.covariance(&candidate.covariance));
        let signature = &candidate.signatures[size.node];
        let vector = DVector::from_column_slice(&curve.vectors[size.node]);
        let full = vector.norm_squared();
        let full_norm2 = (full - raw_error.trace()).max(0.0);
        let visibility = if full_norm2 > 0.0 { (size.norm2 / full_norm2).min(1.0) } else { 0.0 };
        let level = machine.options.signature_level;
        let known = significance(&vector, &raw_error, full.max(f64::MIN_POSITIVE)) <= level;
        // Calibration takes up of it what the bounds allow, and errs by the slopes over that way alone.
        let followed = whitened.follow(&problem.parameters, signature.strength, &vector);
        let error = with_slopes(&raw_error, slopes, |column| {
            let parameter = &problem.parameters[column];
            followed.moves[column] * (parameter.upper - parameter.lower) - signature.shift[column]
        });
        let (left, error) = (followed.geometry.basis.tr_mul(&followed.left), followed.geometry.projected(&error));
        // The better known of two signatures is a choice, for which a test pays.
        let choices = candidate.signatures.len().min(2) as f64;
        let p = (choices * significance(&left, &error, full)).min(1.0);
        let status = if let Err(why) = &candidate.testable {
            Status::NotTestable(why.clone())
        } else if known && visibility < machine.options.visibility && effect.reach() < REACH {
            Status::AbsorbedByCalibration
        } else if p > level || size.norm2 <= 0.0 {
            Status::SignatureNotResolved
        } else {
            Status::Testable
        };
        Self { status, visibility, p }
    }

    /// An effect whose full model gains significantly shows, whatever becomes of its signature.
    fn or_seen(self, profile: Option<Profile>, t0: f64, level: f64) -> Self {
        let gains = |profile: Profile| t0 - profile.misfit > special::chi2_quantile(1.0 - level, 1.0);
        match self.status {
            Status::AbsorbedByCalibration | Status::SignatureNotResolved if profile.is_some_and(gains) => {
                Self { status: Status::Testable, ..self }
            }
            _ => self,
        }
    }
}

/// Everything that is known once the observed residual has been fitted.
struct Report<'a> {
    problem: &'a Problem,
    whitened: &'a Whitened,
    machine: &'a Machine,
    noise: &'a Noise<'a>,
    null: &'a Null,
    seen: &'a Seen,
    fits: &'a [Found],
    leads: &'a DMatrix<f64>,
}

impl Report<'_> {
    fn assemble(&self, visible: &[Visible], worlds: &[World]) -> Attribution {
        let (machine, seen) = (self.machine, self.seen);
        let effects: Vec<EffectReport> = (0..visible.len()).map(|k| self.effect(k, &visible[k], &worlds[k])).collect();
        let outcome = machine.judge(seen, self.fits, 1.0, 1.0);
        let separations = self.separations(outcome);
        let simulated = self.null.simulated;
        Attribution {
            verdict: self.verdict(outcome, &separations),
            excluded: self.excluded(),
            evidence: machine.evidence(),
            t0: seen.t0,
            t0_p: self.p_of(&self.null.t0, seen.t0, machine.evidence(), simulated),
            method: if simulated { TestMethod::ParametricBootstrap } else { TestMethod::ChiSquare },
            ln_bayes_other: machine.ln_bayes_other(seen.t0, 1.0),
            notes: self.notes(&effects, outcome),
            effects,
            confusion: self.confusion(),
            separations,
            leads: self.leads.clone(),
            sensitivity: self.sensitivity(),
            residual: self.residual(),
            condition: self.whitened.condition,
            on_bound: self.on_bound(),
        }
    }

    fn p_of(&self, sorted: &[f64], value: f64, dof: usize, simulated: bool) -> f64 {
        match dof {
            0 => 1.0,
            _ if simulated => draws::upper_tail(sorted, value),
            _ => special::chi2_sf(value, dof as f64),
        }
    }

    fn effect(&self, k: usize, visible: &Visible, world: &World) -> EffectReport {
        let (machine, found, candidate) = (self.machine, self.fits[k], &self.problem.candidates[k]);
        let projected = &machine.effects[found.geometry][k];
        let z = machine.local_z(self.seen, k);
        let leftovers = self.null.leftover.get(k);
        let gain = self.seen.t0 - found.misfit;
        let dof = machine.evidence().saturating_sub(1);
        EffectReport {
            name: candidate.name.clone(),
            unit: candidate.unit.clone(),
            status: visible.status.clone(),
            a: machine.effects[0][k].local_norm2().sqrt(),
            visibility: visible.visibility,
            signature_p: visible.p,
            z,
            local_strength: self.local_strength(k, z),
            strength: found.fit.strength,
            strength_sd: machine.strength_sd(&found, k),
            leftover: found.fit.leftover,
            leftover_p: self.p_of(leftovers.map_or(&[], Vec::as_slice), found.fit.leftover, dof, leftovers.is_some()),
            accepted: machine.accepts(&found, k),
            familywise_p: draws::upper_tail(&self.null.gain, gain),
            ln_bayes: machine.evidence_of(self.seen, self.fits, k).ln_bayes(1.0),
            detection: self.detection(k, world),
            extrapolated: projected.curve.beyond(found.fit.strength),
            nearest_rival: self.nearest_rival(k),
        }
    }

    fn local_strength(&self, k: usize, z: f64) -> f64 {
        let local = &self.machine.effects[self.seen.geometry][k];
        let (raw2, norm2) = (dot(local.curve.local(), local.curve.local()), local.local_norm2());
        if norm2 > 0.0 { z * raw2.sqrt() / norm2 } else { f64::NAN }
    }

    fn detection(&self, k: usize, world: &World) -> Vec<super::DetectionLimit> {
        let (low, high) = self.machine.rules[k].range;
        let wanted = self.machine.rules[k].testable && self.machine.options.power_draws > 0;
        let sides = [low, high].into_iter().filter(|end| wanted && *end != 0.0);
        sides.map(|end| draws::detection_limit(self.machine, self.noise, world, k, end)).collect()
    }

    /// Local signatures in the basis of the unrestricted geometry.
    fn local(&self, k: usize) -> Vec<f64> {
        let effect = &self.machine.effects[0][k];
        let v = DVector::from_column_slice(effect.curve.local());
        effect.rotation.as_ref().map_or_else(|| v.clone(), |u| u.tr_mul(&v)).as_slice().to_vec()
    }

    fn confusion(&self) -> DMatrix<f64> {
        let local: Vec<Vec<f64>> = (0..self.fits.len()).map(|k| self.local(k)).collect();
        DMatrix::from_fn(local.len(), local.len(), |k, l| cosine(&local[k], &local[l]))
    }

    /// The sign in which an effect is considered: as fitted, or else the physical one.
    fn sign(&self, k: usize) -> f64 {
        let strength = self.fits[k].fit.strength;
        if strength == 0.0 { self.machine.rules[k].side() } else { strength.signum() }
    }

    fn confusion_with(&self, k: usize, l: usize) -> f64 {
        usable(cosine(&self.local(k), &self.local(l)), self.sign(k), &self.machine.rules[l])
    }

    fn nearest_rival(&self, k: usize) -> Option<(String, f64)> {
        let rivals = (0..self.fits.len()).filter(|l| *l != k && self.machine.rules[*l].testable);
        let each = rivals.map(|l| (self.problem.candidates[l].name.clone(), self.leads[(k, l)]));
        each.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn separations(&self, outcome: Outcome) -> Vec<Separation> {
        let Outcome::Class(_) = outcome else { return Vec::new() };
        let members = self.members(outcome);
        let pairs = members.iter().flat_map(|k| members.iter().map(move |l| (*k, *l))).filter(|(k, l)| k != l);
        pairs.map(|(k, l)| self.separation(k, l)).collect()
    }

    fn separation(&self, truth: usize, rival: usize) -> Separation {
        let name = |k: usize| self.problem.candidates[k].name.clone();
        let strength = self.fits[truth].fit.strength;
        let confusion = self.confusion_with(truth, rival);
        let size2 = strength * strength * self.machine.effects[0][truth].local_norm2();
        let (expected, rule) = (self.leads[(truth, rival)], &self.machine.rules[rival]);
        let local = separation(size2, confusion);
        let mut with: Vec<(String, f64)> = Vec::new();
        for proposal in &self.problem.proposals {
            let then = with_proposal(self.problem, self.whitened, proposal, (truth, strength), (rival, rule));
            with.extend(then.map(|then| (proposal.name.clone(), expected + (then - local).max(0.0))));
        }
        with.sort_by(|a, b| b.1.total_cmp(&a.1));
        Separation { truth: name(truth), rival: name(rival), confusion, expected, with_proposal: with }
    }

    /// Members of an outcome, best first.
    fn members(&self, outcome: Outcome) -> Vec<usize> {
        let mut members: Vec<usize> = match outcome {
            Outcome::Effect(k) => vec![k],
            Outcome::Class(mask) => (0..self.fits.len()).filter(|k| mask >> k & 1 == 1).collect(),
            Outcome::Pair(k, l) => vec![k, l],
            Outcome::Nothing | Outcome::Other => Vec::new(),
        };
        members.sort_by(|k, l| self.fits[*k].misfit.total_cmp(&self.fits[*l].misfit));
        members
    }

    fn verdict(&self, outcome: Outcome, separations: &[Separation]) -> Verdict {
        if let Err(why) = &self.problem.attributable {
            return Verdict::NotAttributable { why: why.clone() };
        }
        if self.machine.evidence() == 0 {
            return Verdict::NotAttributable {
                why: "calibration can fit every observable, no evidence is left".into(),
            };
        }
        let mut members = self.members(outcome).into_iter().map(|k| self.member(k)).collect::<Vec<_>>().into_iter();
        match (outcome, members.next(), members.next()) {
            (Outcome::Nothing, ..) => Verdict::NoDetectableDiscrepancy,
            (Outcome::Effect(_), Some(only), _) => Verdict::Effect(only),
            (Outcome::Pair(k, l), ..) => self.pair(k, l),
            (Outcome::Class(_), Some(first), Some(second)) => Verdict::Class {
                members: [first, second].into_iter().chain(members).collect(),
                measure: best_measurement(separations),
            },
            _ => Verdict::NoneOfTheCandidates,
        }
    }

    fn member(&self, k: usize) -> Member {
        let (candidate, found) = (&self.problem.candidates[k], self.fits[k]);
        let sd = self.machine.strength_sd(&found, k);
        Member { name: candidate.name.clone(), strength: found.fit.strength, sd, unit: candidate.unit.clone() }
    }

    /// The members of a pair with the strengths they have together.
    fn pair(&self, k: usize, l: usize) -> Verdict {
        let together = |k, l| {
            let (strength, sd) =
                self.machine.strength_beside(self.seen, self.fits, k, l).unwrap_or((f64::NAN, f64::NAN));
            Member { strength, sd, ..self.member(k) }
        };
        Verdict::Pair(together(k, l), together(l, k))
    }

    fn sensitivity(&self) -> Vec<Sensitivity> {
        let factors = [0.5, 1.0, 2.0];
        let all = factors.into_iter().flat_map(|tau| factors.into_iter().map(move |s| (tau, s)));
        all.filter(|pair| *pair != (1.0, 1.0))
            .map(|(strength_scale, other_scale)| {
                let outcome = self.machine.judge(self.seen, self.fits, strength_scale, other_scale);
                let verdict = self.verdict(outcome, &self.separations(outcome));
                Sensitivity { strength_scale, other_scale, verdict }
            })
            .collect()
    }

    /// Rows after the fit; whitened leftover ρ = QQᵀr̃ turned back into the units of each row.
    fn residual(&self) -> Vec<ResidualRow> {
        let basis = &self.machine.geometries[self.seen.geometry].basis;
        let rho = basis * basis.tr_mul(&self.whitened.residual);
        let (m, factor) = (self.whitened.kept.len(), &self.whitened.factor);
        let unwhitened = factor * rho.rows(0, m);
        let spread = factor * basis.rows(0, m);
        let weighted = factor.transpose().solve_upper_triangular(&rho.rows(0, m).into_owned());
        let share = |value: f64| if self.seen.t0 > 0.0 { value / self.seen.t0 } else { 0.0 };
        let row = |name: &str, residual: f64, variance: f64, part: f64| ResidualRow {
            name: name.to_owned(),
            residual,
            standardised: if variance > 0.0 { residual / variance.sqrt() } else { f64::NAN },
            share: share(part),
        };
        let data = self.whitened.kept.iter().enumerate().map(|(i, index)| {
            let part = unwhitened[i] * weighted.as_ref().map_or(f64::NAN, |w| w[i]);
            row(&self.problem.rows[*index].name, unwhitened[i], spread.row(i).norm_squared(), part)
        });
        let priors = self.whitened.priors.iter().enumerate().map(|(i, (name, sd))| {
            let (value, variance) = (rho[m + i], basis.row(m + i).norm_squared());
            row(name, value * sd, variance * sd * sd, value * value)
        });
        data.chain(priors).collect()
    }

    fn excluded(&self) -> Vec<(String, String)> {
        let least = self.machine.options.small_count;
        let few = |row: &&super::Row| row.kind == RowKind::LnSd && row.count < least;
        let reason = |row: &super::Row| {
            (row.name.clone(), format!("a standard deviation from {} repetitions; {least} are needed", row.count))
        };
        self.problem.rows.iter().filter(few).map(reason).collect()
    }

    fn on_bound(&self) -> Vec<String> {
        self.whitened.held.iter().map(|held| self.problem.parameters[held.column].name.clone()).collect()
    }

    /// Why an effect that would explain a rejected T₀ is not named.
    fn not_named(&self, effect: &EffectReport, told: bool) -> String {
        let (name, odds) = (&effect.name, libm::exp(effect.ln_bayes));
        if told {
            let needed = self.machine.options.odds;
            format!(
                "T₀ is rejected, but the odds of {name} against no effect are {odds:.1} : 1, and a name takes {needed}"
            )
        } else {
            format!("T₀ is rejected, but the model with {name} in it does not tell its strength from zero")
        }
    }

    fn notes(&self, effects: &[EffectReport], outcome: Outcome) -> Vec<String> {
        let mut notes = Vec::new();
        if outcome == Outcome::Nothing && self.seen.t0 > self.machine.critical.t0 {
            let accepted = effects.iter().zip(self.fits).filter(|(effect, _)| effect.accepted);
            let likeliest = accepted.max_by(|a, b| a.0.ln_bayes.total_cmp(&b.0.ln_bayes));
            notes.extend(likeliest.map(|(effect, found)| self.not_named(effect, found.told)));
        }
        for name in self.on_bound() {
            notes.push(format!("{name} sits on its bound; fits and critical values allow it to move inwards only"));
        }
        if self.machine.is_profiled() {
            notes.push("the fits of the models with each effect decide; pairs are not tried".to_owned());
        }
        if self.whitened.condition > self.machine.options.largest_condition {
            notes.push(format!(
                "the sensitivities are nearly dependent (condition {:.1e}); directions the data hardly see count as free",
                self.whitened.condition
            ));
        }
        for effect in effects.iter().filter(|effect| effect.accepted && effect.extrapolated) {
            notes.push(format!(
                "the strength of {} lies beyond its signatures; take one at {:.3} and repeat",
                effect.name, effect.strength
            ));
        }
        notes
    }
}

/// The proposal whose smallest expected separation over all pairs is the largest.
fn best_measurement(separations: &[Separation]) -> Option<String> {
    let names = separations.first()?.with_proposal.iter().map(|(name, _)| name);
    let worst = |name: &String| {
        let of = |s: &Separation| s.with_proposal.iter().find(|(other, _)| other == name).map_or(0.0, |(_, e)| *e);
        separations.iter().map(of).fold(f64::INFINITY, f64::min)
    };
    names.max_by(|a, b| worst(a).total_cmp(&worst(b))).cloned()
}
