//! Challenges: measured data that hide an effect, made by the study's own set-up with hidden parameters.
//!
//! Takes a study and a seed; gives a measured data set and, in a file of its own, the declaration of what is hidden.
//! The data carry a commitment (blake3) to the declaration, so that it cannot be changed afterwards. Hidden parameters
//! lie inside the bounds and are no design point; the packings come from seeds that no stage of a study can draw.

use crate::campaign::{Campaign, CampaignError, Point, Request, Values};
use crate::canonical::{Digest, Encoder, digest};
use crate::config::Config;
use crate::effects::{self, Effect, EffectError};
use crate::experiments::Experiment;
use crate::rng::Stream;
use crate::tables::list::KpiRow;
use std::fmt::Write;
use std::sync::Arc;

/// Contexts of a challenge's seeds; a study's runs use others.
const PACKING_CONTEXT: &str = "granulake 2026 challenge packing v1";
/// Share of each parameter's range that hidden values keep from its bounds.
const MARGIN: f64 = 0.2;

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
}

/// Makes the challenge of `order` with the set-up of `config`.
///
/// # Errors
/// An effect that is unknown or out of range, or runs that cannot be made.
pub fn make(config: &Config, campaign: &Campaign, order: &Order) -> Result<Challenge, ChallengeError> {
    let mut stream = Stream::new(order.seed, "challenge");
    let parameters = hidden_parameters(config, &mut stream);
    let effects = hidden_effect(config, order, &mut stream)?;
    let mut base = config.base_settings().clone();
    for (name, factor) in &order.scale {
        base.scale(name, *factor).map_err(CampaignError::from)?;
    }
    let point = Arc::new(Point::new(1, &base, &parameters).map(|point| point.with_effects(&effects))?);
    let mut requests = Vec::new();
    for experiment in config.experiments() {
        requests.extend(batch(experiment, &point, order.repetitions, order.seed)?);
    }
    if let Some(experiment) = Some(config.validate.experiment) {
        requests.extend(batch(experiment, &point, order.held_out_repetitions, order.seed)?);
    }
    let runs = campaign.simulate(&requests)?;
    let kpis = campaign.measure(&requests, &runs)?;
    let sealed = declaration(order, &parameters, &effects);
    Ok(Challenge { measured: csv(order, &sealed, &kpis), sealed })
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
    let effect: &dyn Effect = if order.effect == "random" {
        let candidates = &config.diagnose.candidates;
        if candidates.is_empty() {
            return Err(ChallengeError::NoCandidates);
        }
        effects::find(&candidates[stream.index(candidates.len())])?
    } else {
        effects::find(&order.effect)?
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
         # commitment: blake3 {}\n\
         experiment,repetition,kpi,value,unit\n",
        order.seed,
        Digest::of_content(sealed.as_bytes())
    );
    for row in kpis {
        let _ = match (row.value, &row.reason) {
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
