//! What can go wrong in the store: where, what, and what to do.

use crate::canonical::Digest;
use crate::tables::TableError;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An error of the store. Cloneable, because one failed write is the answer to every thread that shared it.
#[derive(Debug, Clone, thiserror::Error)]
pub enum StoreError {
    /// The operating system refused.
    #[error("cannot {action} `{}`: {source}; {}", path.display(), remedy(source))]
    Io {
        /// What was tried, such as `write`.
        action: &'static str,
        /// On which file or folder.
        path: PathBuf,
        /// What the operating system said.
        source: Arc<io::Error>,
    },
    /// Another process works in the same artifacts directory.
    #[error("`{}` is in use by another granulake ({holder}); wait for it to finish or stop it, then run again", root.display())]
    Busy {
        /// The artifacts directory.
        root: PathBuf,
        /// Who holds it, as far as known.
        holder: String,
    },
    /// An object that something refers to is gone.
    #[error("object {digest} is missing from `{}`; run `repro`, which computes it again", path.display())]
    MissingObject {
        /// Digest of the object.
        digest: Digest,
        /// Where it should be.
        path: PathBuf,
    },
    /// A file whose bytes are not those its name or the lock promises.
    #[error("`{}` is damaged: its digest is {found}, expected {expected}; run `fsck`, then `repro`", path.display())]
    WrongDigest {
        /// The file.
        path: PathBuf,
        /// Promised digest.
        expected: Digest,
        /// Digest of the bytes found.
        found: Digest,
    },
    /// The same key gave two results.
    #[error(transparent)]
    Nondeterminism(Box<Contradiction>),
    /// A key that is not a digest.
    #[error("ledger `{ledger}`: `{key}` is not a key of 64 hexadecimal digits")]
    BadKey {
        /// Kind of the ledger.
        ledger: String,
        /// The text found.
        key: String,
    },
    /// A lock file that cannot be understood.
    #[error(
        "`{}`: {detail}; restore it from version control, or remove it: `repro` then checks every stage again and keeps \
         all runs",
        path.display()
    )]
    BadLock {
        /// The lock file.
        path: PathBuf,
        /// What is wrong with it.
        detail: String,
    },
    /// A manifest of a table that cannot be understood.
    #[error("`{}` is no manifest of a table: {detail}; run `fsck`, then `repro`", path.display())]
    BadIndex {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with it.
        detail: String,
    },
    /// A table that cannot be written or read.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Two results for one key; both are kept.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "ledger `{ledger}`: key {key} was computed twice with different results (stored {stored}, now {offered}); the engine \
     is not deterministic here, please report it with both records: the new one is kept in `{}`",
    kept.display()
)]
pub struct Contradiction {
    /// Kind of the ledger.
    pub ledger: String,
    /// The key.
    pub key: Digest,
    /// Digest of the rows in the ledger, as a table of their own.
    pub stored: Digest,
    /// Digest of the rows offered, as a table of their own.
    pub offered: Digest,
    /// Where the offered rows were kept.
    pub kept: PathBuf,
}

impl StoreError {
    /// An [`StoreError::Io`], for `map_err`.
    pub fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { action, path, source: Arc::new(source) }
    }

    /// Whether a file or folder was not there.
    pub fn is_not_found(&self) -> bool {
        matches!(self, Self::Io { source, .. } if source.kind() == io::ErrorKind::NotFound)
    }
}

fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "make room on the disk and run again, finished runs are kept"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "make the folder writable or choose another artifacts folder"
        }
        io::ErrorKind::NotFound => "run `fsck`, then `repro`",
        _ => "check the disk and run again, finished runs are kept",
    }
}

/// Something the store set aside or could not find while it opened; the work goes on without it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it and what follows from that.
    pub what: String,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "`{}`: {}", self.path.display(), self.what)
    }
}
