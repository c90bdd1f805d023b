//! Air drag: a negative control. On gravel it is about 1 % of the weight where grains fall fastest, so it should not be seen.
//!
//! Force ½ C_d ρ_air π R² v² against the velocity of every grain, in still air.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Drag of still air.
pub struct AirDrag;

impl Effect for AirDrag {
    fn name(&self) -> &'static str {
        "air_drag"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 1.0)
    }

    fn meaning(&self) -> &'static str {
        "drag coefficient of a grain in air of 1.2 kg/m3"
    }

    fn source(&self) -> &'static str {
        "a smooth sphere has 0.44 at these Reynolds numbers (Clift, Grace and Weber 1978); angular grains about twice that"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("drag_coefficient", settings.get("drag_coefficient")? + strength)
    }
}
