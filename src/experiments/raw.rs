//! What a laboratory records, read by the code that reads a simulation: a load cell's force over time and the outline of
//! a heap in a picture.
//!
//! A force becomes the mass that hangs on the cell, force/g; a point of an outline becomes a grain without size in the
//! front layer, so that the highest point of each bin is marked as the highest z + r is. Errors that the settings give
//! to the instruments of a *simulated* laboratory are left out, because a real record holds its own; bins follow the
//! true grains, not those of a coarse set-up. Deliberately no smoothing and no detection of the release.

use super::{Experiment, Measurement};
use crate::dem::{State, TracePoint};
use crate::settings::{Settings, SettingsError};

/// One record of one repetition.
#[derive(Debug, Clone, PartialEq)]
pub enum Raw {
    /// Samples (time since the release [s], force of the material on the load cell [N]) in the order of time (paper,
    /// section 2.3, Fig. 5). Samples before the release have negative times.
    Force(Vec<(f64, f64)>),
    /// Points (x, z) [m] on the edge of the material as seen from the front, in any order (paper, section 2.3, Fig. 4).
    /// x counts from the centre line of the pile and from the back wall of the ledge, z from the floor.
    Outline(Vec<(f64, f64)>),
}

/// Errors of simulated instruments.
const INSTRUMENT_ERRORS: [&str; 3] = ["camera_roll", "hopper.load_cell_gain", "bulk_density.tare"];

/// The observables of `experiment` that `raw` shows, with their values or the reason why there is none; empty where the
/// experiment reads nothing off such a record.
///
/// # Errors
/// Settings that cannot be those of a real laboratory, which the declared ranges exclude.
pub fn observe(experiment: &dyn Experiment, settings: &Settings, raw: &Raw) -> Result<Vec<Measurement>, SettingsError> {
    let settings = laboratory(experiment, settings)?;
    let (readable, state, trace) = match raw {
        Raw::Force(samples) => {
            let gravity = settings["gravity"];
            let masses: Vec<_> = samples.iter().map(|(time, force)| (*time, force / gravity)).collect();
            (experiment.read_off_force(), State::default(), since_release(experiment, &settings, &masses))
        }
        Raw::Outline(points) => (experiment.read_off_outline(), state(points), Vec::new()),
    };
    let measured = experiment.measure(&settings, &state, &trace);
    Ok(measured.into_iter().filter(|(name, _)| readable.contains(name)).collect())
}

/// The same operator with faultless instruments and grains of their true size.
fn laboratory(experiment: &dyn Experiment, settings: &Settings) -> Result<Settings, SettingsError> {
    let mut settings = settings.clone();
    for name in INSTRUMENT_ERRORS {
        settings.set(name, 0.0)?;
    }
    settings.set("radius_scale", 1.0)?;
    settings.set(&format!("{}.radius_scale", experiment.name()), 1.0)?;
    Ok(settings)
}

/// Samples (time since the release [s], mass above the opening [kg]) as the trace of a run with these settings.
pub fn since_release(experiment: &dyn Experiment, settings: &Settings, samples: &[(f64, f64)]) -> Vec<TracePoint> {
    let release = settings.get(&format!("{}.release_time", experiment.name())).unwrap_or(0.0);
    samples.iter().map(|(time, mass)| TracePoint { time: release + time, mass: *mass }).collect()
}

fn state(points: &[(f64, f64)]) -> State {
    let zeros = || vec![0.0; points.len()];
    State {
        id: (0..).take(points.len()).collect(),
        x: points.iter().map(|point| point.0).collect(),
        z: points.iter().map(|point| point.1).collect(),
        radius: zeros(),
        y: zeros(),
        vx: zeros(),
        vy: zeros(),
        vz: zeros(),
        wx: zeros(),
        wy: zeros(),
        wz: zeros(),
    }
}
