//! Untyped columns: named numbers of equal length, such as the final state of a run or a trace over time.
//!
//! The names belong to whoever writes the state; here they are only kept, with their units, in the order given.

use super::cell::refuse_nan;
use super::io::{parquet_fault, read_batches, read_bytes, write_batch};
use super::{Fault, TableError};
use arrow::array::{Array, ArrayRef, Float64Array, RecordBatch, UInt32Array};
use arrow::datatypes::{DataType, Field, Schema};
use bytes::Bytes;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Field metadata key of the unit.
const UNIT: &str = "unit";

/// The values of one column.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers, none of them NaN.
    F64(Vec<f64>),
    /// Counts and indices.
    U32(Vec<u32>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::F64(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    fn into_array(self) -> (DataType, ArrayRef) {
        match self {
            Self::F64(values) => (DataType::Float64, Arc::new(Float64Array::from(values))),
            Self::U32(values) => (DataType::UInt32, Arc::new(UInt32Array::from(values))),
        }
    }

    fn from_array(array: &dyn Array) -> Option<Self> {
        if array.null_count() > 0 {
            return None;
        }
        let any = array.as_any();
        let floats = any.downcast_ref::<Float64Array>().map(|a| Self::F64(a.values().to_vec()));
        floats.or_else(|| any.downcast_ref::<UInt32Array>().map(|a| Self::U32(a.values().to_vec())))
    }
}

/// A named column with its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, unique in its file.
    pub name: String,
    /// Unit text; `1` for pure numbers.
    pub unit: String,
    /// The values.
    pub values: Values,
}

impl Column {
    /// A column of numbers.
    pub fn f64(name: &str, unit: &str, values: Vec<f64>) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), values: Values::F64(values) }
    }

    /// A column of counts or indices.
    pub fn u32(name: &str, unit: &str, values: Vec<u32>) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), values: Values::U32(values) }
    }
}

/// Columns of equal length, in the order they are stored.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ColumnFile {
    columns: Vec<Column>,
}

impl ColumnFile {
    /// A file of these columns; `kind` (such as `state`) names it in errors.
    ///
    /// # Errors
    /// [`Fault::WrongLength`] naming the first column that is longer or shorter than the first.
    pub fn new(kind: &str, columns: Vec<Column>) -> Result<Self, TableError> {
        let expected = columns.first().map_or(0, |column| column.values.len());
        match columns.iter().find(|column| column.values.len() != expected) {
            Some(odd) => {
                let (column, found) = (odd.name.clone(), odd.values.len());
                Err(TableError::in_memory(kind, Fault::WrongLength { column, expected, found }))
            }
            None => Ok(Self { columns }),
        }
    }

    /// The columns in order.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |column| column.values.len())
    }

    /// The numbers of a column, or nothing when there is no such column of numbers.
    pub fn f64(&self, name: &str) -> Option<&[f64]> {
        match &self.column(name)?.values {
            Values::F64(values) => Some(values),
            Values::U32(_) => None,
        }
    }

    /// The counts of a column, or nothing when there is no such column of counts.
    pub fn u32(&self, name: &str) -> Option<&[u32]> {
        match &self.column(name)?.values {
            Values::U32(values) => Some(values),
            Values::F64(_) => None,
        }
    }

    fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// The Parquet bytes: as deterministic as those of a table.
    ///
    /// # Errors
    /// [`Fault::NotANumber`] for a NaN, which a state that has not diverged does not hold.
    pub fn to_parquet_bytes(self, kind: &str) -> Result<Vec<u8>, TableError> {
        let fail = |fault| TableError::in_memory(kind, fault);
        let batch = self.into_batch(kind).map_err(fail)?;
        write_batch(&batch).map_err(|e| fail(parquet_fault(&e)))
    }

    fn into_batch(self, kind: &str) -> Result<RecordBatch, Fault> {
        let mut fields = Vec::with_capacity(self.columns.len());
        let mut arrays = Vec::with_capacity(self.columns.len());
        for column in self.columns {
            let (data_type, array) = column.values.into_array();
            refuse_nan(&column.name, &array)?;
            let unit = HashMap::from([(UNIT.to_owned(), column.unit)]);
            fields.push(Field::new(column.name, data_type, false).with_metadata(unit));
            arrays.push(array);
        }
        let schema = Schema::new(fields).with_metadata(HashMap::from([("table".to_owned(), kind.to_owned())]));
        RecordBatch::try_new(Arc::new(schema), arrays).map_err(|e| Fault::Parquet { detail: e.to_string() })
    }

    /// The columns in the bytes of a file; `origin` names it in errors.
    ///
    /// # Errors
    /// [`Fault::Parquet`], [`Fault::WrongTable`], or [`Fault::WrongType`] for a column of any other type or with nulls.
    pub fn from_parquet_bytes(kind: &str, origin: &str, bytes: impl Into<Bytes>) -> Result<Self, TableError> {
        let fail = |fault| TableError::in_memory(kind, fault).at(origin);
        let batch = read_batches(bytes.into(), false).map_err(|e| fail(parquet_fault(&e)))?;
        if let Some(found) = batch.schema_ref().metadata().get("table").filter(|found| *found != kind) {
            return Err(fail(Fault::WrongTable { found: found.clone() }));
        }
        Self::from_batch(&batch).map_err(fail)
    }

    /// The columns of a file.
    ///
    /// # Errors
    /// As [`ColumnFile::from_parquet_bytes`], and [`Fault::Unreadable`].
    pub fn read(kind: &str, path: &Path) -> Result<Self, TableError> {
        Self::from_parquet_bytes(kind, &path.display().to_string(), read_bytes(kind, path)?)
    }

    fn from_batch(batch: &RecordBatch) -> Result<Self, Fault> {
        let pairs = batch.schema_ref().fields().iter().zip(batch.columns());
        let columns: Result<Vec<_>, _> = pairs.map(|(field, array)| stored_column(field, array)).collect();
        Ok(Self { columns: columns? })
    }
}

fn stored_column(field: &Field, array: &ArrayRef) -> Result<Column, Fault> {
    let values = Values::from_array(array).ok_or_else(|| Fault::WrongType {
        column: field.name().clone(),
        expected: super::ColumnType::F64,
        found: format!("{} with {} nulls", field.data_type(), array.null_count()),
    })?;
    let unit = field.metadata().get(UNIT).cloned().unwrap_or_default();
    Ok(Column { name: field.name().clone(), unit, values })
}
