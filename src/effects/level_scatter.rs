//! Level scatter: the density cylinder is struck off a little too high or too low, anew in every repetition.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Scatter of the strike-off height of the density cylinder.
pub struct LevelScatter;

impl Effect for LevelScatter {
    fn name(&self) -> &'static str {
        "level_scatter"
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.005)
    }

    fn meaning(&self) -> &'static str {
        "standard deviation, between repetitions, of the height at which the density cylinder is struck off"
    }

    fn source(&self) -> &'static str {
        "1.8 mm equals the whole measured scatter of the bulk density"
    }

    fn is_scatter(&self) -> bool {
        true
    }

    fn apply(&self, strength: f64, settings: &mut Settings, stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("bulk_density.fill_height", settings.get("bulk_density.fill_height")? + strength * stream.normal())
    }
}
