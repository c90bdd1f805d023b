//! Load-cell gain: the cells under the hopper read too much or too little. Only the held-out hopper shows it.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Gain error of the load cells.
pub struct LoadCellGain;

impl Effect for LoadCellGain {
    fn name(&self) -> &'static str {
        "load_cell_gain"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.1, 0.1)
    }

    fn meaning(&self) -> &'static str {
        "relative error of the load cells under the hopper"
    }

    fn source(&self) -> &'static str {
        "a cell that was calibrated empty; classes C1 to C3 are far better (OIML R 60)"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("hopper.load_cell_gain", settings.get("hopper.load_cell_gain")? + strength)
    }
}
