//! DEM runs at the optima against the metamodels' predictions and the measured targets, beside the paper's Table 8.

use std::collections::BTreeSet;

use crate::tables::{RunRow, VerificationRow};

use super::super::charts::{Chart, Line, LineChart, Node, Pair, Scatter};
use super::super::document::{Block, Cell, Figure, Legend, Section, Table, Tone, cell, optional, text};
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

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let own: Vec<&VerificationRow> = report.verification.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return Vec::new();
    }
    let published = report.is_published(measured);
    let (last, others): (Vec<&VerificationRow>, Vec<&VerificationRow>) =
        latest(&own).into_iter().partition(|row| words::is_kpi(&row.kpi));
    let said = format!(
        "Bars are the {} of the simulated mean; on the dashed line prediction and simulation agree, on the dotted one the \
         simulation gives the measured mean.",
        report.interval_name()
    );
    let mut blocks = vec![Block::Paragraph(text(said)), scatters(&last)];
    blocks.push(against_prediction("Simulated against predicted mean", last.clone()));
    blocks.extend(trained_on(report, &last));
    if published {
        blocks.extend(coarse_warning(report));
    }
    blocks.extend(table_8(&last, published));
    if over_repetitions(&own) {
        blocks.extend(developments(&own));
        let all = vec![
            against_prediction("Simulated against predicted mean at every number of repetitions", own.clone()),
            against_target("Error against the target at every number of repetitions, in per cent", own.clone()),
        ];
        blocks.push(Block::Details { summary: format!("All {} verifications", own.len()), blocks: all });
    } else if !others.is_empty() {
        let tables = vec![
            against_prediction("Simulated against predicted mean of the other observables", others.clone()),
            against_target("Error of the other observables against the target, in per cent", others.clone()),
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
    let headings = [
        "observable",
        "method",
        "#n",
        "#simulated mean",
        "#its sd",
        "#predicted mean",
        "#predicted sd",
        "#error [%]",
        "unit",
    ];
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

fn against_target(caption: &str, rows: Vec<&VerificationRow>) -> Block {
    let headings = ["observable", "method", "#n", "#target", "#mean", "#mean ± sd"];
    Block::Table(Table::new(caption, &headings).with_rows(sorted(rows).map(target_row)))
}

fn target_row(row: &VerificationRow) -> Vec<Cell> {
    vec![
        cell(words::title(&row.kpi)),
        cell(words::method(&row.kind, &row.approach)),
        runs(row),
        cell(words::with_unit(&spread(row.target_mean, row.target_sd), &row.unit)),
        error_of_mean(row),
        error_of_spread(row),
    ]
}

fn error_of_mean(row: &VerificationRow) -> Cell {
    optional(row.target_error_percent, percent, &no_value(row))
}

fn error_of_spread(row: &VerificationRow) -> Cell {
    let ends = row.target_error_upper_percent.zip(row.target_error_lower_percent);
    let missing = if row.count == 1 { "needs two runs".to_string() } else { no_value(row) };
    both(ends, &missing)
}

/// The methods as columns and the KPIs as rows, first the errors of the means, then those of mean ± sd, as in the
/// paper's Table 8; beside its own targets the paper's row and the difference stand below each of this study's.
fn table_8(rows: &[&VerificationRow], published: bool) -> Vec<Block> {
    let mut methods: Vec<(&str, &str)> = rows.iter().map(|row| (&*row.kind, &*row.approach)).collect();
    methods.sort_by_key(|method| method_rank(*method));
    methods.dedup();
    let kpis = ranked(rows.iter().map(|row| row.kpi.as_str()));
    let names: Vec<String> =
        methods.iter().map(|(kind, approach)| format!("#{}", words::method(kind, approach))).collect();
    let headings: Vec<&str> = ["KPI", "from"].into_iter().chain(names.iter().map(String::as_str)).collect();
    let beside = if published { ", beside the paper's Table 8 (which has no SK)" } else { "" };
    let halves: [(&str, Part); 2] = [("Mean KPI % error", MEAN), ("Mean ± standard deviation KPI % error", SPREAD)];
    let table = |(caption, part): (&str, Part)| {
        let caption = format!("{caption}: simulation against target{beside}; bold is the nearest to zero");
        let triples = kpis.iter().flat_map(|kpi| triple(rows, &methods, kpi, &part, published));
        Block::Table(Table::new(caption, &headings).with_rows(triples))
    };
    let target = |kpi: &&str| {
        let row = rows.iter().find(|row| row.kpi == **kpi)?;
        Some(format!("{} {}", words::label(kpi), words::with_unit(&spread(row.target_mean, row.target_sd), &row.unit)))
    };
    let targets: Vec<String> = kpis.iter().filter_map(target).collect();
    let said = text(format!("Targets, mean ± standard deviation: {}.", targets.join(", ")));
    [Block::Paragraph(said)].into_iter().chain(halves.into_iter().map(table)).collect()
}

/// One half of Table 8: the cell of a row of this study, the paper's, their difference, and the size of an error.
struct Part {
    ours: fn(&VerificationRow) -> Cell,
    theirs: fn(&paper::TargetError) -> Cell,
    difference: fn(&VerificationRow, &paper::TargetError) -> Option<Cell>,
    size: fn(&VerificationRow) -> Option<f64>,
}

const MEAN: Part = Part {
    ours: error_of_mean,
    theirs: |printed| cell(percent(printed.mean)),
    difference: |row, printed| Some(cell(percent(row.target_error_percent? - printed.mean))),
    size: |row| row.target_error_percent.map(f64::abs),
};

const SPREAD: Part = Part {
    ours: error_of_spread,
    theirs: |printed| both(Some((printed.upper, printed.lower)), ""),
    difference: |row, printed| {
        let (upper, lower) = (row.target_error_upper_percent?, row.target_error_lower_percent?);
        Some(both(Some((upper - printed.upper, lower - printed.lower)), ""))
    },
    size: |row| Some(row.target_error_upper_percent?.abs() + row.target_error_lower_percent?.abs()),
};

/// The rows of a KPI: this study's, and beside its own targets the paper's and the difference.
fn triple(
    rows: &[&VerificationRow],
    methods: &[(&str, &str)],
    kpi: &str,
    part: &Part,
    published: bool,
) -> Vec<Vec<Cell>> {
    let find = |(kind, approach): &(&str, &str)| {
        rows.iter().copied().find(|row| row.kpi == kpi && row.kind == *kind && row.approach == *approach)
    };
    let found: Vec<Option<&VerificationRow>> = methods.iter().map(find).collect();
    let line = |from: String, cells: Vec<Cell>| -> Vec<Cell> {
        [cell(words::title(kpi)), cell(from)].into_iter().chain(cells).collect()
    };
    let n = found.iter().flatten().map(|row| row.n).max().unwrap_or_default();
    let least = found.iter().flatten().filter_map(|row| (part.size)(row)).min_by(f64::total_cmp);
    let ours = |row: &Option<&VerificationRow>| {
        let Some(row) = row else { return Cell::missing("not verified") };
        let best = least.is_some() && (part.size)(row) == least;
        let shown = (part.ours)(row);
        let shown = if row.n == n { shown } else { shown.with_note(format!("n = {}", row.n)) };
        if best { shown.with_tone(Tone::Strong) } else { shown }
    };
    let mut lines = vec![line(format!("this study, n = {n}"), found.iter().map(ours).collect())];
    if published {
        let printed = |(kind, approach): &(&str, &str)| paper::target_error(kind, approach, kpi);
        let theirs = methods
            .iter()
            .map(|method| printed(method).map_or(Cell::missing("not in the paper"), |error| (part.theirs)(&error)));
        lines.push(line(super::from_paper(), theirs.collect()));
        let apart = methods.iter().zip(&found).map(|(method, row)| {
            row.zip(printed(method)).and_then(|(row, error)| (part.difference)(row, &error)).unwrap_or_else(|| cell(""))
        });
        lines.push(line("difference".to_string(), apart.collect()));
    }
    lines
}

/// Names the optima at design points: their simulations are among those that the metamodel was trained on.
fn trained_on(report: &Report, rows: &[&VerificationRow]) -> Option<Block> {
    let design: Vec<&RunRow> = report.runs.iter().filter(|run| run.label == "design").collect();
    let experiments: BTreeSet<&str> = design.iter().map(|run| run.experiment.as_str()).collect();
    let design: BTreeSet<&str> = design.iter().map(|run| run.run_key.as_str()).collect();
    let known = |row: &&VerificationRow| {
        let label = format!("{}/{}-{}/{}", row.measured, row.kind, row.approach, row.n);
        // Runs of the held-out experiment have the same label.
        let own = report.runs.iter().filter(|run| run.label == label && experiments.contains(run.experiment.as_str()));
        let keys: BTreeSet<&str> = own.map(|run| run.run_key.as_str()).collect();
        !keys.is_empty() && keys.is_subset(&design)
    };
    let methods: BTreeSet<(usize, String)> = rows
        .iter()
        .filter(|row| known(row))
        .map(|row| (method_rank((&row.kind, "")).0, words::method(&row.kind, &row.approach)))
        .collect();
    let names: Vec<String> = methods.into_iter().map(|(_, name)| name).collect();
    (!names.is_empty()).then(|| Block::Note {
        tone: Tone::Caution,
        title: "No test.".to_string(),
        text: text(format!(
            "The optimum of {} is a point of the design, so these simulations are among those that the metamodel was \
             trained on: that they agree says nothing.",
            names.join(", ")
        )),
    })
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
