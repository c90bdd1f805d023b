//! Measured targets with their intervals: what the calibration aims at and what is held out.

use crate::tables::{FeasibilityRow, MeasuredAnalysisRow, MeasuredStatisticRow, TargetRow};

use super::super::charts::{Line, LineChart, Node};
use super::super::document::{Block, Cell, Figure, Section, Table, Text, Tone, cell, optional, text};
use super::super::numbers::{count, fixed, p_value, significant, trimmed, with_interval};
use super::super::{Report, paper, words};
use super::{interval, not_run, per_data_set, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks =
        per_data_set(report, "No targets are stored for these data.", |measured| data_set(report, measured));
    if report.targets.is_empty() && report.measured_analysis.is_empty() {
        blocks = vec![not_run("calibrate", "no measured targets are stored")];
    }
    Section { id: "targets", title: "Measured targets".to_string(), blocks }
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let mut blocks = targets(report, measured);
    blocks.extend(analysis(report, measured));
    blocks.extend(developments(report, measured));
    blocks.extend(feasibility(report, measured));
    blocks
}

fn targets(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&TargetRow> = report.targets.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    rows.sort_by_key(|row| (words::rank(&row.kpi), row.experiment.as_str()));
    let headings = ["observable", "experiment", "role", "#n", "#mean", "#standard deviation", "unit"];
    let caption = format!("Measured mean and standard deviation, each with its {}", report.interval_name());
    let table = Table::new(&caption, &headings);
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
        cell(Report::purpose(row)),
        cell(row.n.to_string()),
        cell(with_interval(row.mean, row.mean_lower, row.mean_upper)),
        cell(with_interval(row.sd, row.sd_lower, row.sd_upper)),
        cell(words::unit(&row.unit)),
    ]
}

fn slip() -> Text {
    text(format!("Source: {}. {}", paper::CITATION, paper::SLIPS[0]))
}

/// Stability, normality and the repetitions that a precision takes.
fn analysis(report: &Report, measured: &str) -> Option<Block> {
    let mut rows: Vec<&MeasuredAnalysisRow> =
        report.measured_analysis.iter().filter(|row| row.measured == measured).collect();
    let wished = trimmed(100.0 * rows.first()?.precision_wished, 3);
    rows.sort_by_key(|row| (words::rank(&row.kpi), row.experiment.as_str()));
    let needed = format!("#repetitions for ±{wished} %");
    let headings = [
        "observable",
        "#n",
        "#mean known to ± [%]",
        &needed,
        "#mean settled from n",
        "#normality D",
        "#p, published",
        "#p, simulated",
    ];
    let caption = "What the repetitions are worth: precision reached, repetitions needed (with those at the limits of \
                   the standard deviation's interval), from where on the running mean stays near the last one, \
                   Lilliefors' test of normality with p from its published approximation and from simulated samples";
    Some(Block::Table(Table::new(caption, &headings).with_rows(rows.into_iter().map(analysis_row))))
}

fn analysis_row(row: &MeasuredAnalysisRow) -> Vec<Cell> {
    let single = "no single values";
    // An interval of the mean that holds zero makes every percentage of it meaningless.
    let near_zero = row.precision.is_none_or(|precision| precision >= 1.0);
    let whole = |n: Option<u32>| n.map_or("more than a million".to_string(), |n| count(n as usize));
    let enough = row.needed.is_some_and(|needed| needed <= row.n);
    let needed = cell(whole(row.needed))
        .with_note(format!("{} to {}", whole(row.needed_lower), whole(row.needed_upper)))
        .with_tone(if enough { Tone::Good } else { Tone::Caution });
    let known = row.precision.filter(|_| !near_zero);
    vec![
        cell(words::title(&row.kpi)),
        cell(row.n.to_string()),
        optional(known, |value| significant(100.0 * value, 2), "the mean may be zero"),
        if near_zero { Cell::missing("") } else { needed },
        row.stable_from.map_or(Cell::missing(single), |n| cell(n.to_string())),
        optional(row.lilliefors_d, |value| fixed(value, 3), single),
        optional(row.lilliefors_p, p_value, single),
        optional(row.lilliefors_p_simulated, p_value, single),
    ]
}

/// Mean and standard deviation over the repetitions, as in Fig. 6 of the paper.
fn developments(report: &Report, measured: &str) -> Vec<Block> {
    let own: Vec<&MeasuredStatisticRow> =
        report.measured_statistics.iter().filter(|row| row.measured == measured).collect();
    let names = ranked(own.iter().filter(|row| words::is_kpi(&row.kpi)).map(|row| row.kpi.as_str()));
    let of = |name: &str| -> Vec<&MeasuredStatisticRow> { own.iter().copied().filter(|row| row.kpi == name).collect() };
    let repeated: Vec<&str> = names.into_iter().filter(|name| of(name).len() > 1).collect();
    if repeated.is_empty() {
        return Vec::new();
    }
    let means = repeated
        .iter()
        .map(|name| development(&of(name), "mean", |row| (Some(row.mean), (row.mean_lower, row.mean_upper))));
    let sds = repeated
        .iter()
        .map(|name| development(&of(name), "standard deviation", |row| (row.sd, (row.sd_lower, row.sd_upper))));
    let figures = means.chain(sds).collect();
    let rows = repeated.iter().flat_map(|name| of(name)).map(statistic_row);
    let headings = ["observable", "#n", "#mean", "#standard deviation", "unit"];
    let table =
        Table::new("Measured mean and standard deviation of the first n repetitions", &headings).with_rows(rows);
    let said = format!(
        "How the measured mean and standard deviation settle with repetitions (as Fig. 6 of the paper). The grey band is \
         ±1 % around the last mean, the coloured one the {}.",
        report.interval_name()
    );
    vec![
        Block::Paragraph(text(said)),
        Block::Figures { legend: Vec::new(), figures },
        Block::Details { summary: "These values as a table".to_string(), blocks: vec![Block::Table(table)] },
    ]
}

type Limits = (Option<f64>, Option<f64>);

fn development(
    rows: &[&MeasuredStatisticRow],
    what: &str,
    value: fn(&MeasuredStatisticRow) -> (Option<f64>, Limits),
) -> Figure {
    let node = |row: &&MeasuredStatisticRow| {
        let (value, (lower, upper)) = value(row);
        let value = value?;
        Some(Node { n: row.n, value, interval: interval(lower, upper), hint: significant(value, 4) })
    };
    let nodes: Vec<Node> = rows.iter().filter_map(node).collect();
    let chart = LineChart {
        title: format!("{}, {what}", words::title(&rows[0].kpi)),
        axis: format!("{what} [{}]", words::unit(&rows[0].unit)),
        reference: nodes.last().map(|node| node.value).filter(|_| what == "mean"),
        lines: vec![Line { series: 0, nodes }],
    };
    Figure { chart: chart.draw(), caption: String::new() }
}

fn statistic_row(row: &MeasuredStatisticRow) -> Vec<Cell> {
    let with = |value: Option<f64>, (lower, upper): Limits| match (value, interval(lower, upper)) {
        (Some(value), Some((lower, upper))) => cell(with_interval(value, lower, upper)),
        (Some(value), None) => cell(significant(value, 4)).with_note("no interval from one value"),
        (None, _) => Cell::missing("needs two values"),
    };
    vec![
        cell(words::title(&row.kpi)),
        cell(row.n.to_string()),
        with(Some(row.mean), (row.mean_lower, row.mean_upper)),
        with(row.sd, (row.sd_lower, row.sd_upper)),
        cell(words::unit(&row.unit)),
    ]
}

/// Whether the design brackets the measured means, with a warning that names those it does not.
fn feasibility(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&FeasibilityRow> = report.feasibility.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    let order = |set: &str| ["corner", "boundary", "design"].iter().position(|known| *known == set);
    rows.sort_by_key(|row| (words::rank(&row.kpi), order(&row.set)));
    let out: Vec<&&FeasibilityRow> =
        rows.iter().filter(|row| row.set == "design" && !row.bracketed && words::is_kpi(&row.kpi)).collect();
    let mut blocks = Vec::new();
    if !out.is_empty() {
        let names: Vec<String> = out.iter().map(|row| words::label(&row.kpi)).collect();
        let said = format!(
            "No simulation of the design comes as far as the measured mean of {}: within these bounds the model cannot \
             reach it, and calibration ends at the edge. Widen the bounds, or expect a residual.",
            names.join(", ")
        );
        blocks.push(Block::Note { tone: Tone::Caution, title: "Out of reach.".to_string(), text: text(said) });
    }
    let headings =
        ["observable", "points", "#of them", "#lowest mean", "#measured mean", "#highest mean", "brackets it", "unit"];
    let caption = "Feasibility: do the simulated means at the corners, on the boundary and in the whole design bracket \
                   the measured mean?";
    let table = Table::new(caption, &headings).with_rows(rows.iter().map(|row| feasibility_row(row)));
    blocks.push(Block::Table(table));
    blocks
}

fn feasibility_row(row: &FeasibilityRow) -> Vec<Cell> {
    let mean = |value: Option<f64>, point: Option<u32>| {
        let shown = optional(value, |value| significant(value, 4), "no value");
        point.map_or(shown.clone(), |point| shown.with_note(format!("point {point}")))
    };
    let away = row.outside_sd.map_or(String::new(), |away| format!("off by {} sd", significant(away, 2)));
    let verdict = if row.bracketed {
        cell("yes").with_tone(Tone::Good)
    } else {
        cell("no").with_tone(Tone::Caution).with_note(away)
    };
    vec![
        cell(words::title(&row.kpi)),
        cell(words::label(&row.set)),
        cell(row.points.to_string()),
        mean(row.lowest, row.lowest_point),
        cell(significant(row.target, 4)),
        mean(row.highest, row.highest_point),
        verdict,
        cell(words::unit(&row.unit)),
    ]
}
