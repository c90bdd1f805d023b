//! What can be wrong with a table: where (file, table, column, row), what, and what to do.

use super::ColumnType;

/// A table that cannot be written or read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{origin}: table `{table}`: {fault}")]
pub struct TableError {
    /// The file, or `rows in memory`.
    pub origin: String,
    /// Name of the table that was wanted.
    pub table: String,
    /// What is wrong.
    pub fault: Box<Fault>,
}

impl TableError {
    /// A fault of rows that have not come from a file.
    pub fn in_memory(table: &str, fault: Fault) -> Self {
        Self { origin: "rows in memory".to_owned(), table: table.to_owned(), fault: Box::new(fault) }
    }

    /// Whether the file was written with an earlier version of the schema.
    pub fn is_of_earlier_version(&self) -> bool {
        matches!(&*self.fault, Fault::WrongVersion { found, expected } if found.parse().is_ok_and(|found: u32| found < *expected))
    }

    /// The same error with the file it was found in.
    #[must_use]
    pub fn at(self, origin: &str) -> Self {
        Self { origin: origin.to_owned(), ..self }
    }
}

/// The kinds of faults of a table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// A column of the table is absent.
    #[error("column `{column}` ({}) is missing; it was written by something else, remove it and run `repro`", expected.name())]
    MissingColumn {
        /// Name of the column.
        column: String,
        /// Its type.
        expected: ColumnType,
    },
    /// A column the table does not have.
    #[error("column `{column}` is not known; it was written by another version, remove it and run `repro`")]
    UnknownColumn {
        /// Name of the column.
        column: String,
    },
    /// A column of another type.
    #[error("column `{column}` has type {found}, expected {}; write it with that type", expected.name())]
    WrongType {
        /// Name of the column.
        column: String,
        /// Expected type.
        expected: ColumnType,
        /// Type found.
        found: String,
    },
    /// A column in another unit.
    #[error("column `{column}` has unit `{found}`, expected `{expected}`; convert it or run `repro`")]
    WrongUnit {
        /// Name of the column.
        column: String,
        /// Expected unit.
        expected: String,
        /// Unit found.
        found: String,
    },
    /// Missing values where none may be.
    #[error("column `{column}` misses {count} values, the first in row {row}, but none may be missing")]
    MissingValues {
        /// Name of the column.
        column: String,
        /// How many are missing.
        count: usize,
        /// First row, counted from 1.
        row: usize,
    },
    /// A NaN.
    #[error("column `{column}`, row {row}: NaN cannot be stored; store a null and a reason instead")]
    NotANumber {
        /// Name of the column.
        column: String,
        /// Row, counted from 1.
        row: usize,
    },
    /// A value that does not fit the type of the column.
    #[error("column `{column}`: {detail}; give whole numbers from 0 where a count is expected")]
    OutOfRange {
        /// Name of the column.
        column: String,
        /// What did not fit.
        detail: String,
    },
    /// The file holds another table.
    #[error("this is table `{found}`")]
    WrongTable {
        /// Name found in the file.
        found: String,
    },
    /// The file was written with another version of the schema.
    #[error("schema version {found}, this program reads {expected}; move it away and run `repro`")]
    WrongVersion {
        /// Version found in the file.
        found: String,
        /// Version of this program.
        expected: u32,
    },
    /// Columns of different length.
    #[error("column `{column}` has {found} values, expected {expected}")]
    WrongLength {
        /// Name of the column.
        column: String,
        /// Length of the columns before it.
        expected: usize,
        /// Its own length.
        found: usize,
    },
    /// The bytes are not a whole Parquet file.
    #[error("not a readable Parquet file ({detail}); run `fsck`, then `repro`")]
    Parquet {
        /// What the reader said.
        detail: String,
    },
    /// The file could not be read from disk.
    #[error("cannot be read ({detail}); check the path and its permissions")]
    Unreadable {
        /// What the operating system said.
        detail: String,
    },
}
