//! Fines: grains below the lower cut of the sieve curve, dust and chips that the model leaves out.
//!
//! All of one size, `fines_size` times the smallest other grain; they come in addition to the others, whose sizes stay.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Mass fraction of fines.
pub struct Fines;

impl Effect for Fines {
    fn name(&self) -> &'static str {
        "fines"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.15)
    }

    fn meaning(&self) -> &'static str {
        "mass of grains below the lower cut over the mass of all grains"
    }

    fn source(&self) -> &'static str {
        "undersize of a commercial gravel is up to 15 % (EN 12620, category GC 85/15)"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("fines_fraction", settings.get("fines_fraction")? + strength)
    }
}
