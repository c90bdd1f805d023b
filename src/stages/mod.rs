//! Stages: plain functions from tables to tables, and a description of each.
//!
//! A stage reads the tables that earlier stages wrote and gives new ones; the driver in `pipeline` does keys, skipping
//! and publishing. One file and one line in [`STAGES`] each; no stage imports another.

mod aggregate;
mod analyse;
pub mod bounds;
mod calibrate;
mod context;
mod design;
mod diagnose;
mod feasibility;
mod kpi;
mod models;
mod optima;
mod report;
mod sample;
mod simulate;
mod suggest;
mod targets;
mod train;
mod validate;
mod verify;

pub use context::{Content, Context, Known, Outputs, Parts, StageError};
pub use diagnose::{Panel, PanelRows};
pub use report::{HTML as REPORT_HTML, SUMMARY as REPORT_SUMMARY};
pub use suggest::{SuggestedPoint, suggest};

use crate::campaign::{CampaignError, Request};
use crate::config::{Config, DensityBounds};
use crate::tables::TableSpec;
use std::collections::BTreeMap;

/// Settings of a stage as text, by name: what can make it stale, and what `why` compares.
pub type SettingsText = BTreeMap<String, String>;

/// The simulations that a stage asks for, as far as its inputs tell.
pub enum Demand {
    /// These.
    Runs(Vec<Request>),
    /// These besides so many that the table of the stage holds already.
    Besides(usize, Vec<Request>),
    /// So many of every experiment at most: where they will be is not known yet.
    AtMost(BTreeMap<&'static str, usize>),
}

/// Description of a stage.
pub struct Stage {
    /// Name on the command line.
    pub name: &'static str,
    /// Raised when the meaning of the output changes.
    pub version: u32,
    /// What it does, for `plan` and `--help`.
    pub purpose: &'static str,
    /// Tables it reads.
    pub reads: &'static [&'static TableSpec],
    /// Tables it writes.
    pub writes: &'static [&'static TableSpec],
    /// Files it writes besides tables, relative to the artifacts directory.
    pub files: &'static [&'static str],
    /// Whether it reads measured data.
    pub measured: bool,
    /// The only settings that can make it stale.
    pub settings: fn(&Config) -> SettingsText,
    /// Why a study has no need of it, where it has none: nothing runs then, and nothing is written.
    pub skipped: fn(&Config) -> Option<&'static str>,
    /// The work.
    pub run: fn(&Context) -> Result<Outputs, StageError>,
    /// The simulations it asks for.
    pub demand: fn(&Context) -> Result<Demand, StageError>,
}

/// All stages in the order of the data.
pub const STAGES: &[&Stage] = &[
    &bounds::STAGE,
    &sample::STAGE,
    &simulate::STAGE,
    &kpi::STAGE,
    &aggregate::STAGE,
    &train::STAGE,
    &analyse::STAGE,
    &feasibility::STAGE,
    &calibrate::STAGE,
    &verify::STAGE,
    &validate::STAGE,
    &diagnose::STAGE,
    &report::STAGE,
];

impl Demand {
    /// `requests` at points between the bounds of the parameters: only their number is known while bounds are sought.
    fn within_bounds(config: &Config, requests: Vec<Request>) -> Self {
        if config.bounds.density != DensityBounds::Sought {
            return Self::Runs(requests);
        }
        let mut counts = BTreeMap::new();
        for request in &requests {
            *counts.entry(request.experiment.name()).or_default() += 1;
        }
        Self::AtMost(counts)
    }
}

/// For stages that every study needs.
fn never(_: &Config) -> Option<&'static str> {
    None
}

/// For stages that simulate nothing.
fn no_runs(_: &Context) -> Result<Demand, StageError> {
    Ok(Demand::Runs(Vec::new()))
}

/// The stage called `name`.
pub fn find(name: &str) -> Option<&'static Stage> {
    STAGES.iter().copied().find(|stage| stage.name == name)
}

impl From<CampaignError> for StageError {
    fn from(source: CampaignError) -> Self {
        Self::Campaign(source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_read_was_written_by_an_earlier_stage() {
        let mut written = Vec::new();
        for stage in STAGES {
            for table in stage.reads {
                assert!(written.contains(&table.name), "{} reads {} before it is written", stage.name, table.name);
            }
            written.extend(stage.writes.iter().map(|table| table.name));
        }
        let mut unique = written.clone();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!(unique.len(), written.len(), "a table has two writers: {written:?}");
    }
}
