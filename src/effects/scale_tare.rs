//! Scale tare: the empty cylinder was weighed wrong, so every net mass is off by the same amount.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Error of the tare.
pub struct ScaleTare;

impl Effect for ScaleTare {
    fn name(&self) -> &'static str {
        "scale_tare"
    }

    fn unit(&self) -> &'static str {
        "kg"
    }

    fn range(&self) -> (f64, f64) {
        (-0.1, 0.1)
    }

    fn meaning(&self) -> &'static str {
        "error of the tare of the scale under the density cylinder"
    }

    fn source(&self) -> &'static str {
        "a handful of grains left in a 5 l cylinder"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("bulk_density.tare", settings.get("bulk_density.tare")? + strength)
    }
}
