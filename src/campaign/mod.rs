//! Campaign: many requests to runs and their observables, each computed once per content key.
//!
//! Takes requests and a store; gives one row per request, in the order of the requests. Runs that the store has are
//! looked up, the others are simulated on all threads and published one by one, so that a kill loses the runs in
//! flight and nothing else. A run that fails is a row with its reason. Deliberately ignorant of why a run is wanted:
//! sampling, verification, validation and diagnosis use the same campaign.

mod measure;
mod progress;
mod provenance;
mod records;
mod request;

pub use measure::{KPI_VERSION, kpi_key};
pub use progress::Progress;
pub use provenance::Stopwatch;
pub use records::{FAILED, KpiRecord, OK, RunRecord, state_digest};
pub use request::{Point, Request, Values, run_seed};

use crate::canonical::{CanonicalError, Digest};
use crate::dem;
use crate::effects::EffectError;
use crate::experiments::SetupError;
use crate::settings::SettingsError;
use crate::store::{Ledger, Store, StoreError, Warning};
use crate::tables::TableError;
use crate::tables::list::{ProvenanceRow, RunRow};
use rayon::prelude::*;
use request::{Resolved, resolve};
use std::collections::BTreeMap;

/// The ledger of what results were made by and what they cost.
pub const PROVENANCE: &str = "provenance";
const RUN: &str = "run";
const STAGE: &str = "stage";

/// Runs that an expected cost is averaged over, at most.
const COSTS: usize = 500;

/// Why a campaign cannot go on; a failed run is not among the reasons.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A value cannot be hashed.
    #[error(transparent)]
    Canonical(#[from] CanonicalError),
    /// A setting cannot be taken.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// An effect cannot be applied.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The settings give no set-up.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The store cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Rows cannot be read or written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A run that was just published is gone.
    #[error("run {key} was published but cannot be found again; run `granulake fsck`, then repeat the command")]
    LostRun {
        /// Content key of the run.
        key: String,
    },
    /// No threads.
    #[error("cannot start {jobs} threads: {source}")]
    Threads {
        /// Threads asked for.
        jobs: usize,
        /// What the system says.
        source: rayon::ThreadPoolBuildError,
    },
}

/// The place where runs are made and kept.
pub struct Campaign {
    store: Store,
    runs: Ledger<RunRecord>,
    kpis: Ledger<KpiRecord>,
    provenance: Ledger<ProvenanceRow>,
    pool: rayon::ThreadPool,
    progress: Progress,
    retry_failed: bool,
    step_limit: Option<u64>,
}

/// How a campaign works; nothing here changes a result.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Threads; 0 is one per core.
    pub jobs: usize,
    /// Show progress bars on stderr.
    pub progress: bool,
    /// Run failed runs again.
    pub retry_failed: bool,
}

/// What the ledger has of a run.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Standing {
    /// All that is wanted.
    Known,
    /// Nothing, or a record whose final state is gone: the same run again gives the same record.
    Missing,
    /// A failure that is to be tried again: another record may come out.
    Outdated,
}

/// How many runs of an experiment are asked for, how many of them the store lacks, and what one costs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outlook {
    /// Runs asked for.
    pub wanted: usize,
    /// Runs the store lacks.
    pub missing: usize,
    /// Mean processor time of a run [s]: of those asked for that the store has, else of all runs of the experiment.
    pub seconds: Option<f64>,
}

impl Campaign {
    /// Opens the ledgers of `store`.
    ///
    /// # Errors
    /// A ledger that cannot be read, or no threads.
    pub fn open(store: Store, options: Options) -> Result<Self, CampaignError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.jobs)
            .build()
            .map_err(|source| CampaignError::Threads { jobs: options.jobs, source })?;
        let open = || rayon::join(|| store.ledger(PROVENANCE), || (store.ledger("runs"), store.ledger("kpis")));
        let (provenance, (runs, kpis)) = pool.install(open);
        Ok(Self {
            runs: runs?,
            kpis: kpis?,
            provenance: provenance?,
            store,
            pool,
            progress: Progress::new(options.progress),
            retry_failed: options.retry_failed,
            step_limit: None,
        })
    }

    /// The same campaign, giving up on runs that need more steps.
    #[must_use]
    pub fn with_step_limit(self, step_limit: Option<u64>) -> Self {
        Self { step_limit, ..self }
    }

    /// The store behind the campaign.
    pub fn store(&self) -> &Store {
        &self.store
    }

    /// Runs in parallel whatever `work` does with rayon.
    pub fn install<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.pool.install(work)
    }

    /// One row per request, in order; runs the store lacks are simulated first.
    ///
    /// # Errors
    /// Settings that make no set-up, or a store that cannot be read or written.
    pub fn simulate(&self, requests: &[Request]) -> Result<Vec<RunRow>, CampaignError> {
        self.compute(requests)?;
        self.rows(requests)
    }

    /// Simulates what the store lacks of the requests.
    ///
    /// # Errors
    /// Settings that make no set-up, or a store that cannot be read or written.
    pub fn compute(&self, requests: &[Request]) -> Result<(), CampaignError> {
        let resolved = self.pool.install(|| resolve(requests))?;
        let missing = self.missing(&resolved);
        if missing.is_empty() { Ok(()) } else { self.run_all(&missing) }
    }

    /// One row per request, in order, of runs that the store has.
    ///
    /// # Errors
    /// [`CampaignError::LostRun`] for one that it lacks.
    pub fn rows(&self, requests: &[Request]) -> Result<Vec<RunRow>, CampaignError> {
        self.pool.install(|| resolve(requests)?.par_iter().map(|run| self.run_row(run)).collect())
    }

    /// How many of the requests are new and what a run costs, by experiment.
    ///
    /// # Errors
    /// Settings that make no set-up.
    pub fn outlook(&self, requests: &[Request]) -> Result<BTreeMap<&'static str, Outlook>, CampaignError> {
        let resolved = self.pool.install(|| resolve(requests))?;
        let mut outlook: BTreeMap<&'static str, Outlook> = BTreeMap::new();
        for run in self.missing(&resolved) {
            outlook.entry(run.request.experiment.name()).or_default().missing += 1;
        }
        let mut costs: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for run in &resolved {
            let name = run.request.experiment.name();
            outlook.entry(name).or_default().wanted += 1;
            let costs = costs.entry(name).or_default();
            if costs.len() < COSTS {
                costs.extend(self.seconds(&run.key));
            }
        }
        for (name, outlook) in &mut outlook {
            outlook.seconds = mean(&costs[name]).or_else(|| self.seconds_of_all(name));
        }
        Ok(outlook)
    }

    /// What so many runs of an experiment cost where nobody knows yet which they are: none of them is in the store.
    pub fn foresee(&self, experiment: &str, runs: usize) -> Outlook {
        Outlook { wanted: runs, missing: runs, seconds: self.seconds_of_all(experiment) }
    }

    /// Processor time of a run [s], if the store knows it.
    fn seconds(&self, key: &Digest) -> Option<f64> {
        self.provenance.rows_of(key)?.first().map(cost)
    }

    /// Mean processor time over the runs of an experiment [s], whatever their settings.
    fn seconds_of_all(&self, experiment: &str) -> Option<f64> {
        let of_experiment = |row: &ProvenanceRow| row.subject == RUN && row.name == experiment;
        mean(&self.provenance.rows().filter(of_experiment).take(COSTS).map(|row| cost(&row)).collect::<Vec<_>>())
    }

    /// Keeps what the outputs of a stage were made by and what they cost.
    ///
    /// # Errors
    /// A store that cannot be written.
    pub fn record_stage(&self, key: &Digest, stage: &str, watch: &Stopwatch) -> Result<(), CampaignError> {
        Ok(self.provenance.replace(&[watch.stop(key.to_string(), STAGE, stage)])?)
    }

    /// Takes runs that came to their end out of the tables of a study, where the ledger has lost them.
    ///
    /// # Errors
    /// A store that cannot be written.
    pub fn recover(&self, rows: &[RunRow]) -> Result<(), CampaignError> {
        let lost = |row: &&RunRow| row.status == OK && row.run_key.parse().is_ok_and(|key| !self.runs.contains(&key));
        let records: BTreeMap<&String, &RunRow> = rows.iter().filter(lost).map(|row| (&row.run_key, row)).collect();
        Ok(self.runs.append(&records.into_values().map(RunRecord::of_row).collect::<Vec<_>>())?)
    }

    /// What was found damaged or of an earlier version when the ledgers were opened.
    pub fn warnings(&self) -> Vec<Warning> {
        [self.runs.warnings(), self.kpis.warnings(), self.provenance.warnings()].concat()
    }

    /// Merges what has been published since the last time into few files.
    ///
    /// # Errors
    /// A store that cannot be written.
    pub fn compact(&self) -> Result<(), CampaignError> {
        self.runs.compact()?;
        self.kpis.compact()?;
        self.provenance.compact()?;
        Ok(())
    }

    /// The first request of every key that is still to be run.
    fn missing<'r, 'a>(&self, resolved: &'r [Resolved<'a>]) -> Vec<&'r Resolved<'a>> {
        let wanted = |run: &&Resolved| self.standing(&run.key) != Standing::Known;
        let wanted: Vec<_> = self.pool.install(|| resolved.par_iter().filter(wanted).collect());
        let mut seen = std::collections::HashSet::new();
        wanted.into_iter().filter(|run| seen.insert(run.key)).collect()
    }

    fn standing(&self, key: &Digest) -> Standing {
        let Some(rows) = self.runs.rows_of(key) else { return Standing::Missing };
        let Some(record) = rows.into_iter().next().and_then(|record| record.under(*key, self.step_limit)) else {
            return Standing::Outdated;
        };
        let stored = |text: &Option<String>| {
            text.as_ref().is_some_and(|text| text.parse().is_ok_and(|digest| self.store.has_object(&digest)))
        };
        match record.status == records::OK {
            true if stored(&record.state) && stored(&record.trace) => Standing::Known,
            true => Standing::Missing,
            false if self.retry_failed => Standing::Outdated,
            false => Standing::Known,
        }
    }

    fn run_all(&self, missing: &[&Resolved]) -> Result<(), CampaignError> {
        let bar = self.progress.bar("simulate", missing.len());
        let outcome = self.pool.install(|| {
            missing.par_iter().with_max_len(1).try_for_each(|run| {
                let record = self.run(run)?;
                match self.standing(&run.key) {
                    Standing::Outdated => self.runs.replace(&[record])?,
                    Standing::Known | Standing::Missing => self.runs.append(&[record])?,
                }
                bar.inc(1);
                Ok(())
            })
        });
        bar.finish_and_clear();
        outcome
    }

    /// Simulates one run; publishes what it cost, its final state and its trace.
    fn run(&self, run: &Resolved) -> Result<RunRecord, CampaignError> {
        let setup = run.request.experiment.setup(&run.settings)?;
        let watch = Stopwatch::of_thread();
        let outcome = dem::simulate_within(&setup, run.request.seed, self.step_limit);
        self.provenance.replace(&[watch.stop(run.key.to_string(), RUN, run.request.experiment.name())])?;
        Ok(match outcome {
            Ok(outcome) => {
                let state = self.store.put_object(&records::state_bytes(&outcome.state)?)?;
                let trace = self.store.put_object(&records::trace_bytes(&outcome.trace)?)?;
                RunRecord::finished(run.key, &outcome, state, trace)
            }
            Err(failure) => RunRecord::failed(run.key, &failure),
        })
    }
}

/// Processor time [s], wall time where that is unknown.
fn cost(row: &ProvenanceRow) -> f64 {
    row.cpu_s.unwrap_or(row.wall_s)
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

impl Campaign {
    /// The row of a run that the ledger holds.
    fn run_row(&self, run: &Resolved) -> Result<RunRow, CampaignError> {
        let Resolved { request, key, .. } = run;
        let key = key.to_string();
        let record = self.runs.rows_of(&run.key).and_then(|rows| rows.into_iter().next());
        let record = record.and_then(|record| record.under(run.key, self.step_limit));
        let record = record.ok_or_else(|| CampaignError::LostRun { key: key.clone() })?;
        Ok(RunRow {
            label: request.label.clone(),
            experiment: request.experiment.name().to_owned(),
            point: request.point.number,
            parameter_hash: request.point.hash()?.to_string(),
            repetition: request.repetition,
            seed: request.seed,
            effects: request.point.effects_text(),
            run_key: key,
            status: record.status,
            reason: record.reason,
            stop: record.stop,
            time_s: record.time_s,
            steps: record.steps,
            inserted: record.inserted,
            insertion_attempts: record.insertion_attempts,
            deleted: record.deleted,
            lost: record.lost,
            particles: record.particles,
            energy_ratio: record.energy_ratio,
            coordination_number: record.coordination_number,
            max_overlap: record.max_overlap,
            state: record.state,
            trace: record.trace,
        })
    }
}
