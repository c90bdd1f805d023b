//! A study on disk: its file, its lock, its tables and its store.

use super::plan::{State, assess_stage};
use crate::campaign::{Campaign, CampaignError, Options};
use crate::canonical::Digest;
use crate::config::{Config, ConfigError, DENSITY, DensityBounds, Measured, Problems};
use crate::stages::bounds::{self, Unmeasured, densities};
use crate::stages::{Context, StageError};
use crate::store::{Lock, Store, StoreError, TABLES, Warning, table};
use crate::tables::{Row, list::BoundRow};
use std::path::{Path, PathBuf};

/// Why the driver cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The study or its measured data cannot be taken.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The store cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Runs cannot be made or looked up.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// A stage failed.
    #[error("stage {stage} failed: {source}")]
    Stage {
        /// The stage.
        stage: &'static str,
        /// Why.
        source: StageError,
    },
    /// A lock that is needed is not there.
    #[error("there is no lock `{}`, so nobody can tell what is still needed; run `granulake repro`, or name the right file", path.display())]
    NoLock {
        /// Where it should be.
        path: PathBuf,
    },
    /// A ledger has lost rows, so that not all it referred to is known.
    #[error(
        "a ledger has lost rows, so nobody can tell what is still needed ({warning}); run `granulake fsck`, then this again"
    )]
    Forgetful {
        /// What was lost.
        warning: Warning,
    },
    /// A pin with this name cannot be a file.
    #[error("`{name}` cannot name a pin; use letters, digits, `_`, `-` and `.`")]
    PinName {
        /// The name asked for.
        name: String,
    },
    /// A pin of this name keeps other results.
    #[error("`{}` keeps other results; take another name, or remove the file to let those go", path.display())]
    PinTaken {
        /// The pin.
        path: PathBuf,
    },
    /// Simulations failed, and nobody wanted to go on without them.
    #[error(
        "simulations of stage {stage} failed, and --keep-going=false stops there; what is done is kept, `granulake query \
         \"SELECT reason, count(*) FROM runs GROUP BY reason\"` says why"
    )]
    FailedRuns {
        /// The stage.
        stage: &'static str,
    },
    /// No stage has this name.
    #[error("no stage is called `{name}`; there are: {known}")]
    UnknownStage {
        /// The name asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// The same key gave other bytes.
    #[error(
        "stage {stage} gave other bytes for {output} than before from the same inputs ({old} then, {new} now); \
             please report it as nondeterminism, both are kept in the store"
    )]
    Nondeterminism {
        /// The stage.
        stage: &'static str,
        /// The output.
        output: String,
        /// Digest in the lock.
        old: Digest,
        /// Digest now.
        new: Digest,
    },
}

/// A loaded study.
pub struct Study {
    /// Checked content of the study file.
    pub config: Config,
    /// Measured data sets, in the order of the study.
    pub measured: Vec<Measured>,
    lock_path: PathBuf,
    store: Store,
}

impl Study {
    /// Reads the study file and the measured data it names, and bounds that an earlier `repro` found.
    ///
    /// # Errors
    /// What is wrong in which file and line.
    pub fn load(path: &Path) -> Result<Self, PipelineError> {
        Self::load_with(path, None)
    }

    /// The same with another number of repetitions.
    ///
    /// # Errors
    /// What is wrong in which file and line.
    pub fn load_with(path: &Path, repetitions: Option<u32>) -> Result<Self, PipelineError> {
        let mut study = Self::declared(path, repetitions)?;
        if study.config.bounds.density == DensityBounds::Sought {
            study.can_find_bounds()?;
            study.take_bounds(&study.lock()?)?;
        }
        Ok(study)
    }

    /// Reads the study file and the measured data it names, and nothing that was found since.
    ///
    /// # Errors
    /// What is wrong in which file and line.
    pub fn declared(path: &Path, repetitions: Option<u32>) -> Result<Self, PipelineError> {
        let mut config = Self::config(path)?;
        if let Some(repetitions) = repetitions {
            config = config.with_repetitions(repetitions).map_err(ConfigError::from)?;
        }
        let measured = config.read_measured().map_err(ConfigError::from)?;
        let store = Store::at(config.artifacts());
        Ok(Self { config, measured, lock_path: Self::lock_of(path), store })
    }

    /// Whether the measured data tell what the stage `bounds` needs.
    fn can_find_bounds(&self) -> Result<(), PipelineError> {
        let refused = |unmeasured: Unmeasured| {
            let what = format!("the bounds are left out, but {unmeasured}; add it, or give lower and upper");
            ConfigError::from(Problems::from(self.config.problem(&format!("parameters.{DENSITY}"), &what)))
        };
        densities(&self.config, self.measured.iter(), None).map_err(refused)?;
        Ok(())
    }

    /// Takes the bounds of the table that the stage `bounds` wrote, if it is up to date.
    ///
    /// # Errors
    /// A table that cannot be read, or bounds that the study cannot have.
    pub fn take_bounds(&mut self, lock: &Lock) -> Result<(), PipelineError> {
        if assess_stage(self, lock, &bounds::STAGE) == State::Fresh {
            let rows: Vec<BoundRow> = table::read(self.store.root(), BoundRow::SPEC)?;
            if let Some((lower, upper)) = bounds::of_rows(&rows) {
                self.config = self.config.with_density_bounds(lower, upper).map_err(ConfigError::from)?;
            }
        }
        Ok(())
    }

    /// Reads the study file alone.
    ///
    /// # Errors
    /// What is wrong in which line.
    pub fn config(path: &Path) -> Result<Config, PipelineError> {
        Ok(Config::load(path)?)
    }

    /// The lock file of the study at `path`.
    pub fn lock_of(path: &Path) -> PathBuf {
        path.with_extension("lock")
    }

    /// The artifacts directory.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// The lock file.
    pub fn lock_path(&self) -> &Path {
        &self.lock_path
    }

    /// What the lock file says; empty when there is none.
    ///
    /// # Errors
    /// A lock file that cannot be read.
    pub fn lock(&self) -> Result<Lock, PipelineError> {
        Ok(Lock::read(&self.lock_path)?)
    }

    /// The folder of the tables.
    pub fn tables(&self) -> PathBuf {
        self.store.root().join(TABLES)
    }

    /// Opens the place where runs are made and kept.
    ///
    /// # Errors
    /// A ledger that cannot be read.
    pub fn campaign(&self, options: Options) -> Result<Campaign, PipelineError> {
        Ok(Campaign::open(self.store.clone(), options)?.with_step_limit(self.config.study.step_limit))
    }

    /// What stages are given.
    pub fn context<'a>(&'a self, campaign: &'a Campaign) -> Context<'a> {
        Context::new(&self.config, &self.measured, campaign, self.store.root())
    }
}
