//! Whether the store is whole, and what in it is still referred to.
//!
//! Roots are the lock of the study, other locks that are named, and pins: copies of locks in `artifacts/pins/`.

use super::run::OutputRecord;
use super::study::{PipelineError, Study};
use crate::campaign::{KpiRecord, Options, PROVENANCE, RunRecord};
use crate::canonical::Digest;
use crate::store::fsck::{Depth, Report, examine};
use crate::store::ledger::survey;
use crate::store::{Lock, Output, PINS, QUARANTINE, Store, StoreError, Warning};
use crate::tables::io::from_parquet_bytes_as;
use crate::tables::list::ProvenanceRow;
use crate::tables::{Row, RunRow, TABLES, TableSpec};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// What is kept when garbage is collected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// Everything that a root or a ledger remembers: outputs of earlier settings, runs of other studies.
    Remembered,
    /// What a root needs, and nothing else.
    Rooted,
}

/// Kind and rows of every ledger.
const LEDGERS: [(&str, &TableSpec); 4] = [
    ("runs", RunRecord::SPEC),
    ("kpis", KpiRecord::SPEC),
    ("stages", OutputRecord::SPEC),
    (PROVENANCE, ProvenanceRow::SPEC),
];

/// What a user should know of the store before trusting that all is there: files of ledgers whose rows count as missing,
/// and what has been set aside. Reads names, sizes and footers only.
///
/// # Errors
/// A store that cannot be read.
pub fn warnings(study: &Study) -> Result<Vec<Warning>, PipelineError> {
    let store = study.store();
    let mut warnings = Vec::new();
    for (kind, spec) in LEDGERS {
        warnings.extend(survey(store, kind, spec)?);
    }
    let aside = store.quarantined()?.len();
    if aside > 0 {
        let what = format!(
            "{aside} damaged or outdated files were set aside here; `granulake gc` lists them, --delete removes them"
        );
        warnings.push(Warning { path: store.root().join(QUARANTINE), what });
    }
    Ok(warnings)
}

/// Checks everything that the roots need and all that is there besides. Damaged files are set aside, and what they held
/// is forgotten, so that the next `repro` makes it again.
///
/// # Errors
/// A store that cannot be read or written.
pub fn fsck(study: &Study, depth: Depth) -> Result<Report, PipelineError> {
    let mut needed = BTreeSet::new();
    for root in roots(study, &[])? {
        needed.extend(root.outputs().map(|(_, _, output)| output.digest));
        // A table that is gone or damaged is found by itself; what it names cannot be told.
        let states = root.stages.values().map(|stage| states(study.store(), &stage.outputs));
        needed.extend(states.flat_map(Result::unwrap_or_default));
    }
    let report = examine(study.store(), &study.lock()?, &needed, depth, true)?;
    if !report.findings.is_empty() {
        forget_what_is_gone(study)?;
    }
    Ok(report)
}

/// Ledgers forget the files they lost, but for the runs that stand in tables; stages whose objects are gone leave the
/// lock.
fn forget_what_is_gone(study: &Study) -> Result<(), PipelineError> {
    let store = study.store();
    let campaign = study.campaign(Options::default())?;
    for root in roots(study, &[])? {
        for stage in root.stages.values() {
            campaign.recover(&run_rows(store, &stage.outputs).unwrap_or_default())?;
        }
    }
    campaign.compact()?;
    store.ledger::<OutputRecord>("stages")?.compact()?;
    let mut lock = study.lock()?;
    for (path, output) in lock.stages.values().flat_map(|stage| &stage.outputs) {
        store.recover_object(path, output)?;
    }
    lock.stages.retain(|_, stage| {
        let objects = stage.outputs.values().map(|output| output.digest);
        objects.chain(states(store, &stage.outputs).unwrap_or_default()).all(|digest| store.has_object(&digest))
    });
    Ok(lock.write(study.lock_path())?)
}

/// Digests of all objects that have to stay.
///
/// # Errors
/// A lock that is named but not there, or a store that cannot be read; with [`Keep::Rooted`] also a study without a
/// lock, and a root whose tables are not whole, with [`Keep::Remembered`] a ledger that lost rows, because then nobody can
/// tell what is needed.
pub fn live(study: &Study, locks: &[PathBuf], keep: Keep) -> Result<BTreeSet<Digest>, PipelineError> {
    let mut live = BTreeSet::new();
    if keep == Keep::Rooted && study.lock()?.stages.is_empty() {
        return Err(PipelineError::NoLock { path: study.lock_path().to_owned() });
    }
    for root in roots(study, locks)? {
        live.extend(root.outputs().map(|(_, _, output)| output.digest));
        for stage in root.stages.values() {
            match (states(study.store(), &stage.outputs), keep) {
                (Err(error), Keep::Rooted) => return Err(error.into()),
                (found, _) => live.extend(found.unwrap_or_default()),
            }
        }
    }
    if keep == Keep::Remembered {
        let runs = study.store().ledger::<RunRecord>("runs")?;
        let outputs = study.store().ledger::<OutputRecord>("stages")?;
        // What a ledger lost may still be wanted: fsck takes back what stands in tables, and says what is gone.
        if let Some(warning) = runs.warnings().into_iter().chain(outputs.warnings()).next() {
            return Err(PipelineError::Forgetful { warning });
        }
        for run in runs.rows() {
            live.extend(objects_of(run.state, run.trace));
        }
        for output in outputs.rows() {
            live.extend(output.digest.parse::<Digest>());
        }
    }
    Ok(live)
}

/// Copies the lock of the study to `pins/NAME.lock`, so that its results stay; gives the path.
///
/// # Errors
/// A name that is no file name or taken by another lock, a study without a lock, or a store that cannot be written.
pub fn pin(study: &Study, name: &str) -> Result<PathBuf, PipelineError> {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "_.-".contains(letter);
    if name.is_empty() || name.starts_with('.') || !name.chars().all(plain) {
        return Err(PipelineError::PinName { name: name.to_owned() });
    }
    let lock = study.lock()?;
    if lock.stages.is_empty() {
        return Err(PipelineError::NoLock { path: study.lock_path().to_owned() });
    }
    let relative = format!("{PINS}/{name}.lock");
    let path = study.store().root().join(&relative);
    if path.exists() && Lock::read(&path)? != lock {
        return Err(PipelineError::PinTaken { path });
    }
    let text = lock.to_text().map_err(|detail| StoreError::BadLock { path: path.clone(), detail })?;
    study.store().publish(&relative, text.as_bytes())?;
    Ok(path)
}

/// The locks from which everything that is needed can be reached.
fn roots(study: &Study, locks: &[PathBuf]) -> Result<Vec<Lock>, PipelineError> {
    if let Some(absent) = locks.iter().find(|path| !path.is_file()) {
        return Err(PipelineError::NoLock { path: absent.clone() });
    }
    let mut roots = vec![study.lock()?];
    for path in locks.iter().chain(&study.store().pins()?) {
        roots.push(Lock::read(path)?);
    }
    Ok(roots)
}

/// Final states and traces of the runs in the tables of a stage.
///
/// # Errors
/// A table that the object store no longer has whole.
pub fn states(store: &Store, outputs: &BTreeMap<String, Output>) -> Result<Vec<Digest>, StoreError> {
    Ok(run_rows(store, outputs)?.into_iter().flat_map(|run| objects_of(run.state, run.trace)).collect())
}

/// The runs in the tables of a stage.
fn run_rows(store: &Store, outputs: &BTreeMap<String, Output>) -> Result<Vec<RunRow>, StoreError> {
    let mut rows = Vec::new();
    for spec in TABLES.iter().filter(|spec| spec.columns == RunRow::SPEC.columns) {
        let folder = format!("tables/{}/", spec.name);
        let parts = outputs.iter().filter(|(path, _)| path.starts_with(&folder) && path.ends_with(".parquet"));
        for (path, output) in parts {
            rows.extend(from_parquet_bytes_as::<RunRow>(spec, path, store.object(&output.digest)?)?);
        }
    }
    Ok(rows)
}

fn objects_of(state: Option<String>, trace: Option<String>) -> impl Iterator<Item = Digest> {
    [state, trace].into_iter().flatten().filter_map(|text| text.parse().ok())
}
