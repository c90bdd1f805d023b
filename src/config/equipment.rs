//! Equipment of the user: the STL files that a study names, as meshes in metres.

use super::Config;
use super::problem::Problems;
use crate::dem::{Facet, Region, facets};
use crate::experiments::{self, Experiment};
use crate::settings::{Equipment, MATERIALS};
use crate::units;
use std::path::Path;

/// Reads the mesh of every `[[equipment]]`, sorted by experiment and name: their order in the file makes no difference.
///
/// # Errors
/// Every mesh that cannot be taken, with the key that is to blame and a remedy.
pub fn read(config: &Config) -> Result<Vec<Equipment>, Problems> {
    let mut ids = config.reading.lists.get("equipment").cloned().unwrap_or_default();
    ids.sort();
    let (mut equipment, mut problems) = (Vec::new(), Vec::new());
    for id in ids {
        match piece(config, &id) {
            Ok(piece) => equipment.push(piece),
            Err((key, what)) => problems.push(config.problem(&format!("equipment.{id}.{key}"), &what)),
        }
    }
    Problems::none_in(problems).map(|()| equipment)
}

/// What is wrong, and the key that is to blame.
type Complaint = (&'static str, String);

fn piece(config: &Config, id: &str) -> Result<Equipment, Complaint> {
    let text = |key: &str| config.reading.values.text(&format!("equipment.{id}.{key}"));
    let experiment = experiments::find(text("experiment")).map_err(|error| ("experiment", error.to_string()))?;
    let (name, file) = (text("name"), Path::new(text("stl")));
    let factor = units::convert(1.0, text("unit"), "m").map_err(|error| ("unit", error.to_string()))?;
    let path = config.resolve(file);
    let told = |what: String| ("stl", format!("`{}`: {what}", path.display()));
    let bytes = std::fs::read(&path)
        .map_err(|error| told(format!("{error}; give a file, with its path relative to the study")))?;
    let facets = facets(&bytes, factor).map_err(|error| told(error.to_string()))?;
    fits(config, experiment, name, &facets)?;
    // The declaration admits these names only.
    let material = MATERIALS.iter().position(|known| *known == text("material")).unwrap_or_default();
    Equipment::new(experiment.name(), name, material, facets).map_err(|error| told(error.to_string()))
}

/// Whether the mesh stands in the apparatus under a name that none of its walls has. Settings that describe no apparatus
/// are told elsewhere.
fn fits(config: &Config, experiment: &dyn Experiment, name: &str, facets: &[Facet]) -> Result<(), Complaint> {
    let Ok(apparatus) = experiment.apparatus(config.base_settings()) else { return Ok(()) };
    if apparatus.walls.iter().any(|wall| wall.name == name) {
        let walls: Vec<&str> = apparatus.walls.iter().map(|wall| wall.name.as_str()).collect();
        let what = format!("is a wall of the apparatus, which has {}; take another name", walls.join(", "));
        return Err(("name", what));
    }
    let Region { lower, upper } = apparatus.domain;
    let [low, high] = extent(facets);
    if (0..3).all(|axis| low[axis] <= upper[axis] && lower[axis] <= high[axis]) {
        return Ok(());
    }
    let span = |low: [f64; 3], high: [f64; 3]| {
        let axis = |(name, k): (&str, usize)| format!("{name} {} to {} m", number(low[k]), number(high[k]));
        [("x", 0), ("y", 1), ("z", 2)].map(axis).join(", ")
    };
    let (mesh, room) = (span(low, high), span(lower, upper));
    Err(("unit", format!("the mesh ({mesh}) lies outside the apparatus ({room}); is this the unit of the file?")))
}

fn number(value: f64) -> String {
    units::significant(value, 3)
}

/// Lowest and highest coordinates.
fn extent(facets: &[Facet]) -> [[f64; 3]; 2] {
    let corners = || facets.iter().flatten();
    let least = |axis: usize| corners().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
    let most = |axis: usize| corners().map(|corner| corner[axis]).fold(f64::NEG_INFINITY, f64::max);
    [[0, 1, 2].map(least), [0, 1, 2].map(most)]
}
