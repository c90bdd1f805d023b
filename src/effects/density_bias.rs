//! Density bias: the grains are denser or lighter than the submerged weighing said.
//!
//! A calibrated density takes this up entirely; only a prior on the measured density makes it visible.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Bias of the grain density.
pub struct DensityBias;

impl Effect for DensityBias {
    fn name(&self) -> &'static str {
        "density_bias"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.2, 0.2)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of the density of the grains against the one measured submerged"
    }

    fn source(&self) -> &'static str {
        "open pores and trapped air"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.scale("particle_density", 1.0 + strength)
    }
}
