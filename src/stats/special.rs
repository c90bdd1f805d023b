//! Special functions and the quantiles of the usual distributions.
//!
//! Takes and gives plain `f64`. Everything rests on crate `libm` and on `+ − × ÷ √`, because numbers that are stored
//! must have the same bits on every machine; statistics crates call the platform's mathematical library, which does
//! not promise that. Relative accuracy is about 1e-12 for the arguments statistics needs (degrees of freedom from 1 to
//! some thousands). Arguments outside a function's domain give NaN; there are no errors and no panics.
//! Deliberately absent: anything random (see `rng`) and any estimate from data (see `summary`).

use std::f64::consts::{LN_2, PI, SQRT_2};

/// Largest number of terms of a series or continued fraction; they need about √(largest argument) of them.
const MAX_TERMS: usize = 20_000;
/// Relative size at which a series or continued fraction has converged.
const CONVERGED: f64 = 1e-16;
/// Stand-in for zero in a continued fraction (Lentz).
const TINY: f64 = 1e-300;

/// ln Γ(x), x > 0.
pub fn ln_gamma(x: f64) -> f64 {
    if x > 0.0 { libm::lgamma(x) } else { f64::NAN }
}

/// ψ(x) = d ln Γ(x)/dx, x > 0: upward recurrence to x ≥ 15, then the asymptotic series.
pub fn digamma(x: f64) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return f64::NAN;
    }
    let (mut x, mut shift) = (x, 0.0);
    while x < 15.0 {
        shift += 1.0 / x;
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = y
        * (1.0 / 12.0
            - y * (1.0 / 120.0 - y * (1.0 / 252.0 - y * (1.0 / 240.0 - y * (1.0 / 132.0 - y * 691.0 / 32_760.0)))));
    libm::log(x) - 0.5 / x - series - shift
}

/// ψ₁(x) = dψ(x)/dx, x > 0: upward recurrence to x ≥ 15, then the asymptotic series.
pub fn trigamma(x: f64) -> f64 {
    if x.is_nan() || x <= 0.0 {
        return f64::NAN;
    }
    let (mut x, mut shift) = (x, 0.0);
    while x < 15.0 {
        shift += 1.0 / (x * x);
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series =
        1.0 / 6.0 - y * (1.0 / 30.0 - y * (1.0 / 42.0 - y * (1.0 / 30.0 - y * (5.0 / 66.0 - y * 691.0 / 2730.0))));
    shift + 1.0 / x + 0.5 * y + series * y / x
}

/// Error function 2/√π ∫₀ˣ exp(−t²) dt.
pub fn erf(x: f64) -> f64 {
    libm::erf(x)
}

/// Complement 1 − erf(x), accurate in the tail.
pub fn erfc(x: f64) -> f64 {
    libm::erfc(x)
}

/// Density of the standard normal distribution.
pub fn normal_density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x) / (2.0 * PI).sqrt()
}

/// Φ(x), the standard normal distribution function.
pub fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x / SQRT_2)
}

/// 1 − Φ(x), accurate in the upper tail.
pub fn normal_sf(x: f64) -> f64 {
    normal_cdf(-x)
}

/// ln Φ(x), finite far into the lower tail, where Φ itself underflows.
pub fn normal_ln_cdf(x: f64) -> f64 {
    if x > -30.0 {
        return libm::log(normal_cdf(x));
    }
    // Asymptotic series of Mills' ratio; its next term is below 1e-9 of the last kept one at x = −30.
    let y = 1.0 / (x * x);
    let series = 1.0 - y * (1.0 - 3.0 * y * (1.0 - 5.0 * y * (1.0 - 7.0 * y)));
    -0.5 * x * x - libm::log(-x) - 0.5 * (LN_2 + libm::log(PI)) + libm::log(series)
}

/// Φ⁻¹(p): Wichura's algorithm AS 241 (PPND16), relative accuracy about 1e-16.
pub fn normal_quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180625 - q * q;
        return q * ratio(r, &CENTRE_NUMERATOR, &CENTRE_DENOMINATOR);
    }
    let tail = if q < 0.0 { p } else { 1.0 - p };
    if tail.is_nan() || tail < 0.0 {
        return f64::NAN;
    }
    if tail == 0.0 {
        return if q < 0.0 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    let r = (-libm::log(tail)).sqrt();
    let x = if r <= 5.0 {
        ratio(r - 1.6, &MIDDLE_NUMERATOR, &MIDDLE_DENOMINATOR)
    } else {
        ratio(r - 5.0, &FAR_NUMERATOR, &FAR_DENOMINATOR)
    };
    if q < 0.0 { -x } else { x }
}

/// P(a, x) = γ(a, x)/Γ(a), the regularised lower incomplete gamma function; a > 0, x ≥ 0.
pub fn gamma_p(a: f64, x: f64) -> f64 {
    gamma_pair(a, x).0
}

/// Q(a, x) = 1 − P(a, x), accurate in the upper tail.
pub fn gamma_q(a: f64, x: f64) -> f64 {
    gamma_pair(a, x).1
}

/// I_x(a, b), the regularised incomplete beta function; a, b > 0, 0 ≤ x ≤ 1.
pub fn beta_i(a: f64, b: f64, x: f64) -> f64 {
    beta_pair(a, b, x, 1.0 - x).0
}

/// Distribution function of χ² with `dof` degrees of freedom.
pub fn chi2_cdf(x: f64, dof: f64) -> f64 {
    gamma_p(0.5 * dof, 0.5 * x.max(0.0))
}

/// Upper tail of χ² with `dof` degrees of freedom: the p-value of a sum of squares.
pub fn chi2_sf(x: f64, dof: f64) -> f64 {
    gamma_q(0.5 * dof, 0.5 * x.max(0.0))
}

/// The value that χ² with `dof` degrees of freedom stays below with probability `p`.
pub fn chi2_quantile(p: f64, dof: f64) -> f64 {
    if let Some(edge) = quantile_edge(p, dof, f64::INFINITY) {
        return edge;
    }
    let a = 0.5 * dof;
    // Wilson and Hilferty's cube-root approximation starts the search, the small-x limit where that turns negative.
    let z = normal_quantile(p);
    let c = 1.0 - 1.0 / (9.0 * a) + z / (3.0 * a.sqrt());
    let low = libm::exp((libm::log(p) + ln_gamma(a + 1.0)) / a);
    let start = if c > 0.2 { a * c * c * c } else { low };
    let density = |x: f64| libm::exp((a - 1.0) * libm::log(x) - x - ln_gamma(a));
    2.0 * invert(p, 0.0, f64::INFINITY, start, |x| gamma_pair(a, x), density)
}

/// Distribution function of Student's t with `dof` degrees of freedom.
pub fn student_t_cdf(t: f64, dof: f64) -> f64 {
    let square = t * t;
    if square.is_infinite() {
        return if t > 0.0 { 1.0 } else { 0.0 };
    }
    let total = dof + square;
    let (outside, _) = beta_pair(0.5 * dof, 0.5, dof / total, square / total);
    if t > 0.0 { 1.0 - 0.5 * outside } else { 0.5 * outside }
}

/// The value that Student's t with `dof` degrees of freedom stays below with probability `p`.
pub fn student_t_quantile(p: f64, dof: f64) -> f64 {
    if !(0.0..=1.0).contains(&p) || dof.is_nan() || dof <= 0.0 {
        return f64::NAN;
    }
    let tail = if p < 0.5 { p } else { 1.0 - p };
    if tail == 0.0 {
        return if p < 0.5 { f64::NEG_INFINITY } else { f64::INFINITY };
    }
    // t²/(ν + t²) is Beta(½, ν/2); each form is used where its argument is not close to one.
    let square = if tail < 0.25 {
        let y = beta_quantile(2.0 * tail, 0.5 * dof, 0.5);
        dof * (1.0 - y) / y
    } else {
        let z = beta_quantile(1.0 - 2.0 * tail, 0.5, 0.5 * dof);
        dof * z / (1.0 - z)
    };
    if p < 0.5 { -square.sqrt() } else { square.sqrt() }
}

/// The value that Beta(a, b) stays below with probability `p`; the Clopper–Pearson limits are such quantiles.
pub fn beta_quantile(p: f64, a: f64, b: f64) -> f64 {
    if let Some(edge) = quantile_edge(p, a.min(b), 1.0) {
        return edge;
    }
    // The power-law limits at both ends start the search where the mean would be a poor guess.
    let ln_beta = ln_gamma(a) + ln_gamma(b) - ln_gamma(a + b);
    let low = libm::exp((libm::log(p * a) + ln_beta) / a);
    let start = if low < 0.1 * a / (a + b) { low } else { a / (a + b) };
    let density = |x: f64| libm::exp((a - 1.0) * libm::log(x) + (b - 1.0) * libm::log1p(-x) - ln_beta);
    invert(p, 0.0, 1.0, start, |x| beta_pair(a, b, x, 1.0 - x), density)
}

/// Trivial or impossible quantiles: `Some` of 0, `top` or NaN.
fn quantile_edge(p: f64, shape: f64, top: f64) -> Option<f64> {
    if !(0.0..=1.0).contains(&p) || shape.is_nan() || shape <= 0.0 {
        Some(f64::NAN)
    } else if p == 0.0 {
        Some(0.0)
    } else if p == 1.0 {
        Some(top)
    } else {
        None
    }
}

/// Solves cdf(x) = p by Newton steps inside a shrinking bracket; the smaller tail is compared, so that both keep digits.
fn invert(
    p: f64,
    low: f64,
    high: f64,
    start: f64,
    tails: impl Fn(f64) -> (f64, f64),
    density: impl Fn(f64) -> f64,
) -> f64 {
    let (mut low, mut high, mut x) = (low, high, start);
    for _ in 0..200 {
        let (lower, upper) = tails(x);
        let excess = if p < 0.5 { lower - p } else { (1.0 - p) - upper };
        if excess > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - excess / density(x);
        let next = if newton > low && newton < high { newton } else { halfway(low, high) };
        if (next - x).abs() <= 2e-16 * x.abs() {
            return next;
        }
        x = next;
    }
    x
}

/// Middle of a bracket; doubles the lower end while there is no upper one, and shrinks fast towards zero.
fn halfway(low: f64, high: f64) -> f64 {
    if high.is_infinite() {
        2.0 * low.max(0.5)
    } else if low == 0.0 {
        0.1 * high
    } else {
        0.5 * (low + high)
    }
}

/// (P, Q) of the incomplete gamma function: the smaller one is computed, the other is its complement.
fn gamma_pair(a: f64, x: f64) -> (f64, f64) {
    if a.is_nan() || x.is_nan() || a <= 0.0 || x < 0.0 {
        return (f64::NAN, f64::NAN);
    }
    if x == 0.0 {
        return (0.0, 1.0);
    }
    if x.is_infinite() {
        return (1.0, 0.0);
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let p = (front * gamma_series(a, x)).min(1.0);
        (p, 1.0 - p)
    } else {
        let q = (front * gamma_fraction(a, x)).min(1.0);
        (1.0 - q, q)
    }
}

/// Σ xⁿ/(a(a+1)…(a+n)), the series of γ(a, x) without its front factor.
fn gamma_series(a: f64, x: f64) -> f64 {
    let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
    for _ in 0..MAX_TERMS {
        n += 1.0;
        term *= x / n;
        sum += term;
        if term < CONVERGED * sum {
            break;
        }
    }
    sum
}

/// Continued fraction of Γ(a, x) without its front factor (Lentz's method).
fn gamma_fraction(a: f64, x: f64) -> f64 {
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1.0 / TINY, 1.0 / b);
    let mut h = d;
    for i in 1..MAX_TERMS {
        let i = i as f64;
        let numerator = -i * (i - a);
        b += 2.0;
        d = 1.0 / away_from_zero(numerator * d + b);
        c = away_from_zero(b + numerator / c);
        let factor = d * c;
        h *= factor;
        if (factor - 1.0).abs() < 2.0 * CONVERGED {
            break;
        }
    }
    h
}

/// (I_x, 1 − I_x) of the incomplete beta function; `y` = 1 − x is given apart so that neither end loses digits.
fn beta_pair(a: f64, b: f64, x: f64, y: f64) -> (f64, f64) {
    if !(a > 0.0 && b > 0.0 && (0.0..=1.0).contains(&x)) {
        return (f64::NAN, f64::NAN);
    }
    if x == 0.0 || y == 0.0 {
        return if x == 0.0 { (0.0, 1.0) } else { (1.0, 0.0) };
    }
    let ln_beta = libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    let ln_y = if x < 0.5 { libm::log1p(-x) } else { libm::log(y) };
    let ln_x = if x < 0.5 { libm::log(x) } else { libm::log1p(-y) };
    let front = libm::exp(a * ln_x + b * ln_y - ln_beta);
    if x < (a + 1.0) / (a + b + 2.0) {
        let lower = (front * beta_fraction(a, b, x) / a).min(1.0);
        (lower, 1.0 - lower)
    } else {
        let upper = (front * beta_fraction(b, a, y) / b).min(1.0);
        (1.0 - upper, upper)
    }
}

/// Continued fraction of the incomplete beta function (Lentz's method).
fn beta_fraction(a: f64, b: f64, x: f64) -> f64 {
    let mut c = 1.0;
    let mut d = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0));
    let mut h = d;
    for m in 1..MAX_TERMS {
        let m = m as f64;
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / away_from_zero(1.0 + even * d);
        c = away_from_zero(1.0 + even / c);
        h *= d * c;
        d = 1.0 / away_from_zero(1.0 + odd * d);
        c = away_from_zero(1.0 + odd / c);
        let factor = d * c;
        h *= factor;
        if (factor - 1.0).abs() < 2.0 * CONVERGED {
            break;
        }
    }
    h
}

fn away_from_zero(x: f64) -> f64 {
    if x.abs() < TINY { TINY } else { x }
}

/// Ratio of two polynomials, coefficients from the constant upwards.
fn ratio(x: f64, numerator: &[f64], denominator: &[f64]) -> f64 {
    let value = |coefficients: &[f64]| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    value(numerator) / value(denominator)
}

// Coefficients of AS 241 (Wichura 1988, Applied Statistics 37:477), constant term first.
const CENTRE_NUMERATOR: [f64; 8] = [
    3.387_132_872_796_366_5,
    1.331_416_678_917_843_8e2,
    1.971_590_950_306_551_3e3,
    1.373_169_376_550_946e4,
    4.592_195_393_154_987e4,
    6.726_577_092_700_87e4,
    3.343_057_558_358_813e4,
    2.509_080_928_730_122_7e3,
];
const CENTRE_DENOMINATOR: [f64; 8] = [
    1.0,
    4.231_333_070_160_091e1,
    6.871_870_074_920_579e2,
    5.394_196_021_424_751e3,
    2.121_379_430_158_659_7e4,
    3.930_789_580_009_271e4,
    2.872_908_573_572_194_3e4,
    5.226_495_278_852_854e3,
];
const MIDDLE_NUMERATOR: [f64; 8] = [
    1.423_437_110_749_683_5,
    4.630_337_846_156_546,
    5.769_497_221_460_691,
    3.647_848_324_763_204_5,
    1.270_458_252_452_368_4,
    2.417_807_251_774_506e-1,
    2.272_384_498_926_918_4e-2,
    7.745_450_142_783_414e-4,
];
const MIDDLE_DENOMINATOR: [f64; 8] = [
    1.0,
    2.053_191_626_637_759,
    1.676_384_830_183_803_8,
    6.897_673_349_851e-1,
    1.481_039_764_274_800_8e-1,
    1.519_866_656_361_645_7e-2,
    5.475_938_084_995_345e-4,
    1.050_750_071_644_416_9e-9,
];
const FAR_NUMERATOR: [f64; 8] = [
    6.657_904_643_501_103,
    5.463_784_911_164_114,
    1.784_826_539_917_291_3,
    2.965_605_718_285_048_7e-1,
    2.653_218_952_657_612_4e-2,
    1.242_660_947_388_078_4e-3,
    2.711_555_568_743_487_6e-5,
    2.010_334_399_292_288_1e-7,
];
const FAR_DENOMINATOR: [f64; 8] = [
    1.0,
    5.998_322_065_558_88e-1,
    1.369_298_809_227_358e-1,
    1.487_536_129_085_061_5e-2,
    7.868_691_311_456_133e-4,
    1.846_318_317_510_054_7e-5,
    1.421_511_758_316_446e-7,
    2.044_263_103_389_939_8e-15,
];
