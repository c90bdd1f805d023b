//! `status`: where every stage stands.

use super::output::aligned;
use super::{CliError, Outcome};
use crate::pipeline::plan::assess;
use crate::pipeline::{Study, integrity};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// Say which stages are up to date, and what the store has lost or set aside. Exit code 3 when a stage is not up to date.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake status
  granulake status --json")]
pub struct Arguments {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints the state of every stage.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::load(path)?;
    let lock = study.lock()?;
    let steps = assess(&study, &lock);
    let rows = |stage: &str| -> Option<u64> {
        let outputs = lock.stages.get(stage)?.outputs.values();
        Some(outputs.filter_map(|output| output.rows).sum::<u64>()).filter(|rows| *rows > 0)
    };
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let entry = |step: &crate::pipeline::plan::Step| json!({"stage": step.stage, "state": step.state.word(), "why": step.state.detail(), "rows": rows(step.stage)});
        writeln!(out, "{}", Value::Array(steps.iter().map(entry).collect()))?;
    } else {
        let names = ["stage", "state", "rows", "why"].map(str::to_owned);
        let cells = steps.iter().map(|step| {
            vec![step.stage.into(), step.state.word().into(), rows(step.stage).into(), step.state.detail().into()]
        });
        writeln!(out, "{}", aligned(&names, &cells.collect::<Vec<_>>()))?;
    }
    for warning in integrity::warnings(&study)? {
        eprintln!("warning: {warning}");
    }
    Ok(if steps.iter().all(|step| step.state.is_settled()) { Outcome::Done } else { Outcome::Findings })
}
