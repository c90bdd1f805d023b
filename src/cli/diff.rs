//! `diff`: settings and results of two states of a study, side by side.

use super::output::aligned;
use super::{CliError, Outcome};
use crate::pipeline::Study;
use crate::pipeline::diff::{Diff, Finding, Lost, ResultDiff, SettingDiff, Value, compare};
use crate::report::numbers::significant;
use crate::store::{Lock, Store, StoreError};
use clap::Args;
use serde_json::json;
use std::io::Write;
use std::path::Path;
use std::process::Command;

/// Digits of a number in the text; JSON has all.
const DIGITS: usize = 5;

/// Show changed settings and changed results side by side: parameters, errors of verification and validation, verdicts.
///
/// Of every calibration the one with most repetitions is compared. Results come out of the store, nothing is run; what
/// the store no longer has is named. Keep the results of a state with `granulake gc --pin NAME`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake diff HEAD~1                           the last commit but one against now
  granulake diff v1.0 HEAD --json
  granulake diff artifacts/pins/before.lock       a pin against now
  granulake diff old/pipeline.lock new/pipeline.lock")]
pub struct Arguments {
    /// A lock file, or a git revision whose lock file of this study is taken.
    #[arg(value_name = "REV|LOCK")]
    old: String,
    /// The other side; the study's lock file as it is now when left out.
    #[arg(value_name = "REV|LOCK")]
    new: Option<String>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Why a side of the comparison cannot be read.
#[derive(Debug, thiserror::Error)]
enum SideError {
    /// Neither a file nor a revision.
    #[error(
        "`{given}` is no lock file, and git has no `{file}` of it ({said}); `git log -- {file}` lists revisions that do"
    )]
    Neither {
        /// As given.
        given: String,
        /// Name of the lock file.
        file: String,
        /// What git said.
        said: String,
    },
    /// Git cannot be run.
    #[error("`{given}` is no lock file, and git cannot be asked for a revision of that name: {source}")]
    NoGit {
        /// As given.
        given: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The study has no lock yet.
    #[error("there is no `{file}` yet; run `granulake repro`, or name two lock files or revisions")]
    NoLock {
        /// Path of the lock file.
        file: String,
    },
    /// A lock that cannot be understood.
    #[error(transparent)]
    Lock(#[from] StoreError),
}

/// Prints the differences.
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let store = Store::at(Study::config(study)?.artifacts());
    let now = Study::lock_of(study);
    let old = side(&now, &arguments.old)?;
    let new = match &arguments.new {
        Some(given) => side(&now, given)?,
        None if now.is_file() => Lock::read(&now)?,
        None => return Err(SideError::NoLock { file: now.display().to_string() }.into()),
    };
    let names = [arguments.old.as_str(), arguments.new.as_deref().unwrap_or("now")];
    let diff = compare(&store, [&old, &new]);
    let mut out = std::io::stdout().lock();
    match arguments.json {
        true => writeln!(out, "{}", as_json(&diff, names))?,
        false => write!(out, "{}", as_text(&diff, names))?,
    }
    Ok(Outcome::Done)
}

/// The lock that a word on the command line names: a file, else a revision of `lock`.
fn side(lock: &Path, given: &str) -> Result<Lock, SideError> {
    let path = Path::new(given);
    if path.is_file() {
        return Ok(Lock::read(path)?);
    }
    let file = lock.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let neither =
        |said: &str| SideError::Neither { given: given.to_owned(), file: file.clone(), said: said.to_owned() };
    if given.starts_with('-') {
        return Err(neither("no revision begins with a dash"));
    }
    let folder = lock.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or_else(|| Path::new("."));
    let git = Command::new("git").arg("-C").arg(folder).arg("show").arg(format!("{given}:./{file}")).output();
    let output = git.map_err(|source| SideError::NoGit { given: given.to_owned(), source })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(neither(said.lines().next().unwrap_or("it gave no reason")));
    }
    let bad = |detail: String| StoreError::BadLock { path: format!("{given}:{file}").into(), detail };
    let text = String::from_utf8(output.stdout).map_err(|error| bad(error.to_string()))?;
    Ok(Lock::parse(&text).map_err(bad)?)
}

fn as_text(diff: &Diff, names: [&str; 2]) -> String {
    let mut text = String::new();
    if diff.settings.is_empty() {
        text += "no setting differs\n";
    } else {
        let head = ["setting", names[0], names[1], "used by"].map(str::to_owned);
        text += &(aligned(&head, &diff.settings.iter().map(setting_cells).collect::<Vec<_>>()) + "\n");
    }
    if !diff.results.is_empty() {
        let head = ["result", "of", names[0], names[1], "change"].map(str::to_owned);
        text += &format!("\n{}\n", aligned(&head, &diff.results.iter().map(result_cells).collect::<Vec<_>>()));
    } else if diff.lost.is_empty() {
        text += "no result differs\n";
    }
    for Lost { side, table, why } in &diff.lost {
        text += &format!("\n{table} of {} cannot be compared: {why}\n", names[*side]);
    }
    text
}

fn setting_cells(change: &SettingDiff) -> Vec<serde_json::Value> {
    vec![
        change.name.clone().into(),
        change.old.clone().into(),
        change.new.clone().into(),
        change.stages.join(", ").into(),
    ]
}

fn result_cells(change: &ResultDiff) -> Vec<serde_json::Value> {
    let cell =
        |finding: &Option<Finding>| finding.as_ref().map(|finding| value_text(&finding.value, &finding.unit)).into();
    let difference = difference(change).map(|difference| {
        let unit = change.new.as_ref().map_or("", |finding| &finding.unit);
        let sign = if difference > 0.0 { "+" } else { "" };
        format!("{sign}{}", value_text(&Value::Number(difference), unit))
    });
    vec![change.kind.into(), change.name.clone().into(), cell(&change.old), cell(&change.new), difference.into()]
}

fn value_text(value: &Value, unit: &str) -> String {
    match value {
        Value::Number(number) if unit == "1" => significant(*number, DIGITS),
        Value::Number(number) => format!("{} {unit}", significant(*number, DIGITS)),
        Value::Text(text) => text.clone(),
    }
}

/// Second minus first side, where both are numbers of one unit.
fn difference(change: &ResultDiff) -> Option<f64> {
    match (change.old.as_ref()?, change.new.as_ref()?) {
        (Finding { value: Value::Number(old), unit, .. }, Finding { value: Value::Number(new), unit: other, .. }) => {
            (unit == other).then_some(new - old)
        }
        _ => None,
    }
}

fn as_json(diff: &Diff, names: [&str; 2]) -> serde_json::Value {
    let finding = |finding: &Option<Finding>| {
        finding.as_ref().map(|finding| {
            let value = match &finding.value {
                Value::Number(number) => json!(number),
                Value::Text(text) => json!(text),
            };
            json!({"value": value, "unit": finding.unit, "n": finding.n})
        })
    };
    let setting = |change: &SettingDiff| json!({"name": change.name, "old": change.old, "new": change.new, "stages": change.stages});
    let result = |change: &ResultDiff| {
        json!({
            "kind": change.kind,
            "name": change.name,
            "old": finding(&change.old),
            "new": finding(&change.new),
            "change": difference(change),
        })
    };
    let lost = |lost: &Lost| json!({"side": names[lost.side], "table": lost.table, "why": lost.why});
    json!({
        "old": names[0],
        "new": names[1],
        "settings": diff.settings.iter().map(setting).collect::<Vec<_>>(),
        "results": diff.results.iter().map(result).collect::<Vec<_>>(),
        "lost": diff.lost.iter().map(lost).collect::<Vec<_>>(),
    })
}
