//! The distribution of the parameters given the measurements, by ensemble sampling over the metamodels.
//!
//! ln p(x) = −½ Σ_k [(K_e − m(x))²/S + ln S] − ½ Σ priors ((x_d − μ)/σ)² within the unit cube, where
//! S = σ_Ke²/n_e + (epistemic sd of the metamodel)². In mode `mv` every KPI with at least ten measured repetitions adds
//! the row ln s: its bias ½(ψ(ν/2) − ln(ν/2)) is removed, its variance is ¼ψ₁(ν/2) plus that of the metamodel.
//! The eqs 10–13 weigh KPIs by convention; here they are weighed by what is known of them. Deliberately absent:
//! an error of the simulation model itself, which is the business of the diagnosis.

use super::{Mode, Prediction, Problem, Target};
use crate::rng::Stream;
use crate::stats::optimise::Bounds;
use crate::stats::points::Points;
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

/// Length of a sampling run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Seed of the walk.
    pub seed: u64,
    /// Number of walkers, even and at least twice the number of parameters plus two.
    pub walkers: usize,
    /// Sweeps that are dropped.
    pub burn_in: usize,
    /// Sweeps that are kept.
    pub sweeps: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { seed: 0, walkers: 32, burn_in: 300, sweeps: 1000 }
    }
}

/// A sample of the posterior.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Positions of all walkers, sweep after sweep, shape (sweeps · walkers, n_parameters).
    pub points: Points,
    /// ln p of each position, up to a constant.
    pub log_posterior: Vec<f64>,
    /// Share of proposals accepted; 0.2 to 0.7 is usual.
    pub acceptance: f64,
    /// Sweeps after which a walker has forgotten where it was, the largest over the parameters. The sample is worth
    /// sweeps · walkers over this many independent draws; keep sweeps above fifty times of it.
    pub autocorrelation_time: f64,
}

/// Stretch of a proposal, a of Goodman & Weare.
const STRETCH: f64 = 2.0;

/// Samples the posterior by the affine-invariant ensemble of Goodman & Weare (2010), in sequence and thus reproducibly.
///
/// # Panics
/// If the number of walkers is odd or below 2(p + 1).
pub fn sample(problem: &Problem, sampling: &Sampling) -> Sample {
    let (p, half) = (problem.dimension(), sampling.walkers / 2);
    assert!(sampling.walkers.is_multiple_of(2) && half > p, "an even number of walkers, at least 2(p + 1)");
    let mut walk = Walk::start(problem, sampling);
    let mut points = Points::empty(p);
    let mut log_posterior = Vec::with_capacity(sampling.sweeps * sampling.walkers);
    let mut accepted = 0;
    for sweep in 0..sampling.burn_in + sampling.sweeps {
        let moved = walk.sweep(problem, half);
        if sweep >= sampling.burn_in {
            accepted += moved;
            walk.positions.iter().for_each(|position| points.push(position));
            log_posterior.extend_from_slice(&walk.values);
        }
    }
    let acceptance = accepted as f64 / log_posterior.len() as f64;
    let time = (0..p).map(|d| autocorrelation_time(&points, sampling.walkers, d)).fold(1.0, f64::max);
    Sample { points, log_posterior, acceptance, autocorrelation_time: time }
}

struct Walk {
    positions: Vec<Vec<f64>>,
    values: Vec<f64>,
    stream: Stream,
}

impl Walk {
    fn start(problem: &Problem, sampling: &Sampling) -> Self {
        let mut stream = Stream::new(sampling.seed, "posterior walkers");
        let bounds = Bounds::cube(problem.dimension(), 0.0, 1.0);
        let positions: Vec<_> = (0..sampling.walkers).map(|_| bounds.draw(&mut stream)).collect();
        let values = positions.iter().map(|position| problem.log_posterior(position)).collect();
        Self { positions, values, stream }
    }

    /// Moves every walker once, each half against the other; gives the number of accepted moves.
    fn sweep(&mut self, problem: &Problem, half: usize) -> usize {
        (0..2 * half).filter(|&walker| self.move_one(problem, walker, half)).count()
    }

    fn move_one(&mut self, problem: &Problem, walker: usize, half: usize) -> bool {
        let other = self.stream.index(half) + if walker < half { half } else { 0 };
        let root = (STRETCH - 1.0) * self.stream.uniform() + 1.0;
        let z = root * root / STRETCH;
        let threshold = libm::log(1.0 - self.stream.uniform());
        let (here, anchor) = (&self.positions[walker], &self.positions[other]);
        let proposal: Vec<f64> = here.iter().zip(anchor).map(|(x, a)| a + z * (x - a)).collect();
        let value = problem.log_posterior(&proposal);
        let gain = (problem.dimension() as f64 - 1.0) * libm::log(z) + value - self.values[walker];
        let accept = threshold < gain;
        if accept {
            self.positions[walker] = proposal;
            self.values[walker] = value;
        }
        accept
    }
}

/// Integrated autocorrelation time of parameter `d`, averaged over walkers, by Sokal's window of five times itself.
fn autocorrelation_time(points: &Points, walkers: usize, d: usize) -> f64 {
    let sweeps = points.len() / walkers;
    let value = |sweep: usize, walker: usize| points.row(sweep * walkers + walker)[d];
    let mean = points.rows().map(|row| row[d]).sum::<f64>() / points.len() as f64;
    let covariance = |lag: usize| -> f64 {
        let product = |s: usize, w: usize| (value(s, w) - mean) * (value(s + lag, w) - mean);
        (0..sweeps - lag).map(|s| (0..walkers).map(|w| product(s, w)).sum::<f64>()).sum::<f64>() / (sweeps - lag) as f64
    };
    let variance = covariance(0);
    let mut time = 1.0;
    for lag in 1..sweeps {
        if variance <= 0.0 || lag as f64 >= 5.0 * time {
            break;
        }
        time += 2.0 * covariance(lag) / variance;
    }
    time
}

/// Marginal distribution of one parameter, in the unit cube.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marginal {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
    /// 2.5 % quantile.
    pub lower: f64,
    /// Median.
    pub median: f64,
    /// 97.5 % quantile.
    pub upper: f64,
}

impl Sample {
    /// Marginal of every parameter.
    pub fn marginals(&self) -> Vec<Marginal> {
        (0..self.points.dimension()).map(|d| self.marginal(d)).collect()
    }

    fn marginal(&self, d: usize) -> Marginal {
        let mut values: Vec<f64> = self.points.rows().map(|row| row[d]).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / n;
        let quantile = |share: f64| values[((share * n) as usize).min(values.len() - 1)];
        let (lower, median, upper) = (quantile(0.025), quantile(0.5), quantile(0.975));
        Marginal { mean, sd: variance.sqrt(), lower, median, upper }
    }

    /// Correlation of every pair of parameters, shape (n_parameters, n_parameters).
    pub fn correlations(&self) -> Vec<Vec<f64>> {
        let marginals = self.marginals();
        let n = self.points.len() as f64;
        let pair = |i: usize, j: usize| {
            let product = |row: &[f64]| (row[i] - marginals[i].mean) * (row[j] - marginals[j].mean);
            self.points.rows().map(product).sum::<f64>() / (n * marginals[i].sd * marginals[j].sd)
        };
        let p = marginals.len();
        (0..p).map(|i| (0..p).map(|j| if i == j { 1.0 } else { pair(i, j) }).collect()).collect()
    }
}
