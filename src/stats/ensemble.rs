//! Draws from a density over the unit cube of which only the logarithm is known, up to a constant, by an ensemble of walkers: half
//! of the moves are the stretches of Goodman & Weare (2010), half the steps of differential evolution (ter Braak 2006, Nelson, Ford &
//! Payne 2014), which also lead from one mode to another. No scaling or correlation of the coordinates slows either down.
//!
//! Takes ln p as a function, −∞ outside the cube, and where the walkers start; gives the positions of all walkers, marginals,
//! correlations, and how far the draws are independent. Random numbers are drawn in sequence and only densities are computed in
//! parallel: the same bits for any number of threads. Suited to a handful of coordinates.

use super::linalg::symmetric_eigen;
use super::optimise::Bounds;
use super::points::Points;
use crate::rng::Stream;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Stretch of a proposal, a of Goodman & Weare.
const STRETCH: f64 = 2.0;

/// Share of the steps that are as long as the way between two walkers, from mode to mode.
const LONG: f64 = 0.1;

/// How far below the best in ln p a walker is lost: with e⁻¹⁵ of the density a mode there counts only if the best one is narrower than
/// 3·10⁻⁷ of its volume.
const LOST: f64 = 15.0;

/// How long to walk. Of all sweeps the first three tenths are dropped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Length {
    /// Sweeps to begin with.
    pub sweeps: usize,
    /// Independent draws that are enough: as long as there are fewer the walk goes on until it is twice as long.
    pub draws: f64,
    /// Most times that it is doubled.
    pub doublings: usize,
}

/// A mean to a fourteenth of the standard deviation.
impl Default for Length {
    fn default() -> Self {
        Self { sweeps: 500, draws: 200.0, doublings: 4 }
    }
}

impl Length {
    /// Sweeps that are dropped of so many.
    fn burn_in(sweeps: usize) -> usize {
        sweeps * 3 / 10
    }
}

/// A number of walkers for `p` coordinates: 24, if that is enough.
pub fn walkers(p: usize) -> usize {
    24.max(2 * (p + 1))
}

/// A sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Positions of all walkers, sweep after sweep, shape (sweeps · walkers, n_parameters).
    pub points: Points,
    /// ln p of each position, up to a constant.
    pub ln_density: Vec<f64>,
    /// Share of proposals accepted; 0.2 to 0.7 is usual.
    pub acceptance: f64,
    /// Sweeps after which a walker has forgotten where it was, the largest over the parameters. The sample is worth
    /// sweeps · walkers over this many independent draws.
    pub autocorrelation_time: f64,
}

/// Samples a density from where the walkers stand, at least 2(p + 1) of them in p coordinates and an even number. They
/// must not lie in one plane. A walker in a far mode could stay there for good; half-way through the first burn-in and at its end those
/// that are lost begin anew where another stands (in the manner of Hou et al. 2012, who prune them).
///
/// # Panics
/// If the number of walkers is odd or below 2(p + 1).
pub fn sample(
    start: Vec<Vec<f64>>,
    ln_density: impl Fn(&[f64]) -> f64 + Sync,
    length: Length,
    stream: Stream,
) -> Sample {
    let (walkers, p) = (start.len(), start.first().map_or(0, Vec::len));
    assert!(walkers.is_multiple_of(2) && walkers / 2 > p, "an even number of walkers, at least 2(p + 1)");
    let values = start.iter().map(|position| ln_density(position)).collect();
    let mut walk = Walk { positions: start, values, stream };
    let mut history = History { walkers, points: Points::empty(p), ln_density: Vec::new(), accepted: Vec::new() };
    let (first_burn_in, mut doublings) = (Length::burn_in(length.sweeps), 0);
    loop {
        let sweeps = length.sweeps << doublings;
        while history.accepted.len() < sweeps {
            if [first_burn_in / 2, first_burn_in].contains(&history.accepted.len()) {
                walk.fetch_lost();
            }
            let accepted = walk.sweep(&ln_density, walkers / 2);
            history.record(&walk, accepted);
        }
        let sample = history.after(Length::burn_in(sweeps));
        if sample.independent_draws() >= length.draws || doublings == length.doublings {
            return sample;
        }
        doublings += 1;
    }
}

/// All sweeps of a walk.
struct History {
    walkers: usize,
    points: Points,
    ln_density: Vec<f64>,
    accepted: Vec<usize>,
}

impl History {
    fn record(&mut self, walk: &Walk, accepted: usize) {
        walk.positions.iter().for_each(|position| self.points.push(position));
        self.ln_density.extend_from_slice(&walk.values);
        self.accepted.push(accepted);
    }

    /// The sample that follows a burn-in.
    fn after(&self, burn_in: usize) -> Sample {
        let first = burn_in * self.walkers;
        let mut points = Points::empty(self.points.dimension());
        self.points.rows().skip(first).for_each(|row| points.push(row));
        let ln_density = self.ln_density[first..].to_vec();
        let accepted: usize = self.accepted[burn_in..].iter().sum();
        let acceptance = accepted as f64 / ln_density.len() as f64;
        let time = (0..points.dimension()).map(|d| autocorrelation_time(&points, self.walkers, d)).fold(1.0, f64::max);
        Sample { points, ln_density, acceptance, autocorrelation_time: time }
    }
}

/// Walkers all over the unit cube.
pub fn everywhere(p: usize, walkers: usize, stream: &mut Stream) -> Vec<Vec<f64>> {
    let bounds = Bounds::cube(p, 0.0, 1.0);
    (0..walkers).map(|_| bounds.draw(stream)).collect()
}

/// Walkers around a point, normal with the given standard deviations and thrown back at the faces of the cube.
pub fn around(centre: &[f64], sd: &[f64], walkers: usize, stream: &mut Stream) -> Vec<Vec<f64>> {
    let mut one = |(x, sd): (&f64, &f64)| {
        let place = (x + sd * stream.normal()).abs();
        (1.0 - (1.0 - place).abs()).clamp(0.0, 1.0)
    };
    (0..walkers).map(|_| centre.iter().zip(sd).map(&mut one).collect()).collect()
}

struct Walk {
    positions: Vec<Vec<f64>>,
    values: Vec<f64>,
    stream: Stream,
}

impl Walk {
    /// Moves every walker once, each half against the other; gives the number of accepted moves. The moves of a half do not
    /// depend on each other, so their densities are computed in parallel.
    fn sweep(&mut self, ln_density: &(impl Fn(&[f64]) -> f64 + Sync), half: usize) -> usize {
        let mut accepted = 0;
        for first in [0, half] {
            let moves: Vec<Move> = (first..first + half).map(|walker| self.propose(walker, half)).collect();
            let values: Vec<f64> = moves.par_iter().map(|proposed| ln_density(&proposed.position)).collect();
            for (walker, (proposed, value)) in (first..).zip(moves.into_iter().zip(values)) {
                if proposed.threshold < proposed.gain + value - self.values[walker] {
                    (self.positions[walker], self.values[walker]) = (proposed.position, value);
                    accepted += 1;
                }
            }
        }
        accepted
    }

    /// Puts every lost walker where one of the others stands.
    fn fetch_lost(&mut self) {
        let best = self.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (lost, kept): (Vec<usize>, Vec<usize>) =
            (0..self.values.len()).partition(|&walker| self.values[walker] < best - LOST);
        for walker in lost {
            let other = kept[self.stream.index(kept.len())];
            (self.positions[walker], self.values[walker]) = (self.positions[other].clone(), self.values[other]);
        }
    }

    /// A stretch or, as often, a step, either along walkers of the other half.
    fn propose(&mut self, walker: usize, half: usize) -> Move {
        let others = if walker < half { half..2 * half } else { 0..half };
        match self.stream.uniform() < 0.5 {
            true => self.stretch(walker, others),
            false => self.step(walker, others),
        }
    }

    /// A step by the difference of two others, scaled by 2.38/√(2p) or, now and then, as it is.
    fn step(&mut self, walker: usize, others: Range<usize>) -> Move {
        let number = others.len();
        let first = self.stream.index(number);
        let second = (first + 1 + self.stream.index(number - 1)) % number;
        let here = &self.positions[walker];
        let scale = if self.stream.uniform() < LONG { 1.0 } else { 2.38 / (2.0 * here.len() as f64).sqrt() };
        let threshold = libm::log(1.0 - self.stream.uniform());
        let (from, to) = (&self.positions[others.start + first], &self.positions[others.start + second]);
        let position = here.iter().zip(from.iter().zip(to)).map(|(x, (a, b))| x + scale * (b - a)).collect();
        Move { position, gain: 0.0, threshold }
    }

    /// A stretch along the line to another.
    fn stretch(&mut self, walker: usize, others: Range<usize>) -> Move {
        let other = others.start + self.stream.index(others.len());
        let root = (STRETCH - 1.0) * self.stream.uniform() + 1.0;
        let z = root * root / STRETCH;
        let threshold = libm::log(1.0 - self.stream.uniform());
        let (here, anchor) = (&self.positions[walker], &self.positions[other]);
        let position: Vec<f64> = here.iter().zip(anchor).map(|(x, a)| a + z * (x - a)).collect();
        let gain = (position.len() as f64 - 1.0) * libm::log(z);
        Move { position, gain, threshold }
    }
}

/// A proposed move: accepted where the threshold is below the gain and the growth of ln p together.
struct Move {
    position: Vec<f64>,
    gain: f64,
    threshold: f64,
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
    /// How many independent draws it is worth.
    pub fn independent_draws(&self) -> f64 {
        self.points.len() as f64 / self.autocorrelation_time
    }

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

    /// Covariance of the parameters, shape (n_parameters, n_parameters).
    pub fn covariance(&self) -> DMatrix<f64> {
        let (marginals, correlations) = (self.marginals(), self.correlations());
        let covariance = |i: usize, j: usize| match marginals[i].sd * marginals[j].sd {
            0.0 => 0.0,
            product => correlations[i][j] * product,
        };
        DMatrix::from_fn(marginals.len(), marginals.len(), covariance)
    }

    /// Steps of one standard deviation each whose squares add up to the covariance: along the principal axes of what the other
    /// parameters scatter where the last one is given, and last along the line on which they follow it.
    pub fn steps(&self) -> Vec<Vec<f64>> {
        let (line, covariance) = (self.line(), self.covariance());
        let last = line.len() - 1;
        let left = |i: usize, j: usize| covariance[(i, j)] - line[i] * line[j];
        let rows: Vec<Vec<f64>> = (0..last).map(|i| (0..last).map(|j| left(i, j)).collect()).collect();
        let step = |(variance, axis): (f64, Vec<f64>)| {
            axis.iter().map(|part| part * variance.max(0.0).sqrt()).chain([0.0]).collect()
        };
        symmetric_eigen(&rows).into_iter().map(step).chain([line]).collect()
    }

    /// The place `k` steps from the mean of all, within the unit cube.
    pub fn at(&self, step: &[f64], k: f64) -> Vec<f64> {
        self.means().zip(step).map(|(mean, step)| (mean + k * step).clamp(0.0, 1.0)).collect()
    }

    /// The place on the line on which the parameters follow the last one, `k` of its standard deviations from the mean of all and within the
    /// unit cube.
    pub fn along(&self, k: f64) -> Vec<f64> {
        self.at(&self.line(), k)
    }

    fn means(&self) -> impl Iterator<Item = f64> {
        self.marginals().into_iter().map(|marginal| marginal.mean)
    }

    /// A step on that line: one standard deviation of the last parameter with the mean change of all others over it. A last parameter
    /// that is the same in all draws has none.
    fn line(&self) -> Vec<f64> {
        let covariance = self.covariance();
        let last = covariance.nrows() - 1;
        let sd = covariance[(last, last)].sqrt();
        let step = |i: usize| if sd > 0.0 { covariance[(i, last)] / sd } else { 0.0 };
        (0..=last).map(step).collect()
    }

    /// The same draws, further apart by a factor for every one of [`Self::steps`], within the unit cube.
    #[must_use]
    pub fn stretched(&self, factors: &[f64]) -> Self {
        let (means, steps) = (self.means().collect::<Vec<f64>>(), self.steps());
        let Some((line, axes)) = steps.split_last() else { return self.clone() };
        let last = line.len() - 1;
        let mut points = Points::empty(means.len());
        for row in self.points.rows() {
            let off: Vec<f64> = row.iter().zip(&means).map(|(x, mean)| x - mean).collect();
            let on_line = ratio(off[last], line[last]);
            let across: Vec<f64> = off.iter().zip(line).map(|(off, step)| off - on_line * step).collect();
            let numbers = axes.iter().map(|axis| ratio(dot(&across, axis), dot(axis, axis))).chain([on_line]);
            let mut moved = row.to_vec();
            for ((step, number), factor) in steps.iter().zip(numbers).zip(factors) {
                for (x, step) in moved.iter_mut().zip(step) {
                    *x += (factor - 1.0) * number * step;
                }
            }
            points.push(&moved.iter().map(|x| x.clamp(0.0, 1.0)).collect::<Vec<f64>>());
        }
        Self { points, ..self.clone() }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// a/b, and nothing of a step that has no length.
fn ratio(a: f64, b: f64) -> f64 {
    if b == 0.0 { 0.0 } else { a / b }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A narrow normal ridge: sd 0.1 and 0.05, correlation 0.9.
    fn ridge(x: &[f64]) -> f64 {
        let (a, b) = ((x[0] - 0.4) / 0.1, (x[1] - 0.6) / 0.05);
        -0.5 * (a * a - 1.8 * a * b + b * b) / (1.0 - 0.81)
    }

    #[test]
    fn a_ridge_is_sampled_with_its_widths_and_its_correlation() {
        let mut stream = Stream::new(1, "ridge");
        let start = around(&[0.4, 0.6], &[0.1, 0.05], 24, &mut stream);
        let found = sample(start, ridge, Length { sweeps: 2200, draws: 0.0, doublings: 0 }, stream);
        // Independent draws: sweeps · walkers over the autocorrelation time, some 3000; five standard errors.
        assert!(found.autocorrelation_time < 40.0 && (0.2..0.9).contains(&found.acceptance), "{found:?}");
        for (marginal, (mean, sd)) in found.marginals().iter().zip([(0.4, 0.1), (0.6, 0.05)]) {
            assert!((marginal.mean - mean).abs() < 0.12 * sd && (marginal.sd / sd - 1.0).abs() < 0.1, "{marginal:?}");
            assert!((marginal.upper - marginal.lower - 3.92 * sd).abs() < 0.5 * sd, "{marginal:?}");
        }
        assert!((found.correlations()[0][1] - 0.9).abs() < 0.03);
        let covariance = found.covariance();
        assert!((covariance[(0, 1)] / 0.0045 - 1.0).abs() < 0.2 && covariance[(0, 1)] == covariance[(1, 0)]);
        assert_eq!(covariance[(1, 1)].sqrt(), found.marginals()[1].sd);
    }

    fn drawn<const P: usize>(rows: &[[f64; P]]) -> Sample {
        let points = Points::from_rows(rows, P).expect("rows of one length");
        Sample { points, ln_density: vec![0.0; rows.len()], acceptance: 0.5, autocorrelation_time: 1.0 }
    }

    /// A parameter that falls by twice what the last gains, and one that ignores it.
    #[test]
    fn the_line_is_that_on_which_parameters_follow_the_last() {
        let found = drawn(&[[0.6, 0.2, 0.4], [0.6, 0.4, 0.4], [0.2, 0.2, 0.6], [0.2, 0.4, 0.6]]);
        for (k, expected) in [(-2.0, [0.8, 0.3, 0.3]), (1.0, [0.2, 0.3, 0.6]), (3.0, [0.0, 0.3, 0.8])] {
            let place = found.along(k);
            assert!(place.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{k}: {place:?}");
        }
    }

    /// The first coordinate falls by twice what the last gains, and scatters by 0.05 about that.
    #[test]
    fn draws_are_stretched_along_their_line_and_across_it() {
        let found = drawn(&[[0.75, 0.4], [0.65, 0.4], [0.35, 0.6], [0.25, 0.6]]);
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        for (k, expected) in [(0.0, [0.5, 0.5]), (1.0, [0.3, 0.6]), (-2.0, [0.9, 0.3]), (9.0, [0.0, 1.0])] {
            assert!(close(&found.along(k), &expected), "{:?}", found.along(k));
        }
        for (factors, expected) in [
            ([1.0, 1.5], [[0.85, 0.35], [0.75, 0.35], [0.25, 0.65], [0.15, 0.65]]),
            ([2.0, 1.0], [[0.8, 0.4], [0.6, 0.4], [0.4, 0.6], [0.2, 0.6]]),
        ] {
            let wide = found.stretched(&factors);
            assert!(wide.points.rows().zip(expected).all(|(row, expected)| close(row, &expected)), "{wide:?}");
        }
        assert!(found.stretched(&[50.0, 50.0]).points.rows().flatten().all(|x| (0.0..=1.0).contains(x)));
        let level = drawn(&[[0.25, 0.5], [0.5, 0.5]]);
        assert_eq!(level.stretched(&[1.0, 2.0]), level);
        assert_eq!(level.stretched(&[2.0, 2.0]), drawn(&[[0.125, 0.5], [0.625, 0.5]]));
    }

    /// Two parameters that scatter askew about a line, one of them following the last.
    #[test]
    fn steps_add_up_to_the_covariance_and_only_the_last_moves_the_last() {
        let mut stream = Stream::new(5, "steps");
        let row = |stream: &mut Stream| {
            let [a, b, c] = [0.08, 0.03, 0.05].map(|sd| sd * stream.normal());
            [0.5 + (a + b) * 0.6 + 2.0 * c, 0.5 + (a - b) * 0.8, 0.5 + c]
        };
        let found = drawn(&(0..500).map(|_| row(&mut stream)).collect::<Vec<_>>());
        let (steps, covariance) = (found.steps(), found.covariance());
        assert!(steps[..2].iter().all(|step| step[2] == 0.0) && steps[2] == found.line());
        assert!(dot(&steps[0], &steps[1]).abs() < 1e-12, "{steps:?}");
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            let sum: f64 = steps.iter().map(|step| step[i] * step[j]).sum();
            assert!((sum - covariance[(i, j)]).abs() < 1e-12, "{i} {j}: {sum} {}", covariance[(i, j)]);
        }
    }

    /// The same walk: only its length depends on how many draws are asked for, and it stops at the first that is enough.
    #[test]
    fn a_walk_goes_on_until_there_are_enough_independent_draws() {
        let walk = |draws: f64, doublings: usize| {
            let mut stream = Stream::new(1, "ridge");
            let start = around(&[0.4, 0.6], &[0.1, 0.05], 24, &mut stream);
            sample(start, ridge, Length { sweeps: 100, draws, doublings }, stream)
        };
        let (short, long, longest) = (walk(0.0, 4), walk(400.0, 8), walk(f64::INFINITY, 2));
        assert_eq!((short.points.len(), longest.points.len()), (70 * 24, 280 * 24));
        assert!(short.independent_draws() < 400.0 && long.independent_draws() >= 400.0);
        assert_eq!(long.points.len() % (70 * 24), 0);
        let before = walk(f64::INFINITY, (long.points.len() / (70 * 24)).ilog2() as usize - 1);
        assert!(before.independent_draws() < 400.0, "half of it would have been enough");
    }

    /// The ridge and a second mode in a corner, 55 lower in ln p; half-way between, as far as a move leads, it is 70 lower.
    fn with_a_trap(x: &[f64]) -> f64 {
        let (a, b) = ((x[0] - 0.05) / 0.03, (x[1] - 0.95) / 0.03);
        ridge(x).max(-55.0 - 0.5 * (a * a + b * b))
    }

    #[test]
    fn a_walker_lost_in_a_mode_without_weight_comes_back() {
        let mut stream = Stream::new(3, "trap");
        let mut start = around(&[0.4, 0.6], &[0.1, 0.05], 22, &mut stream);
        start.extend([vec![0.05, 0.96], vec![0.04, 0.95]]);
        let found = sample(start, with_a_trap, Length { sweeps: 2200, draws: 0.0, doublings: 0 }, stream);
        assert!(found.ln_density.iter().all(|&value| value > -LOST), "a walker is still in the trap");
        for (marginal, (mean, sd)) in found.marginals().iter().zip([(0.4, 0.1), (0.6, 0.05)]) {
            assert!((marginal.mean - mean).abs() < 0.12 * sd && (marginal.sd / sd - 1.0).abs() < 0.1, "{marginal:?}");
        }
    }

    /// Two narrow modes, one three times as heavy as the other; all walkers start in the light one but for two.
    #[test]
    fn modes_far_apart_have_their_share() {
        let mode = |x: &[f64], centre: f64| -0.5 * x.iter().map(|x| (x - centre) * (x - centre)).sum::<f64>() / 0.0009;
        let density = |x: &[f64]| libm::log(0.75 * libm::exp(mode(x, 0.2)) + 0.25 * libm::exp(mode(x, 0.8)));
        let mut stream = Stream::new(4, "modes");
        let mut start = around(&[0.8, 0.8], &[0.03, 0.03], 22, &mut stream);
        start.extend([vec![0.2, 0.21], vec![0.19, 0.2]]);
        let found = sample(start, density, Length { draws: 400.0, ..Length::default() }, stream);
        let share = found.points.rows().filter(|x| x[0] < 0.5).count() as f64 / found.points.len() as f64;
        let error = (0.75 * 0.25 / found.independent_draws()).sqrt();
        assert!(found.independent_draws() > 400.0 && (share - 0.75).abs() < 3.0 * error, "{share} ± {error}");
    }

    #[test]
    fn walkers_start_inside_the_cube_and_not_in_one_plane() {
        let mut stream = Stream::new(2, "start");
        let walkers = around(&[0.0, 0.99, 0.5], &[0.02, 0.3, 5.0], 200, &mut stream);
        assert!(walkers.iter().flatten().all(|x| (0.0..=1.0).contains(x)));
        let near = walkers.iter().filter(|walker| walker[0] > 0.0 && walker[0] < 0.1).count();
        assert!(near > 190, "{near} of 200 beside the face they start from");
    }
}
