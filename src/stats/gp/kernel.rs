//! Correlation functions of a Gaussian process, of the squared scaled distance s = Σ_d a_d (x_d − x'_d)².
//!
//! Takes exponents −½s, which is what the loops of `stats::kernels` give, a vector at a time; gives correlations and
//! their slopes. Knows nothing of points and of what is predicted.

use crate::stats::kernels::{apply, apply_to_both, exp_in_place};
use crate::stats::naming::named;

/// How correlation falls with distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// k = exp(−½s): infinitely smooth (the paper's, below eq. 5).
    SquaredExponential,
    /// Matérn with ν = 5/2, k = (1 + √5 r + 5r²/3) exp(−√5 r), r = √s: twice differentiable (Rasmussen & Williams 2006, eq. 4.17).
    Matern52,
}

named!(Kernel, "kernel", SquaredExponential => "squared_exponential", Matern52 => "matern_5_2");

impl Kernel {
    /// Turns exponents −½s into correlations k(s).
    pub fn correlate(self, exponents: &mut [f64]) {
        if self == Self::Matern52 {
            let mut negative = self.decay(exponents);
            apply_to_both(exponents, &mut negative, |value, negative| (value * polynomial(-negative), negative));
        } else {
            exp_in_place(exponents);
        }
    }

    /// The same, and gives −2 dk/ds over k: 1 for the squared exponential.
    pub fn correlate_with_steepness(self, exponents: &mut [f64]) -> Vec<f64> {
        let mut steepness = self.decay(exponents);
        match self {
            Self::SquaredExponential => steepness.fill(1.0),
            Self::Matern52 => apply_to_both(exponents, &mut steepness, |value, negative| {
                let polynomial = polynomial(-negative);
                (value * polynomial, 5.0 / 3.0 * (1.0 - negative) / polynomial)
            }),
        }
        steepness
    }

    /// Turns exponents −½s into the exponential factor of k(s), and gives its exponents.
    fn decay(self, exponents: &mut [f64]) -> Vec<f64> {
        if self == Self::Matern52 {
            apply(exponents, |exponent| -distance(exponent));
        }
        let of_factor = exponents.to_vec();
        exp_in_place(exponents);
        of_factor
    }
}

/// √5 r from −½r²; rounding must not make its square negative.
#[inline(always)]
fn distance(exponent: f64) -> f64 {
    (-10.0 * exponent).max(0.0).sqrt()
}

/// 1 + √5 r + 5r²/3.
#[inline(always)]
fn polynomial(distance: f64) -> f64 {
    1.0 + distance * (1.0 + distance / 3.0)
}
