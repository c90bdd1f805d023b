//! Bringing stages up to date.

use super::integrity::states;
use super::plan::{Recipe, State, assess_stage, leftovers, recipe, selection};
use super::study::{PipelineError, Study};
use crate::campaign::{Campaign, FAILED, Options, Stopwatch};
use crate::canonical::{Digest, Encoder, digest};
use crate::stages::{Content, Known, Stage, bounds};
use crate::store::table::{self, Part};
use crate::store::{Ledger, Lock, Output, StageLock, Warning};
use crate::tables::io::rows_in_file;
use crate::tables::{Row, RunRow};
use std::collections::BTreeMap;

crate::table! {
    /// What a stage gave for a key, so that a key seen before is put back without running.
    pub struct OutputRecord in "ledger_stages" version 2 keyed by stage_key sorted by (stage_key, number) {
        /// Key of the stage.
        stage_key: String [""],
        /// Place in the order of publishing, from 1: the manifest of a split table comes after its parts.
        number: u32 ["1"],
        /// File, relative to the artifacts directory.
        path: String [""],
        /// Digest of its bytes, an object of the store.
        digest: String [""],
    }
}

/// What happened to a stage.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// It was up to date.
    Kept,
    /// Its outputs were put back from the store.
    Restored,
    /// It ran.
    Ran,
    /// The study has no need of it.
    Skipped,
}

impl Action {
    /// One word.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Kept => "fresh",
            Self::Restored => "restored",
            Self::Ran => "ran",
            Self::Skipped => "skipped",
        }
    }
}

/// What to bring up to date and how.
#[derive(Clone, Copy, Default)]
pub struct Request {
    /// The last stage; all when none is given.
    pub target: Option<&'static Stage>,
    /// Run the target (or everything) even if it is up to date, and compare the bytes.
    pub force: bool,
    /// Go no further than a stage with failed simulations.
    pub stop_at_failure: bool,
    /// How runs are made.
    pub options: Options,
}

/// Brings the stages up to date one by one; `report` hears of each. What is done is locked at once, so that a later
/// failure or a kill loses nothing. Bounds that are found on the way are the study's from then on. Gives what the store
/// was found to have lost; a store that nothing was asked of is not looked into.
///
/// # Errors
/// The first stage that fails, or that has failed simulations where these are to stop it, or a store that cannot be written.
pub fn repro(
    study: &mut Study,
    request: &Request,
    mut report: impl FnMut(&'static str, Action),
) -> Result<Vec<Warning>, PipelineError> {
    let mut lock = study.lock()?;
    let mut driver: Option<Driver> = None;
    if study.lock_path().exists() && !lock.is_as_written(study.lock_path())? {
        driver = Some(Driver::open(study, request.options)?);
        recount(study, &mut lock)?;
    }
    for stage in selection(request.target) {
        if (stage.skipped)(&study.config).is_some() {
            forget(study, &mut lock, stage)?;
            report(stage.name, Action::Skipped);
            continue;
        }
        let forced = request.force && request.target.is_none_or(|target| target.name == stage.name);
        let fresh = assess_stage(study, &lock, stage) == State::Fresh;
        let retry = request.options.retry_failed && fresh && has_failed_runs(study, stage)?;
        if fresh && !forced && !retry {
            report(stage.name, Action::Kept);
        } else {
            let driver = match &mut driver {
                Some(driver) => driver,
                none => none.insert(Driver::open(study, request.options)?),
            };
            let action = driver.update(study, &mut lock, stage, forced)?;
            if stage.name == bounds::STAGE.name {
                study.take_bounds(&lock)?;
            }
            report(stage.name, action);
        }
        if request.stop_at_failure && has_failed_runs(study, stage)? {
            return Err(PipelineError::FailedRuns { stage: stage.name });
        }
    }
    match driver {
        Some(driver) => driver.finish(),
        None => Ok(Vec::new()),
    }
}

/// Mends a lock that is not as it was written. What stages read and wrote shows by digests and sizes when they are assessed;
/// rows are counted here.
fn recount(study: &Study, lock: &mut Lock) -> Result<(), PipelineError> {
    for (path, output) in lock.stages.values_mut().flat_map(|stage| &mut stage.outputs) {
        output.rows = rows_of(study, path).or(output.rows);
    }
    Ok(lock.write(study.lock_path())?)
}

/// Rows of an output that is a table.
fn rows_of(study: &Study, path: &str) -> Option<u64> {
    let table = path.ends_with(".parquet");
    table.then(|| rows_in_file(&study.store().root().join(path)).ok()).flatten()
}

/// Takes a stage that is skipped out of the lock, and its outputs with it.
fn forget(study: &Study, lock: &mut Lock, stage: &Stage) -> Result<(), PipelineError> {
    let Some(locked) = lock.stages.remove(stage.name) else { return Ok(()) };
    lock.write(study.lock_path())?;
    Ok(locked.outputs.keys().try_for_each(|path| study.store().remove_output(path))?)
}

/// Whether the tables of a stage hold a run that failed.
fn has_failed_runs(study: &Study, stage: &Stage) -> Result<bool, PipelineError> {
    for spec in stage.writes.iter().filter(|spec| spec.columns == RunRow::SPEC.columns) {
        if table::text_counts(study.store().root(), spec, "status")?.contains_key(FAILED) {
            return Ok(true);
        }
    }
    Ok(false)
}

fn publish(study: &Study, path: &str, bytes: &[u8]) -> Result<Output, PipelineError> {
    let output = study.store().publish(path, bytes)?;
    Ok(Output { rows: rows_of(study, path), ..output })
}

/// What a stage wrote when it last ran: a part is in place if `locked` lists it, and it is there. The recipe of all parts
/// leaves out the repetitions, of which each names its own.
pub fn known<'a>(
    study: &'a Study,
    ledger: &'a Ledger<OutputRecord>,
    locked: &'a BTreeMap<String, Output>,
    stage: &Stage,
    recipe: &Recipe,
) -> Known<'a> {
    let mut encoder = Encoder::new();
    encoder.str(stage.name).u64(u64::from(stage.version));
    for (name, value) in recipe.settings.iter().filter(|(name, _)| *name != "study.repetitions") {
        encoder.str(name).str(value);
    }
    let part = move |key: &Digest| {
        let record = ledger.rows_of(key)?.into_iter().next()?;
        let part = Part::of_path(&record.path)?;
        let output = locked.get(&record.path).filter(|output| output.digest == part.digest)?;
        let store = study.store();
        (store.has_object(&part.digest) && store.has_output(&record.path, output)).then_some(part)
    };
    Known { recipe: digest("granulake 2026 part recipe v1", &encoder), part: Box::new(part) }
}

/// The open store while stages run.
struct Driver {
    campaign: Campaign,
    outputs: Ledger<OutputRecord>,
    retry_failed: bool,
}

impl Driver {
    fn open(study: &Study, options: Options) -> Result<Self, PipelineError> {
        study.store().claim()?;
        let campaign = study.campaign(options)?;
        let outputs = study.store().ledger("stages")?;
        Ok(Self { campaign, outputs, retry_failed: options.retry_failed })
    }

    fn finish(self) -> Result<Vec<Warning>, PipelineError> {
        let warnings = [self.campaign.warnings(), self.outputs.warnings()].concat();
        self.outputs.compact()?;
        self.campaign.compact()?;
        Ok(warnings)
    }

    /// Puts the outputs of `stage` in place and into the lock.
    fn update(
        &self,
        study: &Study,
        lock: &mut Lock,
        stage: &'static Stage,
        forced: bool,
    ) -> Result<Action, PipelineError> {
        let recipe = recipe(study, lock, stage);
        let known = if forced { None } else { self.restore(study, &recipe)? };
        let retry = self.retry_failed && has_failed_runs(study, stage)?;
        let (outputs, action) = match known.filter(|_| !retry) {
            Some(outputs) => (outputs, Action::Restored),
            None => {
                // Forced or tried again, a stage leaves nothing as it is.
                let locked = lock.stages.get(stage.name).filter(|_| !forced && !self.retry_failed);
                let locked = locked.map(|locked| locked.outputs.clone()).unwrap_or_default();
                (self.run(study, stage, &recipe, &locked)?, Action::Ran)
            }
        };
        let locked = StageLock {
            key: recipe.key,
            version: stage.version,
            settings: recipe.settings,
            inputs: recipe.inputs,
            outputs,
        };
        let old = leftovers(study, &locked, stage);
        lock.stages.insert(stage.name.to_owned(), locked);
        lock.write(study.lock_path())?;
        old.iter().try_for_each(|path| study.store().remove_output(path))?;
        Ok(action)
    }

    /// Copies the outputs of a key seen before out of the store; `None` if the key is new or an object is gone, be it a
    /// table or the final state of a run in it.
    fn restore(&self, study: &Study, recipe: &Recipe) -> Result<Option<BTreeMap<String, Output>>, PipelineError> {
        let Some(records) = self.outputs.get(&recipe.key.to_string()) else { return Ok(None) };
        let mut outputs = BTreeMap::new();
        for record in records.iter() {
            let Ok(digest) = record.digest.parse::<Digest>() else { return Ok(None) };
            let Ok(bytes) = study.store().object(&digest) else { return Ok(None) };
            outputs.insert(record.path.clone(), publish(study, &record.path, &bytes)?);
        }
        let states = states(study.store(), &outputs)?;
        Ok(states.iter().all(|digest| study.store().has_object(digest)).then_some(outputs))
    }

    /// Runs a stage; parts of split tables that stand in `locked` and have the key of what is wanted stay in place.
    fn run(
        &self,
        study: &Study,
        stage: &'static Stage,
        recipe: &Recipe,
        locked: &BTreeMap<String, Output>,
    ) -> Result<BTreeMap<String, Output>, PipelineError> {
        let context = study.context(&self.campaign).knowing(known(study, &self.outputs, locked, stage, recipe));
        let watch = Stopwatch::of_process();
        let outputs = (stage.run)(&context).map_err(|source| PipelineError::Stage { stage: stage.name, source })?;
        self.campaign.record_stage(&recipe.key, stage.name, &watch)?;
        let record = |key: &Digest, number, path: &str, digest: &Digest| OutputRecord {
            stage_key: key.to_string(),
            number,
            path: path.to_owned(),
            digest: digest.to_string(),
        };
        let mut records = Vec::new();
        for ((path, content), number) in outputs.files.iter().zip(1..) {
            let digest = match content {
                Content::Bytes(bytes) => study.store().put_object(bytes)?,
                Content::InPlace(part) => part.digest,
            };
            records.push(record(&recipe.key, number, path, &digest));
        }
        if self.retry_failed {
            // A run that failed may have come to its end this time.
            self.outputs.replace(&records)?;
        } else {
            self.check_same_bytes(stage, recipe, &records)?;
            self.outputs.append(&records)?;
        }
        let parts = outputs.parts.iter().map(|(key, path, part)| record(key, 1, path, &part.digest));
        self.outputs.replace(&parts.collect::<Vec<_>>())?;
        let published = |(path, content): &(String, Content)| match content {
            Content::Bytes(bytes) => publish(study, path, bytes).map(|output| (path.clone(), output)),
            Content::InPlace(_) => Ok((path.clone(), locked[path])),
        };
        outputs.files.iter().map(published).collect()
    }

    /// The same key must give the same bytes.
    fn check_same_bytes(
        &self,
        stage: &'static Stage,
        recipe: &Recipe,
        now: &[OutputRecord],
    ) -> Result<(), PipelineError> {
        let Some(before) = self.outputs.get(&recipe.key.to_string()) else { return Ok(()) };
        let changed = before.iter().zip(now).find(|(old, new)| old != new);
        changed.map_or(Ok(()), |(old, new)| {
            let digest = |text: &str| text.parse().unwrap_or_else(|_| digest("unreadable", &Encoder::new()));
            Err(PipelineError::Nondeterminism {
                stage: stage.name,
                output: new.path.clone(),
                old: digest(&old.digest),
                new: digest(&new.digest),
            })
        })
    }
}
