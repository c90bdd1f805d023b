//! The command line: one file per subcommand, each with its arguments and one function.
//!
//! Data goes to stdout, everything else to stderr. Exit codes: 0 done; 1 failed, with the reason on stderr; 2 wrong
//! usage; 3 `fsck` found damage, or `status` found stale stages; 4 a run of `repro` ended with failed simulations.

mod bounds;
mod challenge;
mod diff;
mod fsck;
mod gc;
mod init;
mod measure;
mod observables;
mod output;
mod plan;
mod query;
mod repetitions;
mod repro;
mod schemas;
mod sim;
mod status;
mod why;

use crate::tables::io::print_no_reader_panics;
use clap::{Parser, Subcommand};
use std::fmt;
use std::path::PathBuf;
use std::process::ExitCode;

/// Calibrate granular (DEM) models against measured data, with known certainty, and find out what the model lacks.
#[derive(Debug, Parser)]
#[command(name = "granulake", version, after_help = EXAMPLES)]
pub struct Cli {
    /// The study.
    #[arg(long, global = true, value_name = "FILE", default_value = "pipeline.toml")]
    study: PathBuf,
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  granulake init my-study && cd my-study       write a commented study and a template for measured data
  granulake plan                               what would run, why, how many simulations, what they cost
  granulake repro                              bring every stage up to date and print the result
  granulake repro --reps 5                     five repetitions; computes only what three did not
  granulake sim pile --set sliding_friction=0.4 --json
  granulake query \"SELECT experiment, kpi, avg(value) FROM kpis GROUP BY experiment, kpi\"

Exit codes: 0 done; 1 failed, the reason is on stderr; 2 wrong usage; 3 fsck found damage or status found
something stale; 4 done, but some simulations failed (rows with status `failed` say why).";

#[derive(Debug, Subcommand)]
enum Command {
    Bounds(bounds::Arguments),
    Init(init::Arguments),
    Measure(measure::Arguments),
    Plan(plan::Arguments),
    Repetitions(repetitions::Arguments),
    Repro(repro::Arguments),
    Status(status::Arguments),
    Why(why::Arguments),
    Diff(diff::Arguments),
    Sim(sim::Arguments),
    Query(query::Arguments),
    Fsck(fsck::Arguments),
    Gc(gc::Arguments),
    Challenge(challenge::Arguments),
    Schemas(schemas::Arguments),
}

/// How a command ended well, or with a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for is done.
    Done,
    /// `fsck` found damage or `status` found something stale.
    Findings,
    /// Done, with failed simulations among the rows.
    FailedRuns,
}

/// An error with what the command was about to do.
type CliError = Box<dyn std::error::Error>;

/// Runs the command and turns its end into an exit code.
pub fn run(cli: Cli) -> ExitCode {
    print_no_reader_panics();
    match dispatch(&cli) {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Findings) => ExitCode::from(3),
        Ok(Outcome::FailedRuns) => ExitCode::from(4),
        Err(error) if is_broken_pipe(error.as_ref()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", Chain(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

fn dispatch(cli: &Cli) -> Result<Outcome, CliError> {
    let study = cli.study.as_path();
    match &cli.command {
        Command::Bounds(arguments) => bounds::run(study, arguments),
        Command::Init(arguments) => init::run(arguments),
        Command::Measure(arguments) => measure::run(study, arguments),
        Command::Plan(arguments) => plan::run(study, arguments),
        Command::Repetitions(arguments) => repetitions::run(study, arguments),
        Command::Repro(arguments) => repro::run(study, arguments),
        Command::Status(arguments) => status::run(study, arguments),
        Command::Why(arguments) => why::run(study, arguments),
        Command::Diff(arguments) => diff::run(study, arguments),
        Command::Sim(arguments) => sim::run(study, arguments),
        Command::Query(arguments) => query::run(study, arguments),
        Command::Fsck(arguments) => fsck::run(study, arguments),
        Command::Gc(arguments) => gc::run(study, arguments),
        Command::Challenge(arguments) => challenge::run(study, arguments),
        Command::Schemas(arguments) => schemas::run(arguments),
    }
}

/// A reader that closed its end, such as `head`, is no failure of ours.
fn is_broken_pipe(error: &(dyn std::error::Error + 'static)) -> bool {
    error.downcast_ref::<std::io::Error>().is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

/// An error followed by its causes, each once.
struct Chain<'a>(&'a (dyn std::error::Error + 'static));

impl fmt::Display for Chain<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = self.0.to_string();
        write!(f, "{text}")?;
        let mut source = self.0.source();
        while let Some(error) = source {
            let next = error.to_string();
            if !text.contains(&next) {
                write!(f, ": {next}")?;
            }
            text = next;
            source = error.source();
        }
        Ok(())
    }
}
