//! What a stage is given, and what it gives back.

use super::SettingsText;
use crate::campaign::{Campaign, CampaignError, KPI_VERSION};
use crate::canonical::{CanonicalError, Encoder, digest};
use crate::config::{Config, Measured};
use crate::dem;
use crate::experiments::Experiment;
use crate::settings::Scope;
use crate::store::{StoreError, table};
use crate::tables::{Row, TableError, TableSpec};
use std::path::Path;

/// Why a stage cannot finish.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// Runs cannot be made or looked up.
    #[error("{0}")]
    Campaign(#[source] CampaignError),
    /// A table holds a value that cannot be stored.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A table cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A value cannot be hashed.
    #[error(transparent)]
    Canonical(#[from] CanonicalError),
    /// The tables hold something the stage cannot work with.
    #[error("{what}; {remedy}")]
    Input {
        /// What is wrong and where.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
}

/// What a stage may look at: the study, the measured data, the tables of earlier stages and the campaign.
pub struct Context<'a> {
    /// The study.
    pub config: &'a Config,
    /// The measured data sets, in the order of the study.
    pub measured: &'a [Measured],
    /// Where runs are made and kept.
    pub campaign: &'a Campaign,
    artifacts: &'a Path,
    /// Tables that are taken for unwritten.
    outdated: Vec<&'static str>,
}

impl<'a> Context<'a> {
    /// A context over an artifacts directory.
    pub fn new(config: &'a Config, measured: &'a [Measured], campaign: &'a Campaign, artifacts: &'a Path) -> Self {
        Self { config, measured, campaign, artifacts, outdated: Vec::new() }
    }

    /// The same context, in which these tables, which other settings gave, have not been written.
    #[must_use]
    pub fn without(self, outdated: Vec<&'static str>) -> Self {
        Self { outdated, ..self }
    }

    /// Rows of the table of `R`.
    ///
    /// # Errors
    /// A file that is missing or does not fit the schema.
    pub fn read<R: Row>(&self) -> Result<Vec<R>, StageError> {
        self.read_from(R::SPEC)
    }

    /// Rows of table `spec`, which has the columns of `R`.
    ///
    /// # Errors
    /// A file that is missing or does not fit the schema.
    pub fn read_from<R: Row>(&self, spec: &TableSpec) -> Result<Vec<R>, StageError> {
        Ok(table::read(self.artifacts, spec)?)
    }

    /// Whether table `spec` has been written.
    pub fn has(&self, spec: &TableSpec) -> bool {
        !self.outdated.contains(&spec.name) && self.artifacts.join(table::index(spec)).is_file()
    }

    /// A seed for random choices of one purpose, from the study's seed.
    pub fn seed(&self, purpose: &str) -> u64 {
        let mut encoder = Encoder::new();
        encoder.u64(self.config.study.seed).str(purpose);
        digest("granulake 2026 stage seed v1", &encoder).to_u64()
    }
}

/// What a stage gives, for the driver to publish.
#[derive(Default)]
pub struct Outputs {
    /// Files by path relative to the artifacts directory, each with its bytes.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Outputs {
    /// Adds the table of `R`, sorted by its key.
    ///
    /// # Errors
    /// A value that cannot be stored, such as NaN.
    pub fn table<R: Row + Clone>(&mut self, rows: Vec<R>) -> Result<(), StageError> {
        self.table_as(R::SPEC, rows)
    }

    /// Adds table `spec`, which has the columns of `R`.
    ///
    /// # Errors
    /// A value that cannot be stored, such as NaN.
    pub fn table_as<R: Row + Clone>(&mut self, spec: &TableSpec, rows: Vec<R>) -> Result<(), StageError> {
        self.files.extend(table::files(spec, rows)?);
        Ok(())
    }
}

/// The settings that shape runs of `experiments` and what is read off them.
pub fn run_settings(config: &Config, experiments: &[&dyn Experiment]) -> SettingsText {
    let mut settings = text([
        ("study.seed", config.study.seed.to_string()),
        ("physics_version", dem::PHYSICS_VERSION.to_string()),
        ("kpi_version", KPI_VERSION.to_string()),
    ]);
    settings.extend(config.settings_text(&["study.step_limit"]));
    settings.extend(config.active_text());
    settings.extend(config.setup_text(experiments, Scope::Simulate));
    settings.extend(config.setup_text(experiments, Scope::Measure));
    settings.extend(config.setup_text(experiments, Scope::Series));
    settings
}

/// Settings as text from pairs.
pub fn text<const N: usize>(pairs: [(&str, String); N]) -> SettingsText {
    pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
