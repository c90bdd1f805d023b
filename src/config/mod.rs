//! Configuration: pipeline.toml as validated types, and the measured data it names.
//!
//! Takes the text of a study and its data files; gives a [`Config`] and [`Measured`] sets that cannot be wrong, or all
//! problems at once, each with file, line and remedy. [`Config::settings_text`] gives the resolved values of sections as
//! text, for the keys of stages. It starts nothing and writes nothing.

mod check;
mod cross;
mod declare;
mod equipment;
pub mod measured;
mod nearest;
pub mod points;
mod problem;
mod read;
pub mod schema;
pub mod states;
pub mod template;
mod types;
mod values;

pub use declare::DENSITY;
pub use measured::{Measured, MeasuredSummary, MeasuredValue};
pub use nearest::{nearest, suggestion};
pub use points::ChosenPoint;
pub use problem::{Place, Problem, Problems};
pub use types::{
    Accept, Analysis, Approach, Bounds, Calibrate, DensityBounds, Design, Diagnose, Effects, Filling, Kernel,
    MeasuredSource, Metamodel, MetamodelKind, Parameter, Prior, RbmNoise, Resolution, Scale, Statistics, Study,
    Thresholds, Uncertain, Validate, Verify,
};

use crate::experiments::Experiment;
use crate::settings::{self, Equipment, Scope, SettingSpec, Settings};
use read::Reading;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use values::Value;

/// Why there is no configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the study {file}: {source}; name another with --study, or write one with `granulake init`")]
    Read {
        /// The file.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file can be read but is wrong.
    #[error(transparent)]
    Problems(#[from] Problems),
}

/// A study that is known to be right.
///
/// Fields are read freely; one is made only by [`Config::load`] and [`Config::parse`].
#[derive(Debug, Clone)]
pub struct Config {
    /// What the study is.
    pub study: Study,
    /// What is calibrated, sorted by name; at least one.
    pub parameters: Vec<Parameter>,
    /// How bounds of the particle density are found.
    pub bounds: Bounds,
    /// Numbers of sample points.
    pub design: Design,
    /// Points that somebody chose, in the order of their file.
    pub chosen: Vec<ChosenPoint>,
    /// Measured data sets, in the order of the file; at least one.
    pub measured: Vec<MeasuredSource>,
    /// Parameters that were measured by themselves.
    pub priors: Vec<Prior>,
    /// Settings of the model that are known only to a standard deviation.
    pub uncertain: Vec<Uncertain>,
    /// Intervals.
    pub statistics: Statistics,
    /// What is asked of the measured data.
    pub analysis: Analysis,
    /// Metamodels.
    pub metamodel: Metamodel,
    /// Calibration.
    pub calibrate: Calibrate,
    /// Verification.
    pub verify: Verify,
    /// Validation.
    pub validate: Validate,
    /// Diagnosis.
    pub diagnose: Diagnose,
    /// Effects of the model.
    pub effects: Effects,
    reading: Reading,
    file: PathBuf,
}

impl Config {
    /// Reads the study `file`. Paths in it are relative to its folder.
    ///
    /// # Errors
    /// A file that cannot be read, or all problems in it.
    pub fn load(file: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(file);
        let text = text.map_err(|source| ConfigError::Read { file: file.display().to_string(), source })?;
        Ok(Self::parse(&text, file)?)
    }

    /// Reads the study `text` as if it stood in `file`.
    ///
    /// # Errors
    /// All problems in it, sorted by line.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Problems> {
        let reading = read::read(text, &file.display().to_string());
        Self::from_reading(reading, file)
    }

    /// The same study with another number of repetitions, as `--reps` asks for.
    ///
    /// # Errors
    /// A number of 0 or above 100,000, or one below every count of `verify.counts`.
    pub fn with_repetitions(&self, repetitions: u32) -> Result<Self, Problems> {
        if !(1..=100_000).contains(&repetitions) {
            let what = format!("{repetitions} repetitions cannot be run; allowed is 1 to 100000");
            return Err(Problem { file: "--reps".to_owned(), place: Place::File, what }.into());
        }
        let mut reading = self.reading.clone();
        let line = reading.values.line("study.repetitions").unwrap_or(1);
        reading.values.insert("study.repetitions".to_owned(), Value::Count(repetitions.into()), line);
        Self::from_reading(reading, &self.file)
    }

    /// The same study with bounds that were found for the particle density, whose section gives none.
    ///
    /// # Errors
    /// What is wrong with these bounds, or with what else the study says about the density.
    pub fn with_density_bounds(&self, lower: f64, upper: f64) -> Result<Self, Problems> {
        let mut reading = self.reading.clone();
        for (key, bound) in declare::BOTH.into_iter().zip([lower, upper]) {
            let line = reading.unbounded.unwrap_or(1);
            reading.values.insert(format!("parameters.{DENSITY}.{key}"), Value::Number(bound), line);
        }
        Self::from_reading(reading, &self.file)
    }

    /// A problem with `path` of the study, for checks that need more than its text.
    pub fn problem(&self, path: &str, what: &str) -> Problem {
        let place = self.reading.line(path).map_or(Place::File, Place::Line);
        Problem { file: self.file.display().to_string(), place, what: format!("`{path}`: {what}") }
    }

    /// The same study with one data set in place of all others; the candidate `without` may not be named.
    #[must_use]
    pub fn with_only(&self, source: MeasuredSource, without: Option<&str>) -> Self {
        let mut config = self.clone();
        config.diagnose.measured = vec![source.name.clone()];
        config.diagnose.left_out = without.map(str::to_owned);
        config.priors.clear();
        config.uncertain.clear();
        config.measured = vec![source];
        config
    }

    /// The experiments whose KPIs are fitted, in the order in which experiments are registered.
    pub fn experiments(&self) -> Vec<&'static dyn Experiment> {
        self.reading.fitted()
    }

    /// Settings of the model before parameters and effects: the defaults with the overrides of `[setup]`, and equipment.
    pub fn base_settings(&self) -> &Settings {
        &self.reading.settings
    }

    /// Resolved values, defaults included, of everything at or under the dotted `paths`, such as `design` or
    /// `effects.active`, as canonical text by full path: equal texts mean equal values.
    pub fn settings_text(&self, paths: &[&str]) -> BTreeMap<String, String> {
        self.reading.values.texts(paths)
    }

    /// Strengths of the active effects, with the declarations of those that are the study's own, as
    /// [`Config::settings_text`] gives them.
    pub fn active_text(&self) -> BTreeMap<String, String> {
        let mut text = self.settings_text(&["effects.active"]);
        let names = self.effects.active.iter().filter(|(_, strength)| *strength != 0.0).map(|(name, _)| name.as_str());
        text.extend(self.declared_text(names));
        text
    }

    /// Declarations of those of `names` that are the study's own effects; none for built-in ones.
    pub fn declared_text<'n>(&self, names: impl Iterator<Item = &'n str>) -> BTreeMap<String, String> {
        let own = names.filter(|name| self.effects.library.declared().any(|declared| declared == *name));
        let mut text: BTreeMap<String, String> =
            own.flat_map(|name| self.settings_text(&[&format!("effects.{name}")])).collect();
        if !text.is_empty() {
            text.extend(self.settings_text(&["setup.series_length"]));
        }
        text
    }

    /// Resolved values of `[setup]` in one scope, but only those that one of `experiments` reads, as
    /// [`Config::settings_text`] gives them: a stage that measures a pile does not care for the shape of a hopper.
    /// The equipment of these experiments is part of what is simulated.
    pub fn setup_text(&self, experiments: &[&dyn Experiment], scope: Scope) -> BTreeMap<String, String> {
        let told = |spec: &SettingSpec| spec.is_told(self.base_settings().get(spec.name).unwrap_or_default());
        let used = |spec: &SettingSpec| experiments.iter().any(|one| self.base_settings().is_read(spec, one.name()));
        let paths = settings::specs().filter(|spec| spec.scope == scope && used(spec) && told(spec));
        let paths: Vec<String> = paths.map(|spec| format!("setup.{}", spec.name)).collect();
        let mut text = self.settings_text(&paths.iter().map(String::as_str).collect::<Vec<_>>());
        if scope == Scope::Simulate {
            text.extend(self.equipment_text(experiments));
        }
        text
    }

    /// Material and digest of every mesh in the apparatus of one of `experiments`, as [`Config::settings_text`] gives them;
    /// neither where the file lies nor how it is written makes a difference.
    pub fn equipment_text(&self, experiments: &[&dyn Experiment]) -> BTreeMap<String, String> {
        let told = |piece: &Equipment| {
            let path = format!("equipment.{}.{}", piece.experiment, piece.name);
            (path, format!("{}, {}", piece.text(), piece.digest))
        };
        experiments.iter().flat_map(|one| self.base_settings().equipment(one.name())).map(told).collect()
    }

    /// What is known of the parameters besides `measured`: the priors that the study declares for it, and for any other
    /// parameter what the data themselves say of the grains.
    pub fn priors_of(&self, measured: &Measured) -> Vec<Prior> {
        let declared = self.priors.iter().filter(|prior| prior.measured == measured.name).cloned();
        let mut priors: Vec<Prior> = declared.collect();
        for known in &measured.properties {
            let parameter = self.parameters.iter().find(|parameter| parameter.name == known.kpi);
            if let Some(parameter) = parameter.filter(|p| priors.iter().all(|prior| prior.parameter != p.name)) {
                let (name, measured) = (parameter.name, measured.name.clone());
                priors.push(Prior { measured, parameter: name, mean: known.mean, sd: known.sd, n: known.n });
            }
        }
        priors
    }

    /// The file the study was read from, as given.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// `path` of the study as seen from the working directory.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.file.parent().map_or_else(|| path.to_owned(), |folder| folder.join(path))
    }

    /// Folder of tables, objects and the report.
    pub fn artifacts(&self) -> PathBuf {
        self.resolve(&self.study.artifacts)
    }

    /// Reads every measured data set, in the order of the study.
    ///
    /// # Errors
    /// All problems of all files.
    pub fn read_measured(&self) -> Result<Vec<Measured>, Problems> {
        let read = |source: &MeasuredSource| {
            Measured::read_as(&source.name, &self.resolve(&source.path), self.base_settings())
        };
        let (mut sets, mut problems) = (Vec::new(), Vec::new());
        for source in &self.measured {
            match read(source) {
                Ok(set) => sets.push(set),
                Err(error) => problems.extend(error.list().iter().cloned()),
            }
        }
        Problems::none_in(problems).map(|()| sets)
    }

    fn from_reading(mut reading: Reading, file: &Path) -> Result<Self, Problems> {
        if reading.problems.is_empty() {
            cross::check(&mut reading, &file.display().to_string());
        }
        Problems::none_in(std::mem::take(&mut reading.problems))?;
        let mut config = Self::build(reading, file);
        let equipment = equipment::read(&config)?;
        config.reading.settings.equip(equipment);
        if let Some(path) = types::points_file(&config.reading.values) {
            config.chosen = points::read(&config.resolve(&path), &config.parameters)?;
        }
        Ok(config)
    }

    fn build(reading: Reading, file: &Path) -> Self {
        let values = &reading.values;
        let (study, effects) = (types::study(values), types::effects(values, &reading.library));
        let specs = reading.parameters.iter().filter_map(|name| settings::spec(name).ok());
        let ids = |list: &str| reading.lists.get(list).into_iter().flatten();
        Self {
            parameters: specs.map(|spec| types::parameter(values, spec)).collect(),
            bounds: Bounds { density: reading.density_bounds(), repetitions: values.count32("bounds.repetitions") },
            design: types::design(values),
            chosen: Vec::new(),
            measured: ids("measured").map(|id| types::measured(values, id)).collect(),
            priors: ids("prior").filter_map(|id| types::prior(values, id)).collect(),
            uncertain: ids("uncertain").filter_map(|id| types::uncertain(values, id)).collect(),
            statistics: types::statistics(values),
            analysis: types::analysis(values),
            metamodel: types::metamodel(values),
            calibrate: types::calibrate(values),
            verify: types::verify(values, study.repetitions),
            validate: types::validate(values),
            diagnose: types::diagnose(values, &effects.active),
            study,
            effects,
            file: file.to_owned(),
            reading,
        }
    }
}
