//! Effects that a study declares: a shift, a scatter or a drift of any one setting, without a line of code.

use super::{Effect, lognormal};
use crate::rng::Stream;
use crate::settings::{Kind, SettingSpec, Settings, SettingsError};

/// How a declared effect changes its setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The same change in every repetition.
    Shift,
    /// A random change in every repetition: normal, or lognormal of mean 1 where it is relative.
    Scatter,
    /// A change that grows from repetition to repetition, about the middle of the series.
    Drift,
}

impl Way {
    /// Words in studies.
    pub const WORDS: &'static [&'static str] = &["shift", "scatter", "drift"];

    /// The way that a word means; a shift for any other word.
    pub fn of_word(word: &str) -> Self {
        match word {
            "scatter" => Self::Scatter,
            "drift" => Self::Drift,
            _ => Self::Shift,
        }
    }

    fn word(self) -> &'static str {
        Self::WORDS[self as usize]
    }
}

/// A change of one setting.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    name: String,
    setting: &'static SettingSpec,
    way: Way,
    relative: bool,
    range: (f64, f64),
    unit: String,
    meaning: String,
    source: String,
}

impl Declared {
    /// The effect `name` on `setting`; `range` is in the unit of the setting, or pure numbers where it is `relative`.
    pub fn new(
        name: &str,
        (setting, way, relative): (&'static SettingSpec, Way, bool),
        range: (f64, f64),
        source: &str,
    ) -> Self {
        let kind = if relative { "relative " } else { "" };
        let per = if way == Way::Drift { " per repetition" } else { "" };
        Self {
            name: name.to_owned(),
            setting,
            way,
            relative,
            range,
            unit: if relative { "1".to_owned() } else { setting.unit.to_owned() },
            meaning: format!("{kind}{} of `{}`{per}: {}", way.word(), setting.name, setting.meaning),
            source: source.to_owned(),
        }
    }
}

impl Effect for Declared {
    fn name(&self) -> &str {
        &self.name
    }

    fn unit(&self) -> &str {
        &self.unit
    }

    fn range(&self) -> (f64, f64) {
        self.range
    }

    fn meaning(&self) -> &str {
        &self.meaning
    }

    fn source(&self) -> &str {
        &self.source
    }

    fn is_drift(&self) -> bool {
        self.way == Way::Drift
    }

    fn is_scatter(&self) -> bool {
        self.way == Way::Scatter
    }

    /// What scatters is held within the bounds of its setting, because a draw has no bounds of its own.
    fn apply(&self, strength: f64, settings: &mut Settings, stream: &mut Stream) -> Result<(), SettingsError> {
        let value = settings.get(self.setting.name)?;
        let changed = match (self.way, self.relative) {
            (Way::Scatter, true) => value * lognormal(strength, stream),
            (Way::Scatter, false) => value + strength * stream.normal(),
            (_, true) => value * (1.0 + strength),
            (_, false) => value + strength,
        };
        let held = match self.setting.kind {
            Kind::Number { lower, upper, .. } if self.way == Way::Scatter => changed.max(lower).min(upper),
            _ => changed,
        };
        settings.set(self.setting.name, held)
    }
}
