//! Size distribution: all grains larger or smaller than the sieve said, at the same relative width.
//!
//! The analyst does not know: bins stay one *nominal* diameter wide, and stiffness stays that of the nominal grain.

use super::Effect;
use crate::rng::Stream;
use crate::settings::{SIEVES, Settings, SettingsError};

/// Shift of the whole size distribution.
pub struct SizeDistribution;

impl Effect for SizeDistribution {
    fn name(&self) -> &'static str {
        "size_distribution"
    }

    fn unit(&self) -> &'static str {
        "1"
    }

    fn range(&self) -> (f64, f64) {
        (-0.2, 0.2)
    }

    fn meaning(&self) -> &'static str {
        "relative shift of every radius: the sieve curve is off by a factor"
    }

    fn source(&self) -> &'static str {
        "half a sieve step of the R20/3 series is about 20 %"
    }

    fn apply(&self, strength: f64, settings: &mut Settings, _stream: &mut Stream) -> Result<(), SettingsError> {
        let curve = match settings.word("size_distribution")? {
            Some("rosin_rammler") => vec!["rosin_rammler_size"],
            Some("sieve") => SIEVES.iter().map(|(size, _)| *size).collect(),
            _ => Vec::new(),
        };
        let mut sizes = ["radius_mean", "radius_sd"].into_iter().chain(curve);
        sizes.try_for_each(|name| settings.scale(name, 1.0 + strength))
    }
}
