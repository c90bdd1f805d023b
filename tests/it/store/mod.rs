//! The store and its tables: same rows same bytes, nothing half-written, nothing damaged believed, nothing lost.

mod ledger;
mod tables;
mod upkeep;

use granulake::canonical::Digest;
use granulake::store::{Ledger, Store};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

granulake::table! {
    /// A value under a key.
    pub struct Entry in "entries" version 1 keyed by key sorted by (key, name) {
        /// Key.
        key: String [""],
        /// Name.
        name: String [""],
        /// Value.
        value: Option<f64> ["1"],
    }
}

mod other {
    granulake::table! {
        /// As the other, with another type.
        pub struct WrongType in "every_type" version 3 sorted by (count) {
            /// A count.
            count: u64 ["1"],
        }
    }
    granulake::table! {
        /// As the other, with another unit.
        pub struct WrongUnit in "entries" version 1 sorted by (key) {
            /// Key.
            key: String [""],
            /// Name.
            name: String [""],
            /// Value.
            value: Option<f64> ["mm"],
        }
    }
    granulake::table! {
        /// As the other, of a later version.
        pub struct Later in "entries" version 2 keyed by key sorted by (key) {
            /// Key.
            key: String [""],
        }
    }
    granulake::table! {
        /// What another program might write.
        pub struct Foreign in "foreign" version 1 sorted by (count) {
            /// An index nobody asked for.
            index: u64 ["1"],
            /// Wider than needed.
            count: u64 ["1"],
            /// May be missing.
            value: Option<f64> ["1"],
        }
    }
    granulake::table! {
        /// What we read of it.
        pub struct Narrow in "narrow" version 1 sorted by (count) {
            /// A number made of a count.
            value: Option<f64> ["1"],
            /// Narrower.
            count: u32 ["1"],
        }
    }
}

fn key(number: u64) -> Digest {
    Digest::of_content(&number.to_le_bytes())
}

/// Two rows under key `number`.
fn entry(number: u64) -> Vec<Entry> {
    let row = |name: &str, value| Entry { key: key(number).to_string(), name: name.to_owned(), value };
    vec![row("second", Some(number as f64)), row("first", None)]
}

fn entries(range: std::ops::Range<u64>) -> Vec<Entry> {
    range.flat_map(entry).collect()
}

fn open(store: &Store) -> Ledger<Entry> {
    store.ledger("entries").unwrap()
}

/// A folder whose path has a space and a letter beyond ASCII.
struct Place {
    _folder: TempDir,
    root: PathBuf,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("my läke/artifacts");
        Self { _folder: folder, root }
    }

    /// The store as a new process would see it.
    fn store(&self) -> Store {
        Store::at(&self.root)
    }

    fn ledger_folder(&self) -> PathBuf {
        self.root.join("ledger/entries")
    }

    fn parts(&self) -> Vec<PathBuf> {
        files(&self.ledger_folder(), "part-")
    }

    fn journal(&self) -> Vec<PathBuf> {
        files(&self.ledger_folder().join("journal"), "")
    }

    /// Every file below the root but the guard, with its bytes.
    fn snapshot(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        collect(&self.root, &mut found);
        found.retain(|path, _| path.file_name().unwrap() != ".guard");
        found
    }

    fn restore(&self, snapshot: &BTreeMap<PathBuf, Vec<u8>>) {
        fs::remove_dir_all(&self.root).unwrap();
        for (path, bytes) in snapshot {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    }
}

fn files(folder: &Path, start: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> =
        paths.filter(|path| path.is_file() && path.file_name().unwrap().to_str().unwrap().starts_with(start)).collect();
    paths.sort();
    paths
}

fn collect(folder: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, found);
        } else {
            found.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
}

fn flip_a_bit(path: &Path) {
    let mut bytes = fs::read(path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(path, bytes).unwrap();
}

fn truncate(path: &Path) {
    let bytes = fs::read(path).unwrap();
    fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}
