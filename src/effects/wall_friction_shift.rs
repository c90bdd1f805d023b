//! Wall friction, shift: every wall is smoother or rougher than measured, in every repetition alike.
//!
//! Rolling friction of a wall is a multiple of its sliding friction and follows.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError, WALL_FRICTIONS};

/// Common shift of every wall friction.
pub struct WallFrictionShift;

impl Effect for WallFrictionShift {
    fn name(&self) -> &'static str {
        "wall_friction_shift"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.5, 0.5)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of every wall friction, rolling included"
    }

    fn source(&self) -> &'static str {
        "paper, Table 1: coefficients of variation of 10 to 22 %"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        WALL_FRICTIONS.iter().try_for_each(|name| settings.scale(name, 1.0 + strength))
    }
}
