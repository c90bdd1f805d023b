//! aggregate: mean and standard deviation of every observable over the first n repetitions, for every n.
//!
//! Runs beyond those that every point gets count at the largest n, where `count` says how many there are.

use super::context::text;
use super::{Context, Outputs, Parts, SettingsText, Stage, StageError, never, no_runs};
use crate::canonical::Encoder;
use crate::config::Config;
use crate::stats::summary::{Factors, Running};
use crate::store::table::{self, Part};
use crate::tables::list::{AggregateRow, KpiRow};
use crate::tables::{Cell, Checked, Row};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "aggregate",
    version: 3,
    purpose: "mean, standard deviation and intervals for every number of repetitions",
    reads: &[KpiRow::SPEC],
    writes: &[AggregateRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([("study.repetitions", config.study.repetitions.to_string())]);
    settings.extend(config.settings_text(&["statistics"]));
    settings
}

/// A part of the table holds the numbers n of one block for all points of one experiment.
fn run(context: &Context) -> Result<Outputs, StageError> {
    let mut table = Parts::new(context, AggregateRow::SPEC);
    let last = context.config.study.repetitions;
    let mut experiments: BTreeMap<String, Vec<Part>> = BTreeMap::new();
    for part in context.parts(KpiRow::SPEC)? {
        experiments.entry(part.value.clone()).or_default().push(part);
    }
    for (experiment, parts) in experiments {
        let read = || parts.into_par_iter().map(|part| Values::read(context, part)).collect::<Result<Vec<_>, _>>();
        let values = context.campaign.install(read)?;
        let beyond = values.iter().any(|values| values.last > last);
        let mut series = Series::new(&values)?;
        for block in table::blocks(last, series.points()) {
            let all = beyond && *block.end() == last;
            let mut inputs = Encoder::new();
            inputs.u64((*block.start()).into()).u64((*block.end()).into()).u64(all.into());
            for values in values.iter().filter(|values| all || values.first <= *block.end()) {
                inputs.bytes(&values.part.digest.0);
            }
            table.add(&experiment, &inputs, || Ok(series.rows(&experiment, &block, context.config)))?;
        }
    }
    Ok(table.finish())
}

/// The columns of one part of the observables that a summary needs.
struct Values {
    part: Part,
    columns: Checked,
    /// First and last repetition.
    first: u32,
    last: u32,
}

impl Values {
    fn read(context: &Context, part: Part) -> Result<Self, StageError> {
        let names = ["kpi", "point", "parameter_hash", "repetition", "value", "unit"];
        let columns = context.columns(KpiRow::SPEC, &part, &names)?;
        let repetitions = columns.column::<u32>("repetition")?.values();
        let limits = (repetitions.iter().min().copied(), repetitions.iter().max().copied());
        let (first, last) = (limits.0.unwrap_or_default(), limits.1.unwrap_or_default());
        Ok(Self { part, columns, first, last })
    }
}

/// The values of one observable at one point, by repetition, and how far they have been summed up.
struct Group {
    parameter_hash: String,
    unit: String,
    /// Repetitions that gave a value, with it.
    values: Vec<(u32, f64)>,
    summed: Running,
}

/// All observables of one experiment at all points.
struct Series {
    /// By observable and point.
    groups: BTreeMap<String, BTreeMap<u32, Group>>,
    factors: Vec<Factors>,
}

impl Series {
    fn new(parts: &[Values]) -> Result<Self, StageError> {
        let mut groups: BTreeMap<String, BTreeMap<u32, Group>> = BTreeMap::new();
        for Values { columns, .. } in parts {
            let text = |name| columns.column::<String>(name);
            let (kpis, hashes, units) = (text("kpi")?, text("parameter_hash")?, text("unit")?);
            let (points, repetitions) = (columns.column::<u32>("point")?, columns.column::<u32>("repetition")?);
            let values = columns.column::<Option<f64>>("value")?;
            for row in 0..columns.rows() {
                let kpi = kpis.value(row);
                if !groups.contains_key(kpi) {
                    groups.insert(kpi.to_owned(), BTreeMap::new());
                }
                let group = groups.get_mut(kpi).map(|points_of| {
                    points_of.entry(points.value(row)).or_insert_with(|| Group {
                        parameter_hash: hashes.value(row).to_owned(),
                        unit: units.value(row).to_owned(),
                        values: Vec::new(),
                        summed: Running::default(),
                    })
                });
                if let (Some(group), Some(value)) = (group, Option::<f64>::get(values, row)) {
                    group.values.push((repetitions.value(row), value));
                }
            }
        }
        groups.values_mut().flat_map(BTreeMap::values_mut).for_each(|group| group.values.sort_by_key(|value| value.0));
        Ok(Self { groups, factors: Vec::new() })
    }

    /// Number of points.
    fn points(&self) -> usize {
        self.groups.values().map(BTreeMap::len).max().unwrap_or(0)
    }

    /// One row per observable, point and n of the block; a repetition without a value is counted out, not replaced.
    /// Blocks come in order, and may be left out.
    fn rows(&mut self, experiment: &str, block: &RangeInclusive<u32>, config: &Config) -> Vec<AggregateRow> {
        let (statistics, last) = (&config.statistics, config.study.repetitions);
        let longest = self.groups.values().flat_map(BTreeMap::values).map(|group| group.values.len()).max();
        let known = self.factors.len()..=longest.unwrap_or(0);
        self.factors.extend(known.map(|n| Factors::new(n, statistics.confidence, statistics.convention)));
        let mut rows = Vec::new();
        for (kpi, points) in &mut self.groups {
            for (point, group) in points {
                for n in block.clone() {
                    group.sum_up(if n == last { u32::MAX } else { n });
                    rows.push(group.row((experiment, kpi, *point), n, &self.factors));
                }
            }
        }
        rows
    }
}

impl Group {
    /// Takes the values up to a repetition that have not been taken yet.
    fn sum_up(&mut self, repetition: u32) {
        let new = self.values[self.summed.n()..].iter().take_while(|value| value.0 <= repetition);
        let mut summed = self.summed;
        new.for_each(|value| summed.push(value.1));
        self.summed = summed;
    }

    fn row(&self, (experiment, kpi, point): (&str, &str, u32), n: u32, factors: &[Factors]) -> AggregateRow {
        let summary = factors[self.summed.n()].summary(self.summed.mean(), self.summed.sd());
        let finite = |value: f64| value.is_finite().then_some(value);
        AggregateRow {
            experiment: experiment.to_owned(),
            kpi: kpi.to_owned(),
            point,
            parameter_hash: self.parameter_hash.clone(),
            n,
            count: summary.n as u32,
            mean: finite(summary.mean),
            mean_lower: finite(summary.mean_interval.lower),
            mean_upper: finite(summary.mean_interval.upper),
            sd: finite(summary.sd),
            sd_lower: finite(summary.sd_interval.lower),
            sd_upper: finite(summary.sd_interval.upper),
            unit: self.unit.clone(),
        }
    }
}
