//! The decision: from one whitened residual to one outcome.
//!
//! A [`Machine`] holds everything that does not depend on the residual, so that a decision costs microseconds and the
//! whole procedure can be repeated on drawn residuals. Takes whitened residuals; gives fits and an [`Outcome`] of
//! indices. Draws nothing and writes no texts.

use super::bayes::{Evidence, PairEvidence, ln_bayes_other};
use super::effect::{Curve, Errors, Fit, Projected, dot, weighted_dot};
use super::geometry::{Geometry, Held};
use super::{Options, Presence, Profile};
use nalgebra::{DMatrix, DVector};

/// Slack in the units of a parameter's width within which "moves inwards" is satisfied.
const FEASIBLE: f64 = 1e-9;
/// Share of a signature that must be left beside another one before the two are tried as a pair.
const DISTINCT: f64 = 1e-4;

/// ln BF of "no discrepancy", against which those of all others are given.
const NO_DISCREPANCY: f64 = 0.0;

/// What a residual leads to; indices of candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// T₀ is not rejected, or what would explain it is hardly likelier than chance.
    Nothing,
    /// One effect.
    Effect(usize),
    /// Bit k: candidate k belongs to the class.
    Class(u64),
    /// Two effects together.
    Pair(usize, usize),
    /// None of the candidates.
    Other,
}

impl Outcome {
    /// Whether the outcome is effect k, or a class of at most `largest` that contains it.
    pub(super) fn detects(self, k: usize, largest: usize) -> bool {
        match self {
            Self::Effect(found) => found == k,
            Self::Class(members) => members >> k & 1 == 1 && members.count_ones() as usize <= largest,
            _ => false,
        }
    }
}

/// What the decision must know about a candidate besides its projections.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rule {
    /// Whether it may be named at all.
    pub testable: bool,
    /// What the full model says of its strength in the observed residual.
    pub presence: Presence,
    /// The least that it leaves of the observed residual.
    pub leaves: f64,
    /// What the full model with it makes of the observed residual, where that decides.
    pub profile: Option<Profile>,
    /// Physical range.
    pub range: (f64, f64),
    /// Half the range.
    pub tau: f64,
}

impl Rule {
    pub(super) fn one_sided(&self) -> bool {
        self.range.0 == 0.0 || self.range.1 == 0.0
    }

    /// −1 if only negative strengths are physical.
    pub(super) fn side(&self) -> f64 {
        if self.range.1 == 0.0 { -1.0 } else { 1.0 }
    }

    /// Whether it may be a member of a pair.
    fn paired(&self) -> bool {
        self.testable && self.presence == Presence::Present
    }

    fn allows(&self, strength: f64, sd: f64) -> bool {
        let inside = strength > self.range.0 - 2.0 * sd && strength < self.range.1 + 2.0 * sd;
        strength != 0.0 && inside && (!self.one_sided() || strength * self.side() > 0.0)
    }
}

/// Critical values of the tests.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Critical {
    pub t0: f64,
    pub leftover: Vec<f64>,
    pub pair: f64,
    pub pair_leftover: f64,
}

/// How a held parameter would move: its row of J̃⁺, turned inwards, and its product with each effect's signatures.
#[derive(Debug, Clone)]
struct Motion {
    row: DVector<f64>,
    effects: Vec<Curve>,
}

/// The decision procedure of one problem.
#[derive(Debug, Clone)]
pub(super) struct Machine {
    pub geometries: Vec<Geometry>,
    /// `effects[geometry][candidate]`.
    pub effects: Vec<Vec<Projected>>,
    /// `beside[geometry][k][l]`: signatures of l in the eigenbasis of k.
    beside: Vec<Vec<Vec<Curve>>>,
    motions: Vec<Vec<Motion>>,
    pub rules: Vec<Rule>,
    pub critical: Critical,
    /// Relative variance s² of the catch-all.
    pub s2: f64,
    pub options: Options,
}

/// A residual seen in every geometry.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    t: Vec<Vec<f64>>,
    motion: Vec<Vec<f64>>,
    /// T₀, the smallest feasible square sum.
    pub t0: f64,
    /// The geometry that gave it.
    pub geometry: usize,
}

/// An effect's fit and the geometry it was found in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub fit: Fit,
    /// Leftover and ln det(I + η²C), −2 ln likelihood up to a constant: effects are compared by it, since a signature of which
    /// little is known leaves nothing over of anything.
    pub misfit: f64,
    pub geometry: usize,
    /// Whether it may be named on this fit: not where the full model does not tell the strength from zero.
    pub told: bool,
    /// Standard deviation of the strength, where the full model knows it.
    sd: Option<f64>,
}

impl Found {
    /// The same where the full model decides, or else no less is left than it leaves.
    fn as_known(self, rule: &Rule) -> Self {
        match rule.profile {
            Some(Profile { strength, sd, leaves, misfit }) => {
                Self { fit: Fit { strength, leftover: leaves }, misfit, sd, ..self }
            }
            None => {
                let fit = Fit { leftover: self.fit.leftover.max(rule.leaves), ..self.fit };
                Self { fit, misfit: self.misfit.max(rule.leaves), ..self }
            }
        }
    }

    /// An effect that is not there.
    fn absent(t0: f64, geometry: usize) -> Self {
        Self { fit: Fit { strength: 0.0, leftover: t0 }, misfit: t0, geometry, told: false, sd: None }
    }
}

impl Machine {
    /// Builds the machine; critical values and s² are filled in by the caller.
    pub(super) fn new(
        geometries: Vec<Geometry>,
        held: &[Held],
        signatures: &[Curve],
        errors: &[Errors],
        rules: Vec<Rule>,
        options: Options,
    ) -> Self {
        let project = |geometry: &Geometry| -> Vec<Projected> {
            let each = signatures.iter().zip(errors).zip(&rules);
            each.map(|((curve, errors), rule)| Projected::new(geometry, curve, errors, rule.range)).collect()
        };
        let effects: Vec<Vec<Projected>> = geometries.iter().map(project).collect();
        let beside = geometries.iter().zip(&effects).map(|(g, own)| beside(g, own, signatures)).collect();
        let motions = geometries.iter().map(|geometry| motions(geometry, held, signatures)).collect();
        let critical = Critical { t0: 0.0, leftover: vec![0.0; rules.len()], pair: 0.0, pair_leftover: 0.0 };
        Self { geometries, effects, beside, motions, rules, critical, s2: 0.0, options }
    }

    /// d of the unrestricted geometry.
    pub(super) fn evidence(&self) -> usize {
        self.geometries[0].evidence()
    }

    /// Projects a whitened residual and finds T₀.
    pub(super) fn see(&self, residual: &DVector<f64>) -> Seen {
        let t: Vec<Vec<f64>> = self.geometries.iter().map(|g| g.basis.tr_mul(residual).as_slice().to_vec()).collect();
        let motion = self.motions.iter().map(|all| all.iter().map(|m| m.row.dot(residual)).collect()).collect();
        let mut seen = Seen { t, motion, t0: f64::INFINITY, geometry: 0 };
        for geometry in 0..self.geometries.len() {
            let square = dot(&seen.t[geometry], &seen.t[geometry]);
            if square < seen.t0 && seen.motion[geometry].iter().all(|m| *m >= -FEASIBLE) {
                (seen.t0, seen.geometry) = (square, geometry);
            }
        }
        seen
    }

    /// Best feasible fit of one effect.
    pub(super) fn fit(&self, seen: &Seen, k: usize, scratch: &mut Vec<f64>) -> Found {
        let mut best = Found::absent(f64::INFINITY, 0);
        for geometry in 0..self.geometries.len() {
            let effect = &self.effects[geometry][k];
            effect.rotate(&seen.t[geometry], scratch);
            let fit = effect.fit(scratch);
            if fit.leftover < best.fit.leftover && self.feasible(seen, geometry, k, fit.strength) {
                let misfit = fit.leftover + effect.ln_det(fit.strength);
                best = Found { fit, misfit, geometry, told: true, sd: None };
            }
        }
        best
    }

    fn feasible(&self, seen: &Seen, geometry: usize, k: usize, strength: f64) -> bool {
        let moves = self.motions[geometry].iter().zip(&seen.motion[geometry]);
        moves
            .into_iter()
            .all(|(motion, of_residual)| of_residual - strength * motion.effects[k].secant(strength)[0] >= -FEASIBLE)
    }

    /// Fits of all candidates.
    pub(super) fn fits(&self, seen: &Seen) -> Vec<Found> {
        let mut scratch = Vec::new();
        (0..self.rules.len()).map(|k| self.fit(seen, k, &mut scratch)).collect()
    }

    /// The same for the observed residual, with what the full models say of the strengths.
    pub(super) fn fits_as_known(&self, seen: &Seen) -> Vec<Found> {
        let none = Found::absent(seen.t0, seen.geometry);
        let fits = self.fits(seen);
        let known = |(found, rule): (Found, &Rule)| match rule.presence {
            Presence::Present => found.as_known(rule),
            Presence::Untold => Found { told: false, ..found.as_known(rule) },
            Presence::Absent => none,
        };
        fits.into_iter().zip(&self.rules).map(known).collect()
    }

    /// The whole procedure on one whitened residual.
    pub(super) fn decide(&self, residual: &DVector<f64>) -> Outcome {
        let seen = self.see(residual);
        if seen.t0 <= self.critical.t0 {
            return Outcome::Nothing;
        }
        self.judge(&seen, &self.fits(&seen), 1.0, 1.0)
    }

    /// The verdict on a residual that is fitted already, with the prior scales τ and s multiplied.
    pub(super) fn judge(&self, seen: &Seen, fits: &[Found], tau_factor: f64, s_factor: f64) -> Outcome {
        if seen.t0 <= self.critical.t0 {
            return Outcome::Nothing;
        }
        let ln_odds = libm::log(self.options.odds);
        let other = self.ln_bayes_other(seen.t0, s_factor);
        let bayes: Vec<f64> = (0..fits.len()).map(|k| self.evidence_of(seen, fits, k).ln_bayes(tau_factor)).collect();
        let testable = |k: &usize| self.rules[*k].testable;
        let single = (0..fits.len()).filter(testable).map(|k| bayes[k]).fold(other.max(NO_DISCREPANCY), f64::max);
        if let Some((pair, ln_bayes)) = self.best_pair(seen, fits, tau_factor)
            && ln_bayes >= single + ln_odds
        {
            return Outcome::Pair(pair.0, pair.1);
        }
        let accepted = |k: &usize| self.accepts(&fits[*k], *k);
        let told = |k: &usize| fits[*k].told;
        let likely: Vec<usize> = (0..fits.len()).filter(accepted).filter(|k| bayes[*k] >= other + ln_odds).collect();
        if !likely.is_empty() && !likely.iter().any(|k| told(k) && bayes[*k] >= NO_DISCREPANCY + ln_odds) {
            return Outcome::Nothing;
        }
        let named = likely.into_iter().filter(told);
        let best = named.map(|k| fits[k].misfit).fold(f64::INFINITY, f64::min);
        let near = |k: &usize| 0.5 * (fits[*k].misfit - best) < self.options.class_rule;
        let class: Vec<usize> = (0..fits.len()).filter(accepted).filter(told).filter(near).collect();
        match class[..] {
            _ if best.is_infinite() => Outcome::Other,
            [only] => Outcome::Effect(only),
            _ => Outcome::Class(class.iter().fold(0, |mask, k| mask | 1 << k)),
        }
    }

    /// Testable, of the allowed sign, and with a leftover that is not rejected.
    pub(super) fn accepts(&self, found: &Found, k: usize) -> bool {
        self.rules[k].testable && found.fit.strength != 0.0 && found.fit.leftover <= self.critical.leftover[k]
    }

    /// ln BF of the catch-all.
    pub(super) fn ln_bayes_other(&self, t0: f64, factor: f64) -> f64 {
        ln_bayes_other(t0, self.evidence(), factor * factor * self.s2)
    }

    /// What the odds of candidate k rest on; a fit of zero strength falls back on the local signature.
    pub(super) fn evidence_of(&self, seen: &Seen, fits: &[Found], k: usize) -> Evidence {
        let (found, rule) = (fits[k], self.rules[k]);
        let (tau, one_sided) = (rule.tau, rule.one_sided());
        if found.fit.strength == 0.0 {
            let effect = &self.effects[seen.geometry][k];
            let mut rotated = Vec::new();
            effect.rotate(&seen.t[seen.geometry], &mut rotated);
            let z = rule.side() * effect.local_z(&rotated);
            return Evidence { z, gain: z * z, norm2: effect.local_norm2(), tau, one_sided };
        }
        let norm2 = match found.sd {
            Some(sd) => 1.0 / (sd * sd),
            None => self.effects[found.geometry][k].scale(found.fit.strength).norm2,
        };
        let gain = seen.t0 - found.misfit;
        Evidence { z: found.fit.strength.abs() * norm2.sqrt(), gain, norm2, tau, one_sided }
    }

    /// Standard deviation of a fitted strength.
    pub(super) fn strength_sd(&self, found: &Found, k: usize) -> f64 {
        found.sd.unwrap_or_else(|| self.effects[found.geometry][k].scale(found.fit.strength).sd)
    }

    /// Whether the full models decide, of which none has two effects.
    pub(super) fn is_profiled(&self) -> bool {
        self.rules.iter().any(|rule| rule.profile.is_some())
    }

    /// Local z of candidate k in the geometry of T₀.
    pub(super) fn local_z(&self, seen: &Seen, k: usize) -> f64 {
        let effect = &self.effects[seen.geometry][k];
        let mut rotated = Vec::new();
        effect.rotate(&seen.t[seen.geometry], &mut rotated);
        effect.local_z(&rotated)
    }

    /// The pair with the largest odds among those whose members are each significant given the other and whose
    /// leftover is accepted; `None` below the evidence that pairs need, and where full models decide.
    fn best_pair(&self, seen: &Seen, fits: &[Found], factor: f64) -> Option<((usize, usize), f64)> {
        if self.evidence() < self.options.pair_evidence || self.is_profiled() {
            return None;
        }
        let table = self.pair_table(seen, fits);
        let mut best: Option<((usize, usize), f64)> = None;
        for (k, l) in (0..fits.len()).flat_map(|k| (0..k).map(move |l| (k, l))) {
            let (Some(first), Some(second)) = (&table[k][l], &table[l][k]) else { continue };
            if first.gain.min(second.gain) <= self.critical.pair || !(first.allowed && second.allowed) {
                continue;
            }
            let ln_bayes = first.ln_bayes(factor).min(second.ln_bayes(factor));
            if best.is_none_or(|(_, top)| ln_bayes > top) && self.pair_accepted(seen, (k, l), first) {
                best = Some(((l, k), ln_bayes));
            }
        }
        best
    }

    /// `table[k][l]`: l added to k.
    fn pair_table(&self, seen: &Seen, fits: &[Found]) -> Vec<Vec<Option<Addition>>> {
        let mut rotated = Vec::new();
        let row = |k: usize| -> Vec<Option<Addition>> {
            if !self.rules[k].paired() {
                return vec![None; fits.len()];
            }
            let geometry = fits[k].geometry;
            let effect = &self.effects[geometry][k];
            effect.rotate(&seen.t[geometry], &mut rotated);
            let base = Base::new(effect, fits[k].fit.strength, &rotated);
            let add = |l: usize| {
                let other = self.beside[geometry][k][l].secant(fits[l].fit.strength);
                let rules = (&self.rules[k], &self.rules[l]);
                (l != k && rules.1.paired()).then(|| base.add(&rotated, &other, rules, seen.t0)).flatten()
            };
            (0..fits.len()).map(add).collect()
        };
        (0..fits.len()).map(row).collect()
    }

    /// Strength of k fitted together with l, with its standard deviation.
    pub(super) fn strength_beside(&self, seen: &Seen, fits: &[Found], k: usize, l: usize) -> Option<(f64, f64)> {
        let addition = self.pair_table(seen, fits).swap_remove(l).swap_remove(k)?;
        Some((addition.strengths.1, addition.sd))
    }

    /// Largest gain of any testable effect given any other: the statistic behind the family-wise level of pairs.
    pub(super) fn largest_addition(&self, seen: &Seen, fits: &[Found]) -> f64 {
        let table = self.pair_table(seen, fits);
        table.iter().flatten().flatten().map(|addition| addition.gain).fold(0.0, f64::max)
    }

    /// Leftover of a pair with the signature errors of both members in the noise.
    fn pair_accepted(&self, seen: &Seen, (k, l): (usize, usize), addition: &Addition) -> bool {
        let geometry = seen.geometry;
        let effects = (&self.effects[geometry][k], &self.effects[geometry][l]);
        let part = |effect: &Projected, strength: f64| {
            let shift = DVector::from_vec(effect.curve.secant(strength)) * strength;
            let error = DMatrix::from_diagonal(&DVector::from_column_slice(&effect.lambda)) * (strength * strength);
            match &effect.rotation {
                Some(u) => (u.tr_mul(&shift), u.transpose() * error * u),
                None => (shift, error),
            }
        };
        let (first, second) = (part(effects.0, addition.strengths.0), part(effects.1, addition.strengths.1));
        let rest = DVector::from_column_slice(&seen.t[geometry]) - first.0 - second.0;
        let noise = DMatrix::identity(rest.len(), rest.len()) + first.1 + second.1;
        let leftover = noise.cholesky().map_or(f64::INFINITY, |factor| rest.dot(&factor.solve(&rest)));
        leftover <= self.critical.pair_leftover
    }
}

/// One effect at its strength, ready for a second one beside it.
struct Base {
    weight: Vec<f64>,
    secant: Vec<f64>,
    kk: f64,
    kt: f64,
    tt: f64,
    ln_det: f64,
}

/// A second effect added to a first one.
#[derive(Debug, Clone, PartialEq)]
struct Addition {
    /// z² of the second given the first.
    gain: f64,
    /// Strengths of (first, second), fitted together.
    strengths: (f64, f64),
    /// Standard deviation of the second strength.
    sd: f64,
    /// Both strengths are physical.
    allowed: bool,
    evidence: PairEvidence,
    /// ½(T₀ − tᵀS⁻¹t − ln det S): what the first signature's error explains by itself.
    offset: f64,
}

impl Addition {
    fn ln_bayes(&self, factor: f64) -> f64 {
        self.offset + self.evidence.ln_bayes(factor)
    }
}

impl Base {
    fn new(effect: &Projected, strength: f64, t: &[f64]) -> Self {
        let weight = effect.weights(strength);
        let secant = effect.curve.secant(strength);
        let (kk, kt) = (weighted_dot(&weight, &secant, &secant), weighted_dot(&weight, &secant, t));
        let ln_det = effect.ln_det(strength);
        Self { kk, kt, tt: weighted_dot(&weight, t, t), ln_det, weight, secant }
    }

    fn add(&self, t: &[f64], other: &[f64], rules: (&Rule, &Rule), t0: f64) -> Option<Addition> {
        let kl = weighted_dot(&self.weight, &self.secant, other);
        let ll = weighted_dot(&self.weight, other, other);
        let lt = weighted_dot(&self.weight, other, t);
        let own = ll - kl * kl / self.kk;
        if own.is_nan() || own <= DISTINCT * ll {
            return None;
        }
        let score = lt - kl * self.kt / self.kk;
        let second = score / own;
        let first = (self.kt - kl * second) / self.kk;
        let (sd_first, sd_second) = ((ll / (self.kk * own)).sqrt(), (1.0 / own).sqrt());
        let sides = [rules.0.side(), rules.1.side()];
        Some(Addition {
            gain: score * score / own,
            strengths: (first, second),
            sd: sd_second,
            allowed: rules.0.allows(first, sd_first) && rules.1.allows(second, sd_second),
            evidence: PairEvidence {
                gram: [self.kk, kl * sides[0] * sides[1], ll],
                score: [self.kt * sides[0], lt * sides[1]],
                tau: [rules.0.tau, rules.1.tau],
                one_sided: [rules.0.one_sided(), rules.1.one_sided()],
            },
            offset: 0.5 * (t0 - self.tt - self.ln_det),
        })
    }
}

fn beside(geometry: &Geometry, own: &[Projected], signatures: &[Curve]) -> Vec<Vec<Curve>> {
    let projection = geometry.basis.transpose();
    let projected: Vec<Curve> = signatures.iter().map(|curve| curve.mapped(&projection)).collect();
    let in_basis_of = |effect: &Projected| -> Vec<Curve> {
        let rotate = |curve: &Curve| effect.rotation.as_ref().map_or_else(|| curve.clone(), |u| curve.mapped(u));
        projected.iter().map(rotate).collect()
    };
    own.iter().map(in_basis_of).collect()
}

fn motions(geometry: &Geometry, held: &[Held], signatures: &[Curve]) -> Vec<Motion> {
    let free = held.iter().enumerate().filter(|(i, _)| geometry.choice >> i & 1 == 0);
    let motion = |(_, held): (usize, &Held)| {
        let row = geometry.inverse.row(held.column) * held.inward;
        let row = DMatrix::from_row_slice(1, row.len(), row.transpose().as_slice());
        let effects = signatures.iter().map(|curve| curve.mapped(&row)).collect();
        Motion { row: row.transpose().column(0).into_owned(), effects }
    };
    free.map(motion).collect()
}
