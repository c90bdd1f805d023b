//! The `granulake` command: parse, run, exit code.

use clap::Parser;
use granulake::cli::Cli;
use std::process::ExitCode;

fn main() -> ExitCode {
    granulake::cli::run(Cli::parse())
}
