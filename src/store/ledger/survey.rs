//! What opening a ledger would complain of, told from names, sizes and footers alone.

use super::layout::{Files, Found, Journal, Manifest, Part};
use crate::store::{LEDGERS, Store, StoreError, Warning};
use crate::tables::TableSpec;
use crate::tables::io::version_in_file;
use std::path::{Path, PathBuf};

/// Files of the ledger of `kind` that are gone, have another size than promised, or hold rows of an earlier version of
/// `spec`: all of them count as missing. Nothing is moved.
///
/// # Errors
/// [`StoreError::Io`].
pub fn survey(store: &Store, kind: &str, spec: &TableSpec) -> Result<Vec<Warning>, StoreError> {
    let folder = store.root().join(LEDGERS).join(kind);
    let files = Files::list(&folder)?;
    let (parts, folded) = match Manifest::find(Manifest::bytes(&folder)?.as_deref()) {
        Found::Whole(manifest) => (manifest.parts, manifest.folded),
        Found::Nothing | Found::Damaged(_) => (Vec::new(), 0),
    };
    let promised = parts.iter().map(|part: &Part| (folder.join(part.file_name()), Some(part.bytes)));
    let waiting = files.journal.into_iter().filter(|file: &Journal| file.sequence > folded);
    let all = promised.chain(waiting.map(|file| (file.path, None)));
    Ok(all.filter_map(|(path, bytes)| complaint(path, bytes, spec)).collect())
}

fn complaint(path: PathBuf, bytes: Option<u64>, spec: &TableSpec) -> Option<Warning> {
    let what = match std::fs::metadata(&path) {
        Err(_) => "is missing; its keys count as missing, run `granulake fsck`",
        Ok(found) if bytes.is_some_and(|bytes| bytes != found.len()) => {
            "is truncated or altered; its keys count as missing, run `granulake fsck`"
        }
        Ok(_) if is_earlier(&path, spec) => {
            "was written by an earlier version of this program; its keys count as missing, and the next `granulake repro` \
             that needs them sets it aside"
        }
        Ok(_) => return None,
    };
    Some(Warning { path, what: what.to_owned() })
}

fn is_earlier(path: &Path, spec: &TableSpec) -> bool {
    version_in_file(path).ok().flatten().is_some_and(|version| version < spec.version)
}
