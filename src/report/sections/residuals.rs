//! What is left between the calibrated model and every measured statistic.

use crate::tables::ResidualRow;

use super::super::charts::{Mark, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Section, Table, Tone, cell, text};
use super::super::numbers::{plus_minus, signed_fixed, to_uncertainty};
use super::super::{Report, words};
use super::{not_run, per_data_set};

/// Beyond this many standard errors a value is outside its 95 % interval.
const LIMIT: f64 = 1.96;

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks =
        per_data_set(report, "No residuals are stored for these data.", |measured| data_set(report, measured));
    if report.residuals.is_empty() {
        blocks = vec![not_run("diagnose", "there are no residuals")];
    } else {
        blocks.insert(0, Block::Paragraph(text(intro())));
    }
    Section { id: "residuals", title: "Residuals".to_string(), blocks }
}

fn intro() -> String {
    "Measured minus simulated in standard errors of the difference (measurement, simulation and metamodel together). \
     The unabsorbed part is what no change of the calibrated parameters can take away: that is what a missing effect \
     has to explain."
        .to_string()
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&ResidualRow> = report.residuals.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    rows.sort_by_key(|row| (statistic_rank(&row.statistic), words::rank(&row.kpi)));
    let headings =
        ["observable", "statistic", "#measured", "#model", "#measured − model", "#z", "#unabsorbed z", "unit"];
    let table = Table::new("Residual of every measured statistic", &headings);
    let legend = vec![(0, "z".to_string()), (1, "unabsorbed z; dashed: ±1.96".to_string())];
    vec![
        Block::Figures { legend, figures: vec![Figure { chart: chart(&rows), caption: String::new() }] },
        Block::Table(table.with_rows(rows.into_iter().map(row))),
    ]
}

/// Means before spreads.
fn statistic_rank(statistic: &str) -> (bool, &str) {
    (statistic != "mean", statistic)
}

fn chart(rows: &[&ResidualRow]) -> super::super::charts::Chart {
    let chart = RowChart {
        title: "Residuals in standard errors".to_string(),
        axis: "measured minus model [standard errors]".to_string(),
        rows: rows.iter().map(|row| chart_row(row)).collect(),
        guides: vec![-LIMIT, 0.0, LIMIT],
        joined: true,
        ..RowChart::default()
    };
    chart.draw()
}

fn chart_row(row: &ResidualRow) -> Row {
    let mark = |series, value, name| Mark {
        series,
        value,
        interval: None,
        hint: format!("{name} {}", signed_fixed(value, 2)),
    };
    Row {
        group: if row.statistic == "mean" { "Means".to_string() } else { "Spreads (ln sd)".to_string() },
        label: words::title(&row.kpi),
        marks: vec![mark(0, row.z, "z"), mark(1, row.unabsorbed_z, "unabsorbed z")],
        ..Row::default()
    }
}

fn row(row: &ResidualRow) -> Vec<Cell> {
    let z = |value: f64| {
        let tone = if value.abs() > LIMIT { Tone::Caution } else { Tone::Plain };
        cell(signed_fixed(value, 2)).with_tone(tone)
    };
    vec![
        cell(words::title(&row.kpi)),
        cell(words::statistic(&row.statistic)),
        cell(to_uncertainty(row.measured_value, row.standard_error)),
        cell(to_uncertainty(row.model_value, row.standard_error)),
        cell(plus_minus(row.residual, row.standard_error)),
        z(row.z),
        z(row.unabsorbed_z),
        cell(words::unit(&row.unit)),
    ]
}
