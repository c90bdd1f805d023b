//! simulate: run the DEM model at every design point, as often as the study repeats.

use super::context::text;
use super::design::{self, Runs};
use super::{Context, Demand, Outputs, Parts, SettingsText, Stage, StageError, never};
use crate::campaign::Request;
use crate::canonical::Encoder;
use crate::config::Config;
use crate::dem;
use crate::experiments::Experiment;
use crate::settings::Scope;
use crate::store::table::blocks;
use crate::tables::Row;
use crate::tables::list::{ReplicationRow, RunRow, SampleRow};
use std::ops::RangeInclusive;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "simulate",
    version: 4,
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

/// A part of the table holds one block of repetitions of all points in one experiment; only those that are not in place
/// are looked into. What they lack is simulated at once, so that no thread waits for the end of a part.
fn run(context: &Context) -> Result<Outputs, StageError> {
    let runs = Runs::new(context.config, &context.read()?, &context.read()?)?;
    let places = places(context, &runs)?;
    let mut table = Parts::new(context, RunRow::SPEC);
    context.campaign.compute(&outstanding(&runs, &table, &places)?.0)?;
    for place in places {
        let rows = || Ok(context.campaign.rows(&runs.of(place.experiment, &place.block)?)?);
        table.add(place.experiment.name(), &place.inputs, rows)?;
    }
    Ok(table.finish())
}

/// Where a part of the table has its rows from.
struct Place {
    experiment: &'static dyn Experiment,
    block: RangeInclusive<u32>,
    inputs: Encoder,
}

/// The parts in their order: by name of the experiment and by repetition.
fn places(context: &Context, runs: &Runs) -> Result<Vec<Place>, StageError> {
    let (samples, replications) = (context.digest(SampleRow::SPEC)?, context.digest(ReplicationRow::SPEC)?);
    let mut experiments = context.config.experiments();
    experiments.sort_by_key(|experiment| experiment.name());
    let place = |experiment, block: RangeInclusive<u32>| {
        // Beyond the repetitions of the study a block holds the extra runs of some points only.
        let of_all_points = context.config.study.repetitions.min(*block.end());
        let mut inputs = Encoder::new();
        inputs.bytes(&samples.0).bytes(&replications.0);
        inputs.u64((*block.start()).into()).u64((*block.end()).into()).u64(of_all_points.into());
        Place { experiment, block, inputs }
    };
    let of_experiment =
        |experiment| blocks(runs.last(), runs.points()).into_iter().map(move |block| place(experiment, block));
    Ok(experiments.into_iter().flat_map(of_experiment).collect())
}

/// The runs of the parts that are not in place, and how many there are in the others.
fn outstanding(runs: &Runs, table: &Parts, places: &[Place]) -> Result<(Vec<Request>, usize), StageError> {
    let (mut requests, mut in_place) = (Vec::new(), 0);
    for place in places {
        match table.known(place.experiment.name(), &place.inputs) {
            Some(_) => in_place += runs.count(&place.block),
            None => requests.extend(runs.of(place.experiment, &place.block)?),
        }
    }
    Ok((requests, in_place))
}

/// The design need not have been written: drawing it again gives the same points. Of runs in place the first repetition
/// is asked for all the same, because it tells what a run costs.
fn demand(context: &Context) -> Result<Demand, StageError> {
    if !context.has(SampleRow::SPEC) || !context.has(ReplicationRow::SPEC) {
        let design = design::draw(context)?;
        let runs = Runs::new(context.config, &design.samples, &design.replications)?;
        return Ok(Demand::within_bounds(context.config, runs.all()?));
    }
    let runs = Runs::new(context.config, &context.read()?, &context.read()?)?;
    let table = Parts::new(context, RunRow::SPEC);
    let places = places(context, &runs)?;
    let (mut requests, mut in_place) = outstanding(&runs, &table, &places)?;
    let first =
        |place: &&Place| *place.block.start() == 1 && table.known(place.experiment.name(), &place.inputs).is_some();
    for place in places.iter().filter(first) {
        let first = runs.of(place.experiment, &(1..=1))?;
        in_place -= first.len();
        requests.extend(first);
    }
    Ok(if in_place == 0 {
        Demand::within_bounds(context.config, requests)
    } else {
        Demand::Besides(in_place, requests)
    })
}
