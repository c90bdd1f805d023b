//! diagnose: what the calibrated model cannot explain, which effect would, and the error before and after adding it.
//!
//! Every candidate is simulated over the parameters and its strength (`anchors`), once for all data sets. Then, for each
//! measured data set: all statistics are fitted at once over metamodels (`fit`), and the optimum is simulated directly
//! (`direct`); metamodels over parameters and strength give the signature of every candidate, and those that may be
//! named are simulated directly at their own optimum first (`joint`); the residual is attributed
//! ([`crate::stats::attribution`]), less the model's own offset where the data have `controls`, and no surer than what is known
//! of the apparatus (`doubts`). An effect that is accepted is
//! switched on, its strength calibrated together with the parameters, with runs along what the data leave open (`along`), and
//! both models are simulated anew (`before_after`), the held-out experiment also where the parameters may be besides
//! (`leeway`), and that has a say (`held_out`). The held-out experiment enters nothing of this but the last comparison.

mod along;
mod anchors;
mod before_after;
mod closer;
mod controls;
mod direct;
mod doubts;
mod evidence;
mod fit;
mod held_out;
mod joint;
mod lab;
mod leeway;
mod moments;
mod panel;
mod proposals;
mod rows;
mod scatter;
mod target;
mod verdict;

pub use panel::{Panel, PanelRows};

use super::context::{run_settings, text};
use super::models::Models;
use super::{Context, Demand, Outputs, SettingsText, Stage, StageError, never};
use crate::config::{Config, Measured};
use crate::tables::Row;
use crate::tables::list::{
    AggregateRow, AttributionRow, BeforeAfterRow, ConfusionRow, DIAGNOSE_KPIS, DIAGNOSE_RUNS, HeldOutRow,
    HyperparameterRow, PointRow, PriorWidthRow, RecalibrationRow, ResidualRow, SampleRow, SignatureRow, VerdictRow,
};
use anchors::Anchors;
use controls::{Control, Offset};
use lab::Lab;
use std::collections::BTreeMap;
use verdict::{Prepared, prepare};

/// The stage.
pub const STAGE: Stage = Stage {
    name: "diagnose",
    version: 38,
    purpose: "name the effect the model lacks, add it, compare before and after",
    reads: &[SampleRow::SPEC, AggregateRow::SPEC, HyperparameterRow::SPEC],
    writes: &[
        PointRow::SPEC,
        &DIAGNOSE_RUNS,
        &DIAGNOSE_KPIS,
        SignatureRow::SPEC,
        ResidualRow::SPEC,
        AttributionRow::SPEC,
        ConfusionRow::SPEC,
        VerdictRow::SPEC,
        PriorWidthRow::SPEC,
        RecalibrationRow::SPEC,
        BeforeAfterRow::SPEC,
        HeldOutRow::SPEC,
    ],
    files: &[],
    measured: true,
    settings,
    skipped: never,
    run,
    demand,
};

fn settings(config: &Config) -> SettingsText {
    let mut experiments = config.experiments();
    experiments.push(config.validate.experiment);
    let mut settings = run_settings(config, &experiments);
    settings.extend(text([("study.repetitions", config.study.repetitions.to_string())]));
    settings.extend(config.settings_text(&[
        "diagnose",
        "effects.accept",
        "validate",
        "parameters",
        "experiments",
        "metamodel",
        "prior",
        "uncertain",
        "statistics",
        "study.resolution",
    ]));
    settings.extend(config.declared_text(config.diagnose.candidates.iter().map(String::as_str)));
    let comparable = config.measured.iter().map(|set| format!("measured.{}.comparable", set.name));
    settings
        .extend(config.settings_text(&comparable.collect::<Vec<_>>().iter().map(String::as_str).collect::<Vec<_>>()));
    for set in config.measured.iter().filter(|set| !set.controls.is_empty()) {
        settings.extend(text([(&*format!("measured.{}.controls", set.name), set.controls.join(", "))]));
    }
    settings
}

/// A data set as the fits see it, and the repetitions that are kept from them.
struct Split {
    seen: Measured,
    unseen: Measured,
}

/// The data sets; those to be diagnosed less the repetitions that are held out.
fn splits(context: &Context) -> Vec<Split> {
    let experiments: Vec<&str> = context.config.experiments().iter().map(|experiment| experiment.name()).collect();
    let is_diagnosed = |set: &Measured| context.config.diagnose.measured.contains(&set.name);
    let split = |set: &Measured| {
        let share = if is_diagnosed(set) { context.config.diagnose.held_out_share } else { 0.0 };
        let (seen, unseen) = set.hold_out(share, &experiments);
        Split { seen, unseen }
    };
    context.measured.iter().map(split).collect()
}

/// Rows of all tables of this stage but the runs.
#[derive(Default)]
struct Tables {
    signatures: Vec<SignatureRow>,
    residuals: Vec<ResidualRow>,
    attribution: Vec<AttributionRow>,
    confusion: Vec<ConfusionRow>,
    verdicts: Vec<VerdictRow>,
    prior_widths: Vec<PriorWidthRow>,
    recalibration: Vec<RecalibrationRow>,
    before_after: Vec<BeforeAfterRow>,
    held_out: Vec<HeldOutRow>,
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let models = Models::read(context)?;
    let mut lab = Lab::new(context);
    let anchors = Anchors::simulate(context, &mut lab)?;
    let mut tables = Tables::default();
    let mut ready: BTreeMap<&str, Prepared> = BTreeMap::new();
    let mut controls: BTreeMap<&str, Control> = BTreeMap::new();
    let sets = splits(context);
    for Split { seen: set, .. } in controlling(context, &sets) {
        let prepared = prepare(context, &models, &anchors, &mut lab, set, None)?;
        if let Ok((case, _)) = &prepared {
            controls.insert(&set.name, Control::new(case, &mut lab)?);
        }
        ready.insert(&set.name, prepared);
    }
    for Split { seen: set, unseen } in diagnosed(context, &sets) {
        let prepared = match (ready.remove(&*set.name), offset(context, set, &controls)) {
            (Some(prepared), _) => prepared,
            (None, Ok(offset)) => prepare(context, &models, &anchors, &mut lab, set, offset.as_ref())?,
            (None, Err(why)) => Err(why),
        };
        verdict::diagnose(&models, &anchors, &mut lab, ((set, unseen), prepared), &mut tables)?;
    }
    let mut outputs = Outputs::default();
    outputs.table(lab.points)?;
    outputs.table_as(&DIAGNOSE_RUNS, lab.runs)?;
    outputs.table_as(&DIAGNOSE_KPIS, lab.kpis)?;
    outputs.table(tables.signatures)?;
    outputs.table(tables.residuals)?;
    outputs.table(tables.attribution)?;
    outputs.table(tables.confusion)?;
    outputs.table(tables.verdicts)?;
    outputs.table(tables.prior_widths)?;
    outputs.table(tables.recalibration)?;
    outputs.table(tables.before_after)?;
    outputs.table(tables.held_out)?;
    Ok(outputs)
}

/// The anchors; how many runs at the optima follow, nobody knows before they are diagnosed.
fn demand(context: &Context) -> Result<Demand, StageError> {
    Ok(Demand::within_bounds(context.config, anchors::requests(context)?))
}

/// Names of the controls of a set.
fn controls_of<'a>(context: &Context<'a>, set: &Measured) -> &'a [String] {
    let source = context.config.measured.iter().find(|source| source.name == set.name);
    source.map_or(&[], |source| &source.controls)
}

/// The sets that are controls of one to be diagnosed.
fn controlling<'s>(context: &Context<'s>, sets: &'s [Split]) -> impl Iterator<Item = &'s Split> {
    let wanted: Vec<&String> = diagnosed(context, sets).flat_map(|set| controls_of(context, &set.seen)).collect();
    sets.iter().filter(move |set| wanted.contains(&&set.seen.name))
}

/// What the controls of a set say; the error names a control that says nothing.
fn offset(context: &Context, set: &Measured, seen: &BTreeMap<&str, Control>) -> Result<Option<Offset>, String> {
    let control = |name: &String| {
        seen.get(name.as_str()).ok_or_else(|| format!("the control `{name}` allows no comparison of its own"))
    };
    let controls = controls_of(context, set).iter().map(control).collect::<Result<Vec<_>, _>>()?;
    Ok(Offset::of(&controls))
}

fn diagnosed<'s>(context: &Context<'s>, sets: &'s [Split]) -> impl Iterator<Item = &'s Split> {
    let wanted = &context.config.diagnose.measured;
    sets.iter().filter(move |set| wanted.contains(&set.seen.name))
}
