//! The laboratory of the diagnosis: batches of runs at chosen points, with everything that was run kept for the tables.

use super::moments::Batch;
use crate::campaign::{Point, Request};
use crate::experiments::Experiment;
use crate::stages::{Context, StageError};
use crate::tables::list::{KpiRow, RunRow};
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
    /// Every run so far.
    pub runs: Vec<RunRow>,
    /// Every observable so far.
    pub kpis: Vec<KpiRow>,
}

impl<'a> Lab<'a> {
    /// An empty laboratory.
    pub fn new(context: &'a Context<'a>) -> Self {
        Self { context, runs: Vec::new(), kpis: Vec::new() }
    }

    /// Runs all jobs together and gives the batch of each, in order.
    ///
    /// # Errors
    /// Runs that cannot be made or read.
    pub fn run(&mut self, jobs: &[Job]) -> Result<Vec<Batch>, StageError> {
        let mut requests = Vec::new();
        let mut ends = Vec::new();
        for job in jobs {
            requests.extend(requests_of(self.context, job)?);
            ends.push(requests.len());
        }
        let runs = self.context.campaign.simulate(&requests)?;
        let kpis = self.context.campaign.measure(&requests, &runs)?;
        let batches = batches(&kpis, jobs, self.context.config.base_settings()["series_length"] as u32);
        self.runs.extend(runs);
        self.kpis.extend(kpis);
        Ok(batches)
    }
}

/// The runs of a job.
pub fn requests_of(context: &Context, job: &Job) -> Result<Vec<Request>, StageError> {
    let point = Arc::new(job.point.clone());
    let mut requests = Vec::new();
    for experiment in &job.experiments {
        let range = 1..=job.repetitions;
        requests.extend(Request::batch(&job.label, *experiment, &point, range, context.config.study.seed)?);
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
