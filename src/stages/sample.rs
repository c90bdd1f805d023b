//! sample: draw the design of experiments over the parameter ranges.
//!
//! A full factorial covers the boundary (27 points for three parameters), a Latin hypercube fills the inside, spread
//! conditional on the boundary points, and the validation points are spread conditional on both (paper, section 4.2).
//! A hypercube of one point more is another hypercube; points that are added later are put between all others instead.

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, no_simulations};
use crate::campaign::Point;
use crate::config::Config;
use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
use crate::stats::design::{factorial, farthest};
use crate::stats::points::Points;
use crate::tables::Row;
use crate::tables::list::SampleRow;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "sample",
    version: 1,
    purpose: "draw the design over the parameter ranges",
    reads: &[],
    writes: &[SampleRow::SPEC],
    files: &[],
    measured: false,
    settings,
    run,
    simulations: no_simulations,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("study.seed", config.study.seed.to_string())]);
    settings.extend(config.settings_text(&["parameters", "design"]));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let mut outputs = Outputs::default();
    outputs.table(draw(context.config, context.seed("sample"))?)?;
    Ok(outputs)
}

/// The rows of the design: the same arguments give the same rows on every machine.
pub fn draw(config: &Config, seed: u64) -> Result<Vec<SampleRow>, StageError> {
    let p = config.parameters.len();
    let boundary = factorial(config.design.boundary_levels as usize, p);
    let interior = spread(config.design.interior as usize, &boundary, seed);
    let validation = spread(config.design.validation as usize, &boundary.joined(&interior), seed ^ 1);
    let added = farthest(config.design.added as usize, &boundary.joined(&interior).joined(&validation))
        .map_err(|error| StageError::Input { what: error.to_string(), remedy: "set design.added to 0" })?;
    let mut rows = Vec::new();
    let mut number = 0;
    // Added points come last, so that the others keep their numbers.
    let sets = [("boundary", &boundary), ("interior", &interior), ("validation", &validation), ("interior", &added)];
    for (set, points) in sets {
        for point in points.rows() {
            number += 1;
            rows.extend(point_rows(config, set, number, point)?);
        }
    }
    Ok(rows)
}

fn spread(count: usize, existing: &Points, seed: u64) -> Points {
    if count == 0 {
        return Points::empty(existing.dimension());
    }
    conditional_latin_hypercube(count, existing, &Annealing { seed, ..Annealing::default() }).points
}

fn point_rows(config: &Config, set: &str, number: u32, unit: &[f64]) -> Result<Vec<SampleRow>, StageError> {
    let parameters = || config.parameters.iter().zip(unit);
    let values: Vec<_> =
        parameters().map(|(parameter, u)| (parameter.name.to_owned(), parameter.from_unit(*u))).collect();
    let hash = Point::new(number, config.base_settings(), &values)?.hash()?.to_string();
    let row = |((parameter, u), (_, value)): ((&crate::config::Parameter, &f64), &(String, f64))| SampleRow {
        point: number,
        set: set.to_owned(),
        parameter: parameter.name.to_owned(),
        value: *value,
        unit: parameter.unit.to_owned(),
        unit_value: *u,
        parameter_hash: hash.clone(),
    };
    Ok(parameters().zip(&values).map(row).collect())
}
