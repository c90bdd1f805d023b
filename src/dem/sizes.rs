//! Size distributions: how radii are drawn, and the sizes that follow from a distribution alone.
//!
//! Grains are drawn by number. Rosin–Rammler and sieve curves are given by mass, as they are measured: a radius drawn from
//! the mass curve is kept with probability (r_min/r)³, because a class of mass m holds m/(ρ 4/3 π r³) grains.
//! Radii, not diameters, throughout.

use crate::rng::Stream;

/// Distribution of the grain radius.
#[derive(Debug, Clone, PartialEq)]
pub enum SizeDistribution {
    /// Normal by number, redrawn until it lies in `[mean - below·sd, mean + above·sd]` (paper, section 3.1: 5.02 ± 1.39 mm,
    /// 1.5, 5).
    TruncatedNormal {
        /// Mean before truncation [m].
        mean: f64,
        /// Standard deviation before truncation [m]; 0 gives equal spheres.
        sd: f64,
        /// Lower cut, in standard deviations below the mean [-].
        below: f64,
        /// Upper cut, in standard deviations above the mean [-].
        above: f64,
    },
    /// Lognormal by number, redrawn until it lies in the bounds: ln r ~ N(ln mean - s²/2, s²) with s² = ln(1 + sd²/mean²).
    Lognormal {
        /// Mean before truncation [m].
        mean: f64,
        /// Standard deviation before truncation [m].
        sd: f64,
        /// Smallest and largest radius [m].
        bounds: [f64; 2],
    },
    /// Rosin–Rammler by mass: the share finer than r is 1 - exp(-(r/scale)^exponent), within the bounds (Rosin and Rammler
    /// 1933; a Weibull distribution).
    RosinRammler {
        /// Radius below which 63.2 % of the mass lies [m].
        scale: f64,
        /// Exponent n; the larger, the narrower [-].
        exponent: f64,
        /// Smallest and largest radius [m].
        bounds: [f64; 2],
    },
    /// Sieve curve: points (radius [m], share of the mass that is finer [-]) from 0 to 1, straight lines between them.
    Sieve(Vec<[f64; 2]>),
}

/// Classes by which the number mean of a Rosin–Rammler distribution is taken.
const CLASSES: usize = 256;

impl SizeDistribution {
    /// Mean radius r̄ by number [m]; of the normal and lognormal distributions the nominal one, before truncation.
    pub fn mean(&self) -> f64 {
        match self {
            Self::TruncatedNormal { mean, .. } | Self::Lognormal { mean, .. } => *mean,
            Self::RosinRammler { scale, exponent, bounds } => {
                let radius = |k: usize| bounds[0] + (bounds[1] - bounds[0]) * k as f64 / CLASSES as f64;
                let points = (0..=CLASSES).map(|k| [radius(k), finer(radius(k), *scale, *exponent)]);
                number_mean(&points.collect::<Vec<_>>())
            }
            Self::Sieve(points) => number_mean(points),
        }
    }

    /// Smallest possible radius [m].
    pub fn smallest(&self) -> f64 {
        match self {
            Self::TruncatedNormal { mean, sd, below, .. } => mean - below * sd,
            Self::Lognormal { bounds, .. } | Self::RosinRammler { bounds, .. } => bounds[0],
            Self::Sieve(points) => points.first().map_or(f64::NAN, |point| point[0]),
        }
    }

    /// Largest possible radius [m].
    pub fn largest(&self) -> f64 {
        match self {
            Self::TruncatedNormal { mean, sd, above, .. } => mean + above * sd,
            Self::Lognormal { bounds, .. } | Self::RosinRammler { bounds, .. } => bounds[1],
            Self::Sieve(points) => points.last().map_or(f64::NAN, |point| point[0]),
        }
    }

    /// Draws a radius [m].
    pub(super) fn draw(&self, stream: &mut Stream) -> f64 {
        match self {
            Self::TruncatedNormal { mean, sd, below, above } => loop {
                let z = stream.normal();
                if (-below..=*above).contains(&z) {
                    return mean + sd * z;
                }
            },
            Self::Lognormal { mean, sd, bounds } => {
                let variance = libm::log(1.0 + (sd / mean) * (sd / mean));
                loop {
                    let radius = mean * libm::exp(variance.sqrt() * stream.normal() - 0.5 * variance);
                    if (bounds[0]..=bounds[1]).contains(&radius) {
                        return radius;
                    }
                }
            }
            Self::RosinRammler { scale, exponent, bounds } => {
                let [low, high] = bounds.map(|radius| finer(radius, *scale, *exponent));
                by_number(bounds[0], stream, |share| {
                    let coarser = 1.0 - (low + share * (high - low));
                    (scale * libm::pow(-libm::log(coarser), 1.0 / exponent)).clamp(bounds[0], bounds[1])
                })
            }
            Self::Sieve(points) => by_number(self.smallest(), stream, |share| radius_at(points, share)),
        }
    }

    /// What is wrong with the numbers, if anything.
    pub(super) fn fault(&self) -> Option<&'static str> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let not_negative = |x: f64| x.is_finite() && x >= 0.0;
        let sound = match self {
            Self::TruncatedNormal { mean, sd, below, above } => {
                positive(*mean) && not_negative(*sd) && positive(*below) && positive(*above)
            }
            Self::Lognormal { mean, sd, bounds } => positive(*mean) && not_negative(*sd) && contains(bounds, *mean),
            Self::RosinRammler { scale, exponent, bounds } => {
                positive(*exponent) && positive(*scale) && contains(bounds, *scale)
            }
            Self::Sieve(points) => is_curve(points),
        };
        match self {
            _ if sound && positive(self.smallest()) && self.largest().is_finite() => None,
            Self::Sieve(_) => Some("give at least two sieves of growing size, with shares that grow from 0 to 1"),
            Self::TruncatedNormal { .. } => {
                Some("give finite numbers, and a lower cut that leaves every radius positive")
            }
            Self::Lognormal { .. } | Self::RosinRammler { .. } => {
                Some("give positive numbers, and bounds round the size")
            }
        }
    }
}

fn contains(bounds: &[f64; 2], size: f64) -> bool {
    bounds[0] < bounds[1] && (bounds[0]..=bounds[1]).contains(&size)
}

/// Whether points make a sieve curve: radii grow, shares grow from 0 to 1.
fn is_curve(points: &[[f64; 2]]) -> bool {
    let ends = points.first().is_some_and(|p| p[1] == 0.0) && points.last().is_some_and(|p| p[1] == 1.0);
    ends && points.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1])
}

/// Share of the mass finer than a radius, 1 - exp(-(r/scale)^n).
fn finer(radius: f64, scale: f64, exponent: f64) -> f64 {
    1.0 - libm::exp(-libm::pow(radius / scale, exponent))
}

/// Radius below which a share of the mass of a sieve curve lies.
fn radius_at(points: &[[f64; 2]], share: f64) -> f64 {
    let upper = points.iter().position(|point| point[1] > share).unwrap_or(points.len() - 1).max(1);
    let ([r0, s0], [r1, s1]) = (points[upper - 1], points[upper]);
    r0 + (r1 - r0) * ((share - s0) / (s1 - s0)).clamp(0.0, 1.0)
}

/// A radius by number from one by mass: kept with probability (smallest/r)³.
fn by_number(smallest: f64, stream: &mut Stream, mut by_mass: impl FnMut(f64) -> f64) -> f64 {
    loop {
        let radius = by_mass(stream.uniform());
        let part = smallest / radius;
        if stream.uniform() < part * part * part {
            return radius;
        }
    }
}

/// Mean radius by number of a curve by mass. Mass spread evenly over a < r < b holds grains in proportion to r⁻³:
/// ∫ r⁻³ = (a⁻² - b⁻²)/2 of them, whose radii add up to ∫ r⁻² = 1/a - 1/b.
fn number_mean(points: &[[f64; 2]]) -> f64 {
    let (mut count, mut sum) = (0.0, 0.0);
    for pair in points.windows(2) {
        let ([a, from], [b, to]) = (pair[0], pair[1]);
        let density = (to - from) / (b - a);
        count += density * 0.5 * (1.0 / (a * a) - 1.0 / (b * b));
        sum += density * (1.0 / a - 1.0 / b);
    }
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 200_000;

    fn sample(size: &SizeDistribution) -> Vec<f64> {
        assert_eq!(size.fault(), None);
        let mut stream = Stream::new(1, "sizes");
        let radii: Vec<f64> = (0..COUNT).map(|_| size.draw(&mut stream)).collect();
        assert!(radii.iter().all(|r| (size.smallest()..=size.largest()).contains(r)));
        radii
    }

    fn mean(values: &[f64]) -> f64 {
        values.iter().sum::<f64>() / values.len() as f64
    }

    fn sd(values: &[f64]) -> f64 {
        let centre = mean(values);
        mean(&values.iter().map(|x| (x - centre) * (x - centre)).collect::<Vec<_>>()).sqrt()
    }

    /// Share of the mass of a sample that is finer, with its standard error √Σ(m_i (1{r_i < r} - F))²/Σ m.
    fn finer_share(radii: &[f64], radius: f64) -> (f64, f64) {
        let mass = |r: &f64| r * r * r;
        let total: f64 = radii.iter().map(mass).sum();
        let share = radii.iter().filter(|r| **r < radius).map(mass).sum::<f64>() / total;
        let error = |r: &f64| mass(r) * (f64::from(u8::from(*r < radius)) - share);
        (share, radii.iter().map(|r| error(r) * error(r)).sum::<f64>().sqrt() / total)
    }

    /// Mean 5.02 + 1.39 φ(1.5)/Φ(1.5) = 5.2129 mm, sd 1.22 mm (SCIENCE: mean 5.21, sd 1.22); five standard errors.
    #[test]
    fn a_truncated_normal_has_its_moments() {
        let size = SizeDistribution::TruncatedNormal { mean: 5.02e-3, sd: 1.39e-3, below: 1.5, above: 5.0 };
        let radii = sample(&size);
        assert!((mean(&radii) - 5.2129e-3).abs() < 5.0 * 1.22e-3 / (COUNT as f64).sqrt(), "{}", mean(&radii));
        assert!((sd(&radii) / 1.22e-3 - 1.0).abs() < 0.01, "{}", sd(&radii));
    }

    /// With bounds far out the nominal mean and sd come out: five standard errors, sd/√n and about 0.85 sd/√n at this skewness.
    #[test]
    fn a_lognormal_has_its_moments_and_its_median() {
        let size = SizeDistribution::Lognormal { mean: 5e-3, sd: 1e-3, bounds: [1e-4, 1e-1] };
        let mut radii = sample(&size);
        let error = 5.0 / (COUNT as f64).sqrt();
        assert!((mean(&radii) / 5e-3 - 1.0).abs() < error * 0.2, "{}", mean(&radii));
        assert!((sd(&radii) / 1e-3 - 1.0).abs() < error, "{}", sd(&radii));
        radii.sort_by(f64::total_cmp);
        // Median mean/√(1 + cv²); standard error 1.25 s/√n.
        assert!((radii[COUNT / 2] / (5e-3 / 1.04_f64.sqrt()) - 1.0).abs() < error * 1.25 * 0.2);
    }

    /// The mass curve of a sample is that of the law between its bounds, at every size within five standard errors, and the
    /// number mean is the one given.
    #[test]
    fn a_rosin_rammler_sample_has_its_mass_curve() {
        let (scale, exponent, bounds) = (5e-3, 3.5, [2e-3, 9e-3]);
        let size = SizeDistribution::RosinRammler { scale, exponent, bounds };
        let radii = sample(&size);
        let law = |r: f64| 1.0 - (-(r / scale).powf(exponent)).exp();
        for radius in [2.5e-3, 3e-3, 4e-3, 5e-3, 6e-3, 7e-3, 8e-3] {
            let exact = (law(radius) - law(bounds[0])) / (law(bounds[1]) - law(bounds[0]));
            let (share, error) = finer_share(&radii, radius);
            assert!((share - exact).abs() < 5.0 * error, "{radius}: {share} for {exact} ± {error}");
        }
        assert!((mean(&radii) / size.mean() - 1.0).abs() < 5.0 * sd(&radii) / mean(&radii) / (COUNT as f64).sqrt());
    }

    #[test]
    fn a_sieved_sample_gives_its_sieve_curve_back() {
        let curve = vec![[2e-3, 0.0], [3e-3, 0.1], [4e-3, 0.1], [5e-3, 0.6], [6.3e-3, 0.9], [8e-3, 1.0]];
        let size = SizeDistribution::Sieve(curve.clone());
        let radii = sample(&size);
        for [radius, exact] in curve {
            let (share, error) = finer_share(&radii, radius);
            assert!((share - exact).abs() <= 5.0 * error, "{radius}: {share} for {exact} ± {error}");
        }
        assert!(
            !radii.iter().any(|r| (3.001e-3..3.999e-3).contains(r)),
            "no mass lies between the second and third sieve"
        );
        assert!((mean(&radii) / size.mean() - 1.0).abs() < 5.0 * sd(&radii) / mean(&radii) / (COUNT as f64).sqrt());
    }

    #[test]
    fn impossible_distributions_are_refused() {
        let bounds = [1e-3, 2e-3];
        for size in [
            SizeDistribution::TruncatedNormal { mean: 1e-3, sd: 1e-3, below: 1.5, above: 1.0 },
            SizeDistribution::Lognormal { mean: 3e-3, sd: 1e-3, bounds },
            SizeDistribution::RosinRammler { scale: 1.5e-3, exponent: 0.0, bounds },
            SizeDistribution::RosinRammler { scale: 1.5e-3, exponent: 2.0, bounds: [2e-3, 1e-3] },
            SizeDistribution::Sieve(vec![]),
            SizeDistribution::Sieve(vec![[1e-3, 0.0], [2e-3, 0.9]]),
            SizeDistribution::Sieve(vec![[2e-3, 0.0], [1e-3, 1.0]]),
            SizeDistribution::Sieve(vec![[0.0, 0.0], [1e-3, 1.0]]),
        ] {
            assert!(size.fault().is_some(), "{size:?}");
        }
    }
}
