//! Noise of a whitened residual whose covariance may itself be an estimate.
//!
//! Takes the rows of a problem; gives draws of the residual without any effect. Where Σ was estimated from few
//! repetitions, its own scatter makes large residuals likelier than χ² says: each group of rows gets the factor
//! ν/χ²(ν − p + 1) that turns χ² into Hotelling's T². The variance of a row from its measured repetitions is one such group,
//! the correlations of a test from its simulated ones another, whose block is taken as a Wishart draw as a whole: an
//! assumption, since observables are not quite normal and variances of ln s are known. That would be exact without a fit. A fit gives most weight to the
//! rows whose variance was underestimated and so absorbs part of it; one factor on all draws corrects this, such that
//! their T₀ has the critical value of a full bootstrap in which Σ is redrawn, whitened anew and refitted.

use super::geometry::{Whitened, range_of, whiten, whiten_vector};
use super::{Correlations, Options, Problem, RowKind};
use crate::rng::Stream;
use nalgebra::{DMatrix, DVector};

/// Noise of the whitened residual.
pub(super) struct Noise<'a> {
    whitened: &'a Whitened,
    groups: Vec<Group>,
    /// What calibration reaches of the whitened rows.
    range: DMatrix<f64>,
    /// Factor on all draws.
    scale: f64,
    /// Whether some covariance was estimated.
    pub heavy: bool,
}

/// What a covariance was estimated from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// Measured repetitions of a group of rows of one kind.
    Measured(usize, RowKind),
    /// Simulated repetitions of a group of rows.
    Simulated(usize),
}

/// Observables whose covariance was estimated from the same repetitions.
struct Group {
    id: Source,
    rows: Vec<usize>,
    /// Share of the variance of every row that was estimated from them.
    shares: Vec<f64>,
    /// Degrees of freedom ν of the estimate.
    dof: usize,
}

impl Group {
    /// ν/χ²(ν − p + 1): noise judged by an estimated covariance follows Hotelling's T² = χ²(p)·ν/χ²(ν − p + 1), which
    /// is Student's t for a single row.
    fn stretch(&self, stream: &mut Stream) -> f64 {
        let left = (self.dof + 1).saturating_sub(self.rows.len()).max(1);
        self.dof as f64 / chi2(left, stream)
    }
}

impl<'a> Noise<'a> {
    pub(super) fn new(problem: &Problem, whitened: &'a Whitened, options: &Options) -> Self {
        let mut groups: Vec<Group> = Vec::new();
        let mut add =
            |id: Source, row: usize, share: f64, dof: usize| match groups.iter_mut().find(|group| group.id == id) {
                Some(group) => {
                    group.rows.push(row);
                    group.shares.push(share);
                    group.dof = group.dof.min(dof);
                }
                None => groups.push(Group { id, rows: vec![row], shares: vec![share], dof }),
            };
        for (i, row) in whitened.kept.iter().map(|index| &problem.rows[*index]).enumerate() {
            if let Some(Correlations { group, dof }) = row.correlations {
                add(Source::Simulated(group), i, 1.0, dof.max(1));
            }
            // The variance of a logarithm of a standard deviation is known, not estimated.
            if row.count < options.simulate_below && row.measured_share > 0.0 && row.kind != RowKind::LnSd {
                let fitted = if row.kind == RowKind::Trend { 2 } else { 1 };
                let dof = row.count.saturating_sub(fitted).max(1);
                add(Source::Measured(row.group, row.kind), i, row.measured_share.min(1.0), dof);
            }
        }
        let range = range_of(&whitened.tangent);
        let mut noise = Self { whitened, heavy: !groups.is_empty(), groups, range, scale: 1.0 };
        if noise.heavy {
            noise.scale = noise.calibrated(options);
        }
        noise
    }

    /// √(critical T₀ with Σ redrawn and refitted ÷ critical T₀ of draws with Σ as it is), both of the same normal numbers,
    /// so that the chance in them is no part of the ratio.
    fn calibrated(&self, options: &Options) -> f64 {
        let Some(blocks) = self.blocks() else { return 1.0 };
        let mut stream = Stream::new(options.seed, "attribution noise refitted");
        let both = |_| {
            let e = self.normal(&mut stream);
            let as_is = leftover(&self.range, &self.stretched(e.clone(), &mut stream));
            (as_is, self.refitted(e, &blocks, &mut stream))
        };
        let (mut as_is, mut refitted): (Vec<f64>, Vec<f64>) = (0..options.null_draws).map(both).unzip();
        [&mut as_is, &mut refitted].into_iter().for_each(|values| values.sort_by(f64::total_cmp));
        tail_ratio(|place| refitted[place], &as_is, options.adequacy_level).sqrt()
    }

    /// Σ of the observables in use.
    fn sigma(&self) -> DMatrix<f64> {
        &self.whitened.factor * self.whitened.factor.transpose()
    }

    /// Factors of each group's block of Σ and of the estimated part of it.
    fn blocks(&self) -> Option<Vec<Block>> {
        let sigma = self.sigma();
        let block = |group: &Group| {
            let whole = sigma.select_rows(&group.rows).select_columns(&group.rows);
            let size = |i: usize| group.shares[i].sqrt();
            let estimated = DMatrix::from_fn(whole.nrows(), whole.ncols(), |i, j| size(i) * size(j) * whole[(i, j)]);
            // Principal blocks of a positive definite matrix, also scaled, are positive definite.
            let factor = |a: &DMatrix<f64>| a.clone().cholesky().map(|c| c.l());
            Some(Block { factor: factor(&whole)?, estimated: factor(&estimated)?, whole })
        };
        self.groups.iter().map(block).collect()
    }

    /// T₀ of normal noise whose Σ was estimated anew.
    fn refitted(&self, e: DVector<f64>, blocks: &[Block], stream: &mut Stream) -> f64 {
        let m = self.whitened.factor.nrows();
        let turns: Vec<DMatrix<f64>> =
            self.groups.iter().zip(blocks).map(|(group, block)| block.rewhitened(group.dof, stream)).collect();
        let whitened_anew = |a: DMatrix<f64>| {
            let mut turned = a;
            for (group, turn) in self.groups.iter().zip(&turns) {
                let part = turn * turned.select_rows(&group.rows);
                group.rows.iter().enumerate().for_each(|(i, row)| turned.set_row(*row, &part.row(i)));
            }
            whiten(&self.whitened.factor, &turned)
        };
        let mut e = DMatrix::from_column_slice(e.len(), 1, e.as_slice());
        let x = &self.whitened.factor * e.rows(0, m);
        e.rows_mut(0, m).copy_from(&whitened_anew(x));
        let mut tangent = self.whitened.tangent.clone();
        let columns = &self.whitened.factor * tangent.rows(0, m);
        tangent.rows_mut(0, m).copy_from(&whitened_anew(columns));
        leftover(&range_of(&tangent), &e.column(0).into_owned())
    }

    /// One whitened residual without any shift (M), and the T₀ of the same draw as normal noise, which is χ² of d. `turn` (M × M)
    /// changes the normal noise where repetitions scatter otherwise than Σ says.
    pub(super) fn draw(&self, turn: Option<&DMatrix<f64>>, stream: &mut Stream) -> (DVector<f64>, f64) {
        let e = self.normal(stream);
        let plain = leftover(&self.range, &e);
        (self.stretched(turn.map_or_else(|| e.clone(), |turn| turn * &e), stream), plain)
    }

    fn normal(&self, stream: &mut Stream) -> DVector<f64> {
        DVector::from_fn(self.whitened.len(), |_, _| stream.normal())
    }

    /// Normal noise with the tails of a Σ that was estimated.
    fn stretched(&self, mut e: DVector<f64>, stream: &mut Stream) -> DVector<f64> {
        if !self.heavy {
            return e;
        }
        let m = self.whitened.factor.nrows();
        let mut x = &self.whitened.factor * e.rows(0, m);
        for group in &self.groups {
            let stretch = group.stretch(stream);
            for (i, share) in group.rows.iter().zip(&group.shares) {
                x[*i] *= (1.0 + share * (stretch - 1.0)).sqrt();
            }
        }
        let back = whiten_vector(&self.whitened.factor, x.as_slice());
        e.rows_mut(0, m).copy_from(&back);
        e * self.scale
    }
}

/// One group's block of Σ.
struct Block {
    whole: DMatrix<f64>,
    /// Lower Cholesky factor of `whole`.
    factor: DMatrix<f64>,
    /// Lower Cholesky factor of the part that was estimated.
    estimated: DMatrix<f64>,
}

impl Block {
    /// BB*⁻¹ for a redrawn block B*B*ᵀ: what changes the whitening from the old block to the redrawn one while it keeps
    /// Σ positive definite, whatever covariance there is between groups. The identity if B* is not positive definite,
    /// which unequal shares within a group can cause.
    fn rewhitened(&self, dof: usize, stream: &mut Stream) -> DMatrix<f64> {
        let change = wishart(&self.estimated, dof, stream) - &self.estimated * self.estimated.transpose();
        let redrawn = (&self.whole + change).cholesky();
        let identity = DMatrix::identity(self.whole.nrows(), self.whole.nrows());
        redrawn.map_or_else(|| identity.clone(), |anew| &self.factor * whiten(&anew.l(), &identity))
    }
}

/// A draw of χ² with `dof` degrees of freedom: squares of normals, or Marsaglia and Tsang's method for many.
fn chi2(dof: usize, stream: &mut Stream) -> f64 {
    if dof <= 4 {
        return (0..dof).map(|_| stream.normal()).map(|z| z * z).sum();
    }
    let d = 0.5 * dof as f64 - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = stream.normal();
        let root = 1.0 + c * x;
        let v = root * root * root;
        let accept = 1.0 - stream.uniform();
        if v > 0.0 && libm::log(accept) < 0.5 * x * x + d * (1.0 - v + libm::log(v)) {
            return 2.0 * d * v;
        }
    }
}

/// Estimate of a covariance LLᵀ from ν degrees of freedom: a Wishart draw over ν, by Bartlett's decomposition.
fn wishart(factor: &DMatrix<f64>, dof: usize, stream: &mut Stream) -> DMatrix<f64> {
    let p = factor.nrows();
    let mut a = DMatrix::zeros(p, p);
    for i in 0..p {
        for j in 0..i {
            a[(i, j)] = stream.normal();
        }
        a[(i, i)] = chi2(dof.saturating_sub(i).max(1), stream).sqrt();
    }
    let half = factor * a;
    &half * half.transpose() / dof as f64
}

/// Square sum of what lies outside an orthonormal range.
fn leftover(range: &DMatrix<f64>, e: &DVector<f64>) -> f64 {
    (e.norm_squared() - range.tr_mul(e).norm_squared()).max(0.0)
}

/// How much larger `wanted` (by place in an ascending order) is than the sorted values around their critical value at
/// `level`: the mean ratio of the order statistics between twice and half that level. 1 where there are none.
pub(super) fn tail_ratio(wanted: impl Fn(usize) -> f64, sorted: &[f64], level: f64) -> f64 {
    let place = |level: f64| (libm::ceil((1.0 - level) * (sorted.len() + 1) as f64) as usize).saturating_sub(1);
    let places = place((2.0 * level).min(1.0))..=place(0.5 * level).min(sorted.len().saturating_sub(1));
    let ratios: Vec<f64> =
        places.filter(|i| sorted.get(*i).is_some_and(|value| *value > 0.0)).map(|i| wanted(i) / sorted[i]).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    if mean.is_finite() && mean > 0.0 { mean } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi2_draws_have_their_moments() {
        for dof in [1, 4, 5, 40] {
            let mut stream = Stream::new(dof as u64, "chi2");
            let draws: Vec<f64> = (0..20_000).map(|_| chi2(dof, &mut stream)).collect();
            let mean = draws.iter().sum::<f64>() / 20_000.0;
            let variance = draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 20_000.0;
            let nu = dof as f64;
            // Five standard errors; the fourth central moment of χ² is 12ν(ν + 4).
            assert!((mean - nu).abs() < 5.0 * (2.0 * nu / 20_000.0).sqrt(), "mean {mean} of {nu}");
            let spread = (12.0 * nu * (nu + 4.0) - 4.0 * nu * nu) / 20_000.0;
            assert!((variance - 2.0 * nu).abs() < 5.0 * spread.sqrt(), "variance {variance} of {nu}");
        }
    }

    #[test]
    fn wishart_draws_average_to_their_covariance() {
        let factor = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, 1.0, 0.5]);
        let mut stream = Stream::new(3, "wishart");
        let mut sum = DMatrix::zeros(2, 2);
        for _ in 0..20_000 {
            sum += wishart(&factor, 6, &mut stream) / 20_000.0;
        }
        // Entries scatter by √((Σ_ii Σ_jj + Σ_ij²)/6), at most 2.4; five standard errors of the mean are 0.085.
        assert!((sum - &factor * factor.transpose()).amax() < 0.085);
    }
}
