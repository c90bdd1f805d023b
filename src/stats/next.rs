//! Where to simulate next: new points or more repetitions, whichever lowers the uncertainty of the metamodels more.
//!
//! The measure is the integrated mean squared prediction error of stochastic kriging over the unit cube, and a round is
//! chosen greedily, one candidate after the other (Binois, Huang, Gramacy & Ludkovski 2019, *Replication or exploration?
//! Sequential design for stochastic simulation experiments*, Technometrics 61:7–23, section 3; their integrals are in closed
//! form, ours are sums over a Sobol sequence, which serve any kernel).
//! Takes metamodels of kind `sk` over one design; gives points and repetitions. The share of an estimated constant mean is
//! left out, and hyperparameters are held. Deliberately knows nothing of KPIs, costs in hours and of files.

use super::design::sobol::{Sobol, TooManyDimensions};
use super::gp::GaussianProcess;
use super::linalg::{SpdFactor, dot};
use super::metamodel::Metamodel;
use super::points::{Points, squared_distance};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// New points that are looked at in every step: the first ones of the Sobol sequence.
const CANDIDATES: usize = 1024;

/// Places whose mean stands for an integral over the unit cube: the first ones of a shifted Sobol sequence.
const NODES: usize = 4096;

/// Squared distance in the unit cube below which two points are one.
const SAME: f64 = 1e-16;

/// What to simulate.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// A new point of the unit cube.
    Explore(Vec<f64>),
    /// More runs at this zero-based point of the design.
    Replicate(usize),
}

/// A choice with what it is expected to bring.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    /// What to simulate.
    pub choice: Choice,
    /// Share of each metamodel's integrated mean squared prediction error that it takes away.
    pub gain: Vec<f64>,
}

/// The integrated mean squared prediction error of one process, I = σ_f² − tr(K⁻¹W) with W_ij = ∫ k(x_i, x) k(x_j, x) dx
/// over the unit cube, and what it becomes with more runs. In squared units of the process's targets.
#[derive(Debug, Clone)]
pub struct Imspe<'a> {
    process: &'a GaussianProcess,
    points: Points,
    /// Coordinates of the nodes of integration, one parameter after the other.
    nodes: Vec<f64>,
    /// k(x_i, x) at every node, for every point of the design.
    at_nodes: Vec<Vec<f64>>,
    /// Variance of one run at every point, and the number of runs there.
    run_variance: Vec<f64>,
    runs: Vec<f64>,
    /// Added to the diagonal besides.
    jitter: f64,
    /// K⁻¹, W and K⁻¹WK⁻¹, each n columns of n.
    inverse: Vec<f64>,
    integrals: DMatrix<f64>,
    middle: Vec<f64>,
}

/// ∫ f g from the values at the nodes.
fn integral(f: &[f64], g: &[f64]) -> f64 {
    dot(f, g) / NODES as f64
}

impl<'a> Imspe<'a> {
    /// The error of the process of the mean of `model`, whose training points have `runs` runs each.
    ///
    /// None where the model has no standard deviation between runs, or the covariance cannot be factorised.
    ///
    /// # Errors
    /// [`TooManyDimensions`] for more parameters than the Sobol sequence offers.
    ///
    /// # Panics
    /// If there is not one count per training point.
    pub fn new(model: &'a Metamodel, runs: &[usize]) -> Result<Option<Self>, TooManyDimensions> {
        let nodes = Sobol::shifted(model.dimension(), 1)?.take(NODES).columns();
        let Some(part) = model.parts().first().copied() else { return Ok(None) };
        let (process, record) = (part.process(), part.record());
        let points = process.training().points.clone();
        assert_eq!(points.len(), runs.len(), "one count per training point");
        let run_variance: Option<Vec<f64>> = points.rows().map(|x| run_variance(model, x)).collect();
        let Some(run_variance) = run_variance else { return Ok(None) };
        let at_nodes: Vec<Vec<f64>> = points.rows().map(|x| process.covariances_with(&nodes, x)).collect();
        let mut imspe = Self {
            integrals: DMatrix::from_fn(points.len(), points.len(), |i, j| integral(&at_nodes[i], &at_nodes[j])),
            at_nodes,
            nodes,
            process,
            run_variance,
            runs: runs.iter().map(|&runs| runs as f64).collect(),
            jitter: record.jitter,
            inverse: Vec::new(),
            middle: Vec::new(),
            points,
        };
        Ok(imspe.update().then_some(imspe))
    }

    /// σ_f².
    fn variance(&self) -> f64 {
        self.process.hyperparameters().variance
    }

    /// I.
    pub fn value(&self) -> f64 {
        self.variance() - dot(&self.inverse, self.integrals.as_slice())
    }

    /// Recomputes K⁻¹ and K⁻¹WK⁻¹; false where K cannot be factorised.
    fn update(&mut self) -> bool {
        let n = self.points.len();
        let noise = |i: usize| self.run_variance[i] / self.runs[i] + self.jitter;
        let columns = self.points.columns();
        let rows: Vec<Vec<f64>> = self.points.rows().map(|x| self.process.covariances_with(&columns, x)).collect();
        let entry = |i: usize, j: usize| rows[i][j] + if i == j { noise(i) } else { 0.0 };
        let Ok(factor) = SpdFactor::new(DMatrix::from_fn(n, n, entry)) else { return false };
        let inverse = factor.inverse();
        let middle = &inverse * &self.integrals * &inverse;
        self.inverse = inverse.as_slice().to_vec();
        self.middle = middle.as_slice().to_vec();
        true
    }

    /// By how much I falls with a new point `x` that gets `runs` runs of variance `run_variance` each:
    /// ∫ c(x', x)² dx'/(c(x, x) + v/runs) with the covariance c of the process given its data.
    pub fn gain_of_point(&self, x: &[f64], run_variance: f64, runs: f64) -> f64 {
        let n = self.points.len();
        let k = self.process.covariances_with(&self.points.columns(), x);
        let own = self.process.covariances_with(&self.nodes, x);
        let w: Vec<f64> = self.at_nodes.iter().map(|other| integral(&own, other)).collect();
        let column = |matrix: &[f64], j: usize| dot(&matrix[j * n..(j + 1) * n], &k);
        let (mut explained, mut quadratic, mut mixed) = (0.0, 0.0, 0.0);
        for j in 0..n {
            let solved = column(&self.inverse, j);
            explained += k[j] * solved;
            mixed += w[j] * solved;
            quadratic += k[j] * column(&self.middle, j);
        }
        let squares = integral(&own, &own) - 2.0 * mixed + quadratic;
        let known = (self.variance() - explained).max(0.0) + run_variance / runs + self.jitter;
        squares.max(0.0) / known
    }

    /// By how much I falls with `runs` more runs at point `i`: (K⁻¹WK⁻¹)_ii/(1/δ − (K⁻¹)_ii), where δ is how much the
    /// variance of the mean there falls (Sherman & Morrison).
    pub fn gain_of_replicates(&self, i: usize, runs: f64) -> f64 {
        let n = self.points.len();
        let fall = self.run_variance[i] * runs / (self.runs[i] * (self.runs[i] + runs));
        if fall <= 0.0 {
            return 0.0;
        }
        self.middle[i * n + i] / (1.0 / fall - self.inverse[i * n + i])
    }

    /// The same design with more runs at point `i`.
    fn replicate(&mut self, i: usize, runs: f64) -> bool {
        self.runs[i] += runs;
        self.update()
    }

    /// The same design with a new point.
    fn explore(&mut self, x: &[f64], run_variance: f64, runs: f64) -> bool {
        self.at_nodes.push(self.process.covariances_with(&self.nodes, x));
        let n = self.at_nodes.len();
        self.integrals = DMatrix::from_fn(n, n, |i, j| integral(&self.at_nodes[i], &self.at_nodes[j]));
        self.points.push(x);
        self.run_variance.push(run_variance);
        self.runs.push(runs);
        self.update()
    }
}

/// Variance of one run at `x` in squared units of the scaled targets.
fn run_variance(model: &Metamodel, x: &[f64]) -> Option<f64> {
    let scale = model.parts().first()?.record().scale;
    let sd = model.predict(x).sd?.value / scale;
    Some(sd * sd)
}

/// A round of `wished` choices, each of `runs` runs: in every step the new point or the repetition that takes the largest
/// share of the integrated mean squared prediction error away, summed over the metamodels.
///
/// `counts` holds the runs at every training point of each metamodel; all metamodels share their training points. No point
/// of `apart`, which judges the metamodels, is offered. Stops early where a covariance cannot be factorised any more. The
/// same arguments give the same round.
///
/// # Errors
/// [`TooManyDimensions`] for more parameters than the Sobol sequence offers.
pub fn suggest(
    models: &[(&Metamodel, &[usize])],
    apart: &Points,
    wished: usize,
    runs: usize,
) -> Result<Vec<Suggestion>, TooManyDimensions> {
    let mut errors: Vec<(&Metamodel, Imspe)> = Vec::new();
    for (model, counts) in models {
        errors.extend(Imspe::new(model, counts)?.map(|imspe| (*model, imspe)));
    }
    let Some(dimension) = errors.first().map(|(model, _)| model.dimension()) else { return Ok(Vec::new()) };
    let candidates = Sobol::new(dimension)?.take(CANDIDATES);
    let design = errors[0].1.points.len();
    // A point of the design is no new one.
    let is_near = |i: &usize, point: &[f64]| squared_distance(point, candidates.row(*i)) < SAME;
    let known = |i: &usize| errors[0].1.points.rows().chain(apart.rows()).any(|point| is_near(i, point));
    let mut added: Vec<usize> = (0..candidates.len()).filter(known).collect();
    let mut chosen: Vec<Suggestion> = Vec::new();
    while chosen.len() < wished {
        let best = best(&errors, &candidates, design, &added, runs as f64);
        let updated = errors.iter_mut().all(|(model, imspe)| match &best.choice {
            Choice::Replicate(i) => imspe.replicate(*i, runs as f64),
            Choice::Explore(x) => {
                let variance = run_variance(model, x).unwrap_or(0.0);
                imspe.explore(x, variance, runs as f64)
            }
        });
        if !updated {
            break;
        }
        if let Choice::Explore(x) = &best.choice {
            added.extend(candidates.rows().position(|candidate| candidate == x));
        }
        chosen.push(best);
    }
    Ok(chosen)
}

/// The best of all new points that are not taken yet and of all repetitions of the `design`'s points; the first of equals.
fn best(errors: &[(&Metamodel, Imspe)], candidates: &Points, design: usize, taken: &[usize], runs: f64) -> Suggestion {
    let share = |gain: &dyn Fn(&Metamodel, &Imspe) -> f64| -> Vec<f64> {
        errors.iter().map(|(model, imspe)| gain(model, imspe) / imspe.value().max(f64::MIN_POSITIVE)).collect()
    };
    let replicate = |i: usize| Suggestion {
        choice: Choice::Replicate(i),
        gain: share(&|_, imspe| imspe.gain_of_replicates(i, runs)),
    };
    let explore = |i: usize| {
        let x = candidates.row(i);
        let gain = share(&|model, imspe| imspe.gain_of_point(x, run_variance(model, x).unwrap_or(0.0), runs));
        Suggestion { choice: Choice::Explore(x.to_vec()), gain }
    };
    let free: Vec<usize> = (0..candidates.len()).filter(|i| !taken.contains(i)).collect();
    let explored: Vec<Suggestion> = free.into_par_iter().map(explore).collect();
    let all = (0..design).map(replicate).chain(explored);
    let total = |suggestion: &Suggestion| suggestion.gain.iter().sum::<f64>();
    let better = |best: Suggestion, next: Suggestion| if total(&next) > total(&best) { next } else { best };
    all.reduce(better).unwrap_or(Suggestion { choice: Choice::Replicate(0), gain: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;
    use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
    use crate::stats::metamodel::{Kind, Observations, Options, quality};
    use crate::stats::summary::{mean, sd};

    /// A response with a bend and a scatter that grows ninefold along the first parameter.
    fn truth(x: &[f64]) -> (f64, f64) {
        (3.0 + libm::sin(5.0 * x[0]) + 2.0 * x[1] * x[1], 0.1 + 0.8 * x[0])
    }

    /// Runs at points, the first ones the same however many follow.
    struct Lab {
        points: Points,
        values: Vec<Vec<f64>>,
        stream: Stream,
    }

    impl Lab {
        fn new(points: Points, runs: usize, seed: u64) -> Self {
            let mut lab = Self { points: Points::empty(2), values: Vec::new(), stream: Stream::new(seed, "next test") };
            points.rows().for_each(|x| lab.explore(x, runs));
            lab
        }

        fn explore(&mut self, x: &[f64], runs: usize) {
            self.points.push(x);
            self.values.push(Vec::new());
            self.replicate(self.values.len() - 1, runs);
        }

        fn replicate(&mut self, i: usize, runs: usize) {
            let (mean, sd) = truth(self.points.row(i));
            (0..runs).for_each(|_| self.values[i].push(mean + sd * self.stream.normal()));
        }

        fn observations(&self) -> Observations {
            Observations {
                points: self.points.clone(),
                means: self.values.iter().map(|values| mean(values)).collect(),
                sds: self.values.iter().map(|values| sd(values)).collect(),
                counts: self.values.iter().map(Vec::len).collect(),
            }
        }

        fn model(&self) -> Metamodel {
            let options = Options { starts: 30, refined: 2, ..Options::default() };
            Metamodel::fit(Kind::Sk, &self.observations(), &options).unwrap()
        }

        /// NRMSE of the mean against the truth on a grid (eq. 15).
        fn error(&self) -> f64 {
            let mut points = Points::empty(2);
            (0..225).for_each(|i| points.push(&[f64::from(i / 15) / 14.0, f64::from(i % 15) / 14.0]));
            let means = points.rows().map(|x| truth(x).0).collect();
            let (sds, counts) = (vec![0.0; 225], vec![1; 225]);
            quality::score(&self.model(), &Observations { points, means, sds, counts }).unwrap().mean.nrmse
        }
    }

    fn lab(seed: u64) -> Lab {
        let start = conditional_latin_hypercube(16, &Points::empty(2), &Annealing { seed, exchanges: 2_000 });
        Lab::new(start.points, 4, seed)
    }

    #[test]
    fn the_error_is_the_integral_of_the_variance() {
        let lab = lab(1);
        let model = lab.model();
        let imspe = Imspe::new(&model, &lab.observations().counts).unwrap().unwrap();
        let process = model.parts()[0].process();
        // Midpoint rule on 60 × 60; the constant mean's share, which the integral leaves out, is taken off.
        let n = lab.points.len();
        let (mut sum, cells) = (0.0, 60);
        for i in 0..cells * cells {
            let x = [(f64::from(i / cells) + 0.5) / f64::from(cells), (f64::from(i % cells) + 0.5) / f64::from(cells)];
            let k = process.covariances_with(&lab.points.columns(), &x);
            let explained: f64 = (0..n).map(|j| k[j] * dot(&imspe.inverse[j * n..(j + 1) * n], &k)).sum();
            sum += (imspe.variance() - explained) / f64::from(cells * cells);
        }
        assert!((sum / imspe.value() - 1.0).abs() < 1e-3, "{sum} against {}", imspe.value());
    }

    #[test]
    fn gains_are_what_the_error_falls_by() {
        let lab = lab(2);
        let model = lab.model();
        let before = Imspe::new(&model, &lab.observations().counts).unwrap().unwrap();
        for i in [0, 7] {
            let mut after = before.clone();
            assert!(after.replicate(i, 3.0));
            let fall = before.value() - after.value();
            assert!((before.gain_of_replicates(i, 3.0) / fall - 1.0).abs() < 1e-6, "{fall}");
        }
        for x in [[0.5, 0.5], [1.0, 0.02]] {
            let (mut after, variance) = (before.clone(), run_variance(&model, &x).unwrap());
            assert!(after.explore(&x, variance, 4.0));
            let fall = before.value() - after.value();
            assert!((before.gain_of_point(&x, variance, 4.0) / fall - 1.0).abs() < 1e-6, "{fall}");
        }
    }

    /// Twelve more batches of four runs, chosen or at random, from twelve beginnings: the NRMSE falls from 0.052 on average
    /// to 0.035 and 0.045, and the choice wins ten times of twelve.
    #[test]
    fn a_chosen_round_lowers_the_error_more_than_random_runs() {
        const ROUND: usize = 12;
        let (mut before, mut by_choice, mut by_chance, mut wins) = (0.0, 0.0, 0.0, 0);
        for seed in 0..12 {
            let (mut chosen, mut random) = (lab(seed), lab(seed));
            before += chosen.error();
            let (model, counts) = (chosen.model(), chosen.observations().counts);
            let round = suggest(&[(&model, &counts)], &Points::empty(model.dimension()), ROUND, 4).unwrap();
            assert_eq!(round.len(), ROUND);
            for suggestion in &round {
                match &suggestion.choice {
                    Choice::Explore(x) => chosen.explore(x, 4),
                    Choice::Replicate(i) => chosen.replicate(*i, 4),
                }
            }
            let mut stream = Stream::new(seed, "random points");
            (0..ROUND).for_each(|_| random.explore(&[stream.uniform(), stream.uniform()], 4));
            let (a, b) = (chosen.error(), random.error());
            by_choice += a;
            by_chance += b;
            wins += usize::from(a < b);
        }
        assert!(by_choice < 0.9 * by_chance && by_chance < before, "{before} {by_choice} {by_chance}, {wins} wins");
        assert!(wins > 6, "{wins} of 12");
    }
}
