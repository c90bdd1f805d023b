//! Bin width: the analyst cuts the outline into wider or narrower bins than one mean diameter.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Width of the bins of an outline.
pub struct BinWidth;

impl Effect for BinWidth {
    fn name(&self) -> &'static str {
        "bin_width"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.5, 1.0)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of the width of the bins in which an outline is marked"
    }

    fn source(&self) -> &'static str {
        "paper, section 3.3: bins one mean diameter wide, by number 5.02 or by truncated distribution 5.21 mm"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.scale("bin_width", 1.0 + strength)
    }
}
