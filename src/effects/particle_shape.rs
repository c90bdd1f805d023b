//! Particle shape: grains longer than wide, as rigid clumps of two or three equal spheres in a row.
//!
//! A clump has the volume of the sphere that it replaces, so sizes and masses stay. The strength is its length over its width
//! less one. Rolling friction, by which spheres make up for their shape, stays as the parameters have it.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

/// Elongation of the grains.
pub struct ParticleShape;

impl Effect for ParticleShape {
    fn name(&self) -> &'static str {
        "particle_shape"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (0.0, 1.2)
    }

    fn meaning(&self) -> &'static str {
        "length over width of the grains, less 1"
    }

    fn source(&self) -> &'static str {
        "rigid clumps after Favier et al. (1999); crushed gravel is mostly 1.2 to 2 times as long as wide"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        settings.set("aspect_ratio", settings.get("aspect_ratio")? + strength)
    }
}
