//! Release: gate and wall are pulled away at a finite speed, where the model lets them vanish.
//!
//! The strength is the time of the pull and not its speed, so that zero is absent. The slide under pile and hopper leaves through
//! the front, the wall of the ledge upwards; both rub against the grains on their way.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Time in which gate and wall are pulled away.
pub struct ReleaseDelay;

impl Effect for ReleaseDelay {
    fn name(&self) -> &'static str {
        "release_delay"
    }

    fn unit(&self) -> &'static str {
        "s"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.5)
    }

    fn meaning(&self) -> &'static str {
        "time in which the gate, or the wall of the ledge, is pulled away at constant speed"
    }

    fn source(&self) -> &'static str {
        "a slide pulled by hand takes some tenths of a second; the paper does not say"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("release_duration", settings.get("release_duration")? + strength)
    }
}
