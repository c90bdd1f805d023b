//! Atomic publishing: a file is there with all its bytes, or it is not there.
//!
//! Temporary file in the same folder, fsync, rename, fsync of the folder. A kill leaves at most a file whose name
//! starts with [`TEMPORARY`], which every reader ignores and `gc` removes. No clock is asked, so a clock set back
//! confuses nothing.

use super::StoreError;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Start of the name of a file that is being written.
pub const TEMPORARY: &str = ".tmp-";

/// Writes `bytes` under `path`, replacing what was there; durable when it returns. Creates missing folders.
///
/// # Errors
/// [`StoreError::Io`] naming the path; nothing is left behind and an earlier file stays as it was.
pub fn publish(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let folder = path.parent().unwrap_or_else(|| Path::new(""));
    create_folder(folder)?;
    let (temporary, file) = create_temporary(folder)?;
    let renamed = fill(file, bytes).and_then(|()| fs::rename(&temporary, path));
    if let Err(error) = renamed {
        // The write has failed already; a temporary file that cannot be removed either is left to `gc`.
        let _ = fs::remove_file(&temporary);
        return Err(StoreError::io("write", path)(error));
    }
    sync_folder(folder)
}

/// Moves a file to another name, durably on both sides.
///
/// # Errors
/// [`StoreError::Io`] naming the file.
pub fn relocate(from: &Path, to: &Path) -> Result<(), StoreError> {
    let folders = [from, to].map(|path| path.parent().unwrap_or_else(|| Path::new("")));
    create_folder(folders[1])?;
    fs::rename(from, to).map_err(StoreError::io("move", from))?;
    folders.into_iter().try_for_each(sync_folder)
}

/// Removes a file; one that is gone already counts as removed.
///
/// # Errors
/// [`StoreError::Io`] naming the file.
pub fn remove(path: &Path) -> Result<(), StoreError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(StoreError::io("remove", path)(e)),
        _ => Ok(()),
    }
}

/// The names in a folder in order, with paths; none when the folder does not exist.
///
/// # Errors
/// [`StoreError::Io`] naming the folder.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(StoreError::io("list", folder))?,
    };
    let paths: Result<Vec<_>, _> = entries.map(|entry| entry.map(|entry| entry.path())).collect();
    let mut paths = paths.map_err(StoreError::io("list", folder))?;
    paths.sort();
    Ok(paths)
}

/// Creates a folder and its parents, each durable in its own parent.
///
/// # Errors
/// [`StoreError::Io`] naming the folder.
pub fn create_folder(folder: &Path) -> Result<(), StoreError> {
    if folder.as_os_str().is_empty() || folder.is_dir() {
        return Ok(());
    }
    let parent = folder.parent().unwrap_or_else(|| Path::new(""));
    create_folder(parent)?;
    match fs::create_dir(folder) {
        Err(e) if e.kind() != ErrorKind::AlreadyExists => Err(StoreError::io("create", folder)(e)),
        _ => sync_folder(parent),
    }
}

/// A temporary file of a name nobody else uses: a process that was killed may have left the same number behind.
fn create_temporary(folder: &Path) -> Result<(PathBuf, File), StoreError> {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    loop {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = folder.join(format!("{TEMPORARY}{}-{number}", std::process::id()));
        match OpenOptions::new().write(true).create_new(true).open(&path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            file => return file.map(|file| (path.clone(), file)).map_err(StoreError::io("create", &path)),
        }
    }
}

fn fill(mut file: File, bytes: &[u8]) -> std::io::Result<()> {
    file.write_all(bytes)?;
    file.sync_all()
}

/// Makes the names in a folder durable. Only Unix can open a folder to do so.
pub fn sync_folder(folder: &Path) -> Result<(), StoreError> {
    if !cfg!(unix) {
        return Ok(());
    }
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    File::open(folder).and_then(|file| file.sync_all()).map_err(StoreError::io("write", folder))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_publish_keeps_the_old_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("table");
        // A folder of the target's name makes the last step, the rename, fail.
        fs::create_dir_all(target.join("inside")).unwrap();
        let error = publish(&target, b"new").unwrap_err().to_string();
        assert!(error.starts_with("cannot write `") && error.contains("table"), "{error}");
        assert_eq!(list(folder.path()).unwrap(), [target]);
    }

    #[test]
    fn leftovers_of_a_killed_process_do_not_disturb() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..50 {
            fs::write(folder.path().join(format!("{TEMPORARY}{}-{number}", std::process::id())), b"half").unwrap();
        }
        let target = folder.path().join("a b/ä/table.parquet");
        publish(&target, b"one").unwrap();
        publish(&target, b"two").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"two");
        assert_eq!(list(target.parent().unwrap()).unwrap(), [target]);
    }
}
