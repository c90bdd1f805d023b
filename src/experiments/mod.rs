//! Experiments: what is built, done and read off in the laboratory, one file and one line in [`EXPERIMENTS`] each.
//!
//! Takes settings; gives a simulation set-up, and from its final state and trace the observables, the KPI first. A
//! value that cannot be given is a typed [`Reason`], never a gap. Deliberately runs nothing and stores nothing.

mod build;
mod bulk_density;
mod flow;
mod hopper;
mod ledge;
mod pile;
mod profile;
mod raw;
mod reason;

pub use profile::{Grain, Slope, View, Window};
pub use raw::{Raw, observe, since_release};
pub use reason::Reason;

use crate::dem::{Setup, State, TracePoint};
use crate::settings::Settings;

/// Every experiment that a study can name.
pub const EXPERIMENTS: &[&dyn Experiment] = &[&pile::Pile, &ledge::Ledge, &bulk_density::BulkDensity, &hopper::Hopper];

/// A quantity that the laboratory can read off an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Observable {
    /// Name in tables; unique over all experiments.
    pub name: &'static str,
    /// Unit of its values.
    pub unit: &'static str,
    /// Definition.
    pub meaning: &'static str,
    /// Whether it is the experiment's KPI, which models are calibrated on.
    pub is_kpi: bool,
}

/// An observable with its value, or why there is none.
pub type Measurement = (&'static str, Result<f64, Reason>);

/// An apparatus and what is read off it.
pub trait Experiment: Sync {
    /// Name in studies and tables.
    fn name(&self) -> &'static str;
    /// What is read off, the KPI first.
    fn observables(&self) -> &'static [Observable];
    /// Geometry and programme, without equipment.
    ///
    /// # Errors
    /// Dimensions or times that contradict each other.
    fn apparatus(&self, settings: &Settings) -> Result<Setup, SetupError>;
    /// Geometry and programme, with the equipment that the settings put in the apparatus: what is simulated.
    ///
    /// # Errors
    /// Dimensions or times that contradict each other.
    fn setup(&self, settings: &Settings) -> Result<Setup, SetupError> {
        let mut setup = self.apparatus(settings)?;
        setup.walls.extend(settings.equipment(self.name()).flat_map(|piece| build::equipment(settings, piece)));
        Ok(setup)
    }
    /// One entry per observable, in their order, from the final grains and the trace of a run with these settings.
    fn measure(&self, settings: &Settings, state: &State, trace: &[TracePoint]) -> Vec<Measurement>;
    /// Observables that the force on a load cell over time shows by itself.
    fn read_off_force(&self) -> &'static [&'static str] {
        &[]
    }
    /// Observables that the outline in a picture shows by itself.
    fn read_off_outline(&self) -> &'static [&'static str] {
        &[]
    }
}

/// Settings that are each allowed but together describe no apparatus.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{experiment}: `{small}` ({low} {unit}) must be below `{large}` ({high} {unit})")]
pub struct SetupError {
    /// The experiment.
    pub experiment: &'static str,
    /// Setting that must be the smaller.
    pub small: &'static str,
    /// Its value.
    pub low: f64,
    /// Setting that must be the larger.
    pub large: &'static str,
    /// Its value.
    pub high: f64,
    /// Unit of both.
    pub unit: &'static str,
}

/// No experiment has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no experiment is called `{name}`; there are: {known}")]
pub struct UnknownExperiment {
    /// The name asked for.
    pub name: String,
    /// All names, separated by commas.
    pub known: String,
}

/// The experiment called `name`.
///
/// # Errors
/// [`UnknownExperiment`] with all names.
pub fn find(name: &str) -> Result<&'static dyn Experiment, UnknownExperiment> {
    EXPERIMENTS.iter().copied().find(|experiment| experiment.name() == name).ok_or_else(|| {
        let known = EXPERIMENTS.iter().map(|experiment| experiment.name()).collect::<Vec<_>>().join(", ");
        UnknownExperiment { name: name.to_owned(), known }
    })
}

const fn kpi(name: &'static str, unit: &'static str, meaning: &'static str) -> Observable {
    Observable { name, unit, meaning, is_kpi: true }
}

const fn extra(name: &'static str, unit: &'static str, meaning: &'static str) -> Observable {
    Observable { name, unit, meaning, is_kpi: false }
}
