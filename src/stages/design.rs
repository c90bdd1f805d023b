//! The design: drawn over the parameter ranges, and the runs it asks for, every point in every fitted experiment.
//!
//! A full factorial covers the boundary (27 points for three parameters), a Latin hypercube fills the inside, spread
//! conditional on the boundary points, and the validation points are spread conditional on both (paper, section 4.2).
//! Beyond four parameters a shifted Sobol sequence takes the place of the hypercube.
//! A hypercube of one point more is another hypercube; points that are added later are put between all others instead.

use super::{Context, StageError};
use crate::campaign::{Point, Request, Values};
use crate::config::{Config, Filling, Parameter};
use crate::experiments::Experiment;
use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
use crate::stats::design::metrics::{min_distance, min_distance_between};
use crate::stats::design::sobol::{Sobol, TooManyDimensions};
use crate::stats::design::{factorial, farthest};
use crate::stats::points::Points;
use crate::tables::list::{DesignQualityRow, ReplicationRow, SampleRow};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Label of the runs of the design.
pub const LABEL: &str = "design";

/// A design as rows of its tables.
pub struct Design {
    /// Every point, a row per parameter.
    pub samples: Vec<SampleRow>,
    /// Runs beyond `study.repetitions`, by point.
    pub replications: Vec<ReplicationRow>,
    /// The distances that every part of the design reached.
    pub quality: Vec<DesignQualityRow>,
}

/// Draws the design: the same study gives the same points on every machine.
///
/// # Errors
/// More parameters or points than the sequences offer.
pub fn draw(context: &Context) -> Result<Design, StageError> {
    let mut parts = parts(context.config, context.seed("sample"))?;
    let replications = choose(context.config, &mut parts);
    Ok(Design { samples: rows(context.config, &parts)?, replications, quality: quality(&parts) })
}

/// The points of the design with their settings, by number.
///
/// # Errors
/// A point outside the bounds of a setting.
pub fn points(config: &Config, samples: &[SampleRow]) -> Result<BTreeMap<u32, Arc<Point>>, StageError> {
    let mut values: BTreeMap<u32, Values> = BTreeMap::new();
    for row in samples {
        values.entry(row.point).or_default().push((row.parameter.clone(), row.value));
    }
    let point = |(number, values): (u32, Values)| {
        let point = Point::new(number, config.base_settings(), &values)?.knowing(&config.effects.library);
        Ok((number, Arc::new(point.with_effects(&config.effects.active))))
    };
    values.into_iter().map(point).collect()
}

/// The runs that a design asks for.
pub struct Runs<'a> {
    config: &'a Config,
    points: BTreeMap<u32, Arc<Point>>,
    /// Runs beyond `study.repetitions`, by point.
    extra: BTreeMap<u32, u32>,
}

impl<'a> Runs<'a> {
    /// The runs at these points.
    ///
    /// # Errors
    /// A point outside the bounds of a setting.
    pub fn new(config: &'a Config, samples: &[SampleRow], replications: &[ReplicationRow]) -> Result<Self, StageError> {
        let extra = replications.iter().map(|row| (row.point, row.extra)).collect();
        Ok(Self { config, points: points(config, samples)?, extra })
    }

    fn repetitions(&self, point: u32) -> u32 {
        self.config.study.repetitions + self.extra.get(&point).copied().unwrap_or(0)
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.points.len()
    }

    /// The last repetition of any point.
    pub fn last(&self) -> u32 {
        self.points.keys().map(|point| self.repetitions(*point)).max().unwrap_or(0)
    }

    /// Those of some repetitions in one experiment, by point and repetition.
    ///
    /// # Errors
    /// A parameter value that is NaN.
    pub fn of(
        &self,
        experiment: &'static dyn Experiment,
        block: &RangeInclusive<u32>,
    ) -> Result<Vec<Request>, StageError> {
        let mut requests = Vec::new();
        for (number, point) in &self.points {
            let repetitions = *block.start()..=self.repetitions(*number).min(*block.end());
            requests.extend(Request::batch(LABEL, experiment, point, repetitions, self.config.study.seed)?);
        }
        Ok(requests)
    }

    /// How many there are of some repetitions in one experiment.
    pub fn count(&self, block: &RangeInclusive<u32>) -> usize {
        let of = |point: &u32| (self.repetitions(*point).min(*block.end()) + 1).saturating_sub(*block.start()) as usize;
        self.points.keys().map(of).sum()
    }

    /// All of them, by experiment, point and repetition.
    ///
    /// # Errors
    /// A parameter value that is NaN.
    pub fn all(&self) -> Result<Vec<Request>, StageError> {
        let of_experiment = |experiment| self.of(experiment, &(1..=self.last()));
        Ok(self.config.experiments().into_iter().map(of_experiment).collect::<Result<Vec<_>, _>>()?.concat())
    }
}

/// A part of the design: what its points are for, its name among the parts, its points in the unit cube.
struct DesignPart {
    set: &'static str,
    name: &'static str,
    points: Points,
}

/// The parts of the design in the order of their points: the same arguments give the same points on every machine.
fn parts(config: &Config, seed: u64) -> Result<Vec<DesignPart>, StageError> {
    let p = config.parameters.len();
    let boundary = factorial(config.design.boundary_levels as usize, p);
    let interior = spread(config, config.design.interior, &boundary, seed)?;
    let validation = spread(config, config.design.validation, &boundary.joined(&interior), seed ^ 1)?;
    let added = farthest(config.design.added as usize, &boundary.joined(&interior).joined(&validation))
        .map_err(|error| StageError::Input { what: error.to_string(), remedy: "set design.added to 0" })?;
    // Added points come last, so that the others keep their numbers.
    let part = |set, name, points| DesignPart { set, name, points };
    Ok(vec![
        part("boundary", "boundary", boundary),
        part("interior", "interior", interior),
        part("validation", "validation", validation),
        part("interior", "added", added),
    ])
}

/// Two points nearer than this in every coordinate of the unit cube are one.
const SAME: f64 = 1e-9;

/// Adds the points that somebody chose as the last part; gives the runs beyond those that every point gets. A chosen
/// point that is in the design already only adds its runs.
fn choose(config: &Config, parts: &mut Vec<DesignPart>) -> Vec<ReplicationRow> {
    let mut known: Vec<Vec<f64>> = parts.iter().flat_map(|part| part.points.rows().map(<[f64]>::to_vec)).collect();
    let mut chosen = Points::empty(config.parameters.len());
    let mut extra: BTreeMap<u32, u32> = BTreeMap::new();
    for row in &config.chosen {
        let unit: Vec<f64> = config.parameters.iter().zip(&row.values).map(|(p, value)| p.to_unit(*value)).collect();
        let same = |other: &Vec<f64>| other.iter().zip(&unit).all(|(a, b)| (a - b).abs() < SAME);
        let index = known.iter().position(same).unwrap_or_else(|| {
            chosen.push(&unit);
            known.push(unit.clone());
            known.len() - 1
        });
        *extra.entry(index as u32 + 1).or_default() += row.extra;
    }
    parts.push(DesignPart { set: "interior", name: "chosen", points: chosen });
    extra.into_iter().filter(|(_, extra)| *extra > 0).map(|(point, extra)| ReplicationRow { point, extra }).collect()
}

fn rows(config: &Config, parts: &[DesignPart]) -> Result<Vec<SampleRow>, StageError> {
    let mut rows = Vec::new();
    let mut number = 0;
    for part in parts {
        for point in part.points.rows() {
            number += 1;
            rows.extend(point_rows(config, part.set, number, point)?);
        }
    }
    Ok(rows)
}

/// The distances that every part reached, by itself and beside the parts before it.
fn quality(parts: &[DesignPart]) -> Vec<DesignQualityRow> {
    let finite = |distance: f64| distance.is_finite().then_some(distance);
    let mut before = Points::empty(parts.first().map_or(0, |part| part.points.dimension()));
    let mut rows = Vec::new();
    for part in parts.iter().filter(|part| !part.points.is_empty()) {
        let own = min_distance(&part.points);
        rows.push(DesignQualityRow {
            set: part.name.to_owned(),
            points: part.points.len() as u32,
            min_distance: finite(own),
            joint_min_distance: finite(own.min(min_distance_between(&part.points, &before))),
        });
        before = before.joined(&part.points);
    }
    rows
}

/// Parameters up to which `filling = "auto"` takes a Latin hypercube.
const LATIN_UP_TO: usize = 4;

fn spread(config: &Config, count: u32, existing: &Points, seed: u64) -> Result<Points, StageError> {
    let (count, p) = (count as usize, existing.dimension());
    let latin = match config.design.filling {
        Filling::Latin => true,
        Filling::Sobol => false,
        Filling::Auto => p <= LATIN_UP_TO,
    };
    if count == 0 {
        return Ok(Points::empty(p));
    }
    if latin {
        return Ok(conditional_latin_hypercube(count, existing, &Annealing { seed, ..Annealing::default() }).points);
    }
    let sequence = Sobol::shifted(p, seed);
    let refused =
        |error: TooManyDimensions| StageError::Input { what: error.to_string(), remedy: "take filling = \"latin\"" };
    Ok(sequence.map_err(refused)?.take(count))
}

fn point_rows(config: &Config, set: &str, number: u32, unit: &[f64]) -> Result<Vec<SampleRow>, StageError> {
    let parameters = || config.parameters.iter().zip(unit);
    let values: Vec<_> =
        parameters().map(|(parameter, u)| (parameter.name.to_owned(), parameter.from_unit(*u))).collect();
    let hash = Point::new(number, config.base_settings(), &values)?.hash()?.to_string();
    let row = |((parameter, u), (_, value)): ((&Parameter, &f64), &(String, f64))| SampleRow {
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
