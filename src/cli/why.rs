//! `why`: what makes a stage stale, or what it stands on.

use super::repro::stage;
use super::{CliError, Outcome};
use crate::pipeline::Study;
use crate::pipeline::plan::{State, assess, recipe};
use clap::Args;
use std::io::Write;
use std::path::Path;

/// Say why a stage would run, or what it was made from.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  granulake why train")]
pub struct Arguments {
    /// The stage.
    stage: String,
}

/// Prints reasons, inputs and settings of the stage.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let Some(stage) = stage(Some(&arguments.stage))? else { return Ok(Outcome::Done) };
    let study = Study::load(path)?;
    let lock = study.lock()?;
    let state = assess(&study, &lock).into_iter().find(|step| step.stage == stage.name).map(|step| step.state);
    let recipe = recipe(&study, &lock, stage);
    let mut out = std::io::stdout().lock();
    match state {
        Some(State::Stale(reasons)) => {
            writeln!(out, "{} is stale:", stage.name)?;
            reasons.iter().try_for_each(|reason| writeln!(out, "  {reason}"))?;
        }
        Some(State::Skipped(why)) => {
            writeln!(out, "{} is skipped: {why}", stage.name)?;
            return Ok(Outcome::Done);
        }
        Some(State::Waiting(stages)) => writeln!(out, "{} waits for {}", stage.name, stages.join(", "))?,
        _ => writeln!(out, "{} is fresh; it stands on:", stage.name)?,
    }
    for (name, digest) in &recipe.inputs {
        writeln!(out, "  input    {name} {}", &digest.to_string()[..12])?;
    }
    for (name, value) in &recipe.settings {
        writeln!(out, "  setting  {name} = {value}")?;
    }
    Ok(Outcome::Done)
}
