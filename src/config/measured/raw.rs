//! Files of measured data as rows of text, before any meaning: CSV and Parquet alike.
//!
//! Numbers of a Parquet file become their shortest exact text, so that both formats go through the same checks.

use crate::config::problem::{Place, Problem};
use crate::tables::io::unpanicked;
use arrow::array::{Array, AsArray, RecordBatch};
use arrow::compute::cast;
use arrow::datatypes::{DataType, Float64Type, Int64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::errors::ParquetError;
use std::path::Path;

/// How a file is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values.
    Csv,
    /// Apache Parquet.
    Parquet,
}

impl Format {
    /// The format by the ending of the name.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        match ending.as_str() {
            "csv" => Some(Self::Csv),
            "parquet" => Some(Self::Parquet),
            _ => None,
        }
    }
}

/// A table of text cells.
#[derive(Debug, Clone, PartialEq)]
pub struct RawTable {
    /// The file, for messages.
    pub file: String,
    /// Where the header stands.
    pub header_place: Place,
    /// Names of the columns.
    pub header: Vec<String>,
    /// Cells of every row, with its place; may be ragged.
    pub rows: Vec<(Place, Vec<String>)>,
}

/// Reads a file by the ending of its name.
///
/// # Errors
/// A file that cannot be opened or is not of its format.
pub fn read(path: &Path) -> Result<RawTable, Problem> {
    let file = path.display().to_string();
    let refuse = |what: String| Problem { file: file.clone(), place: Place::File, what };
    match Format::of(path) {
        Some(Format::Csv) => {
            let bytes = std::fs::read(path).map_err(|error| refuse(format!("cannot be read: {error}")))?;
            let text =
                String::from_utf8(bytes).map_err(|_| refuse("is not UTF-8 text; save it as CSV UTF-8".to_owned()))?;
            csv(&text, &file)
        }
        Some(Format::Parquet) => parquet(path, &file).map_err(refuse),
        None => Err(refuse("has no ending .csv or .parquet; rename it".to_owned())),
    }
}

/// Reads CSV: `#` begins a comment line, empty lines do not count, cells may stand in double quotes.
///
/// # Errors
/// A file without a header, or an open quote.
pub fn csv(text: &str, file: &str) -> Result<RawTable, Problem> {
    let refuse = |place, what: &str| Problem { file: file.to_owned(), place, what: what.to_owned() };
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(index, line)| (Place::Line(index + 1), line.trim()));
    let mut records = Vec::new();
    for (place, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
        let open = || refuse(place, "a double quote is not closed; close it in the same line");
        records.push((place, cells(line).ok_or_else(open)?));
    }
    let mut records = records.into_iter();
    let empty = || refuse(Place::File, "holds no header; `granulake init` writes a template");
    let (header_place, header) = records.next().ok_or_else(empty)?;
    Ok(RawTable { file: file.to_owned(), header_place, header, rows: records.collect() })
}

/// The trimmed cells of a line; `None` where a quote stays open. Two quotes within quotes are one.
fn cells(line: &str) -> Option<Vec<String>> {
    let (mut cells, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    let mut letters = line.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => {
                letters.next();
                cell.push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(std::mem::take(&mut cell).trim().to_owned()),
            other => cell.push(other),
        }
    }
    cells.push(cell.trim().to_owned());
    (!quoted).then_some(cells)
}

fn parquet(path: &Path, file: &str) -> Result<RawTable, String> {
    let source = std::fs::File::open(path).map_err(|error| format!("cannot be read: {error}"))?;
    let read = || -> Result<(Vec<String>, Vec<RecordBatch>), ParquetError> {
        let builder = ParquetRecordBatchReaderBuilder::try_new(source)?;
        let header = builder.schema().fields().iter().map(|field| field.name().clone()).collect();
        Ok((header, builder.build()?.collect::<Result<_, _>>()?))
    };
    let broken = |error: ParquetError| format!("cannot be read as Parquet: {error}; write it again");
    let (header, batches) = unpanicked(read).map_err(broken)?;
    let mut rows = Vec::new();
    batches.iter().try_for_each(|batch| append(&mut rows, batch))?;
    Ok(RawTable { file: file.to_owned(), header_place: Place::File, header, rows })
}

fn append(rows: &mut Vec<(Place, Vec<String>)>, batch: &RecordBatch) -> Result<(), String> {
    let columns = batch.columns().iter().zip(batch.schema_ref().fields());
    let columns = columns.map(|(column, field)| texts(column, field.name())).collect::<Result<Vec<_>, _>>()?;
    for row in 0..batch.num_rows() {
        let place = Place::Row(rows.len() + 1);
        rows.push((place, columns.iter().map(|column| column[row].clone()).collect()));
    }
    Ok(())
}

/// A column as text; null becomes an empty cell.
fn texts(column: &dyn Array, name: &str) -> Result<Vec<String>, String> {
    let kind = column.data_type();
    let unfit = |_| format!("column `{name}` holds {kind}; write texts, whole numbers or 64-bit floats");
    if kind.is_integer() {
        let numbers = cast(column, &DataType::Int64).map_err(unfit)?;
        let numbers = numbers.as_primitive::<Int64Type>();
        return Ok(numbers.iter().map(|number| number.map_or_else(String::new, |number| number.to_string())).collect());
    }
    if kind.is_floating() {
        let numbers = cast(column, &DataType::Float64).map_err(unfit)?;
        let numbers = numbers.as_primitive::<Float64Type>();
        return Ok(numbers.iter().map(|number| number.map_or_else(String::new, |number| number.to_string())).collect());
    }
    let words = cast(column, &DataType::Utf8).map_err(unfit)?;
    Ok(words.as_string::<i32>().iter().map(|word| word.unwrap_or_default().trim().to_owned()).collect())
}
