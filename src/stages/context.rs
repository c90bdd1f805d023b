//! What a stage is given, and what it gives back.

use super::SettingsText;
use crate::campaign::{Campaign, CampaignError, KPI_VERSION};
use crate::canonical::{CanonicalError, Digest, Encoder, digest};
use crate::config::{Config, Measured};
use crate::dem;
use crate::experiments::Experiment;
use crate::settings::Scope;
use crate::store::StoreError;
use crate::store::table::{self, Part};
use crate::tables::{Checked, Row, TableError, TableSpec, io};
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
    known: Option<Known<'a>>,
}

/// Gives the part that was made for a key, if it is in place.
pub type PartOf<'a> = dyn Fn(&Digest) -> Option<Part> + Sync + 'a;

/// What the stage wrote when it last ran.
pub struct Known<'a> {
    /// Hash of what all its parts depend on: the stage, its version and its settings but for the repetitions.
    pub recipe: Digest,
    /// The part that was made for a key, if it is in place.
    pub part: Box<PartOf<'a>>,
}

impl<'a> Context<'a> {
    /// A context over an artifacts directory.
    pub fn new(config: &'a Config, measured: &'a [Measured], campaign: &'a Campaign, artifacts: &'a Path) -> Self {
        Self { config, measured, campaign, artifacts, outdated: Vec::new(), known: None }
    }

    /// The same context, in which these tables, which other settings gave, have not been written.
    #[must_use]
    pub fn without(self, outdated: Vec<&'static str>) -> Self {
        Self { outdated, ..self }
    }

    /// The same context, in which parts that are known need not be made again.
    #[must_use]
    pub fn knowing(self, known: Known<'a>) -> Self {
        Self { known: Some(known), ..self }
    }

    /// The parts of split table `spec`, in order.
    ///
    /// # Errors
    /// A table that has not been written.
    pub fn parts(&self, spec: &TableSpec) -> Result<Vec<Part>, StageError> {
        Ok(table::parts(self.artifacts, spec)?)
    }

    /// Rows of one part of the table of `R`.
    ///
    /// # Errors
    /// A file that is missing or does not fit the schema.
    pub fn read_part<R: Row>(&self, part: &Part) -> Result<Vec<R>, StageError> {
        Ok(io::read_table(&self.artifacts.join(part.path(R::SPEC)))?)
    }

    /// Some columns of one part of table `spec`.
    ///
    /// # Errors
    /// A file that is missing or does not fit the schema.
    pub fn columns(&self, spec: &'static TableSpec, part: &Part, names: &[&str]) -> Result<Checked, StageError> {
        Ok(io::columns(spec, &self.artifacts.join(part.path(spec)), names)?)
    }

    /// Digest of a table that is one file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn digest(&self, spec: &TableSpec) -> Result<Digest, StageError> {
        let path = self.artifacts.join(table::index(spec));
        Ok(Digest::of_content(&std::fs::read(&path).map_err(StoreError::io("read", &path))?))
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
    /// Files by path relative to the artifacts directory, in the order in which they are to be published.
    pub files: Vec<(String, Content)>,
    /// Parts of split tables with their paths, under the keys by which they are known next time.
    pub parts: Vec<(Digest, String, Part)>,
}

/// Content of an output.
pub enum Content {
    /// These bytes.
    Bytes(Vec<u8>),
    /// The file is in place already, as the lock has it.
    InPlace(Part),
}

impl Outputs {
    /// Adds a file.
    pub fn file(&mut self, path: String, bytes: Vec<u8>) {
        self.files.push((path, Content::Bytes(bytes)));
    }

    /// Adds the table of `R`, sorted by its key.
    ///
    /// # Errors
    /// A value that cannot be stored, such as NaN.
    pub fn table<R: Row>(&mut self, rows: Vec<R>) -> Result<(), StageError> {
        self.table_as(R::SPEC, rows)
    }

    /// Adds table `spec`, which has the columns of `R`.
    ///
    /// # Errors
    /// A value that cannot be stored, such as NaN.
    pub fn table_as<R: Row>(&mut self, spec: &TableSpec, rows: Vec<R>) -> Result<(), StageError> {
        for (path, bytes) in table::files(spec, rows)? {
            self.file(path, bytes);
        }
        Ok(())
    }
}

/// A split table that is made part by part. A part that is in place under its key is not made again.
pub struct Parts<'a> {
    context: &'a Context<'a>,
    spec: &'static TableSpec,
    parts: Vec<Part>,
    outputs: Outputs,
}

impl<'a> Parts<'a> {
    /// Table `spec` without a part.
    pub fn new(context: &'a Context<'a>, spec: &'static TableSpec) -> Self {
        Self { context, spec, parts: Vec::new(), outputs: Outputs::default() }
    }

    /// Key of a part: the recipe of the stage, the value by which the table is split, and what else the rows follow from.
    fn key(&self, value: &str, inputs: &Encoder) -> Option<Digest> {
        let mut encoder = Encoder::new();
        encoder.bytes(&self.context.known.as_ref()?.recipe.0).str(self.spec.name).str(value).append(inputs);
        Some(digest("granulake 2026 part key v1", &encoder))
    }

    /// The part that follows from these inputs, if it is in place.
    pub fn known(&self, value: &str, inputs: &Encoder) -> Option<Part> {
        (self.context.known.as_ref()?.part)(&self.key(value, inputs)?)
    }

    /// Adds the part with `value` in the column by which the table is split; none where there are no rows. Parts come in
    /// the order in which they are added.
    ///
    /// # Errors
    /// What `rows` says, or a value that cannot be stored, such as NaN.
    pub fn add<R: Row>(
        &mut self,
        value: &str,
        inputs: &Encoder,
        rows: impl FnOnce() -> Result<Vec<R>, StageError>,
    ) -> Result<(), StageError> {
        let (part, content) = match self.known(value, inputs) {
            Some(part) => (part.clone(), Content::InPlace(part)),
            None => {
                let rows = rows()?;
                if rows.is_empty() {
                    return Ok(());
                }
                let (part, bytes) = table::part(self.spec, value, rows)?;
                (part, Content::Bytes(bytes))
            }
        };
        let path = part.path(self.spec);
        self.outputs.parts.extend(self.key(value, inputs).map(|key| (key, path.clone(), part.clone())));
        self.outputs.files.push((path, content));
        self.parts.push(part);
        Ok(())
    }

    /// The whole table.
    pub fn finish(mut self) -> Outputs {
        let (path, bytes) = table::manifest(self.spec, &self.parts);
        self.outputs.file(path, bytes);
        self.outputs
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
