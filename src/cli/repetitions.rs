//! `repetitions`: how often a test has to be repeated for a wished precision.

use super::output::aligned;
use super::{CliError, Outcome};
use crate::pipeline::Study;
use crate::stats::summary::plan_repetitions;
use crate::units;
use clap::Args;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;

/// Say how many repetitions a wished precision of the mean takes, from the measured data alone.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake repetitions
  granulake repetitions --precision \"1 %\" --json

The number follows from the measured standard deviation; the range from the limits of its own interval, so few
repetitions give a wide range. `granulake repro analyse` stores the same, with every n and tests of normality.")]
pub struct Arguments {
    /// Wished half width of the mean's interval over the mean, instead of analysis.precision.
    #[arg(long, value_name = "SHARE")]
    precision: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Prints one line per measured observable.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::load(path)?;
    let precision = match &arguments.precision {
        Some(text) => share(text)?,
        None => study.config.analysis.precision,
    };
    let (level, convention) = (study.config.statistics.confidence, study.config.statistics.convention);
    let mut rows = Vec::new();
    for set in &study.measured {
        for found in set.statistics() {
            let plan = plan_repetitions(found.mean, found.sd, found.n as usize, precision, level, convention);
            rows.push(vec![
                set.name.clone().into(),
                found.kpi.into(),
                found.n.into(),
                format!("{} ± {:.2} %", units::format(found.mean, found.unit), 100.0 * plan.reached).into(),
                plan.needed.into(),
                plan.range.0.into(),
                plan.range.1.into(),
            ]);
        }
    }
    let names = ["data", "observable", "n", "mean", "needed", "at least", "at most"].map(str::to_owned);
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let object = |row: &Vec<Value>| {
            json!({
                "measured": row[0], "kpi": row[1], "n": row[2],
                "needed": row[4], "needed_lower": row[5], "needed_upper": row[6],
            })
        };
        writeln!(out, "{}", Value::Array(rows.iter().map(object).collect()))?;
    } else {
        writeln!(out, "repetitions for a mean known to ± {} %:", units::canonical(100.0 * precision))?;
        writeln!(out, "{}", aligned(&names, &rows))?;
    }
    Ok(Outcome::Done)
}

/// A positive share, such as `2 %` or `0.02`.
fn share(text: &str) -> Result<f64, CliError> {
    let share = units::parse(text, "1")?;
    if share > 0.0 && share <= 1.0 {
        Ok(share)
    } else {
        Err(format!("`{text}` is no precision; take 0.02 or \"2 %\"").into())
    }
}
