//! `sim`: one simulation with the study's set-up, its observables printed; on request watched, stored and resumed.

mod end;
mod vtk;
mod watch;

use super::observables::{self, pair};
use super::{CliError, Outcome};
use crate::campaign::{Point, Request, Values, state_digest};
use crate::dem::{Checkpoint, Setup, Simulation};
use crate::effects::Library;
use crate::pipeline::Study;
use crate::{dem, experiments, units};
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Simulate one experiment once and print what is read off it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake sim ledge
  granulake sim pile --set sliding_friction=0.4 --set pile.drop_height=\"0.3 m\" --seed 7 --json
  granulake sim bulk_density --effect cohesion=0.5
  granulake sim hopper --vtk frames --trace energies.parquet --every \"5 ms\"
  granulake sim pile --particles grains.csv --flow flow.csv    what `granulake measure` reads
  granulake sim hopper --checkpoint hopper.checkpoint          stopped on the way, it goes on to the same bits with
  granulake sim hopper --resume hopper.checkpoint              the same settings, effects and seed")]
pub struct Arguments {
    /// pile, ledge, bulk_density or hopper.
    experiment: String,
    /// Set a parameter or any other setting; a unit may follow the value.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    settings: Vec<(String, String)>,
    /// Switch an effect on with this strength.
    #[arg(long = "effect", value_name = "NAME=STRENGTH", value_parser = pair)]
    effects: Vec<(String, String)>,
    /// Seed of the random packing.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    watch: watch::Options,
    #[command(flatten)]
    end: end::Options,
    /// Go on from a checkpoint of the same run instead of starting at t = 0.
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the simulation and prints the observables.
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let config = Study::config(study)?;
    let experiment = experiments::find(&arguments.experiment)?;
    let settings = observables::changed(config.base_settings(), &arguments.settings)?;
    let library = &config.effects.library;
    let point = Point::new(1, &settings, &[])?.knowing(library).with_effects(&strengths(library, &arguments.effects)?);
    let request =
        Request { label: "sim".to_owned(), experiment, point: Arc::new(point), repetition: 1, seed: arguments.seed };
    let resolved = request.resolve()?;
    let key = request.key(&resolved)?;
    let release = arguments.end.release(experiment, &resolved)?;
    let outcome = simulate(&experiment.setup(&resolved)?, arguments)?;
    arguments.end.write(release, &outcome)?;
    let measured = experiment.measure(&resolved, &outcome.state, &outcome.trace);
    let answer = json!({
        "experiment": experiment.name(),
        "seed": arguments.seed,
        "run_key": key.to_string(),
        "inserted": outcome.inserted,
        "insertion_attempts": outcome.attempts,
        "deleted": outcome.deleted,
        "lost": outcome.lost,
        "particles": outcome.state.len(),
        "steps": outcome.steps,
        "time_s": outcome.time,
        "stop": outcome.stop.name(),
        "energy_ratio": outcome.energies.ratio(),
        "coordination_number": outcome.coordination_number,
        "max_overlap": outcome.max_overlap,
        "state": state_digest(&outcome.state)?.to_string(),
        "kpis": observables::json(experiment, &measured),
    });
    let mut out = std::io::stdout().lock();
    match arguments.json {
        true => writeln!(out, "{answer}")?,
        false => write!(out, "{}", text(&answer))?,
    }
    Ok(if measured.iter().all(|(_, value)| value.is_ok()) { Outcome::Done } else { Outcome::FailedRuns })
}

/// Runs the simulation, from the start or from a checkpoint, and has it watched.
fn simulate(setup: &Setup, arguments: &Arguments) -> Result<dem::Outcome, CliError> {
    let mut run = match &arguments.resume {
        Some(path) => {
            let told = |what: &dyn std::fmt::Display| format!("`{}`: {what}", path.display());
            let bytes = std::fs::read(path).map_err(|e| told(&e))?;
            let checkpoint = Checkpoint::from_bytes(bytes).map_err(|e| told(&e))?;
            Simulation::resume(setup, arguments.seed, &checkpoint).map_err(|e| told(&e))?
        }
        None => Simulation::new(setup, arguments.seed)?,
    };
    let mut watch = watch::Watch::new(&arguments.watch);
    loop {
        watch.look(&run)?;
        match run.step() {
            Ok(None) => {}
            Ok(Some(stop)) => {
                watch.finish(&run)?;
                return Ok(run.outcome(stop));
            }
            Err(failure) => {
                // What was seen until then is what one wants to look at.
                watch.finish(&run)?;
                return Err(failure.into());
            }
        }
    }
}

fn strengths(library: &Library, pairs: &[(String, String)]) -> Result<Values, CliError> {
    let strength = |(name, text): &(String, String)| {
        let effect = library.find(name)?;
        Ok((name.clone(), units::parse(text, effect.unit())?))
    };
    pairs.iter().map(strength).collect()
}

fn text(answer: &Value) -> String {
    let fact = |name: &str| answer[name].to_string().trim_matches('"').to_owned();
    let mut text = format!(
        "{} (seed {}): {} particles, {} steps, {} s simulated, stopped by {}\n",
        fact("experiment"),
        fact("seed"),
        fact("particles"),
        fact("steps"),
        fact("time_s"),
        fact("stop")
    );
    let counts = ["inserted", "deleted", "lost"].map(|name| format!("{} {name}", fact(name))).join(", ");
    let ends = ["energy_ratio", "max_overlap", "coordination_number"];
    let ends = ends
        .map(|name| format!("{name} {}", answer[name].as_f64().map_or("none".into(), |x| units::significant(x, 3))));
    text += &format!("  {counts} ({} attempts); {}\n", fact("insertion_attempts"), ends.join(", "));
    text + &observables::lines(&answer["kpis"])
}
