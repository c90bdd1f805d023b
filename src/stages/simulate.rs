//! simulate: run the DEM model at every design point, as often as the study repeats.

use super::context::text;
use super::{Context, Demand, Outputs, SettingsText, Stage, StageError, design, never};
use crate::config::Config;
use crate::dem;
use crate::settings::Scope;
use crate::tables::Row;
use crate::tables::list::{ReplicationRow, RunRow, SampleRow};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "simulate",
    version: 2,
    purpose: "run the DEM model at every design point",
    reads: &[SampleRow::SPEC, ReplicationRow::SPEC],
    writes: &[RunRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([
        ("study.seed", config.study.seed.to_string()),
        ("study.repetitions", config.study.repetitions.to_string()),
        ("physics_version", dem::PHYSICS_VERSION.to_string()),
    ]);
    settings.extend(config.settings_text(&["study.step_limit", "experiments"]));
    settings.extend(config.active_text());
    settings.extend(config.setup_text(&config.experiments(), Scope::Simulate));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let requests = design::requests(context, &context.read::<SampleRow>()?, &context.read::<ReplicationRow>()?)?;
    let mut outputs = Outputs::default();
    outputs.table(context.campaign.simulate(&requests)?)?;
    Ok(outputs)
}

/// The design need not have been written: drawing it again gives the same points.
fn demand(context: &Context) -> Result<Demand, StageError> {
    let written = context.has(SampleRow::SPEC) && context.has(ReplicationRow::SPEC);
    let (samples, replications) = match written {
        true => (context.read()?, context.read()?),
        false => design::draw(context).map(|design| (design.samples, design.replications))?,
    };
    let requests = design::requests(context, &samples, &replications)?;
    Ok(Demand::within_bounds(context.config, requests))
}
