//! Which parameter moves a quantity: Sobol indices of first and total order.
//!
//! For f on the unit cube with independent uniform parameters, S_d = Var(E(f|x_d))/Var f is the share of the variance
//! that parameter d explains alone, T_d = E(Var(f|x_−d))/Var f the share that involves it at all. Estimated from two
//! matrices A and B of a shifted Sobol sequence, with A_B^d = A with column d from B: S_d after Saltelli et al. 2010,
//! T_d after Jansen 1999. Works on any function; on a metamodel it costs seconds.

use super::design::sobol::{Sobol, TooManyDimensions};
use super::points::Points;
use rayon::prelude::*;

/// Indices of one parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// S_d: share of the variance explained by the parameter alone; may be slightly negative by sampling error.
    pub first: f64,
    /// T_d: share of the variance that involves the parameter.
    pub total: f64,
}

/// Indices of every parameter, and the moments they refer to.
#[derive(Debug, Clone, PartialEq)]
pub struct SobolIndices {
    /// Mean of f over the cube.
    pub mean: f64,
    /// Variance of f over the cube.
    pub variance: f64,
    /// One entry per parameter; zeros where f is constant.
    pub indices: Vec<Index>,
}

/// Sobol indices of `function` on the unit cube of `dimension` from `samples` rows of A and B.
///
/// Costs samples · (dimension + 2) evaluations, spread over threads; the result does not depend on their number.
/// `samples` should be a power of two; 4096 gives errors of about 0.01.
///
/// # Errors
/// [`TooManyDimensions`] where 2 · dimension exceeds what the Sobol sequence offers.
pub fn sobol_indices(
    function: impl Fn(&[f64]) -> f64 + Sync,
    dimension: usize,
    samples: usize,
    seed: u64,
) -> Result<SobolIndices, TooManyDimensions> {
    let both = Sobol::shifted(2 * dimension, seed)?.take(samples);
    let of_row = |i: usize| row_values(&function, &both, i, dimension);
    let rows: Vec<Vec<f64>> = (0..samples).into_par_iter().map(of_row).collect();
    let n = samples as f64;
    let mean = rows.iter().map(|row| row[0] + row[1]).sum::<f64>() / (2.0 * n);
    let square = |row: &Vec<f64>| (row[0] - mean) * (row[0] - mean) + (row[1] - mean) * (row[1] - mean);
    let variance = rows.iter().map(square).sum::<f64>() / (2.0 * n);
    let index = |d: usize| {
        let first = rows.iter().map(|row| (row[1] - mean) * (row[2 + d] - row[0])).sum::<f64>() / n;
        let total = rows.iter().map(|row| (row[0] - row[2 + d]) * (row[0] - row[2 + d])).sum::<f64>() / (2.0 * n);
        if variance > 0.0 {
            Index { first: first / variance, total: total / variance }
        } else {
            Index { first: 0.0, total: 0.0 }
        }
    };
    Ok(SobolIndices { mean, variance, indices: (0..dimension).map(index).collect() })
}

/// f(A_i), f(B_i), f(A_B^1 of row i), f(A_B^2 …) …
fn row_values(function: &impl Fn(&[f64]) -> f64, both: &Points, i: usize, dimension: usize) -> Vec<f64> {
    let (a, b) = both.row(i).split_at(dimension);
    let mixed = |d: usize| {
        let mut x = a.to_vec();
        x[d] = b[d];
        function(&x)
    };
    [function(a), function(b)].into_iter().chain((0..dimension).map(mixed)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_function_has_shares_of_its_squared_slopes() {
        let found = sobol_indices(|x| 3.0 + 2.0 * x[0] + x[1], 3, 1024, 1).unwrap();
        assert!((found.mean - 4.5).abs() < 1e-3 && (found.variance - 5.0 / 12.0).abs() < 1e-3);
        for (index, share) in found.indices.iter().zip([0.8, 0.2, 0.0]) {
            assert!((index.first - share).abs() < 5e-3 && (index.total - share).abs() < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn a_constant_has_no_shares_and_threads_change_nothing() {
        let found = sobol_indices(|_| 2.0, 2, 64, 1).unwrap();
        assert_eq!(found.indices, vec![Index { first: 0.0, total: 0.0 }; 2]);
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sobol_indices(|x| x[0] * x[1] + x[1], 2, 512, 9).unwrap())
        };
        assert_eq!(run(1), run(2));
    }
}
