//! Attribution: which missing effect explains what a calibrated model leaves over, with an explicit "none of them".
//!
//! Takes plain matrices: the residual y − f(θ̂) of a fitted model, its covariance, the sensitivity to the calibrated
//! parameters, and one signature (change of every observable per unit of strength) for each candidate effect. Gives the
//! tests, the estimates, the power and one [`Verdict`]. The method is a projected score test:
//!
//! 1. Everything is whitened with Σ = LLᵀ; priors of parameters are appended as rows (`geometry`).
//! 2. What calibration can absorb is projected away; d = rows − rank is the evidence that is left.
//! 3. Each candidate is fitted by its strength within its physical range (`effect`), with η̂²Σ_g and the error of the
//!    sensitivities added to the noise and the signature taken at η̂ itself.
//! 4. Adequacy, leftover, class rule, odds and pairs give an outcome (`judge`); the same procedure, run on drawn
//!    residuals, gives family-wise p-values and the detection limit η₉₀ (`draws`, with the `noise` of a Σ that was itself
//!    estimated from few repetitions).
//!
//! **A name is worth more than chance.** The adequacy test alarms once in twenty times where nothing is missing, and some
//! effect then fits what is left over. So what is named must beat "no discrepancy" by the odds by which it must beat
//! "other"; where it does not, no discrepancy is detected and [`Attribution::notes`] says so. What no candidate fits
//! remains an alarm. The same holds of an effect whose own model does not tell its strength from zero
//! ([`Presence::Untold`]). And what the runs of an effect leave over, the errors of its signatures do not excuse
//! ([`Candidate::leaves`]).
//!
//! **On a bound.** Where a parameter sits on its bound, the tangent space is no linear space: the parameter may move
//! inwards only. Every fit is then the best feasible one over all choices of which of these parameters stay on their
//! bound (whose columns leave the tangent space), which is the exact minimum for a linear model, and all critical
//! values come from draws that repeat this bounded refit. The model's curvature in θ is not followed there, bounds that
//! θ̂ does not touch are not enforced, and errors of the sensitivities count over ways that the bound forbids. So there, and where
//! the sensitivities are nearly dependent, the fits of the full models decide of the observed residual ([`Candidate::profile`]):
//! what an effect leaves, how likely it is, and whether it shows. None has two effects, so that pairs are not tried.
//!
//! Deliberately absent: running models, files, and any knowledge of what an observable or an effect is. The held-out
//! observables never enter: the caller leaves them out of every matrix. [`gls_fit`] supplies θ̂.

mod bayes;
mod draws;
mod effect;
mod geometry;
mod gls;
mod judge;
mod noise;
mod outcome;
mod proposals;
mod report;

pub use gls::{Bound, GlsFit, GlsOptions, gls_fit};
pub use outcome::{
    Attribution, DetectionLimit, EffectReport, Member, ResidualRow, Sensitivity, Separation, Status, TestMethod,
    Verdict,
};
pub use report::attribute;

use nalgebra::{DMatrix, DVector};

/// What an observable is, as far as its statistics go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum RowKind {
    /// Mean over repetitions; its measured variance has n − 1 degrees of freedom.
    Mean,
    /// Bias-corrected ln sd over repetitions; used from [`Options::small_count`] repetitions on.
    LnSd,
    /// Slope over repetitions; its measured variance has n − 2 degrees of freedom.
    Trend,
}

/// One observable: a row of the residual.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name, for the report.
    pub name: String,
    /// What the number is.
    pub kind: RowKind,
    /// Measured repetitions behind it.
    pub count: usize,
    /// Share of this row's variance in Σ that was estimated from these repetitions, 0 to 1; the rest is known better.
    pub measured_share: f64,
    /// Rows of one group have a covariance (not only variances) that was estimated from the same repetitions, as for the
    /// observables of one test; the more rows such a group has, the less its estimate can be trusted. Rows whose mutual
    /// covariance was not estimated belong to groups of their own.
    pub group: usize,
    /// Where the correlations with other rows were estimated from simulated repetitions.
    pub correlations: Option<Correlations>,
}

/// Correlations among rows of one group that were estimated together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Correlations {
    /// The group, such as a test.
    pub group: usize,
    /// Degrees of freedom of the estimate.
    pub dof: usize,
}

/// Normal prior of a parameter, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// A calibrated parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Name, for the report.
    pub name: String,
    /// Fitted value (the start, for [`gls_fit`]).
    pub value: f64,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// Independent knowledge, such as a measured particle density.
    pub prior: Option<Prior>,
}

/// A signature at one strength: the secant [f(θ̂, η) − f(θ̂, 0)]/η, per unit of strength (m).
#[derive(Debug, Clone, PartialEq)]
pub struct Signature {
    /// The strength at which it was taken, not 0.
    pub strength: f64,
    /// Change of each observable per unit of strength.
    pub per_unit: DVector<f64>,
    /// Move δ of the parameters per unit of strength at which it was taken (p): zero where that was θ̂ itself. With
    /// g = [f(θ̂ + δη, η) − f(θ̂, 0)]/η − Jδ the linear model is exact there, whatever the error of J.
    pub shift: DVector<f64>,
}

/// A candidate effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Name, for the report.
    pub name: String,
    /// Unit of the strength.
    pub unit: String,
    /// Physical range of the strength; contains 0 (absent). A range that ends at 0 constrains the sign.
    pub range: (f64, f64),
    /// Signatures in increasing order of strength; between them the secant is interpolated linearly, beyond them it is
    /// held. One at the end of the range suffices for an effect that acts linearly; adding the one recomputed at η̂ sharpens the
    /// leftover test. Whether the effect can be seen at all is judged by the largest of them.
    pub signatures: Vec<Signature>,
    /// Strength at which the full model fits best, 0 where that is not known: a fit counts the error of the signature
    /// nearest to it.
    pub fitted: f64,
    /// Covariance of the error of a signature per unit of strength (m × m), zero if it is exact.
    pub covariance: DMatrix<f64>,
    /// `Err` with the reason if these data cannot show the effect (no trends, no traces …).
    pub testable: Result<(), String>,
    /// What the full model with it says of its strength in the data.
    pub presence: Presence,
    /// χ² that the full model with it leaves where it was simulated, if that gives no signature; else 0. The effect leaves no less
    /// of the observed residual, whatever the errors of its signatures would excuse.
    pub leaves: f64,
    /// What the full model with it says of the data, if there is one: it decides where the linear model cannot.
    pub profile: Option<Profile>,
    /// How it changes the noise of the observables, where that is known and matters.
    pub scatter: Option<Scatter>,
}

/// The best fit of a full model, parameters and strength together and each within its bounds: where the profile likelihood of the
/// strength has its maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Strength of the fit; 0 where the effect is better left out.
    pub strength: f64,
    /// Its standard deviation; `None` where it lies on the end of its range.
    pub sd: Option<f64>,
    /// χ² of the fit, priors included.
    pub leaves: f64,
    /// −2 ln likelihood, counted so that it is T₀ without the effect: χ² and ln det of its Σ less that of [`Problem::covariance`].
    pub misfit: f64,
}

/// How an effect changes the noise of the observables: one that scatters from one repetition to the next is a cause that all
/// observables of a run share, so that their tails grow heavier and their scatters follow one another.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// Strength at which that was seen, not 0.
    pub strength: f64,
    /// Σ with the effect at that strength less Σ (m × m). It is taken to grow as the square of the strength, as a variance does, and
    /// to be held beyond.
    pub change: DMatrix<f64>,
}

/// What a full model says of the strength of an effect in the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presence {
    /// It has one, or there is no full model that could deny it.
    Present,
    /// It has one that is not told from zero. The effect is not named, nor a member of a class or a pair; an alarm that nothing
    /// else explains is none.
    Untold,
    /// Its best fit has none: the effect is fitted with strength zero, so that it is rejected with its numbers and its detection
    /// limit.
    Absent,
}

/// A measurement that could be added to separate a class of effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Name, for the report.
    pub name: String,
    /// Sensitivity of its q observables to the parameters (q × p).
    pub jacobian: DMatrix<f64>,
    /// Covariance of its observables (q × q).
    pub covariance: DMatrix<f64>,
    /// Signature of each candidate in its observables, in the order of the candidates (q each).
    pub signatures: Vec<DVector<f64>>,
}

/// Everything an attribution needs; m observables, p parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// The observables (m).
    pub rows: Vec<Row>,
    /// y − f(θ̂) (m).
    pub residual: DVector<f64>,
    /// Σ: measurement/n + simulation/n + metamodel, and ddᵀ for every uncertain dimension whose standard deviation moves the
    /// observables by d (m × m): the same as a column d for it with a prior of mean 0 and variance 1.
    pub covariance: DMatrix<f64>,
    /// The calibrated parameters with θ̂ (p).
    pub parameters: Vec<Parameter>,
    /// J = ∂f/∂θ at θ̂ (m × p).
    pub jacobian: DMatrix<f64>,
    /// Covariance of the error of each column of J (p matrices m × m; columns taken as independent), empty if exact.
    pub jacobian_covariance: Vec<DMatrix<f64>>,
    /// Candidate effects, at most 64.
    pub candidates: Vec<Candidate>,
    /// Measurements that could be added.
    pub proposals: Vec<Proposal>,
    /// `Err` with the reason if no verdict may be given, such as a coarse model against real data without an offset.
    pub attributable: Result<(), String>,
}

/// Thresholds and sizes of the simulations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Level of the adequacy test of T₀ (0.05).
    pub adequacy_level: f64,
    /// Level of the leftover test (0.01).
    pub leftover_level: f64,
    /// Level at which a projected signature must differ from its own error (0.01).
    pub signature_level: f64,
    /// Posterior odds by which an effect must beat "other" and "no discrepancy", and a pair every single effect too (3).
    pub odds: f64,
    /// Effects whose log-likelihood is within this of the best one form a class (3).
    pub class_rule: f64,
    /// Largest class that still counts as a detection for η₉₀ (3).
    pub largest_class: usize,
    /// Visibility below which an effect is called absorbed, if its reach is undetectable too (0.05).
    pub visibility: f64,
    /// Evidence d from which pairs are searched (6).
    pub pair_evidence: usize,
    /// Family-wise level of each member of a pair given the other (0.05).
    pub pair_level: f64,
    /// Repetitions below which ln sd rows are set aside (10).
    pub small_count: usize,
    /// Repetitions below which a row's variance counts as an estimate, so that null distributions are simulated (100).
    /// With 20 repetitions and four observables a test, χ² raised 14 % false alarms in place of 5 %.
    pub simulate_below: usize,
    /// Draws for null distributions and family-wise p-values (2000).
    pub null_draws: usize,
    /// Draws for each strength in the search for η₉₀ (1000); 0 leaves the search out.
    pub power_draws: usize,
    /// Probability that defines the detection limit (0.90).
    pub power: f64,
    /// Condition of the scaled sensitivity matrix from which the fits of the full models decide (1e6).
    pub largest_condition: f64,
    /// Seed of all draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            adequacy_level: 0.05,
            leftover_level: 0.01,
            signature_level: 0.01,
            odds: 3.0,
            class_rule: 3.0,
            largest_class: 3,
            visibility: 0.05,
            pair_evidence: 6,
            pair_level: 0.05,
            small_count: 10,
            simulate_below: 100,
            null_draws: 2000,
            power_draws: 1000,
            power: 0.90,
            largest_condition: 1e6,
            seed: 0,
        }
    }
}

/// An attribution that cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AttributionError {
    /// A vector or matrix has the wrong size.
    #[error("{what} has size {found}, but {expected} is needed")]
    Shape {
        /// Which input.
        what: String,
        /// Its size.
        found: String,
        /// The size that fits.
        expected: String,
    },
    /// An input is NaN or infinite.
    #[error("{0} holds a value that is not finite")]
    NotFinite(String),
    /// Σ is not positive definite.
    #[error("{0} is not positive definite; check for rows that repeat each other or have zero variance")]
    NotPositiveDefinite(String),
    /// A candidate makes no sense.
    #[error("candidate effect `{name}`: {why}")]
    Candidate {
        /// Its name.
        name: String,
        /// What is wrong.
        why: String,
    },
    /// A prior has no positive standard deviation, or bounds are reversed.
    #[error("{0} needs a positive standard deviation and ordered bounds")]
    Width(String),
    /// More candidates than the outcome can hold.
    #[error("{0} candidate effects were given, at most 64 are possible")]
    TooManyCandidates(usize),
}

impl Problem {
    /// Checks sizes, finiteness and ranges.
    ///
    /// # Errors
    /// [`AttributionError`] naming the first input that does not fit.
    pub fn validate(&self) -> Result<(), AttributionError> {
        let (m, p) = (self.rows.len(), self.parameters.len());
        check("the residual", self.residual.shape(), (m, 1), self.residual.iter())?;
        check("the covariance", self.covariance.shape(), (m, m), self.covariance.iter())?;
        check("the sensitivity matrix", self.jacobian.shape(), (m, p), self.jacobian.iter())?;
        let columns = if self.jacobian_covariance.is_empty() { 0 } else { p };
        check("the list of sensitivity covariances", (self.jacobian_covariance.len(), 1), (columns, 1), [].iter())?;
        for covariance in &self.jacobian_covariance {
            check("a sensitivity covariance", covariance.shape(), (m, m), covariance.iter())?;
        }
        self.parameters.iter().try_for_each(Parameter::validate)?;
        if self.candidates.len() > 64 {
            return Err(AttributionError::TooManyCandidates(self.candidates.len()));
        }
        self.candidates.iter().try_for_each(|candidate| candidate.validate(m, p))?;
        self.proposals.iter().try_for_each(|proposal| self.validate_proposal(proposal))
    }

    fn validate_proposal(&self, proposal: &Proposal) -> Result<(), AttributionError> {
        let (q, name) = (proposal.covariance.nrows(), &proposal.name);
        let what = |part: &str| format!("the {part} of proposal `{name}`");
        check(&what("covariance"), proposal.covariance.shape(), (q, q), proposal.covariance.iter())?;
        check(&what("sensitivity"), proposal.jacobian.shape(), (q, self.parameters.len()), proposal.jacobian.iter())?;
        let signatures = (proposal.signatures.len(), 1);
        check(&what("list of signatures"), signatures, (self.candidates.len(), 1), [].iter())?;
        let one = |g: &DVector<f64>| check(&what("signature"), g.shape(), (q, 1), g.iter());
        proposal.signatures.iter().try_for_each(one)
    }
}

impl Parameter {
    fn validate(&self) -> Result<(), AttributionError> {
        let what = format!("parameter `{}`", self.name);
        check(&what, (1, 1), (1, 1), [self.value].iter())?;
        if let Some(prior) = self.prior {
            check(&format!("the prior of {what}"), (1, 1), (1, 1), [prior.mean].iter())?;
            positive(&format!("the prior of {what}"), prior.sd)?;
        }
        positive(&what, self.upper - self.lower)
    }
}

impl Candidate {
    /// The signature at the least strength, by which effects are compared; `None` without signatures.
    pub fn local(&self) -> Option<&Signature> {
        self.signatures.iter().min_by(|a, b| a.strength.abs().total_cmp(&b.strength.abs()))
    }

    fn validate(&self, m: usize, p: usize) -> Result<(), AttributionError> {
        let what = format!("the signature of `{}`", self.name);
        check(&format!("the covariance of {what}"), self.covariance.shape(), (m, m), self.covariance.iter())?;
        if let Some(scatter) = &self.scatter {
            let what = format!("the change of the noise by `{}`", self.name);
            check(&what, scatter.change.shape(), (m, m), scatter.change.iter())?;
            positive(&what, scatter.strength.abs())?;
        }
        for signature in &self.signatures {
            check(&what, signature.per_unit.shape(), (m, 1), signature.per_unit.iter())?;
            check(&format!("the shift of {what}"), signature.shift.shape(), (p, 1), signature.shift.iter())?;
        }
        check(&format!("the fitted strength of `{}`", self.name), (1, 1), (1, 1), [self.fitted].iter())?;
        if let Some(Profile { strength, sd, leaves, misfit }) = self.profile {
            let what = format!("the fit of the model with `{}`", self.name);
            check(&what, (1, 1), (1, 1), [strength, leaves, misfit].iter())?;
            sd.map_or(Ok(()), |sd| positive(&what, sd))?;
        }
        let (low, high) = self.range;
        let ordered = self.signatures.windows(2).all(|pair| pair[0].strength < pair[1].strength);
        let usable = |s: &Signature| s.strength.is_finite() && s.strength != 0.0;
        let why = if !(low.is_finite() && high.is_finite() && low <= 0.0 && high >= 0.0 && low < high) {
            "its range must be finite, not empty and contain 0"
        } else if self.signatures.is_empty() {
            "it has no signature; give at least one, at a strength other than 0"
        } else if !ordered || !self.signatures.iter().all(usable) {
            "its signatures must stand in increasing order of strength, none at 0"
        } else {
            return Ok(());
        };
        Err(AttributionError::Candidate { name: self.name.clone(), why: why.to_owned() })
    }

    /// Half the physical range: the scale τ of plausible strengths.
    pub fn scale(&self) -> f64 {
        0.5 * (self.range.1 - self.range.0)
    }
}

fn check<'a>(
    what: &str,
    found: (usize, usize),
    expected: (usize, usize),
    mut values: impl Iterator<Item = &'a f64>,
) -> Result<(), AttributionError> {
    if found != expected {
        let size = |(rows, columns): (usize, usize)| format!("{rows} × {columns}");
        return Err(AttributionError::Shape { what: what.into(), found: size(found), expected: size(expected) });
    }
    if values.any(|value| !value.is_finite()) { Err(AttributionError::NotFinite(what.into())) } else { Ok(()) }
}

fn positive(what: &str, width: f64) -> Result<(), AttributionError> {
    if width.is_finite() && width > 0.0 { Ok(()) } else { Err(AttributionError::Width(what.into())) }
}
