//! Where the tables of the stages lie, and how one is split into files.
//!
//! ```text
//! tables/aggregates/aggregates.parquet                   one file
//! tables/kpis/experiment=pile/part-<digest>.parquet      split by a column, rows sorted by the table's key
//! tables/kpis/manifest.json                              lists the live parts, renamed into place last
//! ```
//!
//! A table has one **index**: the file whose digest stands for the whole, which is the manifest of a split table. Parts
//! carry their digest in the name, so a part never changes under a reader that holds the manifest.

use super::{StoreError, TABLES, atomic};
use crate::canonical::Digest;
use crate::tables::{Row, TableError, TableSpec, io};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
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

/// The files of a table with these rows, relative to the artifacts directory, in the order in which they are to be
/// published: the index last.
///
/// # Errors
/// A value that cannot be stored, such as NaN.
pub fn files<R: Row + Clone>(spec: &TableSpec, mut rows: Vec<R>) -> Result<Vec<(String, Vec<u8>)>, TableError> {
    rows.sort_by(R::order);
    let Some(column) = spec.partitioned_by else {
        return Ok(vec![(index(spec), io::encode(spec, &R::to_batch(&rows)?)?)]);
    };
    let mut groups: BTreeMap<String, Vec<R>> = BTreeMap::new();
    for row in rows {
        groups.entry(row.partition().to_owned()).or_default().push(row);
    }
    let mut manifest = Manifest { table: spec.name.to_owned(), parts: Vec::new() };
    let mut files = Vec::new();
    for (value, rows) in groups {
        let bytes = io::encode(spec, &R::to_batch(&rows)?)?;
        let part = format!("{column}={value}/part-{}.parquet", Digest::of_content(&bytes));
        files.push((format!("{TABLES}/{}/{part}", spec.name), bytes));
        manifest.parts.push(part);
    }
    // Serialising texts cannot fail; an empty manifest would be refused when it is read.
    let text = serde_json::to_string_pretty(&manifest).unwrap_or_default() + "\n";
    files.push((index(spec), text.into_bytes()));
    Ok(files)
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
    let bytes = std::fs::read(&path).map_err(StoreError::io("read", &path))?;
    let bad = |detail: String| StoreError::BadIndex { path: path.clone(), detail };
    let manifest: Manifest = serde_json::from_slice(&bytes).map_err(|e| bad(e.to_string()))?;
    let folder = path.parent().unwrap_or(root);
    let plain = |part: &&String| !part.split('/').all(|name| !name.is_empty() && name != ".." && name != ".");
    match manifest.parts.iter().find(plain) {
        Some(part) => Err(bad(format!("`{part}` is no path of a part"))),
        None if manifest.table != spec.name => Err(bad(format!("it belongs to table {}", manifest.table))),
        None => Ok(manifest.parts.iter().map(|part| folder.join(part)).collect()),
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
pub fn text_counts(root: &Path, spec: &TableSpec, column: &str) -> Result<BTreeMap<String, u64>, StoreError> {
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
