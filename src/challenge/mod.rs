//! Challenges: measured data that hide an effect, made by the study's own set-up with hidden parameters.
//!
//! Takes a study and a seed; gives a measured data set and, in a file of its own, the declaration of what is hidden; later
//! compares a solution with the declaration. The data carry a commitment (blake3) to the declaration, so that it cannot be changed afterwards. Hidden parameters
//! lie inside the bounds and are no design point; the packings come from seeds that no stage of a study can draw.

mod confusion;
mod scoring;

pub use confusion::ConfusionMatrix;
pub use scoring::{Score, Solution, parameters_off, score};

use crate::campaign::{Campaign, CampaignError, Point, Request, Values};
use crate::canonical::{Digest, Encoder, digest};
use crate::config::Config;
use crate::effects::EffectError;
use crate::experiments::Experiment;
use crate::rng::Stream;
use crate::tables::list::KpiRow;
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
}
