//! fsck: does the store hold what the lock and the ledgers say it holds?
//!
//! Fast: files exist, have their size, and have a readable footer. Full: every byte against its digest. Damaged files
//! are set aside on request, so that the next `repro` finds them missing and computes them again.

use super::ledger::layout::{Files, Found, Manifest, promised_digest};
use super::lock::{Lock, Output};
use super::{LEDGERS, OBJECTS, Store, StoreError, atomic};
use crate::canonical::Digest;
use crate::tables::io::rows_in_file;
use std::collections::BTreeSet;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

/// How closely to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// Names, sizes and footers.
    Fast,
    /// Every byte.
    Full,
}

/// What is wrong with a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Problem {
    /// It is not there.
    Missing,
    /// It has another size than promised.
    WrongSize {
        /// Promised bytes.
        expected: u64,
        /// Bytes found.
        found: u64,
    },
    /// It is not a whole Parquet file.
    Unreadable {
        /// What the reader said.
        detail: String,
    },
    /// It has other bytes than promised.
    WrongDigest {
        /// Promised digest.
        expected: Digest,
        /// Digest found.
        found: Digest,
    },
    /// It is no manifest.
    BadManifest {
        /// What is wrong with it.
        detail: String,
    },
}

/// A file with a problem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// The file.
    pub path: PathBuf,
    /// Who needs it: `stage aggregate`, `ledger runs`, `a run` or nothing in particular.
    pub needed_by: String,
    /// What is wrong with it.
    pub problem: Problem,
    /// Where it was set aside.
    pub set_aside: Option<PathBuf>,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => write!(f, "is missing"),
            Self::WrongSize { expected, found } => write!(f, "has {found} bytes, expected {expected}"),
            Self::Unreadable { detail } => write!(f, "is not a whole Parquet file ({detail})"),
            Self::WrongDigest { expected, found } => write!(f, "has digest {found}, expected {expected}"),
            Self::BadManifest { detail } => write!(f, "is not a manifest ({detail})"),
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` {}; needed by {}", self.path.display(), self.problem, self.needed_by)?;
        match &self.set_aside {
            Some(to) => write!(f, "; moved to `{}`, `repro` computes it again", to.display()),
            None => write!(f, "; run `repro` to compute what is missing"),
        }
    }
}

/// What an examination found.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Report {
    /// Number of files looked at.
    pub files: u64,
    /// The ones with a problem, by place.
    pub findings: Vec<Finding>,
}

/// Examines the outputs of `lock`, all objects, all ledgers, and that the objects of `needed` are there.
///
/// With `set_aside`, damaged files go to `quarantine/`; the store must then be free to claim.
///
/// # Errors
/// [`StoreError::Io`], or [`StoreError::Busy`] with `set_aside`.
pub fn examine(
    store: &Store,
    lock: &Lock,
    needed: &BTreeSet<Digest>,
    depth: Depth,
    set_aside: bool,
) -> Result<Report, StoreError> {
    if set_aside {
        store.claim()?;
    }
    let mut examiner = Examiner { store, depth, set_aside, report: Report::default() };
    for (stage, path, output) in lock.outputs() {
        examiner.output(stage, path, output)?;
    }
    examiner.objects(needed)?;
    for kind in store.ledger_kinds()? {
        examiner.ledger(&kind)?;
    }
    Ok(examiner.report)
}

struct Examiner<'a> {
    store: &'a Store,
    depth: Depth,
    set_aside: bool,
    report: Report,
}

impl Examiner<'_> {
    fn output(&mut self, stage: &str, relative: &str, output: &Output) -> Result<(), StoreError> {
        let path = self.store.root().join(relative);
        self.file(&path, &format!("stage {stage}"), Some(output.bytes), Some(output.digest))
    }

    fn objects(&mut self, needed: &BTreeSet<Digest>) -> Result<(), StoreError> {
        let mut missing = needed.clone();
        for folder in atomic::list(&self.store.root().join(OBJECTS))? {
            for path in objects_in(&folder)? {
                let digest = promised_digest(&path);
                digest.map(|digest| missing.remove(&digest));
                self.file(&path, "a run", None, digest)?;
            }
        }
        for digest in missing {
            self.report.files += 1;
            self.find(&self.store.object_path(&digest), "a run", Problem::Missing)?;
        }
        Ok(())
    }

    fn ledger(&mut self, kind: &str) -> Result<(), StoreError> {
        let folder = self.store.root().join(LEDGERS).join(kind);
        let needed_by = format!("ledger {kind}");
        let files = Files::list(&folder)?;
        match Manifest::find(Manifest::bytes(&folder)?.as_deref()) {
            Found::Whole(manifest) => self.parts(&folder, &needed_by, &manifest)?,
            Found::Nothing => {}
            Found::Damaged(detail) => {
                self.find(&Manifest::path(&folder), &needed_by, Problem::BadManifest { detail })?
            }
        }
        for journal in &files.journal {
            self.file(&journal.path, &needed_by, None, promised_digest(&journal.path))?;
        }
        Ok(())
    }

    fn parts(&mut self, folder: &Path, needed_by: &str, manifest: &Manifest) -> Result<(), StoreError> {
        for part in &manifest.parts {
            let path = folder.join(part.file_name());
            self.file(&path, needed_by, Some(part.bytes), promised_digest(&path))?;
        }
        Ok(())
    }

    fn file(
        &mut self,
        path: &Path,
        needed_by: &str,
        bytes: Option<u64>,
        digest: Option<Digest>,
    ) -> Result<(), StoreError> {
        self.report.files += 1;
        match problem(path, bytes, digest, self.depth)? {
            Some(problem) => self.find(path, needed_by, problem),
            None => Ok(()),
        }
    }

    fn find(&mut self, path: &Path, needed_by: &str, problem: Problem) -> Result<(), StoreError> {
        let movable = self.set_aside && problem != Problem::Missing;
        let set_aside = if movable { Some(self.store.set_aside(path)?) } else { None };
        self.report.findings.push(Finding {
            path: path.to_owned(),
            needed_by: needed_by.to_owned(),
            problem,
            set_aside,
        });
        Ok(())
    }
}

/// The files of an object folder, without those that are being written.
fn objects_in(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    Ok(atomic::list(folder)?.into_iter().filter(|path| promised_digest(path).is_some()).collect())
}

/// What is wrong with a file, if anything.
fn problem(
    path: &Path,
    bytes: Option<u64>,
    digest: Option<Digest>,
    depth: Depth,
) -> Result<Option<Problem>, StoreError> {
    let Ok(metadata) = std::fs::metadata(path) else { return Ok(Some(Problem::Missing)) };
    if let Some(expected) = bytes.filter(|expected| *expected != metadata.len()) {
        return Ok(Some(Problem::WrongSize { expected, found: metadata.len() }));
    }
    match (depth, digest) {
        (Depth::Full, Some(expected)) => {
            let found = Digest::of_content(&std::fs::read(path).map_err(StoreError::io("read", path))?);
            Ok((found != expected).then_some(Problem::WrongDigest { expected, found }))
        }
        _ => Ok(footer_problem(path)),
    }
}

/// Only Parquet files have a footer, known by their name or their first bytes; of others the size must do.
fn footer_problem(path: &Path) -> Option<Problem> {
    let unreadable = |detail: String| Some(Problem::Unreadable { detail });
    let mut head = [0; 4];
    let begins = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut head));
    let named = path.extension().is_some_and(|extension| extension == "parquet");
    match begins {
        Err(error) => unreadable(error.to_string()),
        Ok(()) if named || head == *b"PAR1" => rows_in_file(path).err().and_then(unreadable),
        Ok(()) => None,
    }
}
