//! Ledgers: keyed, append-only collections of rows, such as every run ever simulated.
//!
//! ```text
//! ledger/<kind>/manifest.json               the live parts; renamed into place last
//!               part-<digest>.parquet       rows sorted by key
//!               journal/<n>-<digest>.parquet  rows appended since the last fold
//! ```
//!
//! An append is on disk before it returns; threads that append at the same time share one file. When the journal has
//! [`FOLD_AT`] files it is folded into a part; [`Ledger::compact`] merges all into one part, whose bytes depend on the
//! rows alone, but leaves parts of more than [`SMALL`] keys as they are while little has come after them. A crash at any
//! point loses nothing that was appended and duplicates nothing.
//!
//! Rows must follow from their key. The same rows again are no news, other rows are an error of nondeterminism; what
//! does depend on time or machine (provenance, failures tried again) is [`Ledger::replace`]d.

mod commit;
mod compact;
pub mod layout;
mod load;
mod state;
mod survey;

pub use compact::{FOLD_AT, SMALL};
pub use survey::survey;

use super::{LEDGERS, Store, StoreError, Warning};
use crate::canonical::Digest;
use crate::tables::{Keyed, RecordBatch};
use commit::Entry;
use state::State;
use std::marker::PhantomData;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

/// A keyed, append-only collection of rows; shared between threads by reference.
///
/// ```
/// use granulake::{canonical::Digest, store::Store};
///
/// granulake::table! {
///     /// One row per run.
///     pub struct RunRow in "runs" version 1 keyed by run_key sorted by (run_key) {
///         /// Key of the run.
///         run_key: String [""],
///         /// Steps made.
///         steps: u64 ["1"],
///     }
/// }
///
/// let folder = tempfile::tempdir()?;
/// let runs = Store::at(folder.path()).ledger::<RunRow>("runs")?;
/// let row = RunRow { run_key: Digest::of_content(b"settings and seed").to_string(), steps: 7 };
/// runs.append(&[row.clone()])?;
/// assert_eq!(runs.get(&row.run_key), Some(vec![row]));
/// runs.compact()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Ledger<R> {
    store: Store,
    folder: PathBuf,
    kind: String,
    state: RwLock<State>,
    /// Rows that wait for the thread whose turn it is to write.
    waiting: Mutex<Vec<Arc<Entry>>>,
    /// The turn to write; holds whether the state was loaded under the claim of this process.
    turn: Mutex<bool>,
    rows: PhantomData<fn() -> R>,
}

impl<R: Keyed> Ledger<R> {
    /// Opens the ledger of `kind`; it need not exist yet. Damaged files become [`Ledger::warnings`].
    ///
    /// # Errors
    /// [`StoreError::Io`], or [`StoreError::Table`] for rows of a later schema version.
    pub fn open(store: &Store, kind: &str) -> Result<Self, StoreError> {
        let folder = store.root().join(LEDGERS).join(kind);
        let writing = store.is_claimed();
        let state = load::load::<R>(store, &folder, kind, writing)?;
        Ok(Self {
            store: store.clone(),
            folder,
            kind: kind.to_owned(),
            state: RwLock::new(state),
            waiting: Mutex::default(),
            turn: Mutex::new(writing),
            rows: PhantomData,
        })
    }

    /// What was found damaged or missing when the ledger was opened.
    pub fn warnings(&self) -> Vec<Warning> {
        self.read().warnings.clone()
    }

    /// The rows of a key of 64 hexadecimal digits, in the order they were appended.
    pub fn get(&self, key: &str) -> Option<Vec<R>> {
        self.rows_of(&key.parse().ok()?)
    }

    /// As [`Ledger::get`], for a key that is parsed already.
    pub fn rows_of(&self, key: &Digest) -> Option<Vec<R>> {
        let state = self.read();
        let (columns, rows) = state.place_of(key)?;
        R::from_checked(columns, rows).ok()
    }

    /// Whether there are rows of a key.
    pub fn contains(&self, key: &Digest) -> bool {
        self.read().index.contains_key(key)
    }

    /// Number of keys.
    pub fn len(&self) -> usize {
        self.read().index.len()
    }

    /// Whether there is no key.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All keys in order.
    pub fn keys(&self) -> Vec<Digest> {
        self.read().index.keys().copied().collect()
    }

    /// All rows, by key; those of keys that are added on the way are left out.
    pub fn rows(&self) -> impl Iterator<Item = R> {
        self.keys().into_iter().flat_map(|key| self.rows_of(&key).unwrap_or_default())
    }

    /// All rows as columns, by key.
    ///
    /// # Errors
    /// [`StoreError::Table`] when they do not fit one batch (2 GiB of text in one column).
    pub fn all(&self) -> Result<RecordBatch, StoreError> {
        Ok(self.read().all(empty::<R>()?)?)
    }

    fn read(&self) -> RwLockReadGuard<'_, State> {
        self.state.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, State> {
        self.state.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes the turn to write, ready to do so.
    fn take_turn(&self) -> Result<MutexGuard<'_, bool>, StoreError> {
        let mut turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.prepare(&mut turn)?;
        Ok(turn)
    }

    /// The first time, takes the claim and loads again what others wrote until then.
    fn prepare(&self, claimed: &mut bool) -> Result<(), StoreError> {
        if !*claimed {
            self.store.claim()?;
            let loaded = load::load::<R>(&self.store, &self.folder, &self.kind, true)?;
            *self.write() = loaded;
            *claimed = true;
        }
        Ok(())
    }
}

/// A batch of no rows.
fn empty<R: Keyed>() -> Result<RecordBatch, StoreError> {
    Ok(R::to_batch(&[])?)
}
