//! Error of every statistic before and after the effect was switched on and the model recalibrated.

use crate::tables::{BeforeAfterRow, RecalibrationRow};

use super::super::charts::{Mark, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Section, Table, Tone, cell, optional};
use super::super::numbers::{plus_minus, significant};
use super::super::{Report, words};
use super::verdict::error;
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

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&BeforeAfterRow> = report.before_after.iter().filter(|row| row.measured == measured).collect();
    rows.sort_by_key(|row| (!row.fitted, words::rank(&row.kpi), row.statistic.as_str()));
    let mut blocks: Vec<Block> = parameters(report, measured).into_iter().collect();
    if !rows.is_empty() {
        blocks.push(charts(&rows));
        blocks.push(table(&rows));
    }
    blocks
}

/// One drawing per statistic: spreads are known far less well than means and need an axis of their own.
fn charts(rows: &[&BeforeAfterRow]) -> Block {
    let statistics = distinct(rows.iter().map(|row| row.statistic.as_str()));
    let legend = vec![(1, "before: no effect".to_string()), (0, "after: effect switched on, recalibrated".to_string())];
    Block::Figures { legend, figures: statistics.into_iter().map(|statistic| figure(rows, statistic)).collect() }
}

fn figure(rows: &[&BeforeAfterRow], statistic: &str) -> Figure {
    let chart = RowChart {
        title: format!("Error of the {}", words::statistic(statistic)),
        axis: "error against the measurement [%]".to_string(),
        rows: rows.iter().filter(|row| row.statistic == statistic).map(|row| chart_row(row)).collect(),
        guides: vec![0.0],
        joined: true,
        ..RowChart::default()
    };
    let caption = "Intervals are 95 %; one without an end cap goes on beyond the axis.".to_string();
    Figure { chart: chart.draw(), caption }
}

fn chart_row(row: &BeforeAfterRow) -> Row {
    let mark = |series, name: &str, value: Option<f64>, lower, upper| {
        let hint = format!("{name} {} %", error(value, lower, upper, "").text);
        value.map(|value| Mark { series, value, interval: interval(lower, upper), hint })
    };
    let before = mark(1, "before", row.before_error_percent, row.before_lower_percent, row.before_upper_percent);
    let after = mark(0, "after", row.after_error_percent, row.after_lower_percent, row.after_upper_percent);
    Row {
        group: if row.fitted { "Fitted".to_string() } else { "Held out: the fit never saw these".to_string() },
        label: words::title(&row.kpi),
        note: if before.is_none() && after.is_none() { "not simulated".to_string() } else { String::new() },
        marks: before.into_iter().chain(after).collect(),
    }
}

fn table(rows: &[&BeforeAfterRow]) -> Block {
    let headings = [
        "observable",
        "statistic",
        "role",
        "#measured",
        "#before",
        "#after",
        "unit",
        "#error before [%]",
        "#error after [%]",
    ];
    let table = Table::new("Simulated values and their errors, before and after", &headings);
    Block::Table(table.with_rows(rows.iter().map(|row| self::row(row))))
}

fn row(row: &BeforeAfterRow) -> Vec<Cell> {
    let value = |value| optional(value, |value| significant(value, 4), "not simulated");
    vec![
        cell(words::title(&row.kpi)),
        cell(words::statistic(&row.statistic)),
        cell(words::role(row.fitted)),
        cell(significant(row.measured_value, 4)),
        value(row.before),
        value(row.after),
        cell(words::unit(&row.unit)),
        error(row.before_error_percent, row.before_lower_percent, row.before_upper_percent, "not simulated"),
        error(row.after_error_percent, row.after_lower_percent, row.after_upper_percent, "not simulated"),
    ]
}

fn parameters(report: &Report, measured: &str) -> Option<Block> {
    let own: Vec<&RecalibrationRow> = report.recalibration.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return None;
    }
    let find = |name: &str, model: &str| own.iter().copied().find(|row| row.name == name && row.model == model);
    let row = |name: &str| {
        let (before, after) = (find(name, "before"), find(name, "after"));
        let unit = before.or(after).map_or("", |row| &row.unit);
        let (before, after) = (parameter(before, "absent"), parameter(after, "not recalibrated"));
        vec![cell(words::title(name)), before, after, cell(words::unit(unit))]
    };
    let headings = ["parameter or effect", "#before", "#after", "unit"];
    let table = Table::new("Parameters and strengths ± standard error", &headings);
    let names = ranked(own.iter().map(|row| row.name.as_str()));
    Some(Block::Table(table.with_rows(names.into_iter().map(row))))
}

fn parameter(row: Option<&RecalibrationRow>, reason: &str) -> Cell {
    let Some(row) = row else { return Cell::missing(reason) };
    let value = cell(plus_minus(row.value, row.standard_error));
    if row.at_bound { value.with_note("on its bound").with_tone(Tone::Caution) } else { value }
}
