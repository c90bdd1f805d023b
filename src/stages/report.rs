//! report: one HTML file, one Markdown file, from the tables alone.

use super::context::text;
use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs};
use crate::config::{Config, DensityBounds, Resolution};
use crate::dem;
use crate::experiments::EXPERIMENTS;
use crate::report::{self, Assumption, Departure, Method, Report};
use crate::settings::{self, Equipment, SettingSpec, Settings};
use crate::tables::list::{
    AggregateRow, AttributionRow, BOUNDS_KPIS, BOUNDS_RUNS, BeforeAfterRow, BoundRow, CalibrationRow, ConfusionRow,
    DIAGNOSE_KPIS, DIAGNOSE_RUNS, DesignQualityRow, FeasibilityRow, HyperparameterRow, KpiRow, MeasuredAnalysisRow,
    MeasuredStatisticRow, MetamodelRow, OptimumRow, PosteriorRow, PosteriorSummaryRow, PredictionRow, RecalibrationRow,
    ResidualRow, RunRow, SampleRow, SensitivityRow, SignatureRow, TargetRow, VALIDATE_KPIS, VALIDATE_RUNS, VERIFY_KPIS,
    VERIFY_RUNS, ValidationRow, VerdictRow, VerificationRow,
};
use crate::tables::{Row, TableSpec};
use crate::units;

/// The report as HTML, relative to the artifacts directory.
pub const HTML: &str = "report/index.html";
/// The report as Markdown.
pub const MARKDOWN: &str = "report/report.md";

/// The summary that is printed at the end of a run.
pub const SUMMARY: &str = "report/summary.txt";

/// The stage.
pub const STAGE: Stage = Stage {
    name: "report",
    version: 8,
    purpose: "one HTML file and one Markdown file",
    reads: &[
        &BOUNDS_RUNS,
        &BOUNDS_KPIS,
        BoundRow::SPEC,
        SampleRow::SPEC,
        DesignQualityRow::SPEC,
        RunRow::SPEC,
        KpiRow::SPEC,
        AggregateRow::SPEC,
        MetamodelRow::SPEC,
        HyperparameterRow::SPEC,
        SensitivityRow::SPEC,
        MeasuredStatisticRow::SPEC,
        MeasuredAnalysisRow::SPEC,
        FeasibilityRow::SPEC,
        TargetRow::SPEC,
        CalibrationRow::SPEC,
        OptimumRow::SPEC,
        PosteriorRow::SPEC,
        PosteriorSummaryRow::SPEC,
        PredictionRow::SPEC,
        &VERIFY_RUNS,
        &VERIFY_KPIS,
        VerificationRow::SPEC,
        &VALIDATE_RUNS,
        &VALIDATE_KPIS,
        ValidationRow::SPEC,
        &DIAGNOSE_RUNS,
        &DIAGNOSE_KPIS,
        SignatureRow::SPEC,
        ResidualRow::SPEC,
        AttributionRow::SPEC,
        ConfusionRow::SPEC,
        VerdictRow::SPEC,
        RecalibrationRow::SPEC,
        BeforeAfterRow::SPEC,
    ],
    writes: &[],
    files: &[HTML, MARKDOWN, SUMMARY],
    measured: false,
    settings: settings_text,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings_text(config: &Config) -> SettingsText {
    let mut settings = text([("physics_version", dem::PHYSICS_VERSION.to_string())]);
    settings.extend(config.settings_text(&[
        "study.name",
        "study.title",
        "study.resolution",
        "setup",
        "measured",
        "diagnose.kind",
        "statistics.confidence",
    ]));
    settings.extend(config.equipment_text(EXPERIMENTS));
    settings
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let report = gather(context)?;
    let mut outputs = Outputs::default();
    outputs.file(HTML.to_owned(), report::html(&report).into_bytes());
    outputs.file(MARKDOWN.to_owned(), report::markdown(&report).into_bytes());
    outputs.file(SUMMARY.to_owned(), report::summary(&report).into_bytes());
    Ok(outputs)
}

/// Everything the report shows; tables of stages that have not run are empty.
fn gather(context: &Context) -> Result<Report, StageError> {
    let mut runs = rows::<RunRow>(context, RunRow::SPEC)?;
    let mut kpis = rows::<KpiRow>(context, KpiRow::SPEC)?;
    for table in [&VERIFY_RUNS, &VALIDATE_RUNS, &DIAGNOSE_RUNS] {
        runs.extend(rows::<RunRow>(context, table)?);
    }
    for table in [&VERIFY_KPIS, &VALIDATE_KPIS, &DIAGNOSE_KPIS] {
        kpis.extend(rows::<KpiRow>(context, table)?);
    }
    // Of a study that gives its bounds there are no such tables; another one in the same store may have left its own.
    let mut bounds = Vec::new();
    if context.config.bounds.density == DensityBounds::Found {
        runs.extend(rows::<RunRow>(context, &BOUNDS_RUNS)?);
        kpis.extend(rows::<KpiRow>(context, &BOUNDS_KPIS)?);
        bounds = own(context)?;
    }
    Ok(Report {
        study: study(context.config),
        bounds,
        samples: own(context)?,
        design_quality: own(context)?,
        runs,
        kpis,
        aggregates: own(context)?,
        metamodels: own(context)?,
        hyperparameters: own(context)?,
        sensitivity: own(context)?,
        measured_statistics: own(context)?,
        measured_analysis: own(context)?,
        feasibility: own(context)?,
        targets: own(context)?,
        calibrations: own(context)?,
        optima: own(context)?,
        posterior: own(context)?,
        posterior_summary: own(context)?,
        predictions: own(context)?,
        verification: own(context)?,
        validation: own(context)?,
        signatures: own(context)?,
        residuals: own(context)?,
        attribution: own(context)?,
        confusion: own(context)?,
        verdicts: own(context)?,
        recalibration: own(context)?,
        before_after: own(context)?,
    })
}

fn own<R: Row>(context: &Context) -> Result<Vec<R>, StageError> {
    rows(context, R::SPEC)
}

fn rows<R: Row>(context: &Context, table: &TableSpec) -> Result<Vec<R>, StageError> {
    if context.has(table) { context.read_from(table) } else { Ok(Vec::new()) }
}

fn study(config: &Config) -> report::Study {
    let kind = config.diagnose.kind.name().to_owned();
    report::Study {
        name: config.study.name.clone(),
        title: config.study.title.clone(),
        resolution: match config.study.resolution {
            Resolution::Coarse => report::Resolution::Coarse,
            Resolution::Full => report::Resolution::Full,
        },
        physics_version: dem::PHYSICS_VERSION.to_string(),
        published: config.measured.iter().find(|set| set.name == "paper").map(|set| set.name.clone()),
        method: Some(Method { kind, approach: "m".to_owned() }),
        confidence: config.statistics.confidence,
        assumptions: assumptions(config.base_settings()),
        departures: departures(config.base_settings()),
    }
}

/// Settings that the paper leaves open, with their values here.
fn assumptions(settings: &Settings) -> Vec<Assumption> {
    let assumption = |spec: &SettingSpec| Assumption {
        name: spec.name.to_owned(),
        value: value(settings, spec),
        meaning: format!("{} ({})", spec.meaning, spec.source),
    };
    settings::specs().filter(|spec| spec.assumption).map(assumption).collect()
}

/// Settings whose value is not that of the full-scale study, and equipment that the paper does not have.
fn departures(settings: &Settings) -> Vec<Departure> {
    let full = Settings::default();
    let departs = |spec: &&SettingSpec| settings.get(spec.name) != full.get(spec.name);
    let departure = |spec: &SettingSpec| Departure {
        name: spec.name.to_owned(),
        value: value(settings, spec),
        paper: value(&full, spec),
    };
    let equipment = EXPERIMENTS.iter().flat_map(|experiment| settings.equipment(experiment.name()));
    let own = |piece: &Equipment| Departure {
        name: format!("equipment.{}.{}", piece.experiment, piece.name),
        value: piece.text(),
        paper: "none".to_owned(),
    };
    settings::specs().filter(departs).map(departure).chain(equipment.map(own)).collect()
}

fn value(settings: &Settings, spec: &SettingSpec) -> String {
    match settings.word(spec.name) {
        Ok(Some(word)) => word.to_owned(),
        _ => settings.get(spec.name).map_or_else(|_| String::new(), |value| units::format(value, spec.unit)),
    }
}
