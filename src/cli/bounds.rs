//! `bounds`: bounds of the particle density that let the model reach a measured bulk density.

use super::{CliError, Outcome};
use crate::campaign::Options;
use crate::config::{DENSITY, DensityBounds};
use crate::pipeline::{PipelineError, Study};
use crate::stages::bounds::{Bound, Densities, Known, Unmeasured, densities, density_bounds};
use crate::units;
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::Path;

/// Simulate the bulk density test at the corners of the other parameters and say which bounds the particle density needs.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake bounds --density \"2313.4 kg/m3\" --reps 5
  granulake bounds --measured paper --json

Eqs 2 and 3 of Fransen et al. (2022): measured over simulated bulk density, times the measured particle density, which is
that of a [[prior]] or of weighed grains where --density is left out. Simulations are kept, so a second call runs nothing.
This only prints. A study whose [parameters.particle_density] has neither lower nor upper finds both by itself, in the
stage `bounds` of `granulake repro`; to hold them fast, put the two lines at the end there.")]
pub struct Arguments {
    /// Data set with the measured densities; the first one that has them when left out.
    #[arg(long, value_name = "NAME")]
    measured: Option<String>,
    /// Measured particle density.
    #[arg(long, value_name = "VALUE")]
    density: Option<String>,
    /// Simulations at each end, instead of bounds.repetitions.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    reps: Option<u32>,
    /// Threads; one per core when left out.
    #[arg(long, value_name = "N", default_value_t = 0)]
    jobs: usize,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Simulates and prints the bounds.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::declared(path, None)?;
    if study.config.bounds.density == DensityBounds::NotCalibrated {
        return Err(format!("`{DENSITY}` is no parameter of this study; give it a [parameters.{DENSITY}]").into());
    }
    let known = known(&study, arguments)?;
    study.store().claim()?;
    let campaign = study.campaign(Options { jobs: arguments.jobs, progress: true, retry_failed: false })?;
    let repetitions = arguments.reps.unwrap_or(study.config.bounds.repetitions);
    let found = density_bounds(&study.context(&campaign), &known, repetitions)
        .map_err(|source| PipelineError::Stage { stage: "bounds", source })?;
    campaign.compact()?;
    let [lower, upper] = &found.bounds;
    let mut out = std::io::stdout().lock();
    if arguments.json {
        writeln!(out, "{}", json!({"lower": entry(lower), "upper": entry(upper)}))?;
    } else {
        write!(out, "{}", text(&known, [lower, upper]))?;
    }
    Ok(Outcome::Done)
}

/// The measured densities, that of the grains as given or known.
fn known(study: &Study, arguments: &Arguments) -> Result<Densities, CliError> {
    let given = arguments.density.as_deref().map(|text| units::parse(text, "kg/m3")).transpose()?;
    let given = given.map(|mean| Known { mean, standard_error: 0.0 });
    let wished = |name: &str| arguments.measured.as_ref().is_none_or(|wished| wished == name);
    let sets = study.measured.iter().filter(|set| wished(&set.name));
    Ok(densities(&study.config, sets, given).map_err(|error| match error {
        Unmeasured::Bulk => format!("{error} (of the name asked for); name another with --measured"),
        Unmeasured::Particle(_) => format!("{error}; give one with --density"),
    })?)
}

fn entry(bound: &Bound) -> serde_json::Value {
    json!({
        "value": bound.rounded,
        "unrounded": bound.value,
        "standard_error": bound.standard_error,
        "others": bound.others,
        "simulated_mean": bound.simulated.mean,
        "simulated_sd": bound.simulated.sd,
        "simulations": bound.simulated.n,
        "unit": "kg/m3",
    })
}

fn text(known: &Densities, bounds: [&Bound; 2]) -> String {
    let (set, bulk, particle) = (&known.measured, known.bulk.mean, known.particle.mean);
    let mut text = format!("measured: bulk density {bulk:.1} kg/m3 ({set}), particle density {particle:.1} kg/m3\n");
    for bound in bounds {
        let interval = bound.simulated.mean_interval;
        let scatter = if interval.lower.is_finite() {
            format!("[{:.1}, {:.1}]", interval.lower, interval.upper)
        } else {
            "no interval from one run".to_owned()
        };
        let (mean, n, others) = (bound.simulated.mean, bound.simulated.n, &bound.others);
        text += &format!("at {others}: simulated {mean:.1} kg/m3 {scatter} from {n} runs");
        text += &format!(" -> {:.1} ± {:.1} kg/m3\n", bound.value, bound.standard_error);
    }
    let [lower, upper] = bounds.map(|bound| bound.rounded);
    text + &format!("\n[parameters.{DENSITY}]\nlower = \"{lower} kg/m3\"\nupper = \"{upper} kg/m3\"\n")
}
