//! `schemas`: descriptions of every table and of pipeline.toml, generated from the types.

use super::{CliError, Outcome};
use crate::config::schema;
use crate::tables::list::{BESIDE, TABLES};
use crate::tables::schema::describe;
use clap::Args;
use std::path::PathBuf;

/// Write schemas/*.json: one per table, and the JSON Schema of pipeline.toml.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  granulake schemas --out schemas")]
pub struct Arguments {
    /// Folder to write to.
    #[arg(long, default_value = "schemas")]
    out: PathBuf,
}

/// Name and text of every schema.
pub fn texts() -> Vec<(String, String)> {
    let tables = TABLES.iter().chain(BESIDE).map(|table| (format!("{}.json", table.name), describe(table)));
    tables.chain([("pipeline.schema.json".to_owned(), schema::text())]).collect()
}

/// Writes the schemas.
pub fn run(arguments: &Arguments) -> Result<Outcome, CliError> {
    std::fs::create_dir_all(&arguments.out)?;
    for (name, text) in texts() {
        std::fs::write(arguments.out.join(name), text)?;
    }
    Ok(Outcome::Done)
}
