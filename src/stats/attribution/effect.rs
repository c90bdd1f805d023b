//! One candidate effect seen from the space that calibration cannot reach: its shift, its noise, its fit.
//!
//! Takes projected signatures and the covariance C of their error; works in the eigenbasis of C, where the noise of a
//! residual that carries the effect at strength η is the diagonal 1 + η²λ. A fit minimises
//! h(η) = Σ (tᵢ − ηvᵢ(η))²/(1 + η²λᵢ) over the physical range, which is the profile likelihood of η with the true
//! signature unknown within its error: unbiased where ordinary projection is attenuated by signature noise.
//! Knows nothing of other effects, verdicts or random numbers.

use super::geometry::Geometry;
use crate::stats::special;
use nalgebra::{DMatrix, DVector};

/// Grid steps on each side of zero; the minimum is then refined by parabolas, exactly where h is quadratic.
const STEPS: usize = 12;
/// Parabolic refinements.
const REFINEMENTS: usize = 4;
/// Change of the strength, in grid steps, at which refinement stops.
const PRECISION: f64 = 1e-6;
/// Relative eigenvalue below which a direction of signature error counts as exactly known.
const EXACT: f64 = 1e-12;

/// Vectors per unit of strength at increasing strengths: linear between them, held beyond them.
#[derive(Debug, Clone)]
pub(super) struct Curve {
    pub strengths: Vec<f64>,
    pub vectors: Vec<Vec<f64>>,
}

impl Curve {
    pub(super) fn new(strengths: Vec<f64>, vectors: &[DVector<f64>]) -> Self {
        Self { strengths, vectors: vectors.iter().map(|v| v.as_slice().to_vec()).collect() }
    }

    /// The two neighbours of a strength and the share of the second one.
    fn locate(&self, strength: f64) -> (&[f64], &[f64], f64) {
        let last = self.strengths.len() - 1;
        let above = self.strengths.iter().position(|node| *node >= strength);
        let (i, j) = match above {
            None => (last, last),
            Some(0) => (0, 0),
            Some(j) => (j - 1, j),
        };
        let width = self.strengths[j] - self.strengths[i];
        let share = if width > 0.0 { (strength - self.strengths[i]) / width } else { 0.0 };
        (&self.vectors[i], &self.vectors[j], share)
    }

    /// The secant at a strength, per unit.
    pub(super) fn secant(&self, strength: f64) -> Vec<f64> {
        let (a, b, share) = self.locate(strength);
        a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect()
    }

    /// ∂(ηv(η))/∂η at a strength.
    fn tangent(&self, strength: f64) -> Vec<f64> {
        let (a, b, share) = self.locate(strength);
        let last = self.strengths.len() - 1;
        let j = self.strengths.iter().position(|node| *node >= strength).unwrap_or(last);
        let width = if j > 0 { self.strengths[j] - self.strengths[j - 1] } else { f64::INFINITY };
        a.iter().zip(b).map(|(a, b)| a + share * (b - a) + strength * (b - a) / width).collect()
    }

    /// The node nearest to a strength.
    pub(super) fn nearest(&self, strength: f64) -> usize {
        let distance = |i: usize| (self.strengths[i] - strength).abs();
        (1..self.strengths.len()).fold(0, |best, i| if distance(i) < distance(best) { i } else { best })
    }

    /// The node nearest to zero: the local signature.
    pub(super) fn local(&self) -> &[f64] {
        &self.vectors[self.nearest(0.0)]
    }

    /// The node of the largest ‖v‖: the local one where an effect saturates, the last one of a scatter, which has no slope at
    /// zero.
    fn steepest(&self) -> usize {
        let norm2 = |i: usize| dot(&self.vectors[i], &self.vectors[i]);
        (1..self.strengths.len()).fold(0, |best, i| if norm2(i) > norm2(best) { i } else { best })
    }

    /// Every vector multiplied by a matrix.
    pub(super) fn mapped(&self, matrix: &DMatrix<f64>) -> Self {
        let map = |v: &Vec<f64>| (matrix * DVector::from_column_slice(v)).as_slice().to_vec();
        Self { strengths: self.strengths.clone(), vectors: self.vectors.iter().map(map).collect() }
    }

    /// Whether a strength lies beyond the strengths at which signatures were taken.
    pub(super) fn beyond(&self, strength: f64) -> bool {
        let outermost = |sign: f64| self.strengths.iter().fold(0.0_f64, |far, s| far.max(sign * s));
        let side = if strength < 0.0 { -1.0 } else { 1.0 };
        strength.abs() > outermost(side) * (1.0 + 1e-9)
    }
}

/// Covariances (M × M) of the errors of a candidate's whitened signatures.
#[derive(Debug, Clone)]
pub(super) struct Errors {
    /// At every node.
    pub each: Vec<DMatrix<f64>>,
    /// The node nearest to the fitted strength, whose error stands in the noise of a fit.
    pub fitted: usize,
}

impl Errors {
    /// The one that stands in the noise of a fit.
    pub(super) fn of_fit(&self) -> &DMatrix<f64> {
        &self.each[self.fitted]
    }
}

/// Best strength of an effect for one residual, and what it leaves over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    pub strength: f64,
    pub leftover: f64,
}

/// What the odds need to know about an effect at a strength, all with the signature's error in the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    /// a², bias-corrected, of the secant.
    pub norm2: f64,
    /// Standard deviation of the fitted strength, from the tangent.
    pub sd: f64,
}

#[derive(Debug, Clone)]
struct GridPoint {
    strength: f64,
    shift: Vec<f64>,
    weight: Vec<f64>,
}

/// An effect in one geometry.
#[derive(Debug, Clone)]
pub(super) struct Projected {
    /// Signatures in the eigenbasis of their error.
    pub curve: Curve,
    /// Uᵀ, from the basis of the geometry to the eigenbasis; `None` for an exact signature (U = I).
    pub rotation: Option<DMatrix<f64>>,
    /// The same, row by row.
    rows: Vec<f64>,
    /// Variances of the error of a signature in its eigenbasis, as a fit has it.
    pub lambda: Vec<f64>,
    /// What its own error adds to the squared size of every signature.
    inflation: Vec<f64>,
    grid: Vec<GridPoint>,
}

impl Projected {
    /// Projects whitened signatures (M) with the covariances of their errors into a geometry.
    pub(super) fn new(geometry: &Geometry, signatures: &Curve, errors: &Errors, range: (f64, f64)) -> Self {
        let projection = geometry.basis.transpose();
        let error = geometry.projected(errors.of_fit());
        let curve = signatures.mapped(&projection);
        let (grid, inflation) = (Vec::new(), errors.each.iter().map(|e| geometry.projected(e).trace()).collect());
        let mut projected = if error.iter().all(|x| *x == 0.0) {
            Self { curve, rotation: None, rows: Vec::new(), lambda: vec![0.0; error.nrows()], inflation, grid }
        } else {
            let eigen = error.symmetric_eigen();
            let rotation = eigen.eigenvectors.transpose();
            let rows = eigen.eigenvectors.as_slice().to_vec();
            let lambda = eigen.eigenvalues.iter().map(|value| value.max(0.0)).collect();
            Self { curve: curve.mapped(&rotation), rotation: Some(rotation), rows, lambda, inflation, grid }
        };
        projected.grid = strengths(range).into_iter().map(|strength| projected.point(strength)).collect();
        projected
    }

    fn point(&self, strength: f64) -> GridPoint {
        GridPoint {
            strength,
            shift: self.curve.secant(strength).iter().map(|v| strength * v).collect(),
            weight: self.weights(strength),
        }
    }

    /// 1/(1 + η²λ).
    pub(super) fn weights(&self, strength: f64) -> Vec<f64> {
        let square = strength * strength;
        self.lambda.iter().map(|lambda| 1.0 / (1.0 + square * lambda)).collect()
    }

    /// A projected residual in this effect's eigenbasis.
    pub(super) fn rotate(&self, t: &[f64], out: &mut Vec<f64>) {
        out.clear();
        match &self.rotation {
            None => out.extend_from_slice(t),
            Some(_) => out.extend(self.rows.chunks_exact(t.len()).map(|row| dot(row, t))),
        }
    }

    /// Best strength within the physical range for a rotated residual.
    pub(super) fn fit(&self, t: &[f64]) -> Fit {
        let value = |point: &GridPoint| weighted_distance(t, &point.shift, &point.weight);
        let mut best = Fit { strength: 0.0, leftover: f64::INFINITY };
        let mut index = 0;
        for (i, point) in self.grid.iter().enumerate() {
            let leftover = value(point);
            if leftover < best.leftover {
                (best, index) = (Fit { strength: point.strength, leftover }, i);
            }
        }
        self.refine(t, best, index.clamp(1, self.grid.len() - 2))
    }

    /// Successive parabolas around a grid point with two neighbours.
    fn refine(&self, t: &[f64], grid_best: Fit, index: usize) -> Fit {
        let at = |strength: f64| Fit { strength, leftover: self.profile(t, strength) };
        let [mut low, mut centre, mut high] = [index - 1, index, index + 1].map(|i| at(self.grid[i].strength));
        let width = high.strength - low.strength;
        for _ in 0..REFINEMENTS {
            let Some(vertex) = vertex(low, centre, high) else { break };
            let next = vertex.clamp(low.strength, high.strength);
            if (next - centre.strength).abs() < PRECISION * width {
                break;
            }
            let next = at(next);
            let (inner, outer) = if next.leftover < centre.leftover { (next, centre) } else { (centre, next) };
            if outer.strength < inner.strength {
                low = outer;
            } else {
                high = outer;
            }
            centre = inner;
        }
        if centre.leftover <= grid_best.leftover { centre } else { grid_best }
    }

    /// h(η).
    fn profile(&self, t: &[f64], strength: f64) -> f64 {
        let (a, b, share) = self.curve.locate(strength);
        let (square, n) = (strength * strength, t.len());
        let (t, a, b, lambda) = (&t[..n], &a[..n], &b[..n], &self.lambda[..n]);
        interleaved(n, |i| {
            let e = t[i] - strength * (a[i] + share * (b[i] - a[i]));
            e * e / (1.0 + square * lambda[i])
        })
    }

    /// ln det(I + η²C): logarithms of products of a few factors, since logarithms cost most of a decision otherwise.
    pub(super) fn ln_det(&self, strength: f64) -> f64 {
        let square = strength * strength;
        let product = |block: &[f64]| block.iter().fold(1.0, |all, lambda| all * (1.0 + square * lambda));
        self.lambda.chunks(8).map(|block| libm::log(product(block))).sum()
    }

    /// What odds and intervals need at a strength.
    pub(super) fn scale(&self, strength: f64) -> Scale {
        let weight = self.weights(strength);
        let norm = |v: &[f64]| weighted_dot(&weight, v, v);
        let error = dot(&self.lambda, &weight);
        let tangent = self.curve.tangent(strength);
        Scale {
            norm2: (norm(&self.curve.secant(strength)) - error).max(0.0),
            sd: 1.0 / (norm(&tangent) - error).max(0.0).sqrt(),
        }
    }

    /// a² of the local signature, bias-corrected: ‖Mg̃‖² − tr MΣ_gM, not below 0.
    pub(super) fn local_norm2(&self) -> f64 {
        self.norm2(self.curve.nearest(0.0))
    }

    /// z = uᵀt of a rotated residual with the unit vector of the local signature; 0 for a signature of zero.
    pub(super) fn local_z(&self, t: &[f64]) -> f64 {
        let v = self.curve.local();
        let norm = dot(v, v).sqrt();
        if norm > 0.0 { dot(v, t) / norm } else { 0.0 }
    }

    /// The signature by which the effect is judged visible or not: the largest or, if less of its size is its own error, the
    /// one that a fit takes.
    pub(super) fn judged_by(&self, fitted: usize) -> Size {
        let (largest, fitted) = (self.size(self.curve.steepest()), self.size(fitted));
        if fitted.own_share() > largest.own_share() { fitted } else { largest }
    }

    fn size(&self, node: usize) -> Size {
        let v = &self.curve.vectors[node];
        Size { node, raw_norm2: dot(v, v), norm2: self.norm2(node) }
    }

    /// The largest |η|·‖Mg̃‖ of all signatures, bias-corrected.
    pub(super) fn reach(&self) -> f64 {
        let shift = |(node, strength): (usize, &f64)| strength.abs() * self.norm2(node).sqrt();
        self.curve.strengths.iter().enumerate().map(shift).fold(0.0, f64::max)
    }

    /// ‖Mg̃‖² of a node less what its error adds to it, not below 0.
    fn norm2(&self, node: usize) -> f64 {
        let v = &self.curve.vectors[node];
        (dot(v, v) - self.inflation[node]).max(0.0)
    }
}

/// How large one signature of an effect is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    /// Its place among the signatures.
    pub node: usize,
    /// ‖Mg̃‖², as it came.
    pub raw_norm2: f64,
    /// The same, bias-corrected.
    pub norm2: f64,
}

impl Size {
    /// Share that is not its own error.
    pub(super) fn own_share(&self) -> f64 {
        if self.raw_norm2 > 0.0 { self.norm2 / self.raw_norm2 } else { 0.0 }
    }
}

/// p-value of "this vector is nothing but its error".
/// `full_norm2` is the squared size the vector had before projection: what is smaller by 1e-18 is rounding.
pub(super) fn significance(vector: &DVector<f64>, error: &DMatrix<f64>, full_norm2: f64) -> f64 {
    if vector.is_empty() {
        return 1.0;
    }
    let eigen = error.clone().symmetric_eigen();
    let (vector, lambda) = (eigen.eigenvectors.tr_mul(vector), eigen.eigenvalues);
    let floor = EXACT * lambda.max().max(0.0);
    let (mut chi2, mut directions, mut exact) = (0.0, 0, 0.0);
    for (v, variance) in vector.iter().zip(&lambda) {
        if *variance > floor {
            chi2 += v * v / variance;
            directions += 1;
        } else {
            exact += v * v;
        }
    }
    if exact > 1e-18 * full_norm2 {
        0.0
    } else if directions == 0 {
        1.0
    } else {
        special::chi2_sf(chi2, f64::from(directions))
    }
}

/// Σ f(i) over 0..n in four interleaved sums: a fixed order that still lets the compiler use vector registers.
fn interleaved(n: usize, f: impl Fn(usize) -> f64) -> f64 {
    let mut sums = [0.0; 4];
    for block in 0..n / 4 {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum += f(4 * block + lane);
        }
    }
    let rest: f64 = (n / 4 * 4..n).map(&f).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// Σ aᵢbᵢ.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len());
    let (a, b) = (&a[..n], &b[..n]);
    interleaved(n, |i| a[i] * b[i])
}

/// Σ wᵢaᵢbᵢ.
pub(super) fn weighted_dot(w: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let n = w.len().min(a.len()).min(b.len());
    let (w, a, b) = (&w[..n], &a[..n], &b[..n]);
    interleaved(n, |i| w[i] * a[i] * b[i])
}

/// Σ w(t − s)².
fn weighted_distance(t: &[f64], shift: &[f64], weight: &[f64]) -> f64 {
    let n = t.len().min(shift.len()).min(weight.len());
    let (t, s, w) = (&t[..n], &shift[..n], &weight[..n]);
    interleaved(n, |i| {
        let e = t[i] - s[i];
        w[i] * e * e
    })
}

/// Lowest point of the parabola through three fits, if it opens upwards.
fn vertex(low: Fit, centre: Fit, high: Fit) -> Option<f64> {
    let (left, right) = (centre.strength - low.strength, high.strength - centre.strength);
    if left <= 0.0 || right <= 0.0 {
        return None;
    }
    let (down, up) = ((centre.leftover - low.leftover) / left, (high.leftover - centre.leftover) / right);
    let curvature = (up - down) / (left + right);
    let slope = (down * right + up * left) / (left + right);
    (curvature > 0.0).then(|| centre.strength - 0.5 * slope / curvature)
}

/// Grid over the physical range: zero and equal steps to each end.
fn strengths((low, high): (f64, f64)) -> Vec<f64> {
    let side = |end: f64| (1..=STEPS).map(move |i| end * i as f64 / STEPS as f64);
    let mut grid: Vec<f64> = if low < 0.0 { side(low).collect() } else { Vec::new() };
    grid.reverse();
    grid.push(0.0);
    if high > 0.0 {
        grid.extend(side(high));
    }
    grid
}
