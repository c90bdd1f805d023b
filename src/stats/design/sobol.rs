//! The Sobol sequence: points that fill the unit cube evenly, however many are taken.
//!
//! Direction numbers of Joe & Kuo (2008, table new-joe-kuo-6.21201) in Gray-code order (Antonov & Saleev 1979). A seed
//! shifts every coordinate by its own random bits (digital shift), which keeps the evenness and makes repetitions
//! independent. For designs of many parameters, where a factorial is too dear, and for sensitivity indices.

use crate::rng::Stream;
use crate::stats::points::Points;

/// Degree s, coefficients a and first direction numbers m of the primitive polynomials of dimensions 2 to 21.
const POLYNOMIALS: [(u32, u32, &[u32]); MAX_DIMENSION - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// Largest dimension for which direction numbers are held.
pub const MAX_DIMENSION: usize = 21;

const BITS: usize = 32;

/// More parameters than there are direction numbers for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a Sobol sequence of {0} dimensions was asked for, {MAX_DIMENSION} is the most; use fewer parameters")]
pub struct TooManyDimensions(pub usize);

/// A Sobol sequence, one point after the other.
#[derive(Debug, Clone)]
pub struct Sobol {
    directions: Vec<[u32; BITS]>,
    state: Vec<u32>,
    index: u32,
}

impl Sobol {
    /// The plain sequence, which begins at the origin.
    ///
    /// # Errors
    /// [`TooManyDimensions`] above [`MAX_DIMENSION`].
    pub fn new(dimension: usize) -> Result<Self, TooManyDimensions> {
        if dimension > MAX_DIMENSION {
            return Err(TooManyDimensions(dimension));
        }
        let directions = (0..dimension).map(directions).collect();
        Ok(Self { directions, state: vec![0; dimension], index: 0 })
    }

    /// The sequence with every coordinate shifted by random bits of `seed`.
    ///
    /// # Errors
    /// [`TooManyDimensions`] above [`MAX_DIMENSION`].
    pub fn shifted(dimension: usize, seed: u64) -> Result<Self, TooManyDimensions> {
        let (mut sequence, mut stream) = (Self::new(dimension)?, Stream::new(seed, "sobol shift"));
        sequence.state.iter_mut().for_each(|bits| *bits = stream.index(1 << BITS) as u32);
        Ok(sequence)
    }

    /// The next point, in the middle of its smallest cell and thus inside the cube.
    fn next_point(&mut self) -> Vec<f64> {
        let cell = 1.0 / (1_u64 << BITS) as f64;
        let point = self.state.iter().map(|&bits| (f64::from(bits) + 0.5) * cell).collect();
        let bit = self.index.trailing_ones() as usize;
        self.state.iter_mut().zip(&self.directions).for_each(|(bits, directions)| *bits ^= directions[bit]);
        self.index += 1;
        point
    }

    /// The next `n` points, shape (n, p). A power of two fills the cube most evenly.
    pub fn take(&mut self, n: usize) -> Points {
        let mut points = Points::empty(self.directions.len());
        (0..n).for_each(|_| points.push(&self.next_point()));
        points
    }
}

/// Direction numbers of zero-based dimension `d`: v_k = m_k 2^(32−k), m_k by the recurrence of its polynomial.
fn directions(d: usize) -> [u32; BITS] {
    let mut v = [0; BITS];
    let Some(&(degree, coefficients, first)) = d.checked_sub(1).map(|index| &POLYNOMIALS[index]) else {
        v.iter_mut().enumerate().for_each(|(k, direction)| *direction = 1 << (BITS - 1 - k));
        return v;
    };
    let s = degree as usize;
    for k in 0..BITS {
        v[k] = match first.get(k) {
            Some(m) => m << (BITS - 1 - k),
            None => {
                let inner = (1..s).filter(|i| coefficients >> (s - 1 - i) & 1 == 1).map(|i| v[k - i]);
                inner.fold(v[k - s] ^ (v[k - s] >> s), |sum, term| sum ^ term)
            }
        };
    }
    v
}

#[cfg(test)]
mod tests {
    use super::super::metrics::centred_discrepancy;
    use super::*;

    #[test]
    fn the_first_points_are_the_published_ones() {
        // The usual table begins 0, 1/2, 3/4, 1/4 and 0, 1/2, 1/4, 3/4; here each lies in the middle of its cell.
        let points = Sobol::new(3).unwrap().take(4);
        let expected = [[0.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.75, 0.25, 0.25], [0.25, 0.75, 0.75]];
        for (row, expected) in points.rows().zip(expected) {
            assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{row:?} {expected:?}");
        }
    }

    #[test]
    fn every_dimension_fills_every_slice_once() {
        for mut sequence in [Sobol::new(MAX_DIMENSION).unwrap(), Sobol::shifted(MAX_DIMENSION, 7).unwrap()] {
            let points = sequence.take(256);
            for d in 0..MAX_DIMENSION {
                let mut slices: Vec<usize> = points.rows().map(|row| (row[d] * 256.0) as usize).collect();
                slices.sort_unstable();
                assert_eq!(slices, (0..256).collect::<Vec<_>>(), "dimension {d}");
            }
        }
        assert_eq!(Sobol::new(22).unwrap_err(), TooManyDimensions(22));
    }

    #[test]
    fn it_is_far_more_even_than_random_points() {
        let mut stream = Stream::new(1, "random points");
        let rows: Vec<[f64; 3]> = (0..128).map(|_| [stream.uniform(), stream.uniform(), stream.uniform()]).collect();
        let random = centred_discrepancy(&Points::from_rows(&rows, 3).unwrap());
        let sobol = centred_discrepancy(&Sobol::shifted(3, 3).unwrap().take(128));
        assert!(sobol < 0.1 * random, "{sobol:e} against {random:e}");
    }
}
