//! Measured data: what the laboratory found, as single values or as published summaries.
//!
//! Takes a CSV or Parquet file, or a folder of them; gives values in SI (angles in degrees) that are known to be right,
//! or every problem with file, line and remedy. Single values have the columns experiment, repetition, kpi, value, unit;
//! summaries have experiment, kpi, mean, sd, n, unit; the header decides, and a column `note` may stand in both. `kpi`
//! is any observable of the experiment, so the extra observables of a test stand beside its KPI. What was measured on the
//! grains themselves has `grains` for an experiment and a setting for a kpi; of a calibrated parameter it is a prior. Raw
//! records have experiment, repetition and a sample: time and force of a load cell, or x and z of an outline
//! (`crate::experiments`).
//! Deliberately repairs nothing: a row is taken as it stands or refused.

pub(in crate::config) mod raw;
mod rows;
#[cfg(test)]
mod tests;

use super::problem::{Place, Problem, Problems};
use crate::settings::{self, Settings};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One measured value.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredValue {
    /// Experiment.
    pub experiment: &'static str,
    /// Observable.
    pub kpi: &'static str,
    /// Repetition, from 1.
    pub repetition: u32,
    /// Value in the observable's unit.
    pub value: f64,
}

/// Mean and standard deviation of one observable.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredSummary {
    /// Experiment.
    pub experiment: &'static str,
    /// Observable.
    pub kpi: &'static str,
    /// Unit of mean and standard deviation.
    pub unit: &'static str,
    /// Mean.
    pub mean: f64,
    /// Standard deviation (n − 1), positive.
    pub sd: f64,
    /// Number of repetitions, at least 2.
    pub n: u32,
}

/// A measured data set. Every observable has either single values or a published summary.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Measured {
    /// Name in tables and labels.
    pub name: String,
    /// Single values, sorted by experiment, kpi and repetition.
    pub values: Vec<MeasuredValue>,
    /// Published summaries, sorted by experiment and kpi.
    pub summaries: Vec<MeasuredSummary>,
    /// Properties of the grains that were measured by themselves, such as the particle density; `kpi` is the setting.
    pub properties: Vec<MeasuredSummary>,
    /// The files it was read from, sorted, for content digests.
    pub files: Vec<PathBuf>,
    /// Whether values were read off raw records, so that they depend on the settings of the measurement too.
    pub raw: bool,
}

impl Measured {
    /// Reads the data set `name` from a `.csv` or `.parquet` file, or from all such files of a folder; raw records are
    /// read with the default settings of the measurement.
    ///
    /// # Errors
    /// All problems of all files, sorted by file and line.
    pub fn read(name: &str, path: &Path) -> Result<Self, Problems> {
        Self::read_as(name, path, &Settings::default())
    }

    /// The same with raw records read as `settings` say.
    ///
    /// # Errors
    /// All problems of all files, sorted by file and line.
    pub fn read_as(name: &str, path: &Path, settings: &Settings) -> Result<Self, Problems> {
        let files = files_of(path)?;
        let mut collector = rows::Collector::default();
        for file in &files {
            match raw::read(file) {
                Ok(table) => collector.add(&table),
                Err(problem) => collector.problem(problem),
            }
        }
        let (values, summaries, raw) = collector.finish(settings)?;
        Ok(Self { raw, ..Self::new(name, values, summaries, files) })
    }

    fn new(name: &str, values: Vec<MeasuredValue>, summaries: Vec<MeasuredSummary>, files: Vec<PathBuf>) -> Self {
        let (weighed, values): (Vec<_>, Vec<_>) =
            values.into_iter().partition(|value| value.experiment == rows::GRAINS);
        let (known, summaries): (Vec<_>, Vec<_>) =
            summaries.into_iter().partition(|summary| summary.experiment == rows::GRAINS);
        let grains = Self { values: weighed, summaries: known, ..Self::default() };
        Self { name: name.to_owned(), values, summaries, properties: grains.statistics(), files, raw: false }
    }

    /// The repetition and the value of every single value of one observable, in the order of the repetitions.
    pub fn series_of(&self, kpi: &str) -> Vec<(u32, f64)> {
        self.values.iter().filter(|value| value.kpi == kpi).map(|value| (value.repetition, value.value)).collect()
    }

    /// Mean, standard deviation and n of every observable, sorted by experiment and kpi: published, or computed from
    /// all single values in the order of their repetitions.
    pub fn statistics(&self) -> Vec<MeasuredSummary> {
        self.statistics_of_first(u32::MAX)
    }

    /// The same from the first `n` single values of each observable (at least 2); published summaries stay as they are.
    pub fn statistics_of_first(&self, n: u32) -> Vec<MeasuredSummary> {
        let computed = self.groups().into_iter().map(|((experiment, kpi), values)| {
            let count = values.len().min(n.max(2) as usize);
            summarise(experiment, kpi, &values[..count])
        });
        let mut all: Vec<_> = computed.chain(self.summaries.iter().cloned()).collect();
        all.sort_by_key(|summary| (summary.experiment, summary.kpi));
        all
    }

    /// Statistics of one observable, if it was measured.
    pub fn statistic(&self, kpi: &str) -> Option<MeasuredSummary> {
        self.statistics().into_iter().find(|summary| summary.kpi == kpi)
    }

    /// Single values of one observable in the order of their repetitions; empty where only a summary was published.
    pub fn values_of(&self, kpi: &str) -> Vec<f64> {
        self.values.iter().filter(|value| value.kpi == kpi).map(|value| value.value).collect()
    }

    /// What a fit may see, and the values of that share of the repetitions of `experiments`, spread evenly over a series, that
    /// it may not. An observable that would keep fewer than two values on either side stays whole with the first, as do
    /// published summaries and properties.
    #[must_use]
    pub fn hold_out(&self, share: f64, experiments: &[&str]) -> (Self, Self) {
        let upto = |repetition: u32| (f64::from(repetition) * share).floor();
        let is_out = |value: &MeasuredValue| upto(value.repetition) > upto(value.repetition - 1);
        let counts = |kpi: &str| {
            let of_kpi = || self.values.iter().filter(|value| value.kpi == kpi);
            (of_kpi().filter(|value| is_out(value)).count(), of_kpi().count())
        };
        let splits: Vec<&str> = self
            .groups()
            .into_keys()
            .filter(|(experiment, _)| experiments.contains(experiment))
            .map(|(_, kpi)| kpi)
            .filter(|kpi| matches!(counts(kpi), (out, all) if out >= 2 && all - out >= 2))
            .collect();
        let (unseen, seen): (Vec<_>, Vec<_>) =
            self.values.iter().cloned().partition(|value| splits.contains(&value.kpi) && is_out(value));
        let unseen = Self { name: self.name.clone(), values: unseen, raw: self.raw, ..Self::default() };
        (Self { values: seen, ..self.clone() }, unseen)
    }

    fn groups(&self) -> BTreeMap<(&'static str, &'static str), Vec<f64>> {
        let mut groups: BTreeMap<_, Vec<f64>> = BTreeMap::new();
        for value in &self.values {
            groups.entry((value.experiment, value.kpi)).or_default().push(value.value);
        }
        groups
    }
}

/// Mean and sample standard deviation in two passes, in the order of the slice (two or more values).
fn summarise(experiment: &'static str, kpi: &'static str, values: &[f64]) -> MeasuredSummary {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    let of_grains = || settings::spec(kpi).ok().filter(|_| experiment == rows::GRAINS).map(|spec| spec.unit);
    let unit = rows::observable(experiment, kpi).map(|observable| observable.unit).or_else(of_grains).unwrap_or("1");
    MeasuredSummary { experiment, kpi, unit, mean, sd: (squares / (n - 1.0)).sqrt(), n: values.len() as u32 }
}

/// The file itself, or the data files of a folder, sorted by name.
fn files_of(path: &Path) -> Result<Vec<PathBuf>, Problem> {
    let refuse = |what: String| Problem { file: path.display().to_string(), place: Place::File, what };
    let cannot = |error: std::io::Error| refuse(format!("cannot be read: {error}; check `path` of its [[measured]]"));
    if !std::fs::metadata(path).map_err(cannot)?.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path).map_err(cannot)?;
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in entries {
        let file = entry.map_err(cannot)?.path();
        if raw::Format::of(&file).is_some() {
            files.push(file);
        }
    }
    files.sort();
    if files.is_empty() {
        Err(refuse("the folder holds no .csv or .parquet file; add one".to_owned()))
    } else {
        Ok(files)
    }
}
