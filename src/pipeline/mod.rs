//! The driver: what is stale and why, and doing it.
//!
//! Takes a study file; keeps tables, lock and store in step. [`plan`] is pure and says what would run, [`run`] does it.
//! A stage is up to date when its key is the one in the lock and its outputs are there; outputs of a key seen before
//! are put back from the store without running anything.

pub mod diff;
pub mod integrity;
pub mod plan;
pub mod run;
pub mod solve;
mod study;

pub use study::{PipelineError, Study};
