//! Time to train every metamodel of a study at the paper's size: n = 1..50 repetitions × 3 KPIs × 3 kinds on 127 points.
//!
//! `cargo bench --bench metamodels -- [repetitions] [threads]`, 50 and 2 where left out. The data are synthetic: smooth
//! responses of three parameters with normal scatter of the size that Table 2 shows. Each chain of growing n starts from
//! the optimum for fewer repetitions, as the stage `train` does. The last line holds the seconds.

use granulake::rng::Stream;
use granulake::stats::design::factorial;
use granulake::stats::design::latin::{Annealing, conditional_latin_hypercube};
use granulake::stats::metamodel::{Kind, Metamodel, Observations, Options};
use granulake::stats::points::Points;
use granulake::stats::summary;
use rayon::prelude::*;
use std::time::Instant;

/// Mean and standard deviation of a KPI at a point of the unit cube.
type Response = fn(&[f64]) -> (f64, f64);

/// An angle of repose, an angle of movement and a bulk density in shape and size.
const RESPONSES: [Response; 3] = [
    |x| (15.0 + 14.0 * libm::tanh(2.0 * x[0]) + 6.0 * x[1] * x[0], 1.5 + 2.0 * x[1]),
    |x| (25.0 + 22.0 * libm::tanh(3.0 * x[0]) + 4.0 * x[1], 1.0 + 3.0 * x[0]),
    |x| (1400.0 + 160.0 * x[2] - 90.0 * x[0] - 40.0 * x[0] * x[1], 4.0 + 4.0 * x[0]),
];

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|argument| argument.parse::<usize>().ok());
    let (repetitions, threads) = (arguments.next().unwrap_or(50), arguments.next().unwrap_or(2));
    let boundary = factorial(3, 3);
    let annealing = Annealing { seed: 1, exchanges: 20_000 };
    let points = boundary.joined(&conditional_latin_hypercube(100, &boundary, &annealing).points);
    let runs: Vec<Vec<Vec<f64>>> = RESPONSES.iter().map(|response| runs(&points, *response, repetitions)).collect();
    let chains: Vec<(usize, Kind)> =
        (0..runs.len()).flat_map(|kpi| [Kind::Ibm, Kind::Rbm, Kind::Sk].map(|kind| (kpi, kind))).collect();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let begin = Instant::now();
    let train = |(kpi, kind): &(usize, Kind)| (*kpi, *kind, chain(&points, &runs[*kpi], *kind));
    let trained: Vec<_> = pool.install(|| chains.par_iter().map(train).collect());
    let seconds = begin.elapsed().as_secs_f64();
    for (kpi, kind, (models, likelihood)) in &trained {
        println!("response {kpi} {}: {models} metamodels, sum of log likelihoods {likelihood:.6}", kind.name());
    }
    let total: usize = trained.iter().map(|(.., (models, _))| models).sum();
    println!("{total} metamodels of {} points on {threads} threads", points.len());
    println!("{seconds:.1} s");
}

/// Values of every repetition at every point, shape (points, repetitions).
fn runs(points: &Points, response: Response, repetitions: usize) -> Vec<Vec<f64>> {
    let mut stream = Stream::new(7, "synthetic runs");
    let at = |x: &[f64]| {
        let (mean, sd) = response(x);
        (0..repetitions).map(|_| mean + sd * stream.normal()).collect()
    };
    points.rows().map(at).collect()
}

/// Trains on the first 1, 2, … repetitions; gives the number of metamodels and the sum of their log likelihoods.
fn chain(points: &Points, runs: &[Vec<f64>], kind: Kind) -> (usize, f64) {
    let mut options = Options::default();
    let (mut models, mut likelihood) = (0, 0.0);
    for n in 1..=runs[0].len() {
        // A single run has no scatter, which only `ibm` can do without.
        let Ok(model) = Metamodel::fit(kind, &observations(points, runs, n), &options) else { continue };
        options.warm = model.records();
        models += 1;
        likelihood += options.warm.iter().map(|record| record.log_likelihood).sum::<f64>();
    }
    (models, likelihood)
}

fn observations(points: &Points, runs: &[Vec<f64>], n: usize) -> Observations {
    Observations {
        points: points.clone(),
        means: runs.iter().map(|values| summary::mean(&values[..n])).collect(),
        sds: runs.iter().map(|values| if n > 1 { summary::sd(&values[..n]) } else { 0.0 }).collect(),
        counts: vec![n; points.len()],
    }
}
