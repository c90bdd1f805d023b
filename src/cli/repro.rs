//! `repro`: bring stages up to date.

use super::{CliError, Outcome};
use crate::campaign::Options;
use crate::pipeline::run::{Request, repro};
use crate::pipeline::{PipelineError, Study, plan};
use crate::stages::{self, Stage};
use crate::store::table;
use crate::tables::Row;
use crate::tables::list::RunRow;
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// Bring every stage, or one and those it needs, up to date; only what is new is computed.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake repro                    everything, ending with a summary and the report
  granulake repro train              up to the metamodels
  granulake repro --reps 5           five repetitions instead of those of the study
  granulake --study studies/fransen2022.toml repro simulate --jobs 8

Stages: bounds, sample, simulate, kpi, aggregate, train, analyse, feasibility, calibrate, verify, validate, diagnose, report.
A kill at any moment loses at most the simulations in flight; the next repro continues.")]
pub struct Arguments {
    /// Last stage; all stages when left out.
    stage: Option<String>,
    /// Repetitions, instead of study.repetitions.
    #[arg(long, value_name = "N")]
    reps: Option<u32>,
    /// Threads; one per core when left out.
    #[arg(long, value_name = "N", default_value_t = 0)]
    jobs: usize,
    /// Say what would run, as `plan` does, and stop.
    #[arg(long)]
    dry_run: bool,
    /// Run the stage even if it is up to date, and check that it gives the same bytes.
    #[arg(long)]
    force: bool,
    /// Run failed simulations again.
    #[arg(long)]
    retry_failed: bool,
    /// Go on without simulations that failed, or with `=false` stop after the stage they belong to.
    #[arg(long, value_name = "BOOL", require_equals = true, num_args = 0..=1, default_value_t = true,
        default_missing_value = "true", action = clap::ArgAction::Set)]
    keep_going: bool,
    /// Print what was done as JSON.
    #[arg(long)]
    json: bool,
}

/// The stage of that name.
pub fn stage(name: Option<&str>) -> Result<Option<&'static Stage>, PipelineError> {
    name.map(|name| {
        stages::find(name).ok_or_else(|| PipelineError::UnknownStage {
            name: name.to_owned(),
            known: stages::STAGES.iter().map(|stage| stage.name).collect::<Vec<_>>().join(", "),
        })
    })
    .transpose()
}

/// Runs what is stale and prints the summary.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let target = stage(arguments.stage.as_deref())?;
    let mut study = Study::load_with(path, arguments.reps)?;
    if arguments.dry_run {
        return super::plan::print(&study, target, arguments.json);
    }
    let options = Options { jobs: arguments.jobs, progress: true, retry_failed: arguments.retry_failed };
    let request = Request { target, force: arguments.force, stop_at_failure: !arguments.keep_going, options };
    let mut done = Vec::new();
    let mut clock = Instant::now();
    let warnings = repro(&mut study, &request, |stage, action| {
        let seconds = clock.elapsed().as_secs_f64();
        clock = Instant::now();
        eprintln!("{stage:<11} {:<9} {seconds:7.1} s", action.word());
        done.push(json!({"stage": stage, "action": action.word()}));
    })?;
    let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    finish(&study, target, arguments.json, (&done, &warnings))
}

fn finish(
    study: &Study,
    target: Option<&'static Stage>,
    json: bool,
    (done, warnings): (&[serde_json::Value], &[String]),
) -> Result<Outcome, CliError> {
    let root = study.store().root();
    let (runs, failed) = run_counts(study)?;
    let mut out = std::io::stdout().lock();
    if json {
        let stale: Vec<_> = plan::assess(study, &study.lock()?)
            .into_iter()
            .filter(|step| !step.state.is_settled())
            .map(|step| step.stage)
            .collect();
        writeln!(
            out,
            "{}",
            json!({"stages": done, "stale": stale, "runs": runs, "failed_runs": failed, "warnings": warnings})
        )?;
    } else if let Some(target) = target {
        writeln!(out, "{} is up to date; {runs} runs, {failed} of them failed", target.name)?;
    } else {
        writeln!(out, "{}", std::fs::read_to_string(root.join(stages::REPORT_SUMMARY))?)?;
        writeln!(out, "report: {}", root.join(stages::REPORT_HTML).display())?;
    }
    Ok(if failed == 0 { Outcome::Done } else { Outcome::FailedRuns })
}

/// Number of all runs in the tables of the study, and of those that failed.
fn run_counts(study: &Study) -> Result<(u64, u64), CliError> {
    let (mut runs, mut failed) = (0, 0);
    let needed = stages::STAGES.iter().filter(|stage| (stage.skipped)(&study.config).is_none());
    let written = needed.flat_map(|stage| stage.writes);
    for spec in written.filter(|spec| spec.columns == RunRow::SPEC.columns) {
        let counts = table::text_counts(study.store().root(), spec, "status")?;
        let all: u64 = counts.values().sum();
        runs += all;
        failed += all - counts.get("ok").copied().unwrap_or(0);
    }
    Ok((runs, failed))
}
