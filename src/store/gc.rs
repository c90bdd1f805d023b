//! gc: what nothing refers to.
//!
//! Takes the digests that lock files, pins and ledgers refer to; lists every other object, temporary files of killed
//! processes, files a compaction left behind, and the quarantine. Deleting is a second step, and needs the claim, so a
//! process that is writing is never disturbed.

use super::ledger::layout::{Files, Found, Manifest, promised_digest};
use super::{LEDGERS, OBJECTS, QUARANTINE, Store, StoreError, atomic};
use crate::canonical::Digest;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Why a file can go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// An object nothing refers to.
    Object,
    /// A part or journal file whose rows are in another part.
    Ledger,
    /// What a killed process was writing.
    Temporary,
    /// A damaged file that was set aside.
    Quarantine,
}

impl Kind {
    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Object => "object nothing refers to",
            Self::Ledger => "folded ledger file",
            Self::Temporary => "unfinished file",
            Self::Quarantine => "damaged file",
        }
    }
}

/// A file that can go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Garbage {
    /// Why.
    pub kind: Kind,
    /// The file.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
}

/// Lists what can go when only the objects in `live` are wanted. Deletes nothing.
///
/// # Errors
/// [`StoreError::Io`].
pub fn find(store: &Store, live: &BTreeSet<Digest>) -> Result<Vec<Garbage>, StoreError> {
    let mut garbage = Vec::new();
    for path in files_under(store.root())? {
        if let Some(kind) = kind_of(store, &path, live) {
            let bytes = fs::metadata(&path).map_err(StoreError::io("read", &path))?.len();
            garbage.push(Garbage { kind, path, bytes });
        }
    }
    for kind in store.ledger_kinds()? {
        garbage.extend(ledger_leftovers(&store.root().join(LEDGERS).join(kind))?);
    }
    garbage.sort_by(|a, b| (a.kind, &a.path).cmp(&(b.kind, &b.path)));
    Ok(garbage)
}

/// Deletes what [`find`] listed; gives the bytes freed. Claim the store before listing, or another process may come to
/// need in between what is about to go.
///
/// # Errors
/// [`StoreError::Busy`] when another process writes; [`StoreError::Io`].
pub fn delete(store: &Store, garbage: &[Garbage]) -> Result<u64, StoreError> {
    store.claim()?;
    garbage.iter().try_for_each(|file| atomic::remove(&file.path))?;
    Ok(garbage.iter().map(|file| file.bytes).sum())
}

fn kind_of(store: &Store, path: &Path, live: &BTreeSet<Digest>) -> Option<Kind> {
    let relative = path.strip_prefix(store.root()).ok()?;
    if path.file_name()?.to_string_lossy().starts_with(atomic::TEMPORARY) {
        return Some(Kind::Temporary);
    }
    if relative.starts_with(QUARANTINE) {
        return Some(Kind::Quarantine);
    }
    let digest = promised_digest(path).filter(|_| relative.starts_with(OBJECTS))?;
    (!live.contains(&digest)).then_some(Kind::Object)
}

/// Leftovers of a compaction. Without a whole manifest every part may be needed, so there are none.
fn ledger_leftovers(folder: &Path) -> Result<Vec<Garbage>, StoreError> {
    let Found::Whole(manifest) = Manifest::find(Manifest::bytes(folder)?.as_deref()) else { return Ok(Vec::new()) };
    let paths = Files::list(folder)?.leftovers(&manifest);
    let sized = |path: PathBuf| {
        let bytes = fs::metadata(&path).map_err(StoreError::io("read", &path))?.len();
        Ok(Garbage { kind: Kind::Ledger, path, bytes })
    };
    paths.into_iter().map(sized).collect()
}

fn files_under(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let mut files = Vec::new();
    for path in atomic::list(folder)? {
        // Links are not followed: what lies outside is not ours to judge.
        let is_folder = fs::symlink_metadata(&path).map_err(StoreError::io("read", &path))?.is_dir();
        if is_folder { files.append(&mut files_under(&path)?) } else { files.push(path) }
    }
    Ok(files)
}
