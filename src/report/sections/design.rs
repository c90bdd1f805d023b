//! What was run: points of the design, repetitions, runs by status, failures with their reasons.

use std::collections::{BTreeMap, BTreeSet};

use crate::tables::{AggregateRow, BoundRow, RunRow, SampleRow};

use super::super::charts::{Line, LineChart, Node};
use super::super::document::{Block, Cell, Figure, Section, Table, Tone, cell, optional, text};
use super::super::numbers::{count, fixed, significant, trimmed, with_interval};
use super::super::{Report, paper, words};
use super::{coarse_warning, interval, not_run, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks: Vec<Block> = coarse_warning(report).into_iter().collect();
    blocks.extend(design(report));
    blocks.extend(runs(report));
    blocks.extend(failures(report));
    blocks.extend(fewer_values(report));
    blocks.extend(scatter(report));
    Section { id: "runs", title: "What was run".to_string(), blocks }
}

fn design(report: &Report) -> Vec<Block> {
    if report.samples.is_empty() {
        return vec![not_run("sample", "there is no design")];
    }
    let mut points: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for row in &report.samples {
        points.entry(&row.set).or_default().push(row.point);
    }
    let said: Vec<String> = points
        .into_iter()
        .map(|(set, mut points)| {
            points.sort_unstable();
            points.dedup();
            format!("{} {set}", count(points.len()))
        })
        .collect();
    let repetitions = report.runs.iter().filter(|run| run.label == "design").map(|run| run.repetition).max();
    let repeated = repetitions.map_or("not simulated yet".to_string(), |n| format!("up to {n} repetitions of each"));
    vec![Block::Paragraph(text(format!("Design points: {}; {repeated}.", said.join(", ")))), bounds(report)]
        .into_iter()
        .chain(found_bounds(report))
        .chain(distances(report))
        .collect()
}

/// Bounds that the study left out, with what they come from.
fn found_bounds(report: &Report) -> Option<Block> {
    if report.bounds.is_empty() {
        return None;
    }
    let headings =
        ["bound", "others at", "#simulations", "#simulated bulk density", "#by eqs 2 and 3", "#taken", "unit"];
    let first = &report.bounds[0];
    let caption = format!(
        "Bounds of the particle density by simulation, rounded outward: bulk density {} and particle density {} kg/m³ \
         measured ({})",
        fixed(first.measured_bulk_density, 1),
        fixed(first.measured_particle_density, 1),
        first.measured
    );
    let row = |row: &BoundRow| {
        vec![
            cell(row.bound.clone()),
            cell(row.others.clone()),
            cell(count(row.count as usize)),
            cell(fixed(row.simulated_mean, 1)),
            cell(format!("{} ± {}", fixed(row.unrounded, 1), fixed(row.standard_error, 1))),
            cell(trimmed(row.value, 5)),
            cell(words::unit(&row.unit)),
        ]
    };
    Some(Block::Table(Table::new(&caption, &headings).with_rows(report.bounds.iter().map(row))))
}

/// How far the points keep from each other.
fn distances(report: &Report) -> Option<Block> {
    if report.design_quality.is_empty() {
        return None;
    }
    let headings = ["part of the design", "#points", "#smallest distance", "#to earlier parts too"];
    let caption = "Smallest distance between two points in the unit cube: the hypercubes are spread given all earlier \
                   points, so that the last column is what was made large";
    let mut rows: Vec<_> = report.design_quality.iter().collect();
    rows.sort_by_key(|row| {
        ["boundary", "interior", "validation", "added", "chosen"].iter().position(|set| *set == row.set)
    });
    let row = |row: &crate::tables::DesignQualityRow| {
        vec![
            cell(words::label(&row.set)),
            cell(count(row.points as usize)),
            optional(row.min_distance, |value| fixed(value, 3), "one point"),
            optional(row.joint_min_distance, |value| fixed(value, 3), "one point"),
        ]
    };
    Some(Block::Table(Table::new(caption, &headings).with_rows(rows.into_iter().map(row))))
}

fn bounds(report: &Report) -> Block {
    let headings = ["parameter", "#lowest", "#highest", "#paper, lower", "#paper, upper", "unit"];
    let table = Table::new("Range of the design, beside the paper's Table 6", &headings);
    let names = ranked(report.samples.iter().map(|row| row.parameter.as_str()));
    Block::Table(table.with_rows(names.into_iter().map(|name| bounds_row(&report.samples, name))))
}

fn bounds_row(samples: &[SampleRow], name: &str) -> Vec<Cell> {
    let own = || samples.iter().filter(|row| row.parameter == name);
    let low = own().map(|row| row.value).fold(f64::INFINITY, f64::min);
    let high = own().map(|row| row.value).fold(f64::NEG_INFINITY, f64::max);
    let printed = paper::bounds(name);
    let paper = |value: Option<f64>| match value {
        Some(value) => cell(trimmed(value, 5)),
        None => Cell::missing("not in the paper"),
    };
    vec![
        cell(words::title(name)),
        cell(trimmed(low, 5)),
        cell(trimmed(high, 5)),
        paper(printed.map(|bounds| bounds.0)),
        paper(printed.map(|bounds| bounds.1)),
        cell(words::unit(own().next().map_or("", |row| &row.unit))),
    ]
}

/// What asked for a run: the part of its label before the first slash.
fn purpose(run: &RunRow) -> &str {
    run.label.split('/').next().unwrap_or("")
}

fn runs(report: &Report) -> Vec<Block> {
    if report.runs.is_empty() {
        return vec![not_run("simulate", "there are no simulations")];
    }
    let mut groups: BTreeMap<(bool, &str, &str), Vec<&RunRow>> = BTreeMap::new();
    for run in &report.runs {
        let purpose = purpose(run);
        groups.entry((purpose != "design", purpose, &run.experiment)).or_default().push(run);
    }
    let headings =
        ["asked for by", "experiment", "#ok", "#failed", "ended by", "#contacts per particle", "#largest overlap"];
    let different = report.runs.iter().map(|run| run.run_key.as_str()).collect::<BTreeSet<_>>().len();
    let caption = format!(
        "{} simulations asked for, {} different ones; overlap in per cent of the smaller radius",
        count(report.runs.len()),
        count(different)
    );
    let rows = groups.into_iter().map(|((_, purpose, experiment), runs)| run_row(purpose, experiment, &runs));
    vec![Block::Table(Table::new(caption, &headings).with_rows(rows))]
}

fn run_row(purpose: &str, experiment: &str, runs: &[&RunRow]) -> Vec<Cell> {
    let ok = runs.iter().filter(|run| run.status == "ok").count();
    let failed = runs.len() - ok;
    let tone = if failed > 0 { Tone::Caution } else { Tone::Plain };
    vec![
        cell(words::label(purpose)),
        cell(words::label(experiment)),
        cell(count(ok)),
        cell(count(failed)).with_tone(tone),
        stops(runs),
        contacts(runs),
        overlap(runs),
    ]
}

fn stops(runs: &[&RunRow]) -> Cell {
    let mut stops: BTreeMap<&str, usize> = BTreeMap::new();
    for stop in runs.iter().filter_map(|run| run.stop.as_deref()) {
        *stops.entry(stop).or_default() += 1;
    }
    if stops.is_empty() {
        return Cell::missing("no run ended");
    }
    let said: Vec<String> =
        stops.into_iter().map(|(stop, runs)| format!("{} ({})", words::label(stop), count(runs))).collect();
    cell(said.join(", "))
}

fn contacts(runs: &[&RunRow]) -> Cell {
    let known: Vec<f64> = runs.iter().filter_map(|run| run.coordination_number).filter(|z| z.is_finite()).collect();
    if known.is_empty() {
        return Cell::missing("no final state");
    }
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    cell(format!("{} to {}", fixed(low, 2), fixed(high, 2)))
}

fn overlap(runs: &[&RunRow]) -> Cell {
    let known = runs.iter().filter_map(|run| run.max_overlap).filter(|overlap| overlap.is_finite());
    match known.reduce(f64::max) {
        Some(largest) => cell(significant(largest * 100.0, 2)),
        None => Cell::missing("no final state"),
    }
}

/// Failures of one kind: what failed, in which runs, and one reason in full.
#[derive(Default)]
struct Failures {
    what: BTreeSet<String>,
    runs: BTreeSet<String>,
    example: String,
}

fn failures(report: &Report) -> Vec<Block> {
    let mut kinds: BTreeMap<(String, String), Failures> = BTreeMap::new();
    let mut add = |experiment: &str, what: String, run: &str, reason: Option<&str>| {
        let reason = reason.unwrap_or("no reason recorded");
        // Reasons begin with a stable word; numbers follow.
        let code = reason.split([':', ' ']).next().unwrap_or_default().to_string();
        let kind = kinds.entry((experiment.to_string(), code)).or_default();
        kind.what.insert(what);
        kind.runs.insert(run.to_string());
        if kind.example.is_empty() {
            kind.example = reason.to_string();
        }
    };
    let lost: BTreeSet<&str> =
        report.runs.iter().filter(|run| run.status != "ok").map(|run| run.run_key.as_str()).collect();
    for run in report.runs.iter().filter(|run| run.status != "ok") {
        add(&run.experiment, "simulation".to_string(), &run.run_key, run.reason.as_deref());
    }
    // An observable of a failed run is no failure of its own.
    for kpi in report.kpis.iter().filter(|kpi| kpi.status != "ok" && !lost.contains(kpi.run_key.as_str())) {
        add(&kpi.experiment, words::label(&kpi.kpi), &kpi.run_key, kpi.reason.as_deref());
    }
    if kinds.is_empty() {
        return vec![Block::Paragraph(text("No simulation failed, and every run gave all its observables."))];
    }
    let table = Table::new("Failures by reason", &["experiment", "what failed", "reason, as of the first", "#runs"]);
    let rows = kinds.into_iter().map(|((experiment, _), kind)| {
        let what = kind.what.into_iter().collect::<Vec<_>>().join(", ");
        vec![cell(words::label(&experiment)), cell(what), cell(kind.example), cell(count(kind.runs.len()))]
    });
    vec![Block::Table(table.with_rows(rows))]
}

/// Where means stand on fewer values than repetitions, and on how many.
fn fewer_values(report: &Report) -> Option<Block> {
    let n = report.aggregates.iter().map(|row| row.n).max()?;
    let mut counts: BTreeMap<&str, Vec<u32>> = BTreeMap::new();
    for row in report.aggregates.iter().filter(|row| row.n == n) {
        counts.entry(&row.kpi).or_default().push(row.count);
    }
    counts.retain(|_, counts| counts.iter().any(|count| *count < n));
    if counts.is_empty() {
        return None;
    }
    let caption = format!(
        "Observables with fewer than {n} values at a design point; means, intervals and metamodels \
                           stand on those there are"
    );
    let headings = ["observable", "#points with fewer", "#of points", "#fewest values", "#values missing"];
    let rows = ranked(counts.keys().copied()).into_iter().map(|kpi| {
        let counts = &counts[kpi];
        let missing: u32 = counts.iter().map(|count| n.saturating_sub(*count)).sum();
        vec![
            cell(words::title(kpi)),
            cell(count(counts.iter().filter(|count| **count < n).count())),
            cell(count(counts.len())),
            cell(counts.iter().min().map_or(String::new(), u32::to_string)),
            cell(count(missing as usize)),
        ]
    });
    Some(Block::Table(Table::new(caption, &headings).with_rows(rows)))
}

/// Mean over the number of repetitions at the point nearest to the centre of the design (as Fig. 6 of the paper).
fn scatter(report: &Report) -> Vec<Block> {
    let Some(point) = centre(&report.samples) else { return Vec::new() };
    let kpis = ranked(report.aggregates.iter().map(|row| row.kpi.as_str()).filter(|kpi| words::is_kpi(kpi)));
    let own = |kpi: &str| -> Vec<&AggregateRow> {
        report.aggregates.iter().filter(|row| row.point == point && row.kpi == kpi).collect()
    };
    let charts: Vec<Figure> = kpis.into_iter().filter_map(|kpi| development(kpi, &own(kpi))).collect();
    if charts.is_empty() {
        return vec![not_run("aggregate", "there are no means over repetitions")];
    }
    let intro = text(format!(
        "How the mean settles with repetitions, at design point {point}, the one nearest to the centre of the range. \
         The grey band is ±1 % around the last mean, the coloured one the {}.",
        report.interval_name()
    ));
    let rows = report.aggregates.iter().filter(|row| row.point == point && words::is_kpi(&row.kpi));
    vec![
        Block::Heading("Scatter between repetitions".to_string()),
        Block::Paragraph(intro),
        Block::Figures { legend: Vec::new(), figures: charts },
        Block::Details { summary: "These means as a table".to_string(), blocks: vec![means(report, rows)] },
    ]
}

fn centre(samples: &[SampleRow]) -> Option<u32> {
    let mut distances: BTreeMap<u32, f64> = BTreeMap::new();
    for row in samples.iter().filter(|row| row.set != "validation") {
        let away = row.unit_value - 0.5;
        *distances.entry(row.point).or_default() += away * away;
    }
    distances.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(point, _)| point)
}

fn development(kpi: &str, rows: &[&AggregateRow]) -> Option<Figure> {
    let nodes: Vec<Node> = rows.iter().filter_map(|row| node(row)).collect();
    let reference = nodes.last()?.value;
    let chart = LineChart {
        title: words::title(kpi),
        axis: format!("mean [{}]", words::unit(&rows[0].unit)),
        lines: vec![Line { series: 0, nodes }],
        reference: Some(reference),
    };
    Some(Figure { chart: chart.draw(), caption: String::new() })
}

fn node(row: &AggregateRow) -> Option<Node> {
    let value = row.mean?;
    let interval = interval(row.mean_lower, row.mean_upper);
    Some(Node { n: row.n, value, interval, hint: mean_text(row).text })
}

fn mean_text(row: &AggregateRow) -> Cell {
    let Some(mean) = row.mean else { return Cell::missing(format!("{} of {} runs gave a value", row.count, row.n)) };
    match interval(row.mean_lower, row.mean_upper) {
        Some((lower, upper)) => cell(with_interval(mean, lower, upper)),
        None => cell(significant(mean, 4)).with_note("no interval from one run"),
    }
}

fn means<'a>(report: &Report, rows: impl Iterator<Item = &'a AggregateRow>) -> Block {
    let mut rows: Vec<&AggregateRow> = rows.collect();
    rows.sort_by_key(|row| (words::rank(&row.kpi), row.n));
    let caption = format!("Mean with {} and standard deviation", report.interval_name());
    let table = Table::new(&caption, &["KPI", "#n", "#mean", "#sd", "unit"]);
    Block::Table(table.with_rows(rows.into_iter().map(|row| {
        let sd = optional(row.sd, |sd| significant(sd, 3), "needs two runs");
        vec![cell(words::title(&row.kpi)), cell(row.n.to_string()), mean_text(row), sd, cell(words::unit(&row.unit))]
    })))
}
