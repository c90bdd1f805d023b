//! How well the metamodels reproduce the simulations, in the training and in the validation points.

use std::collections::BTreeMap;

use crate::tables::{MetamodelRow, SensitivityRow};

use super::super::charts::{Line, LineChart, Node};
use super::super::document::{Block, Cell, Figure, Legend, Section, Table, Tone, cell, optional, text};
use super::super::numbers::{fixed, significant};
use super::super::{Report, words};
use super::{distinct, latest, method_rank, not_run, over_repetitions, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let blocks = if report.metamodels.is_empty() {
        vec![not_run("train", "there are no metamodels")]
    } else {
        let mut blocks = blocks(&report.metamodels.iter().collect::<Vec<_>>());
        blocks.extend(sensitivity(report));
        blocks
    };
    Section { id: "metamodels", title: "Metamodels".to_string(), blocks }
}

fn blocks(rows: &[&MetamodelRow]) -> Vec<Block> {
    let intro = "Normalised root mean square error (eq. 15 of the paper) in the points a metamodel was trained on and \
                 in validation points it has never seen; 0.01 is one per cent of the mean. Kinds: interpolating (IBM), \
                 regression with noise (RBM), stochastic kriging (SK).";
    let (kpis, others): (Vec<&MetamodelRow>, Vec<&MetamodelRow>) =
        latest(rows).into_iter().partition(|row| words::is_kpi(&row.kpi));
    let mut blocks = vec![Block::Paragraph(text(intro)), table("Error of the KPIs' metamodels", kpis)];
    blocks.extend(failures(rows));
    if over_repetitions(rows) {
        blocks.push(charts(rows));
        let all = vec![table("Error at every number of repetitions", rows.to_vec())];
        blocks.push(Block::Details { summary: format!("All {} metamodels", rows.len()), blocks: all });
    } else if !others.is_empty() {
        let summary =
            format!("Metamodels of {} other observables", distinct(others.iter().map(|row| row.kpi.as_str())).len());
        blocks.push(Block::Details {
            summary,
            blocks: vec![table("Error of the other observables' metamodels", others)],
        });
    }
    blocks
}

/// Sobol indices: KPI, statistic and kind as rows, parameters as columns.
fn sensitivity(report: &Report) -> Vec<Block> {
    let mut groups: BTreeMap<_, Vec<&SensitivityRow>> = BTreeMap::new();
    for row in &report.sensitivity {
        let key = (words::rank(&row.kpi), row.statistic.as_str(), method_rank((&row.kind, "")), row.kind.as_str());
        groups.entry(key).or_default().push(row);
    }
    if groups.is_empty() {
        return Vec::new();
    }
    let names = ranked(report.sensitivity.iter().map(|row| row.parameter.as_str()));
    let mut headings = vec!["KPI".to_string(), "statistic".to_string(), "kind".to_string()];
    headings.extend(names.iter().map(|name| format!("#{}", words::label(name))));
    headings.extend(["#spread over the design space".to_string(), "unit".to_string()]);
    let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
    let caption = "Sobol indices: share of the variance over the parameter space that a parameter explains alone / that \
                   involves it at all; their sampling error is about 0.01";
    let rows = groups.values().map(|rows| sensitivity_row(rows, &names));
    vec![
        Block::Heading("Which parameter moves what".to_string()),
        Block::Table(Table::new(caption, &headings).with_rows(rows)),
    ]
}

fn sensitivity_row(rows: &[&SensitivityRow], names: &[&str]) -> Vec<Cell> {
    let first = rows[0];
    let shares = names.iter().map(|name| match rows.iter().find(|row| row.parameter == **name) {
        Some(row) => cell(format!("{} / {}", fixed(row.first.max(0.0), 2), fixed(row.total.max(0.0), 2))),
        None => Cell::missing("not stored"),
    });
    let head =
        [cell(words::title(&first.kpi)), cell(words::statistic(&first.statistic)), cell(first.kind.to_uppercase())];
    let tail = [cell(significant(first.spread, 3)), cell(words::unit(&first.unit))];
    head.into_iter().chain(shares).chain(tail).collect()
}

fn table(caption: &str, mut rows: Vec<&MetamodelRow>) -> Block {
    rows.sort_by_key(|row| (words::rank(&row.kpi), method_rank((&row.kind, "")), row.n));
    let headings = [
        "observable",
        "kind",
        "#n",
        "#points",
        "#training, mean",
        "#training, sd",
        "#validation, mean",
        "#validation, sd",
        "#log likelihood",
    ];
    Block::Table(Table::new(caption, &headings).with_rows(rows.into_iter().map(row)))
}

/// Every reason for which metamodels failed, once, with those it concerns.
fn failures(rows: &[&MetamodelRow]) -> Option<Block> {
    let mut failed: BTreeMap<(&str, &str, u32), Vec<&str>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.status != "ok") {
        let reason = row.reason.as_deref().unwrap_or("no reason recorded");
        failed.entry((reason, &row.kind, row.n)).or_default().push(&row.kpi);
    }
    let fact = |((reason, kind, n), kpis): ((&str, &str, u32), Vec<&str>)| {
        let names: Vec<String> = ranked(kpis.into_iter()).into_iter().map(words::label).collect();
        (format!("No {} at n = {n} of {}", kind.to_uppercase(), names.join(", ")), text(reason))
    };
    (!failed.is_empty()).then(|| Block::Facts(failed.into_iter().map(fact).collect()))
}

fn row(row: &MetamodelRow) -> Vec<Cell> {
    let said = |reason| if row.status == "ok" { reason } else { "" };
    let mean = |value| optional(value, |value| significant(value, 3), said("the mean vanishes"));
    let sd = |value| optional(value, |value| significant(value, 3), said("needs two runs"));
    let kind = cell(row.kind.to_uppercase());
    vec![
        cell(words::title(&row.kpi)),
        if row.status == "ok" { kind } else { kind.with_note(&row.status).with_tone(Tone::Caution) },
        cell(row.n.to_string()),
        cell(row.points.to_string()),
        mean(row.nrmse_train_mean),
        sd(row.nrmse_train_sd),
        mean(row.nrmse_validation_mean),
        sd(row.nrmse_validation_sd),
        mean(row.lml),
    ]
}

fn charts(rows: &[&MetamodelRow]) -> Block {
    let mut kinds = distinct(rows.iter().map(|row| row.kind.as_str()));
    kinds.sort_by_key(|kind| method_rank((kind, "")));
    let legend: Legend = kinds.iter().enumerate().map(|(series, kind)| (series, kind.to_uppercase())).collect();
    let kpis = ranked(rows.iter().map(|row| row.kpi.as_str()).filter(|kpi| words::is_kpi(kpi)));
    let figure = |kpi: &str, what: &str, value: fn(&MetamodelRow) -> Option<f64>| {
        let lines = kinds.iter().enumerate().map(|(series, kind)| line(series, kind, kpi, rows, value)).collect();
        let title = format!("{}, {what}", words::title(kpi));
        let chart = LineChart { title, axis: "validation error [–]".to_string(), lines, reference: None };
        Figure { chart: chart.draw(), caption: String::new() }
    };
    let means = kpis.iter().map(|kpi| figure(kpi, "mean", |row| row.nrmse_validation_mean));
    let sds = kpis.iter().map(|kpi| figure(kpi, "sd", |row| row.nrmse_validation_sd));
    Block::Figures { legend, figures: means.chain(sds).collect() }
}

fn line(series: usize, kind: &str, kpi: &str, rows: &[&MetamodelRow], value: fn(&MetamodelRow) -> Option<f64>) -> Line {
    let mut own: Vec<&&MetamodelRow> = rows.iter().filter(|row| row.kpi == kpi && row.kind == kind).collect();
    own.sort_by_key(|row| row.n);
    let node = |row: &&&MetamodelRow| {
        let value = value(row)?;
        Some(Node {
            n: row.n,
            value,
            interval: None,
            hint: format!("{} {}", kind.to_uppercase(), significant(value, 3)),
        })
    };
    Line { series, nodes: own.iter().filter_map(node).collect() }
}
