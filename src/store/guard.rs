//! The guard: at most one process writes in an artifacts directory.
//!
//! An advisory lock of the operating system on `artifacts/.guard`, so that a killed process holds nothing. Readers
//! (`status`, `plan`, `query`) do not take it.

use super::{StoreError, atomic};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::Path;

/// Name of the file that is locked.
pub const GUARD: &str = ".guard";

/// Proof that this process alone writes in an artifacts directory; given back on drop or when the process ends.
#[derive(Debug)]
pub struct Guard {
    // Held for its lock, which the operating system gives back when the file is closed.
    _file: File,
}

impl Guard {
    /// Takes the guard of `root`, or fails at once when another process has it.
    ///
    /// # Errors
    /// [`StoreError::Busy`], or [`StoreError::Io`] when the folder is not writable.
    pub fn take(root: &Path) -> Result<Self, StoreError> {
        atomic::create_folder(root)?;
        let path = root.join(GUARD);
        let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
        let mut file = options.map_err(StoreError::io("open", &path))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(busy(root, &path)),
            Err(TryLockError::Error(e)) => return Err(StoreError::io("lock", &path)(e)),
        }
        // Only for the message of a process that comes second; it may read a torn or stale number.
        file.set_len(0)
            .and_then(|()| write!(file, "process {}", std::process::id()))
            .map_err(StoreError::io("write", &path))?;
        Ok(Self { _file: file })
    }
}

fn busy(root: &Path, path: &Path) -> StoreError {
    let holder = std::fs::read_to_string(path).unwrap_or_default();
    let holder = if holder.is_empty() { "unknown process".to_owned() } else { holder };
    StoreError::Busy { root: root.to_owned(), holder }
}
