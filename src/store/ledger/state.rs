//! A ledger in memory: blocks of rows as they lie on disk, and where the rows of each key are.
//!
//! Of a file only the keys are read until someone asks for its rows. These stay in Arrow columns and become Rust values
//! one key at a time: a million rows cost their bytes, not a million structs with their texts.

use super::layout::{Manifest, Part};
use crate::canonical::Digest;
use crate::store::{StoreError, Warning};
use crate::tables::{Checked, Fault, RecordBatch, TableError, TableSpec, io};
use arrow::array::{Array, StringArray};
use arrow::compute::interleave_record_batch;
use bytes::Bytes;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::OnceLock;

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
    pub source: Source,
    /// Number of keys.
    pub keys: usize,
    /// The whole file as it was checked against its digest; nothing where the rows are held already.
    bytes: Bytes,
    rows: OnceLock<Result<Checked, TableError>>,
    spec: &'static TableSpec,
}

impl Block {
    /// Rows that are held.
    pub fn held(spec: &'static TableSpec, batch: &RecordBatch, source: Source, keys: usize) -> Self {
        let rows = OnceLock::from(Checked::new(spec, batch));
        Self { source, keys, bytes: Bytes::new(), rows, spec }
    }

    /// Rows in the bytes of a file.
    pub fn in_file(spec: &'static TableSpec, bytes: Bytes, source: Source, keys: usize) -> Self {
        Self { source, keys, bytes, rows: OnceLock::new(), spec }
    }

    /// The rows, read when first asked for.
    ///
    /// # Errors
    /// [`TableError`] for a file that its digest lets pass and that is no file of this table.
    pub fn rows(&self) -> Result<&Checked, TableError> {
        let read = || {
            let batch = io::decode(self.spec, "ledger", self.bytes.clone())?;
            Checked::new(self.spec, &batch)
        };
        self.rows.get_or_init(read).as_ref().map_err(Clone::clone)
    }

    /// Whether it lies in a journal file, or in a part that no manifest lists.
    pub fn is_journal(&self) -> bool {
        matches!(self.source, Source::Journal)
    }
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
    /// Adds a block and points the index to it, key by key.
    pub fn add(&mut self, block: Block, spans: &[(Digest, usize, usize)]) {
        let number = self.blocks.last_key_value().map_or(0, |(last, _)| last + 1);
        let placed = spans.iter().map(|&(key, start, rows)| (key, Span { block: number, start, rows }));
        if self.index.is_empty() {
            // A million keys at once are four times as fast as one by one.
            self.index = placed.collect();
        } else {
            self.index.extend(placed);
        }
        self.blocks.insert(number, block);
    }

    /// The keys of a block that are here already with other rows.
    pub fn contradicted(&self, block: &Block, spans: &[(Digest, usize, usize)]) -> BTreeSet<Digest> {
        let differs = |&&(key, start, rows): &&(Digest, usize, usize)| {
            let new = block.rows().map(|rows_of| rows_of.batch().slice(start, rows));
            self.rows_of(&key).is_some_and(|old| new.is_ok_and(|new| !same_rows(&old, &new)))
        };
        spans.iter().filter(differs).map(|(key, ..)| *key).collect()
    }

    /// The rows of a key, without copying.
    pub fn rows_of(&self, key: &Digest) -> Option<RecordBatch> {
        let (rows, place) = self.place_of(key)?;
        Some(rows.batch().slice(place.start, place.len()))
    }

    /// The columns that hold the rows of a key, and which of them they are.
    pub fn place_of(&self, key: &Digest) -> Option<(&Checked, Range<usize>)> {
        let span = *self.index.get(key)?;
        let rows = self.blocks.get(&span.block)?.rows().ok()?;
        Some((rows, span.start..span.start + span.rows))
    }

    /// Number of journal files that no fold has taken in.
    pub fn journal_length(&self) -> usize {
        self.blocks.values().filter(|block| block.is_journal()).count()
    }

    /// All rows, by key.
    pub fn all(&self, empty: RecordBatch) -> Result<RecordBatch, TableError> {
        self.gather(empty, |_| true).map(|(batch, _)| batch)
    }

    /// The rows that live in the chosen blocks, by key, as one batch with its spans.
    pub fn gather(&self, empty: RecordBatch, chosen: impl Fn(u64) -> bool) -> Result<Gathered, TableError> {
        let mut batches: BTreeMap<u64, &RecordBatch> = BTreeMap::new();
        for (number, block) in self.blocks.iter().filter(|(number, _)| chosen(**number)) {
            batches.insert(*number, block.rows()?.batch());
        }
        let pick = |(key, span): (&Digest, &Span)| Some((*key, *batches.get(&span.block)?, span.start, span.rows));
        gather(empty, self.index.iter().filter_map(pick))
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

/// The runs of equal keys in a column: (key, first row, number of rows).
pub(super) fn spans_of(kind: &str, keys: &StringArray) -> Result<Vec<(Digest, usize, usize)>, StoreError> {
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
