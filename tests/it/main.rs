//! The integration tests: one binary, one module per subject.

mod attribution;
mod challenge;
mod closed_loop;
mod config;
mod controls;
mod diff;
mod effects;
mod experiments;
mod failures;
mod faults;
mod fuzz;
mod golden;
mod incremental;
mod laboratory;
mod layering;
mod least_squares;
mod oracles_design;
mod oracles_gp;
mod oracles_statistics;
mod physics;
mod pipeline;
mod provenance;
mod report;
mod schemas;
mod store;
mod support;
