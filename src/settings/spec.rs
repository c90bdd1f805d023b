//! What one setting is: name, unit, bounds or options, who uses it, what it means and where its default comes from.

/// Experiments that exist, for settings which all of them use.
pub const ALL: &[&str] = &["pile", "ledge", "bulk_density", "hopper"];
/// Experiments whose KPI is read off a slope.
pub const SLOPES: &[&str] = &["pile", "ledge"];
/// Experiments between a front and a back plate.
pub const PLATES: &[&str] = &["pile", "ledge", "hopper"];

/// Whether a setting shapes the simulated grains or only what is read off them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// Enters the key of a run.
    Simulate,
    /// Enters the key of the KPIs of a run, never that of the run itself.
    Measure,
    /// Says how repetitions follow each other; enters no key, because what it does to a run changes other settings.
    Series,
}

/// What values a setting takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A number within inclusive bounds.
    Number {
        /// Value of the full-scale study, in the unit of the setting.
        default: f64,
        /// Smallest value accepted.
        lower: f64,
        /// Largest value accepted.
        upper: f64,
    },
    /// One of several words, stored as its index.
    Choice {
        /// The words, in the order of their indices; new words go to the end, so that stored indices keep their meaning.
        options: &'static [&'static str],
        /// Index of the word of the full-scale study.
        default: usize,
    },
}

/// One line of the namespace of everything that defines a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SettingSpec {
    /// Name as written in a study: bare for material and method, `experiment.dimension` for geometry and procedure.
    pub name: &'static str,
    /// Unit of the value, "1" for pure numbers and choices.
    pub unit: &'static str,
    /// Bounds or options.
    pub kind: Kind,
    /// Simulation or measurement.
    pub scope: Scope,
    /// Experiments that read the setting; a run's key holds only what its experiment reads.
    pub used_by: &'static [&'static str],
    /// What the setting means.
    pub meaning: &'static str,
    /// Where the default comes from.
    pub source: &'static str,
    /// True where the paper does not state the value and it is ours.
    pub assumption: bool,
    /// True where keys leave the setting out while it has its default, so that adding it to this list lost no run.
    pub silent: bool,
}

impl SettingSpec {
    /// A number that shapes the simulation, with `range` = (default, lower, upper).
    pub(super) const fn number(
        name: &'static str,
        unit: &'static str,
        range: (f64, f64, f64),
        used_by: &'static [&'static str],
        meaning: &'static str,
        source: &'static str,
    ) -> Self {
        let kind = Kind::Number { default: range.0, lower: range.1, upper: range.2 };
        Self { name, unit, kind, scope: Scope::Simulate, used_by, meaning, source, assumption: false, silent: false }
    }

    /// A choice that shapes the simulation; the first option is the default.
    pub(super) const fn choice(
        name: &'static str,
        options: &'static [&'static str],
        used_by: &'static [&'static str],
        meaning: &'static str,
        source: &'static str,
    ) -> Self {
        let kind = Kind::Choice { options, default: 0 };
        Self {
            name,
            unit: "1",
            kind,
            scope: Scope::Simulate,
            used_by,
            meaning,
            source,
            assumption: false,
            silent: false,
        }
    }

    /// The same setting, read only when KPIs are measured.
    pub(super) const fn measured(self) -> Self {
        Self { scope: Scope::Measure, ..self }
    }

    /// The same setting, left out of keys while it has its default: for what came after the first runs were stored.
    pub(super) const fn silent(self) -> Self {
        Self { silent: true, ..self }
    }

    /// The same setting, about the order of repetitions.
    pub(super) const fn of_series(self) -> Self {
        Self { scope: Scope::Series, ..self }
    }

    /// The same setting, marked as ours rather than the paper's.
    pub(super) const fn assumed(self) -> Self {
        Self { assumption: true, ..self }
    }

    /// Value of the full-scale study; the index for a choice.
    pub fn default_value(&self) -> f64 {
        match self.kind {
            Kind::Number { default, .. } => default,
            Kind::Choice { default, .. } => default as f64,
        }
    }

    /// Whether a key holds the setting at `value`.
    pub fn is_told(&self, value: f64) -> bool {
        !self.silent || value != self.default_value()
    }

    /// Whether `experiment` reads this setting.
    pub fn is_used_by(&self, experiment: &str) -> bool {
        self.used_by.contains(&experiment)
    }

    /// Whether `value` lies in the bounds, or is the index of an option.
    pub fn accepts(&self, value: f64) -> bool {
        match self.kind {
            Kind::Number { lower, upper, .. } => (lower..=upper).contains(&value),
            Kind::Choice { options, .. } => (0..options.len()).any(|index| index as f64 == value),
        }
    }

    /// The bounds or options in words, for messages and help.
    pub fn allowed(&self) -> String {
        match self.kind {
            Kind::Number { lower, upper, .. } => format!("{lower} to {upper} {}", self.unit),
            Kind::Choice { options, .. } => options.join(", "),
        }
    }
}
