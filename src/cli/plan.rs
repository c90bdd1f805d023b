//! `plan`: what would run, why, how many simulations and what they cost.

use super::output::aligned;
use super::repro::stage;
use super::{CliError, Outcome};
use crate::campaign::{Options, Outlook};
use crate::config::points::EXTRA;
use crate::config::{Config, DensityBounds};
use crate::dem::expected_seconds;
use crate::experiments;
use crate::pipeline::plan::{State, Step, assess, recipe, selection};
use crate::pipeline::run::known;
use crate::pipeline::{PipelineError, Study};
use crate::stages::{self, Context, Demand, Stage, find};
use crate::units::canonical;
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

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
the first one they are guessed from the number of grains and steps, and said to be.
How many runs verify and validate need at most is known before their places are, and so it is of the whole design while
bounds of the particle density are sought; of diagnose the anchors of all effects are counted, its runs at optima only
when those are known.")]
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
        assess(study, &study.lock()?).into_iter().find(|step| step.stage == "train" && !step.state.is_settled());
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
    let lock = study.lock()?;
    let steps: Vec<Step> = assess(study, &lock).into_iter().filter(|step| wanted.contains(&step.stage)).collect();
    let unsettled = steps.iter().filter(|step| !step.state.is_settled()).filter_map(|step| find(step.stage));
    let outdated = unsettled.flat_map(|stage| stage.writes.iter().map(|spec| spec.name));
    let outdated: Vec<&str> = outdated.collect();
    let ledger = study.store().ledger("stages")?;
    let rows = steps.iter().map(|step| {
        let stage = stage(Some(step.stage))?.ok_or("no stage")?;
        let locked = lock.stages.get(stage.name).map(|locked| locked.outputs.clone()).unwrap_or_default();
        let known = known(study, &ledger, &locked, stage, &recipe(study, &lock, stage));
        row(&study.context(&campaign).without(outdated.clone()).knowing(known), stage, step)
    });
    let rows = rows.collect::<Result<Vec<_>, CliError>>()?;
    let mut out = std::io::stdout().lock();
    if as_json {
        writeln!(out, "{}", Value::Array(rows.iter().map(Row::json).collect()))?;
        return Ok(Outcome::Done);
    }
    let names = ["stage", "state", "runs", "new", "CPU-h", "why"].map(str::to_owned);
    let cells: Vec<Vec<Value>> = rows.iter().map(Row::cells).collect();
    writeln!(out, "{}", aligned(&names, &cells))?;
    let any = |test: fn(&Runs) -> bool| rows.iter().map(|row| &row.runs).any(test);
    if any(|runs| runs.at_most) {
        let bounds = study.config.bounds.density == DensityBounds::Sought;
        let design = if bounds { "the design lies within the bounds that the stage `bounds` finds, and " } else { "" };
        writeln!(
            out,
            "<= marks runs at points that are not known yet: {design}every calibration that succeeds needs its share"
        )?;
    }
    if any(|runs| runs.guessed) {
        writeln!(
            out,
            "CPU-h marked ~ are guessed from grains and steps where no run of that experiment has been timed yet"
        )?;
    }
    Ok(Outcome::Done)
}

struct Row {
    stage: &'static str,
    state: State,
    runs: Runs,
}

/// Simulations of a stage.
#[derive(Clone, Copy)]
struct Runs {
    wanted: usize,
    missing: usize,
    /// Of the missing ones.
    cpu_hours: f64,
    /// No run of an experiment has been timed yet.
    guessed: bool,
    /// Where they will be is not known yet: some may be in the store already, some may not be needed.
    at_most: bool,
}

fn row(context: &Context, stage: &Stage, step: &Step) -> Result<Row, CliError> {
    let failed = |source| PipelineError::Stage { stage: stage.name, source };
    let demand = match step.state {
        State::Skipped(_) => Demand::Runs(Vec::new()),
        _ => (stage.demand)(context).map_err(failed)?,
    };
    let cost = |outlook, at_most| Runs::of(context.config, outlook, at_most);
    let runs = match demand {
        Demand::Runs(requests) => cost(context.campaign.outlook(&requests)?, false),
        Demand::Besides(in_place, requests) => {
            let runs = cost(context.campaign.outlook(&requests)?, false);
            Runs { wanted: runs.wanted + in_place, ..runs }
        }
        Demand::AtMost(counts) => {
            let outlook = |(experiment, runs)| (experiment, context.campaign.foresee(experiment, runs));
            cost(counts.into_iter().map(outlook).collect(), true)
        }
    };
    Ok(Row { stage: step.stage, state: step.state.clone(), runs })
}

impl Runs {
    fn of(config: &Config, experiments: BTreeMap<&str, Outlook>, at_most: bool) -> Self {
        let mut runs = Self { wanted: 0, missing: 0, cpu_hours: 0.0, guessed: false, at_most };
        for (experiment, outlook) in experiments {
            runs.guessed |= outlook.seconds.is_none() && outlook.missing > 0;
            runs.wanted += outlook.wanted;
            runs.missing += outlook.missing;
            let seconds = outlook.seconds.unwrap_or_else(|| guess(config, experiment));
            runs.cpu_hours += outlook.missing as f64 * seconds / 3600.0;
        }
        runs
    }

    /// Wanted, missing and CPU-hours; nothing of a stage that never simulates.
    fn texts(&self) -> [String; 3] {
        if self.wanted == 0 {
            return Default::default();
        }
        let limit = if self.at_most { "<=" } else { "" };
        let mark = if self.guessed { "~" } else { "" };
        let hours = if self.missing == 0 { "0".to_owned() } else { format!("{limit}{mark}{:.2}", self.cpu_hours) };
        [format!("{limit}{}", self.wanted), format!("{limit}{}", self.missing), hours]
    }
}

/// Seconds that a run of an experiment may take at the settings of a study; none where these make no set-up, which the
/// stage itself says.
fn guess(config: &Config, experiment: &str) -> f64 {
    let setup = experiments::find(experiment).ok().and_then(|one| one.setup(config.base_settings()).ok());
    setup.map_or(0.0, |setup| expected_seconds(&setup))
}

impl Row {
    fn cells(&self) -> Vec<Value> {
        let [wanted, missing, hours] = self.runs.texts();
        vec![
            self.stage.into(),
            self.state.word().into(),
            wanted.into(),
            missing.into(),
            hours.into(),
            self.state.detail().into(),
        ]
    }

    fn json(&self) -> Value {
        json!({
            "stage": self.stage,
            "state": self.state.word(),
            "why": self.state.detail(),
            "runs": self.runs.wanted,
            "new_runs": self.runs.missing,
            "at_most": self.runs.at_most,
            "cpu_hours": self.runs.cpu_hours,
            "cpu_hours_guessed": self.runs.guessed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the runs took: 0.05 s and 0.4 s in the coarse set-up of the default study; 35, 52 and 48 s and four minutes at full scale.
    #[test]
    fn a_run_that_was_never_timed_is_guessed_within_a_factor_of_four() {
        let took = |study: &str, seconds: [f64; 4]| {
            let study = Study::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(study)).expect("a study");
            for (experiment, seconds) in ["bulk_density", "ledge", "pile", "hopper"].into_iter().zip(seconds) {
                let guess = guess(&study.config, experiment);
                assert!(guess < 4.0 * seconds && guess > 0.25 * seconds, "{experiment}: {guess} s for {seconds} s");
            }
        };
        took("pipeline.toml", [0.05, 0.05, 0.05, 0.4]);
        took("studies/fransen2022.toml", [35.0, 52.0, 48.0, 249.0]);
    }
}
