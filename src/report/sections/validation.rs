//! Held-out equipment at the optima against the measurement, beside the paper's Table 9.

use crate::tables::ValidationRow;

use super::super::charts::{Mark, PAPER, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Legend, Section, Table, cell, optional, text};
use super::super::numbers::{percent, signed_fixed, significant, spread, with_interval};
use super::super::{Report, paper, words};
use super::verdict::error;
use super::{coarse_warning, interval, latest, method_rank, not_run, over_repetitions, per_data_set, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks = per_data_set(report, "No held-out equipment was simulated for these data.", |measured| {
        data_set(report, measured)
    });
    if report.validation.is_empty() {
        blocks = vec![not_run("validate", "the calibrated model has not met data it was not fitted to")];
    }
    Section { id: "validation", title: "Validation: the hopper".to_string(), blocks }
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let own: Vec<&ValidationRow> = report.validation.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return Vec::new();
    }
    let published = report.is_published(measured);
    let last = latest(&own);
    let mut blocks: Vec<Block> = coarse_warning(report).filter(|_| published).into_iter().collect();
    blocks.push(chart(report, &last, published));
    let beside = if published { ", beside the paper's Table 9 (which has no SK)" } else { "" };
    blocks.push(table(&format!("Held-out observable at the calibrated parameters{beside}"), last, published));
    if published {
        blocks.push(Block::Paragraph(text(format!("{} {}", paper::SLIPS[1], paper::SLIPS[2]))));
    }
    if over_repetitions(&own) {
        let summary = format!("All {} validations", own.len());
        let all = vec![table("Held-out observable at every number of repetitions", own, published)];
        blocks.push(Block::Details { summary, blocks: all });
    }
    blocks
}

fn table(caption: &str, mut rows: Vec<&ValidationRow>, published: bool) -> Block {
    rows.sort_by_key(|row| (words::rank(&row.kpi), method_rank((&row.kind, &row.approach)), row.n));
    let headings = ["method", "from", "observable", "#runs", "#simulated mean", "#sd", "#measured", "#error [%]"];
    let mut table = Table::new(caption, &headings);
    for (index, row) in rows.iter().enumerate() {
        table.rows.push(self::row(row));
        let next = rows.get(index + 1);
        let last = next.is_none_or(|next| (&next.kind, &next.approach) != (&row.kind, &row.approach));
        if let Some(paper) = discharge(row).filter(|_| published && last) {
            table.rows.extend([printed(row, &paper), difference(row, &paper)]);
        }
    }
    Block::Table(table)
}

fn row(row: &ValidationRow) -> Vec<Cell> {
    let missing = no_value(row);
    vec![
        cell(words::method(&row.kind, &row.approach)),
        cell(format!("this study, n = {}", row.n)),
        cell(format!("{} [{}]", words::title(&row.kpi), words::unit(&row.unit))),
        runs(row),
        simulated(row),
        optional(row.sd, |sd| significant(sd, 2), if row.count == 1 { "needs two runs" } else { &missing }),
        cell(spread(row.target_mean, row.target_sd)).with_note(format!("n = {}", row.target_n)),
        error(row.error_percent, row.error_lower_percent, row.error_upper_percent, &missing),
    ]
}

/// The paper's row of a method (Table 9).
fn printed(row: &ValidationRow, paper: &paper::Discharge) -> Vec<Cell> {
    let both = format!("{} / {} at mean ± sd", percent(paper.error.upper), percent(paper.error.lower));
    vec![
        cell(words::method(&row.kind, &row.approach)),
        cell(super::from_paper()),
        cell(format!("{} [{}]", words::title(&row.kpi), words::unit(&row.unit))),
        cell("5"),
        cell(format!("{:.2} [{:.2}, {:.2}]", paper.mean, paper.mean_lower, paper.mean_upper)),
        cell(significant(paper.sd, 2)),
        cell(paper::MEASURED_DISCHARGE),
        cell(percent(paper.error.mean)).with_note(both),
    ]
}

/// This study's error minus the paper's, in per cent of the measured mean.
fn difference(row: &ValidationRow, paper: &paper::Discharge) -> Vec<Cell> {
    let missing = no_value(row);
    let apart = row.mean.map(|mean| mean - paper.mean);
    vec![
        cell(words::method(&row.kind, &row.approach)),
        cell("difference"),
        cell(format!("{} [{}]", words::title(&row.kpi), words::unit(&row.unit))),
        cell(""),
        optional(apart, |apart| signed_fixed(apart, 2), &missing),
        optional(row.sd.map(|sd| sd - paper.sd), |apart| signed_fixed(apart, 3), &missing),
        cell(""),
        optional(row.error_percent.map(|error| error - paper.error.mean), percent, &missing),
    ]
}

/// The paper's only held-out observable is the discharge rate.
fn discharge(row: &ValidationRow) -> Option<paper::Discharge> {
    paper::discharge(&row.kind, &row.approach).filter(|_| row.kpi == "discharge_rate")
}

fn runs(row: &ValidationRow) -> Cell {
    let (count, asked) = (row.count, row.repetitions);
    if count == asked { cell(asked.to_string()) } else { cell(format!("{count} of {asked}")) }
}

fn no_value(row: &ValidationRow) -> String {
    row.reason.clone().unwrap_or_else(|| format!("{} of {} runs gave a value", row.count, row.repetitions))
}

fn simulated(row: &ValidationRow) -> Cell {
    let Some(mean) = row.mean else { return Cell::missing(no_value(row)) };
    match interval(row.mean_lower, row.mean_upper) {
        Some((lower, upper)) => cell(with_interval(mean, lower, upper)),
        None => cell(significant(mean, 4)).with_note("no interval from one run"),
    }
}

fn chart(report: &Report, rows: &[&ValidationRow], published: bool) -> Block {
    let kpis = ranked(rows.iter().map(|row| row.kpi.as_str()));
    let figures = kpis.into_iter().map(|kpi| {
        let own = rows.iter().filter(|row| row.kpi == kpi);
        let chart = RowChart {
            title: format!("{}: error against the measurement", words::title(kpi)),
            axis: "error of the simulated mean [%]".to_string(),
            rows: own.map(|row| chart_row(row, published)).collect(),
            guides: vec![0.0],
            ..RowChart::default()
        };
        Figure { chart: chart.draw(), caption: String::new() }
    });
    let mut legend: Legend = vec![(0, format!("this study, {}", report.interval_name()))];
    if published {
        legend.push((PAPER, super::from_paper()));
    }
    Block::Figures { legend, figures: figures.collect() }
}

fn chart_row(row: &ValidationRow, published: bool) -> Row {
    let ours = row.error_percent.map(|value| Mark {
        series: 0,
        value,
        interval: interval(row.error_lower_percent, row.error_upper_percent),
        hint: format!("{} %", error(Some(value), row.error_lower_percent, row.error_upper_percent, "").text),
    });
    let theirs = discharge(row).filter(|_| published).map(|paper| Mark {
        series: PAPER,
        value: paper.error.mean,
        interval: None,
        hint: format!("paper {} %", percent(paper.error.mean)),
    });
    Row {
        label: format!("{}, n = {}", words::method(&row.kind, &row.approach), row.n),
        note: if ours.is_none() { no_value(row) } else { String::new() },
        marks: ours.into_iter().chain(theirs).collect(),
        ..Row::default()
    }
}
