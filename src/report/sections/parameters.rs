//! Calibrated parameters with their uncertainty, beside the paper's Table 7.

use crate::tables::{CalibrationRow, OptimumRow, PosteriorRow, PosteriorSummaryRow, PredictionRow, TargetRow};

use super::super::charts::{Axis, Corner, Mark, PAPER, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Legend, Section, Table, Tone, cell, optional, text};
use super::super::numbers::{fixed, percent, significant, trimmed, with_interval};
use super::super::{Report, paper, words};
use super::{coarse_warning, interval, latest, method_rank, not_run, over_repetitions, per_data_set, ranked};

/// Why an optimum may lie outside its own interval.
const TWO_WEIGHTINGS: &str = "A value minimises the objective of the paper's eqs 10 to 13, which weigh the KPIs by \
    convention. Its interval is that of the posterior, which weighs each measurement by its standard error and that of \
    the metamodel. Where the model misses a measurement by much more than these errors the two pull apart, and a value \
    can lie outside its interval: a sign of a model that lacks something, not of a precise parameter.";

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks =
        per_data_set(report, "Nothing was calibrated to these data.", |measured| data_set(report, measured));
    if report.optima.is_empty() && report.calibrations.is_empty() {
        blocks = vec![not_run("calibrate", "there are no calibrated parameters")];
    }
    Section { id: "parameters", title: "Calibrated parameters".to_string(), blocks }
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let optima: Vec<&OptimumRow> = report.optima.iter().filter(|row| row.measured == measured).collect();
    let mut blocks = Vec::new();
    if !optima.is_empty() {
        blocks.extend(parameters(report, measured, &optima));
    }
    blocks.extend(posterior(report, measured));
    blocks.extend(calibrations(report, measured));
    blocks.extend(predictions(report, measured));
    blocks
}

fn parameters(report: &Report, measured: &str, optima: &[&OptimumRow]) -> Vec<Block> {
    let published = report.is_published(measured);
    let last = latest(optima);
    let mut blocks = Vec::new();
    if published {
        blocks.extend(coarse_warning(report));
    }
    blocks.push(charts(report, &last, published));
    let beside = if published { ", beside the paper's Table 7 (which has no SK)" } else { "" };
    blocks.push(Block::Paragraph(text(TWO_WEIGHTINGS)));
    let caption = format!("Calibrated parameters with 95 % credible intervals{beside}");
    blocks.push(table(&caption, last, published));
    if over_repetitions(optima) {
        let all = vec![table("Calibrated parameters at every number of repetitions", optima.to_vec(), published)];
        let summary = format!("All {} calibrated values", optima.len());
        blocks.push(Block::Details { summary, blocks: all });
    }
    blocks
}

/// Methods as rows, parameters as columns, the paper's values in a row of their own below each method.
fn table(caption: &str, rows: Vec<&OptimumRow>, published: bool) -> Block {
    let names = ranked(rows.iter().map(|row| row.parameter.as_str()));
    let unit = |name: &str| rows.iter().find(|row| row.parameter == name).map_or("", |row| row.unit.as_str());
    let mut headings = vec!["method".to_string(), "from".to_string()];
    headings.extend(names.iter().map(|name| format!("#{} [{}]", words::label(name), words::unit(unit(name)))));
    let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
    let mut methods: Vec<(&str, &str, u32)> = rows.iter().map(|row| (&*row.kind, &*row.approach, row.n)).collect();
    methods.sort_by_key(|&(kind, approach, n)| (method_rank((kind, approach)), n));
    methods.dedup();
    let mut table = Table::new(caption, &headings);
    for (index, &method) in methods.iter().enumerate() {
        table.rows.push(ours(&rows, &names, method));
        let last = methods.get(index + 1).is_none_or(|next| (next.0, next.1) != (method.0, method.1));
        if published && last {
            table.rows.extend(theirs(&names, method));
            table.rows.extend(difference(&rows, &names, method));
        }
    }
    Block::Table(table)
}

fn ours(rows: &[&OptimumRow], names: &[&str], (kind, approach, n): (&str, &str, u32)) -> Vec<Cell> {
    let own = |row: &&&OptimumRow| row.kind == kind && row.approach == approach && row.n == n;
    let find = |name: &&str| {
        let row = rows.iter().filter(own).find(|row| row.parameter == **name);
        row.map_or(Cell::missing("not calibrated"), |row| value(row))
    };
    let head = [cell(words::method(kind, approach)), cell(format!("this study, n = {n}"))];
    head.into_iter().chain(names.iter().map(find)).collect()
}

/// The paper's row of a method (Table 7), if it has that method.
fn theirs(names: &[&str], (kind, approach, _): (&str, &str, u32)) -> Option<Vec<Cell>> {
    let printed: Vec<Option<f64>> = names.iter().map(|name| paper::parameter(kind, approach, name)).collect();
    printed.iter().any(Option::is_some).then(|| {
        let head = [cell(words::method(kind, approach)), cell(super::from_paper())];
        let values = printed.into_iter().map(|value| optional(value, |value| trimmed(value, 5), "not in the paper"));
        head.into_iter().chain(values).collect()
    })
}

/// This study's values over the paper's, minus one.
fn difference(rows: &[&OptimumRow], names: &[&str], (kind, approach, n): (&str, &str, u32)) -> Option<Vec<Cell>> {
    let of = |name: &&str| {
        let own = rows
            .iter()
            .find(|row| row.kind == kind && row.approach == approach && row.n == n && row.parameter == **name)?;
        paper::parameter(kind, approach, name).map(|printed| 100.0 * (own.value / printed - 1.0))
    };
    let differences: Vec<Option<f64>> = names.iter().map(of).collect();
    differences.iter().any(Option::is_some).then(|| {
        let head = [cell(words::method(kind, approach)), cell("difference [%]")];
        let values = differences.into_iter().map(|value| optional(value, percent, "not in the paper"));
        head.into_iter().chain(values).collect()
    })
}

const POSTERIOR: &str = "The distribution of the parameters given the measured means (M), or means and standard \
    deviations (MV), sampled over the metamodel with its own uncertainty. A relative width near 1 is that of the bounds \
    alone: such a parameter, or the combination named among the flat directions below, is not fixed by these data.";

/// Posterior as a table and as corner plots.
fn posterior(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&PosteriorSummaryRow> =
        report.posterior_summary.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    rows.sort_by_key(|row| (method_rank((&row.kind, &row.approach)), words::rank(&row.parameter)));
    let headings = [
        "method",
        "parameter",
        "#median [95 % interval]",
        "#relative width",
        "most correlated with",
        "#correlation",
        "#independent draws",
        "unit",
    ];
    let caption = format!("Posterior of the parameters at n = {}", rows[0].n);
    let table = Table::new(caption, &headings).with_rows(rows.iter().map(|row| posterior_row(row)));
    let mut methods: Vec<(&str, &str)> = rows.iter().map(|row| (&*row.kind, &*row.approach)).collect();
    methods.dedup();
    let figure = |&(kind, approach): &(&str, &str)| Figure {
        chart: corner(report, measured, kind, approach),
        caption: String::new(),
    };
    let figures = methods.iter().map(figure).collect();
    let legend: Legend = vec![(1, "calibrated value; its line on the diagonal".to_string())];
    let plots = Block::Details {
        summary: format!("Corner plots of {} posteriors", methods.len()),
        blocks: vec![Block::Figures { legend, figures }],
    };
    vec![Block::Paragraph(text(POSTERIOR)), Block::Table(table), plots]
}

fn posterior_row(row: &PosteriorSummaryRow) -> Vec<Cell> {
    let wide = row.relative_sd > 0.9;
    let width = cell(fixed(row.relative_sd, 2));
    vec![
        cell(words::method(&row.kind, &row.approach)),
        cell(words::label(&row.parameter)),
        cell(with_interval(row.median, row.lower, row.upper)),
        if wide { width.with_tone(Tone::Caution).with_note("not fixed by these data") } else { width },
        row.partner.as_deref().map_or(Cell::missing("the only parameter"), |name| cell(words::label(name))),
        optional(row.correlation, |value| fixed(value, 2), "the only parameter"),
        cell(significant(row.independent_draws, 2)).with_note(format!("acceptance {}", fixed(row.acceptance, 2))),
        cell(words::unit(&row.unit)),
    ]
}

fn corner(report: &Report, measured: &str, kind: &str, approach: &str) -> super::super::charts::Chart {
    let of = |row: &&PosteriorRow| row.measured == measured && row.kind == kind && row.approach == approach;
    let own: Vec<&PosteriorRow> = report.posterior.iter().filter(of).collect();
    let optimum = |name: &str| {
        let rows = report.optima.iter().filter(|row| row.measured == measured && row.parameter == name);
        rows.filter(|row| row.kind == kind && row.approach == approach).max_by_key(|row| row.n).map(|row| row.value)
    };
    let axis = |name: &str| {
        let rows: Vec<&&PosteriorRow> = own.iter().filter(|row| row.parameter == name).collect();
        let unit = words::unit(rows.first().map_or("", |row| &row.unit));
        let draws: Vec<f64> = rows.iter().map(|row| row.value).collect();
        let seen = || draws.iter().copied().reduce(f64::min).zip(draws.iter().copied().reduce(f64::max));
        Axis {
            name: format!("{} [{unit}]", words::label(name)),
            range: range(report, name).or_else(seen).unwrap_or((0.0, 1.0)),
            marked: optimum(name),
            draws,
        }
    };
    let names = ranked(own.iter().map(|row| row.parameter.as_str()));
    Corner { title: words::method(kind, approach), axes: names.into_iter().map(axis).collect() }.draw()
}

fn value(row: &OptimumRow) -> Cell {
    let value = match interval(row.lower, row.upper) {
        Some((lower, upper)) => cell(with_interval(row.value, lower, upper)),
        None => cell(significant(row.value, 4)).with_note("no interval stored"),
    };
    let outside = interval(row.lower, row.upper).is_some_and(|(lower, upper)| row.value < lower || row.value > upper);
    let value = if outside { value.with_note("outside its interval").with_tone(Tone::Caution) } else { value };
    if row.at_bound { value.with_note("on its bound").with_tone(Tone::Caution) } else { value }
}

fn charts(report: &Report, rows: &[&OptimumRow], published: bool) -> Block {
    let names = ranked(rows.iter().map(|row| row.parameter.as_str()));
    let figures =
        names.into_iter().map(|name| Figure { chart: chart(report, rows, name, published), caption: String::new() });
    let mut legend: Legend =
        vec![(0, "this study, 95 % credible interval; the axis spans the design's range".to_string())];
    if published {
        legend.push((PAPER, super::from_paper()));
    }
    Block::Figures { legend, figures: figures.collect() }
}

fn chart(report: &Report, rows: &[&OptimumRow], name: &str, published: bool) -> super::super::charts::Chart {
    let own: Vec<&&OptimumRow> = rows.iter().filter(|row| row.parameter == name).collect();
    let unit = own.first().map_or("", |row| row.unit.as_str());
    let chart = RowChart {
        title: words::title(name),
        axis: format!("{} [{}]", words::label(name), words::unit(unit)),
        rows: own.into_iter().map(|row| chart_row(row, published)).collect(),
        range: range(report, name),
        ..RowChart::default()
    };
    chart.draw()
}

fn chart_row(row: &OptimumRow, published: bool) -> Row {
    let ours = Mark { series: 0, value: row.value, interval: interval(row.lower, row.upper), hint: value(row).text };
    let printed = paper::parameter(&row.kind, &row.approach, &row.parameter).filter(|_| published);
    let theirs = printed.map(|value| Mark {
        series: PAPER,
        value,
        interval: None,
        hint: format!("paper {}", trimmed(value, 5)),
    });
    Row {
        label: format!("{}, n = {}", words::method(&row.kind, &row.approach), row.n),
        marks: [ours].into_iter().chain(theirs).collect(),
        ..Row::default()
    }
}

/// Limits of the design in a parameter.
fn range(report: &Report, parameter: &str) -> Option<(f64, f64)> {
    let values = || report.samples.iter().filter(|row| row.parameter == parameter).map(|row| row.value);
    values().reduce(f64::min).zip(values().reduce(f64::max))
}

fn calibrations(report: &Report, measured: &str) -> Option<Block> {
    let mut rows: Vec<&CalibrationRow> = report.calibrations.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return None;
    }
    rows.sort_by_key(|row| (method_rank((&row.kind, &row.approach)), row.n));
    let headings = ["method", "#n", "status", "#objective", "#starts", "#at the optimum", "what the data leave open"];
    let table = Table::new("Searches for the optimum (objectives of eqs 10 to 13)", &headings);
    let blocks = vec![Block::Table(table.with_rows(rows.iter().map(|row| calibration(row))))];
    let failed = rows.iter().filter(|row| row.status != "ok").count();
    let failures = if failed > 0 { format!(", {failed} failed") } else { String::new() };
    Some(Block::Details { summary: format!("{} searches for the optimum{failures}", rows.len()), blocks })
}

fn calibration(row: &CalibrationRow) -> Vec<Cell> {
    let reason = row.reason.as_deref().unwrap_or("no optimum");
    let status = cell(words::label(&row.status));
    let open = match row.flat_directions.as_deref() {
        None if row.status == "ok" => cell("nothing"),
        None => Cell::missing(""),
        Some("") => cell("nothing"),
        Some(said) => cell(said),
    };
    vec![
        cell(words::method(&row.kind, &row.approach)),
        cell(row.n.to_string()),
        if row.status == "ok" { status } else { status.with_note(reason).with_tone(Tone::Caution) },
        optional(row.objective, |value| significant(value, 3), ""),
        cell(row.starts.to_string()),
        match row.starts_at_optimum {
            Some(starts) => cell(starts.to_string()),
            None => Cell::missing(""),
        },
        open,
    ]
}

fn predictions(report: &Report, measured: &str) -> Option<Block> {
    let own: Vec<&PredictionRow> = report.predictions.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return None;
    }
    let targets: Vec<&TargetRow> = report.targets.iter().filter(|row| row.measured == measured).collect();
    let mut rows = latest(&own);
    rows.sort_by_key(|row| (words::rank(&row.kpi), method_rank((&row.kind, &row.approach))));
    let headings =
        ["observable", "method", "#n", "#mean", "#sd of the metamodel", "#sd between runs", "#measured mean", "unit"];
    let table = Table::new("What the metamodels predict at the optima", &headings);
    let blocks = vec![Block::Table(table.with_rows(rows.iter().map(|row| prediction(row, &targets))))];
    Some(Block::Details { summary: format!("{} predictions at the optima", rows.len()), blocks })
}

fn prediction(row: &PredictionRow, targets: &[&TargetRow]) -> Vec<Cell> {
    let measured = targets.iter().find(|target| target.kpi == row.kpi).map(|target| target.mean);
    vec![
        cell(words::title(&row.kpi)),
        cell(words::method(&row.kind, &row.approach)),
        cell(row.n.to_string()),
        cell(significant(row.mean, 4)),
        optional(row.epistemic_sd, |sd| significant(sd, 3), "not given by this kind"),
        optional(row.sd, |sd| significant(sd, 3), "not predicted"),
        optional(measured, |mean| significant(mean, 4), "not measured"),
        cell(words::unit(&row.unit)),
    ]
}
