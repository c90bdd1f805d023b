//! `plan`: what would run, why, how many simulations and what they cost.

use super::output::aligned;
use super::repro::stage;
use super::{CliError, Outcome};
use crate::campaign::{Campaign, Options};
use crate::config::points::EXTRA;
use crate::pipeline::plan::{State, Step, assess, selection};
use crate::pipeline::{PipelineError, Study};
use crate::stages::{self, Stage, find};
use crate::units::canonical;
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// Seconds of one core that a run is taken to cost before any has been timed.
const GUESS_SECONDS: f64 = 60.0;

/// Say what would run, why, how many simulations that takes and what they are expected to cost.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake plan
  granulake plan train
  granulake --study studies/fransen2022.toml plan --json
  granulake plan --suggest 10 > points.csv     then points = \"points.csv\" under [design], and repro

--suggest asks the metamodels `sk` where study.repetitions more runs lower their error most: at new points, or at points
of the design (Binois et al. 2019). The rows go to stdout as CSV, those chosen before first.

Costs come from the simulations timed so far: those of this plan, else all of the same experiment in this store; before
the first one, a minute each is assumed and said.
Of diagnose the anchors of all effects are counted; its runs at optima are known only when those are.")]
pub struct Arguments {
    /// Last stage; all stages when left out.
    stage: Option<String>,
    /// Repetitions, instead of study.repetitions.
    #[arg(long, value_name = "N")]
    reps: Option<u32>,
    /// Instead of the plan, say where to simulate next: this many new points or repetitions of points, as CSV.
    #[arg(long, value_name = "N", conflicts_with_all = ["stage", "json"], value_parser = clap::value_parser!(u32).range(1..=1000))]
    suggest: Option<u32>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints the plan of the study.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    if let Some(wished) = arguments.suggest {
        return suggest(&Study::load_with(path, arguments.reps)?, wished as usize);
    }
    let target = stage(arguments.stage.as_deref())?;
    print(&Study::load_with(path, arguments.reps)?, target, arguments.json)
}

/// Prints the rows of a points file.
fn suggest(study: &Study, wished: usize) -> Result<Outcome, CliError> {
    let campaign = study.campaign(Options::default())?;
    let stale =
        assess(study, &study.lock()?).into_iter().find(|step| step.stage == "train" && step.state != State::Fresh);
    if stale.is_some() {
        return Err("the metamodels are not up to date; run `granulake repro train`".into());
    }
    let rows = stages::suggest(&study.context(&campaign), wished)?;
    let mut out = std::io::stdout().lock();
    let names: Vec<&str> = study.config.parameters.iter().map(|parameter| parameter.name).collect();
    writeln!(out, "{},{EXTRA},note", names.join(","))?;
    for row in rows {
        let values: Vec<String> = row.point.values.iter().map(|value| canonical(*value)).collect();
        writeln!(out, "{},{},{}", values.join(","), row.point.extra, row.note)?;
    }
    Ok(Outcome::Done)
}

/// Prints the plan up to `target`.
pub fn print(study: &Study, target: Option<&'static Stage>, as_json: bool) -> Result<Outcome, CliError> {
    let campaign = study.campaign(Options::default())?;
    let wanted: Vec<&str> = selection(target).iter().map(|stage| stage.name).collect();
    let steps: Vec<Step> =
        assess(study, &study.lock()?).into_iter().filter(|step| wanted.contains(&step.stage)).collect();
    let rows = steps.iter().map(|step| row(study, &campaign, step)).collect::<Result<Vec<_>, _>>()?;
    let mut out = std::io::stdout().lock();
    if as_json {
        writeln!(out, "{}", Value::Array(rows.iter().map(Row::json).collect()))?;
        return Ok(Outcome::Done);
    }
    let names = ["stage", "state", "runs", "new", "CPU-h", "why"].map(str::to_owned);
    let cells: Vec<Vec<Value>> = rows.iter().map(Row::cells).collect();
    writeln!(out, "{}", aligned(&names, &cells))?;
    if rows.iter().any(|row| row.guessed) {
        writeln!(
            out,
            "CPU-h marked ~ assume {GUESS_SECONDS} s a run where none of that experiment has been timed yet"
        )?;
    }
    Ok(Outcome::Done)
}

struct Row {
    stage: &'static str,
    state: State,
    /// Runs wanted, runs missing, CPU-hours of the missing ones; unknown while an earlier stage has to run.
    runs: Option<(usize, usize, f64)>,
    guessed: bool,
}

fn row(study: &Study, campaign: &Campaign, step: &Step) -> Result<Row, CliError> {
    let Some(stage) = find(step.stage) else { return Err(format!("no stage is called {}", step.stage).into()) };
    let failed = |source| PipelineError::Stage { stage: stage.name, source };
    let mut row = Row { stage: step.stage, state: step.state.clone(), runs: None, guessed: false };
    if let Some(requests) = (stage.simulations)(&study.context(campaign)).map_err(failed)? {
        let (mut wanted, mut missing, mut hours) = (0, 0, 0.0);
        for outlook in campaign.outlook(&requests)?.into_values() {
            row.guessed |= outlook.seconds.is_none() && outlook.missing > 0;
            wanted += outlook.wanted;
            missing += outlook.missing;
            hours += outlook.missing as f64 * outlook.seconds.unwrap_or(GUESS_SECONDS) / 3600.0;
        }
        row.runs = Some((wanted, missing, hours));
    }
    Ok(row)
}

impl Row {
    fn cells(&self) -> Vec<Value> {
        let simulated = self.runs.filter(|(wanted, ..)| *wanted > 0);
        let hours = |(_, missing, hours): (usize, usize, f64)| {
            let mark = if self.guessed { "~" } else { "" };
            if missing == 0 { "0".to_owned() } else { format!("{mark}{hours:.2}") }
        };
        let unknown = if self.runs.is_none() { Value::from("?") } else { Value::from("") };
        vec![
            self.stage.into(),
            self.state.word().into(),
            simulated.map_or(unknown.clone(), |(wanted, ..)| wanted.to_string().into()),
            simulated.map_or(unknown.clone(), |(_, missing, _)| missing.to_string().into()),
            simulated.map_or(unknown, |runs| hours(runs).into()),
            self.state.detail().into(),
        ]
    }

    fn json(&self) -> Value {
        json!({
            "stage": self.stage,
            "state": self.state.word(),
            "why": self.state.detail(),
            "runs": self.runs.map(|(wanted, ..)| wanted),
            "new_runs": self.runs.map(|(_, missing, _)| missing),
            "cpu_hours": self.runs.map(|(.., hours)| hours),
            "cpu_hours_guessed": self.guessed,
        })
    }
}
