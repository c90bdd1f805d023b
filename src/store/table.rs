//! Where the tables of the stages lie, and how one is split into files.
//!
//! ```text
//! tables/samples/samples.parquet                         one file
//! tables/kpis/experiment=pile/part-<digest>.parquet      split by a column, rows sorted by the table's key
//! tables/kpis/manifest.json                              lists the live parts, renamed into place last
//! ```
//!
//! A table has one **index**: the file whose digest stands for the whole, which is the manifest of a split table. Parts
//! carry their digest in the name, so a part never changes under a reader that holds the manifest. A table that grows with
//! the repetitions has a part for every one of the [`blocks`] of them, so that one more writes one small part.

use super::{StoreError, TABLES, atomic};
use crate::canonical::Digest;
use crate::tables::{Row, TableError, TableSpec, io};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

const MANIFEST: &str = "manifest.json";

/// The live parts of a split table.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    table: String,
    /// Paths relative to the folder of the table.
    parts: Vec<String>,
}

/// The index of a table, relative to the artifacts directory.
pub fn index(spec: &TableSpec) -> String {
    let file = if spec.partitioned_by.is_some() { MANIFEST.to_owned() } else { format!("{}.parquet", spec.name) };
    format!("{TABLES}/{}/{file}", spec.name)
}

/// Repetitions in one part, at most.
const MOST_REPETITIONS: u32 = 64;
/// Runs in one part, at most, unless one repetition has more.
const MOST_RUNS: u32 = 1 << 13;

/// The repetitions 1..=`last` of `points` points in blocks, each a part of a table: as many of the largest size as there
/// are, then the rest by its binary digits. The largest is 64 repetitions or the power of two that has at most 8,192 runs, at
/// least one. So one repetition more writes one repetition or merges a few small blocks, never more than the largest.
pub fn blocks(last: u32, points: usize) -> Vec<RangeInclusive<u32>> {
    let points = u32::try_from(points).unwrap_or(u32::MAX).max(1);
    let largest = MOST_REPETITIONS.min(1 << (MOST_RUNS / points).max(1).ilog2());
    let mut blocks = Vec::new();
    let mut first = 1;
    while first <= last {
        let size = largest.min(1 << (last - first + 1).ilog2());
        blocks.push(first..=first + size - 1);
        first += size;
    }
    blocks
}

/// A part of a split table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Value of the column by which the table is split.
    pub value: String,
    /// Digest of its bytes.
    pub digest: Digest,
}

impl Part {
    fn of_name(name: &str) -> Option<Self> {
        let (folder, file) = name.split_once('/')?;
        let digest = file.strip_prefix("part-")?.strip_suffix(".parquet")?.parse().ok()?;
        Some(Self { value: folder.split_once('=')?.1.to_owned(), digest })
    }

    /// The part at a path, relative to the artifacts directory.
    pub fn of_path(path: &str) -> Option<Self> {
        Self::of_name(path.strip_prefix(TABLES)?.strip_prefix('/')?.split_once('/')?.1)
    }

    fn name(&self, spec: &TableSpec) -> String {
        format!("{}={}/part-{}.parquet", spec.partitioned_by.unwrap_or_default(), self.value, self.digest)
    }

    /// Its path, relative to the artifacts directory.
    pub fn path(&self, spec: &TableSpec) -> String {
        format!("{TABLES}/{}/{}", spec.name, self.name(spec))
    }
}

/// The part of these rows, which belong to one part of a split table, and its bytes.
///
/// # Errors
/// A value that cannot be stored, such as NaN.
pub fn part<R: Row>(spec: &TableSpec, value: &str, mut rows: Vec<R>) -> Result<(Part, Vec<u8>), TableError> {
    rows.sort_by(R::order);
    let bytes = io::encode(spec, &R::to_batch(&rows)?)?;
    Ok((Part { value: value.to_owned(), digest: Digest::of_content(&bytes) }, bytes))
}

/// Path and bytes of the manifest of a split table.
pub fn manifest(spec: &TableSpec, parts: &[Part]) -> (String, Vec<u8>) {
    let parts = parts.iter().map(|part| part.name(spec)).collect();
    // Serialising texts cannot fail; an empty manifest would be refused when it is read.
    let text = serde_json::to_string_pretty(&Manifest { table: spec.name.to_owned(), parts }).unwrap_or_default();
    (index(spec), (text + "\n").into_bytes())
}

/// The files of a table with these rows, relative to the artifacts directory, in the order in which they are to be
/// published: the index last. A split table has one part per value.
///
/// # Errors
/// A value that cannot be stored, such as NaN.
pub fn files<R: Row>(spec: &TableSpec, mut rows: Vec<R>) -> Result<Vec<(String, Vec<u8>)>, TableError> {
    if spec.partitioned_by.is_none() {
        rows.sort_by(R::order);
        return Ok(vec![(index(spec), io::encode(spec, &R::to_batch(&rows)?)?)]);
    }
    let mut groups: BTreeMap<String, Vec<R>> = BTreeMap::new();
    for row in rows {
        groups.entry(row.partition().to_owned()).or_default().push(row);
    }
    let (mut parts, mut files) = (Vec::new(), Vec::new());
    for (value, rows) in groups {
        let (part, bytes) = part(spec, &value, rows)?;
        files.push((part.path(spec), bytes));
        parts.push(part);
    }
    files.push(manifest(spec, &parts));
    Ok(files)
}

/// The parts of a split table in the artifacts directory `root`, in the order of its manifest.
///
/// # Errors
/// As [`data_files`].
pub fn parts(root: &Path, spec: &TableSpec) -> Result<Vec<Part>, StoreError> {
    let named = read_manifest(root, spec)?;
    let part = |name: &String| {
        let detail = format!("`{name}` is no name of a part");
        Part::of_name(name).ok_or_else(|| StoreError::BadIndex { path: root.join(index(spec)), detail })
    };
    named.iter().map(part).collect()
}

/// The data files of a table in the artifacts directory `root`.
///
/// # Errors
/// [`StoreError::Io`] or [`StoreError::BadIndex`] for a manifest that is missing or damaged.
pub fn data_files(root: &Path, spec: &TableSpec) -> Result<Vec<PathBuf>, StoreError> {
    let path = root.join(index(spec));
    if spec.partitioned_by.is_none() {
        return Ok(vec![path]);
    }
    let folder = path.parent().unwrap_or(root);
    Ok(read_manifest(root, spec)?.iter().map(|part| folder.join(part)).collect())
}

/// The names of the parts in the manifest of a split table.
fn read_manifest(root: &Path, spec: &TableSpec) -> Result<Vec<String>, StoreError> {
    let path = root.join(index(spec));
    let bytes = std::fs::read(&path).map_err(StoreError::io("read", &path))?;
    let bad = |detail: String| StoreError::BadIndex { path: path.clone(), detail };
    let manifest: Manifest = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
    let plain = |part: &&String| !part.split('/').all(|name| !name.is_empty() && name != ".." && name != ".");
    match manifest.parts.iter().find(plain) {
        Some(part) => Err(bad(format!("`{part}` is no path of a part"))),
        None if manifest.table != spec.name => Err(bad(format!("it belongs to table {}", manifest.table))),
        None => Ok(manifest.parts),
    }
}

/// The rows of a table, sorted by its key.
///
/// # Errors
/// As [`data_files`]; a file that is missing or does not fit the schema.
pub fn read<R: Row>(root: &Path, spec: &TableSpec) -> Result<Vec<R>, StoreError> {
    let mut rows: Vec<R> = Vec::new();
    for path in data_files(root, spec)? {
        rows.extend(io::read_table_as::<R>(spec, &path)?);
    }
    rows.sort_by(R::order);
    Ok(rows)
}

/// How often every value of a text column occurs in a table; nothing in one that has not been written.
///
/// # Errors
/// As [`data_files`]; a file that is missing or does not fit the schema.
pub fn text_counts(root: &Path, spec: &'static TableSpec, column: &str) -> Result<BTreeMap<String, u64>, StoreError> {
    let mut all = BTreeMap::new();
    if !root.join(index(spec)).is_file() {
        return Ok(all);
    }
    for path in data_files(root, spec)? {
        for (value, count) in io::text_counts(spec, &path, column)? {
            *all.entry(value).or_insert(0) += count;
        }
    }
    Ok(all)
}

/// Files in the folder of a table that `listed` (paths relative to the artifacts directory) does not name: parts of an
/// earlier version that a killed process left behind.
///
/// # Errors
/// [`StoreError::Io`].
pub fn leftovers(root: &Path, spec: &TableSpec, listed: &BTreeSet<&str>) -> Result<Vec<String>, StoreError> {
    let mut found = Vec::new();
    for entry in atomic::list(&root.join(TABLES).join(spec.name))? {
        let inner = if entry.is_dir() { atomic::list(&entry)? } else { vec![entry] };
        let relative = |path: &PathBuf| Some(path.strip_prefix(root).ok()?.to_str()?.replace('\\', "/"));
        found.extend(inner.iter().filter_map(relative));
    }
    let hidden = |path: &String| path.rsplit('/').next().is_some_and(|name| name.starts_with(atomic::TEMPORARY));
    found.retain(|path| !listed.contains(path.as_str()) && !hidden(path));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_every_repetition_once_and_most_stay_when_they_grow() {
        let sizes = |last, points| blocks(last, points).iter().map(|block| block.clone().count()).collect::<Vec<_>>();
        assert_eq!(sizes(0, 127), [0; 0]);
        assert_eq!((sizes(3, 127), sizes(50, 127), sizes(64, 127)), (vec![2, 1], vec![32, 16, 2], vec![64]));
        assert_eq!((sizes(135, 128), sizes(135, 256)), (vec![64, 64, 4, 2, 1], vec![32, 32, 32, 32, 4, 2, 1]));
        assert_eq!((sizes(5, 2048), sizes(2, 6350)), (vec![4, 1], vec![1, 1]));
        for points in [100, 2048] {
            let mut written = 0;
            for last in 1..1000 {
                let (now, next) = (blocks(last, points), blocks(last + 1, points));
                assert!(now.iter().cloned().flatten().eq(1..=last), "{last}");
                let new: usize = next.iter().filter(|block| !now.contains(block)).map(|b| b.clone().count()).sum();
                assert!(new == 1 || new * points <= MOST_RUNS as usize, "{last}: {new}");
                written += new;
            }
            assert!(written < 7 * 1000, "adding one at a time writes each fewer than seven times: {written}");
        }
    }
}
