//! Cohesion: liquid bridges between grains and to walls, law of Willett et al. (2000).
//!
//! The strength is the Bond number 2πR̄γcosθ/(m̄g); the liquid volume ratio and contact angle stay as set.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Liquid-bridge cohesion.
pub struct Cohesion;

impl Effect for Cohesion {
    fn name(&self) -> &'static str {
        "cohesion"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 2.0)
    }

    fn meaning(&self) -> &'static str {
        "Bond number: capillary force of a mean pair over the weight of a mean grain"
    }

    fn source(&self) -> &'static str {
        "Willett et al. (2000); water on this gravel reaches about 0.2, more is adhesion of another origin"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("bond_number", settings.get("bond_number")? + strength)
    }
}
