//! Record batches of a table: built with its schema, and checked against it column by column.

use super::cell::refuse_nan;
use super::{Cell, ColumnSpec, ColumnType, Fault, TableError, TableSpec};
use arrow::array::{Array, ArrayRef, RecordBatch};
use arrow::datatypes::{DataType, Field, Schema};
use std::collections::HashMap;
use std::sync::Arc;

/// Schema metadata key of the table's name.
const TABLE: &str = "table";
/// Schema metadata key of the schema's version.
pub(super) const VERSION: &str = "schema_version";
/// Field metadata key of the unit.
const UNIT: &str = "unit";
/// Field metadata key of the meaning.
const MEANING: &str = "meaning";

/// The Arrow type of a column type.
pub(super) fn arrow_type(column_type: ColumnType) -> DataType {
    match column_type {
        ColumnType::U32 => DataType::UInt32,
        ColumnType::U64 => DataType::UInt64,
        ColumnType::F64 => DataType::Float64,
        ColumnType::Bool => DataType::Boolean,
        ColumnType::Text => DataType::Utf8,
    }
}

/// The explicit Arrow schema of a table: types, nullability, and unit and meaning as field metadata.
pub(super) fn arrow_schema(spec: &TableSpec) -> Schema {
    let fields: Vec<Field> = spec.columns.iter().map(arrow_field).collect();
    Schema::new(fields).with_metadata(HashMap::from([
        (TABLE.to_owned(), spec.name.to_owned()),
        (VERSION.to_owned(), spec.version.to_string()),
    ]))
}

fn arrow_field(column: &ColumnSpec) -> Field {
    Field::new(column.name, arrow_type(column.column_type), column.nullable).with_metadata(HashMap::from([
        (UNIT.to_owned(), column.unit.to_owned()),
        (MEANING.to_owned(), column.meaning.to_owned()),
    ]))
}

/// A batch of `spec` from its columns in order; used by [`table!`](crate::table).
///
/// # Errors
/// [`Fault::NotANumber`] for a NaN.
pub fn to_batch(spec: &TableSpec, columns: Vec<ArrayRef>) -> Result<RecordBatch, TableError> {
    for (column, array) in spec.columns.iter().zip(&columns) {
        refuse_nan(column.name, array).map_err(|fault| TableError::in_memory(spec.name, fault))?;
    }
    assemble(spec, columns)
}

/// A batch with the schema of `spec`; the columns have been made or checked for it.
fn assemble(spec: &TableSpec, columns: Vec<ArrayRef>) -> Result<RecordBatch, TableError> {
    RecordBatch::try_new(Arc::new(arrow_schema(spec)), columns)
        .map_err(|e| TableError::in_memory(spec.name, Fault::Parquet { detail: e.to_string() }))
}

/// The same columns under the name and version of `spec`, which must fit them in order, type and nulls.
pub(super) fn stamp(spec: &TableSpec, batch: &RecordBatch) -> Result<RecordBatch, TableError> {
    assemble(spec, batch.columns().to_vec())
}

/// Checks a batch against `spec`: table, version, and every column's presence, type, unit and nulls. Gives it back with
/// exactly the schema of `spec`, its columns in that order.
///
/// Metadata that is absent is not an error: another tool may have rewritten the file without it.
///
/// # Errors
/// [`TableError`] naming the first column that does not match.
pub fn conform(spec: &TableSpec, batch: &RecordBatch) -> Result<RecordBatch, TableError> {
    let columns = matching_columns(spec, batch).map_err(|fault| TableError::in_memory(spec.name, fault))?;
    assemble(spec, columns)
}

fn matching_columns(spec: &TableSpec, batch: &RecordBatch) -> Result<Vec<ArrayRef>, Fault> {
    check_identity(spec, batch.schema_ref())?;
    if let Some(extra) = batch.schema_ref().fields().iter().find(|field| spec.column(field.name()).is_none()) {
        return Err(Fault::UnknownColumn { column: extra.name().clone() });
    }
    spec.columns.iter().map(|column| matching_column(column, batch)).collect()
}

fn check_identity(spec: &TableSpec, schema: &Schema) -> Result<(), Fault> {
    if let Some(found) = schema.metadata().get(TABLE).filter(|found| *found != spec.name) {
        return Err(Fault::WrongTable { found: found.clone() });
    }
    match schema.metadata().get(VERSION).filter(|found| **found != spec.version.to_string()) {
        Some(found) => Err(Fault::WrongVersion { found: found.clone(), expected: spec.version }),
        None => Ok(()),
    }
}

fn matching_column(column: &ColumnSpec, batch: &RecordBatch) -> Result<ArrayRef, Fault> {
    let (field, array) = find(column, batch)?;
    if field.data_type() != &arrow_type(column.column_type) {
        return Err(wrong_type(column, field.data_type()));
    }
    if let Some(found) = field.metadata().get(UNIT).filter(|found| *found != column.unit) {
        let (name, expected) = (column.name.to_owned(), column.unit.to_owned());
        return Err(Fault::WrongUnit { column: name, expected, found: found.clone() });
    }
    check_nulls(column, array)?;
    Ok(array.clone())
}

/// The field and the array of a column, by name.
pub(super) fn find<'a>(column: &ColumnSpec, batch: &'a RecordBatch) -> Result<(&'a Field, &'a ArrayRef), Fault> {
    let missing = || Fault::MissingColumn { column: column.name.to_owned(), expected: column.column_type };
    let (at, field) = batch.schema_ref().column_with_name(column.name).ok_or_else(missing)?;
    Ok((field, batch.column(at)))
}

/// The error of a column of another type.
pub(super) fn wrong_type(column: &ColumnSpec, found: &DataType) -> Fault {
    let name = column.name.to_owned();
    Fault::WrongType { column: name, expected: column.column_type, found: found.to_string() }
}

/// Refuses nulls where the table allows none, whatever the file's own schema claims.
pub(super) fn check_nulls(column: &ColumnSpec, array: &ArrayRef) -> Result<(), Fault> {
    let first = (0..array.len()).find(|&row| array.is_null(row) && !column.nullable);
    match first {
        Some(at) => {
            let count = array.null_count();
            Err(Fault::MissingValues { column: column.name.to_owned(), count, row: at + 1 })
        }
        None => Ok(()),
    }
}

/// A batch that has passed [`conform`]; gives typed columns to [`table!`](crate::table).
#[derive(Debug, Clone)]
pub struct Checked {
    spec: &'static TableSpec,
    batch: RecordBatch,
}

impl Checked {
    /// Checks a batch.
    ///
    /// # Errors
    /// As [`conform`].
    pub fn new(spec: &'static TableSpec, batch: &RecordBatch) -> Result<Self, TableError> {
        matching_columns(spec, batch).map_err(|fault| TableError::in_memory(spec.name, fault))?;
        Ok(Self { spec, batch: batch.clone() })
    }

    /// Checks the columns of these names, the only ones there.
    ///
    /// # Errors
    /// As [`conform`].
    pub(super) fn columns(spec: &'static TableSpec, batch: RecordBatch, names: &[&str]) -> Result<Self, TableError> {
        let named = spec.columns.iter().filter(|column| names.contains(&column.name));
        let check = || -> Result<(), Fault> {
            check_identity(spec, batch.schema_ref())?;
            named.map(|column| matching_column(column, &batch)).try_for_each(|column| column.map(drop))
        };
        check().map_err(|fault| TableError::in_memory(spec.name, fault))?;
        Ok(Self { spec, batch })
    }

    /// The columns.
    pub fn batch(&self) -> &RecordBatch {
        &self.batch
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.batch.num_rows()
    }

    /// The typed array of a column.
    ///
    /// # Errors
    /// [`Fault::WrongType`] or [`Fault::MissingColumn`] when the field's type is not the one in the spec.
    pub fn column<C: Cell>(&self, name: &str) -> Result<&C::Array, TableError> {
        let fail = |fault| TableError::in_memory(self.spec.name, fault);
        let array = self.batch.column_by_name(name);
        let array = array.ok_or_else(|| fail(Fault::MissingColumn { column: name.to_owned(), expected: C::TYPE }))?;
        array.as_any().downcast_ref::<C::Array>().ok_or_else(|| {
            let found = array.data_type().to_string();
            fail(Fault::WrongType { column: name.to_owned(), expected: C::TYPE, found })
        })
    }
}
