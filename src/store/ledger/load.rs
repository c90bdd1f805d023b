//! Opening a ledger: live parts by the manifest, then the journal, every file checked against its digest.
//!
//! A damaged file is set aside when this process writes, passed over when it only reads; either way it is reported and
//! its keys are missing. Rows of an earlier schema version are treated in the same way: they are made again, so that what
//! a table holds never depends on which version made a run. Those of a later version are an error. Without a manifest all parts count: none ever holds a wrong row, so at most a key that was
//! replaced stands in two versions, and is then dropped to be computed again.

use super::layout::{Files, Found, Journal, Manifest};
use super::state::{Block, Source, State, spans_of};
use crate::canonical::Digest;
use crate::store::{Store, StoreError, Warning};
use crate::tables::{Keyed, io};
use bytes::Bytes;
use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::path::Path;

/// How often a reader starts again because a writer compacted under it.
const ATTEMPTS: usize = 10;

/// Loads the ledger of `kind` in `folder`. With `writing`, this process has the claim.
pub(super) fn load<R: Keyed>(store: &Store, folder: &Path, kind: &str, writing: bool) -> Result<State, StoreError> {
    let mut attempt = 1;
    loop {
        let before = Manifest::bytes(folder)?;
        let mut loader = Loader { store, folder, kind, writing, state: State::default() };
        let loaded = loader.load::<R>(before.as_deref());
        // A compaction renames the manifest before it removes a file, so an unchanged one means nothing was missed.
        if writing || attempt == ATTEMPTS || Manifest::bytes(folder)? == before {
            return loaded.map(|()| loader.state);
        }
        attempt += 1;
    }
}

/// A block and its keys: (key, first row, number of rows).
type Loaded = (Block, Vec<(Digest, usize, usize)>);

struct Loader<'a> {
    store: &'a Store,
    folder: &'a Path,
    kind: &'a str,
    writing: bool,
    state: State,
}

impl Loader<'_> {
    fn load<R: Keyed>(&mut self, manifest: Option<&[u8]>) -> Result<(), StoreError> {
        let files = Files::list(self.folder)?;
        self.load_parts::<R>(manifest, &files)?;
        for Journal { sequence, path } in &files.journal {
            self.state.sequence = self.state.sequence.max(*sequence);
            if *sequence > self.state.manifest.folded {
                self.add_block::<R>(path, Source::Journal)?;
            }
        }
        self.state.sequence = self.state.sequence.max(self.state.manifest.folded);
        self.state.untidy |= self.state.manifest.folded > 0 || !files.leftovers(&self.state.manifest).is_empty();
        Ok(())
    }

    fn load_parts<R: Keyed>(&mut self, manifest: Option<&[u8]>, files: &Files) -> Result<(), StoreError> {
        match Manifest::find(manifest) {
            Found::Whole(manifest) => self.load_listed::<R>(manifest),
            Found::Nothing => self.adopt_parts::<R>(files),
            Found::Damaged(why) => {
                let what = format!("is not a manifest ({why}); the parts beside it are used as they are");
                self.damaged(&Manifest::path(self.folder), what)?;
                self.adopt_parts::<R>(files)
            }
        }
    }

    fn load_listed<R: Keyed>(&mut self, manifest: Manifest) -> Result<(), StoreError> {
        for part in &manifest.parts {
            self.add_block::<R>(&self.folder.join(part.file_name()), Source::Part(part.clone()))?;
        }
        self.state.manifest = manifest;
        Ok(())
    }

    /// Takes every whole part on disk, for want of a manifest.
    fn adopt_parts<R: Keyed>(&mut self, files: &Files) -> Result<(), StoreError> {
        self.state.untidy = !files.parts.is_empty();
        let mut torn = BTreeSet::new();
        for path in &files.parts {
            if let Some((block, spans)) = self.load_block::<R>(path, Source::Journal)? {
                torn.append(&mut self.state.contradicted(&block, &spans));
                self.state.add(block, &spans);
            }
        }
        for key in &torn {
            self.state.index.remove(key);
        }
        if !torn.is_empty() {
            let what = format!("{} keys stand in two versions without a manifest; they count as missing", torn.len());
            self.state.warnings.push(Warning { path: self.folder.to_owned(), what });
        }
        Ok(())
    }

    /// Adds the rows of a file, or reports it.
    fn add_block<R: Keyed>(&mut self, path: &Path, source: Source) -> Result<(), StoreError> {
        if let Some((block, spans)) = self.load_block::<R>(path, source)? {
            self.state.add(block, &spans);
        }
        Ok(())
    }

    /// A file with its keys; nothing, and a report, where it is none.
    fn load_block<R: Keyed>(&mut self, path: &Path, source: Source) -> Result<Option<Loaded>, StoreError> {
        let Some(bytes) = self.whole_bytes(path)?.map(Bytes::from) else {
            self.state.untidy = true;
            return Ok(None);
        };
        let keys = match io::columns_of(R::SPEC, &path.display().to_string(), bytes.clone(), &[R::KEY]) {
            Err(e) if e.is_of_earlier_version() => {
                let what = "was written by an earlier version of this program; its keys count as missing".to_owned();
                self.damaged(path, what)?;
                return Ok(None);
            }
            keys => keys?,
        };
        let spans = spans_of(self.kind, keys.column::<String>(R::KEY)?)?;
        Ok(Some((Block::in_file(R::SPEC, bytes, source, spans.len()), spans)))
    }

    /// The bytes of a file, unless it is gone or damaged.
    fn whole_bytes(&mut self, path: &Path) -> Result<Option<Vec<u8>>, StoreError> {
        let bytes = match std::fs::read(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => {
                let what = "is missing; its keys count as missing".to_owned();
                self.state.warnings.push(Warning { path: path.to_owned(), what });
                return Ok(None);
            }
            bytes => bytes.map_err(StoreError::io("read", path))?,
        };
        if super::layout::promised_digest(path) == Some(Digest::of_content(&bytes)) {
            return Ok(Some(bytes));
        }
        self.damaged(path, "is truncated or altered; its keys count as missing".to_owned())?;
        Ok(None)
    }

    fn damaged(&mut self, path: &Path, what: String) -> Result<(), StoreError> {
        self.state.untidy = true;
        let what = if self.writing {
            format!("{what}, it was moved to `{}`", self.store.set_aside(path)?.display())
        } else {
            what
        };
        self.state.warnings.push(Warning { path: path.to_owned(), what });
        Ok(())
    }
}
