//! Cell list: sorts grains by cell and visits every pair of near neighbours once, in ascending order.
//!
//! Takes rows (x, y, z, reach); two grains are near when their distance is below the sum of their reaches. The order of cells
//! has x fastest, so that the three cells of a row are one contiguous range of grains.

use super::lanes::{Lanes, Number, WIDTH};
use super::setup::Vec3;
use super::vector::{Row4, dot};
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Factor on reaches where whole cells are left out, so that no rounding of a place costs a pair.
const SLACK: f64 = 1.0 + 1e-6;

/// Cells over the bounding box of the grains.
#[derive(Debug, Clone, Default)]
pub struct Grid {
    lower: [f64; 3],
    inverse: f64,
    size: [usize; 3],
    cell: Vec<u32>,
    start: Vec<u32>,
    /// Cell of each grain in sorted order.
    sorted: Vec<u32>,
    /// New order: entry k is the old number of the grain that comes k-th.
    pub order: Vec<u32>,
}

impl Grid {
    /// Sorts the grains for which `keep` holds into cells of edge `edge` [m] or larger; stable, so deterministic.
    pub fn sort(&mut self, rows: &[Row4], keep: &[bool], edge: f64) {
        self.fit(rows, keep, edge);
        let cells = self.size[0] * self.size[1] * self.size[2];
        self.start.clear();
        self.start.resize(cells + 1, 0);
        self.cell.clear();
        for (row, &keep) in rows.iter().zip(keep) {
            let cell = if keep { self.cell_of(row) } else { cells };
            self.cell.push(cell as u32);
            if keep {
                self.start[cell + 1] += 1;
            }
        }
        for c in 0..cells {
            self.start[c + 1] += self.start[c];
        }
        self.place(cells);
    }

    /// Writes the order; `start` serves as the cursor and is shifted back afterwards.
    fn place(&mut self, cells: usize) {
        let count = self.start[cells] as usize;
        self.order.clear();
        self.order.resize(count, 0);
        self.sorted.clear();
        self.sorted.resize(count, 0);
        for (old, &cell) in self.cell.iter().enumerate().filter(|(_, cell)| **cell < cells as u32) {
            let slot = &mut self.start[cell as usize];
            self.order[*slot as usize] = old as u32;
            self.sorted[*slot as usize] = cell;
            *slot += 1;
        }
        self.start.copy_within(0..cells, 1);
        self.start[0] = 0;
    }

    /// Chooses origin and number of cells; scattered grains get larger cells rather than more of them.
    fn fit(&mut self, rows: &[Row4], keep: &[bool], edge: f64) {
        let (mut lower, mut upper) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for (row, _) in rows.iter().zip(keep).filter(|(_, keep)| **keep) {
            for axis in 0..3 {
                lower[axis] = lower[axis].min(row[axis]);
                upper[axis] = upper[axis].max(row[axis]);
            }
        }
        let limit = 4096 + 16 * rows.len();
        let mut edge = edge;
        loop {
            self.inverse = 1.0 / edge;
            for axis in 0..3 {
                let extent = (upper[axis] - lower[axis]).max(0.0);
                self.size[axis] = ((extent * self.inverse) as usize).min(limit) + 1;
            }
            if self.size[0] * self.size[1] * self.size[2] <= limit {
                break;
            }
            edge *= 1.3;
        }
        self.lower = lower;
    }

    fn cell_of(&self, row: &Row4) -> usize {
        let index = |axis: usize| self.index(row[axis], axis);
        (index(2) * self.size[1] + index(1)) * self.size[0] + index(0)
    }

    /// Number of the cell along an axis; never falls with x.
    fn index(&self, x: f64, axis: usize) -> usize {
        (((x - self.lower[axis]) * self.inverse) as usize).min(self.size[axis] - 1)
    }

    /// Calls `visit(i)` for every sorted grain in the cells that a box [m] touches, ascending; all grains in the box are
    /// among them.
    pub fn visit_box(&self, [lower, upper]: [Vec3; 2], mut visit: impl FnMut(usize)) {
        let [x, y, z] = [0, 1, 2].map(|axis| [self.index(lower[axis], axis), self.index(upper[axis], axis)]);
        for layer in z[0]..=z[1] {
            for row in y[0]..=y[1] {
                let base = (layer * self.size[1] + row) * self.size[0];
                let grains = self.start[base + x[0]] as usize..self.start[base + x[1] + 1] as usize;
                grains.for_each(&mut visit);
            }
        }
    }

    /// Calls `found(i, j)` for every near pair i < j of the sorted rows, ascending in i, then j. No reach is above half the
    /// edge that the grains were sorted with.
    pub fn pairs(&self, arch: Arch, rows: &[Row4], search: &mut Search, mut found: impl FnMut(usize, usize)) {
        search.read(rows);
        arch.dispatch(Sweep { grid: self, rows, search });
        let mut first = 0;
        for (i, &last) in search.ends.iter().enumerate() {
            search.hits[first..last].iter().for_each(|&j| found(i, j as usize));
            first = last;
        }
    }

    /// The grains that may be within `reach` of grain `i` of a cell and come after it: the rest of its own row of cells, and four
    /// rows of up to three cells. What lies beyond its reach is left out by whole cells.
    #[inline(always)]
    fn ranges(&self, i: usize, cell: usize, place: &Row4, reach: f64) -> [Range<usize>; 5] {
        let [nx, ny, _] = self.size;
        let (x, y, z) = (cell % nx, cell / nx % ny, cell / (nx * ny));
        let below = |own: usize, axis: usize| own - usize::from(self.index(place[axis] - reach, axis) < own);
        let above = |own: usize, axis: usize| own + usize::from(self.index(place[axis] + reach, axis) > own);
        let ([left, right], [front, back], upper) =
            ([below(x, 0), above(x, 0)], [below(y, 1), above(y, 1)], above(z, 2));
        let row = |is_near: bool, y: usize, z: usize| {
            let base = (z * ny + y) * nx;
            if is_near { self.start[base + left] as usize..self.start[base + right + 1] as usize } else { 0..0 }
        };
        [
            i + 1..row(true, y, z).end,
            row(back > y, back, z),
            row(upper > z && front < y, front, upper),
            row(upper > z, y, upper),
            row(upper > z && back > y, back, upper),
        ]
    }
}

/// Work space of [`Grid::pairs`].
#[derive(Debug, Clone, Default)]
pub struct Search {
    /// The rows, a vector to a block.
    blocks: Vec<Columns>,
    /// Near ones of all grains, and where those of each end.
    hits: Vec<u32>,
    ends: Vec<usize>,
}

/// Rows (x, y, z, reach) of [`WIDTH`] grains by columns.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
struct Columns([[f64; WIDTH]; 4]);

impl Search {
    fn read(&mut self, rows: &[Row4]) {
        self.blocks.clear();
        for rows in rows.chunks(WIDTH) {
            let mut block = Columns::default();
            for (lane, row) in rows.iter().enumerate() {
                (0..4).for_each(|c| block.0[c][lane] = row[c]);
            }
            self.blocks.push(block);
        }
    }
}

/// The search itself, a vector of candidates at a time.
struct Sweep<'a> {
    grid: &'a Grid,
    rows: &'a [Row4],
    search: &'a mut Search,
}

impl WithSimd for Sweep<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Search { blocks, hits, ends } = self.search;
        let widest = self.rows.iter().map(|row| row[3]).fold(0.0, f64::max);
        let mut count = 0;
        ends.clear();
        for (i, (&cell, row)) in self.grid.sorted.iter().zip(self.rows).enumerate() {
            for range in self.grid.ranges(i, cell as usize, row, SLACK * (row[3] + widest)) {
                let room = count + range.len() + WIDTH;
                if hits.len() < room {
                    hits.resize(2 * room, 0);
                }
                count = collect(simd, row, blocks, range, hits, count);
            }
            ends.push(count);
        }
    }
}

/// Writes the near ones of a range behind the first `count` hits and gives their new number. Every vector writes a vector, so
/// that nothing depends on a guess.
#[inline(always)]
fn collect<S: Simd>(
    simd: S,
    row: &Row4,
    blocks: &[Columns],
    range: Range<usize>,
    hits: &mut [u32],
    mut count: usize,
) -> usize {
    if range.is_empty() {
        return count;
    }
    let (first, last) = (range.start / WIDTH, (range.end - 1) / WIDTH);
    for (b, block) in (first..).zip(&blocks[first..=last]) {
        let base = b * WIDTH;
        // Bits of the grains before and behind the range are not set.
        let inside = (0xff << range.start.saturating_sub(base)) & (0xff >> (base + WIDTH).saturating_sub(range.end));
        let near = near_bits(simd, row, block) & inside;
        for (hit, lane) in hits[count..count + WIDTH].iter_mut().zip(PLACES[usize::from(near)]) {
            *hit = base as u32 + lane;
        }
        count += near.count_ones() as usize;
    }
    count
}

/// Which grains of a block are near, one bit for each.
#[inline(always)]
fn near_bits<S: Simd>(simd: S, row: &Row4, Columns([x, y, z, reach]): &Columns) -> u8 {
    const BITS: [f64; WIDTH] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];
    /// Added to a small whole number it leaves that in the last bits.
    const WHOLE: f64 = (1_u64 << 52) as f64;
    let zero = Lanes::zero(simd);
    let mut sum = zero;
    for part in 0..WIDTH / S::F64_LANES {
        let between = [
            zero.splat(row[0]) - Lanes::load(simd, x, part),
            zero.splat(row[1]) - Lanes::load(simd, y, part),
            zero.splat(row[2]) - Lanes::load(simd, z, part),
        ];
        let reach = zero.splat(row[3]) + Lanes::load(simd, reach, part);
        let near = dot(between, between).less(reach * reach);
        sum = sum + Lanes::pick(near, Lanes::load(simd, &BITS, part), zero);
    }
    (sum.sum() + WHOLE).to_bits() as u8
}

/// The places of the bits set in a number, and zeros behind them.
const PLACES: [[u32; WIDTH]; 1 << WIDTH] = {
    let mut places = [[0; WIDTH]; 1 << WIDTH];
    let mut number = 0;
    while number < places.len() {
        let (mut bit, mut count) = (0, 0);
        while bit < WIDTH {
            if number >> bit & 1 == 1 {
                places[number][count] = bit as u32;
                count += 1;
            }
            bit += 1;
        }
        number += 1;
    }
    places
};

#[cfg(test)]
mod tests {
    use super::super::world::Vectors;
    use super::*;
    use crate::rng::Stream;

    fn near(a: &Row4, b: &Row4) -> bool {
        let (x, y, z, reach) = (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] + b[3]);
        x * x + y * y + z * z < reach * reach
    }

    #[test]
    fn every_near_pair_is_found_once_and_in_order() {
        let mut stream = Stream::new(1, "grid");
        let mut rows: Vec<Row4> = (0..1000)
            .map(|_| Row4([stream.uniform(), 0.3 * stream.uniform(), stream.uniform(), stream.uniform_in(0.01, 0.05)]))
            .collect();
        let mut grid = Grid::default();
        grid.sort(&rows, &vec![true; rows.len()], 0.1);
        rows = grid.order.iter().map(|&k| rows[k as usize]).collect();
        let all = (0..rows.len()).flat_map(|i| (i + 1..rows.len()).map(move |j| (i, j)));
        let expected: Vec<_> = all.filter(|&(i, j)| near(&rows[i], &rows[j])).collect();
        assert!(expected.len() > 800);
        for vectors in [Vectors::Scalar, Vectors::Avx2, Vectors::Widest] {
            let mut found = Vec::new();
            grid.pairs(vectors.arch(), &rows, &mut Search::default(), |i, j| found.push((i, j)));
            assert_eq!(found, expected, "{vectors:?}");
        }
    }

    #[test]
    fn a_box_holds_the_grains_inside_it_in_order() {
        let mut stream = Stream::new(2, "grid");
        let rows: Vec<Row4> =
            (0..500).map(|_| Row4([stream.uniform(), stream.uniform(), 0.4 * stream.uniform(), 0.01])).collect();
        let mut grid = Grid::default();
        grid.sort(&rows, &vec![true; rows.len()], 0.1);
        let sorted: Vec<Row4> = grid.order.iter().map(|&k| rows[k as usize]).collect();
        for corners in [[[0.2, 0.3, 0.1], [0.4, 0.5, 0.3]], [[-1.0; 3], [2.0; 3]], [[0.9, 0.9, 0.35], [3.0; 3]]] {
            let mut found = Vec::new();
            grid.visit_box(corners, |i| found.push(i));
            assert!(found.is_sorted());
            let inside = |row: &Row4| (0..3).all(|c| corners[0][c] <= row[c] && row[c] <= corners[1][c]);
            let missing = (0..sorted.len()).find(|i| inside(&sorted[*i]) && !found.contains(i));
            assert_eq!(missing, None);
        }
    }

    #[test]
    fn grains_not_kept_are_left_out_and_far_ones_do_not_blow_up_the_grid() {
        let rows = [[0.0, 0.0, 0.0, 1e-3], [1e9, 0.0, 0.0, 1e-3], [1e-4, 0.0, 1e9, 1e-3]].map(Row4);
        let mut grid = Grid::default();
        grid.sort(&rows, &[true, false, true], 2e-3);
        assert_eq!(grid.order, [0, 2]);
    }
}
