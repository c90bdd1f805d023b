//! Posterior odds in closed form: normal or half-normal priors of a strength, and the catch-all "other".
//!
//! Takes sizes in units of the noise, gives logarithms of Bayes factors against "no discrepancy". No data structures.

use crate::stats::special;
use std::f64::consts::LN_2;

/// Evidence for one strength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Evidence {
    /// Estimate in units of its standard error, aη̂, positive on the allowed side.
    pub z: f64,
    /// T₀ minus leftover, less the volume ln det(I + η²C) of the signature's error; z² where all is linear and exact.
    pub gain: f64,
    /// a².
    pub norm2: f64,
    /// Half the physical range.
    pub tau: f64,
    /// Whether the strength has one allowed sign.
    pub one_sided: bool,
}

impl Evidence {
    /// ln BF = −½ ln(1 + τ²a²) + ½(gain − z²/(1 + τ²a²)), plus ln 2Φ(zτa/√(1 + τ²a²)) for a half-normal prior. The second
    /// part is ½z²τ²a²/(1 + τ²a²) where gain = z²; what the prior takes away, ½η̂²/(τ² + 1/a²), does not grow with a gain
    /// that a bent signature owes to its path.
    pub(super) fn ln_bayes(&self, factor: f64) -> f64 {
        let tau = factor * self.tau;
        let s = tau * tau * self.norm2;
        let two_sided = -0.5 * libm::log1p(s) + 0.5 * (self.gain - self.z * self.z / (1.0 + s));
        if !self.one_sided {
            return two_sided;
        }
        two_sided + LN_2 + special::normal_ln_cdf(self.z * (s / (1.0 + s)).sqrt())
    }
}

/// ln BF of "something else": a normal prior of relative variance s² in all d directions,
/// −(d/2) ln(1 + s²) + ½T₀s²/(1 + s²).
pub(super) fn ln_bayes_other(t0: f64, evidence: usize, s2: f64) -> f64 {
    -0.5 * evidence as f64 * libm::log1p(s2) + 0.5 * t0 * s2 / (1.0 + s2)
}

/// Two effects together, from the normal equations of their strengths.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PairEvidence {
    /// v₁ᵀv₁, v₁ᵀv₂, v₂ᵀv₂.
    pub gram: [f64; 3],
    /// v₁ᵀt, v₂ᵀt, turned so that a constrained strength is allowed to be positive.
    pub score: [f64; 2],
    /// Half the physical ranges.
    pub tau: [f64; 2],
    /// Whether each strength has one allowed sign.
    pub one_sided: [bool; 2],
}

impl PairEvidence {
    /// −½ ln det(I + TGT) + ½bᵀ(G + T⁻²)⁻¹b, plus ln 2Φ(mean/sd) of the posterior for each half-normal prior; the
    /// correlation of the two posteriors is left out of that last part, which only matters near zero strength.
    pub(super) fn ln_bayes(&self, factor: f64) -> f64 {
        let [t1, t2] = self.tau.map(|tau| factor * tau);
        let [p11, p12, p22] = [self.gram[0] + 1.0 / (t1 * t1), self.gram[1], self.gram[2] + 1.0 / (t2 * t2)];
        let det = p11 * p22 - p12 * p12;
        let mean =
            [(p22 * self.score[0] - p12 * self.score[1]) / det, (p11 * self.score[1] - p12 * self.score[0]) / det];
        let gain = mean[0] * self.score[0] + mean[1] * self.score[1];
        let sd = [(p22 / det).sqrt(), (p11 / det).sqrt()];
        let side = |i: usize| if self.one_sided[i] { LN_2 + special::normal_ln_cdf(mean[i] / sd[i]) } else { 0.0 };
        0.5 * (gain - libm::log(det * t1 * t1 * t2 * t2)) + side(0) + side(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both formulas are integrals of a normal likelihood over a prior; compare with the midpoint rule.
    #[test]
    fn bayes_factors_are_the_integrals_they_stand_for() {
        let (a, tau, z) = (1.7, 0.8, 2.1);
        let density =
            |eta: f64| libm::exp(-0.5 * (eta / tau) * (eta / tau)) / (tau * (2.0 * std::f64::consts::PI).sqrt());
        let ratio = |eta: f64| libm::exp(0.5 * z * z - 0.5 * (z - a * eta) * (z - a * eta));
        let step = 1e-4;
        let integral = |low: i64| -> f64 {
            (low..100_000).map(|i| (i as f64 + 0.5) * step).map(|eta| density(eta) * ratio(eta) * step).sum()
        };
        let evidence = |one_sided| Evidence { z, gain: z * z, norm2: a * a, tau, one_sided };
        assert!((evidence(false).ln_bayes(1.0) - libm::log(integral(-100_000))).abs() < 1e-8);
        assert!((evidence(true).ln_bayes(1.0) - libm::log(2.0 * integral(0))).abs() < 1e-8);
        // Orthogonal signatures: the evidence of a pair is the sum of the two.
        let pair =
            PairEvidence { gram: [a * a, 0.0, a * a], score: [a * z; 2], tau: [tau; 2], one_sided: [true, false] };
        let sum = evidence(true).ln_bayes(1.0) + evidence(false).ln_bayes(1.0);
        assert!((pair.ln_bayes(1.0) - sum).abs() < 1e-12);
        // One direction of "other" is an effect with a = 1 and τ = s.
        let other = Evidence { z, gain: z * z, norm2: 1.0, tau: 1.3, one_sided: false };
        assert!((ln_bayes_other(z * z, 1, 1.69) - other.ln_bayes(1.0)).abs() < 1e-14);
    }
}
