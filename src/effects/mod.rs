//! Effects: physical or instrumental changes that a model may lack, each a change of the settings with a strength.
//!
//! Takes settings, a strength and a named random stream; gives changed settings. Strength 0 means absent and leaves
//! every bit as it was, so a run keeps its key. One file and one line in [`EFFECTS`] each. Deliberately knows nothing of
//! simulations and statistics: signatures are computed by whoever runs the settings.

mod air_drag;
mod bin_width;
mod camera_roll;
mod cohesion;
mod cohesion_dry_walls;
mod declared;
mod density_bias;
mod fill_level;
mod fines;
mod friction_spread;
mod layer_thickness;
mod level_error;
mod level_scatter;
mod library;
mod load_cell_gain;
mod particle_shape;
mod release_delay;
mod rolling_spread;
mod scale_tare;
mod size_distribution;
mod tapping;
mod tilt;
mod wall_friction_drift;
mod wall_friction_scatter;
mod wall_friction_shift;

pub use declared::{Declared, Way};
pub use library::{Handle, Library};

use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};
use crate::units::with_unit;

/// Every effect that a study can name.
pub const EFFECTS: &[&dyn Effect] = &[
    &cohesion::Cohesion,
    &wall_friction_scatter::WallFrictionScatter,
    &size_distribution::SizeDistribution,
    &wall_friction_shift::WallFrictionShift,
    &fill_level::FillLevel,
    &friction_spread::FrictionSpread,
    &density_bias::DensityBias,
    &level_error::LevelError,
    &level_scatter::LevelScatter,
    &tilt::Tilt,
    &camera_roll::CameraRoll,
    &wall_friction_drift::WallFrictionDrift,
    &fines::Fines,
    &tapping::Tapping,
    &release_delay::ReleaseDelay,
    &rolling_spread::RollingSpread,
    &layer_thickness::LayerThickness,
    &bin_width::BinWidth,
    &scale_tare::ScaleTare,
    &load_cell_gain::LoadCellGain,
    &air_drag::AirDrag,
    &particle_shape::ParticleShape,
    &cohesion_dry_walls::CohesionDryWalls,
];

/// A change of the settings with a strength η; η = 0 is absent.
pub trait Effect: Send + Sync {
    /// Name in studies and tables.
    fn name(&self) -> &str;
    /// Unit of the strength.
    fn unit(&self) -> &str;
    /// Physical range of the strength; contains 0.
    fn range(&self) -> (f64, f64);
    /// What the strength means.
    fn meaning(&self) -> &str;
    /// Where law and range come from.
    fn source(&self) -> &str;
    /// Whether only η ≥ 0 makes sense.
    fn one_sided(&self) -> bool {
        self.range().0 >= 0.0
    }
    /// Whether the strength is a change per repetition: what is applied is then the change that has come about.
    fn is_drift(&self) -> bool {
        false
    }
    /// Whether it differs from repetition to repetition at random, so that scatter alone shows it.
    fn is_scatter(&self) -> bool {
        false
    }
    /// Changes `settings` by strength `strength`; `stream` varies with the repetition and is this effect's own.
    ///
    /// # Errors
    /// A changed value that leaves the bounds of its setting.
    fn apply(&self, strength: f64, settings: &mut Settings, stream: &mut Stream) -> Result<(), SettingsError>;
}

/// An effect that cannot be applied.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EffectError {
    /// No effect has this name.
    #[error("no effect is called `{name}`; there are: {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// All names, separated by commas.
        known: String,
    },
    /// The strength leaves the physical range.
    #[error(
        "effect `{name}` cannot have strength {strength}; its range is {lower} to {}",
        with_unit(&upper.to_string(), unit)
    )]
    OutOfRange {
        /// Name of the effect.
        name: String,
        /// The strength refused.
        strength: f64,
        /// Lower end of the range.
        lower: f64,
        /// Upper end of the range.
        upper: f64,
        /// Unit of the strength.
        unit: String,
    },
    /// A changed setting leaves its bounds.
    #[error("effect `{name}`: {source}")]
    Settings {
        /// Name of the effect.
        name: String,
        /// What the setting says.
        source: SettingsError,
    },
}

/// The built-in effect called `name`; a study may know more, see [`Library`].
///
/// # Errors
/// [`EffectError::Unknown`] with all names.
pub fn find(name: &str) -> Result<&'static dyn Effect, EffectError> {
    EFFECTS.iter().copied().find(|effect| effect.name() == name).ok_or_else(|| unknown(name, &[]))
}

/// Nothing is called `name`, neither built in nor `declared`.
fn unknown(name: &str, declared: &[&str]) -> EffectError {
    let known = EFFECTS.iter().map(|effect| effect.name()).chain(declared.iter().copied()).collect::<Vec<_>>();
    EffectError::Unknown { name: name.to_owned(), known: known.join(", ") }
}

/// Applies `effect` with `strength` to the settings of repetition `repetition` with `seed`; the only way a study switches
/// an effect on.
///
/// The stream is that of (seed, "effect NAME"), so no other random number of the run moves. Strength 0 does nothing.
///
/// # Errors
/// A strength outside the range (NaN included), or a changed setting outside its bounds.
pub fn apply(
    effect: &dyn Effect,
    strength: f64,
    settings: &mut Settings,
    seed: u64,
    repetition: u32,
) -> Result<(), EffectError> {
    let (lower, upper) = effect.range();
    if !(lower..=upper).contains(&strength) {
        let (name, unit) = (effect.name().to_owned(), effect.unit().to_owned());
        return Err(EffectError::OutOfRange { name, strength, lower, upper, unit });
    }
    if strength == 0.0 {
        return Ok(());
    }
    let mut stream = Stream::new(seed, &format!("effect {}", effect.name()));
    let strength = if effect.is_drift() { strength * place_in_series(settings, repetition) } else { strength };
    effect
        .apply(strength, settings, &mut stream)
        .map_err(|source| EffectError::Settings { name: effect.name().to_owned(), source })
}

/// Repetitions since the middle of the series in which repetition `repetition`, from 1, falls; half-integers where the
/// series has an even number.
pub fn place_in_series(settings: &Settings, repetition: u32) -> f64 {
    let length = settings["series_length"] as u32;
    f64::from(repetition.saturating_sub(1) % length) - 0.5 * f64::from(length - 1)
}

/// Lognormal number of mean 1 and coefficient of variation `cv`: exp(σz − σ²/2), σ² = ln(1 + cv²).
fn lognormal(cv: f64, stream: &mut Stream) -> f64 {
    let variance = libm::log(1.0 + cv * cv);
    libm::exp(variance.sqrt() * stream.normal() - 0.5 * variance)
}
