//! Rolling spread: grains differ in shape, so in rolling friction alone; lognormal about the mean.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Spread of rolling friction from grain to grain.
pub struct RollingSpread;

impl Effect for RollingSpread {
    fn name(&self) -> &'static str {
        "rolling_spread"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.5)
    }

    fn meaning(&self) -> &'static str {
        "coefficient of variation of rolling friction from grain to grain, lognormal"
    }

    fn source(&self) -> &'static str {
        "rolling friction stands for shape, which varies between grains of one gravel"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("rolling_spread_cv", settings.get("rolling_spread_cv")? + strength)
    }
}
