//! `challenge`: measured data that hide an effect, for testing the whole loop.

use super::{CliError, Outcome};
use crate::campaign::{Campaign, Options};
use crate::challenge::{Order, make};
use crate::pipeline::Study;
use crate::store::Store;
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};

/// Make measured data that hide an effect.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write measured.csv and, apart from it, sealed.toml, which says what the data hide.
    #[command(after_help = "\
Examples:
  granulake challenge new --seed 7 --out blind             a random candidate, strength from the upper third of its range
  granulake challenge new --seed 7 --effect none --out blind
  granulake challenge new --seed 7 --effect none --scale pile.drop_height=0.5 --out foreign")]
    New {
        /// Seed of the hidden parameters, the effect and its strength.
        #[arg(long)]
        seed: u64,
        /// Name of an effect, `random` or `none`.
        #[arg(long, default_value = "random")]
        effect: String,
        /// Strength of the effect.
        #[arg(long, allow_negative_numbers = true)]
        strength: Option<f64>,
        /// Repetitions of every fitted experiment.
        #[arg(long, default_value_t = 20)]
        n: u32,
        /// Repetitions of the held-out experiment.
        #[arg(long, default_value_t = 5)]
        n_held_out: u32,
        /// Multiply a setting besides: a discrepancy that no candidate describes.
        #[arg(long, value_name = "NAME=FACTOR", value_parser = factor)]
        scale: Vec<(String, f64)>,
        /// Folder to write to.
        #[arg(long)]
        out: PathBuf,
    },
}

fn factor(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=FACTOR")?;
    Ok((name.to_owned(), value.parse().map_err(|_| format!("`{value}` is not a number"))?))
}

/// Makes the challenge and writes its two files.
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let Action::New { seed, effect, strength, n, n_held_out, scale, out } = &arguments.action;
    let order = Order {
        seed: *seed,
        effect: effect.clone(),
        strength: *strength,
        repetitions: *n,
        held_out_repetitions: *n_held_out,
        scale: scale.clone(),
    };
    // The measured data of the study are not read: the challenge may be about to become one of them.
    let config = Study::config(study)?;
    let campaign = Campaign::open(Store::at(config.artifacts()), Options { progress: true, ..Options::default() })?;
    let campaign = campaign.with_step_limit(config.study.step_limit);
    let challenge = make(&config, &campaign, &order)?;
    std::fs::create_dir_all(out)?;
    std::fs::write(out.join("sealed.toml"), challenge.sealed)?;
    std::fs::write(out.join("measured.csv"), challenge.measured)?;
    eprintln!("wrote {}; name it in a [[measured]] section of a study", out.join("measured.csv").display());
    Ok(Outcome::Done)
}
