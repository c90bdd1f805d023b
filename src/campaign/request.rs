//! What to simulate: one request per run, with its seed, its hash and its content key.
//!
//! The seed of a run depends on base seed, experiment, base parameter values and repetition alone: never on the study,
//! the stage, the point's index, the number of repetitions or an effect. So a campaign that grows keeps its runs, two
//! studies share them, and runs with and without an effect share their packing.

use super::CampaignError;
use crate::canonical::{Digest, Encoder, digest};
use crate::dem;
use crate::effects::{self, Library};
use crate::experiments::Experiment;
use crate::settings::{Scope, Settings};
use rayon::prelude::*;
use std::sync::Arc;

const SEED_CONTEXT: &str = "granulake 2026 run seed v1";
const POINT_CONTEXT: &str = "granulake 2026 parameter hash v1";
const RUN_CONTEXT: &str = "granulake 2026 run key v1";

/// Names and SI values, sorted by name.
pub type Values = Vec<(String, f64)>;

/// A point of the parameter space with the effects that are switched on: what a batch of repetitions shares.
#[derive(Debug, Clone)]
pub struct Point {
    /// Number within its label, from 1.
    pub number: u32,
    /// Settings with the parameters set, before any effect.
    pub settings: Arc<Settings>,
    /// Parameter values, sorted by name.
    pub parameters: Values,
    /// Effect strengths, sorted by name; zero is the same as absent.
    pub effects: Values,
    /// What the names of the effects mean.
    pub library: Library,
}

impl Point {
    /// The point with `parameters` set in `base`, without effects, seeded by its own values.
    ///
    /// # Errors
    /// A parameter that is no setting, or outside its bounds.
    pub fn new(number: u32, base: &Settings, parameters: &[(String, f64)]) -> Result<Self, CampaignError> {
        let mut parameters = parameters.to_vec();
        parameters.sort_by(|a, b| a.0.cmp(&b.0));
        let mut settings = base.clone();
        for (name, value) in &parameters {
            settings.set(name, *value)?;
        }
        Ok(Self { number, settings: Arc::new(settings), parameters, effects: Vec::new(), library: Library::default() })
    }

    /// The same point, whose effects may be those of `library`.
    #[must_use]
    pub fn knowing(self, library: &Library) -> Self {
        Self { library: library.clone(), ..self }
    }

    /// The same point with these effects on; zero strengths are dropped.
    #[must_use]
    pub fn with_effects(mut self, effects: &[(String, f64)]) -> Self {
        self.effects = effects.iter().filter(|(_, strength)| *strength != 0.0).cloned().collect();
        self.effects.sort_by(|a, b| a.0.cmp(&b.0));
        self
    }

    /// Hash of parameter values and effect strengths.
    ///
    /// # Errors
    /// A value that is NaN.
    pub fn hash(&self) -> Result<Digest, CampaignError> {
        let mut encoder = Encoder::new();
        encode(&mut encoder, &self.parameters)?;
        encode(&mut encoder, &self.effects)?;
        Ok(digest(POINT_CONTEXT, &encoder))
    }

    /// The effects as `name=value name=value`, empty when none.
    pub fn effects_text(&self) -> String {
        self.effects.iter().map(|(name, strength)| format!("{name}={strength}")).collect::<Vec<_>>().join(" ")
    }
}

/// One run asked for.
#[derive(Clone)]
pub struct Request {
    /// Who asks, as in the tables.
    pub label: String,
    /// What to run.
    pub experiment: &'static dyn Experiment,
    /// Where in the parameter space.
    pub point: Arc<Point>,
    /// Repetition, from 1.
    pub repetition: u32,
    /// Seed of the run.
    pub seed: u64,
}

impl Request {
    /// All repetitions `from..=to` of `point` in `experiment`.
    ///
    /// # Errors
    /// A parameter value that is NaN.
    pub fn batch(
        label: &str,
        experiment: &'static dyn Experiment,
        point: &Arc<Point>,
        repetitions: std::ops::RangeInclusive<u32>,
        base_seed: u64,
    ) -> Result<Vec<Self>, CampaignError> {
        repetitions
            .map(|repetition| {
                let seed = run_seed(base_seed, experiment.name(), &point.parameters, repetition)?;
                Ok(Self { label: label.to_owned(), experiment, point: Arc::clone(point), repetition, seed })
            })
            .collect()
    }

    /// The settings of this run with its effects applied; without effects they are those of the point, not a copy.
    ///
    /// # Errors
    /// An effect that is unknown or out of range, or that pushes a setting out of its bounds.
    pub fn resolve(&self) -> Result<Arc<Settings>, CampaignError> {
        if self.point.effects.is_empty() {
            return Ok(Arc::clone(&self.point.settings));
        }
        let mut settings = (*self.point.settings).clone();
        for (name, strength) in &self.point.effects {
            let effect = self.point.library.find(name)?;
            effects::apply(&*effect, *strength, &mut settings, self.seed, self.repetition)?;
        }
        Ok(Arc::new(settings))
    }

    /// Whether both resolve to the same settings, told without resolving them: true for repetitions of one point
    /// without effects.
    fn shares_settings(&self, other: &Self) -> bool {
        let same = Arc::ptr_eq(&self.point, &other.point) && self.experiment.name() == other.experiment.name();
        same && self.point.effects.is_empty()
    }

    /// Content key of the run: physics version, experiment, seed, its resolved settings, and equipment if there is any.
    ///
    /// # Errors
    /// A setting that is NaN.
    pub fn key(&self, resolved: &Settings) -> Result<Digest, CampaignError> {
        Ok(self.key_of(&self.told(resolved, Scope::Simulate)?))
    }

    /// The key from the encoded settings of the simulation.
    fn key_of(&self, told: &Encoder) -> Digest {
        let mut encoder = Encoder::new();
        encoder.u64(u64::from(dem::PHYSICS_VERSION)).str(self.experiment.name()).u64(self.seed).append(told);
        digest(RUN_CONTEXT, &encoder)
    }

    /// The settings of one scope that the experiment reads, encoded for a key; with the equipment that is simulated.
    pub(super) fn told(&self, resolved: &Settings, scope: Scope) -> Result<Encoder, CampaignError> {
        let mut encoder = Encoder::new();
        encode(&mut encoder, &resolved.for_experiment(self.experiment.name(), scope))?;
        for piece in resolved.equipment(self.experiment.name()).filter(|_| scope == Scope::Simulate) {
            encoder.str(&piece.name).str(piece.material).bytes(&piece.digest.0);
        }
        Ok(encoder)
    }
}

/// A request with its resolved settings and key.
pub(super) struct Resolved<'a> {
    pub request: &'a Request,
    pub settings: Arc<Settings>,
    pub key: Digest,
}

/// Resolves requests in order, on all threads of the pool this is called in. What repetitions share is encoded once.
pub(super) fn resolve(requests: &[Request]) -> Result<Vec<Resolved<'_>>, CampaignError> {
    let alike: Vec<&[Request]> = requests.chunk_by(Request::shares_settings).collect();
    let parts: Result<Vec<Vec<Resolved>>, CampaignError> = alike.into_par_iter().map(resolve_alike).collect();
    Ok(parts?.into_iter().flatten().collect())
}

fn resolve_alike(requests: &[Request]) -> Result<Vec<Resolved<'_>>, CampaignError> {
    let Some(first) = requests.first() else { return Ok(Vec::new()) };
    let settings = first.resolve()?;
    let told = first.told(&settings, Scope::Simulate)?;
    let resolved = |request| Resolved { request, settings: Arc::clone(&settings), key: request.key_of(&told) };
    Ok(requests.iter().map(resolved).collect())
}

/// Seed of a run: base seed, experiment, base parameter values, repetition.
///
/// # Errors
/// A value that is NaN.
pub fn run_seed(
    base_seed: u64,
    experiment: &str,
    parameters: &[(String, f64)],
    repetition: u32,
) -> Result<u64, CampaignError> {
    let mut encoder = Encoder::new();
    encoder.u64(base_seed).str(experiment);
    encode(&mut encoder, parameters)?;
    encoder.u64(u64::from(repetition));
    Ok(digest(SEED_CONTEXT, &encoder).to_u64())
}

/// Appends a list of names and values.
fn encode<N: AsRef<str>>(encoder: &mut Encoder, values: &[(N, f64)]) -> Result<(), CampaignError> {
    encoder.list(values.len());
    for (name, value) in values {
        encoder.str(name.as_ref()).f64(*value)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::EXPERIMENTS;

    fn point(friction: f64) -> Point {
        Point::new(1, &Settings::default(), &[("sliding_friction".to_owned(), friction)]).unwrap()
    }

    fn key(point: Point, repetition: u32) -> Digest {
        let batch = Request::batch("design", EXPERIMENTS[0], &Arc::new(point), repetition..=repetition, 1).unwrap();
        batch[0].key(&batch[0].resolve().unwrap()).unwrap()
    }

    #[test]
    fn an_effect_of_strength_zero_has_the_key_of_no_effect() {
        let with = |strength| point(0.5).with_effects(&[("cohesion".to_owned(), strength)]);
        assert_eq!(key(with(0.0), 1), key(point(0.5), 1));
        assert_eq!(key(with(-0.0), 1), key(point(0.5), 1));
        assert_ne!(key(with(0.5), 1), key(point(0.5), 1));
        assert_eq!(with(0.0).hash().unwrap(), point(0.5).hash().unwrap());
    }

    #[test]
    fn requests_resolved_together_have_the_keys_of_each_alone() {
        let (plain, other) = (Arc::new(point(0.5)), Arc::new(point(0.4)));
        let scattered = Arc::new(point(0.5).with_effects(&[("wall_friction_scatter".to_owned(), 0.2)]));
        let mut requests = Vec::new();
        for experiment in &EXPERIMENTS[..2] {
            for point in [&plain, &other, &scattered] {
                requests.extend(Request::batch("design", *experiment, point, 1..=3, 1).unwrap());
            }
        }
        let together = resolve(&requests).unwrap();
        for (request, together) in requests.iter().zip(&together) {
            let settings = request.resolve().unwrap();
            assert_eq!((&settings, request.key(&settings).unwrap()), (&together.settings, together.key));
        }
        let keys: std::collections::BTreeSet<_> = together.iter().map(|run| run.key).collect();
        assert_eq!(keys.len(), requests.len());
    }

    #[test]
    fn an_effect_shares_the_seed_but_not_the_key() {
        let base = Arc::new(point(0.5));
        let with = Arc::new(point(0.5).with_effects(&[("cohesion".to_owned(), 0.5)]));
        let seed = |p: &Arc<Point>| Request::batch("a", EXPERIMENTS[0], p, 1..=1, 1).unwrap()[0].seed;
        assert_eq!(seed(&base), seed(&with));
        assert_ne!(key((*base).clone(), 1), key((*with).clone(), 1));
        assert_ne!(base.hash().unwrap(), with.hash().unwrap());
    }

    #[test]
    fn label_and_point_number_do_not_enter_the_key() {
        let mut other = point(0.5);
        other.number = 99;
        assert_eq!(key(other, 2), key(point(0.5), 2));
        assert_ne!(key(point(0.5), 1), key(point(0.5), 2));
    }
}
