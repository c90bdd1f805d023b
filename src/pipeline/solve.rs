//! A blind data set, calibrated and diagnosed with a study's own runs, its seal closed.

use super::study::{PipelineError, Study};
use crate::campaign::Campaign;
use crate::config::MeasuredSource;
use crate::stages::{self, Content, Context};
use std::path::Path;

/// Name of the data set in the tables of a solution.
pub const NAME: &str = "challenge";
/// The stages that read measured data and lead to a verdict.
const STAGES: [&str; 2] = ["calibrate", "diagnose"];

/// Files of the solution by path: the tables of calibration and diagnosis for the data in `measured`, with the design,
/// the metamodels and every run of the study, which must be up to date as far as `train`. `without` leaves out one of
/// the study's candidates. Only the data file is read; the same inputs give the same bytes.
///
/// # Errors
/// Data that cannot be taken, or a stage that fails.
pub fn solve(
    study: &Study,
    campaign: &Campaign,
    measured: &Path,
    without: Option<&str>,
) -> Result<Vec<(String, Vec<u8>)>, PipelineError> {
    let path = std::path::absolute(measured).unwrap_or_else(|_| measured.to_owned());
    let source =
        MeasuredSource { name: NAME.to_owned(), path, comparable: true, note: String::new(), controls: Vec::new() };
    let config = study.config.with_only(source, without);
    let data = config.read_measured().map_err(crate::config::ConfigError::from)?;
    let context = Context::new(&config, &data, campaign, study.store().root());
    let mut files = Vec::new();
    for stage in STAGES.iter().filter_map(|name| stages::find(name)) {
        let outputs = (stage.run)(&context).map_err(|source| PipelineError::Stage { stage: stage.name, source })?;
        files.extend(outputs.files.into_iter().filter_map(|(path, content)| match content {
            Content::Bytes(bytes) => Some((path, bytes)),
            Content::InPlace(_) => None,
        }));
    }
    Ok(files)
}
