//! Camera roll: the picture is rolled, the grains are not. Shifts the ledge angle and splits left from right.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Roll of the camera.
pub struct CameraRoll;

impl Effect for CameraRoll {
    fn name(&self) -> &'static str {
        "camera_roll"
    }

    fn unit(&self) -> &'static str {
        "deg"
    }

    fn range(&self) -> (f64, f64) {
        (-5.0, 5.0)
    }

    fn meaning(&self) -> &'static str {
        "counter-clockwise roll of the picture"
    }

    fn source(&self) -> &'static str {
        "a camera without a spirit level"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("camera_roll", settings.get("camera_roll")? + strength)
    }
}
