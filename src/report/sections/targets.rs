//! Measured targets with their intervals: what the calibration aims at and what is held out.

use crate::tables::TargetRow;

use super::super::document::{Block, Cell, Section, Table, Text, cell, optional, text};
use super::super::numbers::{p_value, with_interval};
use super::super::{Report, paper, words};
use super::{not_run, per_data_set};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks =
        per_data_set(report, "No targets are stored for these data.", |measured| data_set(report, measured));
    if report.targets.is_empty() {
        blocks = vec![not_run("calibrate", "no measured targets are stored")];
    }
    Section { id: "targets", title: "Measured targets".to_string(), blocks }
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&TargetRow> = report.targets.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    rows.sort_by_key(|row| (words::rank(&row.kpi), row.experiment.as_str()));
    let headings = ["observable", "experiment", "role", "#n", "#mean", "#standard deviation", "#normality p", "unit"];
    let table = Table::new("Measured mean and standard deviation with 95 % intervals", &headings);
    let mut blocks = vec![Block::Table(table.with_rows(rows.into_iter().map(row)))];
    if report.is_published(measured) {
        blocks.push(Block::Paragraph(slip()));
    }
    blocks
}

fn row(row: &TargetRow) -> Vec<Cell> {
    vec![
        cell(words::title(&row.kpi)),
        cell(words::label(&row.experiment)),
        cell(words::role(row.fitted)),
        cell(row.n.to_string()),
        cell(with_interval(row.mean, row.mean_lower, row.mean_upper)),
        cell(with_interval(row.sd, row.sd_lower, row.sd_upper)),
        optional(row.lilliefors_p, p_value, "no single values"),
        cell(words::unit(&row.unit)),
    ]
}

fn slip() -> Text {
    text(format!("Source: {}. {}", paper::CITATION, paper::SLIPS[0]))
}
