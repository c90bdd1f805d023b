//! Appending: rows wait in a list, the thread whose turn it is writes all that wait as one journal file.

use super::layout::Journal;
use super::state::{Block, Gathered, Source, State, gather, key_from, same_rows, spans_of};
use super::{FOLD_AT, Ledger, empty};
use crate::canonical::Digest;
use crate::store::{Contradiction, QUARANTINE, StoreError, atomic};
use crate::tables::{Checked, Keyed, RecordBatch, io};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock, PoisonError};

/// What to do with a key that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mode {
    /// The rows must be the same.
    Once,
    /// The new rows count from now on.
    Replace,
}

/// Rows of one call that wait to be written.
#[derive(Debug)]
pub(super) struct Entry {
    mode: Mode,
    /// Sorted by key.
    batch: RecordBatch,
    spans: Vec<(Digest, usize, usize)>,
    outcome: OnceLock<Result<(), StoreError>>,
}

impl Entry {
    fn new<R: Keyed>(kind: &str, rows: &[R], mode: Mode) -> Result<Self, StoreError> {
        let batch = R::to_batch(rows)?;
        let mut rows_of: BTreeMap<Digest, Vec<usize>> = BTreeMap::new();
        for (at, row) in rows.iter().enumerate() {
            rows_of.entry(key_from(kind, row.key())?).or_default().push(at);
        }
        let picks = rows_of.iter().flat_map(|(key, at)| at.iter().map(|at| (*key, &batch, *at, 1)));
        let (batch, _) = gather(empty::<R>()?, picks)?;
        let spans = spans_of(kind, Checked::new(R::SPEC, &batch)?.column::<String>(R::KEY)?)?;
        Ok(Self { mode, batch, spans, outcome: OnceLock::new() })
    }
}

/// New rows by key: which entry has them, and where.
type Fresh = BTreeMap<Digest, (usize, usize, usize)>;

impl<R: Keyed> Ledger<R> {
    /// Appends rows, of one key or several; durable when it returns. All rows of a key come in one call. Rows that are
    /// there already are no news.
    ///
    /// # Errors
    /// [`StoreError::Nondeterminism`] when a key is there with other rows, [`StoreError::BadKey`], [`StoreError::Busy`],
    /// [`StoreError::Io`] and [`StoreError::Table`]. Nothing of the call is stored then.
    pub fn append(&self, rows: &[R]) -> Result<(), StoreError> {
        self.submit(rows, Mode::Once)
    }

    /// As [`Ledger::append`], but where a key is there already the new rows count from now on. For rows that depend on
    /// more than their key: provenance, failed runs tried again.
    ///
    /// # Errors
    /// As [`Ledger::append`] but for nondeterminism.
    pub fn replace(&self, rows: &[R]) -> Result<(), StoreError> {
        self.submit(rows, Mode::Replace)
    }

    fn submit(&self, rows: &[R], mode: Mode) -> Result<(), StoreError> {
        if rows.is_empty() {
            return Ok(());
        }
        let entry = Arc::new(Entry::new(&self.kind, rows, mode)?);
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner).push(Arc::clone(&entry));
        let mut turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        // Whoever had the turn before may have written these rows along with its own.
        if let Some(outcome) = entry.outcome.get() {
            return outcome.clone();
        }
        let waiting = std::mem::take(&mut *self.waiting.lock().unwrap_or_else(PoisonError::into_inner));
        let written = self.prepare(&mut turn).and_then(|()| self.write_group(&waiting));
        for entry in &waiting {
            // An entry that was refused has its own answer already.
            let _ = entry.outcome.set(written.clone());
        }
        drop(turn);
        entry.outcome.get().cloned().unwrap_or(written)
    }

    fn write_group(&self, group: &[Arc<Entry>]) -> Result<(), StoreError> {
        let fresh = self.select(group)?;
        if fresh.is_empty() {
            return Ok(());
        }
        let picks = fresh.iter().map(|(key, &(entry, start, rows))| (*key, &group[entry].batch, start, rows));
        self.write_journal(gather(empty::<R>()?, picks)?)?;
        if self.read().journal_length() >= FOLD_AT { self.fold() } else { Ok(()) }
    }

    /// The rows of a group that are new; answers the entries that contradict what is there.
    fn select(&self, group: &[Arc<Entry>]) -> Result<Fresh, StoreError> {
        let state = self.read();
        let mut fresh = Fresh::new();
        for (number, entry) in group.iter().enumerate() {
            match self.select_entry(&state, group, &fresh, entry)? {
                Ok(spans) => fresh.extend(spans.into_iter().map(|(key, start, rows)| (key, (number, start, rows)))),
                Err(contradiction) => drop(entry.outcome.set(Err(contradiction))),
            }
        }
        Ok(fresh)
    }

    /// The spans of an entry that are new, or the error that one contradicts what is there.
    #[expect(clippy::type_complexity, reason = "outer error: the store failed; inner: this entry is refused")]
    fn select_entry(
        &self,
        state: &State,
        group: &[Arc<Entry>],
        fresh: &Fresh,
        entry: &Entry,
    ) -> Result<Result<Vec<(Digest, usize, usize)>, StoreError>, StoreError> {
        let mut new = Vec::new();
        for &(key, start, rows) in &entry.spans {
            let offered = entry.batch.slice(start, rows);
            let earlier = fresh.get(&key).map(|&(entry, start, rows)| group[entry].batch.slice(start, rows));
            match earlier.or_else(|| state.rows_of(&key)) {
                Some(stored) if same_rows(&stored, &offered) => {}
                Some(stored) if entry.mode == Mode::Once => {
                    return Ok(Err(self.contradiction(key, &stored, &offered)?));
                }
                _ => new.push((key, start, rows)),
            }
        }
        Ok(Ok(new))
    }

    /// The error of nondeterminism, after the offered rows have been kept for whoever looks into it.
    fn contradiction(
        &self,
        key: Digest,
        stored: &RecordBatch,
        offered: &RecordBatch,
    ) -> Result<StoreError, StoreError> {
        let (stored, offered) = (io::encode(R::SPEC, stored)?, io::encode(R::SPEC, offered)?);
        let (stored, bytes, offered) = (Digest::of_content(&stored), &offered, Digest::of_content(&offered));
        let name = format!("nondeterminism-{}-{key}-{offered}.parquet", self.kind);
        let kept = self.store.root().join(QUARANTINE).join(name);
        atomic::publish(&kept, bytes)?;
        let contradiction = Contradiction { ledger: self.kind.clone(), key, stored, offered, kept };
        Ok(StoreError::Nondeterminism(Box::new(contradiction)))
    }

    fn write_journal(&self, (batch, spans): Gathered) -> Result<(), StoreError> {
        let bytes = io::encode(R::SPEC, &batch)?;
        let sequence = self.read().sequence + 1;
        let file = Journal::new(&self.folder, sequence, Digest::of_content(&bytes));
        atomic::publish(&file.path, &bytes)?;
        let mut state = self.write();
        state.sequence = sequence;
        state.add(Block::held(R::SPEC, &batch, Source::Journal, spans.len()), &spans);
        Ok(())
    }
}
