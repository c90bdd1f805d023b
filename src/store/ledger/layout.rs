//! Files of a ledger: their names, the manifest, and which of them are live.
//!
//! `manifest.json` lists the live parts and how far the journal has been folded into them; it is renamed into place
//! last, so it is the moment at which a compaction happens. Part and journal files carry their digest in the name.

use crate::canonical::Digest;
use crate::store::{StoreError, atomic};
use serde::{Deserialize, Serialize};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";
const JOURNAL: &str = "journal";
/// Version of the manifest's format.
const VERSION: u32 = 1;

/// A file of rows, sorted by key, that is never edited.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    digest: String,
    /// Size of the file.
    pub bytes: u64,
    /// Number of rows.
    pub rows: u64,
    /// Number of keys.
    pub keys: u64,
}

impl Part {
    /// A part with these bytes.
    pub(super) fn new(digest: Digest, bytes: u64, rows: u64, keys: u64) -> Self {
        Self { digest: digest.to_string(), bytes, rows, keys }
    }

    /// Name of its file.
    pub fn file_name(&self) -> String {
        format!("part-{}.parquet", self.digest)
    }
}

/// The live parts of a ledger.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    version: u32,
    /// Journal files up to this number are in the parts already.
    pub folded: u64,
    /// The parts; a key in a later one overrides the same key in an earlier one.
    pub parts: Vec<Part>,
}

impl Default for Manifest {
    fn default() -> Self {
        Self::new(0, Vec::new())
    }
}

/// What is at the manifest's place.
pub enum Found {
    /// A manifest.
    Whole(Manifest),
    /// No file: a new ledger, or one that was killed before its first compaction ended.
    Nothing,
    /// A file that is no manifest, and why.
    Damaged(String),
}

impl Manifest {
    /// A manifest of these parts.
    pub(super) fn new(folded: u64, parts: Vec<Part>) -> Self {
        Self { version: VERSION, folded, parts }
    }

    /// Path of the manifest of the ledger in `folder`.
    pub fn path(folder: &Path) -> PathBuf {
        folder.join(MANIFEST)
    }

    /// The bytes at its place, if any; two equal reads mean that no compaction came between them.
    pub fn bytes(folder: &Path) -> Result<Option<Vec<u8>>, StoreError> {
        let path = Self::path(folder);
        match std::fs::read(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            bytes => bytes.map(Some).map_err(StoreError::io("read", &path)),
        }
    }

    /// Reads a manifest from bytes.
    pub fn find(bytes: Option<&[u8]>) -> Found {
        let Some(bytes) = bytes else { return Found::Nothing };
        match serde_json::from_slice::<Self>(bytes) {
            Ok(manifest) if manifest.version != VERSION => {
                Found::Damaged(format!("manifest version {}, this program reads {VERSION}", manifest.version))
            }
            Ok(manifest) => match manifest.parts.iter().find(|part| part.digest.parse::<Digest>().is_err()) {
                Some(part) => Found::Damaged(format!("`{}` is not a digest", part.digest)),
                None => Found::Whole(manifest),
            },
            Err(e) => Found::Damaged(e.to_string()),
        }
    }

    /// Renames the manifest into place.
    pub fn publish(&self, folder: &Path) -> Result<(), StoreError> {
        let path = Self::path(folder);
        let text = serde_json::to_string_pretty(self).map_err(|e| StoreError::io("write", &path)(e.into()))?;
        atomic::publish(&path, (text + "\n").as_bytes())
    }

    fn lists(&self, name: &str) -> bool {
        self.parts.iter().any(|part| part.file_name() == name)
    }
}

/// A journal file: rows appended since the last fold.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Journal {
    /// Its number; a later one overrides the same key in an earlier one.
    pub sequence: u64,
    /// Its path.
    pub path: PathBuf,
}

impl Journal {
    /// Where the journal file of these bytes goes.
    pub(super) fn new(folder: &Path, sequence: u64, digest: Digest) -> Self {
        Self { sequence, path: folder.join(JOURNAL).join(format!("{sequence:012}-{digest}.parquet")) }
    }

    fn parse(path: PathBuf) -> Option<Self> {
        let sequence = path.file_name()?.to_str()?.split_once('-')?.0.parse().ok()?;
        promised_digest(&path).map(|_| Self { sequence, path })
    }
}

/// The digest in the name of a part, journal or object file.
pub fn promised_digest(path: &Path) -> Option<Digest> {
    let name = path.file_name()?.to_str()?;
    name.strip_suffix(".parquet").unwrap_or(name).rsplit('-').next()?.parse().ok()
}

/// The files of a ledger on disk.
#[derive(Debug, Default)]
pub struct Files {
    /// Part files, by name.
    pub parts: Vec<PathBuf>,
    /// Journal files, by number.
    pub journal: Vec<Journal>,
}

impl Files {
    /// Lists the folder of a ledger. Names of any other form are not ours and are left alone.
    pub fn list(folder: &Path) -> Result<Self, StoreError> {
        let parts = atomic::list(folder)?.into_iter();
        let parts =
            parts.filter(|path| name_of(path).starts_with("part-") && promised_digest(path).is_some()).collect();
        let mut journal: Vec<_> = atomic::list(&folder.join(JOURNAL))?.into_iter().filter_map(Journal::parse).collect();
        journal.sort();
        Ok(Self { parts, journal })
    }

    /// Files that a manifest has left behind: parts it does not list, journal files it has folded.
    pub fn leftovers(&self, manifest: &Manifest) -> Vec<PathBuf> {
        let parts = self.parts.iter().filter(|path| !manifest.lists(&name_of(path))).cloned();
        let journal = self.journal.iter().filter(|file| file.sequence <= manifest.folded);
        parts.chain(journal.map(|file| file.path.clone())).collect()
    }
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}
