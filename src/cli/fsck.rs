//! `fsck`: whether everything the study stands on is there and whole.

use super::{CliError, Outcome};
use crate::pipeline::{Study, integrity};
use crate::store::Warning;
use crate::store::fsck::Depth;
use clap::Args;
use std::io::Write;
use std::path::Path;

/// Check tables, objects and ledgers. Damaged files are set aside, and the next repro makes them anew. Exit code 3
/// when something was found.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake fsck           names, sizes and footers
  granulake fsck --full    every byte against its digest")]
pub struct Arguments {
    /// Read every byte and compare digests.
    #[arg(long)]
    full: bool,
}

/// Prints what is damaged or missing.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::load(path)?;
    let depth = if arguments.full { Depth::Full } else { Depth::Fast };
    let warnings = integrity::warnings(&study)?;
    let report = integrity::fsck(&study, depth)?;
    let mut out = std::io::stdout().lock();
    // What is missing or damaged is among the findings; the rest is told by nobody else.
    let found = |warning: &&Warning| report.findings.iter().any(|finding| finding.path == warning.path);
    for warning in warnings.iter().filter(|warning| !found(warning)) {
        writeln!(out, "{warning}")?;
    }
    for finding in &report.findings {
        writeln!(out, "{finding}")?;
    }
    writeln!(out, "{} files looked at, {} findings", report.files, report.findings.len())?;
    Ok(if report.findings.is_empty() { Outcome::Done } else { Outcome::Findings })
}
