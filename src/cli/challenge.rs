//! `challenge`: measured data that hide an effect, for testing the whole loop.

use super::output::aligned;
use super::{CliError, Outcome};
use crate::campaign::{Campaign, Options};
use crate::challenge::{self, ConfusionMatrix, Declaration, Order, Score, Solution};
use crate::config::DensityBounds;
use crate::pipeline::run::{Request, repro};
use crate::pipeline::{self, Study};
use crate::stages;
use crate::stats::summary::clopper_pearson;
use crate::store::{Store, table};
use crate::tables::Row;
use crate::tables::list::{AttributionRow, BeforeAfterRow, ConfusionRow, RecalibrationRow, VerdictRow};
use clap::{Args, Subcommand};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The data of a challenge, in its folder.
const MEASURED: &str = "measured.csv";
/// The declaration, which nothing but `score` reads.
const SEALED: &str = "sealed.toml";
/// Tables of the solution.
const TABLES: &str = "solution";

/// Make, solve and score measured data that hide an effect.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Write measured.csv and, apart from it, sealed.toml, which says what the data hide.
    #[command(after_help = "\
Examples:
  granulake challenge new --seed 7 --out blind             a random candidate, strength from the upper third of its range
  granulake challenge new --seed 7 --effect none --out blind
  granulake challenge new --seed 7 --effect none --scale pile.drop_height=0.5 --out foreign")]
    New {
        /// Seed of the hidden parameters, the effect and its strength.
        #[arg(long)]
        seed: u64,
        /// Name of an effect, `random` or `none`.
        #[arg(long, default_value = "random")]
        effect: String,
        /// Strength of the effect; drawn from the upper third of its physical range when left out.
        #[arg(long, allow_negative_numbers = true)]
        strength: Option<f64>,
        /// Repetitions of every fitted experiment.
        #[arg(long, default_value_t = 20)]
        n: u32,
        /// Repetitions of the held-out experiment.
        #[arg(long, default_value_t = 5)]
        n_held_out: u32,
        /// Submerged weighings of the grains; 0 = the particle density was not measured.
        #[arg(long, default_value_t = 10)]
        weighings: u32,
        /// Multiply a setting besides: a discrepancy that no candidate describes.
        #[arg(long, value_name = "NAME=FACTOR", value_parser = factor)]
        scale: Vec<(String, f64)>,
        /// Folder to write to.
        #[arg(long)]
        out: PathBuf,
    },
    /// Calibrate and diagnose the data of a challenge with the study's runs; writes DIR/solution.
    #[command(after_help = "\
Examples:
  granulake challenge solve blind
  granulake challenge solve blind --without cohesion       as if the library did not know cohesion")]
    Solve {
        /// Folder with measured.csv.
        dir: PathBuf,
        /// A candidate of the study to leave out.
        #[arg(long, value_name = "EFFECT")]
        without: Option<String>,
        /// Threads; one per core when left out.
        #[arg(long, value_name = "N", default_value_t = 0)]
        jobs: usize,
    },
    /// Open the seals of solved challenges and compare; of several, print who is taken for whom and how often a verdict is right.
    #[command(after_help = "\
Examples:
  granulake challenge score blind
  granulake challenge score blind*/ --json")]
    Score {
        /// Folders with measured.csv, sealed.toml and solution.
        #[arg(required = true)]
        dirs: Vec<PathBuf>,
        /// Print JSON.
        #[arg(long)]
        json: bool,
    },
}

fn factor(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=FACTOR")?;
    Ok((name.to_owned(), value.parse().map_err(|_| format!("`{value}` is not a number"))?))
}

/// Makes, solves or scores.
pub fn run(study: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    match &arguments.action {
        Action::New { seed, effect, strength, n, n_held_out, weighings, scale, out } => {
            let order = Order {
                seed: *seed,
                effect: effect.clone(),
                strength: *strength,
                repetitions: *n,
                held_out_repetitions: *n_held_out,
                weighings: *weighings,
                scale: scale.clone(),
            };
            new(study, &order, out)
        }
        Action::Solve { dir, without, jobs } => solve(study, dir, without.as_deref(), *jobs),
        Action::Score { dirs, json } => score(dirs, *json),
    }
}

/// Makes the challenge and writes its two files.
fn new(study: &Path, order: &Order, out: &Path) -> Result<Outcome, CliError> {
    // The measured data of the study are not read: the challenge may be about to become one of them.
    let mut config = Study::config(study)?;
    if config.bounds.density == DensityBounds::Sought {
        config = Study::load(study)?.config;
    }
    if config.bounds.density == DensityBounds::Sought {
        return Err(
            "hidden parameters lie within the bounds, which are still sought; run `granulake repro bounds`".into()
        );
    }
    let campaign = Campaign::open(Store::at(config.artifacts()), Options { progress: true, ..Options::default() })?;
    let campaign = campaign.with_step_limit(config.study.step_limit);
    let challenge = challenge::make(&config, &campaign, order)?;
    std::fs::create_dir_all(out)?;
    std::fs::write(out.join(SEALED), challenge.sealed)?;
    std::fs::write(out.join(MEASURED), challenge.measured)?;
    eprintln!("wrote {}; name it in a [[measured]] section of a study", out.join(MEASURED).display());
    Ok(Outcome::Done)
}

/// Brings the study up to date as far as its metamodels, solves, and writes the tables.
fn solve(study: &Path, dir: &Path, without: Option<&str>, jobs: usize) -> Result<Outcome, CliError> {
    let mut study = Study::load(study)?;
    if let Some(name) = without.filter(|name| !study.config.diagnose.candidates.iter().any(|known| known == name)) {
        let known = study.config.diagnose.candidates.join(", ");
        return Err(format!("`{name}` is no candidate of the study; these are: {known}").into());
    }
    let options = Options { jobs, progress: true, retry_failed: false };
    repro(&mut study, &Request { target: stages::find("train"), options, ..Request::default() }, |_, _| {})?;
    let campaign = study.campaign(options)?;
    let solution = dir.join(TABLES);
    if solution.exists() {
        std::fs::remove_dir_all(&solution)?;
    }
    for (path, bytes) in pipeline::solve::solve(&study, &campaign, &dir.join(MEASURED), without)? {
        let path = solution.join(path);
        std::fs::create_dir_all(path.parent().unwrap_or(&solution))?;
        std::fs::write(path, bytes)?;
    }
    campaign.compact()?;
    let verdicts: Vec<VerdictRow> = table::read(&solution, VerdictRow::SPEC)?;
    let sentence = verdicts.first().map_or("no verdict", |row| row.sentence.as_str());
    writeln!(std::io::stdout(), "{}: {sentence}", dir.display())?;
    Ok(Outcome::Done)
}

/// A solved challenge with its seal open.
struct Opened<'d> {
    dir: &'d Path,
    score: Score,
    verdict: VerdictRow,
    parameters: BTreeMap<String, f64>,
    before_after: Vec<BeforeAfterRow>,
}

/// Opens the seals and prints one line per challenge, or an array.
fn score(dirs: &[PathBuf], as_json: bool) -> Result<Outcome, CliError> {
    let mut opened = Vec::new();
    for dir in dirs {
        opened.push(Opened::read(dir).map_err(|e| format!("{}: {e}", dir.display()))?);
    }
    let mut out = std::io::stdout().lock();
    if as_json {
        writeln!(out, "{}", Value::Array(opened.iter().map(Opened::json).collect()))?;
        return Ok(Outcome::Done);
    }
    let names = ["challenge", "truth", "strength", "verdict", "named", "found", "sd", "off_in_sd", "correct"];
    let cells: Vec<_> = opened.iter().map(Opened::cells).collect();
    writeln!(out, "{}", aligned(&names.map(str::to_owned), &cells))?;
    if opened.len() > 1 {
        writeln!(out, "\n{}\n", confusion(&opened))?;
    }
    writeln!(out, "{}", rates(&opened).join("\n"))?;
    Ok(Outcome::Done)
}

impl<'d> Opened<'d> {
    fn read(dir: &'d Path) -> Result<Self, CliError> {
        let text = |name: &str| {
            std::fs::read_to_string(dir.join(name))
                .map_err(|e| format!("cannot read {name}: {e}; a scored challenge needs it"))
        };
        let declaration = Declaration::open(&text(SEALED)?, &text(MEASURED)?)?;
        let tables = dir.join(TABLES);
        if !tables.is_dir() {
            return Err("it has no solution; run `granulake challenge solve` first".into());
        }
        let verdicts: Vec<VerdictRow> = table::read(&tables, VerdictRow::SPEC)?;
        let missing = "its solution has no verdict; run `granulake challenge solve` again";
        let verdict = verdicts.into_iter().next().ok_or(missing)?;
        let solution = Solution {
            verdict: verdict.clone(),
            attribution: table::read(&tables, AttributionRow::SPEC)?,
            confusion: table::read(&tables, ConfusionRow::SPEC)?,
        };
        let score = challenge::score(&declaration, &solution);
        let recalibration: Vec<RecalibrationRow> = table::read(&tables, RecalibrationRow::SPEC)?;
        let parameters = challenge::parameters_off(&declaration, &score, &recalibration);
        Ok(Self { dir, score, verdict, parameters, before_after: table::read(&tables, BeforeAfterRow::SPEC)? })
    }

    fn json(&self) -> Value {
        let (s, VerdictRow { t0, dof, p, .. }) = (&self.score, &self.verdict);
        json!({
            "dir": self.dir.display().to_string(), "truth": s.truth, "strength": s.strength, "in_library": s.in_library,
            "verdict": s.verdict, "named": s.named, "t0": t0, "dof": dof, "p": p,
            "found": s.found, "found_sd": s.found_sd, "off": s.off(), "detectable": s.detectable,
            "separation": s.separation, "decidable": s.decidable, "correct": s.correct, "parameters_off": self.parameters,
        })
    }

    fn cells(&self) -> Vec<Value> {
        let s = &self.score;
        vec![
            self.dir.display().to_string().into(),
            s.truth.clone().into(),
            shortened(s.strength),
            s.verdict.clone().into(),
            s.named.join(" ").into(),
            shortened(s.found),
            shortened(s.found_sd),
            shortened(s.off()),
            s.correct.into(),
        ]
    }
}

/// Four significant digits, for readers; `--json` has them all.
fn shortened(value: Option<f64>) -> Value {
    value.and_then(|value| format!("{value:.3e}").parse::<f64>().ok()).into()
}

/// How many challenges that hide the same thing got which answer.
fn confusion(opened: &[Opened]) -> String {
    let mut matrix = ConfusionMatrix::default();
    for score in opened.iter().map(|one| &one.score) {
        let left_out = if score.strength.is_some() && !score.in_library { ", left out" } else { "" };
        matrix.add(&(score.truth.replace('_', " ") + left_out), &score.truth, &score.answer(), 1);
    }
    let names: Vec<String> = ["hidden"].into_iter().chain(matrix.columns()).map(str::to_owned).collect();
    let count = |count: usize| if count == 0 { Value::Null } else { count.into() };
    let cells = |(hidden, counts): (&str, Vec<usize>)| {
        [hidden.into()].into_iter().chain(counts.into_iter().map(count)).collect()
    };
    aligned(&names, &matrix.rows().map(cells).collect::<Vec<Vec<Value>>>())
}

/// Rates over several challenges, each with its exact 95 % interval, where there is anything to count.
fn rates(opened: &[Opened]) -> Vec<String> {
    let of = |keep: fn(&Score) -> bool, hit: fn(&Score) -> bool| {
        opened.iter().map(|one| &one.score).filter(|score| keep(score)).map(hit).collect::<Vec<bool>>()
    };
    let lines = [
        rate("correct", &of(|_| true, |s| s.correct)),
        rate(
            "effects at or above their detection limit named, alone or in a class",
            &of(Score::is_detectable, |s| s.correct),
        ),
        rate("effects with D² > 10 to every rival named alone", &of(Score::is_due_alone, Score::is_alone)),
        rate("false alarms where nothing is hidden", &of(|s| s.truth == "none", |s| !s.correct)),
    ];
    let strengths: Vec<f64> = opened.iter().filter_map(|one| one.score.off()).collect();
    let parameters: Vec<f64> = opened.iter().flat_map(|one| one.parameters.values().copied()).collect();
    let within = |what: &str, off: &[f64]| {
        let what = format!("{what} within 1.96 standard errors, off by {:.2} of them (root mean square)", rms(off));
        rate(&what, &off.iter().map(|off| off.abs() < 1.96).collect::<Vec<_>>())
    };
    let off = [within("strengths", &strengths), within("parameters", &parameters)];
    let kinds = [
        ("fitted means", (true, false), "mean"),
        ("fitted scatters", (true, false), "sd"),
        ("means of held-out repetitions", (false, true), "mean"),
        ("scatters of held-out repetitions", (false, true), "sd"),
        ("held-out means", (false, false), "mean"),
        ("held-out scatters", (false, false), "sd"),
    ];
    let errors = kinds.map(|(what, role, statistic)| {
        let rows = opened.iter().flat_map(|one| &one.before_after);
        errors(what, rows.filter(|row| (row.fitted, row.held_out_repetitions) == role && row.statistic == statistic))
    });
    lines.into_iter().chain(off).chain(errors.into_iter().flatten()).flatten().collect()
}

/// Errors before and after an effect was added, of the observables that have both: how many of those with an interval have
/// zero in it, and how many have none; their size in percent where that means something.
fn errors<'r>(what: &str, rows: impl Iterator<Item = &'r BeforeAfterRow>) -> [Option<String>; 2] {
    let has_zero = |lower: Option<f64>, upper: Option<f64>| lower.zip(upper).map(|(l, u)| l <= 0.0 && 0.0 <= u);
    let both = |row: &BeforeAfterRow| {
        row.before_error.zip(row.after_error)?;
        let before = (row.before_error_percent, has_zero(row.before_lower, row.before_upper));
        let after = (row.after_error_percent, has_zero(row.after_lower, row.after_upper));
        Some((before, after))
    };
    let (before, after): (Vec<_>, Vec<_>) = rows.filter_map(both).unzip();
    [("before", before), ("after", after)].map(|(when, errors)| {
        let (percents, zero): (Vec<Option<f64>>, Vec<Option<bool>>) = errors.into_iter().unzip();
        let sizes: Vec<f64> = percents.iter().copied().flatten().collect();
        let mut what = format!("errors of {what} with zero in their interval {when} an effect was added");
        if !sizes.is_empty() {
            let some = if sizes.len() < percents.len() { format!(" of {}", sizes.len()) } else { String::new() };
            what += &format!(", {:.1} % (root mean square{some})", rms(&sizes));
        }
        let open = zero.iter().filter(|zero| zero.is_none()).count();
        if open > 0 {
            what += &format!(", {open} more without an interval");
        }
        let known: Vec<bool> = zero.into_iter().flatten().collect();
        rate(&what, &known).or_else(|| (open > 0).then(|| format!("0 of 0 {what}")))
    })
}

/// How many of those counted hit, with the exact 95 % interval of the rate; nothing where none are counted.
fn rate(what: &str, counted: &[bool]) -> Option<String> {
    let (hits, trials) = (counted.iter().filter(|hit| **hit).count(), counted.len());
    let interval = clopper_pearson(hits, trials, 0.95);
    (trials > 0).then(|| format!("{hits} of {trials} {what} ({:.3} to {:.3})", interval.lower, interval.upper))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of −8, 6 and, before alone, 3 %, each ± 2; after 1 and −2.5 %.
    #[test]
    fn errors_are_counted_where_there_are_both() {
        let row = |before: f64, after: Option<f64>| BeforeAfterRow {
            measured: "blind".to_owned(),
            experiment: "pile".to_owned(),
            kpi: "angle_of_repose".to_owned(),
            statistic: "mean".to_owned(),
            fitted: true,
            held_out_repetitions: false,
            measured_value: 30.0,
            before: Some(30.0 + 0.3 * before),
            after: after.map(|after| 30.0 + 0.3 * after),
            before_error: Some(0.3 * before),
            before_lower: Some(0.3 * (before - 2.0)),
            before_upper: Some(0.3 * (before + 2.0)),
            after_error: after.map(|after| 0.3 * after),
            after_lower: after.map(|after| 0.3 * (after - 2.0)),
            after_upper: after.map(|after| 0.3 * (after + 2.0)),
            before_error_percent: Some(before),
            before_lower_percent: Some(before - 2.0),
            before_upper_percent: Some(before + 2.0),
            after_error_percent: after,
            after_lower_percent: after.map(|after| after - 2.0),
            after_upper_percent: after.map(|after| after + 2.0),
            unit: "deg".to_owned(),
        };
        let mut rows = [row(-8.0, Some(1.0)), row(6.0, Some(-2.5)), row(3.0, None)];
        let [before, after] = errors("fitted means", rows.iter()).map(Option::unwrap);
        assert!(before.starts_with("0 of 2 ") && before.contains(" 7.1 % "), "{before}");
        assert!(after.starts_with("1 of 2 ") && after.contains(" 1.9 % "), "{after}");
        assert_eq!(errors("fitted means", rows[2..].iter()), [None, None]);

        // The second has no interval afterwards: neither a hit nor a miss, and its error still counts.
        rows[1].after_lower = None;
        let [before, after] = errors("fitted means", rows.iter()).map(Option::unwrap);
        assert!(before.starts_with("0 of 2 ") && !before.contains("without"), "{before}");
        assert!(after.starts_with("1 of 1 ") && after.contains(" 1.9 % (root mean square), 1 more without"), "{after}");
        let [_, after] = errors("fitted means", rows[1..].iter()).map(Option::unwrap);
        assert!(after.starts_with("0 of 0 ") && after.contains("1 more without an interval"), "{after}");

        // A mean near zero counts by its interval, and has no percentage.
        (rows[0].before_error_percent, rows[0].after_error_percent) = (None, None);
        let [before, after] = errors("fitted means", rows.iter()).map(Option::unwrap);
        assert!(before.starts_with("0 of 2 ") && before.contains(" 6.0 % (root mean square of 1)"), "{before}");
        assert!(after.starts_with("1 of 1 ") && after.contains(" 2.5 % (root mean square of 1)"), "{after}");
    }
}
