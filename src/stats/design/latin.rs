//! Latin hypercubes that keep away from each other's points and from points that are there already.
//!
//! A Latin hypercube of n points has one point in each of n slices of every parameter; here the points lie at the
//! **centres** of their cells, (level + ½)/n, so that none lies on a face and a design is a table of whole numbers.
//! The levels are chosen by simulated annealing on φ_p over all pairs with at least one new point (Morris & Mitchell
//! 1995), moving by exchanges of one coordinate between two points. Half of the exchanges involve a point of the
//! nearest pair, because only they can enlarge the smallest distance.

use super::metrics::{min_distance, min_distance_between};
use crate::rng::Stream;
use crate::stats::points::Points;

/// How long a search is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Annealing {
    /// Seed of the search.
    pub seed: u64,
    /// Exchanges tried; the distance reached grows slowly beyond some hundred thousand.
    pub exchanges: usize,
}

impl Default for Annealing {
    fn default() -> Self {
        Self { seed: 0, exchanges: 400_000 }
    }
}

/// An optimised Latin hypercube.
#[derive(Debug, Clone, PartialEq)]
pub struct LatinHypercube {
    /// New points, shape (n, p).
    pub points: Points,
    /// Smallest distance among the new points.
    pub min_distance: f64,
    /// Smallest distance among new and given points together, except between given ones.
    pub joint_min_distance: f64,
}

/// Relative temperatures of ln φ_p at the begin and the end of the annealing.
const TEMPERATURE: (f64, f64) = (1e-2, 1e-5);

/// Power p of φ_p, twice the sixteenth power of 1/d²: near the pure maximin, yet not blind to other pairs.
const POWER: f64 = 32.0;

/// Exchanges between two searches for the nearest pair.
const NEAREST_EVERY: usize = 16;

/// Latin hypercube of `n` points in the cube of `given`, as far as the search gets from each other and from `given`.
///
/// The same seed gives the same design. `given` may be empty but must have the wanted dimension.
pub fn conditional_latin_hypercube(n: usize, given: &Points, annealing: &Annealing) -> LatinHypercube {
    let mut search = Search::new(n, given, annealing.seed);
    if n > 1 {
        search.anneal(annealing.exchanges);
    }
    let points = search.best_points();
    let own = min_distance(&points);
    let joint_min_distance = own.min(min_distance_between(&points, given));
    LatinHypercube { points, min_distance: own, joint_min_distance }
}

/// d^−32 from d²; finite for points that coincide, so that the search can move them apart.
fn repulsion(squared: f64) -> f64 {
    let floored = squared.max(1e-12);
    let second = 1.0 / (floored * floored);
    let fourth = second * second;
    let eighth = fourth * fourth;
    eighth * eighth
}

/// Largest of numbers that are not negative, in lanes that the compiler makes vectors of.
fn largest(values: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let larger = |lane: &mut f64, value: f64| *lane = if value > *lane { value } else { *lane };
    let (chunks, rest) = values.as_chunks();
    chunks
        .iter()
        .for_each(|chunk: &[f64; 8]| lanes.iter_mut().zip(chunk).for_each(|(lane, value)| larger(lane, *value)));
    lanes.into_iter().chain(rest.iter().copied()).fold(0.0, |most, value| if value > most { value } else { most })
}

/// Sums of four rows of one length, each in its own order, side by side: one sum alone waits for every addition.
fn sums(rows: [&[f64]; 4]) -> [f64; 4] {
    let [a, b, c, d] = rows;
    let columns = a.iter().zip(b).zip(c.iter().zip(d));
    columns.fold([0.0; 4], |[w, x, y, z], ((a, b), (c, d))| [w + a, x + b, y + c, z + d])
}

struct Search {
    /// New points; the given ones follow them in every column.
    n: usize,
    stream: Stream,
    /// Coordinates of all points, one column per parameter.
    columns: Vec<Vec<f64>>,
    /// Repulsion of new point i from new point j (j < n) or given point j − n; shape (n, n + given).
    pairs: Vec<f64>,
    /// Sum of `pairs` with each pair of new points once, and its value when it was last summed anew.
    energy: f64,
    summed: f64,
    /// Lowest energy met, and the columns of the new points there.
    best: (f64, Vec<Vec<f64>>),
    /// Repulsions of the two points of a trial.
    trial: [Vec<f64>; 2],
    /// New points of the pair that was nearest when last looked for.
    nearest: [usize; 2],
}

impl Search {
    fn new(n: usize, given: &Points, seed: u64) -> Self {
        let mut stream = Stream::new(seed, "latin hypercube");
        let column = |d: usize| {
            let mut levels: Vec<usize> = (0..n).collect();
            stream.shuffle(&mut levels);
            let centres = levels.into_iter().map(|level| (level as f64 + 0.5) / n as f64);
            centres.chain(given.rows().map(|row| row[d])).collect()
        };
        let columns: Vec<Vec<f64>> = (0..given.dimension()).map(column).collect();
        let width = n + given.len();
        let best = (f64::INFINITY, columns.clone());
        let trial = [vec![0.0; width], vec![0.0; width]];
        let mut search = Self {
            n,
            stream,
            columns,
            pairs: vec![0.0; n * width],
            energy: 0.0,
            summed: 0.0,
            best,
            trial,
            nearest: [0; 2],
        };
        search.fill();
        search
    }

    fn width(&self) -> usize {
        self.trial[0].len()
    }

    /// Computes every repulsion.
    fn fill(&mut self) {
        let width = self.width();
        for i in 0..self.n {
            self.repulsions(0, i, [i, i], None);
            self.pairs[i * width..(i + 1) * width].copy_from_slice(&self.trial[0]);
        }
        self.sum_anew();
    }

    /// Repulsions of point `i` into trial row `slot`, 0 from the points `skipped`, coordinate `d` replaced by `value`
    /// where `moved` is (d, value).
    fn repulsions(&mut self, slot: usize, i: usize, skipped: [usize; 2], moved: Option<(usize, f64)>) {
        let row = &mut self.trial[slot];
        row.fill(0.0);
        for (d, column) in self.columns.iter().enumerate() {
            let here = moved.filter(|(changed, _)| *changed == d).map_or(column[i], |(_, value)| value);
            for (square, other) in row.iter_mut().zip(column) {
                *square += (here - other) * (here - other);
            }
        }
        row.iter_mut().for_each(|square| *square = repulsion(*square));
        skipped.into_iter().for_each(|j| row[j] = 0.0);
    }

    fn sum_anew(&mut self) {
        let (n, width) = (self.n, self.width());
        let row = |row: &[f64]| 0.5 * row[..n].iter().sum::<f64>() + row[n..].iter().sum::<f64>();
        self.energy = self.pairs.chunks_exact(width.max(1)).map(row).sum();
        self.summed = self.energy;
    }

    fn anneal(&mut self, exchanges: usize) {
        let ratio = libm::log(TEMPERATURE.1 / TEMPERATURE.0);
        for step in 0..exchanges {
            if step % NEAREST_EVERY == 0 {
                self.find_nearest();
            }
            let temperature = TEMPERATURE.0 * libm::exp(ratio * step as f64 / exchanges as f64);
            self.try_exchange(temperature);
            // The energy is updated by differences. Summing anew before it has lost a digit keeps it exact.
            if self.energy < 0.1 * self.summed || step % 1024 == 0 {
                self.sum_anew();
            }
            if self.energy < self.best.0 {
                self.best.0 = self.energy;
                self.best.1.clone_from(&self.columns);
            }
        }
    }

    /// Exchanges one coordinate of two points and keeps the change by the rule of Metropolis.
    fn try_exchange(&mut self, temperature: f64) {
        let (i, j, d) = self.choose();
        let width = self.width();
        // The distance between the two does not change and is left out on both sides.
        self.repulsions(0, i, [i, j], Some((d, self.columns[d][j])));
        self.repulsions(1, j, [i, j], Some((d, self.columns[d][i])));
        let row = |k: usize| &self.pairs[k * width..(k + 1) * width];
        let [of_i, of_j, new_i, new_j] = sums([row(i), row(j), &self.trial[0], &self.trial[1]]);
        let before = of_i + of_j - 2.0 * self.pairs[i * width + j];
        let after = new_i + new_j;
        let energy = self.energy + after - before;
        let growth = libm::log(energy / self.energy) / POWER;
        if growth <= 0.0 || self.stream.uniform() < libm::exp(-growth / temperature) {
            self.energy = energy;
            self.accept(0, i, j);
            self.accept(1, j, i);
            self.columns[d].swap(i, j);
        }
    }

    /// Two new points and a parameter; every other time the first point is one of the nearest pair.
    fn choose(&mut self) -> (usize, usize, usize) {
        let first = match self.stream.index(4) {
            side @ 0..2 => self.nearest[side],
            _ => self.stream.index(self.n),
        };
        let second = (first + 1 + self.stream.index(self.n - 1)) % self.n;
        (first, second, self.stream.index(self.columns.len()))
    }

    /// Finds the pair of largest repulsion; with a given point, the new one stands for both.
    fn find_nearest(&mut self) {
        let width = self.width();
        let largest = largest(&self.pairs);
        let place = self.pairs.iter().position(|value| *value == largest).unwrap_or_default();
        let (i, j) = (place / width, place % width);
        self.nearest = [i, if j < self.n { j } else { i }];
    }

    /// Stores the repulsions of trial row `slot` for point `moved`, except that from its partner, which stays.
    fn accept(&mut self, slot: usize, moved: usize, partner: usize) {
        let width = self.width();
        self.trial[slot][partner] = self.pairs[moved * width + partner];
        self.pairs[moved * width..(moved + 1) * width].copy_from_slice(&self.trial[slot]);
        for other in 0..self.n {
            self.pairs[other * width + moved] = self.trial[slot][other];
        }
    }

    fn best_points(&self) -> Points {
        let mut points = Points::empty(self.columns.len());
        for i in 0..self.n {
            let row: Vec<f64> = self.best.1.iter().map(|column| column[i]).collect();
            points.push(&row);
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::super::factorial;
    use super::*;

    fn assert_latin(points: &Points) {
        let n = points.len();
        for d in 0..points.dimension() {
            let mut levels: Vec<f64> = points.rows().map(|row| row[d] * n as f64 - 0.5).collect();
            levels.sort_by(f64::total_cmp);
            for (level, value) in levels.iter().enumerate() {
                assert!((value - level as f64).abs() < 1e-9, "parameter {d}: {levels:?}");
            }
        }
    }

    #[test]
    fn every_slice_holds_one_point_and_the_seed_decides() {
        let (given, annealing) = (factorial(3, 3), Annealing { seed: 4, exchanges: 20_000 });
        let design = conditional_latin_hypercube(20, &given, &annealing);
        assert_latin(&design.points);
        assert_eq!(design, conditional_latin_hypercube(20, &given, &annealing));
        assert_ne!(design, conditional_latin_hypercube(20, &given, &Annealing { seed: 5, ..annealing }));
        let joint = min_distance(&design.points.joined(&given));
        assert_eq!(joint, design.joint_min_distance);
    }

    /// Every order of `rest` behind `start`.
    fn permutations(start: &[usize], rest: &[usize]) -> Vec<Vec<usize>> {
        if rest.is_empty() {
            return vec![start.to_vec()];
        }
        let next = |i: usize| {
            let others: Vec<usize> = rest.iter().copied().filter(|&level| level != rest[i]).collect();
            permutations(&[start, &[rest[i]]].concat(), &others)
        };
        (0..rest.len()).flat_map(next).collect()
    }

    #[test]
    fn the_search_finds_the_optimum_of_all_designs_given_points_at_cell_centres_too() {
        // With an odd number of levels the centre of the square, a given point, is the centre of a cell.
        let given = factorial(3, 2);
        let distance = |order: &Vec<usize>| {
            let centre = |level: usize| (level as f64 + 0.5) / 7.0;
            let rows: Vec<[f64; 2]> = order.iter().enumerate().map(|(i, &level)| [centre(i), centre(level)]).collect();
            let points = Points::from_rows(&rows, 2).unwrap();
            min_distance(&points).min(min_distance_between(&points, &given))
        };
        let best = permutations(&[], &[0, 1, 2, 3, 4, 5, 6]).iter().map(distance).fold(0.0, f64::max);
        for seed in 0..5 {
            let design = conditional_latin_hypercube(7, &given, &Annealing { seed, exchanges: 20_000 });
            assert_latin(&design.points);
            assert!(design.joint_min_distance > best - 1e-12, "{} of {best}", design.joint_min_distance);
        }
    }

    #[test]
    fn small_designs_are_possible() {
        let empty = Points::empty(2);
        for n in 0..4 {
            let design = conditional_latin_hypercube(n, &empty, &Annealing { seed: 1, exchanges: 100 });
            assert_eq!(design.points.len(), n);
            assert_latin(&design.points);
        }
    }

    #[test]
    fn four_points_in_the_plane_reach_the_known_optimum() {
        // The best Latin hypercube of four points is the knight's move pattern with squared distance 5 in levels.
        let design = conditional_latin_hypercube(4, &Points::empty(2), &Annealing { seed: 2, exchanges: 2_000 });
        assert!((design.min_distance - 5.0_f64.sqrt() / 4.0).abs() < 1e-12, "{}", design.min_distance);
    }
}
