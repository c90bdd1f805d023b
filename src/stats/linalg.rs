//! The small dense linear algebra that Gaussian processes and information matrices need.
//!
//! Storage and eigenvectors are nalgebra's, built without its `std` feature: then no product goes through
//! `matrixmultiply`, which picks its kernel from the CPU at run time. The factorisation runs in `kernels`, which
//! gives nalgebra's bits in a third of its time. Sums run column by column in a fixed order. Deliberately absent: general
//! solvers, sparse matrices, anything for more than a few thousand rows.

use super::kernels::{cholesky, invert_lower, solve_lower, square_of_inverse};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

pub use super::kernels::dot;

/// A matrix that cannot be factorised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LinalgError {
    /// The matrix is not positive definite in floating point.
    #[error(
        "a covariance of {size} rows is not positive definite, even with {jitter:e} on its diagonal; \
         look for repeated points or raise the jitter"
    )]
    NotPositiveDefinite {
        /// Rows of the matrix.
        size: usize,
        /// Largest jitter that was tried.
        jitter: f64,
    },
}

/// How much is added to a diagonal, and how far this may grow where a factorisation fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jitter {
    /// First amount, relative to the process variance.
    pub first: f64,
    /// Largest amount; each failure multiplies the amount by ten until it is exceeded.
    pub limit: f64,
}

impl Default for Jitter {
    /// 10⁻⁸, at which a design of some hundred points can always be factorised, and at most 10⁻⁴.
    fn default() -> Self {
        Self { first: 1e-8, limit: 1e-4 }
    }
}

impl Jitter {
    /// Calls `attempt` with growing amounts until it succeeds; gives its value and the amount.
    ///
    /// # Errors
    /// The last failure, when the limit is exceeded.
    pub fn escalate<T>(&self, mut attempt: impl FnMut(f64) -> Result<T, LinalgError>) -> Result<(T, f64), LinalgError> {
        let mut amount = self.first;
        loop {
            match attempt(amount) {
                Ok(value) => return Ok((value, amount)),
                Err(error) if amount * 10.0 > self.limit * (1.0 + 1e-9) => return Err(error),
                Err(_) => amount *= 10.0,
            }
        }
    }
}

/// Cholesky factor K = L Lᵀ of a symmetric positive definite matrix, shape (n, n).
#[derive(Debug, Clone)]
pub struct SpdFactor {
    /// L in the lower triangle; what stands above it means nothing.
    lower: DMatrix<f64>,
}

impl SpdFactor {
    /// Factorises `matrix`, of which only the lower triangle is read.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] where a pivot is not positive.
    pub fn new(mut matrix: DMatrix<f64>) -> Result<Self, LinalgError> {
        let size = matrix.nrows();
        if cholesky(matrix.as_mut_slice(), size) {
            Ok(Self { lower: matrix })
        } else {
            Err(LinalgError::NotPositiveDefinite { size, jitter: 0.0 })
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.lower.nrows()
    }

    /// ln det K = 2 Σ ln L_ii.
    pub fn log_det(&self) -> f64 {
        let diagonal = self.lower.diagonal();
        2.0 * diagonal.iter().map(|&pivot| libm::log(pivot)).sum::<f64>()
    }

    /// L⁻¹ b, shape (n) as b.
    pub fn half_solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        solve_lower(self.lower.as_slice(), &mut x);
        x
    }

    /// L⁻ᵀ b, shape (n) as b.
    pub fn transposed_half_solve(&self, b: &[f64]) -> Vec<f64> {
        let (lower, n) = (self.lower.as_slice(), self.size());
        let mut x = b.to_vec();
        for column in (0..n).rev() {
            let below = &lower[column * n..(column + 1) * n];
            let known = dot(&below[column + 1..], &x[column + 1..]);
            x[column] = (x[column] - known) / below[column];
        }
        x
    }

    /// K⁻¹ b, shape (n) as b.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        self.transposed_half_solve(&self.half_solve(b))
    }

    /// K⁻¹, shape (n, n); both triangles are filled.
    ///
    /// L⁻¹ is built column by column, then K⁻¹ = L⁻ᵀ L⁻¹: a third of the work of solving for the unit matrix.
    pub fn inverse(&self) -> DMatrix<f64> {
        let n = self.size();
        let (mut inverse_lower, mut inverse) = (DMatrix::zeros(n, n), DMatrix::zeros(n, n));
        invert_lower(self.lower.as_slice(), inverse_lower.as_mut_slice(), n);
        square_of_inverse(inverse_lower.as_slice(), inverse.as_mut_slice(), n);
        inverse
    }
}

/// Eigenvalues in rising order with unit eigenvectors of a symmetric matrix given as rows, shape (p, p).
///
/// The sign of a vector is chosen so that its largest component is positive: a name for a direction must not flip.
pub fn symmetric_eigen(rows: &[Vec<f64>]) -> Vec<(f64, Vec<f64>)> {
    let matrix = DMatrix::from_fn(rows.len(), rows.len(), |i, j| 0.5 * (rows[i][j] + rows[j][i]));
    let eigen = SymmetricEigen::new(matrix);
    let columns = eigen.eigenvectors.column_iter().map(|column| signed(column.into_owned()));
    let mut pairs: Vec<_> = eigen.eigenvalues.iter().copied().zip(columns).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs
}

fn signed(vector: DVector<f64>) -> Vec<f64> {
    let largest = vector.iter().fold(0.0_f64, |best, &value| if value.abs() > best.abs() { value } else { best });
    vector.iter().map(|value| if largest < 0.0 { -value } else { *value }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;

    /// A A' + n I with normal A: positive definite, condition number of order ten.
    fn random_spd(n: usize) -> DMatrix<f64> {
        let mut stream = Stream::new(n as u64, "random spd");
        let a = DMatrix::from_fn(n, n, |_, _| stream.normal());
        &a * a.transpose() + DMatrix::identity(n, n) * n as f64
    }

    /// Sizes on both sides of the block edges of four.
    const SIZES: [usize; 8] = [1, 2, 3, 4, 5, 31, 32, 33];

    #[test]
    fn inverse_times_matrix_is_unity() {
        for n in SIZES {
            let matrix = random_spd(n);
            let inverse = SpdFactor::new(matrix.clone()).unwrap().inverse();
            let error = (matrix * inverse - DMatrix::identity(n, n)).amax();
            // n eps times a condition number near ten, with a margin of ten.
            assert!(error < 1e-12, "n {n}: {error:e}");
        }
    }

    #[test]
    fn solve_agrees_with_the_inverse_and_the_determinant_with_nalgebra() {
        for n in SIZES {
            let (matrix, mut stream) = (random_spd(n), Stream::new(1, "right-hand side"));
            let b: Vec<f64> = (0..n).map(|_| stream.normal()).collect();
            let factor = SpdFactor::new(matrix.clone()).unwrap();
            let residual = &matrix * DVector::from_vec(factor.solve(&b)) - DVector::from_vec(b);
            assert!(residual.amax() < 1e-12, "n {n}: {:e}", residual.amax());
            let log_det = libm::log(matrix.lu().determinant());
            assert!((factor.log_det() - log_det).abs() < 1e-11 * log_det.abs(), "n {n}");
        }
    }

    #[test]
    fn an_indefinite_matrix_is_refused_and_jitter_repairs_a_singular_one() {
        let singular = DMatrix::from_element(3, 3, 1.0);
        let indefinite = singular.clone() - DMatrix::identity(3, 3) * 2.0;
        assert!(SpdFactor::new(indefinite.clone()).is_err());
        let shifted = |matrix: &DMatrix<f64>, amount| SpdFactor::new(matrix + DMatrix::identity(3, 3) * amount);
        let start = Jitter { first: 1e-18, limit: 1e-4 };
        let (_, amount) = start.escalate(|amount| shifted(&singular, amount)).unwrap();
        assert!(amount > 1e-17 && amount < 1e-13, "{amount:e}");
        assert!(Jitter::default().escalate(|amount| shifted(&indefinite, amount)).is_err());
    }

    #[test]
    fn eigenpairs_rebuild_the_matrix() {
        let rows = vec![vec![2.0, -1.0, 0.0], vec![-1.0, 2.0, -1.0], vec![0.0, -1.0, 2.0]];
        let pairs = symmetric_eigen(&rows);
        // Eigenvalues of the second-difference matrix: 2 - 2 cos(k pi / 4).
        for (pair, exact) in pairs.iter().zip([2.0 - 2.0_f64.sqrt(), 2.0, 2.0 + 2.0_f64.sqrt()]) {
            assert!((pair.0 - exact).abs() < 1e-14);
            for (row, component) in rows.iter().zip(&pair.1) {
                let product: f64 = row.iter().zip(&pair.1).map(|(a, v)| a * v).sum();
                assert!((product - pair.0 * component).abs() < 1e-14);
            }
        }
    }
}
