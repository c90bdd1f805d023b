//! Tilt: the apparatus stands askew, so that grains drift to the right (positive) or left.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Tilt of the apparatus.
pub struct Tilt;

impl Effect for Tilt {
    fn name(&self) -> &'static str {
        "tilt"
    }

    fn unit(&self) -> &'static str {
        "deg"
    }

    fn range(&self) -> (f64, f64) {
        (-5.0, 5.0)
    }

    fn meaning(&self) -> &'static str {
        "tilt of the apparatus about its front-to-back axis"
    }

    fn source(&self) -> &'static str {
        "a bench without a spirit level"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("tilt", settings.get("tilt")? + strength)
    }
}
