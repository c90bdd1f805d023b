//! What the paper leaves open and how it was settled, and where the study departs from the paper.

use super::super::document::{Block, Section, Table, cell, text};
use super::super::{Report, Resolution, paper};

/// The section.
pub fn section(report: &Report) -> Section {
    let blocks = [departures(report), assumptions(report)].into_iter().flatten().collect();
    Section { id: "assumptions", title: "Assumptions and departures".to_string(), blocks }
}

fn departures(report: &Report) -> Vec<Block> {
    let departures = &report.study.departures;
    if departures.is_empty() {
        let said = match report.study.resolution {
            Resolution::Full => "The set-up is the paper's.",
            Resolution::Coarse => "No departure from the paper's set-up is recorded, although the study is coarse.",
        };
        return vec![Block::Paragraph(text(said))];
    }
    let rows = departures.iter().map(|row| vec![cell(&row.name), cell(&row.value), cell(&row.paper)]);
    let caption = format!("Where the set-up departs from the paper ({})", paper::CITATION);
    vec![Block::Table(Table::new(caption, &["setting", "this study", "paper"]).with_rows(rows))]
}

fn assumptions(report: &Report) -> Vec<Block> {
    if report.study.assumptions.is_empty() {
        return vec![Block::Paragraph(text("No assumptions are recorded."))];
    }
    let rows = report.study.assumptions.iter().map(|row| vec![cell(&row.name), cell(&row.value), cell(&row.meaning)]);
    let table = Table::new("What the paper leaves open, and the value taken here", &["setting", "value", "meaning"]);
    vec![Block::Table(table.with_rows(rows))]
}
