//! Cohesion between the grains alone: liquid bridges that the walls repel, as acrylic repels water more than stone does.
//!
//! The same law as `cohesion`; no bridge pulls at a wall, so that nothing is held on shelves and back walls.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Liquid bridges between grains, with dry walls.
pub struct CohesionDryWalls;

impl Effect for CohesionDryWalls {
    fn name(&self) -> &'static str {
        "cohesion_dry_walls"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 2.0)
    }

    fn meaning(&self) -> &'static str {
        "Bond number between grains, with walls to which nothing sticks"
    }

    fn source(&self) -> &'static str {
        "Willett et al. (2000); the force at a wall goes with the cosine of its own contact angle"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        if strength > 0.0 {
            settings.set("wall_bridge_ratio", 0.0)?;
        }
        settings.set("bond_number", settings.get("bond_number")? + strength)
    }
}
