//! Controls: the model's own offset, seen in data that are known to hold no effect.
//!
//! A model of another engine, another resolution or an apparatus with a fault of its own misses even data without an
//! effect. What it leaves of such a data set after calibration, y_c − f(θ̂_c), is its offset; taken off the data of the
//! same origin, with its covariance, it leaves what an effect must explain. Of several controls the mean is taken, and how
//! they differ beyond their noise tells how far the offset depends on θ: the same as a nuisance per statistic with
//! that variance (SCIENCE.md, section 5, coarse models).

use super::direct;
use super::evidence::statistic;
use super::lab::Lab;
use super::moments::{Batch, Moment, Statistic};
use super::verdict::{Case, attributed, options};
use crate::config::Measured;
use crate::stages::StageError;
use crate::stats::special::trigamma;
use crate::stats::summary::{ln_sd, mean, sd};
use nalgebra::{DMatrix, DVector};

/// What the model misses of one control.
#[derive(Debug, Clone)]
pub struct Control {
    /// Name of the data set.
    name: String,
    statistics: Vec<Statistic>,
    /// Measured less simulated (n_statistics).
    residual: DVector<f64>,
    /// Its covariance.
    covariance: DMatrix<f64>,
    /// p-value of "no detectable discrepancy".
    p: f64,
}

/// What is taken off the data of a set.
#[derive(Debug, Clone)]
pub struct Offset {
    statistics: Vec<Statistic>,
    values: DVector<f64>,
    covariance: DMatrix<f64>,
    /// Names and p-values of the controls behind it.
    sources: Vec<(String, f64)>,
}

impl Control {
    /// What is left of a calibrated control; of the held-out experiment too, where the control measured it.
    pub fn new(case: &Case, lab: &mut Lab) -> Result<Self, StageError> {
        let p = attributed(case, Vec::new(), Vec::new(), options(case))?.t0_p;
        let mut control = Self {
            name: case.set.name.clone(),
            statistics: case.evidence.statistics.clone(),
            residual: case.residual(),
            covariance: case.covariance(),
            p,
        };
        let validate = case.context.config.validate.experiment.name();
        if case.set.statistics().iter().any(|summary| summary.experiment == validate) {
            let label = format!("{}/control", case.set.name);
            let runs = direct::held_out(case.context, lab, label, &case.optimum, &[])?;
            control.hold_out(case.set, validate, &runs);
        }
        Ok(control)
    }

    /// Adds the statistics of an experiment that was not fitted, each for itself.
    fn hold_out(&mut self, set: &Measured, experiment: &str, runs: &Batch) {
        for summary in set.statistics().iter().filter(|summary| summary.experiment == experiment) {
            for moment in [Moment::Mean, Moment::LnSd] {
                let statistic = statistic(summary, moment);
                let values: Vec<f64> =
                    runs.series(&statistic).map(|s| s.values().copied().collect()).unwrap_or_default();
                if values.len() >= 2 && sd(&values) > 0.0 && summary.sd > 0.0 {
                    let measured = known(moment, summary.mean, summary.sd, summary.n as usize);
                    let simulated = known(moment, mean(&values), sd(&values), values.len());
                    self.add(statistic, measured.0 - simulated.0, measured.1 + simulated.1);
                }
            }
        }
    }

    fn add(&mut self, statistic: Statistic, residual: f64, variance: f64) {
        let m = self.statistics.len();
        self.statistics.push(statistic);
        self.residual = self.residual.clone().push(residual);
        self.covariance = self.covariance.clone().resize(m + 1, m + 1, 0.0);
        self.covariance[(m, m)] = variance;
    }

    fn of(&self, statistics: &[Statistic]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        select(&self.statistics, &self.residual, &self.covariance, statistics)
    }
}

/// A mean or a bias-corrected ln s with its variance, of n normal values.
pub fn known(moment: Moment, mean: f64, sd: f64, n: usize) -> (f64, f64) {
    match moment {
        Moment::LnSd => (ln_sd(sd, n).value, 0.25 * trigamma(0.5 * (n as f64 - 1.0))),
        Moment::Mean | Moment::Trend => (mean, sd * sd / n as f64),
    }
}

impl Offset {
    /// The mean offset of the statistics that all controls have. Its covariance is that of the mean, and on the diagonal
    /// (1 + 1/m) times the variance between m controls that their noise does not explain.
    pub fn of(controls: &[&Control]) -> Option<Self> {
        let (first, m) = (controls.first()?, controls.len() as f64);
        let everywhere = |statistic: &&Statistic| controls.iter().all(|control| control.statistics.contains(statistic));
        let statistics: Vec<Statistic> = first.statistics.iter().filter(everywhere).cloned().collect();
        let own: Vec<_> = controls.iter().filter_map(|control| control.of(&statistics)).collect();
        let zero = (DVector::zeros(statistics.len()), DMatrix::zeros(statistics.len(), statistics.len()));
        let (sum, noise) = own.iter().fold(zero, |(sum, noise), (r, c)| (sum + r, noise + c));
        let values = sum / m;
        let mut covariance = &noise / (m * m);
        for i in 0..statistics.len() {
            let squares: f64 = own.iter().map(|(r, _)| (r[i] - values[i]) * (r[i] - values[i])).sum();
            let between = if controls.len() < 2 { 0.0 } else { squares / (m - 1.0) - noise[(i, i)] / m };
            covariance[(i, i)] += (1.0 + 1.0 / m) * between.max(0.0);
        }
        let sources = controls.iter().map(|control| (control.name.clone(), control.p)).collect();
        Some(Self { statistics, values, covariance, sources })
    }

    /// Offset and covariance of `statistics`; `None` where one of them has none.
    pub fn restricted(&self, statistics: &[Statistic]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        select(&self.statistics, &self.values, &self.covariance, statistics)
    }

    /// Offset and variance of one statistic.
    pub fn one(&self, statistic: &Statistic) -> Option<(f64, f64)> {
        let i = self.statistics.iter().position(|known| known == statistic)?;
        Some((self.values[i], self.covariance[(i, i)]))
    }

    /// A sentence about the controls.
    pub fn sentence(&self) -> String {
        let one = |(name, p): &(String, f64)| format!("{name} (p = {p:.3} by itself)");
        let names = self.sources.iter().map(one).collect::<Vec<_>>().join(", ");
        let alone = if self.sources.len() == 1 { ", and as if it were the same at all parameters" } else { "" };
        format!("the model's own offset was taken off as seen in {names}{alone}")
    }
}

/// Values and covariance of the `wanted` among the `known` statistics; `None` where one is missing.
fn select(
    known: &[Statistic],
    values: &DVector<f64>,
    covariance: &DMatrix<f64>,
    wanted: &[Statistic],
) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let place = |statistic: &Statistic| known.iter().position(|other| other == statistic);
    let places = wanted.iter().map(place).collect::<Option<Vec<usize>>>()?;
    Some((values.select_rows(&places), covariance.select_rows(&places).select_columns(&places)))
}
