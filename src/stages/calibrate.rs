//! calibrate: the parameters that bring every metamodel to the measured values (eqs 10-13), with what stays uncertain.

use super::context::text;
use super::models::{Models, kind};
use super::{Context, Outputs, SettingsText, Stage, StageError, never, no_runs, targets};
use crate::config::{Approach, Config, Parameter};
use crate::rng::Stream;
use crate::stats::ensemble::{Length, Marginal, Sample, everywhere, sample, walkers};
use crate::stats::metamodel::{Kind, Metamodel, Prediction};
use crate::stats::objective::identifiability::identify;
use crate::stats::objective::{
    Calibration, CalibrationObjective, Mode, ObjectiveError, Prior, Problem, Target, calibrate,
};
use crate::stats::optimise::Starts;
use crate::tables::Row;
use crate::tables::list::{
    AggregateRow, CalibrationRow, HyperparameterRow, OptimumRow, PosteriorRow, PosteriorSummaryRow, PredictionRow,
    SampleRow, TargetRow,
};
use rayon::prelude::*;

/// The stage.
pub const STAGE: Stage = Stage {
    name: "calibrate",
    version: 4,
    purpose: "parameters that bring the metamodels to the measured values",
    reads: &[SampleRow::SPEC, AggregateRow::SPEC, HyperparameterRow::SPEC],
    writes: &[
        TargetRow::SPEC,
        CalibrationRow::SPEC,
        OptimumRow::SPEC,
        PosteriorRow::SPEC,
        PosteriorSummaryRow::SPEC,
        PredictionRow::SPEC,
    ],
    files: &[],
    measured: true,
    settings,
    skipped: never,
    run,
    demand: no_runs,
};

/// Starts whose descent is followed to its end, besides the optimum for fewer repetitions.
const REFINED: usize = 6;

/// The walk behind the credible intervals, from all over the unit cube.
fn walk(problem: &Problem, seed: u64) -> Sample {
    let (p, mut stream) = (problem.dimension(), Stream::new(seed, "posterior walkers"));
    let start = everywhere(p, walkers(p), &mut stream);
    sample(start, |x| problem.log_posterior(x), Length::default(), stream)
}

/// Draws that are stored, taken evenly from the walk.
const DRAWS: usize = 400;

fn settings(config: &Config) -> SettingsText {
    let mut settings = text([
        ("study.seed", config.study.seed.to_string()),
        ("study.repetitions", config.study.repetitions.to_string()),
    ]);
    settings.extend(config.settings_text(&[
        "calibrate",
        "metamodel",
        "parameters",
        "experiments",
        "prior",
        "statistics",
        "validate.experiment",
    ]));
    settings
}

/// A chain of calibrations: one data set, kind and approach over growing numbers of repetitions.
struct Chain {
    measured: String,
    kind: Kind,
    approach: Approach,
}

/// An optimum with what is known of its neighbourhood.
struct Solution {
    calibration: Calibration,
    /// Directions that the data do not fix, in words.
    flat: Option<String>,
    /// Distribution of every parameter; only for the largest number of repetitions, because it is a long walk.
    posterior: Option<Posterior>,
}

/// A walk over the parameters and the marginals that follow.
struct Posterior {
    sample: Sample,
    marginals: Vec<Marginal>,
}

/// The rows of one calibration.
struct Calibrated {
    calibration: CalibrationRow,
    optima: Vec<OptimumRow>,
    predictions: Vec<PredictionRow>,
    draws: Vec<PosteriorRow>,
    summaries: Vec<PosteriorSummaryRow>,
}

fn run(context: &Context) -> Result<Outputs, StageError> {
    let models = Models::read(context)?;
    let targets = targets::rows(context);
    let work = Work { context, models: &models, targets: &targets, seed: context.seed("calibrate") };
    let chains = chains(context);
    let done: Vec<Calibrated> =
        context.campaign.install(|| chains.par_iter().flat_map_iter(|c| work.chain(c)).collect());
    let mut outputs = Outputs::default();
    outputs.table(targets.clone())?;
    outputs.table(done.iter().map(|c| c.calibration.clone()).collect::<Vec<_>>())?;
    outputs.table(done.iter().flat_map(|c| c.optima.clone()).collect::<Vec<_>>())?;
    outputs.table(done.iter().flat_map(|c| c.draws.clone()).collect::<Vec<_>>())?;
    outputs.table(done.iter().flat_map(|c| c.summaries.clone()).collect::<Vec<_>>())?;
    outputs.table(done.into_iter().flat_map(|c| c.predictions).collect::<Vec<_>>())?;
    Ok(outputs)
}

fn chains(context: &Context) -> Vec<Chain> {
    let mut chains = Vec::new();
    for set in context.measured {
        for metamodel in &context.config.metamodel.kinds {
            for approach in &context.config.calibrate.approaches {
                chains.push(Chain { measured: set.name.clone(), kind: kind(*metamodel), approach: *approach });
            }
        }
    }
    chains
}

struct Work<'a> {
    context: &'a Context<'a>,
    models: &'a Models<'a>,
    targets: &'a [TargetRow],
    seed: u64,
}

impl Work<'_> {
    fn chain(&self, chain: &Chain) -> Vec<Calibrated> {
        let mut warm = Vec::new();
        let mut done = Vec::new();
        for n in 1..=self.context.config.study.repetitions {
            let (calibrated, optimum) = self.one(chain, n, &warm);
            warm = optimum.into_iter().collect();
            done.push(calibrated);
        }
        done
    }

    /// One calibration and its optimum in the unit cube, from which the next one also starts.
    fn one(&self, chain: &Chain, n: u32, warm: &[Vec<f64>]) -> (Calibrated, Option<Vec<f64>>) {
        let starts = self.context.config.calibrate.starts;
        let row = CalibrationRow {
            measured: chain.measured.clone(),
            kind: chain.kind.name().to_owned(),
            approach: chain.approach.name().to_owned(),
            n,
            objective: None,
            starts,
            starts_at_optimum: None,
            flat_directions: None,
            status: "ok".to_owned(),
            reason: None,
        };
        match self.solve(chain, n, warm) {
            Ok(solution) => (self.rows(chain, row, &solution), Some(solution.calibration.x)),
            Err(reason) => {
                let calibration = CalibrationRow { status: "failed".to_owned(), reason: Some(reason), ..row };
                let (optima, predictions, draws, summaries) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
                (Calibrated { calibration, optima, predictions, draws, summaries }, None)
            }
        }
    }

    fn solve(&self, chain: &Chain, n: u32, warm: &[Vec<f64>]) -> Result<Solution, String> {
        let targets = self.fitted(&chain.measured);
        let models = targets
            .iter()
            .map(|target| {
                let lost = || format!("there is no {} metamodel of {} at n = {n}", chain.kind.name(), target.kpi);
                self.models.restore(&target.kpi, chain.kind, n).ok_or_else(lost)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let problem = self.problem(chain, &targets, &models).map_err(|error| error.to_string())?;
        let starts = Starts {
            seed: self.seed,
            number: self.context.config.calibrate.starts as usize,
            refined: REFINED,
            warm: warm.to_vec(),
        };
        let objective = CalibrationObjective::new(problem.clone(), self.context.config.calibrate.c);
        let calibration = calibrate(&objective.map_err(|error| error.to_string())?, &starts);
        let last = n == self.context.config.study.repetitions;
        Ok(Solution {
            flat: self.flat_directions(&problem, &calibration.x),
            posterior: last.then(|| {
                let sample = walk(&problem, self.seed);
                Posterior { marginals: sample.marginals(), sample }
            }),
            calibration,
        })
    }

    /// Measured KPIs that the calibration is fitted to.
    fn fitted(&self, measured: &str) -> Vec<&TargetRow> {
        let is_kpi = |row: &&TargetRow| {
            let observables = self.context.config.experiments().into_iter().flat_map(|e| e.observables());
            observables.into_iter().any(|observable| observable.is_kpi && observable.name == row.kpi)
        };
        self.targets.iter().filter(|row| row.measured == measured).filter(is_kpi).collect()
    }

    fn problem<'m>(
        &self,
        chain: &Chain,
        targets: &[&TargetRow],
        models: &'m [Metamodel],
    ) -> Result<Problem<'m>, ObjectiveError> {
        let config = self.context.config;
        let target = |row: &&TargetRow| Target {
            mean: row.mean,
            sd: row.sd,
            count: row.n as usize,
            weight: config.calibrate.weight(&row.kpi),
        };
        let mode = match chain.approach {
            Approach::Mean => Mode::Mean,
            Approach::MeanVariance => Mode::MeanVariance,
        };
        let set = self.context.measured.iter().find(|set| set.name == chain.measured);
        let known = set.map(|set| config.priors_of(set)).unwrap_or_default();
        let priors = known.iter().filter_map(|prior| {
            let index = config.parameters.iter().position(|parameter| parameter.name == prior.parameter)?;
            let bounds = (config.parameters[index].lower, config.parameters[index].upper);
            Some(Prior::measured(index, prior.mean, prior.sd, prior.n as usize, bounds))
        });
        Problem::new(models.iter().collect(), targets.iter().map(target).collect(), priors.collect(), mode)
    }

    fn flat_directions(&self, problem: &Problem, x: &[f64]) -> Option<String> {
        let names: Vec<&str> = self.context.config.parameters.iter().map(|parameter| parameter.name).collect();
        let directions = identify(problem, x).directions;
        let flat: Vec<String> = directions.iter().filter(|d| d.flat).map(|d| d.label(&names)).collect();
        (!flat.is_empty()).then(|| flat.join("; "))
    }

    fn rows(&self, chain: &Chain, row: CalibrationRow, solution: &Solution) -> Calibrated {
        let Solution { calibration, flat, posterior } = solution;
        let marginals = posterior.as_ref().map(|posterior| &posterior.marginals);
        let parameters = self.context.config.parameters.iter().enumerate();
        let optima = parameters.map(|(index, parameter)| OptimumRow {
            measured: row.measured.clone(),
            kind: row.kind.clone(),
            approach: row.approach.clone(),
            n: row.n,
            parameter: parameter.name.to_owned(),
            value: parameter.from_unit(calibration.x[index]),
            lower: marginals.map(|m| parameter.from_unit(m[index].lower)),
            upper: marginals.map(|m| parameter.from_unit(m[index].upper)),
            unit: parameter.unit.to_owned(),
            at_bound: calibration.at_bound[index],
        });
        let prediction = |(target, prediction): (&TargetRow, &Prediction)| PredictionRow {
            measured: row.measured.clone(),
            kind: row.kind.clone(),
            approach: row.approach.clone(),
            n: row.n,
            kpi: target.kpi.clone(),
            mean: prediction.mean.value,
            sd: prediction.sd.as_ref().map(|sd| sd.value),
            epistemic_sd: Some(prediction.epistemic_sd),
            unit: target.unit.clone(),
        };
        let targets = self.fitted(&chain.measured);
        Calibrated {
            optima: optima.collect(),
            draws: posterior.as_ref().map_or_else(Vec::new, |posterior| self.draws(&row, posterior)),
            summaries: posterior.as_ref().map_or_else(Vec::new, |posterior| self.summaries(&row, posterior)),
            predictions: targets.into_iter().zip(&calibration.predictions).map(prediction).collect(),
            calibration: CalibrationRow {
                objective: Some(calibration.value),
                starts_at_optimum: Some(calibration.agreeing as u32),
                flat_directions: flat.clone(),
                ..row
            },
        }
    }

    /// Positions spread evenly over the walk.
    fn draws(&self, row: &CalibrationRow, posterior: &Posterior) -> Vec<PosteriorRow> {
        let points = &posterior.sample.points;
        let step = points.len().div_ceil(DRAWS).max(1);
        let positions = (0..points.len()).step_by(step).map(|index| points.row(index));
        let of_draw = |(draw, x): (u32, &[f64])| {
            let one = |(parameter, u): (&Parameter, &f64)| PosteriorRow {
                measured: row.measured.clone(),
                kind: row.kind.clone(),
                approach: row.approach.clone(),
                n: row.n,
                draw,
                parameter: parameter.name.to_owned(),
                value: parameter.from_unit(*u),
                unit: parameter.unit.to_owned(),
            };
            self.context.config.parameters.iter().zip(x).map(one).collect::<Vec<_>>()
        };
        (1..).zip(positions).flat_map(of_draw).collect()
    }

    fn summaries(&self, row: &CalibrationRow, posterior: &Posterior) -> Vec<PosteriorSummaryRow> {
        let (parameters, correlations) = (&self.context.config.parameters, posterior.sample.correlations());
        let independent = posterior.sample.independent_draws();
        let one = |(index, (parameter, marginal)): (usize, (&Parameter, &Marginal))| {
            let others = (0..parameters.len()).filter(|other| *other != index);
            let known = others.map(|other| (other, correlations[index][other])).filter(|(_, c)| c.is_finite());
            let partner = known.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()).then(b.0.cmp(&a.0)));
            PosteriorSummaryRow {
                measured: row.measured.clone(),
                kind: row.kind.clone(),
                approach: row.approach.clone(),
                n: row.n,
                parameter: parameter.name.to_owned(),
                lower: parameter.from_unit(marginal.lower),
                median: parameter.from_unit(marginal.median),
                upper: parameter.from_unit(marginal.upper),
                relative_sd: marginal.sd * 12.0_f64.sqrt(),
                partner: partner.map(|(other, _)| parameters[other].name.to_owned()),
                correlation: partner.map(|(_, correlation)| correlation),
                acceptance: posterior.sample.acceptance,
                independent_draws: independent,
                unit: parameter.unit.to_owned(),
            }
        };
        parameters.iter().zip(&posterior.marginals).enumerate().map(one).collect()
    }
}
