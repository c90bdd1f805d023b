//! sample: draw the design of experiments over the parameter ranges.

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, design, never, no_runs};
use crate::config::Config;
use crate::tables::Row;
use crate::tables::list::{BoundRow, DesignQualityRow, ReplicationRow, SampleRow};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "sample",
    version: 2,
    purpose: "draw the design over the parameter ranges",
    reads: &[BoundRow::SPEC],
    writes: &[SampleRow::SPEC, ReplicationRow::SPEC, DesignQualityRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("study.seed", config.study.seed.to_string())]);
    settings.extend(config.settings_text(&["parameters", "design"]));
    // What the file holds counts, not what it is called.
    let rows = config.chosen.iter().map(|point| format!("{:?} +{}", point.values, point.extra));
    settings.insert("design.points".to_owned(), rows.collect::<Vec<_>>().join("; "));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let design = design::draw(context)?;
    let mut outputs = Outputs::default();
    outputs.table(design.samples)?;
    outputs.table(design.replications)?;
    outputs.table(design.quality)?;
    Ok(outputs)
}
