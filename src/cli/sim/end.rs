//! The end of a run as tables that `measure` reads: its grains, and the mass above the opening over time.

use crate::cli::CliError;
use crate::dem::Outcome;
use crate::experiments::Experiment;
use crate::settings::Settings;
use crate::store::atomic;
use clap::Args;
use std::path::PathBuf;

/// What to write at the end.
#[derive(Debug, Args)]
pub struct Options {
    /// Write the grains of the end into this CSV file, as `measure` reads them.
    #[arg(long, value_name = "FILE")]
    particles: Option<PathBuf>,
    /// Write the mass above the opening over the time since the release into this CSV file.
    #[arg(long, value_name = "FILE")]
    flow: Option<PathBuf>,
}

impl Options {
    /// Time of the release [s], where the mass over the time since then is asked for; known before anything is simulated.
    ///
    /// # Errors
    /// An experiment that opens nothing.
    pub fn release(&self, experiment: &dyn Experiment, settings: &Settings) -> Result<Option<f64>, CliError> {
        if self.flow.is_none() {
            return Ok(None);
        }
        let release = settings.get(&format!("{}.release_time", experiment.name()));
        release.map(Some).map_err(|_| format!("{} opens nothing; leave --flow out", experiment.name()).into())
    }

    /// Writes what is asked for; numbers in as many digits as give them back.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, release: Option<f64>, outcome: &Outcome) -> Result<(), CliError> {
        if let Some(path) = &self.particles {
            atomic::publish(path, grains(outcome).as_bytes())?;
        }
        if let (Some(path), Some(release)) = (&self.flow, release) {
            atomic::publish(path, flow(outcome, release).as_bytes())?;
        }
        Ok(())
    }
}

fn grains(outcome: &Outcome) -> String {
    let state = &outcome.state;
    let row = |i: usize| {
        let numbers = [state.x[i], state.y[i], state.z[i], state.radius[i], state.vx[i], state.vy[i], state.vz[i]]
            .map(|x| x.to_string());
        numbers.join(",") + "\n"
    };
    "x [m],y [m],z [m],radius [m],vx [m/s],vy [m/s],vz [m/s]\n".to_owned()
        + &(0..state.len()).map(row).collect::<String>()
}

fn flow(outcome: &Outcome, release: f64) -> String {
    let rows = outcome.trace.iter().map(|point| format!("{},{}\n", point.time - release, point.mass));
    "time [s],mass [kg]\n".to_owned() + &rows.collect::<String>()
}
