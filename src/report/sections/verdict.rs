//! What the model lacks, how sure that is, and what adding it changes: the answer the reader came for.

use crate::tables::{AttributionRow, BeforeAfterRow, VerdictRow};

use super::super::document::{Block, Cell, Section, Table, Text, Tone, cell, text};
use super::super::numbers::{odds, p_is, percent, percent_interval, plus_minus, significant, to_uncertainty};
use super::super::{Report, words};
use super::{data_set, not_run};

/// The section.
pub fn section(report: &Report) -> Section {
    let mut blocks: Vec<Block> = report.verdicts.iter().map(|verdict| card(report, verdict)).collect();
    if blocks.is_empty() {
        blocks.push(not_run("diagnose", "there is no verdict"));
    }
    Section { id: "verdict", title: "What the model lacks".to_string(), blocks }
}

fn card(report: &Report, verdict: &VerdictRow) -> Block {
    Block::Card {
        tone: words::verdict_tone(&verdict.verdict),
        eyebrow: format!("{} · {}", data_set(report, &verdict.measured), words::verdict(&verdict.verdict)),
        headline: verdict.sentence.clone(),
        blocks: vec![Block::Facts(facts(report, verdict)), before_after(report, verdict)],
    }
}

fn facts(report: &Report, verdict: &VerdictRow) -> Vec<(String, Text)> {
    let mut facts = vec![("Misfit without any effect".to_string(), misfit(verdict))];
    facts.extend(named(report, verdict).map(|row| (words::title(&row.effect), strength(row))));
    for (term, said) in [("Carried by", &verdict.direction), ("Advice", &verdict.advice)] {
        if !said.is_empty() {
            facts.push((term.to_string(), text(said.clone())));
        }
    }
    facts
}

/// The attribution rows of the effects that the verdict names.
fn named<'a>(report: &'a Report, verdict: &'a VerdictRow) -> impl Iterator<Item = &'a AttributionRow> {
    let names = verdict.effects.split(',').map(str::trim).filter(|name| !name.is_empty());
    names
        .filter_map(|name| report.attribution.iter().find(|row| row.measured == verdict.measured && row.effect == name))
}

fn misfit(verdict: &VerdictRow) -> Text {
    text(format!("T₀ = {} on {} degrees of freedom, {}", significant(verdict.t0, 3), verdict.dof, p_is(verdict.p)))
}

fn strength(row: &AttributionRow) -> Text {
    let value = words::with_unit(&plus_minus(row.strength, row.strength_sd), &row.unit);
    let limit = match row.strength_90 {
        Some(limit) => {
            let limit = words::with_unit(&to_uncertainty(limit, row.strength_sd), &row.unit);
            format!("strengths from {limit} are named in 90 % of cases")
        }
        None => "no strength of its physical range is named in 90 % of cases".to_string(),
    };
    text("strength ").strong(value).plain(format!("; odds against no effect {}; {limit}", odds(row.ln_odds)))
}

/// The KPIs' errors before and after, and all of the held-out experiment; the other observables follow in their own section.
fn before_after(report: &Report, verdict: &VerdictRow) -> Block {
    let mut rows = report.before_after_of(&verdict.measured);
    rows.retain(|row| words::is_kpi(&row.kpi) || report.role(row) == "held out");
    if rows.is_empty() {
        return nothing_added(verdict);
    }
    let switched = is_switched(&rows);
    let said = match switched {
        true => ", without and with the effect; what moves further off zero is marked",
        false => "; no effect was switched on",
    };
    let error = "Error of the model fitted to all statistics against the measurement in per cent";
    let caption = format!("{error}, with {}{said}", report.interval_name());
    let headings: &[&str] =
        if switched { &["KPI and statistic", "#before", "#after"] } else { &["KPI and statistic", "#error"] };
    Block::Table(Table::new(&caption, headings).with_rows(rows.into_iter().map(|r| row(report, r, switched))))
}

/// Was an effect switched on, so that there is an after?
pub fn is_switched(rows: &[&BeforeAfterRow]) -> bool {
    rows.iter().any(|row| row.after.is_some())
}

/// Narrow enough for a telephone: intervals stand below their values.
fn row(report: &Report, row: &BeforeAfterRow, switched: bool) -> Vec<Cell> {
    let name = format!("{}, {}", words::title(&row.kpi), words::statistic(&row.statistic));
    let before = stacked(row.before_error_percent, row.before_lower_percent, row.before_upper_percent);
    let after = stacked(row.after_error_percent, row.after_lower_percent, row.after_upper_percent);
    let after = switched.then(|| toned(after, row));
    [cell(name).with_note(report.role(row)), before].into_iter().chain(after).collect()
}

/// A percentage with its interval as small print.
fn stacked(value: Option<f64>, lower: Option<f64>, upper: Option<f64>) -> Cell {
    let Some(value) = value.filter(|value| value.is_finite()) else { return Cell::missing("not simulated") };
    match super::interval(lower, upper) {
        Some((lower, upper)) => {
            cell(percent(value)).with_note(format!("[{},\u{a0}{}]", percent(lower), percent(upper)))
        }
        None => cell(percent(value)).with_note("no interval"),
    }
}

/// Marks an error that has become larger.
fn toned(after: Cell, row: &BeforeAfterRow) -> Cell {
    match (row.before_error_percent, row.after_error_percent) {
        (Some(old), Some(new)) if new.abs() > old.abs() => further_off(after),
        _ => after,
    }
}

fn further_off(after: Cell) -> Cell {
    let note = format!("{}, further off", after.note);
    after.with_tone(Tone::Caution).with_note(note)
}

/// A percentage with its interval where there is one.
pub fn error(value: Option<f64>, lower: Option<f64>, upper: Option<f64>, reason: &str) -> Cell {
    let Some(value) = value.filter(|value| value.is_finite()) else { return Cell::missing(reason) };
    match super::interval(lower, upper) {
        Some((lower, upper)) => cell(percent_interval(value, lower, upper)),
        None => cell(percent(value)),
    }
}

fn nothing_added(verdict: &VerdictRow) -> Block {
    let reason = match verdict.verdict.as_str() {
        "no_detectable_discrepancy" => "Nothing is missing that these data can show, so no effect was switched on.",
        "effect" | "class" | "pair" => "The effect has not been switched on and recalibrated.",
        _ => "No effect is accepted, so none was switched on.",
    };
    Block::Paragraph(text(format!("Before and after: — {reason}")))
}
