//! `bounds`: bounds of the particle density that let the model reach a measured bulk density.

use super::{CliError, Outcome};
use crate::campaign::Options;
use crate::config::Measured;
use crate::pipeline::{PipelineError, Study};
use crate::stages::bounds::{Bound, Known, PARAMETER, density_bounds};
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
that of a [[prior]] where --density is left out. Simulations are kept, so a second call runs nothing. The two lines at the
end go under [parameters.particle_density]; nothing uses them before they stand there.")]
pub struct Arguments {
    /// Data set with the measured bulk density; the first one that has it when left out.
    #[arg(long, value_name = "NAME")]
    measured: Option<String>,
    /// Measured particle density.
    #[arg(long, value_name = "VALUE")]
    density: Option<String>,
    /// Simulations at each corner, instead of study.repetitions.
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
    let study = Study::load(path)?;
    if !study.config.parameters.iter().any(|parameter| parameter.name == PARAMETER) {
        return Err(format!("`{PARAMETER}` is no parameter of this study; give it a [parameters.{PARAMETER}]").into());
    }
    let (set, bulk) = bulk_density(&study, arguments.measured.as_deref())?;
    let particle = particle_density(&study, set, arguments.density.as_deref())?;
    study.store().claim()?;
    let campaign = study.campaign(Options { jobs: arguments.jobs, progress: true, retry_failed: false })?;
    let repetitions = arguments.reps.unwrap_or(study.config.study.repetitions);
    let bounds = density_bounds(&study.context(&campaign), bulk, particle, repetitions)
        .map_err(|source| PipelineError::Stage { stage: "bounds", source })?;
    campaign.compact()?;
    let mut out = std::io::stdout().lock();
    if arguments.json {
        writeln!(out, "{}", json!({"lower": entry(&bounds[0]), "upper": entry(&bounds[1])}))?;
    } else {
        write!(out, "{}", text(&set.name, bulk, particle, &bounds))?;
    }
    Ok(Outcome::Done)
}

/// The data set and its bulk density.
fn bulk_density<'a>(study: &'a Study, wished: Option<&str>) -> Result<(&'a Measured, Known), CliError> {
    let mut sets = study.measured.iter().filter(|set| wished.is_none_or(|name| set.name == name));
    let found = sets.find_map(|set| set.statistic("bulk_density").map(|found| (set, found)));
    let (set, found) = found.ok_or("no such data set holds a bulk density; name another with --measured")?;
    let standard_error = found.sd / f64::from(found.n).sqrt();
    Ok((set, Known { mean: found.mean, standard_error }))
}

/// The particle density as given, or that of a prior.
fn particle_density(study: &Study, set: &Measured, given: Option<&str>) -> Result<Known, CliError> {
    if let Some(text) = given {
        return Ok(Known { mean: units::parse(text, "kg/m3")?, standard_error: 0.0 });
    }
    let prior = study.config.priors_of(set).into_iter().find(|prior| prior.parameter == PARAMETER);
    let prior = prior.ok_or(
        "neither a row `grains,…,particle_density` of the data nor a [[prior]] tells the density of the grains; give one \
         with --density",
    )?;
    Ok(Known { mean: prior.mean, standard_error: prior.sd / f64::from(prior.n).sqrt() })
}

fn entry(bound: &Bound) -> serde_json::Value {
    json!({
        "value": bound.value,
        "standard_error": bound.standard_error,
        "simulated_mean": bound.simulated.mean,
        "simulated_sd": bound.simulated.sd,
        "simulations": bound.simulated.n,
        "unit": "kg/m3",
    })
}

fn text(set: &str, bulk: Known, particle: Known, bounds: &[Bound; 2]) -> String {
    let mut text =
        format!("measured: bulk density {:.1} kg/m3 ({set}), particle density {:.1} kg/m3\n", bulk.mean, particle.mean);
    for (name, bound) in ["lower", "upper"].into_iter().zip(bounds) {
        let scatter = if bound.interval.lower.is_finite() {
            format!("[{:.1}, {:.1}]", bound.interval.lower, bound.interval.upper)
        } else {
            "no interval from one run".to_owned()
        };
        text += &format!(
            "others on their {name} bounds: simulated {:.1} kg/m3 {scatter} from {} runs -> {:.1} ± {:.1} kg/m3\n",
            bound.simulated.mean, bound.simulated.n, bound.value, bound.standard_error
        );
    }
    let [one, other] = [bounds[0].value, bounds[1].value];
    text += &format!("\n[parameters.{PARAMETER}]\nlower = \"{:.1} kg/m3\"\n", one.min(other));
    text + &format!("upper = \"{:.1} kg/m3\"\n", one.max(other))
}
