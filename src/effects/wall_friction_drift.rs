//! Wall friction, drift: every wall wears from repetition to repetition, so that results have a trend.
//!
//! The friction that was measured is that in the middle of a series of `series_length` repetitions.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError, WALL_FRICTIONS};

/// Drift of every wall friction over the repetitions.
pub struct WallFrictionDrift;

impl Effect for WallFrictionDrift {
    fn name(&self) -> &'static str {
        "wall_friction_drift"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.02, 0.02)
    }

    fn meaning(&self) -> &'static str {
        "relative change of every wall friction per repetition, about the middle of the series"
    }

    fn source(&self) -> &'static str {
        "paper, Table 1: worn and new walls differ by up to half"
    }

    fn is_drift(&self) -> bool {
        true
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        WALL_FRICTIONS.iter().try_for_each(|name| settings.scale(name, 1.0 + strength))
    }
}
