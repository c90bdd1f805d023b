//! Error of every statistic before and after the effect was switched on and the model recalibrated.

use crate::tables::{BeforeAfterRow, RecalibrationRow};

use super::super::charts::{Mark, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Section, Table, Tone, cell, optional, text};
use super::super::numbers::{plus_minus, significant, with_interval};
use super::super::{Report, words};
use super::verdict::{error, is_switched};
use super::{distinct, interval, not_run, per_data_set, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let blocks = if report.verdicts.is_empty() && report.before_after.is_empty() {
        vec![not_run("diagnose", "no effect was switched on")]
    } else {
        per_data_set(report, "No effect was switched on for these data.", |measured| data_set(report, measured))
    };
    Section { id: "before-after", title: "Before and after".to_string(), blocks }
}

/// Why the parameters here are not those of the calibration.
const FITTED_TO_ALL: &str = "These parameters are those of the diagnosis: with many runs at the optimum they are fitted to \
    all statistics of the fitted tests at once, each weighed by its error. The calibrated parameters further up are fitted \
    to the KPIs alone with the paper's weights, so their errors differ from those here. With an effect \
    that was switched on they and its strength are means over all that the data leave open. The intervals of held-out means \
    hold that too, beside the scatter of runs and measurements. How far such standard errors \
    hold is measured on coarse data sets whose truth is known (docs/challenges.md).";

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let rows = report.before_after_of(measured);
    let mut blocks: Vec<Block> = parameters(report, measured).into_iter().collect();
    if !rows.is_empty() {
        blocks.push(Block::Paragraph(text(FITTED_TO_ALL)));
        blocks.push(charts(report, &rows));
        blocks.push(table(report, &rows));
    }
    blocks
}

/// One drawing per statistic: spreads are known far less well than means and need an axis of their own.
fn charts(report: &Report, rows: &[&BeforeAfterRow]) -> Block {
    let statistics = distinct(rows.iter().map(|row| row.statistic.as_str()));
    let after = (0, "after: effect switched on, recalibrated".to_string());
    let legend = [(1, "before: no effect".to_string())].into_iter().chain(is_switched(rows).then_some(after));
    let figures = statistics.into_iter().map(|statistic| figure(report, rows, statistic)).collect();
    Block::Figures { legend: legend.collect(), figures }
}

fn figure(report: &Report, rows: &[&BeforeAfterRow], statistic: &str) -> Figure {
    let chart = RowChart {
        title: format!("Error of the {}", words::statistic(statistic)),
        axis: "error against the measurement [%]".to_string(),
        rows: rows.iter().filter(|row| row.statistic == statistic).map(|row| chart_row(report, row)).collect(),
        guides: vec![0.0],
        joined: true,
        ..RowChart::default()
    };
    let caption = format!("With {}; one without an end cap goes on beyond the axis.", report.interval_name());
    Figure { chart: chart.draw(), caption }
}

fn chart_row(report: &Report, row: &BeforeAfterRow) -> Row {
    let mark = |series, name: &str, value: Option<f64>, lower, upper| {
        let hint = format!("{name} {} %", error(value, lower, upper, "").text);
        value.map(|value| Mark { series, value, interval: interval(lower, upper), hint })
    };
    let before = mark(1, "before", row.before_error_percent, row.before_lower_percent, row.before_upper_percent);
    let after = mark(0, "after", row.after_error_percent, row.after_lower_percent, row.after_upper_percent);
    Row {
        group: match report.role(row) {
            "held out" => "Held out: the fit never saw this experiment".to_string(),
            "held-out repetitions" => "Held-out repetitions: the fit never saw these".to_string(),
            role => words::title(role),
        },
        label: words::title(&row.kpi),
        note: match (before.is_none() && after.is_none(), row.before_error.is_some()) {
            (true, true) => NEAR_ZERO.to_string(),
            (true, false) => "not simulated".to_string(),
            (false, _) => String::new(),
        },
        marks: before.into_iter().chain(after).collect(),
    }
}

fn table(report: &Report, rows: &[&BeforeAfterRow]) -> Block {
    let switched = is_switched(rows);
    let headings = match switched {
        true => vec!["#before", "#after", "unit", "#error before [%]", "#error after [%]"],
        false => vec!["#simulated", "unit", "#error [%]"],
    };
    let caption = match switched {
        true => "Simulated values and their errors, before and after",
        false => "Simulated values and their errors; no effect was switched on",
    };
    let headings = [vec!["observable", "statistic", "role", "#measured"], headings].concat();
    Block::Table(Table::new(caption, &headings).with_rows(rows.iter().map(|r| row(report, r, switched))))
}

fn row(report: &Report, row: &BeforeAfterRow, switched: bool) -> Vec<Cell> {
    let value = |value| optional(value, |value| significant(value, 4), "not simulated");
    let head = [
        cell(words::title(&row.kpi)),
        cell(words::statistic(&row.statistic)),
        cell(report.role(row)),
        cell(significant(row.measured_value, 4)),
        value(row.before),
    ];
    let unit = cell(words::unit(&row.unit));
    let [before, after] = errors(row);
    let cells = head.into_iter().chain(switched.then(|| value(row.after))).chain([unit, before]);
    cells.chain(switched.then_some(after)).collect()
}

/// Said where an error is given in the unit of the observable.
const NEAR_ZERO: &str = "no percentage so near zero";

/// Errors before and after, in percent where that means something.
fn errors(row: &BeforeAfterRow) -> [Cell; 2] {
    let one = |percent: [Option<f64>; 3], [value, lower, upper]: [Option<f64>; 3], simulated: Option<f64>| match value {
        Some(value) if percent[0].is_none() && value.is_finite() => {
            let text = match interval(lower, upper) {
                Some((lower, upper)) => with_interval(value, lower, upper),
                None => significant(value, 3),
            };
            cell(words::with_unit(&text, &row.unit)).with_note(NEAR_ZERO)
        }
        _ => {
            let reason = if simulated.is_some() { "no scatter to compare" } else { "not simulated" };
            error(percent[0], percent[1], percent[2], reason)
        }
    };
    [
        one(
            [row.before_error_percent, row.before_lower_percent, row.before_upper_percent],
            [row.before_error, row.before_lower, row.before_upper],
            row.before,
        ),
        one(
            [row.after_error_percent, row.after_lower_percent, row.after_upper_percent],
            [row.after_error, row.after_lower, row.after_upper],
            row.after,
        ),
    ]
}

fn parameters(report: &Report, measured: &str) -> Option<Block> {
    let own: Vec<&RecalibrationRow> = report.recalibration.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return None;
    }
    let find = |name: &str, model: &str| own.iter().copied().find(|row| row.name == name && row.model == model);
    let switched = own.iter().any(|row| row.model == "after");
    let row = |name: &str| {
        let (before, after) = (find(name, "before"), find(name, "after"));
        let unit = cell(words::unit(before.or(after).map_or("", |row| &row.unit)));
        let cells = [cell(words::title(name)), parameter(before, "absent")].into_iter();
        cells.chain(switched.then(|| parameter(after, "not recalibrated"))).chain([unit]).collect()
    };
    let headings: &[&str] = match switched {
        true => &["parameter or effect", "#before", "#after", "unit"],
        false => &["parameter", "#value", "unit"],
    };
    let table = Table::new("Parameters and strengths ± standard error", headings);
    let names = ranked(own.iter().map(|row| row.name.as_str()));
    Some(Block::Table(table.with_rows(names.into_iter().map(row))))
}

fn parameter(row: Option<&RecalibrationRow>, reason: &str) -> Cell {
    let Some(row) = row else { return Cell::missing(reason) };
    let value = cell(plus_minus(row.value, row.standard_error));
    if row.at_bound { value.with_note("on its bound").with_tone(Tone::Caution) } else { value }
}
