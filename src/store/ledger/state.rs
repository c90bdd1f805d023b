//! A ledger in memory: blocks of rows as they lie on disk, and where the rows of each key are.
//!
//! Rows stay in Arrow columns and become Rust values only when asked for: a million rows cost their bytes, not a
//! million structs with their texts.

use super::layout::{Manifest, Part};
use crate::canonical::Digest;
use crate::store::{StoreError, Warning};
use crate::tables::{Fault, Keyed, RecordBatch, TableError};
use arrow::array::{Array, StringArray};
use arrow::compute::interleave_record_batch;
use std::collections::{BTreeMap, BTreeSet};

/// The rows of one key: consecutive rows of one block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span {
    pub block: u64,
    pub start: usize,
    pub rows: usize,
}

/// Where a block lies on disk.
#[derive(Debug, Clone)]
pub(super) enum Source {
    /// In a part of the manifest.
    Part(Part),
    /// In a journal file, or in a part that no manifest lists: to be folded.
    Journal,
}

/// The rows of one file.
#[derive(Debug)]
pub(super) struct Block {
    pub batch: RecordBatch,
    pub source: Source,
}

/// The content of a ledger.
#[derive(Debug, Default)]
pub(super) struct State {
    /// By number; a later block overrides the keys of an earlier one.
    pub blocks: BTreeMap<u64, Block>,
    pub index: BTreeMap<Digest, Span>,
    pub manifest: Manifest,
    /// Number of the last journal file.
    pub sequence: u64,
    /// The files on disk are not those an undisturbed compaction leaves, even if the rows are.
    pub untidy: bool,
    pub warnings: Vec<Warning>,
}

impl State {
    /// Adds a block and points the index to it, key by key; gives the keys whose rows it changed.
    pub fn add(&mut self, block: Block, spans: &[(Digest, usize, usize)]) -> BTreeSet<Digest> {
        let number = self.blocks.last_key_value().map_or(0, |(last, _)| last + 1);
        let mut changed = BTreeSet::new();
        for &(key, start, rows) in spans {
            let old = self.index.insert(key, Span { block: number, start, rows });
            let old = old.and_then(|span| self.slice(span));
            if old.is_some_and(|old| !same_rows(&old, &block.batch.slice(start, rows))) {
                changed.insert(key);
            }
        }
        self.blocks.insert(number, block);
        changed
    }

    /// The rows of a span, without copying.
    pub fn slice(&self, span: Span) -> Option<RecordBatch> {
        Some(self.blocks.get(&span.block)?.batch.slice(span.start, span.rows))
    }

    /// The rows of a key, without copying.
    pub fn rows_of(&self, key: &Digest) -> Option<RecordBatch> {
        self.slice(*self.index.get(key)?)
    }

    /// Number of journal files that no fold has taken in.
    pub fn journal_length(&self) -> usize {
        self.blocks.values().filter(|block| matches!(block.source, Source::Journal)).count()
    }

    /// All rows, by key.
    pub fn all(&self, empty: RecordBatch) -> Result<RecordBatch, TableError> {
        self.gather(empty, |_| true).map(|(batch, _)| batch)
    }

    /// The rows that live in the chosen blocks, by key, as one batch with its spans.
    pub fn gather(&self, empty: RecordBatch, chosen: impl Fn(u64) -> bool) -> Result<Gathered, TableError> {
        let spans = self.index.iter().filter(|(_, span)| chosen(span.block));
        let picks = spans.map(|(key, span)| (*key, &self.blocks[&span.block].batch, span.start, span.rows));
        gather(empty, picks)
    }
}

/// A batch and its keys: (key, first row, number of rows).
pub(super) type Gathered = (RecordBatch, Vec<(Digest, usize, usize)>);

/// Picks spans of rows out of batches, in the order given.
pub(super) fn gather<'a>(
    empty: RecordBatch,
    picks: impl Iterator<Item = (Digest, &'a RecordBatch, usize, usize)>,
) -> Result<Gathered, TableError> {
    let mut batches: Vec<&RecordBatch> = Vec::new();
    let mut number_of: BTreeMap<*const RecordBatch, usize> = BTreeMap::new();
    let (mut rows, mut spans) = (Vec::new(), Vec::new());
    for (key, batch, start, count) in picks {
        let number = *number_of.entry(std::ptr::from_ref(batch)).or_insert_with(|| {
            batches.push(batch);
            batches.len() - 1
        });
        spans.push((key, rows.len(), count));
        rows.extend((start..start + count).map(|row| (number, row)));
    }
    if batches.is_empty() {
        return Ok((empty, spans));
    }
    let fault = |e: arrow::error::ArrowError| Fault::Parquet { detail: e.to_string() };
    let batch = interleave_record_batch(&batches, &rows).map_err(|e| TableError::in_memory("ledger", fault(e)))?;
    Ok((batch, spans))
}

/// Whether two batches hold the same bits; their schemas are those of one table already.
pub(super) fn same_rows(a: &RecordBatch, b: &RecordBatch) -> bool {
    a.num_rows() == b.num_rows() && a.columns().iter().zip(b.columns()).all(|(a, b)| a.to_data() == b.to_data())
}

/// The runs of equal keys in a batch: (key, first row, number of rows).
pub(super) fn spans_of<R: Keyed>(kind: &str, batch: &RecordBatch) -> Result<Vec<(Digest, usize, usize)>, StoreError> {
    let keys = batch.column_by_name(R::KEY).and_then(|column| column.as_any().downcast_ref::<StringArray>());
    let Some(keys) = keys else {
        return Err(StoreError::BadKey { ledger: kind.to_owned(), key: format!("column {}", R::KEY) });
    };
    let mut spans: Vec<(Digest, usize, usize)> = Vec::new();
    for row in 0..keys.len() {
        let text = keys.value(row);
        match spans.last_mut() {
            Some((_, start, rows)) if keys.value(*start) == text => *rows += 1,
            _ => spans.push((key_from(kind, text)?, row, 1)),
        }
    }
    Ok(spans)
}

/// The key in a text.
pub(super) fn key_from(kind: &str, text: &str) -> Result<Digest, StoreError> {
    text.parse().map_err(|_| StoreError::BadKey { ledger: kind.to_owned(), key: text.to_owned() })
}
