//! `query`: SQL over the tables, answered by polars.

use super::{CliError, Outcome};
use clap::{Args, ValueEnum};
use std::path::Path;

/// Query the tables with SQL; every table is known by its name.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake query \"SELECT kpi, mean, sd FROM aggregates WHERE point = 1 AND n = 3\"
  granulake query \"SELECT * FROM before_after\" --format csv > before_after.csv
The same files open in place elsewhere: DuckDB reads SELECT … FROM 'artifacts/tables/kpis/**/*.parquet'.")]
pub struct Arguments {
    /// The query.
    sql: String,
    /// How to print the answer.
    #[arg(long, value_enum, default_value_t = Format::Table)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Table,
    Csv,
    Json,
    Parquet,
}

/// Runs the query over the tables of the study and prints the answer to stdout.
#[cfg(feature = "query")]
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    use crate::campaign::PROVENANCE;
    use crate::pipeline::Study;
    use crate::store::table;
    use crate::tables::{Row, io, list::ProvenanceRow};
    use polars::prelude::*;
    use std::io::{Cursor, Write};
    use std::path::PathBuf;
    let study = Study::load(study)?;
    let mut context = polars::sql::SQLContext::new();
    for spec in crate::tables::list::TABLES {
        let root = study.store().root();
        if !root.join(table::index(spec)).is_file() {
            continue;
        }
        let scan =
            |path: &PathBuf| LazyFrame::scan_parquet(PlRefPath::try_from_path(path)?, ScanArgsParquet::default());
        let parts = table::data_files(root, spec)?.iter().map(scan).collect::<PolarsResult<Vec<_>>>()?;
        if !parts.is_empty() {
            context.register(spec.name, concat(parts, UnionArgs::default())?);
        }
    }
    if arguments.sql.to_lowercase().contains(PROVENANCE) {
        let rows = study.store().ledger::<ProvenanceRow>(PROVENANCE)?.all()?;
        let bytes = io::encode(ProvenanceRow::SPEC, &rows)?;
        context.register(PROVENANCE, ParquetReader::new(Cursor::new(bytes)).finish()?.lazy());
    }
    let mut frame = context.execute(&arguments.sql)?.collect()?;
    let names: Vec<String> = frame.get_column_names().iter().map(ToString::to_string).collect();
    let mut out = std::io::stdout().lock();
    match arguments.format {
        Format::Table => writeln!(out, "{}", super::output::aligned(&names, &rows(&frame)?))?,
        Format::Csv => write!(out, "{}", super::output::csv(&names, &rows(&frame)?))?,
        Format::Json => writeln!(out, "{}", super::output::json(&names, &rows(&frame)?))?,
        Format::Parquet => drop(ParquetWriter::new(&mut out).finish(&mut frame)?),
    }
    Ok(Outcome::Done)
}

/// The answer as rows of plain values.
#[cfg(feature = "query")]
fn rows(frame: &polars::prelude::DataFrame) -> Result<Vec<Vec<serde_json::Value>>, CliError> {
    (0..frame.height()).map(|row| frame.columns().iter().map(|column| Ok(value(&column.get(row)?))).collect()).collect()
}

#[cfg(feature = "query")]
fn value(cell: &polars::prelude::AnyValue) -> serde_json::Value {
    use polars::prelude::AnyValue;
    use serde_json::Value;
    match cell {
        AnyValue::Null => Value::Null,
        AnyValue::Boolean(truth) => Value::Bool(*truth),
        AnyValue::String(text) => Value::String((*text).to_owned()),
        AnyValue::StringOwned(text) => Value::String(text.to_string()),
        AnyValue::Float32(_) | AnyValue::Float64(_) => cell.extract::<f64>().map_or(Value::Null, Value::from),
        AnyValue::UInt64(number) => Value::from(*number),
        other => other.extract::<i64>().map_or_else(|| Value::String(other.to_string()), Value::from),
    }
}

/// Says how to get the query engine.
#[cfg(not(feature = "query"))]
pub fn run(_: &Path, _: &Arguments) -> Result<Outcome, CliError> {
    Err("this binary was built without the `query` feature; build it with default features, or use DuckDB on the tables".into())
}
