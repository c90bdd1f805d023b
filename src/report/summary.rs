//! The short text at the end of a run: study, runs, parameters, verification, hopper, verdict, before and after.
//!
//! One calibration per data set is shown: the one the diagnosis starts from. The report has them all.

use std::collections::BTreeMap;

use crate::tables::OptimumRow;

use super::numbers::{MISSING, count, percent, plus_minus, significant, with_interval};
use super::{Report, words};

/// No summary is longer.
const LINES: usize = 35;
/// Width at which sentences are wrapped.
const WIDTH: usize = 100;
/// Width of the first column.
const NAME: usize = 14;

/// Renders the summary; what finds no room is counted, never silently dropped.
pub fn render(report: &Report) -> String {
    let mut lines = head(report);
    let sets: Vec<Vec<String>> = report.data_sets().into_iter().map(|measured| data_set(report, measured)).collect();
    let total = sets.len();
    for (index, set) in sets.into_iter().enumerate() {
        // One line stays free for saying what was left out.
        if lines.len() + set.len() > LINES - 1 {
            lines.push(format!("{} of {total} data sets more are in the report", total - index));
            break;
        }
        lines.extend(set);
    }
    lines.truncate(LINES);
    lines.join("\n") + "\n"
}

fn head(report: &Report) -> Vec<String> {
    let study = &report.study;
    let title = if study.title.is_empty() { String::new() } else { format!(": {}", study.title) };
    let mut lines = wrapped("study", &format!("{}{title} ({} resolution)", study.name, study.resolution.name()));
    lines.extend(wrapped("runs", &runs(report)));
    if report.is_coarse() {
        lines
            .extend(wrapped("", "a coarse set-up is its own model: differences from the paper are no error of either"));
    }
    lines
}

fn runs(report: &Report) -> String {
    if report.runs.is_empty() {
        return format!("{MISSING} the stage simulate has not run");
    }
    let mut experiments: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for run in &report.runs {
        let counts = experiments.entry(&run.experiment).or_default();
        if run.status == "ok" { counts.0 += 1 } else { counts.1 += 1 }
    }
    let said = experiments.into_iter().map(|(experiment, (ok, failed))| {
        let failed = if failed > 0 { format!(" ({} failed)", count(failed)) } else { String::new() };
        format!("{} {}{failed}", words::label(experiment), count(ok))
    });
    said.collect::<Vec<_>>().join(", ")
}

/// Kind, approach and n of the calibration to show.
struct Shown<'a> {
    kind: &'a str,
    approach: &'a str,
    n: u32,
}

/// The study's own method, else the last kind and the fuller approach, at its largest number of repetitions.
fn shown<'a>(report: &'a Report, measured: &str) -> Option<Shown<'a>> {
    let wanted = |row: &OptimumRow| {
        report.study.method.as_ref().is_some_and(|method| row.kind == method.kind && row.approach == method.approach)
    };
    let kind = |row: &OptimumRow| words::KINDS.iter().position(|&known| known == row.kind);
    let own = report.optima.iter().filter(|row| row.measured == measured);
    own.max_by_key(|row| (wanted(row), kind(row), &row.approach, row.n)).map(|row| Shown {
        kind: &row.kind,
        approach: &row.approach,
        n: row.n,
    })
}

fn data_set(report: &Report, measured: &str) -> Vec<String> {
    let mut lines = vec![String::new()];
    match shown(report, measured) {
        Some(shown) => lines.extend(calibrated(report, measured, &shown)),
        None => lines.push(format!("{measured}: {MISSING} not calibrated")),
    }
    lines.extend(verdict(report, measured));
    lines.extend(before_after(report, measured));
    lines
}

fn calibrated(report: &Report, measured: &str, shown: &Shown) -> Vec<String> {
    let method = words::method(shown.kind, shown.approach);
    let mut lines = vec![format!("{measured}: calibrated with {method}, n = {}", shown.n)];
    let mut optima: Vec<&OptimumRow> = report
        .optima
        .iter()
        .filter(|row| {
            row.measured == measured && row.kind == shown.kind && row.approach == shown.approach && row.n == shown.n
        })
        .collect();
    optima.sort_by_key(|row| words::rank(&row.parameter));
    lines.extend(optima.into_iter().map(|row| {
        let outside = row.lower.zip(row.upper).is_some_and(|(lower, upper)| !(lower..=upper).contains(&row.value));
        let bound = match (row.at_bound, outside) {
            (true, _) => " (on its bound)",
            (false, true) => " (outside its interval, see the report)",
            (false, false) => "",
        };
        format!("{:NAME$} {:<20} {}{bound}", "", words::label(&row.parameter), words::with_unit(&value(row), &row.unit))
    }));
    lines.extend(wrapped("verification", &verification(report, measured, shown)));
    lines.extend(wrapped("hopper", &hopper(report, measured, shown)));
    lines
}

fn value(row: &OptimumRow) -> String {
    match row.lower.zip(row.upper) {
        Some((lower, upper)) => with_interval(row.value, lower, upper),
        None => significant(row.value, 4),
    }
}

fn verification(report: &Report, measured: &str, shown: &Shown) -> String {
    let mut rows: Vec<_> = report
        .verification
        .iter()
        .filter(|row| {
            row.measured == measured && row.kind == shown.kind && row.approach == shown.approach && row.n == shown.n
        })
        .filter(|row| words::is_kpi(&row.kpi))
        .collect();
    if rows.is_empty() {
        return format!("{MISSING} the stage verify has not run");
    }
    rows.sort_by_key(|row| words::rank(&row.kpi));
    let error = |row: &&crate::tables::VerificationRow| match row.target_error_percent {
        Some(error) => format!("{} {} %", words::label(&row.kpi), percent(error)),
        None => format!("{} {MISSING} no run gave a value", words::label(&row.kpi)),
    };
    format!("error against the target: {}", rows.iter().map(error).collect::<Vec<_>>().join(", "))
}

fn hopper(report: &Report, measured: &str, shown: &Shown) -> String {
    let rows = report.validation.iter();
    let mut own = rows.filter(|row| {
        row.measured == measured && row.kind == shown.kind && row.approach == shown.approach && row.n == shown.n
    });
    let Some(row) = own.next() else { return format!("{MISSING} the stage validate has not run") };
    let Some(error) = row.error_percent else {
        return format!("{MISSING} {}", row.reason.as_deref().unwrap_or("no run gave a value"));
    };
    let interval = match row.error_lower_percent.zip(row.error_upper_percent) {
        Some((lower, upper)) => format!(" [{}, {}]", percent(lower), percent(upper)),
        None => String::new(),
    };
    format!("{} {}{interval} % against the measurement", words::label(&row.kpi), percent(error))
}

fn verdict(report: &Report, measured: &str) -> Vec<String> {
    match report.verdicts.iter().find(|row| row.measured == measured) {
        Some(row) => wrapped("verdict", &row.sentence),
        None => wrapped("verdict", &format!("{MISSING} the stage diagnose has not run")),
    }
}

fn before_after(report: &Report, measured: &str) -> Vec<String> {
    let mut rows = report.before_after_of(measured);
    rows.retain(|row| row.statistic == "mean" && words::is_kpi(&row.kpi));
    let switched = rows.iter().any(|row| row.after.is_some());
    let mut lines = strengths(report, measured);
    if !switched && !rows.is_empty() {
        lines.extend(wrapped("", "error of the model fitted to all statistics, no effect switched on:"));
    }
    lines.extend(rows.into_iter().map(|row| {
        let error = |value: Option<f64>| format!("{:>8} %", value.map_or(MISSING.to_string(), percent));
        let after = if switched { format!(" → {}", error(row.after_error_percent)) } else { String::new() };
        let (name, role) = (words::label(&row.kpi), report.role(row));
        format!("{:NAME$} {name:<20} {}{after}  ({role})", "", error(row.before_error_percent))
    }));
    lines
}

/// Strengths of the effects that were switched on: what is recalibrated but was absent before.
fn strengths(report: &Report, measured: &str) -> Vec<String> {
    let own = || report.recalibration.iter().filter(|row| row.measured == measured);
    let absent = |name: &str| !own().any(|row| row.name == name && row.model == "before");
    let added = own().filter(|row| row.model == "after" && absent(&row.name));
    let strength = |row: &crate::tables::RecalibrationRow| {
        let value = words::with_unit(&plus_minus(row.value, row.standard_error), &row.unit);
        format!("{} {value}", words::label(&row.name))
    };
    let said: Vec<String> = added.map(strength).collect();
    if said.is_empty() {
        Vec::new()
    } else {
        wrapped("added", &format!("{}; error of the model fitted to all statistics, before → after:", said.join(", ")))
    }
}

/// A name and a text beside it, wrapped with the text's left edge straight.
fn wrapped(name: &str, text: &str) -> Vec<String> {
    let mut lines = vec![format!("{name:<NAME$}")];
    for word in text.split_whitespace() {
        let last = lines.last().map_or(0, |line| line.chars().count());
        if last + word.chars().count() + 1 > WIDTH {
            lines.push(" ".repeat(NAME));
        }
        if let Some(line) = lines.last_mut() {
            line.push(' ');
            line.push_str(word);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sentences_are_wrapped_with_a_straight_edge() {
        let lines = wrapped("verdict", &"word ".repeat(60));
        assert!(lines.len() > 2);
        assert!(lines.iter().all(|line| line.chars().count() <= WIDTH));
        assert!(lines[1..].iter().all(|line| line.starts_with(&" ".repeat(NAME + 1))));
    }

    #[test]
    fn an_empty_report_says_what_has_not_run() {
        let text = render(&Report::default());
        assert!(text.contains("the stage simulate has not run"), "{text}");
    }
}
