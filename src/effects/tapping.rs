//! Tapping: the density cylinder is knocked on the bench before it is struck off, which compacts the bed.
//!
//! The vessel is dropped `bulk_density.taps` times; in its frame the grains float, then feel the impact.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Drops of the density cylinder.
pub struct Tapping;

impl Effect for Tapping {
    fn name(&self) -> &'static str {
        "tapping"
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.005)
    }

    fn meaning(&self) -> &'static str {
        "height from which the density cylinder is dropped, several times, before it is struck off"
    }

    fn source(&self) -> &'static str {
        "EN ISO 787-11: a tapping device drops by 3 mm"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("bulk_density.tap_height", settings.get("bulk_density.tap_height")? + strength)
    }
}
