//! Layer thickness: how many grains deep an eye looks into the outline, towards the silhouette.
//!
//! Scales the front layer and the depth slices alike; a silhouette has no layers and stays.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Thickness of the layer whose outline is taken.
pub struct LayerThickness;

impl Effect for LayerThickness {
    fn name(&self) -> &'static str {
        "layer_thickness"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.5, 2.0)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of the thickness of the front layer, or of the depth slices, of which an outline is taken"
    }

    fn source(&self) -> &'static str {
        "paper, section 3.3 says front particles only, not how thick a front is"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        ["front_layer", "slice_thickness"].into_iter().try_for_each(|name| settings.scale(name, 1.0 + strength))
    }
}
