//! Tables: the contracts between stages, as Rust rows and as Parquet bytes.
//!
//! One [`table!`](crate::table) declaration gives a documented row struct, its static [`TableSpec`] (name, version,
//! columns with type, unit and meaning, sort key) and the conversion to and from Arrow with an explicit schema.
//! [`io`] turns rows into bytes and back, [`columns`] does the same for untyped columns such as particle states,
//! [`schema`] describes a table as JSON for `schemas/`.
//!
//! Takes rows, gives bytes. Deliberately absent: paths to write to, keys and locks (see `store`), and any query.

mod batch;
mod cell;
pub mod columns;
mod declare;
mod error;
pub mod io;
pub mod list;
pub mod schema;

use std::cmp::Ordering;

pub use arrow::array::RecordBatch;
pub use batch::{Checked, conform, to_batch};
pub use cell::Cell;
pub use error::{Fault, TableError};
pub use list::*;

/// The type of a column, which is one of five.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnType {
    /// Unsigned 32-bit integer: counts, 1-based numbers.
    U32,
    /// Unsigned 64-bit integer: seeds.
    U64,
    /// Double precision number; never NaN in a stored table.
    F64,
    /// Truth value.
    Bool,
    /// UTF-8 text.
    Text,
}

impl ColumnType {
    /// The name used in `schemas/*.json` and in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::U32 => "u32",
            Self::U64 => "u64",
            Self::F64 => "f64",
            Self::Bool => "bool",
            Self::Text => "string",
        }
    }
}

/// One column of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ColumnSpec {
    /// Name, the same in Rust, Parquet and JSON.
    pub name: &'static str,
    /// Type of the values.
    pub column_type: ColumnType,
    /// Unit text such as `kg/m3`; `1` for pure numbers, empty where a unit makes no sense.
    pub unit: &'static str,
    /// Whether a value may be missing.
    pub nullable: bool,
    /// What the column means, in a sentence.
    pub meaning: &'static str,
}

impl ColumnSpec {
    /// The column of a field of type `C`; used by [`table!`](crate::table).
    ///
    /// # Panics
    /// At compile time, when `meaning` is empty.
    pub const fn of<C: Cell>(name: &'static str, unit: &'static str, meaning: &'static str) -> Self {
        let meaning = meaning.trim_ascii();
        assert!(!meaning.is_empty(), "every column of a table needs a doc comment");
        Self { name, column_type: C::TYPE, unit, nullable: C::NULLABLE, meaning }
    }
}

/// Everything that is fixed about a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TableSpec {
    /// Name, also the folder under `artifacts/tables/`.
    pub name: &'static str,
    /// Version of the schema; raise it when a column or the meaning of one changes.
    pub version: u32,
    /// What a row is, in a sentence.
    pub meaning: &'static str,
    /// The columns in order.
    pub columns: &'static [ColumnSpec],
    /// Columns by which stored rows are sorted, most significant first.
    pub sorted_by: &'static [&'static str],
    /// Column that holds the key of a ledger row, for tables that are kept in a ledger.
    pub keyed_by: Option<&'static str>,
    /// Text column by whose values the table is split into files; `None` is one file.
    pub partitioned_by: Option<&'static str>,
}

impl TableSpec {
    /// The column of that name.
    pub fn column(&self, name: &str) -> Option<&ColumnSpec> {
        self.columns.iter().find(|column| column.name == name)
    }
}

/// The one column that a declaration may name; used by [`table!`](crate::table).
pub const fn one_of(names: &[&'static str]) -> Option<&'static str> {
    match names {
        [name, ..] => Some(name),
        [] => None,
    }
}

/// A row of a table; implemented by [`table!`](crate::table) only.
pub trait Row: Sized {
    /// The table this is a row of.
    const SPEC: &'static TableSpec;

    /// Rows as columns, in the order given.
    ///
    /// # Errors
    /// [`Fault::NotANumber`] for a NaN: a missing value is a null with a reason beside it.
    fn to_batch(rows: &[Self]) -> Result<RecordBatch, TableError>;

    /// Columns as rows, in the order stored.
    ///
    /// # Errors
    /// [`TableError`] naming the first column that does not match [`Row::SPEC`].
    fn from_batch(batch: &RecordBatch) -> Result<Vec<Self>, TableError> {
        let checked = Checked::new(Self::SPEC, batch)?;
        Self::from_checked(&checked, 0..checked.rows())
    }

    /// Some rows of columns that have been checked; the range lies within them.
    ///
    /// # Errors
    /// [`TableError`] when they are the columns of another table.
    fn from_checked(checked: &Checked, rows: std::ops::Range<usize>) -> Result<Vec<Self>, TableError>;

    /// Value of the column by which the table is split into files; empty for a table in one file.
    fn partition(&self) -> &str;

    /// The order of stored rows: by the sort key, text by bytes, null before any value.
    fn order(&self, other: &Self) -> Ordering;
}

/// A row that can be kept in a ledger: one column holds the key, 64 hexadecimal digits.
pub trait Keyed: Row {
    /// Name of the key column.
    const KEY: &'static str;

    /// The key of this row.
    fn key(&self) -> &str;
}
