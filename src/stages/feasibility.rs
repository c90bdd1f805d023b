//! feasibility: do the simulations at the bounds bracket every measured mean?
//!
//! A target outside what the corners and the boundary of the design give cannot be reached without extrapolation, however
//! well the metamodels are (paper, section 4.1: the bounds "contain the experimentally found calibration targets").

use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs};
use crate::config::{Config, Measured, MeasuredSummary};
use crate::tables::Row;
use crate::tables::list::{AggregateRow, FeasibilityRow, SampleRow};
use std::collections::{BTreeMap, BTreeSet};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "feasibility",
    version: 1,
    purpose: "do the simulations at the bounds bracket every measured mean?",
    reads: &[SampleRow::SPEC, AggregateRow::SPEC],
    writes: &[FeasibilityRow::SPEC],
    files: &[],
    measured: true,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    config.settings_text(&["study.repetitions", "experiments"])
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let sets = point_sets(&context.read::<SampleRow>()?);
    let last = context.config.study.repetitions;
    let aggregates: Vec<AggregateRow> =
        context.read::<AggregateRow>()?.into_iter().filter(|row| row.n == last).collect();
    let mut rows = Vec::new();
    for set in context.measured {
        for target in set.statistics() {
            let own: Vec<&AggregateRow> = aggregates.iter().filter(|row| row.kpi == target.kpi).collect();
            if !own.is_empty() {
                rows.extend(sets.iter().map(|(name, points)| row(set, &target, name, points, &own)));
            }
        }
    }
    let mut outputs = Outputs::default();
    outputs.table(rows)?;
    Ok(outputs)
}

/// Numbers of the corner points, of the boundary points and of all points that metamodels are trained on.
fn point_sets(samples: &[SampleRow]) -> BTreeMap<&'static str, BTreeSet<u32>> {
    let mut inner: BTreeSet<u32> = BTreeSet::new();
    let mut sets: BTreeMap<&'static str, BTreeSet<u32>> = BTreeMap::new();
    for row in samples.iter().filter(|row| row.set != "validation") {
        sets.entry("design").or_default().insert(row.point);
        if row.set == "boundary" {
            sets.entry("boundary").or_default().insert(row.point);
            sets.entry("corner").or_default().insert(row.point);
        }
        if row.unit_value != 0.0 && row.unit_value != 1.0 {
            inner.insert(row.point);
        }
    }
    if let Some(corners) = sets.get_mut("corner") {
        corners.retain(|point| !inner.contains(point));
    }
    sets
}

fn row(
    set: &Measured,
    target: &MeasuredSummary,
    name: &str,
    points: &BTreeSet<u32>,
    aggregates: &[&AggregateRow],
) -> FeasibilityRow {
    let known = aggregates.iter().filter(|row| points.contains(&row.point));
    let known: Vec<(f64, &AggregateRow)> = known.filter_map(|row| Some((row.mean?, *row))).collect();
    let lowest = known.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let highest = known.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let bracketed =
        lowest.is_some_and(|(mean, _)| *mean <= target.mean) && highest.is_some_and(|(mean, _)| target.mean <= *mean);
    let nearest = if lowest.is_some_and(|(mean, _)| target.mean < *mean) { lowest } else { highest };
    let outside = nearest.map(|(mean, row)| {
        let scatter = row.sd.unwrap_or(0.0).max(target.sd);
        if bracketed { 0.0 } else { (target.mean - mean).abs() / scatter }
    });
    FeasibilityRow {
        measured: set.name.clone(),
        experiment: target.experiment.to_owned(),
        kpi: target.kpi.to_owned(),
        set: name.to_owned(),
        points: known.len() as u32,
        lowest: lowest.map(|(mean, _)| *mean),
        lowest_point: lowest.map(|(_, row)| row.point),
        highest: highest.map(|(mean, _)| *mean),
        highest_point: highest.map(|(_, row)| row.point),
        target: target.mean,
        bracketed,
        outside_sd: outside.filter(|value| value.is_finite()),
        unit: target.unit.to_owned(),
    }
}
