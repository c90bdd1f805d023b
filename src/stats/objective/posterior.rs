//! The distribution of the parameters given the measurements, over the metamodels.
//!
//! ln p(x) = −½ Σ_k [(K_e − m(x))²/S + ln S] − ½ Σ priors ((x_d − μ)/σ)² within the unit cube, where
//! S = σ_Ke²/n_e + (epistemic sd of the metamodel)². In mode `mv` every KPI with at least ten measured repetitions adds
//! the row ln s: its bias ½(ψ(ν/2) − ln(ν/2)) is removed, its variance is ¼ψ₁(ν/2) plus that of the metamodel.
//! The eqs 10–13 weigh KPIs by convention; here they are weighed by what is known of them. Deliberately absent:
//! an error of the simulation model itself, which is the business of the diagnosis.

use super::{Mode, Prediction, Problem, Target};
use crate::stats::special::{digamma, trigamma};

/// Measured repetitions from which on a standard deviation enters: below, ln s is off by a quarter and far from normal.
const LEAST_COUNT_FOR_SD: usize = 10;

/// A measured quantity beside its prediction: difference, its variance, and the gradient of the prediction.
pub(super) struct Row {
    pub residual: f64,
    pub variance: f64,
    pub gradient: Vec<f64>,
}

/// Rows that one KPI contributes.
pub(super) fn rows(mode: Mode, target: &Target, prediction: &Prediction) -> Vec<Row> {
    let measured = target.sd * target.sd / target.count.max(1) as f64;
    let epistemic = prediction.epistemic_sd * prediction.epistemic_sd;
    // What neither scatters nor is uncertain is still known to rounding only.
    let rounding = 1e-24 * target.mean * target.mean + f64::MIN_POSITIVE;
    let mut rows = vec![Row {
        residual: target.mean - prediction.mean.value,
        variance: measured + epistemic + rounding,
        gradient: prediction.mean.gradient.clone(),
    }];
    if let Some(sd) = prediction.sd.as_ref().filter(|sd| sd.value > 0.0)
        && mode == Mode::MeanVariance
        && target.count >= LEAST_COUNT_FOR_SD
        && target.sd > 0.0
    {
        let half_dof = 0.5 * (target.count as f64 - 1.0);
        let unbiased = libm::log(target.sd) - 0.5 * (digamma(half_dof) - libm::log(half_dof));
        rows.push(Row {
            residual: unbiased - libm::log(sd.value),
            variance: 0.25 * trigamma(half_dof) + prediction.log_sd_error * prediction.log_sd_error,
            gradient: sd.gradient.iter().map(|slope| slope / sd.value).collect(),
        });
    }
    rows
}

impl Problem<'_> {
    /// ln p(x | measurements) up to a constant; −∞ outside the unit cube.
    pub fn log_posterior(&self, x: &[f64]) -> f64 {
        if x.iter().any(|value| !(0.0..=1.0).contains(value)) {
            return f64::NEG_INFINITY;
        }
        let mut sum = 0.0;
        for (target, prediction) in self.targets.iter().zip(self.predict(x)) {
            for row in rows(self.mode, target, &prediction) {
                sum += row.residual * row.residual / row.variance + libm::log(row.variance);
            }
        }
        for prior in &self.priors {
            sum += prior.deviation(x) * prior.deviation(x);
        }
        -0.5 * sum
    }
}
