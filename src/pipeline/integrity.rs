//! Whether the store is whole, and what in it is still referred to.

use super::run::OutputRecord;
use super::study::{PipelineError, Study};
use crate::campaign::RunRecord;
use crate::canonical::Digest;
use crate::store::Lock;
use crate::store::fsck::{Depth, Report, examine};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Checks everything that the lock and the ledgers refer to; damaged files are set aside.
///
/// # Errors
/// A store that cannot be read.
pub fn fsck(study: &Study, depth: Depth) -> Result<Report, PipelineError> {
    let needed = live(study, &[])?;
    Ok(examine(study.store(), &study.lock()?, &needed, depth, true)?)
}

/// Digests of all objects that a ledger or one of the lock files refers to.
///
/// # Errors
/// A store or lock file that cannot be read.
pub fn live(study: &Study, other_locks: &[PathBuf]) -> Result<BTreeSet<Digest>, PipelineError> {
    let mut live = BTreeSet::new();
    for run in study.store().ledger::<RunRecord>("runs")?.rows() {
        live.extend([run.state, run.trace].into_iter().flatten().filter_map(|text| text.parse::<Digest>().ok()));
    }
    for output in study.store().ledger::<OutputRecord>("stages")?.rows() {
        live.extend(output.digest.parse::<Digest>());
    }
    for path in std::iter::once(study.lock_path().to_owned()).chain(other_locks.iter().cloned()) {
        live.extend(Lock::read(&path)?.outputs().map(|(_, _, output)| output.digest));
    }
    Ok(live)
}
