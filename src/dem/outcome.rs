//! What a simulation gives: final state, trace, counts, or a typed failure that says where and why.

use super::checkpoint::stored;
use super::setup::Vec3;

/// State of the grains, structure of arrays in order of insertion; every array has one entry per grain. At the end of a run a
/// clump is one grain, the sphere of its volume.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct State {
    /// Number of the grain in order of insertion; deleted grains leave gaps.
    pub id: Vec<u32>,
    /// Radius [m].
    pub radius: Vec<f64>,
    /// Centre, x [m].
    pub x: Vec<f64>,
    /// Centre, y [m].
    pub y: Vec<f64>,
    /// Centre, z [m].
    pub z: Vec<f64>,
    /// Velocity, x [m/s].
    pub vx: Vec<f64>,
    /// Velocity, y [m/s].
    pub vy: Vec<f64>,
    /// Velocity, z [m/s].
    pub vz: Vec<f64>,
    /// Angular velocity, x [rad/s].
    pub wx: Vec<f64>,
    /// Angular velocity, y [rad/s].
    pub wy: Vec<f64>,
    /// Angular velocity, z [rad/s].
    pub wz: Vec<f64>,
}

/// One sample of the trace.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TracePoint {
    /// Time [s].
    pub time: f64,
    /// Mass of the grains whose centre is in the region [kg].
    pub mass: f64,
}

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// Kinetic over elastic energy fell below the limit: at rest.
    EnergyRatio,
    /// The region to be emptied is empty.
    Empty,
    /// The time cap was reached while grains still moved or remained.
    TimeCap,
}

impl Stop {
    /// The word for it, in tables and on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::EnergyRatio => "energy_ratio",
            Self::Empty => "empty",
            Self::TimeCap => "time_cap",
        }
    }
}

/// Energies of all grains and contacts [J].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energies {
    /// Translational kinetic energy, Σ ½ m v².
    pub translational: f64,
    /// Rotational kinetic energy, Σ ½ I ω² with I = 2/5 m R².
    pub rotational: f64,
    /// Elastic energy of all springs, Σ ½ (k δ² + k_s ξ² + k_r ξ_r²).
    pub elastic: f64,
    /// Potential energy in gravity, -Σ m g·x.
    pub potential: f64,
}

impl Energies {
    /// Sum of all [J].
    pub fn total(&self) -> f64 {
        self.translational + self.rotational + self.elastic + self.potential
    }

    /// Translational kinetic over elastic energy [-], which the stop rule looks at; `None` where no spring holds energy.
    pub fn ratio(&self) -> Option<f64> {
        (self.elastic > 0.0).then(|| self.translational / self.elastic)
    }
}

/// What an event found and did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EventRecord {
    /// Time at which it ran [s].
    pub time: f64,
    /// Grains it deleted.
    pub deleted: usize,
    /// Energies just before it.
    pub energies: Energies,
}

stored!(TracePoint { time, mass });
stored!(Energies { translational, rotational, elastic, potential });
stored!(EventRecord { time, deleted, energies });

/// Result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Grains at the end.
    pub state: State,
    /// Samples of the mass in the trace's region; empty without a trace.
    pub trace: Vec<TracePoint>,
    /// Why the run ended.
    pub stop: Stop,
    /// Time steps made.
    pub steps: u64,
    /// Time step [s].
    pub time_step: f64,
    /// Simulated time [s].
    pub time: f64,
    /// Grains inserted.
    pub inserted: usize,
    /// Attempts of the insertion.
    pub attempts: u64,
    /// Grains deleted by events.
    pub deleted: usize,
    /// Grains that left the domain.
    pub lost: usize,
    /// One record per event that ran, in order of time.
    pub events: Vec<EventRecord>,
    /// Energies at the end.
    pub energies: Energies,
    /// Mean number of touching grains and walls per grain at the end; 0 without grains.
    pub coordination_number: f64,
    /// Largest overlap over the radius of the smaller grain, at any looked-at time of the run [-].
    pub max_overlap: f64,
    /// Neighbour lists built, a figure of merit of the engine.
    pub rebuilds: u64,
    /// Sum over the steps of the number of grains: the work done, in particle-steps.
    pub particle_steps: u64,
}

/// Why a run has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The setup contradicts itself.
    #[error("invalid setup: {what}; {remedy}")]
    InvalidSetup {
        /// What is wrong, with the value.
        what: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The insertion plane left the domain before the volume was reached.
    #[error(
        "insertion reached z = {height:.3} m, the top of the domain, with {inserted} grains and {volume:.3e} of {wanted:.3e} m³; \
         raise the domain, lower the volume or the plane step"
    )]
    FillOverflow {
        /// Height of the plane [m].
        height: f64,
        /// Grains inserted so far.
        inserted: usize,
        /// Volume inserted so far [m³].
        volume: f64,
        /// Volume asked for [m³].
        wanted: f64,
    },
    /// No place was found for a grain at the density that was asked for.
    #[error(
        "insertion found no room for grain {inserted} at z = {height:.3} m in {attempts} attempts; lower the insertion density"
    )]
    FillJammed {
        /// Height of the plane [m].
        height: f64,
        /// Grains inserted so far.
        inserted: usize,
        /// Attempts in a row.
        attempts: u64,
    },
    /// Two grains, or a grain and a wall, overlap so far that the contact law means nothing.
    #[error(
        "exploded at step {step}, t = {time:.6} s: grain {grain} at ({:.4}, {:.4}, {:.4}) m overlaps {with} by {:.0} % of its radius; \
         use a smaller time step or a higher stiffness",
        position[0], position[1], position[2], overlap * 100.0
    )]
    Overlap {
        /// Step.
        step: u64,
        /// Time [s].
        time: f64,
        /// Number of the grain in order of insertion.
        grain: u32,
        /// Centre of the grain [m].
        position: Vec3,
        /// Overlap over radius [-].
        overlap: f64,
        /// The other side: `grain 12` or `wall floor`.
        with: String,
    },
    /// A grain's energy is not a finite number.
    #[error(
        "exploded at step {step}, t = {time:.6} s: the energy of grain {grain} is not finite; use a smaller time step"
    )]
    NotFinite {
        /// Step.
        step: u64,
        /// Time [s].
        time: f64,
        /// Number of the grain in order of insertion.
        grain: u32,
    },
    /// No grain reached the height up to which the vessel was to be filled.
    #[error(
        "underfilled: at t = {time:.6} s no grain lay above the fill height z = {height:.4} m, the highest at {highest:.4} m; \
         insert more (`insertion_ratio`), or let the grains settle before they are levelled"
    )]
    Underfilled {
        /// Step.
        step: u64,
        /// Time [s].
        time: f64,
        /// Fill height asked for [m].
        height: f64,
        /// Highest grain, by the same reference as the height [m].
        highest: f64,
    },
    /// The run needs more steps than allowed.
    #[error("needs more than {limit} time steps; raise the limit, or find out why the grains do not come to rest")]
    StepLimit {
        /// Steps allowed, all of them made.
        limit: u64,
    },
}

impl Failure {
    /// Steps made until the run failed; none where it never started.
    pub const fn steps(&self) -> Option<u64> {
        match self {
            Self::Overlap { step, .. } | Self::NotFinite { step, .. } | Self::Underfilled { step, .. } => Some(*step),
            Self::StepLimit { limit } => Some(*limit),
            Self::InvalidSetup { .. } | Self::FillOverflow { .. } | Self::FillJammed { .. } => None,
        }
    }
}

impl State {
    /// Number of grains.
    pub fn len(&self) -> usize {
        self.radius.len()
    }

    /// Whether there is no grain.
    pub fn is_empty(&self) -> bool {
        self.radius.is_empty()
    }
}
