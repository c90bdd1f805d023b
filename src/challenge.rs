//! Challenges: measured data that hide an effect, made by the study's own set-up with hidden parameters.
//!
//! Takes a study and a seed; gives a measured data set and, in a file of its own, the declaration of what is hidden; later
//! compares a solution with the declaration. The data carry a commitment (blake3) to the declaration, so that it cannot be changed afterwards. Hidden parameters
//! lie inside the bounds and are no design point; the packings come from seeds that no stage of a study can draw.

use crate::campaign::{Campaign, CampaignError, Point, Request, Values};
use crate::canonical::{Digest, Encoder, digest};
use crate::config::Config;
use crate::effects::EffectError;
use crate::experiments::Experiment;
use crate::rng::Stream;
use crate::stats::special::{chi2_quantile, chi2_sf};
use crate::tables::list::{AttributionRow, ConfusionRow, KpiRow, RecalibrationRow, VerdictRow};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::Arc;

/// Contexts of a challenge's seeds; a study's runs use others.
const PACKING_CONTEXT: &str = "granulake 2026 challenge packing v1";
/// Share of each parameter's range that hidden values keep from its bounds.
const MARGIN: f64 = 0.2;

/// Scatter of one submerged weighing [kg/m³]; an assumption, since the paper does not print it.
const WEIGHING_SD: f64 = 30.0;

/// What to hide.
#[derive(Debug, Clone, PartialEq)]
pub struct Order {
    /// Seed of the hidden parameters, the effect and its strength.
    pub seed: u64,
    /// Name of the effect, `random` (one of the study's candidates) or `none`.
    pub effect: String,
    /// Strength; by default drawn from the upper third of the physical range.
    pub strength: Option<f64>,
    /// Repetitions of every fitted experiment.
    pub repetitions: u32,
    /// Repetitions of the held-out experiment.
    pub held_out_repetitions: u32,
    /// Submerged weighings of the grains, where their density is calibrated; fewer than two give none.
    pub weighings: u32,
    /// Settings changed besides, as `(name, factor)`: a discrepancy that no candidate describes.
    pub scale: Vec<(String, f64)>,
}

/// A challenge: data for everybody, a declaration for nobody yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Challenge {
    /// Measured values as CSV, with the commitment in its head.
    pub measured: String,
    /// What is hidden, as TOML.
    pub sealed: String,
}

/// Why there is no challenge.
#[derive(Debug, thiserror::Error)]
pub enum ChallengeError {
    /// Runs cannot be made.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The effect is unknown.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The study names no candidate to choose from.
    #[error("cannot choose a random effect: the study has no candidates; name some in [diagnose] candidates")]
    NoCandidates,
    /// The declaration cannot be understood.
    #[error("the declaration is no TOML of a challenge: {0}")]
    Declaration(String),
    /// The declaration is not the one that the data were made with.
    #[error(
        "the data carry the commitment {committed}, but the declaration has {found}: it was changed, or belongs to other data"
    )]
    BrokenSeal {
        /// What the data say.
        committed: String,
        /// Digest of the declaration.
        found: Digest,
    },
}

/// Makes the challenge of `order` with the set-up of `config`.
///
/// # Errors
/// An effect that is unknown or out of range, or runs that cannot be made.
pub fn make(config: &Config, campaign: &Campaign, order: &Order) -> Result<Challenge, ChallengeError> {
    let mut stream = Stream::new(order.seed, "challenge");
    let parameters = hidden_parameters(config, &mut stream);
    let truth = Truth { effects: hidden_effect(config, order, &mut stream)?, parameters, scale: order.scale.clone() };
    let series = order.repetitions;
    let mut kpis = truth.measure(config, campaign, &config.experiments(), (order.repetitions, series), order.seed)?;
    let held_out = [config.validate.experiment];
    kpis.extend(truth.measure(config, campaign, &held_out, (order.held_out_repetitions, series), order.seed)?);
    let sealed = declaration(order, &truth.parameters, &truth.effects);
    let measured = csv(order, &sealed, &kpis) + &weighings(order, &truth.parameters);
    Ok(Challenge { measured, sealed })
}

/// What measurements are made with.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// Values of the parameters.
    pub parameters: Values,
    /// Effects with their strengths.
    pub effects: Values,
    /// Settings changed besides, as `(name, factor)`.
    pub scale: Vec<(String, f64)>,
}

impl Truth {
    /// Observables of `repetitions` runs of every experiment, in series of `series`, with packings that come from seeds
    /// which no stage of a study can draw.
    ///
    /// # Errors
    /// A parameter or an effect out of range, or runs that cannot be made.
    pub fn measure(
        &self,
        config: &Config,
        campaign: &Campaign,
        experiments: &[&'static dyn Experiment],
        (repetitions, series): (u32, u32),
        seed: u64,
    ) -> Result<Vec<KpiRow>, ChallengeError> {
        let mut base = config.base_settings().clone();
        // The measurements are one series, in whose middle a drifting wall is as it was measured.
        base.set("series_length", f64::from(series.max(2))).map_err(CampaignError::from)?;
        for (name, factor) in &self.scale {
            base.scale(name, *factor).map_err(CampaignError::from)?;
        }
        let point = Point::new(1, &base, &self.parameters)?.knowing(&config.effects.library);
        let point = Arc::new(point.with_effects(&self.effects));
        let mut requests = Vec::new();
        for experiment in experiments {
            requests.extend(batch(*experiment, &point, repetitions, seed)?);
        }
        let runs = campaign.simulate(&requests)?;
        Ok(campaign.measure(&requests, &runs)?)
    }
}

fn batch(
    experiment: &'static dyn Experiment,
    point: &Arc<Point>,
    repetitions: u32,
    seed: u64,
) -> Result<Vec<Request>, CampaignError> {
    let mut encoder = Encoder::new();
    encoder.u64(seed);
    Request::batch("challenge", experiment, point, 1..=repetitions, digest(PACKING_CONTEXT, &encoder).to_u64())
}

/// Uniform over the bounds less a margin.
fn hidden_parameters(config: &Config, stream: &mut Stream) -> Values {
    let mut draw = |lower: f64, upper: f64| lower + (upper - lower) * stream.uniform_in(MARGIN, 1.0 - MARGIN);
    config
        .parameters
        .iter()
        .map(|parameter| (parameter.name.to_owned(), draw(parameter.lower, parameter.upper)))
        .collect()
}

fn hidden_effect(config: &Config, order: &Order, stream: &mut Stream) -> Result<Values, ChallengeError> {
    if order.effect == "none" {
        return Ok(Vec::new());
    }
    let library = &config.effects.library;
    let effect = if order.effect == "random" {
        let candidates = &config.diagnose.candidates;
        if candidates.is_empty() {
            return Err(ChallengeError::NoCandidates);
        }
        library.find(&candidates[stream.index(candidates.len())])?
    } else {
        library.find(&order.effect)?
    };
    let upper = effect.range().1;
    let strength = order.strength.unwrap_or_else(|| upper * stream.uniform_in(2.0 / 3.0, 1.0));
    Ok(vec![(effect.name().to_owned(), strength)])
}

fn declaration(order: &Order, parameters: &Values, effects: &Values) -> String {
    let mut text = format!("# What the challenge hides; no stage reads this file.\nseed = {}\n", order.seed);
    let mut table = |name: &str, values: &Values| {
        let _ = writeln!(text, "\n[{name}]");
        for (key, value) in values {
            let _ = writeln!(text, "{key} = {value:?}");
        }
    };
    table("parameters", parameters);
    table("effects", effects);
    if !order.scale.is_empty() {
        table("scaled_settings", &order.scale.iter().map(|(name, f)| (format!("\"{name}\""), *f)).collect());
    }
    text
}

/// One line per value; a run without a value is a comment with its reason, because a laboratory would note it too.
fn csv(order: &Order, sealed: &str, kpis: &[KpiRow]) -> String {
    let mut text = format!(
        "# Synthetic measurements with hidden parameters and possibly a hidden effect (challenge, seed {}).\n\
         {COMMITMENT}{}\n\
         experiment,repetition,kpi,value,unit\n",
        order.seed,
        Digest::of_content(sealed.as_bytes())
    );
    let values = |kpi: &str| kpis.iter().filter(|row| row.kpi == kpi && row.value.is_some()).count();
    for row in kpis {
        // One value alone has no scatter, and no reader of measured data takes it.
        let _ = match (row.value.filter(|_| values(&row.kpi) >= 2), &row.reason) {
            (Some(value), _) => {
                writeln!(text, "{},{},{},{value},{}", row.experiment, row.repetition, row.kpi, row.unit)
            }
            (None, reason) => {
                let reason = reason.as_deref().unwrap_or("no reason given");
                writeln!(text, "# {} {}: no {}: {reason}", row.experiment, row.repetition, row.kpi)
            }
        };
    }
    text
}

/// The particle density as submerged weighings find it: hidden value and scatter of one weighing.
fn weighings(order: &Order, parameters: &Values) -> String {
    let mut stream = Stream::new(order.seed, "challenge weighings");
    let mut text = String::new();
    let hidden = parameters.iter().find(|(name, _)| name == "particle_density").filter(|_| order.weighings >= 2);
    for (weighing, (name, density)) in (1..=order.weighings).filter_map(|weighing| Some((weighing, hidden?))) {
        let value = density + WEIGHING_SD * stream.normal();
        let _ = writeln!(text, "grains,{weighing},{name},{value},kg/m3");
    }
    text
}

const COMMITMENT: &str = "# commitment: blake3 ";

/// What a challenge hides, read from its seal.
#[derive(Debug, Clone, PartialEq)]
pub struct Declaration {
    /// The effect and its strength; none is hidden otherwise.
    pub effect: Option<(String, f64)>,
    /// Whether a setting was changed that no effect describes.
    pub foreign: bool,
    /// The hidden parameters, in SI units.
    pub parameters: BTreeMap<String, f64>,
}

impl Declaration {
    /// Opens the seal of the data set `measured`.
    ///
    /// # Errors
    /// A declaration that is not the one the data were made with, or that cannot be read.
    pub fn open(sealed: &str, measured: &str) -> Result<Self, ChallengeError> {
        let committed = measured.lines().find_map(|line| line.strip_prefix(COMMITMENT)).unwrap_or("none");
        let found = Digest::of_content(sealed.as_bytes());
        if committed != found.to_string() {
            return Err(ChallengeError::BrokenSeal { committed: committed.to_owned(), found });
        }
        let wrong = |what: &dyn std::fmt::Display| ChallengeError::Declaration(what.to_string());
        let table: toml::Table = sealed.parse().map_err(|e: toml::de::Error| wrong(&e))?;
        let numbers = |name: &str| -> Result<BTreeMap<String, f64>, ChallengeError> {
            let table =
                table.get(name).and_then(toml::Value::as_table).ok_or_else(|| wrong(&format!("no [{name}]")))?;
            Ok(table.iter().filter_map(|(name, value)| Some((name.clone(), value.as_float()?))).collect())
        };
        let effect = numbers("effects")?.into_iter().next();
        Ok(Self { effect, foreign: table.contains_key("scaled_settings"), parameters: numbers("parameters")? })
    }
}

/// A solution beside the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// What is hidden: the effect, `none` or `foreign`.
    pub truth: String,
    /// Its strength.
    pub strength: Option<f64>,
    /// Whether the effect could be named: it is among the candidates.
    pub in_library: bool,
    /// Verdict of the solution.
    pub verdict: String,
    /// Effects that the verdict names.
    pub named: Vec<String>,
    /// Strength found for the hidden effect.
    pub found: Option<f64>,
    /// Its standard error.
    pub found_sd: Option<f64>,
    /// Smallest strength that is detected with the wanted probability, if there is one.
    pub detectable: Option<f64>,
    /// Whether an effect that was left out differs enough from every candidate for "none of them" to be due.
    pub decidable: Option<bool>,
    /// Whether the verdict is right.
    pub correct: bool,
}

impl Score {
    /// Whether an effect of the library is hidden that is at or above its detection limit.
    pub fn is_detectable(&self) -> bool {
        let reaches = |(strength, limit): (f64, f64)| strength.abs() >= limit.abs();
        self.in_library && self.strength.zip(self.detectable).is_some_and(reaches)
    }

    /// Whether the verdict names the hidden effect, alone or in a class.
    pub fn names_truth(&self) -> bool {
        self.named.contains(&self.truth)
    }

    /// How far the strength of an effect that was named is off, in its standard errors.
    pub fn off(&self) -> Option<f64> {
        let (found, sd) = self.found.zip(self.found_sd.filter(|sd| *sd > 0.0)).filter(|_| self.names_truth())?;
        Some((found - self.strength?) / sd)
    }
}

/// How far every hidden parameter is off in the standard errors of the model that holds what is hidden: the plain one where
/// that is nothing and nothing was found, the one with the effect where that is named alone; none of any other model.
pub fn parameters_off(declaration: &Declaration, score: &Score, rows: &[RecalibrationRow]) -> BTreeMap<String, f64> {
    let model = match (&declaration.effect, score.named.as_slice()) {
        (None, []) if !declaration.foreign && score.correct => "before",
        (Some((name, _)), [named]) if name == named => "after",
        _ => return BTreeMap::new(),
    };
    let of = |row: &RecalibrationRow| {
        let hidden = declaration.parameters.get(&row.name).filter(|_| row.standard_error > 0.0)?;
        Some((row.name.clone(), (row.value - hidden) / row.standard_error))
    };
    rows.iter().filter(|row| row.model == model).filter_map(of).collect()
}

/// Part of a candidate that could not be named, in the table of the attribution.
const LEFT_OUT: &str = "left_out";
/// Parts of candidates that could not be named.
const UNNAMED: [&str; 4] = [LEFT_OUT, "absorbed", "unresolved", "not_testable"];
/// Level of the leftover test, and the power that it must have.
const LEFTOVER: (f64, f64) = (0.01, 0.95);

impl Solution {
    /// The candidate that may be named and leaves least of the effect of `row` at a strength, and what it leaves, in squared
    /// standard errors: twice the expected lead, which grows with the square of the strength.
    fn nearest(&self, row: &AttributionRow, strength: f64) -> Option<(&str, f64)> {
        let scale = if row.strength == 0.0 { 0.0 } else { strength / row.strength };
        let may_be_named = |name: &str| {
            self.attribution.iter().any(|other| other.effect == name && !UNNAMED.contains(&other.part.as_str()))
        };
        let rivals = self.confusion.iter().filter(|pair| pair.effect == row.effect && may_be_named(&pair.other));
        let each = rivals.map(|pair| (pair.other.as_str(), 2.0 * pair.separation * scale * scale));
        each.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Whether what the best rival leaves of an effect is seen by the leftover test: χ²(d − 1) with that as its non-centrality
/// exceeds its critical value (Patnaik's approximation of the non-central χ²).
fn is_decidable(shift: f64, dof: u32) -> bool {
    let (level, power) = LEFTOVER;
    let d = f64::from(dof.saturating_sub(1).max(1));
    let (scale, freedom) = ((d + 2.0 * shift) / (d + shift), (d + shift) * (d + shift) / (d + 2.0 * shift));
    chi2_sf(chi2_quantile(1.0 - level, d) / scale, freedom) >= power
}

/// Largest class that still counts as an answer.
const LARGEST_CLASS: usize = 3;

/// Tables of a solution that its score needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The verdict.
    pub verdict: VerdictRow,
    /// What was found for every candidate.
    pub attribution: Vec<AttributionRow>,
    /// How alike the candidates look.
    pub confusion: Vec<ConfusionRow>,
}

/// Compares a solution with the declaration.
///
/// Right is: the hidden effect, or a class of at most three with it; "no detectable discrepancy" where nothing is hidden
/// or the strength is below the detection limit; "none of the candidates" where what is hidden is none of them. An effect
/// that was left out of the library and looks too much like a candidate may be taken for that one.
pub fn score(declaration: &Declaration, solution: &Solution) -> Score {
    let verdict = &solution.verdict;
    let named: Vec<String> = verdict.effects.split([',', ' ']).filter(|n| !n.is_empty()).map(str::to_owned).collect();
    let hidden = declaration.effect.as_ref();
    let row = hidden.and_then(|(name, _)| solution.attribution.iter().find(|row| row.effect == *name));
    let in_library = row.is_some_and(|row| row.part != LEFT_OUT);
    let quiet = verdict.verdict == "no_detectable_discrepancy";
    let none = verdict.verdict == "none_of_the_candidates";
    let one_or_class = matches!(verdict.verdict.as_str(), "effect" | "class") && named.len() <= LARGEST_CLASS;
    let detectable = row.and_then(|row| row.strength_90);
    let decidable = hidden.zip(row).filter(|_| !in_library).map(|((_, strength), row)| {
        // Where no candidate may be named, all of it is left.
        let whole = row.a * strength;
        is_decidable(solution.nearest(row, *strength).map_or(whole * whole, |(_, left)| left), verdict.dof)
    });
    let correct = match hidden {
        None if declaration.foreign => none,
        None => quiet,
        Some((name, strength)) if in_library => {
            let weak = detectable.is_none_or(|limit| strength.abs() < limit.abs());
            (one_or_class && named.contains(name)) || (weak && quiet)
        }
        Some((_, strength)) => {
            let nearest = row.and_then(|row| solution.nearest(row, *strength));
            let taken = nearest.is_some_and(|(name, _)| one_or_class && named.iter().any(|n| n == name));
            none || (decidable == Some(false) && (taken || quiet))
        }
    };
    Score {
        truth: hidden.map_or(if declaration.foreign { "foreign" } else { "none" }, |(name, _)| name).to_owned(),
        strength: hidden.map(|(_, strength)| *strength),
        in_library,
        decidable,
        verdict: verdict.verdict.clone(),
        found: row.map(|row| row.strength),
        found_sd: row.map(|row| row.strength_sd),
        named,
        detectable,
        correct,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::EXPERIMENTS;
    use crate::settings::Settings;
    use std::collections::BTreeSet;

    /// Even at the same point, with the same base seed.
    #[test]
    fn packings_come_from_seeds_that_no_stage_draws() {
        let values = [("sliding_friction".to_owned(), 0.4)];
        let point = Arc::new(Point::new(1, &Settings::default(), &values).unwrap());
        let seeds =
            |requests: Vec<Request>| requests.into_iter().map(|request| request.seed).collect::<BTreeSet<u64>>();
        for seed in 0..50 {
            let blind = seeds(batch(EXPERIMENTS[0], &point, 50, seed).unwrap());
            let study = seeds(Request::batch("design", EXPERIMENTS[0], &point, 1..=50, seed).unwrap());
            assert_eq!(blind.len(), 50);
            assert!(blind.is_disjoint(&study));
        }
    }

    #[test]
    fn none_of_the_candidates_is_due_where_the_leftover_test_sees_the_rest() {
        // Power of χ²(9) at 1 % (21.67): 0.95 needs a non-centrality of about 30.4 (tables of the non-central χ²).
        assert!(is_decidable(31.5, 10) && !is_decidable(29.0, 10));
    }
}
