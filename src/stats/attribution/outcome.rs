//! The result of an attribution, as plain data with stable codes and plain sentences.

use nalgebra::DMatrix;
use std::fmt;

/// Whether a candidate may be named, and if not, why.
#[derive(Debug, Clone, PartialEq)]
pub enum Status {
    /// It may be named.
    Testable,
    /// Calibration can imitate it within what the data can tell.
    AbsorbedByCalibration,
    /// Its signature does not differ from its own error.
    SignatureNotResolved,
    /// These data cannot show it, for the reason given.
    NotTestable(String),
}

impl Status {
    /// Stable code.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Testable => "testable",
            Self::AbsorbedByCalibration => "absorbed_by_calibration",
            Self::SignatureNotResolved => "signature_not_resolved",
            Self::NotTestable(_) => "not_testable",
        }
    }

    /// Sentence for people.
    pub fn sentence(&self) -> String {
        match self {
            Self::Testable => "Can be named.".into(),
            Self::AbsorbedByCalibration => "Absorbed by calibration: other parameter values do the same.".into(),
            Self::SignatureNotResolved => {
                "Signature not resolved: more repetitions of the simulations are needed.".into()
            }
            Self::NotTestable(why) => format!("Not testable with these data: {why}."),
        }
    }
}

/// An effect in a verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Name of the effect.
    pub name: String,
    /// Fitted strength, in `unit`.
    pub strength: f64,
    /// Its standard deviation.
    pub sd: f64,
    /// Unit of the strength.
    pub unit: String,
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = if self.unit.is_empty() || self.unit == "1" { String::new() } else { format!(" {}", self.unit) };
        write!(f, "{} ({:.3} ± {:.3}{unit})", self.name, self.strength, self.sd)
    }
}

/// What the residual says.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// T₀ is not rejected.
    NoDetectableDiscrepancy,
    /// One candidate explains it, no other comes near.
    Effect(Member),
    /// Several candidates explain it equally well.
    Class {
        /// The members, best first.
        members: Vec<Member>,
        /// The proposed measurement with the largest expected separation, if any was proposed.
        measure: Option<String>,
    },
    /// Two candidates together explain what none explains alone.
    Pair(Member, Member),
    /// No candidate explains it.
    NoneOfTheCandidates,
    /// No verdict may be given.
    NotAttributable {
        /// The reason.
        why: String,
    },
}

impl Verdict {
    /// The effects that each explain the residual alone.
    pub fn alone_mut(&mut self) -> Vec<&mut Member> {
        match self {
            Self::Effect(member) => vec![member],
            Self::Class { members, .. } => members.iter_mut().collect(),
            _ => Vec::new(),
        }
    }

    /// Stable code.
    pub fn code(&self) -> &'static str {
        match self {
            Self::NoDetectableDiscrepancy => "no_detectable_discrepancy",
            Self::Effect(_) => "effect",
            Self::Class { .. } => "class",
            Self::Pair(..) => "pair",
            Self::NoneOfTheCandidates => "none_of_the_candidates",
            Self::NotAttributable { .. } => "not_attributable",
        }
    }

    /// Names of the effects it points to, best first.
    pub fn names(&self) -> Vec<&str> {
        match self {
            Self::Effect(member) => vec![&member.name],
            Self::Class { members, .. } => members.iter().map(|member| member.name.as_str()).collect(),
            Self::Pair(first, second) => vec![&first.name, &second.name],
            _ => Vec::new(),
        }
    }

    /// Sentence for people.
    pub fn sentence(&self) -> String {
        match self {
            Self::NoDetectableDiscrepancy => "No detectable discrepancy.".into(),
            Self::Effect(member) => format!("Explained by {member}."),
            Self::Class { members, measure } => {
                let list: Vec<String> = members.iter().map(Member::to_string).collect();
                let next = measure.as_ref().map_or_else(
                    || "No measurement that would separate them was proposed.".to_owned(),
                    |name| format!("Measuring {name} would separate them best."),
                );
                format!("Explained equally well by each of {}. {next}", list.join(", "))
            }
            Self::Pair(first, second) => format!("Explained by {first} together with {second}."),
            Self::NoneOfTheCandidates => "None of the candidates explains it.".into(),
            Self::NotAttributable { why } => format!("Not attributable at this resolution: {why}."),
        }
    }
}

/// How a p-value was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestMethod {
    /// From the χ² distribution.
    ChiSquare,
    /// From parametric draws, because of few repetitions or a parameter on its bound.
    ParametricBootstrap,
}

impl TestMethod {
    /// Stable code.
    pub fn code(self) -> &'static str {
        match self {
            Self::ChiSquare => "chi_square",
            Self::ParametricBootstrap => "parametric_bootstrap",
        }
    }
}

/// η₉₀ on one side of zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectionLimit {
    /// End of the physical range on this side.
    pub side: f64,
    /// The limit; `None` if even the end of the range is not detected often enough.
    pub strength: Option<f64>,
    /// Detection probability at the limit, or at the end of the range.
    pub probability: f64,
}

/// One candidate effect, tested.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectReport {
    /// Name.
    pub name: String,
    /// Unit of the strength.
    pub unit: String,
    /// Whether it may be named.
    pub status: Status,
    /// a = ‖Mg̃‖ of the local signature, bias-corrected, per unit of strength.
    pub a: f64,
    /// ‖Mg̃‖²/‖g̃‖² of the largest signature or, if that is better known, of the one at the fitted strength, both
    /// bias-corrected: the share that calibration cannot imitate.
    pub visibility: f64,
    /// p-value of "the same projected signature is only its own error", twice that where there was a choice.
    pub signature_p: f64,
    /// z = uᵀr̃ of the local signature.
    pub z: f64,
    /// Local linear estimate of the strength, unconstrained and corrected for the error of the signature;
    /// NaN if nothing of the signature is left.
    pub local_strength: f64,
    /// Strength fitted within the physical range, with the signature at that strength.
    pub strength: f64,
    /// Standard deviation of the fitted strength; infinite if nothing of the signature is left.
    pub strength_sd: f64,
    /// What the fit leaves over, with the signature's error in the noise.
    pub leftover: f64,
    /// p-value of the leftover.
    pub leftover_p: f64,
    /// Testable, physical, and leftover not rejected.
    pub accepted: bool,
    /// Share of drawn residuals without effect in which some candidate gains at least as much.
    pub familywise_p: f64,
    /// ln Bayes factor against "no discrepancy".
    pub ln_bayes: f64,
    /// Detection limits, one for each physical side; empty if it is not testable.
    pub detection: Vec<DetectionLimit>,
    /// Whether the strength lies beyond the strengths at which signatures were taken.
    pub extrapolated: bool,
    /// The testable rival over which it leads least, with that lead.
    pub nearest_rival: Option<(String, f64)>,
}

/// One row of the residual after the fit: who carries the discrepancy.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualRow {
    /// Observable or prior.
    pub name: String,
    /// Residual in the row's unit, after calibration has moved as far as it likes.
    pub residual: f64,
    /// The residual over its standard deviation; NaN where calibration always fits the row.
    pub standardised: f64,
    /// Share of T₀; shares add up to 1 and may be negative between correlated rows.
    pub share: f64,
}

/// Two members of a class.
#[derive(Debug, Clone, PartialEq)]
pub struct Separation {
    /// Name of the effect taken as true.
    pub truth: String,
    /// Name of the rival.
    pub rival: String,
    /// c between them, 0 where signs tell them apart.
    pub confusion: f64,
    /// Expected log-likelihood by which truth leads.
    pub expected: f64,
    /// The same with each proposed measurement added, largest first: what that adds is judged by local signatures.
    pub with_proposal: Vec<(String, f64)>,
}

/// The verdict under other prior scales.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    /// Factor on every τ.
    pub strength_scale: f64,
    /// Factor on s of "other".
    pub other_scale: f64,
    /// The verdict there.
    pub verdict: Verdict,
}

/// Everything a table or a report needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribution {
    /// The verdict.
    pub verdict: Verdict,
    /// Rows set aside, with the reason.
    pub excluded: Vec<(String, String)>,
    /// d: directions that calibration cannot reach.
    pub evidence: usize,
    /// T₀.
    pub t0: f64,
    /// Its p-value.
    pub t0_p: f64,
    /// How that was found.
    pub method: TestMethod,
    /// ln Bayes factor of "other" against "no discrepancy".
    pub ln_bayes_other: f64,
    /// Candidates in their given order.
    pub effects: Vec<EffectReport>,
    /// c_kl = u_kᵀu_l of the local signatures, in the order of `effects`.
    pub confusion: DMatrix<f64>,
    /// Expected log-likelihood by which effect k at its fitted strength leads over effect l at the strength at which that looks
    /// most like it: half of what l leaves over. With straight signatures known exactly, ½A²(1 − c²).
    pub leads: DMatrix<f64>,
    /// Separations between the members of a class; empty for other verdicts.
    pub separations: Vec<Separation>,
    /// Verdicts with the prior scales halved and doubled.
    pub sensitivity: Vec<Sensitivity>,
    /// The residual direction.
    pub residual: Vec<ResidualRow>,
    /// Condition number of the scaled sensitivities.
    pub condition: f64,
    /// Parameters on a bound.
    pub on_bound: Vec<String>,
    /// Conditions under which the verdict deserves a second look.
    pub notes: Vec<String>,
}

impl Attribution {
    /// Names of the candidates with a status code.
    pub fn with_status(&self, code: &str) -> Vec<&str> {
        self.effects.iter().filter(|effect| effect.status.code() == code).map(|effect| effect.name.as_str()).collect()
    }

    /// Candidates that could be named in principle but stay below η₉₀ over their whole physical range.
    pub fn below_detection(&self) -> Vec<&str> {
        let hidden = |effect: &&EffectReport| {
            !effect.detection.is_empty() && effect.detection.iter().all(|limit| limit.strength.is_none())
        };
        self.effects.iter().filter(hidden).map(|effect| effect.name.as_str()).collect()
    }

    /// The report of one candidate.
    pub fn effect(&self, name: &str) -> Option<&EffectReport> {
        self.effects.iter().find(|effect| effect.name == name)
    }
}
