//! The discrete-element engine: spheres with a linear visco-elastic contact law, sliding and rolling springs, and walls.
//!
//! Takes a [`Setup`] and a seed, gives an [`Outcome`] or a [`Failure`] through [`simulate`]; a [`Simulation`] is a run that can be
//! looked at and stored on the way, [`World`] the engine itself with grains, or rigid clumps of them, placed by hand. Knows
//! nothing of experiments, KPIs or files, does no input or output, runs on one thread.
//!
//! ```text
//! setup -> validate -> fill -> world: [ integrate -> (rebuild: skin, grid, lists) -> forces: contact, walls -> bridges ] -> outcome
//!                              run: events, trace, stop                               observe: energies, contacts
//! ```
//!
//! Invariants: the same setup and seed give the same bits on every machine; pair forces are added in list order and cancel
//! exactly; a Bond number or spread of zero is bit-identical to its absence; a step allocates nothing once warm.

pub mod bridges;
mod checkpoint;
mod clumps;
mod contact;
mod drag;
mod fill;
mod forces;
mod grid;
mod integrate;
mod lanes;
mod lists;
pub mod material;
mod observe;
mod outcome;
mod particles;
mod period;
mod run;
pub mod setup;
mod sizes;
mod skin;
mod stl;
mod validate;
mod vector;
pub mod walls;
mod world;

pub use checkpoint::{Checkpoint, CheckpointError};
pub use clumps::{Clump, ClumpMotion};
pub use observe::{Contact, Partner};
pub use outcome::{Energies, EventRecord, Failure, Outcome, State, Stop, TracePoint};
pub use particles::Grain;
pub use run::{Simulation, expected_seconds, simulate, simulate_within};
pub use setup::{
    Action, ContactLaw, Damping, Event, Fill, FillArea, Fines, Grains, LiquidBridges, Reference, Region, Rise, Setup,
    Shape, Species, StopRule, Trace, Vec3, Wall, WallSpecies,
};
pub use sizes::SizeDistribution;
pub use stl::{Facet, StlError, facets, mesh};
pub use world::{Vectors, World};

/// Version of the simulated physics; raised with every change that alters the bits of a result. Part of every run's key.
pub const PHYSICS_VERSION: u32 = 3;
