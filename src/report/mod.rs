//! The report: what was run, what came out, what the model lacks, as HTML, Markdown and a short text.
//!
//! Takes the rows of all tables and a few facts of the study, gives text; the same rows give the same bytes, so there
//! are no dates and no hosts in it. `sections` turns tables into a `document`, [`html()`] and [`markdown()`] render
//! it, [`summary()`] is the text for the end of a run, `paper` holds the published numbers shown beside ours.
//! Deliberately absent: reading and writing files, and any statistics. Every number shown stands in a table (or is a
//! ratio of two that do); a value that is missing is a dash with its reason; a stage that has not run is named.

mod charts;
mod document;
mod html;
mod markdown;
pub mod numbers;
mod paper;
mod sections;
mod summary;
mod words;

use std::collections::BTreeSet;

use crate::tables::{
    AggregateRow, AttributionRow, BeforeAfterRow, BoundRow, CalibrationRow, ConfusionRow, DesignQualityRow,
    FeasibilityRow, HyperparameterRow, KpiRow, MeasuredAnalysisRow, MeasuredStatisticRow, MetamodelRow, OptimumRow,
    PosteriorRow, PosteriorSummaryRow, PredictionRow, RecalibrationRow, ResidualRow, RunRow, SampleRow, SensitivityRow,
    SignatureRow, TargetRow, ValidationRow, VerdictRow, VerificationRow,
};

/// How close the study's set-up is to the paper's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Resolution {
    /// Larger or softer particles than the paper's: a model of its own.
    #[default]
    Coarse,
    /// The paper's particles and stiffness.
    Full,
}

impl Resolution {
    /// The word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Coarse => "coarse",
            Self::Full => "full",
        }
    }
}

/// Something the paper leaves open and the study had to settle.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Assumption {
    /// Name of the setting.
    pub name: String,
    /// Its value with unit.
    pub value: String,
    /// What it means and why it was chosen.
    pub meaning: String,
}

/// A setting in which the study departs from the paper.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Departure {
    /// Name of the setting.
    pub name: String,
    /// Value in this study, with unit.
    pub value: String,
    /// Value in the paper, with unit.
    pub paper: String,
}

/// Which calibration is meant when only one can be shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Method {
    /// ibm, rbm or sk.
    pub kind: String,
    /// m or mv.
    pub approach: String,
}

/// Facts of the study that no table holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Study {
    /// Name, as in the file name.
    pub name: String,
    /// Title in words.
    pub title: String,
    /// Coarse or full.
    pub resolution: Resolution,
    /// Version of the simulated physics.
    pub physics_version: String,
    /// Measured data set that holds the paper's targets; results for it are shown beside the paper's.
    pub published: Option<String>,
    /// The calibration that the diagnosis starts from; where there is none, the summary picks the most complete one.
    pub method: Option<Method>,
    /// Confidence of the confidence intervals [-].
    pub confidence: f64,
    /// What the paper leaves open.
    pub assumptions: Vec<Assumption>,
    /// Where the study departs from the paper.
    pub departures: Vec<Departure>,
}

/// Everything the report shows: facts of the study and the rows of every table, each in its stored order.
/// A table whose stage has not run is empty.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Facts of the study.
    pub study: Study,
    /// Bounds of the particle density that were found by simulation; none where the study gives them.
    pub bounds: Vec<BoundRow>,
    /// Design of experiments.
    pub samples: Vec<SampleRow>,
    /// How evenly it fills the unit cube.
    pub design_quality: Vec<DesignQualityRow>,
    /// Simulations of every stage: design, optima, held-out equipment, diagnosis.
    pub runs: Vec<RunRow>,
    /// Observables of these simulations.
    pub kpis: Vec<KpiRow>,
    /// Means and standard deviations over repetitions.
    pub aggregates: Vec<AggregateRow>,
    /// Trained metamodels.
    pub metamodels: Vec<MetamodelRow>,
    /// Numbers that rebuild them.
    pub hyperparameters: Vec<HyperparameterRow>,
    /// Which parameter moves which KPI.
    pub sensitivity: Vec<SensitivityRow>,
    /// Measured means and scatter for every number of repetitions.
    pub measured_statistics: Vec<MeasuredStatisticRow>,
    /// Stability, normality and repetitions needed of every measured observable.
    pub measured_analysis: Vec<MeasuredAnalysisRow>,
    /// Whether the design brackets the measured means.
    pub feasibility: Vec<FeasibilityRow>,
    /// Measured statistics.
    pub targets: Vec<TargetRow>,
    /// Searches for the optimum.
    pub calibrations: Vec<CalibrationRow>,
    /// Calibrated parameters.
    pub optima: Vec<OptimumRow>,
    /// Draws of the parameters given the measurements.
    pub posterior: Vec<PosteriorRow>,
    /// Distribution of every parameter given the measurements.
    pub posterior_summary: Vec<PosteriorSummaryRow>,
    /// What the metamodels predict there.
    pub predictions: Vec<PredictionRow>,
    /// DEM at the optima.
    pub verification: Vec<VerificationRow>,
    /// Held-out equipment at the optima.
    pub validation: Vec<ValidationRow>,
    /// Change of every statistic with every effect and parameter.
    pub signatures: Vec<SignatureRow>,
    /// Measured minus model.
    pub residuals: Vec<ResidualRow>,
    /// Candidate effects.
    pub attribution: Vec<AttributionRow>,
    /// Likeness of effects.
    pub confusion: Vec<ConfusionRow>,
    /// What the model lacks.
    pub verdicts: Vec<VerdictRow>,
    /// Parameters and strengths before and after.
    pub recalibration: Vec<RecalibrationRow>,
    /// Errors before and after.
    pub before_after: Vec<BeforeAfterRow>,
}

/// The report as one HTML file without outside resources.
pub fn html(report: &Report) -> String {
    html::render(&sections::document(report))
}

/// The same report as Markdown.
pub fn markdown(report: &Report) -> String {
    markdown::render(&sections::document(report))
}

/// The short text printed at the end of a run: at most 35 lines.
pub fn summary(report: &Report) -> String {
    summary::render(report)
}

impl Report {
    /// Names of all measured data sets that any table mentions, sorted.
    fn data_sets(&self) -> Vec<&str> {
        let targets = self.targets.iter().map(|row| &row.measured);
        let analysed = self.measured_analysis.iter().map(|row| &row.measured);
        let calibrations = self.calibrations.iter().map(|row| &row.measured);
        let optima = self.optima.iter().map(|row| &row.measured);
        let verdicts = self.verdicts.iter().map(|row| &row.measured);
        let residuals = self.residuals.iter().map(|row| &row.measured);
        let before_after = self.before_after.iter().map(|row| &row.measured);
        let all = targets
            .chain(analysed)
            .chain(calibrations)
            .chain(optima)
            .chain(verdicts)
            .chain(residuals)
            .chain(before_after);
        all.map(String::as_str).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// What a confidence interval is called, as `95 % interval`.
    fn interval_name(&self) -> String {
        format!("{} % interval", (1e4 * self.study.confidence).round() / 100.0)
    }

    /// What a measured observable is there for.
    fn purpose(row: &TargetRow) -> &'static str {
        match (row.fitted, words::is_kpi(&row.kpi)) {
            (true, true) => "fitted",
            (true, false) => "diagnosis only",
            (false, _) => "held out",
        }
    }

    /// What the diagnosis made of a statistic: `held out` is only what belongs to the experiment that no fit sees, and repetitions
    /// that were kept from the fit are named so.
    fn role(&self, row: &BeforeAfterRow) -> &'static str {
        let of_fitted_experiment =
            |target: &TargetRow| target.measured == row.measured && target.kpi == row.kpi && target.fitted;
        match row.fitted {
            true => "fitted",
            false if row.held_out_repetitions => "held-out repetitions",
            false if self.targets.iter().any(of_fitted_experiment) => "not used",
            false => "held out",
        }
    }

    /// The diagnosis' statistics of a data set: fitted ones, then unused ones, then held-out repetitions, then the held-out
    /// experiment, the paper's KPIs first.
    fn before_after_of(&self, measured: &str) -> Vec<&BeforeAfterRow> {
        let mut rows: Vec<&BeforeAfterRow> = self.before_after.iter().filter(|row| row.measured == measured).collect();
        let order = |role: &str| {
            ["fitted", "not used", "held-out repetitions", "held out"].iter().position(|known| *known == role)
        };
        rows.sort_by_key(|row| (order(self.role(row)), words::rank(&row.kpi), row.statistic.as_str()));
        rows
    }

    /// Are the results for this data set to be shown beside the paper's?
    fn is_published(&self, measured: &str) -> bool {
        self.study.published.as_deref() == Some(measured)
    }

    fn is_coarse(&self) -> bool {
        self.study.resolution == Resolution::Coarse
    }
}
