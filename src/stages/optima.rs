//! Runs at the optima: which calibrations are simulated, as which points, under which label.

use super::{Context, Demand, StageError};
use crate::campaign::{Point, Request};
use crate::experiments::Experiment;
use crate::stats::summary::{Summary, summarise};
use crate::tables::list::{KpiRow, OptimumRow};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A calibration: measured data set, kind of metamodel, approach and number of repetitions.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Name {
    /// Measured data set.
    pub measured: String,
    /// Kind of metamodel.
    pub kind: String,
    /// Approach.
    pub approach: String,
    /// Repetitions.
    pub n: u32,
}

impl Name {
    /// Label of its runs.
    pub fn label(&self) -> String {
        format!("{}/{}-{}/{}", self.measured, self.kind, self.approach, self.n)
    }
}

/// The optimum of every calibration whose number of repetitions is verified, as a point.
pub fn points(context: &Context, optima: &[OptimumRow]) -> Result<BTreeMap<Name, Arc<Point>>, StageError> {
    let config = context.config;
    let mut values: BTreeMap<Name, Vec<(String, f64)>> = BTreeMap::new();
    for row in optima.iter().filter(|row| config.verify.counts.contains(&row.n)) {
        let name =
            Name { measured: row.measured.clone(), kind: row.kind.clone(), approach: row.approach.clone(), n: row.n };
        values.entry(name).or_default().push((row.parameter.clone(), row.value));
    }
    values
        .into_iter()
        .map(|(name, values)| {
            let point = Point::new(1, config.base_settings(), &values)?
                .knowing(&config.effects.library)
                .with_effects(&config.effects.active);
            Ok((name, Arc::new(point)))
        })
        .collect()
}

/// Runs of `experiments` at every optimum, as often as `repetitions` says.
pub fn requests(
    context: &Context,
    points: &BTreeMap<Name, Arc<Point>>,
    experiments: &[&'static dyn Experiment],
    repetitions: impl Fn(&Name) -> u32,
) -> Result<Vec<Request>, StageError> {
    let mut requests = Vec::new();
    for (name, point) in points {
        for experiment in experiments {
            let range = 1..=repetitions(name);
            requests.extend(Request::batch(&name.label(), *experiment, point, range, context.config.study.seed)?);
        }
    }
    Ok(requests)
}

/// How many runs of `experiments` there are at the optima before any is known, by experiment: every data set, kind and
/// approach for every n of `verify.counts`. A calibration that fails has no optimum, so these are the most.
pub fn foreseen(
    context: &Context,
    experiments: &[&'static dyn Experiment],
    repetitions: impl Fn(u32) -> u32,
) -> Demand {
    let config = context.config;
    let methods = context.measured.len() * config.metamodel.kinds.len() * config.calibrate.approaches.len();
    let runs: u64 = config.verify.counts.iter().map(|n| u64::from(repetitions(*n))).sum();
    Demand::AtMost(experiments.iter().map(|experiment| (experiment.name(), methods * runs as usize)).collect())
}

/// Values of every observable by label and observable, and why values are missing.
pub struct Results<'a> {
    rows: BTreeMap<(&'a str, &'a str), Vec<&'a KpiRow>>,
}

impl<'a> Results<'a> {
    /// Indexes the rows.
    pub fn new(rows: &'a [KpiRow]) -> Self {
        let mut index: BTreeMap<_, Vec<&KpiRow>> = BTreeMap::new();
        for row in rows {
            index.entry((row.label.as_str(), row.kpi.as_str())).or_default().push(row);
        }
        Self { rows: index }
    }

    /// Number of values and their summary.
    pub fn summary(&self, context: &Context, label: &str, kpi: &str) -> Summary {
        let values: Vec<f64> = self.of(label, kpi).iter().filter_map(|row| row.value).collect();
        summarise(&values, context.config.statistics.confidence, context.config.statistics.convention)
    }

    /// The first reason for a missing value.
    pub fn reason(&self, label: &str, kpi: &str) -> Option<String> {
        self.of(label, kpi).iter().find_map(|row| row.reason.clone())
    }

    fn of<'s>(&'s self, label: &'s str, kpi: &'s str) -> &'s [&'s KpiRow] {
        self.rows.get(&(label, kpi)).map_or(&[], Vec::as_slice)
    }
}

/// A number that a table can hold.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// 100 (value − reference)/reference (eq. 14).
pub fn percent(value: f64, reference: f64) -> Option<f64> {
    finite(100.0 * (value - reference) / reference)
}
