//! Pure numerics: designs, Gaussian processes, metamodels, calibration, sensitivity, summaries, attribution.
//!
//! Takes and gives numbers; knows nothing of grains, files, stages or settings. Everything here is deterministic:
//! the same arguments give the same bits on every machine and for any number of threads. Elementary functions come
//! from `libm`, sums run in a fixed order, random numbers come from named streams ([`crate::rng`]).

pub mod attribution;
pub mod design;
pub mod ensemble;
pub mod gp;
mod kernels;
pub mod linalg;
pub mod metamodel;
pub mod naming;
pub mod next;
pub mod objective;
pub mod optimise;
pub mod points;
pub mod sensitivity;
pub mod special;
pub mod summary;
