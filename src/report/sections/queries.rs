//! How to go from this page to the numbers behind it.

use super::super::Report;
use super::super::document::{Block, Section, text};
use super::super::numbers::count;

/// The section.
pub fn section(report: &Report) -> Section {
    let intro = text("Every number on this page stands in a Parquet table under ")
        .code("artifacts/tables/")
        .plain(". The tables are read in place by DuckDB, polars and anything else that reads Parquet, and by ");
    let intro = intro.code("granulake query").plain(format!(
        ". Runs ({}), observed values ({}) and hyperparameters ({}) are not printed here one by one.",
        count(report.runs.len()),
        count(report.kpis.len()),
        count(report.hyperparameters.len())
    ));
    let blocks = vec![
        Block::Paragraph(intro),
        Block::Paragraph(text("Scatter of every observable at each design point:")),
        Block::Code(SCATTER.to_string()),
        Block::Paragraph(text("From a verdict back to the residuals that carry it:")),
        Block::Code(RESIDUALS.to_string()),
    ];
    Section { id: "queries", title: "Asking the tables".to_string(), blocks }
}

const SCATTER: &str = "SELECT kpi, point, COUNT(value) AS n, AVG(value) AS mean, STDDEV(value) AS sd
FROM 'artifacts/tables/kpis/**/*.parquet'
WHERE label = 'design' AND status = 'ok'
GROUP BY kpi, point
ORDER BY kpi, point";

const RESIDUALS: &str =
    "SELECT measured, kpi, statistic, measured_value, model_value, z, ABS(unabsorbed_z) AS unabsorbed
FROM 'artifacts/tables/residuals/**/*.parquet'
ORDER BY unabsorbed DESC";
