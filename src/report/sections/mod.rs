//! The sections of the report, one file each: tables in, blocks out.
//!
//! Every section renders whatever rows there are; where a stage has not run it says so and how to run it.

mod assumptions;
mod attribution;
mod before_after;
mod design;
mod metamodels;
mod parameters;
mod queries;
mod residuals;
mod targets;
mod validation;
mod verdict;
mod verification;

use super::Report;
use super::document::{Block, Document, Section, Tone, text};
use super::numbers::MISSING;
use super::{paper, words};

/// The whole report as a document.
pub fn document(report: &Report) -> Document {
    let study = &report.study;
    let physics = match study.physics_version.as_str() {
        "" => String::new(),
        version => format!(" · physics version {version}"),
    };
    Document {
        title: if study.title.is_empty() { study.name.clone() } else { study.title.clone() },
        subtitle: format!("Study {} · {} resolution{physics}", study.name, study.resolution.name()),
        sections: sections(report),
    }
}

fn sections(report: &Report) -> Vec<Section> {
    vec![
        verdict::section(report),
        design::section(report),
        targets::section(report),
        metamodels::section(report),
        parameters::section(report),
        verification::section(report),
        validation::section(report),
        residuals::section(report),
        attribution::section(report),
        before_after::section(report),
        assumptions::section(report),
        queries::section(report),
    ]
}

/// Says that a stage has not run, what is missing without it, and the command that runs it.
fn not_run(stage: &str, missing: &str) -> Block {
    let said = text("The stage ").code(stage).plain(format!(" has left no rows, so {missing}. Run "));
    Block::Note {
        tone: Tone::Muted,
        title: "Not there yet.".to_string(),
        text: said.code(format!("granulake repro {stage}")).plain("."),
    }
}

/// The warning that belongs wherever a coarse study's numbers stand beside the paper's.
fn coarse_warning(report: &Report) -> Option<Block> {
    report.is_coarse().then(|| Block::Note {
        tone: Tone::Caution,
        title: "A coarse set-up is its own model.".to_string(),
        text: text(
            "Its particles, stiffness or geometry are not the paper's, so a difference from the paper's numbers is \
             no error of either. It is shown to place the study, not to judge it.",
        ),
    })
}

/// The blocks of each data set under its own heading; where there are none, a dash and what is missing.
fn per_data_set(report: &Report, missing: &str, blocks: impl Fn(&str) -> Vec<Block>) -> Vec<Block> {
    let mut all = Vec::new();
    for measured in report.data_sets() {
        let own = blocks(measured);
        all.push(Block::Heading(data_set(report, measured)));
        if own.is_empty() {
            all.push(Block::Paragraph(text(format!("{MISSING} {missing}"))));
        }
        all.extend(own);
    }
    all
}

/// How a data set is named in headings.
fn data_set(report: &Report, measured: &str) -> String {
    let origin = if report.is_published(measured) { " (the paper's targets)" } else { "" };
    format!("Measured data: {measured}{origin}")
}

/// A row of a method at a number of repetitions.
trait OfMethod {
    /// Kind and approach; the approach is empty where there is none.
    fn method(&self) -> (&str, &str);
    /// Number of repetitions behind the metamodel.
    fn trained_on(&self) -> u32;
}

macro_rules! of_method {
    ($($row:ident),+) => {
        $(impl OfMethod for crate::tables::$row {
            fn method(&self) -> (&str, &str) {
                (&self.kind, &self.approach)
            }

            fn trained_on(&self) -> u32 {
                self.n
            }
        })+
    };
}

of_method!(CalibrationRow, OptimumRow, PredictionRow, VerificationRow, ValidationRow);

impl OfMethod for crate::tables::MetamodelRow {
    fn method(&self) -> (&str, &str) {
        (&self.kind, "")
    }

    fn trained_on(&self) -> u32 {
        self.n
    }
}

/// The rows of each method at its largest number of repetitions, in the order methods are shown.
fn latest<'a, R: OfMethod>(rows: &[&'a R]) -> Vec<&'a R> {
    let last =
        |row: &R| rows.iter().filter(|other| other.method() == row.method()).map(|other| other.trained_on()).max();
    let mut kept: Vec<&R> = rows.iter().copied().filter(|row| Some(row.trained_on()) == last(row)).collect();
    kept.sort_by_key(|row| method_rank(row.method()));
    kept
}

/// Position of a method in the order in which methods are shown.
fn method_rank<'a>((kind, approach): (&'a str, &'a str)) -> (usize, &'a str, &'a str) {
    let position = words::KINDS.iter().position(|&known| known == kind);
    (position.unwrap_or(usize::MAX), kind, approach)
}

/// Is there more than one number of repetitions?
fn over_repetitions<R: OfMethod>(rows: &[&R]) -> bool {
    rows.iter().any(|row| row.trained_on() != rows[0].trained_on())
}

/// Different names in their order of appearance.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen: Vec<&str> = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// Different observables or parameters, the paper's first.
fn ranked<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = distinct(names);
    seen.sort_by_key(|name| words::rank(name));
    seen
}

/// Says that a row or mark is the paper's.
fn from_paper() -> String {
    format!("paper, n = {}", paper::REPETITIONS)
}

/// An interval of two values that may be missing.
fn interval(lower: Option<f64>, upper: Option<f64>) -> Option<(f64, f64)> {
    lower.zip(upper).filter(|(lower, upper)| lower.is_finite() && upper.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::MetamodelRow;

    fn row(kind: &str, n: u32) -> MetamodelRow {
        MetamodelRow {
            kpi: "bulk_density".into(),
            kind: kind.into(),
            n,
            points: 47,
            lml: None,
            nrmse_train_mean: None,
            nrmse_train_sd: None,
            nrmse_validation_mean: None,
            nrmse_validation_sd: None,
            status: "ok".into(),
            reason: None,
        }
    }

    #[test]
    fn latest_keeps_each_methods_own_last_n() {
        let rows = [row("sk", 2), row("ibm", 1), row("sk", 3), row("ibm", 2)];
        let kept: Vec<(&str, u32)> =
            latest(&rows.iter().collect::<Vec<_>>()).iter().map(|row| (row.kind.as_str(), row.n)).collect();
        assert_eq!(kept, [("ibm", 2), ("sk", 3)]);
    }
}
