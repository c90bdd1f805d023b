//! `gc`: files that nothing refers to.

use super::{CliError, Outcome};
use crate::pipeline::{Study, integrity};
use crate::store::gc;
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};

/// List files that no ledger and no lock refers to; delete them with --delete.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake gc --dry-run
  granulake gc --delete
  granulake gc --delete --keep old/pipeline.lock")]
pub struct Arguments {
    /// Only list; this is the default.
    #[arg(long, conflicts_with = "delete")]
    dry_run: bool,
    /// Delete what is listed.
    #[arg(long)]
    delete: bool,
    /// Another lock file whose outputs are kept.
    #[arg(long, value_name = "LOCK")]
    keep: Vec<PathBuf>,
}

/// Prints, and on demand deletes, what nothing refers to.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::load(path)?;
    let garbage = gc::find(study.store(), &integrity::live(&study, &arguments.keep)?)?;
    let mut out = std::io::stdout().lock();
    for file in &garbage {
        writeln!(out, "{:>12}  {:<10} {}", file.bytes, format!("{:?}", file.kind).to_lowercase(), file.path.display())?;
    }
    let bytes: u64 = garbage.iter().map(|file| file.bytes).sum();
    if arguments.delete {
        gc::delete(study.store(), &garbage)?;
    }
    let verb = if arguments.delete { "deleted" } else { "could be deleted" };
    writeln!(out, "{} files, {bytes} bytes {verb}", garbage.len())?;
    Ok(Outcome::Done)
}
