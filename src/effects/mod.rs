//! Effects: physical or instrumental changes that a model may lack, each a change of the settings with a strength.
//!
//! Takes settings, a strength and a named random stream; gives changed settings. Strength 0 means absent and leaves
//! every bit as it was, so a run keeps its key. One file and one line in [`EFFECTS`] each. Deliberately knows nothing of
//! simulations and statistics: signatures are computed by whoever runs the settings.

mod camera_roll;
mod cohesion;
mod density_bias;
mod fill_level;
mod friction_spread;
mod level_error;
mod size_distribution;
mod tilt;
mod wall_friction_scatter;
mod wall_friction_shift;

use crate::rng::Stream;
use crate::settings::{Settings, SettingsError};

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
    &tilt::Tilt,
    &camera_roll::CameraRoll,
];

/// A change of the settings with a strength η; η = 0 is absent.
pub trait Effect: Sync {
    /// Name in studies and tables.
    fn name(&self) -> &'static str;
    /// Unit of the strength.
    fn unit(&self) -> &'static str;
    /// Physical range of the strength; contains 0.
    fn range(&self) -> (f64, f64);
    /// What the strength means.
    fn meaning(&self) -> &'static str;
    /// Where law and range come from.
    fn source(&self) -> &'static str;
    /// Whether only η ≥ 0 makes sense.
    fn one_sided(&self) -> bool {
        self.range().0 >= 0.0
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
    #[error("effect `{name}` cannot have strength {strength}; its range is {lower} to {upper} {unit}")]
    OutOfRange {
        /// Name of the effect.
        name: &'static str,
        /// The strength refused.
        strength: f64,
        /// Lower end of the range.
        lower: f64,
        /// Upper end of the range.
        upper: f64,
        /// Unit of the strength.
        unit: &'static str,
    },
    /// A changed setting leaves its bounds.
    #[error("effect `{name}`: {source}")]
    Settings {
        /// Name of the effect.
        name: &'static str,
        /// What the setting says.
        source: SettingsError,
    },
}

/// The effect called `name`.
///
/// # Errors
/// [`EffectError::Unknown`] with all names.
pub fn find(name: &str) -> Result<&'static dyn Effect, EffectError> {
    EFFECTS.iter().copied().find(|effect| effect.name() == name).ok_or_else(|| {
        let known = EFFECTS.iter().map(|effect| effect.name()).collect::<Vec<_>>().join(", ");
        EffectError::Unknown { name: name.to_owned(), known }
    })
}

/// Applies `effect` with `strength` to the settings of the run with `seed`; the only way a study switches an effect on.
///
/// The stream is that of (seed, "effect NAME"), so no other random number of the run moves. Strength 0 does nothing.
///
/// # Errors
/// A strength outside the range (NaN included), or a changed setting outside its bounds.
pub fn apply(effect: &dyn Effect, strength: f64, settings: &mut Settings, seed: u64) -> Result<(), EffectError> {
    let (lower, upper) = effect.range();
    if !(lower..=upper).contains(&strength) {
        return Err(EffectError::OutOfRange { name: effect.name(), strength, lower, upper, unit: effect.unit() });
    }
    if strength == 0.0 {
        return Ok(());
    }
    let mut stream = Stream::new(seed, &format!("effect {}", effect.name()));
    effect
        .apply(strength, settings, &mut stream)
        .map_err(|source| EffectError::Settings { name: effect.name(), source })
}
