//! Where to simulate next: rows of a points file that the stage `sample` accepts.
//!
//! No stage: it reads what `sample`, `aggregate` and `train` left, and asks [`crate::stats::next`]. What it gives becomes
//! part of the design when somebody puts it into `design.points`.

use super::models::Models;
use super::{Context, StageError};
use crate::config::ChosenPoint;
use crate::stats::metamodel::{Kind, Metamodel, Observations, PartRecord};
use crate::stats::next::{Choice, Suggestion, suggest as choose};
use crate::tables::list::SampleRow;
use std::collections::BTreeMap;

/// A row of a points file, and why it is there.
#[derive(Debug, Clone, PartialEq)]
pub struct SuggestedPoint {
    /// Values and runs.
    pub point: ChosenPoint,
    /// Whether it is new, and what it is expected to bring.
    pub note: String,
}

const REMEDY: &str = "run `granulake repro train` with `sk` among metamodel.kinds";

/// The points that were chosen already, then `wished` more batches of `study.repetitions` runs: new points, or more
/// repetitions of points of the design, for the metamodels `sk` of all fitted KPIs together.
///
/// # Errors
/// Tables or metamodels that are not there, and more parameters than the Sobol sequence offers.
pub fn suggest(context: &Context, wished: usize) -> Result<Vec<SuggestedPoint>, StageError> {
    let config = context.config;
    let trained = Models::read(context)?;
    let apart = trained.validation_points();
    let (models, numbers) = metamodels(context, &trained)?;
    let sets: Vec<(&Metamodel, &[usize])> =
        models.iter().map(|(_, model, counts)| (model, counts.as_slice())).collect();
    let repetitions = config.study.repetitions;
    let round = context
        .campaign
        .install(|| choose(&sets, &apart, wished, repetitions as usize))
        .map_err(|error| StageError::Input { what: error.to_string(), remedy: "calibrate fewer parameters" })?;
    let names: Vec<&str> = models.iter().map(|(kpi, ..)| *kpi).collect();
    let values = values(context)?;
    let given = config.chosen.iter().cloned().map(|point| SuggestedPoint { point, note: "chosen before".to_owned() });
    let row = |suggestion: &Suggestion| {
        let (values, extra, what) = match &suggestion.choice {
            Choice::Replicate(index) => {
                let number = numbers[*index];
                (values[&number].clone(), repetitions, format!("repeat point {number}"))
            }
            Choice::Explore(unit) => {
                let values = config.parameters.iter().zip(unit).map(|(parameter, u)| parameter.from_unit(*u));
                (values.collect(), 0, "new point".to_owned())
            }
        };
        SuggestedPoint { point: ChosenPoint { values, extra }, note: format!("{what}; {}", gains(&names, suggestion)) }
    };
    Ok(given.chain(round.iter().map(row)).collect())
}

/// Expected fall of every KPI's error, in per cent.
fn gains(names: &[&str], suggestion: &Suggestion) -> String {
    let said = names.iter().zip(&suggestion.gain).map(|(name, gain)| format!("{name} -{:.2} %", 100.0 * gain));
    said.collect::<Vec<_>>().join(" ")
}

/// KPI, metamodel on the points that all KPIs have, and the runs there.
type OfKpi = (&'static str, Metamodel, Vec<usize>);

/// Metamodels `sk` of the fitted KPIs, all on the points that every one of them has, and the numbers of these points.
fn metamodels(context: &Context, models: &Models) -> Result<(Vec<OfKpi>, Vec<u32>), StageError> {
    let last = context.config.study.repetitions;
    let observables = context.config.experiments().into_iter().flat_map(|experiment| experiment.observables());
    let mut trained: Vec<(&'static str, Vec<PartRecord>, Observations)> = Vec::new();
    for kpi in observables.filter(|observable| observable.is_kpi).map(|observable| observable.name) {
        let records = models.records(kpi, Kind::Sk, last).ok_or_else(|| StageError::Input {
            what: format!("there is no `sk` metamodel of {kpi}"),
            remedy: REMEDY,
        })?;
        trained.push((kpi, records, models.design(kpi, last)));
    }
    let size = trained.first().map_or(0, |(.., observations)| observations.counts.len());
    let known: Vec<usize> = (0..size).filter(|i| trained.iter().all(|(.., o)| o.counts[*i] > 0)).collect();
    let restored = trained.into_iter().map(|(kpi, records, observations)| {
        let observations = observations.select(&known);
        let model = Metamodel::restore(&records, &observations)
            .map_err(|error| StageError::Input { what: format!("{kpi}: {error}"), remedy: REMEDY })?;
        Ok((kpi, model, observations.counts))
    });
    let restored = restored.collect::<Result<Vec<OfKpi>, StageError>>()?;
    let numbers = models.training_points();
    Ok((restored, known.into_iter().map(|index| numbers[index]).collect()))
}

/// Values of every design point in the order of the parameters.
fn values(context: &Context) -> Result<BTreeMap<u32, Vec<f64>>, StageError> {
    let parameters = &context.config.parameters;
    let mut points: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for row in context.read::<SampleRow>()? {
        let point = points.entry(row.point).or_insert_with(|| vec![0.0; parameters.len()]);
        if let Some(index) = parameters.iter().position(|parameter| parameter.name == row.parameter) {
            point[index] = row.value;
        }
    }
    Ok(points)
}
