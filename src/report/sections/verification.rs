//! DEM runs at the optima against the metamodels' predictions and the measured targets, beside the paper's Table 8.

use crate::tables::VerificationRow;

use super::super::charts::{Chart, Line, LineChart, Node, Pair, Scatter};
use super::super::document::{Block, Cell, Figure, Legend, Section, Table, cell, optional, text};
use super::super::numbers::{percent, significant, spread, with_interval};
use super::super::{Report, paper, words};
use super::{coarse_warning, distinct, interval, latest, method_rank, not_run, over_repetitions, per_data_set, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks = per_data_set(report, "No simulations were made at the optima of these data.", |measured| {
        data_set(report, measured)
    });
    if report.verification.is_empty() {
        blocks = vec![not_run("verify", "nothing tells whether the metamodels' optima hold in the simulation")];
    }
    Section { id: "verification", title: "Verification: DEM at the optima".to_string(), blocks }
}

const SCATTER: &str = "Bars are 95 % intervals of the simulated mean; on the dashed line prediction and simulation agree, \
                       on the dotted one the simulation gives the measured mean.";

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let own: Vec<&VerificationRow> = report.verification.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return Vec::new();
    }
    let published = report.is_published(measured);
    let (last, others): (Vec<&VerificationRow>, Vec<&VerificationRow>) =
        latest(&own).into_iter().partition(|row| words::is_kpi(&row.kpi));
    let mut blocks = vec![Block::Paragraph(text(SCATTER)), scatters(&last)];
    blocks.push(against_prediction("Simulated against predicted mean", last.clone()));
    if published {
        blocks.extend(coarse_warning(report));
    }
    let beside = if published { ", beside the paper's Table 8 (n = 50)" } else { "" };
    blocks.push(against_target(&format!("Error against the target in per cent{beside}"), last, published));
    if over_repetitions(&own) {
        blocks.extend(developments(&own));
        let all = vec![
            against_prediction("Simulated against predicted mean at every number of repetitions", own.clone()),
            against_target(
                "Error against the target at every number of repetitions, in per cent",
                own.clone(),
                published,
            ),
        ];
        blocks.push(Block::Details { summary: format!("All {} verifications", own.len()), blocks: all });
    } else if !others.is_empty() {
        let tables = vec![
            against_prediction("Simulated against predicted mean of the other observables", others.clone()),
            against_target("Error of the other observables against the target, in per cent", others.clone(), false),
        ];
        let summary = format!("{} verifications of other observables", others.len());
        blocks.push(Block::Details { summary, blocks: tables });
    }
    blocks
}

fn sorted(mut rows: Vec<&VerificationRow>) -> impl Iterator<Item = &VerificationRow> {
    rows.sort_by_key(|row| (words::rank(&row.kpi), method_rank((&row.kind, &row.approach)), row.n));
    rows.into_iter()
}

fn against_prediction(caption: &str, rows: Vec<&VerificationRow>) -> Block {
    let headings =
        ["observable", "method", "#n", "#simulated mean", "#sd", "#predicted mean", "#sd", "#error [%]", "unit"];
    let row = |row: &VerificationRow| {
        let missing = no_value(row);
        vec![
            cell(words::title(&row.kpi)),
            cell(words::method(&row.kind, &row.approach)),
            runs(row),
            simulated(row),
            optional(row.sd, |sd| significant(sd, 3), "needs two runs"),
            cell(significant(row.predicted_mean, 4)),
            optional(row.predicted_sd, |sd| significant(sd, 3), "not predicted"),
            optional(row.prediction_error_percent, percent, &missing),
            cell(words::unit(&row.unit)),
        ]
    };
    Block::Table(Table::new(caption, &headings).with_rows(sorted(rows).map(row)))
}

fn against_target(caption: &str, rows: Vec<&VerificationRow>, published: bool) -> Block {
    let mut headings = vec!["observable", "method", "#n", "#target", "#mean", "#mean ± sd"];
    if published {
        headings.extend(["#paper, mean", "#paper, mean ± sd", "#difference of the means"]);
    }
    let row = |row: &VerificationRow| target_row(row, published);
    Block::Table(Table::new(caption, &headings).with_rows(sorted(rows).map(row)))
}

fn target_row(row: &VerificationRow, published: bool) -> Vec<Cell> {
    let missing = no_value(row);
    let ends = row.target_error_upper_percent.zip(row.target_error_lower_percent);
    let mut cells = vec![
        cell(words::title(&row.kpi)),
        cell(words::method(&row.kind, &row.approach)),
        runs(row),
        cell(words::with_unit(&spread(row.target_mean, row.target_sd), &row.unit)),
        optional(row.target_error_percent, percent, &missing),
        both(ends, if row.count == 1 { "needs two runs" } else { &missing }),
    ];
    if published {
        let printed = paper::target_error(&row.kind, &row.approach, &row.kpi);
        cells.push(optional(printed.map(|error| error.mean), percent, "not in the paper"));
        cells.push(both(printed.map(|error| (error.upper, error.lower)), "not in the paper"));
        let apart = row.target_error_percent.zip(printed).map(|(ours, printed)| ours - printed.mean);
        cells.push(optional(apart, percent, if printed.is_some() { &missing } else { "not in the paper" }));
    }
    cells
}

/// Errors at mean + sd and mean - sd, written as in the paper's Table 8.
fn both(ends: Option<(f64, f64)>, reason: &str) -> Cell {
    ends.map_or(Cell::missing(reason), |(upper, lower)| cell(format!("{} / {}", percent(upper), percent(lower))))
}

/// Number of runs; where some gave no value, how many did.
fn runs(row: &VerificationRow) -> Cell {
    if row.count == row.n { cell(row.n.to_string()) } else { cell(format!("{} of {}", row.count, row.n)) }
}

fn no_value(row: &VerificationRow) -> String {
    format!("{} of {} runs gave a value", row.count, row.n)
}

fn simulated(row: &VerificationRow) -> Cell {
    let Some(mean) = row.mean else { return Cell::missing(no_value(row)) };
    match interval(row.mean_lower, row.mean_upper) {
        Some((lower, upper)) => cell(with_interval(mean, lower, upper)),
        None => cell(significant(mean, 4)).with_note("no interval from one run"),
    }
}

/// Colours of the kinds of metamodel, the same in every drawing of this section.
fn kinds<'a>(rows: &[&'a VerificationRow]) -> Vec<&'a str> {
    let mut kinds = distinct(rows.iter().map(|row| row.kind.as_str()));
    kinds.sort_by_key(|kind| method_rank((kind, "")));
    kinds
}

fn scatters(rows: &[&VerificationRow]) -> Block {
    let kinds = kinds(rows);
    let kpis = ranked(rows.iter().map(|row| row.kpi.as_str()).filter(|kpi| words::is_kpi(kpi)));
    let figures = kpis.into_iter().map(|kpi| {
        let own: Vec<&VerificationRow> = rows.iter().copied().filter(|row| row.kpi == kpi).collect();
        Figure { chart: scatter(kpi, &own, &kinds), caption: String::new() }
    });
    let legend: Legend = kinds.iter().enumerate().map(|(series, kind)| (series, kind.to_uppercase())).collect();
    Block::Figures { legend, figures: figures.collect() }
}

fn scatter(kpi: &str, rows: &[&VerificationRow], kinds: &[&str]) -> Chart {
    let pair = |row: &&VerificationRow| {
        let simulated = row.mean?;
        let (method, said) = (words::method(&row.kind, &row.approach), simulated_text(row));
        Some(Pair {
            series: kinds.iter().position(|&kind| kind == row.kind)?,
            predicted: row.predicted_mean,
            simulated,
            interval: interval(row.mean_lower, row.mean_upper),
            hint: format!("{method} predicted {}, simulated {said}", significant(row.predicted_mean, 4)),
        })
    };
    let chart = Scatter {
        title: words::title(kpi),
        unit: words::unit(rows.first().map_or("", |row| &row.unit)),
        pairs: rows.iter().filter_map(pair).collect(),
        target: rows.first().map(|row| row.target_mean),
    };
    chart.draw()
}

fn simulated_text(row: &VerificationRow) -> String {
    simulated(row).text
}

/// Error of the simulated mean against the target over the number of repetitions (as Fig. 16 of the paper).
fn developments(rows: &[&VerificationRow]) -> Vec<Block> {
    let kinds = kinds(rows);
    let kpis = ranked(rows.iter().map(|row| row.kpi.as_str()).filter(|kpi| words::is_kpi(kpi)));
    let approaches = distinct(rows.iter().map(|row| row.approach.as_str()));
    let mut figures = Vec::new();
    for approach in approaches {
        for kpi in &kpis {
            let own = |kind: &str| -> Vec<&VerificationRow> {
                let wanted = |row: &&&VerificationRow| row.kpi == *kpi && row.approach == approach && row.kind == kind;
                rows.iter().filter(wanted).copied().collect()
            };
            let lines = kinds.iter().enumerate().map(|(series, kind)| line(series, own(kind))).collect();
            let title = format!("{}, {}", words::title(kpi), approach.to_uppercase());
            let chart = LineChart { title, axis: "error of the mean [%]".to_string(), lines, reference: None };
            figures.push(Figure { chart: chart.draw(), caption: String::new() });
        }
    }
    let legend = kinds.iter().enumerate().map(|(series, kind)| (series, kind.to_uppercase())).collect();
    vec![
        Block::Paragraph(text("Error of the simulated mean against the target over the number of repetitions.")),
        Block::Figures { legend, figures },
    ]
}

fn line(series: usize, mut rows: Vec<&VerificationRow>) -> Line {
    rows.sort_by_key(|row| row.n);
    let node = |row: &&VerificationRow| {
        let value = row.target_error_percent?;
        let hint = format!("{} {} %", words::method(&row.kind, &row.approach), percent(value));
        Some(Node { n: row.n, value, interval: None, hint })
    };
    Line { series, nodes: rows.iter().filter_map(node).collect() }
}
