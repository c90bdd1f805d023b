//! The store: everything under the artifacts directory, addressed by content and published whole.
//!
//! ```text
//! artifacts/
//!   objects/ab/abcd…              content-addressed bytes: final states, traces, outputs of every stage key seen
//!   ledger/<kind>/                one keyed append-only collection of rows, see [`ledger`]
//!   tables/<name>/…               outputs of the stages, see [`table`]; pipeline.lock holds their digests, see [`lock`]
//!   pins/<name>.lock              copies of locks whose results stay, see [`gc`]
//!   quarantine/                   damaged files, set aside and never read
//!   .guard                        held by the one process that writes, see [`guard`]
//! ```
//!
//! Takes bytes, rows and keys; gives them back, or says what is wrong. Deliberately absent: what a key is made of, which
//! stage wants what, and any cache in memory that could disagree with the disk.

pub mod atomic;
mod error;
pub mod fsck;
pub mod gc;
pub mod guard;
pub mod ledger;
pub mod lock;
pub mod table;

pub use error::{Contradiction, StoreError, Warning};
pub use ledger::Ledger;
pub use lock::{Lock, Output, StageLock};

use crate::canonical::Digest;
use crate::tables::Keyed;
use guard::Guard;
use ledger::layout::promised_digest;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Folder of the content-addressed objects.
pub const OBJECTS: &str = "objects";
/// Folder of the ledgers.
pub const LEDGERS: &str = "ledger";
/// Folder of the tables.
pub const TABLES: &str = "tables";
/// Folder of pinned locks.
pub const PINS: &str = "pins";
/// Folder of damaged files.
pub const QUARANTINE: &str = "quarantine";

/// An artifacts directory. Clones share the claim, which ends with the last of them.
///
/// ```
/// use granulake::store::Store;
///
/// let folder = tempfile::tempdir()?;
/// let store = Store::at(folder.path());
/// store.claim()?; // optional: the first write does it too
/// let digest = store.put_object(b"bytes of a final state")?;
/// assert_eq!(store.object(&digest)?, b"bytes of a final state");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Store {
    root: PathBuf,
    claim: Arc<Mutex<Option<Guard>>>,
}

impl Store {
    /// The store at `root`, which need not exist yet. Touches nothing.
    pub fn at(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), claim: Arc::default() }
    }

    /// The artifacts directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Makes this process the one that writes, until the last clone of this store is dropped. Every write does so
    /// itself; a command that is going to write claims first, so that it fails before it has computed anything.
    ///
    /// # Errors
    /// [`StoreError::Busy`] when another process, or another [`Store`] of this one, has the claim.
    pub fn claim(&self) -> Result<(), StoreError> {
        let mut claim = self.claim.lock().unwrap_or_else(PoisonError::into_inner);
        if claim.is_none() {
            *claim = Some(Guard::take(&self.root)?);
        }
        Ok(())
    }

    /// Whether this store has the claim.
    pub fn is_claimed(&self) -> bool {
        self.claim.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Where an object lies.
    pub fn object_path(&self, digest: &Digest) -> PathBuf {
        let name = digest.to_string();
        self.root.join(OBJECTS).join(&name[..2]).join(name)
    }

    /// Stores bytes under their digest. Bytes that are there already are compared, and replaced when damaged.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Busy`].
    pub fn put_object(&self, bytes: &[u8]) -> Result<Digest, StoreError> {
        self.claim()?;
        let digest = Digest::of_content(bytes);
        let path = self.object_path(&digest);
        match fs::read(&path) {
            Ok(stored) if stored == bytes => {}
            _ => atomic::publish(&path, bytes)?,
        }
        Ok(digest)
    }

    /// The bytes of an object, checked against their digest.
    ///
    /// # Errors
    /// [`StoreError::MissingObject`], [`StoreError::WrongDigest`] or [`StoreError::Io`].
    pub fn object(&self, digest: &Digest) -> Result<Vec<u8>, StoreError> {
        let path = self.object_path(digest);
        match fs::read(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Err(StoreError::MissingObject { digest: *digest, path }),
            bytes => verified(&path, bytes.map_err(StoreError::io("read", &path))?, *digest),
        }
    }

    /// Whether an object is there, by name alone.
    pub fn has_object(&self, digest: &Digest) -> bool {
        self.object_path(digest).is_file()
    }

    /// Publishes bytes at a path relative to the artifacts directory, and says what the lock should hold of them.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Busy`].
    pub fn publish(&self, relative: &str, bytes: &[u8]) -> Result<Output, StoreError> {
        self.claim()?;
        atomic::publish(&self.root.join(relative), bytes)?;
        Ok(Output { digest: Digest::of_content(bytes), bytes: bytes.len() as u64, rows: None })
    }

    /// Stores a published file as an object again, if the object is gone and the file is the one in the lock.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Busy`].
    pub fn recover_object(&self, relative: &str, output: &Output) -> Result<(), StoreError> {
        if self.has_object(&output.digest) {
            return Ok(());
        }
        match fs::read(self.root.join(relative)) {
            Ok(bytes) if Digest::of_content(&bytes) == output.digest => self.put_object(&bytes).map(|_| ()),
            _ => Ok(()),
        }
    }

    /// Removes a published file that nothing refers to any more.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Busy`].
    pub fn remove_output(&self, relative: &str) -> Result<(), StoreError> {
        self.claim()?;
        atomic::remove(&self.root.join(relative))
    }

    /// Whether a published file is there as the lock has it. Of a file that carries its digest in its name the size must
    /// do; any other is read, because another study in the same store may have put one of equal size in its place.
    pub fn has_output(&self, relative: &str, output: &Output) -> bool {
        let path = self.root.join(relative);
        let sized = fs::metadata(&path).is_ok_and(|found| found.is_file() && found.len() == output.bytes);
        let named = promised_digest(&path) == Some(output.digest);
        sized && (named || fs::read(&path).is_ok_and(|bytes| Digest::of_content(&bytes) == output.digest))
    }

    /// Opens the ledger of a kind. See [`Ledger::warnings`] for what was found damaged.
    ///
    /// # Errors
    /// [`StoreError::Io`], or [`StoreError::Table`] for rows of a later schema version.
    pub fn ledger<R: Keyed>(&self, kind: &str) -> Result<Ledger<R>, StoreError> {
        Ledger::open(self, kind)
    }

    /// The kinds of ledgers there are, in order.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn ledger_kinds(&self) -> Result<Vec<String>, StoreError> {
        let folders = atomic::list(&self.root.join(LEDGERS))?.into_iter().filter(|path| path.is_dir());
        Ok(folders.filter_map(|path| path.file_name().map(|name| name.to_string_lossy().into_owned())).collect())
    }

    /// The pinned locks, in order.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn pins(&self) -> Result<Vec<PathBuf>, StoreError> {
        let mut paths = atomic::list(&self.root.join(PINS))?;
        paths.retain(|path| path.extension().is_some_and(|extension| extension == "lock"));
        Ok(paths)
    }

    /// Moves a damaged file into `quarantine/` under a name that says where it came from; gives its new place.
    ///
    /// # Errors
    /// [`StoreError::Io`] or [`StoreError::Busy`].
    pub fn set_aside(&self, path: &Path) -> Result<PathBuf, StoreError> {
        self.claim()?;
        let target = self.free_quarantine_path(path);
        atomic::relocate(path, &target)?;
        Ok(target)
    }

    /// Files that were set aside, by name.
    ///
    /// # Errors
    /// [`StoreError::Io`].
    pub fn quarantined(&self) -> Result<Vec<PathBuf>, StoreError> {
        atomic::list(&self.root.join(QUARANTINE))
    }

    /// A free name in `quarantine/` for the file at `path`.
    fn free_quarantine_path(&self, path: &Path) -> PathBuf {
        let relative = path.strip_prefix(&self.root).unwrap_or(path).to_string_lossy().replace(['/', '\\'], "_");
        let folder = self.root.join(QUARANTINE);
        let names = (0..).map(|n: u32| if n == 0 { relative.clone() } else { format!("{relative}.{n}") });
        let mut paths = names.map(|name| folder.join(name));
        paths.find(|path| !path.exists()).unwrap_or_else(|| folder.join(&relative))
    }
}

/// The bytes, if they have the digest.
fn verified(path: &Path, bytes: Vec<u8>, expected: Digest) -> Result<Vec<u8>, StoreError> {
    let found = Digest::of_content(&bytes);
    if found == expected {
        return Ok(bytes);
    }
    Err(StoreError::WrongDigest { path: path.to_owned(), expected, found })
}
