//! Friction spread: every grain has its own sliding and rolling friction, lognormal about the mean.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Spread of friction from grain to grain.
pub struct FrictionSpread;

impl Effect for FrictionSpread {
    fn name(&self) -> &'static str {
        "friction_spread"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.5)
    }

    fn meaning(&self) -> &'static str {
        "coefficient of variation of friction from grain to grain, lognormal"
    }

    fn source(&self) -> &'static str {
        "angular gravel; tilt tests scatter by 10 to 50 % between grains"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("friction_spread_cv", settings.get("friction_spread_cv")? + strength)
    }
}
