//! Calibration: the objectives of the paper (eqs 10–13) over metamodels, their minimum, and what the data leave open.
//!
//! Takes metamodels of the KPIs, measured mean, sd and count of each, and optional measured values of parameters;
//! gives the best point of the unit cube with the value of every term. [`posterior`] gives the distribution of the
//! parameters and [`identifiability`] the directions that the data do not fix. Deliberately knows nothing of
//! parameter names, units and of the simulation behind the metamodels.

pub mod identifiability;
pub mod posterior;

use super::metamodel::{Metamodel, Prediction};
use super::naming::named;
use super::optimise::{Bounds, Objective, Starts, Stopping, multi_start};

/// What is matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mode {
    /// Means only (eqs 10, 11).
    Mean,
    /// Means and mean ± sd (eqs 10–13).
    MeanVariance,
}

named!(Mode, "mode of calibration", Mean => "m", MeanVariance => "mv");

/// A measured KPI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Measured mean K_e, in the unit of the KPI.
    pub mean: f64,
    /// Measured standard deviation σ_Ke between repetitions (n − 1); 0 where it is not known.
    pub sd: f64,
    /// Number of measured repetitions; below 2 mode `mv` is refused.
    pub count: usize,
    /// Weight w of the mean in eqs 11–13; 1 in the paper.
    pub weight: f64,
}

/// A parameter that was measured by itself, in coordinates of the unit cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Zero-based parameter.
    pub parameter: usize,
    /// Its measured mean; may lie outside [0, 1], where the bounds of the study exclude it.
    pub mean: f64,
    /// Standard deviation of that mean.
    pub sd: f64,
    /// The same over the measured mean, both in physical units: turns a deviation into the relative one of eq. 11.
    pub relative_sd: f64,
    /// Weight of the term in eqs 10–13; 0 leaves the paper's objective as it is.
    pub weight: f64,
}

impl Prior {
    /// Prior from `count` measurements with the given mean and sd, for a parameter between `lower` and `upper`.
    pub fn measured(parameter: usize, mean: f64, sd: f64, count: usize, (lower, upper): (f64, f64)) -> Self {
        let (width, standard_error) = (upper - lower, sd / (count as f64).sqrt());
        Self {
            parameter,
            mean: (mean - lower) / width,
            sd: standard_error / width,
            relative_sd: standard_error / mean.abs(),
            weight: 1.0,
        }
    }

    /// Distance of `x` from the measured mean, in standard deviations.
    fn deviation(&self, x: &[f64]) -> f64 {
        (x[self.parameter] - self.mean) / self.sd
    }
}

/// Targets and metamodels that do not make an objective.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ObjectiveError {
    /// Not one target per metamodel, or none at all.
    #[error("{models} metamodels come with {targets} targets; give one target per metamodel and at least one")]
    Shape {
        /// Number of metamodels.
        models: usize,
        /// Number of targets.
        targets: usize,
    },
    /// Metamodels over different parameters.
    #[error("metamodel {index} has {found} parameters, the first has {expected}; train all on the same parameters")]
    Dimension {
        /// Zero-based metamodel.
        index: usize,
        /// Parameters it has.
        found: usize,
        /// Parameters of the first.
        expected: usize,
    },
    /// A measured value of zero (or mean equal to sd) cannot be divided by.
    #[error("target {index} is zero where eqs 11 to 13 divide by it; leave this KPI out of the calibration")]
    ZeroTarget {
        /// Zero-based target.
        index: usize,
    },
    /// Mean-variance calibration without a standard deviation.
    #[error("target or metamodel {index} has no standard deviation, which mode `mv` needs; use mode `m` or repeat")]
    NoScatter {
        /// Zero-based target.
        index: usize,
    },
    /// A prior for a parameter that does not exist or with a useless sd.
    #[error("prior {index} names no parameter or has an sd that is not positive")]
    BadPrior {
        /// Zero-based prior.
        index: usize,
    },
}

/// Metamodels and targets that fit together, checked once.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    models: Vec<&'a Metamodel>,
    targets: Vec<Target>,
    priors: Vec<Prior>,
    mode: Mode,
    dimension: usize,
}

impl<'a> Problem<'a> {
    /// One target per metamodel, all over the same parameters.
    ///
    /// # Errors
    /// [`ObjectiveError`] where they do not fit together.
    pub fn new(
        models: Vec<&'a Metamodel>,
        targets: Vec<Target>,
        priors: Vec<Prior>,
        mode: Mode,
    ) -> Result<Self, ObjectiveError> {
        let shape = ObjectiveError::Shape { models: models.len(), targets: targets.len() };
        let Some(first) = models.first().filter(|_| models.len() == targets.len()) else { return Err(shape) };
        let expected = first.dimension();
        if let Some(index) = models.iter().position(|model| model.dimension() != expected) {
            return Err(ObjectiveError::Dimension { index, found: models[index].dimension(), expected });
        }
        let good = |prior: &Prior| prior.parameter < expected && prior.sd > 0.0;
        if let Some(index) = priors.iter().position(|prior| !good(prior)) {
            return Err(ObjectiveError::BadPrior { index });
        }
        let centre = vec![0.5; expected];
        let silent = |index: &usize| targets[*index].count < 2 || models[*index].predict(&centre).sd.is_none();
        if mode == Mode::MeanVariance
            && let Some(index) = (0..models.len()).find(silent)
        {
            return Err(ObjectiveError::NoScatter { index });
        }
        Ok(Self { models, targets, priors, mode, dimension: expected })
    }

    /// Number of parameters.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Predictions of every metamodel at `x`.
    pub fn predict(&self, x: &[f64]) -> Vec<Prediction> {
        self.models.iter().map(|model| model.predict(x)).collect()
    }
}

/// The sum of eqs 10–13.
#[derive(Debug, Clone)]
pub struct CalibrationObjective<'a> {
    problem: Problem<'a>,
    scatter_weight: f64,
}

/// Contribution of one KPI to c(x).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Terms {
    /// Eq. 11.
    pub mean: f64,
    /// Eq. 12, with its weight; 0 in mode `m`.
    pub mean_plus_sd: f64,
    /// Eq. 13, with its weight; 0 in mode `m`.
    pub mean_minus_sd: f64,
}

impl<'a> CalibrationObjective<'a> {
    /// The paper's objective; `scatter_weight` is its C (0.5), which multiplies the terms of mean ± sd.
    ///
    /// # Errors
    /// [`ObjectiveError::ZeroTarget`] where a term would divide by zero.
    pub fn new(problem: Problem<'a>, scatter_weight: f64) -> Result<Self, ObjectiveError> {
        let with_sd = problem.mode == Mode::MeanVariance;
        let zero = |target: &Target| {
            target.mean == 0.0 || with_sd && (target.mean + target.sd == 0.0 || target.mean - target.sd == 0.0)
        };
        match problem.targets.iter().position(zero) {
            Some(index) => Err(ObjectiveError::ZeroTarget { index }),
            None => Ok(Self { problem, scatter_weight }),
        }
    }

    /// Every KPI's contribution at `x`.
    pub fn terms(&self, x: &[f64]) -> Vec<Terms> {
        let mut gradient = vec![0.0; x.len()];
        self.problem.targets.iter().zip(self.problem.predict(x)).map(|(t, p)| self.add(t, &p, &mut gradient)).collect()
    }

    /// Terms of one KPI; their gradient is added to `gradient`.
    fn add(&self, target: &Target, prediction: &Prediction, gradient: &mut [f64]) -> Terms {
        let mut term = |weight: f64, sign: f64| {
            let none = (0.0, None);
            let (sd, slopes) = prediction.sd.as_ref().map_or(none, |sd| (sd.value, Some(&sd.gradient)));
            let measured = target.mean + sign * target.sd;
            let deviation = (measured - prediction.mean.value - sign * sd) / measured;
            let factor = -2.0 * weight * deviation / measured;
            for (d, slot) in gradient.iter_mut().enumerate() {
                let of_sd = slopes.map_or(0.0, |slopes| slopes[d]);
                *slot += factor * (prediction.mean.gradient[d] + sign * of_sd);
            }
            weight * deviation * deviation
        };
        let mean = term(target.weight, 0.0);
        if self.problem.mode == Mode::Mean {
            return Terms { mean, ..Terms::default() };
        }
        let weight = target.weight * self.scatter_weight;
        Terms { mean, mean_plus_sd: term(weight, 1.0), mean_minus_sd: term(weight, -1.0) }
    }

    /// w ((x_d − measured)/measured)² of every prior, in physical units; their gradient is added to `gradient`.
    fn prior_terms(&self, x: &[f64], gradient: &mut [f64]) -> f64 {
        let mut sum = 0.0;
        for prior in &self.problem.priors {
            let relative = prior.deviation(x) * prior.relative_sd;
            sum += prior.weight * relative * relative;
            gradient[prior.parameter] += 2.0 * prior.weight * relative * prior.relative_sd / prior.sd;
        }
        sum
    }
}

impl Objective for CalibrationObjective<'_> {
    fn dimension(&self) -> usize {
        self.problem.dimension
    }

    fn value(&self, x: &[f64]) -> f64 {
        self.value_and_gradient(x).0
    }

    fn value_and_gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
        let mut gradient = vec![0.0; x.len()];
        let mut value = self.prior_terms(x, &mut gradient);
        for (target, prediction) in self.problem.targets.iter().zip(self.problem.predict(x)) {
            let terms = self.add(target, &prediction, &mut gradient);
            value += terms.mean + terms.mean_plus_sd + terms.mean_minus_sd;
        }
        (value, gradient)
    }
}

/// A calibrated point.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Best point, in the unit cube.
    pub x: Vec<f64>,
    /// c(x), eq. 10.
    pub value: f64,
    /// Contribution of every KPI.
    pub terms: Vec<Terms>,
    /// Prediction of every KPI.
    pub predictions: Vec<Prediction>,
    /// Whether a parameter lies on a bound.
    pub at_bound: Vec<bool>,
    /// Descents made.
    pub descents: usize,
    /// Descents that ended at practically the same value.
    pub agreeing: usize,
    /// Per parameter the range over the agreeing end points: wide where the objective is flat.
    pub spread: Vec<f64>,
}

/// Descents that end within this much of the best c, absolute plus relative, agree: 10⁻⁸ is a deviation of 0.01 %.
const AGREEMENT: (f64, f64) = (1e-8, 1e-3);

/// Minimises the objective over the unit cube from many starts.
pub fn calibrate(objective: &CalibrationObjective, starts: &Starts) -> Calibration {
    let bounds = Bounds::cube(objective.problem.dimension, 0.0, 1.0);
    // c is a sum of squares of small deviations: the usual stop at a gradient of 1e-9 would leave digits on the table.
    let stopping = Stopping { gradient: 1e-12, ..Stopping::default() };
    let search = multi_start(objective, &bounds, starts, &stopping);
    let limit = search.best.value + AGREEMENT.0 + AGREEMENT.1 * search.best.value;
    let ends: Vec<&[f64]> = search.minima.iter().filter(|m| m.value <= limit).map(|m| m.x.as_slice()).collect();
    let range = |d: usize| {
        let of = |pick: fn(f64, f64) -> f64, from: f64| ends.iter().map(|x| x[d]).fold(from, pick);
        of(f64::max, f64::NEG_INFINITY) - of(f64::min, f64::INFINITY)
    };
    Calibration {
        value: search.best.value,
        terms: objective.terms(&search.best.x),
        predictions: objective.problem.predict(&search.best.x),
        at_bound: search.best.active.clone(),
        descents: search.minima.len(),
        agreeing: ends.len(),
        spread: (0..search.best.x.len()).map(range).collect(),
        x: search.best.x,
    }
}

#[cfg(test)]
mod tests;
