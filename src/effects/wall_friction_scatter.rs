//! Wall friction, scatter: walls differ from repetition to repetition, lognormal about the measured mean.
//!
//! factor = exp(σz − σ²/2), σ² = ln(1 + η²), z standard normal: mean 1, coefficient of variation η, never negative.
//! One z per repetition, because the walls of one test wear together.

use super::{Effect, lognormal};
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError, WALL_FRICTIONS};

/// Scatter of every wall friction between repetitions.
pub struct WallFrictionScatter;

impl Effect for WallFrictionScatter {
    fn name(&self) -> &'static str {
        "wall_friction_scatter"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 0.3)
    }

    fn meaning(&self) -> &'static str {
        "coefficient of variation of every wall friction between repetitions"
    }

    fn source(&self) -> &'static str {
        "paper, Table 1: coefficients of variation of 10 to 22 %"
    }

    fn is_scatter(&self) -> bool {
        true
    }

    fn apply(&self, strength: f64, settings: &mut Settings, stream: &mut Stream) -> Result<(), SettingsError> {
        let factor = lognormal(strength, stream);
        WALL_FRICTIONS.iter().try_for_each(|name| settings.scale(name, factor))
    }
}
