//! granulake: a reproducible data lake that calibrates granular (DEM) models against measured data, knows how sure it
//! is, and finds out what the model lacks.
//!
//! ```text
//! sample -> simulate -> kpi -> aggregate -> train -> calibrate -> verify -> validate -> diagnose -> report
//! designs   runs       one row  mean and    GP +     parameters   DEM at    held-out    residuals   HTML
//!                      per run  scatter     scores                optimum   measured    -> effects
//! ```
//!
//! Modules from the bottom up; each may use only those above it (`tests/it/layering.rs` checks it):
//! [`units`], [`canonical`], [`rng`]; [`stats`] and [`dem`]; [`settings`]; [`effects`] and [`experiments`]; [`tables`],
//! [`store`] and [`config`]; [`campaign`] and [`report`]; [`challenge`] and [`stages`]; [`pipeline`]; [`cli`].

pub mod campaign;
pub mod canonical;
pub mod challenge;
pub mod cli;
pub mod config;
pub mod dem;
pub mod effects;
pub mod experiments;
pub mod pipeline;
pub mod report;
pub mod rng;
pub mod settings;
pub mod stages;
pub mod stats;
pub mod store;
pub mod tables;
pub mod units;
