//! Correlation functions of a Gaussian process, of the squared scaled distance s = Σ_d a_d (x_d − x'_d)².
//!
//! Takes exponents −½s, which is what the loops of `stats::kernels` give, a vector at a time; gives correlations and
//! their slopes. Knows nothing of points and of what is predicted.

use crate::stats::kernels::exp_in_place;
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
        match self {
            Self::SquaredExponential => exp_in_place(exponents),
            Self::Matern52 => {
                let distances: Vec<f64> = exponents.iter().map(|&exponent| distance(exponent)).collect();
                exponents.iter_mut().zip(&distances).for_each(|(exponent, distance)| *exponent = -distance);
                exp_in_place(exponents);
                exponents.iter_mut().zip(&distances).for_each(|(value, &distance)| *value *= polynomial(distance));
            }
        }
    }

    /// −2 dk/ds over k at an exponent −½s: 1 for the squared exponential.
    pub fn steepness(self, exponent: f64) -> f64 {
        match self {
            Self::SquaredExponential => 1.0,
            Self::Matern52 => {
                let distance = distance(exponent);
                5.0 / 3.0 * (1.0 + distance) / polynomial(distance)
            }
        }
    }
}

/// √5 r from −½r²; rounding must not make its square negative.
fn distance(exponent: f64) -> f64 {
    (-10.0 * exponent).max(0.0).sqrt()
}

/// 1 + √5 r + 5r²/3.
fn polynomial(distance: f64) -> f64 {
    1.0 + distance * (1.0 + distance / 3.0)
}
