//! Rows to Parquet bytes and back.
//!
//! The same rows give the same bytes on every machine: sorted by the table's key, one fixed set of writer properties
//! (zstd, floats as BYTE_STREAM_SPLIT without a dictionary, a fixed `created_by`), and no time, host or path inside.
//! Publishing the bytes under a name is the store's affair.

use super::batch::{VERSION, arrow_type, check_nulls, find, stamp, wrong_type};
use super::{Checked, ColumnSpec, ColumnType, Fault, Row, TableError, TableSpec, conform};
use arrow::array::{ArrayRef, RecordBatch, RecordBatchReader};
use arrow::compute::{CastOptions, cast_with_options, concat_batches};
use arrow::datatypes::{DataType, Schema};
use bytes::Bytes;
use parquet::arrow::arrow_reader::{ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use parquet::arrow::{ArrowWriter, ProjectionMask};
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaDataReader;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::schema::types::ColumnPath;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

/// The writer named in every file; never the version, which would move every digest with each release.
const CREATED_BY: &str = "granulake";
/// Rows decoded at a time, which bounds what a forged row count can make the reader allocate.
const READ_ROWS: usize = 1 << 17;

/// The Parquet bytes of a table, its rows sorted by [`Row::order`] (rows of equal key keep the order given).
///
/// # Errors
/// [`Fault::NotANumber`] for a NaN.
pub fn to_parquet_bytes<R: Row + Clone>(rows: &[R]) -> Result<Vec<u8>, TableError> {
    if rows.is_sorted_by(|a, b| a.order(b).is_le()) {
        return encode(R::SPEC, &R::to_batch(rows)?);
    }
    let mut sorted = rows.to_vec();
    sorted.sort_by(Row::order);
    encode(R::SPEC, &R::to_batch(&sorted)?)
}

/// The rows in the bytes of a file; `origin` names the file in errors.
///
/// # Errors
/// [`TableError`] when the bytes are not a whole Parquet file or a column does not match.
pub fn from_parquet_bytes<R: Row>(origin: &str, bytes: impl Into<Bytes>) -> Result<Vec<R>, TableError> {
    from_parquet_bytes_as(R::SPEC, origin, bytes)
}

/// As [`from_parquet_bytes`], for a file of table `spec`, which has the columns of `R` under another name.
///
/// # Errors
/// As [`from_parquet_bytes`].
pub fn from_parquet_bytes_as<R: Row>(
    spec: &TableSpec,
    origin: &str,
    bytes: impl Into<Bytes>,
) -> Result<Vec<R>, TableError> {
    let batch = decode(spec, origin, bytes.into())?;
    stamp(R::SPEC, &batch).and_then(|batch| R::from_batch(&batch)).map_err(|e| e.at(origin))
}

/// The rows of a file.
///
/// # Errors
/// As [`from_parquet_bytes`], and [`Fault::Unreadable`].
pub fn read_table<R: Row>(path: &Path) -> Result<Vec<R>, TableError> {
    read_table_as(R::SPEC, path)
}

/// The rows of a file of table `spec`, which has the columns of `R` under another name.
///
/// # Errors
/// As [`read_table`].
pub fn read_table_as<R: Row>(spec: &TableSpec, path: &Path) -> Result<Vec<R>, TableError> {
    let origin = path.display().to_string();
    from_parquet_bytes_as(spec, &origin, read_bytes(spec.name, path)?)
}

/// The rows of a file that someone else wrote, such as measured data from pandas, polars or DuckDB.
///
/// Columns may stand in any order, further columns are ignored, and narrower or signed whole numbers, single precision
/// and other text encodings are converted when nothing is lost. NaN counts as missing.
///
/// # Errors
/// As [`from_parquet_bytes`]; [`Fault::OutOfRange`] for a negative or too large count.
pub fn from_foreign_parquet_bytes<R: Row>(origin: &str, bytes: impl Into<Bytes>) -> Result<Vec<R>, TableError> {
    let spec = R::SPEC;
    let fail = |fault| TableError::in_memory(spec.name, fault).at(origin);
    let found = read_batches(bytes.into(), true).map_err(|e| fail(parquet_fault(&e)))?;
    let columns: Result<Vec<_>, _> = spec.columns.iter().map(|column| foreign_column(column, &found)).collect();
    let batch = super::to_batch(spec, columns.map_err(fail)?).map_err(|e| e.at(origin))?;
    R::from_batch(&batch).map_err(|e| e.at(origin))
}

fn foreign_column(column: &ColumnSpec, batch: &RecordBatch) -> Result<ArrayRef, Fault> {
    let (field, array) = find(column, batch)?;
    if !convertible(field.data_type(), column.column_type) {
        return Err(wrong_type(column, field.data_type()));
    }
    let strict = CastOptions { safe: false, ..CastOptions::default() };
    let out_of_range = |detail: String| Fault::OutOfRange { column: column.name.to_owned(), detail };
    let cast = cast_with_options(array, &arrow_type(column.column_type), &strict);
    let cast = nan_to_null(cast.map_err(|e| out_of_range(e.to_string()))?);
    check_nulls(column, &cast)?;
    Ok(cast)
}

/// Whether a cast from `found` keeps every value or fails.
fn convertible(found: &DataType, wanted: ColumnType) -> bool {
    match wanted {
        ColumnType::U32 | ColumnType::U64 => found.is_integer(),
        ColumnType::F64 => found.is_integer() || matches!(found, DataType::Float32 | DataType::Float64),
        ColumnType::Bool => found == &DataType::Boolean,
        ColumnType::Text => matches!(found, DataType::Utf8 | DataType::LargeUtf8 | DataType::Utf8View),
    }
}

fn nan_to_null(array: ArrayRef) -> ArrayRef {
    use arrow::array::{Array, Float64Array};
    match array.as_any().downcast_ref::<Float64Array>() {
        Some(numbers) => Arc::new(numbers.iter().map(|x| x.filter(|x| !x.is_nan())).collect::<Float64Array>()),
        None => array,
    }
}

/// The Parquet bytes of a batch in the order it has, as table `spec`, whose columns the batch must have.
///
/// # Errors
/// [`Fault::Parquet`] with what the writer said.
pub fn encode(spec: &TableSpec, batch: &RecordBatch) -> Result<Vec<u8>, TableError> {
    write_batch(&stamp(spec, batch)?).map_err(|e| TableError::in_memory(spec.name, parquet_fault(&e)))
}

/// The checked batch in the bytes of a file, with exactly the schema of `spec`.
///
/// # Errors
/// As [`from_parquet_bytes`].
pub fn decode(spec: &TableSpec, origin: &str, bytes: Bytes) -> Result<RecordBatch, TableError> {
    let fail = |e| TableError::in_memory(spec.name, parquet_fault(&e)).at(origin);
    let batch = read_batches(bytes, false).map_err(fail)?;
    conform(spec, &batch).map_err(|e| e.at(origin))
}

/// Reads only the footer: whether the file looks like a whole Parquet file, and how many rows it claims.
///
/// # Errors
/// What the operating system or the reader said.
pub fn rows_in_file(path: &Path) -> Result<u64, String> {
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let metadata = unpanicked(|| ParquetMetaDataReader::new().parse_and_finish(&file)).map_err(|e| e.to_string())?;
    Ok(u64::try_from(metadata.file_metadata().num_rows()).unwrap_or(0))
}

/// Reads only the footer: the version of the schema that a file was written with, if it says so.
///
/// # Errors
/// What the operating system or the reader said.
pub fn version_in_file(path: &Path) -> Result<Option<u32>, String> {
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let metadata =
        unpanicked(|| ArrowReaderMetadata::load(&file, ArrowReaderOptions::new())).map_err(|e| e.to_string())?;
    Ok(metadata.schema().metadata().get(VERSION).and_then(|version| version.parse().ok()))
}

thread_local! {
    /// Whether this thread is inside [`unpanicked`].
    static READING: Cell<bool> = const { Cell::new(false) };
}

/// From now on the panics that [`unpanicked`] turns into errors are not printed as well; all others are, as before.
pub fn print_no_reader_panics() {
    let print = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !READING.get() {
            print(panic);
        }
    }));
}

/// Runs a reader of the parquet crate: some damaged files make it panic, which becomes an error as any other damage.
///
/// # Errors
/// What the reader said, in one way or the other.
pub fn unpanicked<T>(read: impl FnOnce() -> Result<T, ParquetError>) -> Result<T, ParquetError> {
    let before = READING.replace(true);
    let outcome = catch_unwind(AssertUnwindSafe(read));
    READING.set(before);
    outcome.unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().map(String::as_str);
        let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("the reader gave up");
        Err(ParquetError::General(said.to_owned()))
    })
}

/// Some columns of a file of table `spec`; no other is read.
///
/// # Errors
/// As [`from_parquet_bytes`], and [`Fault::Unreadable`].
pub fn columns(spec: &'static TableSpec, path: &Path, names: &[&str]) -> Result<Checked, TableError> {
    columns_of(spec, &path.display().to_string(), read_bytes(spec.name, path)?.into(), names)
}

/// As [`columns`], from the bytes of the file.
///
/// # Errors
/// As [`from_parquet_bytes`].
pub fn columns_of(spec: &'static TableSpec, origin: &str, bytes: Bytes, names: &[&str]) -> Result<Checked, TableError> {
    let read = || -> Result<RecordBatch, ParquetError> {
        let builder = ParquetRecordBatchReaderBuilder::try_new(bytes)?;
        let mask = ProjectionMask::columns(builder.parquet_schema(), names.iter().copied());
        let metadata = builder.schema().metadata().clone();
        let reader = builder.with_projection(mask).with_batch_size(READ_ROWS).build()?;
        let schema = reader.schema();
        let batch = concat_batches(&schema, &reader.collect::<Result<Vec<_>, _>>()?)?;
        // A projection says nothing of the table any more.
        Ok(batch.with_schema(Arc::new(schema.as_ref().clone().with_metadata(metadata)))?)
    };
    let batch = unpanicked(read).map_err(|e| TableError::in_memory(spec.name, parquet_fault(&e)).at(origin))?;
    Checked::columns(spec, batch, names).map_err(|e| e.at(origin))
}

/// How often every value of a text column of table `spec` occurs in a file; no other column is read.
///
/// # Errors
/// As [`columns`].
pub fn text_counts(spec: &'static TableSpec, path: &Path, column: &str) -> Result<BTreeMap<String, u64>, TableError> {
    let mut counts = BTreeMap::new();
    for value in columns(spec, path, &[column])?.column::<String>(column)?.iter().flatten() {
        match counts.get_mut(value) {
            Some(count) => *count += 1,
            None => drop(counts.insert(value.to_owned(), 1)),
        }
    }
    Ok(counts)
}

pub(super) fn read_bytes(table: &str, path: &Path) -> Result<Vec<u8>, TableError> {
    std::fs::read(path).map_err(|e| {
        TableError::in_memory(table, Fault::Unreadable { detail: e.to_string() }).at(&path.display().to_string())
    })
}

pub(super) fn parquet_fault(error: &ParquetError) -> Fault {
    Fault::Parquet { detail: error.to_string() }
}

/// Writes one batch with the fixed properties.
pub(super) fn write_batch(batch: &RecordBatch) -> Result<Vec<u8>, ParquetError> {
    let mut bytes = Vec::new();
    let properties = properties(batch.schema_ref())?;
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(batch)?;
    writer.close()?;
    Ok(bytes)
}

fn properties(schema: &Schema) -> Result<WriterProperties, ParquetError> {
    let base = WriterProperties::builder()
        .set_created_by(CREATED_BY.to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(3)?))
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true);
    let floats = schema.fields().iter().filter(|field| field.data_type() == &DataType::Float64);
    let builder = floats.fold(base, |builder, field| {
        let path = ColumnPath::new(vec![field.name().clone()]);
        builder
            .set_column_dictionary_enabled(path.clone(), false)
            .set_column_encoding(path, Encoding::BYTE_STREAM_SPLIT)
    });
    Ok(builder.build())
}

/// All rows of a file as one batch. `foreign` ignores the Arrow schema another writer may have embedded.
pub(super) fn read_batches(bytes: Bytes, foreign: bool) -> Result<RecordBatch, ParquetError> {
    unpanicked(|| {
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(foreign);
        let builder = ParquetRecordBatchReaderBuilder::try_new_with_options(bytes, options)?.with_batch_size(READ_ROWS);
        let schema = builder.schema().clone();
        let mut batches: Vec<RecordBatch> = builder.build()?.collect::<Result<_, _>>()?;
        if batches.len() == 1 {
            return Ok(batches.remove(0).with_schema(schema)?);
        }
        Ok(concat_batches(&schema, &batches)?)
    })
}
