//! train: metamodels of every KPI for every kind and number of repetitions, and of the extra observables for diagnosis.

use super::context::text;
use super::models::{Aggregates, Design, kind, options, rows};
use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs};
use crate::config::Config;
use crate::experiments::{Experiment, Observable};
use crate::stats::metamodel::{Kind, Metamodel, PartRecord, quality};
use crate::stats::sensitivity::sobol_indices;
use crate::tables::Row;
use crate::tables::list::{AggregateRow, HyperparameterRow, MetamodelRow, SampleRow, SensitivityRow};
use rayon::prelude::*;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "train",
    version: 3,
    purpose: "Gaussian-process metamodels of every KPI, for every kind and number of repetitions",
    reads: &[SampleRow::SPEC, AggregateRow::SPEC],
    writes: &[MetamodelRow::SPEC, HyperparameterRow::SPEC, SensitivityRow::SPEC],
    files: &[],
    measured: false,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([
        ("study.seed", config.study.seed.to_string()),
        ("study.repetitions", config.study.repetitions.to_string()),
    ]);
    settings.extend(config.settings_text(&["metamodel", "parameters", "experiments", "diagnose.kind"]));
    settings
}

/// A chain of trainings: one observable and kind over growing numbers of repetitions.
struct Chain {
    observable: &'static Observable,
    kind: Kind,
    counts: Vec<u32>,
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let design = Design::new(context.config, &context.read()?);
    let aggregates = Aggregates::new(context.read()?);
    let seed = context.seed("train");
    let train = |chain: &Chain| train_chain(context.config, &design, &aggregates, chain, seed);
    let chains = chains(context.config);
    let trained: Vec<_> = context.campaign.install(|| chains.par_iter().map(train).collect());
    let (metamodels, hyperparameters): (Vec<_>, Vec<_>) =
        trained.iter().flat_map(|(rows, _)| rows.iter().cloned()).unzip();
    let mut outputs = Outputs::default();
    outputs.table::<MetamodelRow>(metamodels)?;
    outputs.table::<HyperparameterRow>(hyperparameters.into_iter().flatten().collect())?;
    outputs.table::<SensitivityRow>(trained.into_iter().flat_map(|(_, rows)| rows).collect())?;
    Ok(outputs)
}

/// Rows of the two Sobol matrices behind the indices, whose error is then about 0.01.
const SENSITIVITY_SAMPLES: usize = 2048;

/// Sobol indices of mean and sd over the parameter space; none where there are more parameters than the Sobol sequence
/// can serve (ten).
fn sensitivity(config: &Config, chain: &Chain, n: u32, model: &Metamodel, seed: u64) -> Vec<SensitivityRow> {
    let mean = |x: &[f64]| model.mean(x);
    let sd = |x: &[f64]| model.predict(x).sd.map_or(0.0, |sd| sd.value);
    let p = config.parameters.len();
    let mut rows = Vec::new();
    for (statistic, found) in [
        ("mean", sobol_indices(mean, p, SENSITIVITY_SAMPLES, seed)),
        ("sd", sobol_indices(sd, p, SENSITIVITY_SAMPLES, seed)),
    ] {
        let Ok(found) = found else { continue };
        if statistic == "sd" && model.predict(&vec![0.5; p]).sd.is_none() {
            continue;
        }
        rows.extend(config.parameters.iter().zip(&found.indices).map(|(parameter, index)| SensitivityRow {
            kpi: chain.observable.name.to_owned(),
            kind: chain.kind.name().to_owned(),
            n,
            statistic: statistic.to_owned(),
            parameter: parameter.name.to_owned(),
            first: index.first,
            total: index.total,
            mean: found.mean,
            spread: found.variance.sqrt(),
            unit: chain.observable.unit.to_owned(),
        }));
    }
    rows
}

/// Rows of every metamodel of a chain, and the sensitivities of the last one where the observable is a KPI.
type Trained = (Vec<(MetamodelRow, Vec<HyperparameterRow>)>, Vec<SensitivityRow>);

fn chains(config: &Config) -> Vec<Chain> {
    let all: Vec<u32> = (1..=config.study.repetitions).collect();
    let last = vec![config.study.repetitions];
    let mut chains = Vec::new();
    for observable in config.experiments().iter().flat_map(|experiment: &&dyn Experiment| experiment.observables()) {
        if observable.is_kpi {
            let kinds = config.metamodel.kinds.iter();
            chains.extend(kinds.map(|k| Chain { observable, kind: kind(*k), counts: all.clone() }));
        } else {
            chains.push(Chain { observable, kind: kind(config.diagnose.kind), counts: last.clone() });
        }
    }
    chains
}

fn train_chain(config: &Config, design: &Design, aggregates: &Aggregates, chain: &Chain, seed: u64) -> Trained {
    let mut warm: Vec<PartRecord> = Vec::new();
    let (mut trained, mut sensitivities) = (Vec::new(), Vec::new());
    for &n in &chain.counts {
        let observations = design.observations(aggregates, chain.observable.name, n, false);
        let mut options = options(config, seed);
        options.warm = std::mem::take(&mut warm);
        let points = observations.counts.iter().filter(|count| **count > 0).count() as u32;
        let row = empty_row(chain, n, points);
        trained.push(match Metamodel::fit(chain.kind, &observations, &options) {
            Ok(model) => {
                warm = model.records();
                if chain.observable.is_kpi && n == config.study.repetitions {
                    sensitivities = sensitivity(config, chain, n, &model, seed);
                }
                let judged = design.observations(aggregates, chain.observable.name, n, true);
                let scores = (quality::score(&model, &observations), quality::score(&model, &judged));
                (scored(row, &model, scores), rows(config, chain.observable.name, n, &warm))
            }
            Err(error) => {
                (MetamodelRow { status: "failed".to_owned(), reason: Some(error.to_string()), ..row }, vec![])
            }
        });
    }
    (trained, sensitivities)
}

fn empty_row(chain: &Chain, n: u32, points: u32) -> MetamodelRow {
    MetamodelRow {
        kpi: chain.observable.name.to_owned(),
        kind: chain.kind.name().to_owned(),
        n,
        points,
        lml: None,
        nrmse_train_mean: None,
        nrmse_train_sd: None,
        nrmse_validation_mean: None,
        nrmse_validation_sd: None,
        status: "ok".to_owned(),
        reason: None,
    }
}

fn scored(
    row: MetamodelRow,
    model: &Metamodel,
    scores: (Option<quality::Score>, Option<quality::Score>),
) -> MetamodelRow {
    // The NRMSE of an observable whose mean vanishes over the design has no meaning; it stays empty.
    let finite = |value: f64| value.is_finite().then_some(value);
    let mean = |score: &Option<quality::Score>| score.as_ref().and_then(|score| finite(score.mean.nrmse));
    let sd = |score: &Option<quality::Score>| {
        score.as_ref().and_then(|score| score.scatter.as_ref()).and_then(|scatter| finite(scatter.sd.nrmse))
    };
    MetamodelRow {
        lml: model.records().first().map(|record| record.log_likelihood),
        nrmse_train_mean: mean(&scores.0),
        nrmse_train_sd: sd(&scores.0),
        nrmse_validation_mean: mean(&scores.1),
        nrmse_validation_sd: sd(&scores.1),
        ..row
    }
}
