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

pub use context::{Context, Outputs, StageError};
pub use diagnose::{Panel, PanelRows};
pub use report::{HTML as REPORT_HTML, SUMMARY as REPORT_SUMMARY};
pub use suggest::{SuggestedPoint, suggest};

use crate::campaign::{CampaignError, Request};
use crate::config::Config;
use crate::tables::TableSpec;
use std::collections::BTreeMap;

/// Settings of a stage as text, by name: what can make it stale, and what `why` compares.
pub type SettingsText = BTreeMap<String, String>;

/// Numbers of runs, by experiment.
pub type RunCounts = BTreeMap<&'static str, usize>;

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
    /// The work.
    pub run: fn(&Context) -> Result<Outputs, StageError>,
    /// The simulations it asks for, as far as its inputs exist; `None` while an input is missing.
    pub simulations: fn(&Context) -> Result<Option<Vec<Request>>, StageError>,
}

/// All stages in the order of the data.
pub const STAGES: &[&Stage] = &[
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

/// The most runs that a stage can ask for while its [`Stage::simulations`] are unknown; `None` where nobody can tell.
pub fn foreseen(stage: &Stage, context: &Context) -> Option<RunCounts> {
    match stage.name {
        name if name == verify::STAGE.name => Some(verify::foreseen(context)),
        name if name == validate::STAGE.name => Some(validate::foreseen(context)),
        _ => None,
    }
}

/// For stages that simulate nothing.
fn no_simulations(_: &Context) -> Result<Option<Vec<Request>>, StageError> {
    Ok(Some(Vec::new()))
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
