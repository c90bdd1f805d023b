//! Which candidate effect explains what is left: strengths, detection limits, odds, and which effects look alike.

use crate::tables::{AttributionRow, ConfusionRow, SignatureRow};

use super::super::charts::{HeatMap, Mark, Row, RowChart};
use super::super::document::{Block, Cell, Figure, Section, Table, Tone, cell, text};
use super::super::numbers::{MISSING, fixed, p_value, plus_minus, signed_fixed, significant, to_uncertainty};
use super::super::{Report, words};
use super::{distinct, not_run, per_data_set, ranked};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks =
        per_data_set(report, "No effect was weighed against these data.", |measured| data_set(report, measured));
    if report.attribution.is_empty() {
        blocks = vec![not_run("diagnose", "no effect has been weighed against the residual")];
    } else {
        blocks.insert(0, Block::Paragraph(text(intro())));
    }
    Section { id: "attribution", title: "Attribution".to_string(), blocks }
}

fn intro() -> String {
    "Each candidate effect is a change of the simulated physics with a strength, 0 meaning absent. η90 is the strength \
     from which the whole procedure names the effect in 90 % of cases; z is the residual along the effect's signature in \
     standard errors, its p-value that of the whole family of candidates; misfit left is what the residual keeps once the \
     effect is in the model. Visibility is the share of its signature that the calibrated parameters cannot imitate, a its \
     length in standard errors per unit of strength."
        .to_string()
}

fn data_set(report: &Report, measured: &str) -> Vec<Block> {
    let mut rows: Vec<&AttributionRow> = report.attribution.iter().filter(|row| row.measured == measured).collect();
    if rows.is_empty() {
        return Vec::new();
    }
    rows.sort_by(|a, b| b.ln_odds.total_cmp(&a.ln_odds).then_with(|| a.effect.cmp(&b.effect)));
    let mut blocks = vec![table(&rows), strengths(&rows)];
    blocks.extend(likeness(report, measured, &rows));
    blocks.extend(signatures(report, measured));
    blocks
}

fn table(rows: &[&AttributionRow]) -> Block {
    let headings = [
        "effect",
        "part in the verdict",
        "#strength",
        "#η90",
        "#ln odds",
        "#z",
        "#p, family",
        "#misfit left",
        "#its p",
        "#visibility",
        "#a",
    ];
    let caption = "Candidate effects, the likeliest first; odds are against no effect at all";
    Block::Table(Table::new(caption, &headings).with_rows(rows.iter().map(|row| self::row(row))))
}

fn row(row: &AttributionRow) -> Vec<Cell> {
    let (part, tone) = words::part(&row.part);
    vec![
        cell(words::title(&row.effect)),
        cell(part).with_tone(tone),
        strength(row),
        limit(row),
        cell(fixed(row.ln_odds, 1)),
        cell(signed_fixed(row.z, 2)),
        cell(p_value(row.p_family)),
        cell(significant(row.leftover, 3)),
        cell(p_value(row.leftover_p)),
        cell(format!("{} %", fixed(row.visibility * 100.0, 0))),
        cell(significant(row.a, 3)),
    ]
}

fn strength(row: &AttributionRow) -> Cell {
    let value = cell(words::with_unit(&plus_minus(row.strength, row.strength_sd), &row.unit));
    match (row.resolved, row.physical) {
        (false, _) if row.part == "unresolved" => value.with_tone(Tone::Muted),
        (false, _) => value.with_note("signature not resolved").with_tone(Tone::Muted),
        (_, false) => value.with_note("outside its physical range").with_tone(Tone::Caution),
        _ => value,
    }
}

fn limit(row: &AttributionRow) -> Cell {
    match row.strength_90.filter(|limit| limit.is_finite()) {
        Some(limit) => cell(words::with_unit(&to_uncertainty(limit, row.strength_sd), &row.unit)),
        None => Cell::missing("beyond its physical range"),
    }
}

/// Strengths in units of each effect's own detection limit, so that they share an axis.
fn strengths(rows: &[&AttributionRow]) -> Block {
    let chart = RowChart {
        title: "Estimated strength over detection limit".to_string(),
        axis: "strength over η90 [–]".to_string(),
        rows: rows.iter().map(|row| strength_row(row)).collect(),
        guides: vec![0.0, 1.0],
        ..RowChart::default()
    };
    let caption = "Right of 1 an effect is strong enough to be named in 90 % of cases.".to_string();
    let legend = vec![(0, "strength ± one standard error".to_string())];
    Block::Figures { legend, figures: vec![Figure { chart: chart.draw(), caption }] }
}

fn strength_row(row: &AttributionRow) -> Row {
    let label = words::title(&row.effect);
    let Some(limit) = row.strength_90.filter(|limit| limit.is_finite() && *limit != 0.0) else {
        return Row { label, note: "no η90 in its physical range".to_string(), ..Row::default() };
    };
    let ratio = |value: f64| value / limit.abs();
    let mark = Mark {
        series: 0,
        value: ratio(row.strength),
        interval: Some((ratio(row.strength - row.strength_sd), ratio(row.strength + row.strength_sd))),
        hint: plus_minus(ratio(row.strength), ratio(row.strength_sd)),
    };
    Row { label, marks: vec![mark], ..Row::default() }
}

fn likeness(report: &Report, measured: &str, rows: &[&AttributionRow]) -> Vec<Block> {
    let own: Vec<&ConfusionRow> = report.confusion.iter().filter(|row| row.measured == measured).collect();
    let inside = |name: &&str| own.iter().any(|row| row.effect == **name || row.other == **name);
    let names: Vec<&str> = rows.iter().map(|row| row.effect.as_str()).filter(inside).collect();
    if names.len() < 2 {
        return Vec::new();
    }
    let cosine = |row: &str, column: &str| pair(&own, row, column).map(|pair| pair.cosine);
    let map = HeatMap {
        title: "Likeness of visible signatures (cosine)".to_string(),
        names: names.iter().map(|name| words::title(name)).collect(),
        fields: names.iter().map(|row| names.iter().map(|column| cosine(row, column)).collect()).collect(),
    };
    let caption = "1: the data cannot tell the two effects apart; 0: nothing in common; -1: opposite, so a one-sided \
                   effect is told apart by its sign."
        .to_string();
    let figure = Block::Figures { legend: Vec::new(), figures: vec![Figure { chart: map.draw(), caption }] };
    vec![
        figure,
        Block::Details { summary: "Likeness and separation as a table".to_string(), blocks: vec![pairs(&own, &names)] },
    ]
}

/// The row of two effects, whichever of them is named first.
fn pair<'a>(rows: &[&'a ConfusionRow], one: &str, two: &str) -> Option<&'a ConfusionRow> {
    let find = |one: &str, two: &str| rows.iter().copied().find(|row| row.effect == one && row.other == two);
    find(one, two).or_else(|| find(two, one))
}

fn pairs(own: &[&ConfusionRow], names: &[&str]) -> Block {
    let headings = ["effect", "other", "#cosine", "#separation"];
    let table = Table::new("Pairs of effects; separation in ln odds at the estimated strength of the first", &headings);
    let mut rows: Vec<&&ConfusionRow> = own.iter().filter(|row| row.effect != row.other).collect();
    let rank = |name: &str| names.iter().position(|&known| known == name);
    rows.sort_by_key(|row| (rank(&row.effect), rank(&row.other)));
    Block::Table(table.with_rows(rows.into_iter().map(|row| {
        vec![
            cell(words::title(&row.effect)),
            cell(words::title(&row.other)),
            cell(fixed(row.cosine, 2)),
            cell(significant(row.separation, 3)),
        ]
    })))
}

/// Signatures: statistics as rows, effects and parameters as columns.
fn signatures(report: &Report, measured: &str) -> Option<Block> {
    let own: Vec<&SignatureRow> = report.signatures.iter().filter(|row| row.measured == measured).collect();
    if own.is_empty() {
        return None;
    }
    let sources = ranked(own.iter().map(|row| row.source.as_str()));
    let titles: Vec<String> = sources.iter().map(|source| format!("#{}", words::label(source))).collect();
    let headings: Vec<&str> =
        ["observable", "statistic"].into_iter().chain(titles.iter().map(String::as_str)).collect();
    let origins = distinct(own.iter().map(|row| row.origin.as_str())).join(", ");
    let caption = format!(
        "Change of each statistic per unit of strength, or over the range of a parameter, ± standard error; in the unit \
         of the statistic (from {origins})"
    );
    let mut statistics: Vec<(&str, &str)> = own.iter().map(|row| (row.kpi.as_str(), row.statistic.as_str())).collect();
    statistics.sort_by_key(|(kpi, statistic)| (words::rank(kpi), *statistic != "mean", *statistic));
    statistics.dedup();
    let rows = statistics.into_iter().map(|statistic| signature_row(&own, &sources, statistic));
    let table = Block::Table(Table::new(caption, &headings).with_rows(rows));
    Some(Block::Details {
        summary: format!("Signatures of {} effects and parameters", sources.len()),
        blocks: vec![table],
    })
}

fn signature_row(own: &[&SignatureRow], sources: &[&str], (kpi, statistic): (&str, &str)) -> Vec<Cell> {
    let signature = |source: &&str| {
        let row = own.iter().find(|row| row.source == **source && row.kpi == kpi && row.statistic == statistic);
        row.map_or(cell(MISSING).with_note("not computed"), |row| cell(plus_minus(row.value, row.standard_error)))
    };
    let names = [cell(words::title(kpi)), cell(words::statistic(statistic))];
    names.into_iter().chain(sources.iter().map(signature)).collect()
}
