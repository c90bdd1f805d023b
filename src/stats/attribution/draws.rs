//! Parametric draws: critical values, family-wise p-values and the detection limit η₉₀.
//!
//! Takes a [`Machine`] and the noise of a problem; gives distributions of its statistics under "no effect" and under
//! one effect at a given strength. A drawn residual carries the noise of every row (heavier than normal where Σ was
//! estimated from few repetitions), the shift of the effect, and the error of its signature. There are two such worlds: the one that
//! an effect is judged by, whose leftovers give critical values, and the one in which it would be met, whose detections give η₉₀.
//! Every purpose has its own random stream; strengths of one search share it, so that the detection probability varies smoothly
//! with the strength.

use super::effect::{Curve, Size};
use super::judge::{Critical, Found, Machine, Seen};
use super::noise::{Noise, tail_ratio};
use super::outcome::DetectionLimit;
use crate::rng::Stream;
use crate::stats::special;
use nalgebra::{DMatrix, DVector};

/// Growth of the strength while the search for η₉₀ has not reached its power.
const GROWTH: f64 = 1.5;
/// Halvings of the last bracket: η₉₀ is then known to about 1 %.
const HALVINGS: usize = 5;

/// A world in which one effect acts: its whitened shift per unit and the square root of its covariance.
pub(super) struct World {
    curve: Curve,
    /// Shrinks the shift by what its own error adds to its size.
    shrink: f64,
    root: Option<DMatrix<f64>>,
    /// A strength, and how the covariance of the whitened noise differs from I there.
    scatter: Option<(f64, DMatrix<f64>)>,
}

impl World {
    /// The true signature is taken to be smaller than `curve` by what its own error adds to the `size` of the one it is judged by.
    pub(super) fn new(curve: &Curve, error: &DMatrix<f64>, size: Size, scatter: Option<(f64, DMatrix<f64>)>) -> Self {
        let shrink = size.own_share().sqrt();
        let root = error.iter().any(|x| *x != 0.0).then(|| {
            let eigen = error.clone().symmetric_eigen();
            let sizes = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
            eigen.eigenvectors * DMatrix::from_diagonal(&sizes)
        });
        Self { curve: curve.clone(), shrink, root, scatter }
    }

    /// What the effect does to a whitened residual at a strength.
    pub(super) fn shift(&self, strength: f64) -> DVector<f64> {
        DVector::from_vec(self.curve.secant(strength)) * (strength * self.shrink)
    }

    /// One whitened residual with the effect at a strength as it is judged, and the T₀ of its noise were that normal.
    fn draw(&self, strength: f64, noise: &Noise<'_>, stream: &mut Stream) -> (DVector<f64>, f64) {
        let (e, plain) = noise.draw(None, stream);
        (self.acting(e, (strength, 1.0), stream), plain)
    }

    /// One whitened residual with the effect at a strength as it would be met. The noise is that of repetitions with the effect, and
    /// the signature is on average as large as it is without its own error: mean and covariance are those of a normal signature given
    /// what was seen of it.
    fn meet(
        &self,
        (strength, turn): (f64, Option<&DMatrix<f64>>),
        noise: &Noise<'_>,
        stream: &mut Stream,
    ) -> DVector<f64> {
        self.acting(noise.draw(turn, stream).0, (strength, self.shrink), stream)
    }

    /// Noise with the effect, its shift and its error both `known` times what they are.
    fn acting(&self, mut e: DVector<f64>, (strength, known): (f64, f64), stream: &mut Stream) -> DVector<f64> {
        e += self.shift(strength) * known;
        if let Some(root) = &self.root {
            let error = DVector::from_fn(root.ncols(), |_, _| stream.normal());
            e.gemv(strength * known, root, &error, 1.0);
        }
        e
    }

    /// What turns whitened noise into that of repetitions with the effect: the lower factor of I and what is added to it. `None`
    /// where nothing is, or where what is left is no covariance.
    fn turn(&self, strength: f64) -> Option<DMatrix<f64>> {
        let (known, change) = self.scatter.as_ref()?;
        let share = strength / known;
        let identity = DMatrix::identity(change.nrows(), change.ncols());
        Some((identity + change * (share * share).min(1.0)).cholesky()?.unpack())
    }
}

/// Simulated distributions, each sorted.
pub(super) struct Null {
    /// Whether χ² does not hold: few repetitions, or a parameter on its bound.
    pub simulated: bool,
    pub t0: Vec<f64>,
    /// Largest gain T₀ − misfit over the testable candidates.
    pub gain: Vec<f64>,
    /// Leftover of each candidate where it acts at half its range; empty where χ² holds.
    pub leftover: Vec<Vec<f64>>,
}

/// Simulates the null distributions and sets the machine's critical values.
pub(super) fn calibrate(machine: &mut Machine, noise: &Noise<'_>, worlds: &[World]) -> Null {
    let options = machine.options;
    let mut stream = Stream::new(options.seed, "attribution without effect");
    let simulated = noise.heavy || machine.geometries.len() > 1;
    let mut null = Null { simulated, t0: Vec::new(), gain: Vec::new(), leftover: Vec::new() };
    let (mut pairs, mut plain) = (Vec::new(), Vec::new());
    for _ in 0..options.null_draws {
        let (residual, t0) = noise.draw(None, &mut stream);
        plain.push(t0);
        let seen = machine.see(&residual);
        let fits = machine.fits(&seen);
        null.t0.push(seen.t0);
        null.gain.push(largest_gain(machine, &seen, &fits));
        if machine.evidence() >= options.pair_evidence {
            pairs.push(machine.largest_addition(&seen, &fits));
        }
    }
    for sorted in [&mut null.t0, &mut null.gain, &mut pairs] {
        sorted.sort_by(f64::total_cmp);
    }
    steady(&mut null.t0, plain, options.adequacy_level, machine.evidence());
    if simulated {
        null.leftover = (0..worlds.len()).map(|k| leftovers(machine, noise, &worlds[k], k)).collect();
    }
    machine.critical = critical(machine, &null, &pairs);
    null
}

/// Share of simulated values at least as large, counting the observed one.
pub(super) fn upper_tail(sorted: &[f64], value: f64) -> f64 {
    let below = sorted.partition_point(|x| *x < value);
    (sorted.len() - below + 1) as f64 / (sorted.len() + 1) as f64
}

/// T₀ − misfit of the best testable candidate.
fn largest_gain(machine: &Machine, seen: &Seen, fits: &[Found]) -> f64 {
    let testable = fits.iter().zip(&machine.rules).filter(|(_, rule)| rule.testable);
    testable.map(|(found, _)| seen.t0 - found.misfit).fold(0.0, f64::max)
}

fn leftovers(machine: &Machine, noise: &Noise<'_>, world: &World, k: usize) -> Vec<f64> {
    let mut stream = Stream::new(machine.options.seed, "attribution leftover");
    let (rule, mut scratch) = (machine.rules[k], Vec::new());
    let draw = |_| {
        let (residual, plain) = world.draw(rule.side() * rule.tau, noise, &mut stream);
        (machine.fit(&machine.see(&residual), k, &mut scratch).fit.leftover, plain)
    };
    let (mut all, plain): (Vec<f64>, Vec<f64>) = (0..machine.options.null_draws).map(draw).unzip();
    all.sort_by(f64::total_cmp);
    steady(&mut all, plain, machine.options.leftover_level, machine.evidence());
    all
}

/// Takes the chance of the draws off their critical value: `plain` are the T₀ of the same draws as normal noise, whose law
/// is χ² of d, and what their tail is off by is in `sorted` too.
fn steady(sorted: &mut [f64], mut plain: Vec<f64>, level: f64, d: usize) {
    plain.sort_by(f64::total_cmp);
    let law = |place: usize| special::chi2_quantile((place + 1) as f64 / (plain.len() + 1) as f64, d as f64);
    let factor = if d > 0 { tail_ratio(law, &plain, level) } else { 1.0 };
    sorted.iter_mut().for_each(|value| *value *= factor);
}

fn critical(machine: &Machine, null: &Null, pairs: &[f64]) -> Critical {
    let (options, d) = (machine.options, machine.evidence());
    let limit = |level: f64, dof: usize| {
        if dof == 0 { f64::INFINITY } else { special::chi2_quantile(1.0 - level, dof as f64) }
    };
    let single = limit(options.leftover_level, d.saturating_sub(1));
    let leftover: Vec<f64> = if null.simulated {
        null.leftover.iter().map(|sorted| quantile(sorted, 1.0 - options.leftover_level)).collect()
    } else {
        vec![single; machine.rules.len()]
    };
    let pair = limit(options.leftover_level, d.saturating_sub(2));
    // Heavier tails than χ² stretch the leftover of a pair as they stretch those of its members.
    let stretch = leftover.iter().fold(1.0_f64, |top, value| top.max(value / single));
    let t0 = if null.simulated {
        quantile(&null.t0, 1.0 - options.adequacy_level)
    } else {
        limit(options.adequacy_level, d)
    };
    Critical { t0, leftover, pair: quantile(pairs, 1.0 - options.pair_level), pair_leftover: pair * stretch }
}

/// The order statistic that a further draw exceeds with probability at most 1 − p.
fn quantile(sorted: &[f64], p: f64) -> f64 {
    let rank = libm::ceil(p * (sorted.len() + 1) as f64) as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(f64::INFINITY)
}

/// η₉₀ on one side of zero: the smallest strength at which the whole procedure ends in effect k, or in a small class
/// that contains it, with the wanted probability.
pub(super) fn detection_limit(
    machine: &Machine,
    noise: &Noise<'_>,
    world: &World,
    k: usize,
    end: f64,
) -> DetectionLimit {
    let options = machine.options;
    let probability = |strength: f64| detection_probability(machine, noise, world, k, strength);
    let norm = machine.effects[0][k].local_norm2().sqrt();
    let (mut low, mut high) = (0.0, (3.0 / norm).min(end.abs()));
    let mut reached = probability(high * end.signum());
    while reached < options.power {
        if high >= end.abs() {
            return DetectionLimit { side: end, strength: None, probability: reached };
        }
        (low, high) = (high, (GROWTH * high).min(end.abs()));
        reached = probability(high * end.signum());
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let there = probability(middle * end.signum());
        if there >= options.power {
            (high, reached) = (middle, there);
        } else {
            low = middle;
        }
    }
    DetectionLimit { side: end, strength: Some(high * end.signum()), probability: reached }
}

/// Share of drawn residuals in which effect k at a strength is detected.
fn detection_probability(machine: &Machine, noise: &Noise<'_>, world: &World, k: usize, strength: f64) -> f64 {
    let options = machine.options;
    let side = if strength < 0.0 { "attribution power below" } else { "attribution power above" };
    let mut stream = Stream::new(options.seed, &format!("{side} {k}"));
    let turn = world.turn(strength);
    let detected = |_: &usize| {
        let residual = world.meet((strength, turn.as_ref()), noise, &mut stream);
        machine.decide(&residual).detects(k, options.largest_class)
    };
    (0..options.power_draws).filter(detected).count() as f64 / options.power_draws as f64
}
