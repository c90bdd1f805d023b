//! The laboratory of the diagnosis: batches of runs at chosen points, with everything that was run kept for the tables.

use super::moments::Batch;
use crate::campaign::{CampaignError, Point, Request};
use crate::config::Config;
use crate::experiments::Experiment;
use crate::settings;
use crate::stages::{Context, StageError};
use crate::tables::list::{KpiRow, PointRow, RunRow};
use std::sync::Arc;

/// A batch asked for: repetitions 1..=n of some experiments at one point.
pub struct Job {
    /// Label of the runs.
    pub label: String,
    /// Where.
    pub point: Point,
    /// What.
    pub experiments: Vec<&'static dyn Experiment>,
    /// How often.
    pub repetitions: u32,
}

/// Runs batches and keeps their rows.
pub struct Lab<'a> {
    context: &'a Context<'a>,
    /// Where these runs stand.
    pub points: Vec<PointRow>,
    /// Every run so far.
    pub runs: Vec<RunRow>,
    /// Every observable so far.
    pub kpis: Vec<KpiRow>,
}

impl<'a> Lab<'a> {
    /// An empty laboratory.
    pub fn new(context: &'a Context<'a>) -> Self {
        Self { context, points: Vec::new(), runs: Vec::new(), kpis: Vec::new() }
    }

    /// Runs all jobs together and gives the batch of each, in order.
    ///
    /// # Errors
    /// Runs that cannot be made or read.
    pub fn run(&mut self, jobs: &[Job]) -> Result<Vec<Batch>, StageError> {
        self.run_from(jobs, self.context.config.study.seed)
    }

    /// The same with packings of their own, of which no fit and no choice can know: seeds come from another base seed.
    ///
    /// # Errors
    /// Runs that cannot be made or read.
    pub fn confirm(&mut self, jobs: &[Job]) -> Result<Vec<Batch>, StageError> {
        self.run_from(jobs, self.context.seed("confirmation"))
    }

    fn run_from(&mut self, jobs: &[Job], base_seed: u64) -> Result<Vec<Batch>, StageError> {
        let mut requests = Vec::new();
        for job in jobs {
            requests.extend(requests_of(job, base_seed)?);
        }
        let runs = self.context.campaign.simulate(&requests)?;
        let kpis = self.context.campaign.measure(&requests, &runs)?;
        let batches = batches(&kpis, jobs, self.context.config.base_settings()["series_length"] as u32);
        for job in jobs {
            self.note(job)?;
        }
        self.runs.extend(runs);
        self.kpis.extend(kpis);
        Ok(batches)
    }

    /// Number of a place under a label: the one that it has, or the next.
    ///
    /// # Errors
    /// A parameter value that is NaN.
    pub fn number(&self, label: &str, point: &Point) -> Result<u32, StageError> {
        let hash = point.hash()?.to_string();
        let of_label = || self.points.iter().filter(|row| row.label == label);
        let known = of_label().find(|row| row.parameter_hash == hash).map(|row| row.point);
        Ok(known.unwrap_or_else(|| 1 + of_label().map(|row| row.point).max().unwrap_or(0)))
    }

    /// Keeps where a job stands; several may ask for runs at one place.
    fn note(&mut self, job: &Job) -> Result<(), StageError> {
        let rows = point_rows(self.context.config, job)?;
        if !rows.first().is_some_and(|row| self.points.contains(row)) {
            self.points.extend(rows);
        }
        Ok(())
    }
}

/// Parameters and effects of the point of a job.
fn point_rows(config: &Config, job: &Job) -> Result<Vec<PointRow>, StageError> {
    let hash = job.point.hash()?.to_string();
    let row = |name: &str, value: f64, unit: &str| PointRow {
        label: job.label.clone(),
        point: job.point.number,
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        parameter_hash: hash.clone(),
    };
    let mut rows = Vec::new();
    for (name, value) in &job.point.parameters {
        rows.push(row(name, *value, settings::spec(name).map_err(CampaignError::from)?.unit));
    }
    for (name, strength) in &job.point.effects {
        rows.push(row(name, *strength, config.effects.library.find(name).map_err(CampaignError::from)?.unit()));
    }
    Ok(rows)
}

/// The runs of a job, with seeds from a base seed.
pub fn requests_of(job: &Job, base_seed: u64) -> Result<Vec<Request>, StageError> {
    let point = Arc::new(job.point.clone());
    let mut requests = Vec::new();
    for experiment in &job.experiments {
        let range = 1..=job.repetitions;
        requests.extend(Request::batch(&job.label, *experiment, &point, range, base_seed)?);
    }
    Ok(requests)
}

/// Splits the rows by label and point number, which no two jobs share.
fn batches(kpis: &[KpiRow], jobs: &[Job], series_length: u32) -> Vec<Batch> {
    let of = |job: &Job| {
        let rows = kpis.iter().filter(|row| row.label == job.label && row.point == job.point.number);
        Batch::new(rows, series_length)
    };
    jobs.iter().map(of).collect()
}
