//! Fill level: the boxes are filled higher or lower than the mark says.
//!
//! The density cylinder is not filled to a mark but struck off at its rim; its error is `level_error`.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Marks up to which grains are filled.
const FILLED_TO_A_MARK: [&str; 3] = ["pile.fill_height", "ledge.fill_height", "hopper.fill_height"];

/// Shift of the fill marks.
pub struct FillLevel;

impl Effect for FillLevel {
    fn name(&self) -> &'static str {
        "fill_level"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.2, 0.2)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of the fill height of boxes and hopper"
    }

    fn source(&self) -> &'static str {
        "214 mm in the experiment and 218 mm in the model (paper, section 2.1 and Table 5) are 2 % apart"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        FILLED_TO_A_MARK.iter().try_for_each(|name| settings.scale(name, 1.0 + strength))
    }
}
