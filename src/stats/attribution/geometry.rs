//! Whitening, and the space that calibration cannot reach.
//!
//! Takes a checked [`Problem`]; gives the whitened rows (observables, then priors of parameters) and, for every choice of bound-held parameters, an orthonormal basis Q of what is orthogonal to the
//! remaining columns of J̃. Knows nothing of effects.

use super::{AttributionError, Options, Parameter, Problem, RowKind};
use nalgebra::{DMatrix, DVector};

/// Relative singular value below which a column adds nothing to the tangent space.
const RANK_TOLERANCE: f64 = 1e-12;
/// Distance from a bound, in units of the parameter's width, that counts as sitting on it.
const ON_BOUND: f64 = 1e-6;

/// A parameter that sits on its bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held {
    /// Column of the tangent matrix.
    pub column: usize,
    /// +1 at the lower bound (may only grow), −1 at the upper one.
    pub inward: f64,
}

/// The problem in units of its own noise: M = used observables + priors rows, p parameters.
#[derive(Debug, Clone)]
pub(super) struct Whitened {
    /// Indices of the observables in use.
    pub kept: Vec<usize>,
    /// Lower Cholesky factor of Σ of the observables in use.
    pub factor: DMatrix<f64>,
    /// r̃ (M).
    pub residual: DVector<f64>,
    /// J̃ (M × p); a parameter's column is per width of its bounds.
    pub tangent: DMatrix<f64>,
    /// (name, sd) of each appended prior row.
    pub priors: Vec<(String, f64)>,
    /// Parameters on a bound.
    pub held: Vec<Held>,
    /// Condition number of J̃; infinite where columns depend on each other.
    pub condition: f64,
}

impl Whitened {
    pub(super) fn new(problem: &Problem, options: &Options) -> Result<Self, AttributionError> {
        let kept = used_rows(problem, options);
        let sigma = problem.covariance.select_rows(&kept).select_columns(&kept);
        let factor =
            sigma.cholesky().ok_or_else(|| AttributionError::NotPositiveDefinite("the covariance".into()))?.l();
        let (priors, rows) = prior_rows(problem);
        let data = whiten(&factor, &per_width(&problem.jacobian, &problem.parameters).select_rows(&kept));
        let tangent = stack(&data, &rows.tangent);
        let residual = whiten_vector(&factor, problem.residual.select_rows(&kept).as_slice());
        let residual = DVector::from_iterator(tangent.nrows(), residual.iter().chain(rows.residual.iter()).copied());
        let condition = condition(&tangent);
        Ok(Self { kept, factor, residual, tangent, priors, held: held(&problem.parameters), condition })
    }

    /// Number of whitened rows M.
    pub(super) fn len(&self) -> usize {
        self.residual.len()
    }

    /// L⁻¹g of a vector over all observables, zero on the prior rows.
    pub(super) fn vector(&self, g: &DVector<f64>) -> DVector<f64> {
        let data = whiten_vector(&self.factor, g.select_rows(&self.kept).as_slice());
        DVector::from_fn(self.len(), |i, _| if i < data.len() { data[i] } else { 0.0 })
    }

    /// L⁻¹CL⁻ᵀ of a covariance over all observables, zero on the prior rows.
    pub(super) fn covariance(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        let block = c.select_rows(&self.kept).select_columns(&self.kept);
        let half = whiten(&self.factor, &block);
        let data = whiten(&self.factor, &half.transpose());
        let m = self.kept.len();
        DMatrix::from_fn(
            self.len(),
            self.len(),
            |i, j| {
                if i < m && j < m { 0.5 * (data[(i, j)] + data[(j, i)]) } else { 0.0 }
            },
        )
    }

    /// Calibration follows a whitened signature of an effect at `strength`: J̃ alone says how far, and a parameter that would leave
    /// its bounds stops there, the one that is furthest beyond first.
    pub(super) fn follow(&self, parameters: &[Parameter], strength: f64, vector: &DVector<f64>) -> Followed {
        let mut stopped: Vec<Option<f64>> = vec![None; self.tangent.ncols()];
        loop {
            let geometry = Geometry::without(self, 0, |column| stopped[column].is_some());
            let shift = |(column, stop): (usize, &Option<f64>)| stop.map(|stop| self.tangent.column(column) * stop);
            let left = stopped.iter().enumerate().filter_map(shift).fold(vector.clone(), |left, shift| left + shift);
            let mut moves = -(&geometry.inverse * &left);
            let beyond = |(column, parameter): (usize, &Parameter)| {
                let Parameter { value, lower, upper, .. } = *parameter;
                let (width, asked) = (upper - lower, value + moves[column] * (upper - lower) * strength);
                let stop = asked.clamp(lower, upper);
                (stop != asked).then(|| ((asked - stop).abs() / width, column, (stop - value) / (width * strength)))
            };
            match parameters.iter().enumerate().filter_map(beyond).max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((_, column, stop)) => stopped[column] = Some(stop),
                None => {
                    let stops = stopped.iter().enumerate().filter_map(|(column, stop)| Some((column, (*stop)?)));
                    stops.for_each(|(column, stop)| moves[column] = stop);
                    return Followed { geometry, moves, left };
                }
            }
        }
    }

    /// One geometry per choice of parameters that stay on their bound; the first is the unrestricted one.
    pub(super) fn geometries(&self) -> Vec<Geometry> {
        (0..1_usize << self.held.len()).map(|choice| Geometry::new(self, choice)).collect()
    }
}

/// Where calibration ends up that follows an effect.
pub(super) struct Followed {
    /// Of the parameters that did not stop at a bound.
    pub geometry: Geometry,
    /// Move of every column per unit of strength, in its own unit (P).
    pub moves: DVector<f64>,
    /// The signature and what the parameters that stopped add to it (M).
    pub left: DVector<f64>,
}

/// The complement of the columns that are free to move.
#[derive(Debug, Clone)]
pub(super) struct Geometry {
    /// Bit i: parameter `held[i]` stays on its bound.
    pub choice: usize,
    /// Q (M × d).
    pub basis: DMatrix<f64>,
    /// J̃⁺ (P × M), zero rows for columns that were dropped.
    pub inverse: DMatrix<f64>,
}

impl Geometry {
    fn new(whitened: &Whitened, choice: usize) -> Self {
        Self::without(whitened, choice, |column| {
            whitened.held.iter().enumerate().any(|(i, held)| choice >> i & 1 == 1 && held.column == column)
        })
    }

    /// With columns that do not move.
    fn without(whitened: &Whitened, choice: usize, dropped: impl Fn(usize) -> bool) -> Self {
        let free: Vec<usize> = (0..whitened.tangent.ncols()).filter(|column| !dropped(*column)).collect();
        let tangent = whitened.tangent.select_columns(&free);
        let (range, inverse) = decompose(&tangent);
        let mut padded = DMatrix::zeros(whitened.tangent.ncols(), whitened.len());
        for (row, column) in free.iter().enumerate() {
            padded.set_row(*column, &inverse.row(row));
        }
        Self { choice, basis: complement(&range), inverse: padded }
    }

    /// QᵀCQ of a covariance (M × M).
    pub(super) fn projected(&self, covariance: &DMatrix<f64>) -> DMatrix<f64> {
        self.basis.tr_mul(covariance) * &self.basis
    }

    /// d, the number of directions that calibration cannot reach.
    pub(super) fn evidence(&self) -> usize {
        self.basis.ncols()
    }
}

/// Orthonormal basis of the complement of a tangent matrix.
pub(super) fn complement_of(tangent: &DMatrix<f64>) -> DMatrix<f64> {
    complement(&decompose(tangent).0)
}

/// Orthonormal basis of the range of a tangent matrix.
pub(super) fn range_of(tangent: &DMatrix<f64>) -> DMatrix<f64> {
    decompose(tangent).0
}

/// L⁻¹A for a lower triangular L with a positive diagonal.
pub(super) fn whiten(factor: &DMatrix<f64>, a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut out = a.clone();
    // A Cholesky factor has a positive diagonal, so that the substitution always succeeds.
    factor.solve_lower_triangular_mut(&mut out);
    out
}

/// L⁻¹a.
pub(super) fn whiten_vector(factor: &DMatrix<f64>, a: &[f64]) -> DVector<f64> {
    let mut out = DVector::from_column_slice(a);
    factor.solve_lower_triangular_mut(&mut out);
    out
}

fn used_rows(problem: &Problem, options: &Options) -> Vec<usize> {
    let used = |i: &usize| {
        let row = &problem.rows[*i];
        row.kind != RowKind::LnSd || row.count >= options.small_count
    };
    (0..problem.rows.len()).filter(used).collect()
}

struct PriorRows {
    residual: Vec<f64>,
    tangent: DMatrix<f64>,
}

/// Rows of the priors, parameters in order.
fn prior_rows(problem: &Problem) -> (Vec<(String, f64)>, PriorRows) {
    let mut names = Vec::new();
    let mut residual = Vec::new();
    let mut entries = Vec::new();
    for (column, parameter) in problem.parameters.iter().enumerate() {
        if let Some(prior) = parameter.prior {
            names.push((format!("prior of {}", parameter.name), prior.sd));
            residual.push((prior.mean - parameter.value) / prior.sd);
            entries.push((column, (parameter.upper - parameter.lower) / prior.sd));
        }
    }
    let mut tangent = DMatrix::zeros(entries.len(), problem.parameters.len());
    for (row, (column, value)) in entries.into_iter().enumerate() {
        tangent[(row, column)] = value;
    }
    (names, PriorRows { residual, tangent })
}

/// Sensitivities per width of a parameter (m × p).
pub(super) fn per_width(jacobian: &DMatrix<f64>, parameters: &[Parameter]) -> DMatrix<f64> {
    DMatrix::from_fn(jacobian.nrows(), parameters.len(), |i, j| {
        jacobian[(i, j)] * (parameters[j].upper - parameters[j].lower)
    })
}

fn held(parameters: &[Parameter]) -> Vec<Held> {
    let on = |(column, p): (usize, &Parameter)| {
        let margin = ON_BOUND * (p.upper - p.lower);
        if p.value - p.lower <= margin {
            Some(Held { column, inward: 1.0 })
        } else if p.upper - p.value <= margin {
            Some(Held { column, inward: -1.0 })
        } else {
            None
        }
    };
    parameters.iter().enumerate().filter_map(on).collect()
}

fn stack(top: &DMatrix<f64>, bottom: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(top.nrows() + bottom.nrows(), top.ncols(), |i, j| {
        if i < top.nrows() { top[(i, j)] } else { bottom[(i - top.nrows(), j)] }
    })
}

fn condition(tangent: &DMatrix<f64>) -> f64 {
    if tangent.is_empty() {
        return 1.0;
    }
    let values = tangent.singular_values();
    let smallest = if tangent.nrows() < tangent.ncols() { 0.0 } else { values.min() };
    values.max() / smallest
}

/// Orthonormal basis of the range of A, and its pseudo-inverse.
fn decompose(a: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    if a.is_empty() {
        return (DMatrix::zeros(a.nrows(), 0), DMatrix::zeros(a.ncols(), a.nrows()));
    }
    let svd = a.clone().svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
        return (DMatrix::zeros(a.nrows(), 0), DMatrix::zeros(a.ncols(), a.nrows()));
    };
    let floor = RANK_TOLERANCE * svd.singular_values.max();
    let used: Vec<usize> = (0..svd.singular_values.len()).filter(|i| svd.singular_values[*i] > floor).collect();
    let range = u.select_columns(&used);
    let mut scaled = vt.select_rows(&used).transpose();
    for (column, i) in used.iter().enumerate() {
        let inverse = 1.0 / svd.singular_values[*i];
        scaled.column_mut(column).scale_mut(inverse);
    }
    let inverse = &scaled * range.transpose();
    (range, inverse)
}

/// Completes an orthonormal set to a basis: Gram and Schmidt, twice, on the unit vector that is least represented.
fn complement(range: &DMatrix<f64>) -> DMatrix<f64> {
    let m = range.nrows();
    let mut basis: Vec<DVector<f64>> = range.column_iter().map(|column| column.into_owned()).collect();
    // What of each unit vector is not yet represented: 1 − Σ (its components)².
    let mut missing: Vec<f64> = (0..m).map(|i| 1.0 - basis.iter().map(|b| b[i] * b[i]).sum::<f64>()).collect();
    while basis.len() < m {
        let pick = (0..m).fold(0, |best, i| if missing[i] > missing[best] { i } else { best });
        let mut v = DVector::zeros(m);
        v[pick] = 1.0;
        for _ in 0..2 {
            for b in &basis {
                v.axpy(-b.dot(&v), b, 1.0);
            }
        }
        v.unscale_mut(v.norm());
        missing.iter_mut().zip(v.iter()).for_each(|(left, x)| *left -= x * x);
        basis.push(v);
    }
    DMatrix::from_fn(m, m - range.ncols(), |i, j| basis[range.ncols() + j][i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn complement_is_orthonormal_and_orthogonal() {
        let a = DMatrix::from_fn(9, 3, |i, j| (1 + i * (j + 2) % 7) as f64 + if j == 2 { 0.5 * i as f64 } else { 0.0 });
        let q = complement_of(&a);
        assert_eq!(q.shape(), (9, 6));
        assert!((q.transpose() * &q - DMatrix::identity(6, 6)).amax() < 1e-14);
        assert!((q.transpose() * &a).amax() < 1e-13);
    }

    /// Two parameters of which the first hardly shows: it would have to move by 24 widths, stops at its bound after half a
    /// width, and the second takes up what it then can.
    #[test]
    fn calibration_follows_an_effect_to_the_bounds() {
        let parameter = |name: &str| Parameter { name: name.into(), value: 0.5, lower: 0.0, upper: 1.0, prior: None };
        let parameters = [parameter("first"), parameter("second")];
        let whitened = Whitened {
            kept: vec![0, 1, 2],
            factor: DMatrix::identity(3, 3),
            residual: DVector::zeros(3),
            tangent: DMatrix::from_row_slice(3, 2, &[0.1, 2.0, 0.0, 10.0, 0.0, 0.0]),
            priors: Vec::new(),
            held: Vec::new(),
            condition: 1.0,
        };
        let signature = DVector::from_vec(vec![1.0, -1.0, 0.3]);
        let followed = whitened.follow(&parameters, 2.0, &signature);
        // The first moves by −0.25 a unit of strength; the second then solves 2 (0.975 + 2m) + 10 (−1 + 10m) = 0.
        let second = 8.05 / 104.0;
        assert!((followed.moves - DVector::from_vec(vec![-0.25, second])).amax() < 1e-14);
        assert!((followed.left - DVector::from_vec(vec![0.975, -1.0, 0.3])).amax() < 1e-14);
        assert_eq!(followed.geometry.evidence(), 2);
        let free = whitened.follow(&parameters, 1e-3, &signature);
        assert_eq!((free.geometry.evidence(), free.left), (1, signature));
    }

    #[test]
    fn dependent_columns_count_once() {
        let a = DMatrix::from_fn(5, 2, |i, j| (i + 1) as f64 * (j + 1) as f64);
        assert_eq!(complement_of(&a).ncols(), 4);
        assert_eq!(complement_of(&DMatrix::zeros(5, 0)).ncols(), 5);
        assert_eq!(complement_of(&DMatrix::zeros(5, 2)).ncols(), 5);
    }
}
