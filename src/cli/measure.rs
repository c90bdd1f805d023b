//! `measure`: the observables of a test that any engine has simulated, by the code that measures our own runs.

use super::observables::{self, pair};
use super::{CliError, Outcome};
use crate::config::states;
use crate::dem::State;
use crate::experiments::{self, Experiment, Measurement};
use crate::pipeline::Study;
use crate::settings::Settings;
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Measure the grains that any engine left behind, as our own runs are measured.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake measure ledge --particles grains.csv --json
  granulake measure pile --particles grains.csv --flow flow.csv --set particle_density=2700
  granulake measure bulk_density --particles runs/*.csv --csv > measured/bulk_density.csv

Files are CSV or Parquet; every header carries its unit. Grains: `x [mm],y [mm],z [mm],radius [mm]`, or `diameter`;
`vx [m/s],vy [m/s],vz [m/s]` where some still move. Flow: `time [s],mass [kg]`, time since the release, mass above the
opening. x, y and z count as in the drawing at the head of src/experiments/EXPERIMENT.rs. Several files are several
repetitions, in their order; with --csv they are rows of a measured data set. Bins, windows and densities are those of
the study's settings.")]
pub struct Arguments {
    /// pile, ledge, bulk_density or hopper.
    experiment: String,
    /// Grains at the end of the test, one file per repetition.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    particles: Vec<PathBuf>,
    /// Mass above the opening over time, one file per repetition.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    flow: Vec<PathBuf>,
    /// Set a parameter or any other setting; a unit may follow the value.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = pair)]
    settings: Vec<(String, String)>,
    /// Print one line of JSON per repetition.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print rows of a measured data set: experiment, repetition, kpi, value, unit.
    #[arg(long)]
    csv: bool,
}

/// Measures every repetition and prints the observables.
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let config = Study::config(study)?;
    let experiment = experiments::find(&arguments.experiment)?;
    let settings = observables::changed(config.base_settings(), &arguments.settings)?;
    let (grains, flows) = (&arguments.particles, &arguments.flow);
    let repetitions = grains.len().max(flows.len());
    if repetitions == 0 {
        return Err("nothing to measure; give --particles, --flow or both".into());
    }
    if !grains.is_empty() && !flows.is_empty() && grains.len() != flows.len() {
        let (grains, flows) = (grains.len(), flows.len());
        return Err(format!("{grains} files of grains and {flows} of flow; give one of each per repetition").into());
    }
    let mut out = std::io::stdout().lock();
    if arguments.csv {
        writeln!(out, "experiment,repetition,kpi,value,unit")?;
    }
    let mut complete = true;
    for repetition in 0..repetitions {
        let (count, measured) = measure(experiment, &settings, grains.get(repetition), flows.get(repetition))?;
        complete &= measured.iter().all(|(_, value)| value.is_ok());
        let text = match (arguments.csv, arguments.json) {
            (true, _) => rows(experiment, repetition + 1, &measured),
            (_, true) => format!("{}\n", answer(experiment, repetition + 1, count, &measured)),
            _ => {
                let entries = observables::json(experiment, &measured);
                let head = format!("{}, repetition {}: {count} particles\n", experiment.name(), repetition + 1);
                head + &observables::lines(&entries.into())
            }
        };
        out.write_all(text.as_bytes())?;
    }
    Ok(if complete { Outcome::Done } else { Outcome::FailedRuns })
}

/// Number of grains, and the observables that the given files show.
fn measure(
    experiment: &dyn Experiment,
    settings: &Settings,
    grains: Option<&PathBuf>,
    flow: Option<&PathBuf>,
) -> Result<(usize, Vec<Measurement>), CliError> {
    let state = grains.map_or_else(|| Ok(State::default()), |path| states::grains(path))?;
    let samples = flow.map_or_else(|| Ok(Vec::new()), |path| states::flow(path))?;
    let trace = experiments::since_release(experiment, settings, &samples);
    let of_flow = |name: &&str| experiment.read_off_force().contains(name);
    let shown = |name: &&str| if of_flow(name) { flow.is_some() } else { grains.is_some() };
    let mut measured = experiment.measure(settings, &state, &trace);
    measured.retain(|(name, _)| shown(name));
    if measured.is_empty() {
        let (given, other) = if flow.is_some() { ("--flow", "--particles") } else { ("--particles", "--flow") };
        return Err(format!("{given} shows nothing of {}; give {other}", experiment.name()).into());
    }
    Ok((state.len(), measured))
}

fn answer(
    experiment: &dyn Experiment,
    repetition: usize,
    particles: usize,
    measured: &[Measurement],
) -> serde_json::Value {
    json!({
        "experiment": experiment.name(),
        "repetition": repetition,
        "particles": particles,
        "kpis": observables::json(experiment, measured),
    })
}

/// Rows of measured data; observables without a value are left out, and told on stderr with their reason.
fn rows(experiment: &dyn Experiment, repetition: usize, measured: &[Measurement]) -> String {
    let mut missing: Vec<(String, Vec<&str>)> = Vec::new();
    let mut text = String::new();
    for (name, value) in measured {
        match value {
            Ok(value) => {
                let unit = observables::unit(experiment, name);
                text += &format!("{},{repetition},{name},{value},{unit}\n", experiment.name());
            }
            Err(reason) => match missing.iter_mut().find(|(other, _)| *other == reason.to_string()) {
                Some((_, names)) => names.push(name),
                None => missing.push((reason.to_string(), vec![name])),
            },
        }
    }
    for (reason, names) in missing {
        eprintln!("{}, repetition {repetition}, without {}: {reason}", experiment.name(), names.join(", "));
    }
    text
}
