//! The flat namespace of everything that defines a run: material, method, apparatus and instrument.
//!
//! Takes `name = value` pairs over the defaults, which are the paper's full-scale study; gives checked numbers to the
//! experiments and, per experiment and scope, the sorted list that enters a key. Effects are changes of these values.
//! A coarse set-up is nothing but other values. Meshes of the user's own equipment go with them. Deliberately knows no
//! experiment's geometry and no file format.

mod apparatus;
mod equipment;
mod instrument;
mod material;
mod spec;

pub use apparatus::APPARATUS;
pub use equipment::{Equipment, MATERIALS};
pub use instrument::INSTRUMENT;
pub use material::{MATERIAL, SIEVES};
pub use spec::{Kind, Scope, SettingSpec};

use std::collections::BTreeMap;
use std::ops::Index;
use std::sync::Arc;

/// The wall frictions of Table 1; rolling friction of a wall is `wall_rolling_ratio` times its value, so it follows.
pub const WALL_FRICTIONS: &[&str] =
    &["wall_friction_acrylic", "wall_friction_steel_impact", "wall_friction_steel_sliding"];

/// A setting that cannot be taken.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// No setting has this name.
    #[error("no setting is called `{name}`; the nearest name is `{nearest}`")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The existing name with the fewest edits.
        nearest: &'static str,
    },
    /// The value lies outside the bounds.
    #[error("setting `{name}` cannot be {value}; allowed: {allowed}")]
    OutOfRange {
        /// Name of the setting.
        name: &'static str,
        /// The value refused, as given.
        value: String,
        /// Bounds with unit, or the options.
        allowed: String,
    },
}

/// All settings, each with its specification, in the order of their definition.
pub fn specs() -> impl Iterator<Item = &'static SettingSpec> {
    MATERIAL.iter().chain(APPARATUS).chain(INSTRUMENT)
}

/// The specification of `name`.
///
/// # Errors
/// [`SettingsError::Unknown`] with the nearest existing name.
pub fn spec(name: &str) -> Result<&'static SettingSpec, SettingsError> {
    specs()
        .find(|spec| spec.name == name)
        .ok_or_else(|| SettingsError::Unknown { name: name.to_owned(), nearest: nearest_name(name) })
}

/// Values of all settings; numbers in SI (angles in degrees), choices as the index of their word. And equipment.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    values: BTreeMap<&'static str, f64>,
    equipment: Arc<[Equipment]>,
}

impl Default for Settings {
    /// The paper's full-scale study.
    fn default() -> Self {
        let values = specs().map(|spec| (spec.name, spec.default_value())).collect();
        Self { values, equipment: Arc::default() }
    }
}

impl Settings {
    /// Value of `name` in the unit of its specification.
    ///
    /// # Errors
    /// [`SettingsError::Unknown`] with the nearest existing name.
    pub fn get(&self, name: &str) -> Result<f64, SettingsError> {
        spec(name).map(|spec| self.value(spec))
    }

    /// Word of the choice `name`; `None` where the setting is a number.
    ///
    /// # Errors
    /// [`SettingsError::Unknown`] with the nearest existing name.
    pub fn word(&self, name: &str) -> Result<Option<&'static str>, SettingsError> {
        let spec = spec(name)?;
        let index = self.value(spec) as usize;
        Ok(match spec.kind {
            Kind::Choice { options, .. } => options.get(index).copied(),
            Kind::Number { .. } => None,
        })
    }

    /// Sets a number, or a choice by index.
    ///
    /// # Errors
    /// An unknown name, or a value outside the bounds (NaN always is).
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), SettingsError> {
        let spec = spec(name)?;
        if !spec.accepts(value) {
            return Err(refused(spec, value.to_string()));
        }
        // Negative zero becomes zero, so that equal settings have equal bits.
        self.values.insert(spec.name, value + 0.0);
        Ok(())
    }

    /// Sets a choice by its word, or a number written as text.
    ///
    /// # Errors
    /// An unknown name, a word that is no option, a text that is no number within the bounds.
    pub fn set_text(&mut self, name: &str, text: &str) -> Result<(), SettingsError> {
        let spec = spec(name)?;
        let value = match spec.kind {
            Kind::Choice { options, .. } => options.iter().position(|option| *option == text).map(|index| index as f64),
            Kind::Number { .. } => text.parse().ok(),
        };
        value.map_or_else(|| Err(refused(spec, format!("`{text}`"))), |value| self.set(name, value))
    }

    /// Value for display: the word of a choice, else the shortest digits that give the number back.
    ///
    /// # Errors
    /// [`SettingsError::Unknown`] with the nearest existing name.
    pub fn text(&self, name: &str) -> Result<String, SettingsError> {
        let value = self.get(name)?;
        Ok(self.word(name)?.map_or_else(|| value.to_string(), str::to_owned))
    }

    /// The settings of one scope that `experiment` reads, sorted by name: what enters the key of a run (simulate) or
    /// of its KPIs (measure). Silent ones are among them only where they differ from their default.
    pub fn for_experiment(&self, experiment: &str, scope: Scope) -> Vec<(&'static str, f64)> {
        let mut list: Vec<_> = specs()
            .filter(|spec| spec.scope == scope && self.is_read(spec, experiment) && spec.is_told(self.value(spec)))
            .map(|spec| (spec.name, self.value(spec)))
            .collect();
        list.sort_unstable_by_key(|(name, _)| *name);
        list
    }

    /// Whether `experiment` reads a setting, by itself or for the material of its equipment.
    pub fn is_read(&self, spec: &SettingSpec, experiment: &str) -> bool {
        spec.is_used_by(experiment) || self.equipment(experiment).any(|piece| piece.friction == spec.name)
    }

    /// Puts `equipment` in place of all there was.
    pub fn equip(&mut self, equipment: Vec<Equipment>) {
        self.equipment = equipment.into();
    }

    /// The equipment in the apparatus of `experiment`.
    pub fn equipment(&self, experiment: &str) -> impl Iterator<Item = &Equipment> {
        self.equipment.iter().filter(move |piece| piece.experiment == experiment)
    }

    /// Whether the choice `name` has `word`.
    pub fn is(&self, name: &str, word: &str) -> bool {
        self.word(name) == Ok(Some(word))
    }

    /// Multiplies the number `name` by `factor`.
    ///
    /// # Errors
    /// An unknown name, or a product outside the bounds.
    pub fn scale(&mut self, name: &str, factor: f64) -> Result<(), SettingsError> {
        let value = self.get(name)?;
        self.set(name, value * factor)
    }

    fn value(&self, spec: &SettingSpec) -> f64 {
        self.values.get(spec.name).copied().unwrap_or_else(|| spec.default_value())
    }
}

impl Index<&str> for Settings {
    type Output = f64;

    /// Value of a setting that the code itself names.
    ///
    /// # Panics
    /// If no setting has this name; names that come from a user go through [`Settings::get`].
    fn index(&self, name: &str) -> &f64 {
        &self.values[name]
    }
}

fn refused(spec: &SettingSpec, value: String) -> SettingsError {
    SettingsError::OutOfRange { name: spec.name, value, allowed: spec.allowed() }
}

fn nearest_name(name: &str) -> &'static str {
    specs().map(|spec| spec.name).min_by_key(|candidate| edit_distance(name, candidate)).unwrap_or_default()
}

/// Levenshtein distance in characters: fewest insertions, deletions and replacements that turn `a` into `b`.
pub fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, from) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, to) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(from != *to);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_every_default_is_allowed() {
        let mut names: Vec<_> = specs().map(|spec| spec.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        for spec in specs() {
            assert!(spec.accepts(spec.default_value()), "{}", spec.name);
            assert!(!spec.meaning.is_empty() && !spec.source.is_empty() && !spec.unit.is_empty(), "{}", spec.name);
            assert!(!spec.used_by.is_empty(), "{}", spec.name);
        }
    }

    #[test]
    fn a_dotted_name_belongs_to_one_experiment() {
        for spec in specs() {
            match spec.name.split_once('.') {
                Some((experiment, _)) => assert_eq!(spec.used_by, [experiment], "{}", spec.name),
                None => assert!(spec.used_by.iter().all(|user| spec::ALL.contains(user)), "{}", spec.name),
            }
        }
    }

    #[test]
    fn the_two_scopes_partition_what_an_experiment_reads() {
        let settings = Settings::default();
        for experiment in spec::ALL {
            let simulate = settings.for_experiment(experiment, Scope::Simulate);
            let measure = settings.for_experiment(experiment, Scope::Measure);
            assert!(simulate.is_sorted_by_key(|(name, _)| *name));
            assert!(simulate.iter().all(|(name, _)| !measure.iter().any(|(other, _)| other == name)));
            let told = |spec: &&SettingSpec| spec.is_used_by(experiment) && !spec.silent;
            assert_eq!(simulate.len() + measure.len(), specs().filter(told).count());
        }
        let names = |experiment, scope| {
            settings.for_experiment(experiment, scope).into_iter().map(|(name, _)| name).collect::<Vec<_>>()
        };
        assert!(!names("pile", Scope::Simulate).contains(&"ledge.depth"));
        assert!(!names("pile", Scope::Simulate).contains(&"camera_roll"));
        assert!(names("pile", Scope::Measure).contains(&"camera_roll"));
        assert!(!names("bulk_density", Scope::Simulate).contains(&"wall_friction_acrylic"));
    }

    #[test]
    fn a_silent_setting_is_told_only_away_from_its_default() {
        let mut settings = Settings::default();
        let told = |settings: &Settings| {
            settings.for_experiment("pile", Scope::Simulate).iter().any(|(name, _)| *name == "drag_coefficient")
        };
        assert!(!told(&settings));
        settings.set("drag_coefficient", 0.4).unwrap();
        assert!(told(&settings));
        settings.set("drag_coefficient", -0.0).unwrap();
        assert!(!told(&settings));
    }

    #[test]
    fn unknown_names_are_refused_with_the_nearest() {
        let error = Settings::default().set("sliding_fricton", 0.3).unwrap_err();
        assert_eq!(error.to_string(), "no setting is called `sliding_fricton`; the nearest name is `sliding_friction`");
    }

    #[test]
    fn values_outside_the_bounds_are_refused() {
        let mut settings = Settings::default();
        for value in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(
                matches!(settings.set("sliding_friction", value), Err(SettingsError::OutOfRange { .. })),
                "{value}"
            );
        }
        let error = settings.set_text("slope_operator", "side").unwrap_err();
        assert_eq!(error.to_string(), "setting `slope_operator` cannot be `side`; allowed: front, slices, silhouette");
        assert!(settings.set("slope_operator", 0.5).is_err());
        assert_eq!(settings, Settings::default());
    }

    #[test]
    fn choices_are_words_and_numbers_are_numbers() {
        let mut settings = Settings::default();
        settings.set_text("slope_operator", "slices").unwrap();
        settings.set_text("ledge.depth", "0.06").unwrap();
        assert_eq!(settings.get("slope_operator"), Ok(1.0));
        assert_eq!(settings.word("slope_operator"), Ok(Some("slices")));
        assert_eq!(settings.word("ledge.depth"), Ok(None));
        assert_eq!(settings.text("ledge.depth").as_deref(), Ok("0.06"));
        settings.set("camera_roll", -0.0).unwrap();
        assert_eq!(settings.get("camera_roll").map(f64::to_bits), Ok(0));
    }

    #[test]
    fn edit_distance_counts_edits() {
        for (a, b, distance) in
            [("", "abc", 3), ("ledge", "ledge", 0), ("lege", "ledge", 1), ("pile", "tile", 1), ("abc", "", 3)]
        {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
        }
    }
}
