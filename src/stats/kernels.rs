//! Inner loops of the linear algebra, compiled for every vector width and chosen when they run.
//!
//! Each element sees the same operations in the same order whatever the width, and none is fused, so the bits depend on
//! nothing but the numbers. Several columns are taken in one pass only to load and store the target once; the order of
//! its subtractions stays. Deliberately knows nothing of what the numbers mean.

use pulp::{Arch, Simd, WithSimd};

/// Columns that are subtracted in one pass.
const PANEL: usize = 4;

/// Cholesky factorisation in place, left-looking: L_ij = (K_ij − Σ_{k<j} L_ik L_jk)/L_jj, L_jj = √(K_jj − Σ L_jk²).
///
/// `matrix` holds n columns of n numbers, of which the lower triangle is read and written. Gives whether every pivot was
/// positive; otherwise the content is of no use.
pub(super) fn cholesky(matrix: &mut [f64], n: usize) -> bool {
    Arch::new().dispatch(Factorise { matrix, n })
}

/// x ← L⁻¹ x by forward substitution. `lower` holds as many columns as x has numbers.
pub(super) fn solve_lower(lower: &[f64], x: &mut [f64]) {
    Arch::new().dispatch(SolveLower { lower, x });
}

/// L⁻¹ into `inverse`, which must be zero: the forward substitution of every unit vector. Both hold n columns.
pub(super) fn invert_lower(lower: &[f64], inverse: &mut [f64], n: usize) {
    Arch::new().dispatch(InvertLower { lower, inverse, n });
}

/// L⁻ᵀL⁻¹ into both triangles of `product`, from the columns of L⁻¹: entry (i, j ≤ i) is the inner product of columns i
/// and j from row i on.
pub(super) fn square_of_inverse(inverse: &[f64], product: &mut [f64], n: usize) {
    Arch::new().dispatch(SquareOfInverse { inverse, product, n });
}

/// x ← exp(x), the same bits as `libm::exp`.
pub(in crate::stats) fn exp_in_place(values: &mut [f64]) {
    Arch::new().dispatch(Exponentials { values });
}

/// x ← f(x), a vector at a time where `f` is plain arithmetic.
pub(in crate::stats) fn apply(values: &mut [f64], f: impl Fn(f64) -> f64) {
    Arch::new().dispatch(Apply { values, f });
}

/// (x, y) ← f(x, y), likewise.
pub(in crate::stats) fn apply_to_both(values: &mut [f64], others: &mut [f64], f: impl Fn(f64, f64) -> (f64, f64)) {
    Arch::new().dispatch(ApplyToBoth { values, others, f });
}

/// −½ Σ_d a_d (x_d − p_jd)² of every point p_j, summed in the order of d. `columns` holds the coordinates of all points one
/// parameter after the other.
pub(in crate::stats) fn squared_distances(columns: &[f64], x: &[f64], a: &[f64]) -> Vec<f64> {
    let mut exponents = vec![0.0; columns.len() / x.len().max(1)];
    Arch::new().dispatch(SquaredDistances { columns, x, a, exponents: &mut exponents });
    exponents
}

/// Σ_j v_j w_j (x_d − p_jd) for every d, summed in the order of j. `columns` as in [`squared_distances`].
pub(in crate::stats) fn weighted_differences(columns: &[f64], x: &[f64], v: &[f64], w: &[f64]) -> Vec<f64> {
    let n = w.len();
    let v = &v[..n];
    let mut sums = vec![0.0; x.len()];
    for (block, (sums, x)) in sums.chunks_mut(PANEL).zip(x.chunks(PANEL)).enumerate() {
        // Lanes beyond the last parameter repeat the first one and are thrown away: the sums of a panel do not wait for each other.
        let lane = |l: usize| if l < x.len() { l } else { 0 };
        let column = |l: usize| &columns[(PANEL * block + lane(l)) * n..][..n];
        let (p, x) = ([column(0), column(1), column(2), column(3)], [x[0], x[lane(1)], x[lane(2)], x[lane(3)]]);
        let mut panel = [0.0; PANEL];
        for j in 0..n {
            let weight = v[j] * w[j];
            for l in 0..PANEL {
                panel[l] += weight * (x[l] - p[l][j]);
            }
        }
        sums.copy_from_slice(&panel[..sums.len()]);
    }
    sums
}

/// Inner product, summed in four interleaved partial sums so that it vectorises in a fixed order.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut partial = [0.0; 4];
    let (a_blocks, b_blocks) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(u, v)| u * v).sum();
    for (u, v) in a_blocks.zip(b_blocks) {
        for lane in 0..4 {
            partial[lane] += u[lane] * v[lane];
        }
    }
    (partial[0] + partial[2]) + (partial[1] + partial[3]) + rest
}

/// x ← x − factor · y.
#[inline(always)]
fn subtract_scaled(x: &mut [f64], factor: f64, y: &[f64]) {
    for (target, source) in x.iter_mut().zip(y) {
        *target -= factor * source;
    }
}

/// x ← x − f₀y₀ − f₁y₁ − f₂y₂ − f₃y₃, from left to right.
#[inline(always)]
fn subtract_panel(x: &mut [f64], factors: [f64; PANEL], columns: [&[f64]; PANEL]) {
    let n = x.len();
    let [a, b, c, d] = [&columns[0][..n], &columns[1][..n], &columns[2][..n], &columns[3][..n]];
    for i in 0..n {
        x[i] = x[i] - factors[0] * a[i] - factors[1] * b[i] - factors[2] * c[i] - factors[3] * d[i];
    }
}

/// Rows `from..` of four neighbouring columns.
#[inline(always)]
fn panel(columns: &[f64], n: usize, first: usize, from: usize) -> [&[f64]; PANEL] {
    let column = |k: usize| &columns[(first + k) * n + from..(first + k + 1) * n];
    [column(0), column(1), column(2), column(3)]
}

struct Factorise<'a> {
    matrix: &'a mut [f64],
    n: usize,
}

impl WithSimd for Factorise<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Self { matrix, n } = self;
        for j in 0..n {
            let (done, rest) = matrix.split_at_mut(j * n);
            let column = &mut rest[j..n];
            let mut k = 0;
            while k + PANEL <= j {
                let columns = panel(done, n, k, j);
                subtract_panel(column, [columns[0][0], columns[1][0], columns[2][0], columns[3][0]], columns);
                k += PANEL;
            }
            while k < j {
                let earlier = &done[k * n + j..(k + 1) * n];
                subtract_scaled(column, earlier[0], earlier);
                k += 1;
            }
            let pivot = column[0];
            if pivot.is_nan() || pivot <= 0.0 {
                return false;
            }
            let root = pivot.sqrt();
            column[0] = root;
            column[1..].iter_mut().for_each(|entry| *entry /= root);
        }
        true
    }
}

struct SolveLower<'a> {
    lower: &'a [f64],
    x: &'a mut [f64],
}

impl WithSimd for SolveLower<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let n = self.x.len();
        substitute(self.lower, self.x, n, 0);
    }
}

struct InvertLower<'a> {
    lower: &'a [f64],
    inverse: &'a mut [f64],
    n: usize,
}

impl WithSimd for InvertLower<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { lower, inverse, n } = self;
        for j in 0..n {
            let x = &mut inverse[j * n..(j + 1) * n];
            x[j] = 1.0;
            substitute(lower, x, n, j);
        }
    }
}

/// x ← L⁻¹ x for an x whose first `from` entries vanish.
#[inline(always)]
fn substitute(lower: &[f64], x: &mut [f64], n: usize, from: usize) {
    let mut k = from;
    while k + PANEL <= n {
        let mut known = [0.0; PANEL];
        for step in 0..PANEL {
            let column = &lower[(k + step) * n..(k + step + 1) * n];
            known[step] = x[k + step] / column[k + step];
            x[k + step] = known[step];
            for row in k + step + 1..k + PANEL {
                x[row] -= known[step] * column[row];
            }
        }
        subtract_panel(&mut x[k + PANEL..], known, panel(lower, n, k, k + PANEL));
        k += PANEL;
    }
    while k < n {
        let column = &lower[k * n..(k + 1) * n];
        let value = x[k] / column[k];
        x[k] = value;
        subtract_scaled(&mut x[k + 1..], value, &column[k + 1..]);
        k += 1;
    }
}

struct SquareOfInverse<'a> {
    inverse: &'a [f64],
    product: &'a mut [f64],
    n: usize,
}

impl WithSimd for SquareOfInverse<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { inverse, product, n } = self;
        for i in 0..n {
            let own = &inverse[i * n + i..(i + 1) * n];
            let mut j = 0;
            while j + PANEL <= i + 1 {
                let values = dots(own, panel(inverse, n, j, i));
                for (step, value) in values.into_iter().enumerate() {
                    product[(j + step) * n + i] = value;
                    product[i * n + j + step] = value;
                }
                j += PANEL;
            }
            while j <= i {
                let value = dot(own, &inverse[j * n + i..(j + 1) * n]);
                product[j * n + i] = value;
                product[i * n + j] = value;
                j += 1;
            }
        }
    }
}

/// [`dot`] of one vector with four others.
#[inline(always)]
fn dots(a: &[f64], others: [&[f64]; PANEL]) -> [f64; PANEL] {
    let blocks = a.len() / 4;
    let mut partial = [[0.0; 4]; PANEL];
    for block in 0..blocks {
        let u = &a[4 * block..4 * block + 4];
        for (sums, other) in partial.iter_mut().zip(others) {
            let v = &other[4 * block..4 * block + 4];
            for lane in 0..4 {
                sums[lane] += u[lane] * v[lane];
            }
        }
    }
    let mut values = [0.0; PANEL];
    for ((value, sums), other) in values.iter_mut().zip(partial).zip(others) {
        let tail = a[4 * blocks..].iter().zip(&other[4 * blocks..]);
        let rest: f64 = tail.map(|(u, v)| u * v).sum();
        *value = (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest;
    }
    values
}

struct SquaredDistances<'a> {
    columns: &'a [f64],
    x: &'a [f64],
    a: &'a [f64],
    exponents: &'a mut [f64],
}

impl WithSimd for SquaredDistances<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { columns, x, a, exponents } = self;
        let (n, rest) = (exponents.len(), x.len() % PANEL);
        for first in (0..x.len() - rest).step_by(PANEL) {
            let [p, q, r, s] = panel(columns, n, first, 0);
            let ([x, y, z, w], [a, b, c, d]) = (four(&x[first..]), four(&a[first..]));
            for j in 0..n {
                exponents[j] = exponents[j]
                    + a * (x - p[j]) * (x - p[j])
                    + b * (y - q[j]) * (y - q[j])
                    + c * (z - r[j]) * (z - r[j])
                    + d * (w - s[j]) * (w - s[j]);
            }
        }
        for k in x.len() - rest..x.len() {
            let (x, a, column) = (x[k], a[k], &columns[k * n..(k + 1) * n]);
            for (sum, p) in exponents.iter_mut().zip(column) {
                *sum += a * (x - p) * (x - p);
            }
        }
        exponents.iter_mut().for_each(|sum| *sum *= -0.5);
    }
}

/// The first four numbers.
#[inline(always)]
fn four(numbers: &[f64]) -> [f64; PANEL] {
    [numbers[0], numbers[1], numbers[2], numbers[3]]
}

struct Apply<'a, F> {
    values: &'a mut [f64],
    f: F,
}

impl<F: Fn(f64) -> f64> WithSimd for Apply<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values.iter_mut().for_each(|value| *value = (self.f)(*value));
    }
}

struct ApplyToBoth<'a, F> {
    values: &'a mut [f64],
    others: &'a mut [f64],
    f: F,
}

impl<F: Fn(f64, f64) -> (f64, f64)> WithSimd for ApplyToBoth<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.values.iter_mut().zip(self.others).for_each(|(value, other)| (*value, *other) = (self.f)(*value, *other));
    }
}

struct Exponentials<'a> {
    values: &'a mut [f64],
}

/// Elements that take the fast path together.
const BLOCK: usize = 64;

impl WithSimd for Exponentials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for block in self.values.chunks_mut(BLOCK) {
            let mut inside = true;
            for value in block.iter() {
                inside &= *value <= 0.0 && *value >= -700.0;
            }
            if inside {
                block.iter_mut().for_each(|value| *value = exp_of_negative(*value));
            } else {
                block.iter_mut().for_each(|value| *value = libm::exp(*value));
            }
        }
    }
}

/// exp(x) for −700 ≤ x ≤ 0: the steps of `libm::exp` (FreeBSD's e_exp.c) with selections in the place of branches.
///
/// x = k ln 2 + r with |r| ≤ ½ ln 2; exp(r) = 1 + r c/(2 − c) + r; the result is scaled by 2^k.
#[inline(always)]
fn exp_of_negative(x: f64) -> f64 {
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    const P: [f64; 5] = [
        1.666_666_666_666_660_2e-1,
        -2.777_777_777_701_559_3e-3,
        6.613_756_321_437_934e-5,
        -1.653_390_220_546_525_2e-6,
        4.138_136_797_057_238_5e-8,
    ];
    /// Adding and taking away 1.5 · 2⁵² rounds to a whole number, whose bits then stand at the end of the sum.
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    // The thresholds of the original, which looks at the high word only: 2⁻²⁸, ½ ln 2 and 1.5 ln 2.
    let size = x.abs();
    let small = size < f64::from_bits(0x3e30_0001_0000_0000);
    let quotient = std::f64::consts::LOG2_E * x - 0.5;
    let nearest = (quotient + MAGIC) - MAGIC;
    let towards_zero = if nearest < quotient { nearest + 1.0 } else { nearest };
    let one_or_more = if size < f64::from_bits(0x3ff0_a2b2_0000_0000) { -1.0 } else { towards_zero };
    let k = if size < f64::from_bits(0x3fd6_2e43_0000_0000) { 0.0 } else { one_or_more };
    let (high, low) = (x - k * LN2_HIGH, k * LN2_LOW);
    let r = high - low;
    let square = r * r;
    let c = r - square * (P[0] + square * (P[1] + square * (P[2] + square * (P[3] + square * P[4]))));
    let y = 1.0 + (r * c / (2.0 - c) - low + high);
    let power = f64::from_bits((k + MAGIC).to_bits().wrapping_add(1023) << 52);
    if small { 1.0 + x } else { y * power }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;
    use pulp::{Scalar, WithSimd};

    #[test]
    fn exponentials_are_those_of_libm_to_the_bit() {
        let mut stream = Stream::new(1, "exponentials");
        let mut arguments: Vec<f64> = (0..200_000).map(|_| -libm::exp10(stream.uniform_in(-12.0, 2.84))).collect();
        let edges = [0.5, 1.5, 1.0].map(|x| x * std::f64::consts::LN_2);
        for edge in edges.into_iter().chain([libm::exp2(-28.0), 0.346_573_4, 1.039_720_3, 708.0, 745.2, 1e6]) {
            arguments.extend((-40..40).map(|step| -f64::from_bits(edge.to_bits().wrapping_add_signed(step))));
        }
        arguments.extend([0.0, -0.0, -700.0, 3.0, f64::NAN, f64::NEG_INFINITY]);
        let mut ours = arguments.clone();
        exp_in_place(&mut ours);
        for (x, y) in arguments.iter().zip(&ours) {
            assert_eq!(y.to_bits(), libm::exp(*x).to_bits(), "exp({x:e}) = {y:e}");
        }
        // One by one, so that the slow path of a neighbour hides nothing.
        for x in arguments.iter().filter(|x| (-700.0..=0.0).contains(*x)) {
            assert_eq!(exp_of_negative(*x).to_bits(), libm::exp(*x).to_bits(), "exp({x:e})");
        }
    }

    #[test]
    fn distances_and_differences_are_summed_in_order() {
        for (n, dimension) in [(1, 1), (7, 3), (33, 4), (20, 5), (9, 9)] {
            let mut stream = Stream::new(n as u64, "distances");
            let mut normals = |count: usize| (0..count).map(|_| stream.normal()).collect::<Vec<f64>>();
            let (columns, x, a) = (normals(n * dimension), normals(dimension), normals(dimension));
            let (v, w) = (normals(n), normals(n));
            let (exponents, sums) = (squared_distances(&columns, &x, &a), weighted_differences(&columns, &x, &v, &w));
            for j in 0..n {
                let terms = (0..dimension).map(|d| a[d] * (x[d] - columns[d * n + j]) * (x[d] - columns[d * n + j]));
                assert_eq!(exponents[j], -0.5 * terms.sum::<f64>());
            }
            for d in 0..dimension {
                assert_eq!(sums[d], (0..n).map(|j| v[j] * w[j] * (x[d] - columns[d * n + j])).sum::<f64>());
            }
        }
    }

    /// Every width and nalgebra's own factorisation give the same bits, at sizes on both sides of every panel's edge.
    #[test]
    fn width_and_panels_change_no_bit() {
        for n in [1, 2, 3, 4, 5, 7, 8, 9, 31, 32, 33, 127] {
            let mut stream = Stream::new(n as u64, "kernels");
            let a = nalgebra::DMatrix::from_fn(n, n, |_, _| stream.normal());
            let matrix = &a * a.transpose() + nalgebra::DMatrix::identity(n, n) * n as f64;
            let theirs = nalgebra::Cholesky::new(matrix.clone()).unwrap();
            let (mut wide, mut narrow) = (matrix.as_slice().to_vec(), matrix.as_slice().to_vec());
            assert!(cholesky(&mut wide, n) && Factorise { matrix: &mut narrow, n }.with_simd(Scalar));
            assert_eq!(wide, narrow);
            assert_eq!(wide, theirs.l_dirty().as_slice());
            let mut inverses = [vec![0.0; n * n], vec![0.0; n * n]];
            invert_lower(&wide, &mut inverses[0], n);
            InvertLower { lower: &wide, inverse: &mut inverses[1], n }.with_simd(Scalar);
            assert_eq!(inverses[0], inverses[1]);
            let b: Vec<f64> = (0..n).map(|_| stream.normal()).collect();
            let mut solutions = [b.clone(), b.clone(), b];
            solve_lower(&wide, &mut solutions[0]);
            SolveLower { lower: &wide, x: &mut solutions[1] }.with_simd(Scalar);
            for j in 0..n {
                let column = &wide[j * n..(j + 1) * n];
                solutions[2][j] /= column[j];
                let value = solutions[2][j];
                subtract_scaled(&mut solutions[2][j + 1..], value, &column[j + 1..]);
            }
            assert!(solutions[0] == solutions[1] && solutions[0] == solutions[2]);
            let mut products = [vec![0.0; n * n], vec![0.0; n * n]];
            square_of_inverse(&inverses[0], &mut products[0], n);
            SquareOfInverse { inverse: &inverses[0], product: &mut products[1], n }.with_simd(Scalar);
            assert_eq!(products[0], products[1]);
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                let columns = &inverses[0];
                let one = dot(&columns[i * n + i..(i + 1) * n], &columns[j * n + i..(j + 1) * n]);
                assert_eq!(products[0][j * n + i], one);
            }
        }
    }
}
