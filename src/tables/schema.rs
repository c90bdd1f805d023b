//! JSON descriptions of tables, for `schemas/<table>.json`.
//!
//! Deterministic text: fields in declaration order, two spaces, a line feed at the end, so that a test can compare the
//! committed file with the declaration byte by byte.

use super::{ColumnSpec, TableSpec};
use serde::Serialize;

#[derive(Serialize)]
struct TableJson<'a> {
    table: &'a str,
    version: u32,
    meaning: &'a str,
    sorted_by: &'a [&'a str],
    #[serde(skip_serializing_if = "Option::is_none")]
    keyed_by: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    partitioned_by: Option<&'a str>,
    columns: Vec<ColumnJson<'a>>,
}

#[derive(Serialize)]
struct ColumnJson<'a> {
    name: &'a str,
    r#type: &'a str,
    unit: &'a str,
    nullable: bool,
    meaning: &'a str,
}

/// The description of a table as JSON text.
///
/// ```
/// # granulake::table! {
/// #     /// One row per run.
/// #     pub struct RunRow in "runs" version 1 sorted by (seed) { /// Seed of the run.
/// #         seed: u64 ["1"] }
/// # }
/// let text = granulake::tables::schema::describe(<RunRow as granulake::tables::Row>::SPEC);
/// assert!(text.contains("\"name\": \"seed\",\n      \"type\": \"u64\""));
/// ```
pub fn describe(spec: &TableSpec) -> String {
    let json = TableJson {
        table: spec.name,
        version: spec.version,
        meaning: spec.meaning,
        sorted_by: spec.sorted_by,
        keyed_by: spec.keyed_by,
        partitioned_by: spec.partitioned_by,
        columns: spec.columns.iter().map(describe_column).collect(),
    };
    // Serialising text, numbers and lists of them cannot fail; an empty text would fail the schema test.
    serde_json::to_string_pretty(&json).unwrap_or_default() + "\n"
}

fn describe_column(column: &ColumnSpec) -> ColumnJson<'_> {
    ColumnJson {
        name: column.name,
        r#type: column.column_type.name(),
        unit: column.unit,
        nullable: column.nullable,
        meaning: column.meaning,
    }
}
