//! Level error: the density cylinder is struck off too high or too low.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Error of the strike-off height of the density cylinder.
pub struct LevelError;

impl Effect for LevelError {
    fn name(&self) -> &'static str {
        "level_error"
    }

    fn unit(&self) -> &'static str {
        "m"
    }

    fn range(&self) -> (f64, f64) {
        (-0.01, 0.01)
    }

    fn meaning(&self) -> &'static str {
        "shift of the height at which the density cylinder is struck off"
    }

    fn source(&self) -> &'static str {
        "assumption: gravel is struck off to within about one grain"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("bulk_density.fill_height", settings.get("bulk_density.fill_height")? + strength)
    }
}
