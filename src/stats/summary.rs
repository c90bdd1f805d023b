//! Summaries of repeated values: mean, scatter, their intervals, and how many repetitions they need.
//!
//! Takes slices of finite values (one per repetition, in order) and gives plain numbers in the unit of the values.
//! Fewer values than a statistic needs give NaN in that field, never a panic. Sums run in the order given, so the bits
//! of a result depend on nothing else. Deliberately absent: any opinion on which KPI is meant, and missing values
//! (drop them first, and say so where they were dropped).

use super::special;
use crate::rng::Stream;

/// Which degrees of freedom an interval uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Convention {
    /// t and χ² with n − 1 degrees of freedom at every n.
    #[default]
    Correct,
    /// As printed by Fransen et al. (2022): n degrees of freedom in both, and the normal quantile for the mean from
    /// n = 30 on. Reproduces the factor 1.837 at n = 3 (correct: 2.484).
    Paper,
}

/// A two-sided interval, in the unit of the quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower limit.
    pub lower: f64,
    /// Upper limit.
    pub upper: f64,
}

/// Mean and standard deviation of one set of repetitions with their intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Number of repetitions.
    pub n: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Standard deviation with n − 1 in the denominator; NaN below two values.
    pub sd: f64,
    /// Interval of the mean; NaN below two values.
    pub mean_interval: Interval,
    /// Interval of the standard deviation (normal values assumed); NaN below two values.
    pub sd_interval: Interval,
}

/// Bias-corrected logarithm of a standard deviation, whose error does not depend on the standard deviation itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LnSd {
    /// ln s − ½(ψ(ν/2) − ln(ν/2)), ν = n − 1: unbiased for ln σ under normal values.
    pub value: f64,
    /// Its standard deviation ½√ψ₁(ν/2).
    pub sd: f64,
}

/// Straight line through the values against the repetition number 1, 2, ….
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trend {
    /// Change per repetition.
    pub slope: f64,
    /// Standard error of the slope, with n − 2 degrees of freedom; NaN below three values.
    pub standard_error: f64,
}

/// Arithmetic mean; NaN for no values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation with n − 1 in the denominator (two passes); NaN below two values.
pub fn sd(values: &[f64]) -> f64 {
    if values.len() < 2 {
        return f64::NAN;
    }
    let centre = mean(values);
    let squares: f64 = values.iter().map(|value| (value - centre) * (value - centre)).sum();
    (squares / (values.len() - 1) as f64).sqrt()
}

/// Mean and standard deviation of values that come one by one, each in constant time and memory.
///
/// The mean is the plain sum over n, as in [`mean`]. Squares are updated by M₂ ← M₂ + (n·d − D)²/(n(n − 1)) (Youngs and
/// Cramer 1971), D = Σd, on distances d from the first value, which costs no digits where the scatter is small beside the
/// mean (Chan, Golub and LeVeque 1983): relative error of about n ε. Equal values have a scatter of exactly zero.
#[derive(Debug, Clone, Copy, Default)]
pub struct Running {
    n: usize,
    first: f64,
    sum: f64,
    distance: f64,
    squares: f64,
}

impl Running {
    /// Takes one more value.
    pub fn push(&mut self, value: f64) {
        if self.n == 0 {
            self.first = value;
        }
        self.n += 1;
        let (n, d) = (self.n as f64, value - self.first);
        self.sum += value;
        self.distance += d;
        if self.n > 1 {
            let gap = n * d - self.distance;
            self.squares += gap * gap / (n * (n - 1.0));
        }
    }

    /// Number of values.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Arithmetic mean; NaN for no values.
    pub fn mean(&self) -> f64 {
        self.sum / self.n as f64
    }

    /// Standard deviation with n − 1 in the denominator; NaN below two values.
    pub fn sd(&self) -> f64 {
        if self.n < 2 { f64::NAN } else { (self.squares / (self.n - 1) as f64).sqrt() }
    }
}

/// What makes intervals of a mean and a standard deviation: quantiles that depend on the number of values alone.
#[derive(Debug, Clone, Copy)]
pub struct Factors {
    n: usize,
    mean: f64,
    sd: Interval,
}

impl Factors {
    /// The factors for `n` values; NaN below two. `level` is the coverage of the intervals, for example 0.95.
    pub fn new(n: usize, level: f64, convention: Convention) -> Self {
        if n < 2 {
            return Self { n, mean: f64::NAN, sd: Interval { lower: f64::NAN, upper: f64::NAN } };
        }
        let limit = |p| ((n - 1) as f64 / special::chi2_quantile(p, dof(n, convention))).sqrt();
        let sd = Interval { lower: limit(0.5 + 0.5 * level), upper: limit(0.5 - 0.5 * level) };
        Self { n, mean: mean_factor(n, level, convention), sd }
    }

    /// Interval of a mean: mean ± t·sd/√n.
    pub fn of_mean(&self, mean: f64, sd: f64) -> Interval {
        let half = self.mean * sd / (self.n as f64).sqrt();
        Interval { lower: mean - half, upper: mean + half }
    }

    /// Interval of a standard deviation: sd·√((n − 1)/χ²), from the two tails of χ².
    pub fn of_sd(&self, sd: f64) -> Interval {
        Interval { lower: sd * self.sd.lower, upper: sd * self.sd.upper }
    }

    /// The summary of so many values with this mean and standard deviation.
    pub fn summary(&self, mean: f64, sd: f64) -> Summary {
        Summary { n: self.n, mean, sd, mean_interval: self.of_mean(mean, sd), sd_interval: self.of_sd(sd) }
    }
}

/// Summary of all values; `level` is the coverage of the intervals, for example 0.95.
pub fn summarise(values: &[f64], level: f64, convention: Convention) -> Summary {
    Factors::new(values.len(), level, convention).summary(mean(values), sd(values))
}

/// Summaries of the first 1, 2, …, N values: the curves of Fig. 6.
pub fn cumulative(values: &[f64], level: f64, convention: Convention) -> Vec<Summary> {
    let step = |running: &mut Running, value: &f64| {
        running.push(*value);
        Some(Factors::new(running.n, level, convention).summary(running.mean(), running.sd()))
    };
    values.iter().scan(Running::default(), step).collect()
}

/// Interval of a mean: mean ± t·sd/√n.
pub fn mean_interval(mean: f64, sd: f64, n: usize, level: f64, convention: Convention) -> Interval {
    Factors::new(n, level, convention).of_mean(mean, sd)
}

/// Interval of a standard deviation: sd·√((n − 1)/χ²), from the two tails of χ².
pub fn sd_interval(sd: f64, n: usize, level: f64, convention: Convention) -> Interval {
    Factors::new(n, level, convention).of_sd(sd)
}

/// Variance of the mean of `n` values with a standard deviation, and its degrees of freedom.
pub fn variance_of_mean(sd: f64, n: usize) -> (f64, f64) {
    (sd * sd / n as f64, n as f64 - 1.0)
}

/// Variance of a sum or difference of independent means, each given by its variance and the degrees of freedom of that, with its
/// own after Welch (1947) and Satterthwaite (1946). NaN where a mean has fewer than two values, or none has any scatter.
pub fn welch(means: &[(f64, f64)]) -> (f64, f64) {
    let sums = means.iter().fold((0.0, 0.0), |(sum, squares), (v, dof)| (sum + v, squares + v * v / dof));
    (sums.0, sums.0 * sums.0 / sums.1)
}

/// Smallest n from which the running mean stays within `tolerance` (relative) of the final mean: 0.01 for Fig. 6.
/// `None` for no values.
pub fn stability_count(values: &[f64], tolerance: f64) -> Option<usize> {
    let last = mean(values);
    let mut running = Running::default();
    let mut leaves = 0;
    for value in values {
        running.push(*value);
        if (running.mean() - last).abs() > tolerance * last.abs() {
            leaves = running.n;
        }
    }
    (!values.is_empty()).then_some(leaves + 1)
}

/// Bias-corrected ln s of a standard deviation from `n` values; NaN below two values or for a scatter of zero.
pub fn ln_sd(sd: f64, n: usize) -> LnSd {
    if n < 2 || sd.is_nan() || sd <= 0.0 {
        return LnSd { value: f64::NAN, sd: f64::NAN };
    }
    let half = 0.5 * (n - 1) as f64;
    LnSd {
        value: libm::log(sd) - 0.5 * (special::digamma(half) - libm::log(half)),
        sd: 0.5 * special::trigamma(half).sqrt(),
    }
}

/// Least-squares line against the repetition number.
pub fn trend(values: &[f64]) -> Trend {
    let n = values.len() as f64;
    let (centre, middle) = (mean(values), 0.5 * (n + 1.0));
    let offsets: Vec<f64> = (1..=values.len()).map(|i| i as f64 - middle).collect();
    let spread = n * (n * n - 1.0) / 12.0;
    let slope = offsets.iter().zip(values).map(|(x, y)| x * (y - centre)).sum::<f64>() / spread;
    let residual: f64 = offsets
        .iter()
        .zip(values)
        .map(|(x, y)| {
            let e = y - centre - slope * x;
            e * e
        })
        .sum();
    let variance = if values.len() < 3 { f64::NAN } else { residual / (n - 2.0) / spread };
    Trend { slope, standard_error: variance.sqrt() }
}

/// Smallest n ≥ 2 for which the interval of the mean is at most ± `precision` (relative), where `cv` = sd/mean.
/// `None` if more than a million repetitions would be needed or an argument is not positive and finite.
pub fn repetitions_needed(cv: f64, precision: f64, level: f64) -> Option<usize> {
    let positive = |x: f64| x.is_finite() && x > 0.0;
    if !positive(cv) || !positive(precision) {
        return None;
    }
    let enough = |n: usize| mean_factor(n, level, Convention::Correct) * cv / (n as f64).sqrt() <= precision;
    let (mut low, mut high) = (1, 2);
    while !enough(high) {
        (low, high) = (high, 2 * high);
        if high > 1 << 20 {
            return None;
        }
    }
    while high - low > 1 {
        let middle = (low + high) / 2;
        if enough(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(high)
}

/// How many repetitions a precision takes, judged by repetitions that are there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RepetitionPlan {
    /// Half width of the mean's interval over the mean, as reached.
    pub reached: f64,
    /// Repetitions needed at the standard deviation as found; `None` beyond a million.
    pub needed: Option<usize>,
    /// The same at the limits of the standard deviation's interval: what the plan itself is worth.
    pub range: (Option<usize>, Option<usize>),
}

/// Repetitions for which the interval of the mean is at most ± `precision` (relative), from the mean and sd of `n`
/// repetitions: [`repetitions_needed`] at s and at both limits of its interval.
pub fn plan_repetitions(
    mean: f64,
    sd: f64,
    n: usize,
    precision: f64,
    level: f64,
    convention: Convention,
) -> RepetitionPlan {
    let of = |sd: f64| repetitions_needed(sd / mean.abs(), precision, level);
    let limits = sd_interval(sd, n, level, convention);
    RepetitionPlan {
        reached: (mean_interval(mean, sd, n, level, convention).upper - mean) / mean.abs(),
        needed: of(sd),
        range: (of(limits.lower), of(limits.upper)),
    }
}

/// Clopper–Pearson interval of a rate of `successes` in `trials`; [0, 1] for no trials.
pub fn clopper_pearson(successes: usize, trials: usize, level: f64) -> Interval {
    let (k, n, tail) = (successes as f64, trials as f64, 0.5 * (1.0 - level));
    let lower = if successes == 0 { 0.0 } else { special::beta_quantile(tail, k, n - k + 1.0) };
    let upper = if successes >= trials { 1.0 } else { special::beta_quantile(1.0 - tail, k + 1.0, n - k) };
    Interval { lower, upper }
}

/// Lilliefors' distance D between the values and the normal distribution with their own mean and sd; NaN when there
/// are fewer than four values or they are all equal.
pub fn lilliefors_distance(values: &[f64]) -> f64 {
    let (n, centre, scatter) = (values.len() as f64, mean(values), sd(values));
    if values.len() < 4 || scatter.is_nan() || scatter <= 0.0 {
        return f64::NAN;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let gap = |(i, x): (usize, &f64)| {
        let model = special::normal_cdf((x - centre) / scatter);
        ((i + 1) as f64 / n - model).max(model - i as f64 / n)
    };
    sorted.iter().enumerate().map(gap).fold(0.0, f64::max)
}

/// p-value of D from published fits: Dallal and Wilkinson (1986) up to 0.1, above it the fit of Stephens' modified
/// statistic that R's package nortest uses. Against simulation the upper part is good to 0.02 from n = 7 on, to 0.04 at
/// n = 5 and 0.07 at n = 4; beyond n = 100 D is rescaled in the lower part. For a decision, simulate.
pub fn lilliefors_p(distance: f64, n: usize) -> f64 {
    let (d, size) = if n > 100 { (distance * libm::pow(n as f64 / 100.0, 0.49), 100.0) } else { (distance, n as f64) };
    let m = size + 2.78019;
    let exponent = -7.01256 * d * d * m + 2.99587 * d * m.sqrt() - 0.122119 + 0.974598 / size.sqrt() + 1.67997 / size;
    let p = libm::exp(exponent);
    if p <= 0.1 { p } else { stephens_p(distance, n as f64) }
}

/// p-value of D by simulation: the share of `draws` normal samples of this size that lie at least as far from normal.
/// Its standard error is √(p(1 − p)/draws). The same seed gives the same p.
pub fn lilliefors_p_monte_carlo(distance: f64, n: usize, draws: usize, seed: u64) -> f64 {
    let mut stream = Stream::new(seed, "lilliefors");
    let mut sample = vec![0.0; n];
    let mut as_far = 0;
    for _ in 0..draws {
        sample.fill_with(|| stream.normal());
        if lilliefors_distance(&sample) >= distance {
            as_far += 1;
        }
    }
    (as_far + 1) as f64 / (draws + 1) as f64
}

fn dof(n: usize, convention: Convention) -> f64 {
    match convention {
        Convention::Correct => (n - 1) as f64,
        Convention::Paper => n as f64,
    }
}

/// Quantile by which sd/√n is multiplied.
fn mean_factor(n: usize, level: f64, convention: Convention) -> f64 {
    let p = 0.5 + 0.5 * level;
    if convention == Convention::Paper && n >= 30 {
        special::normal_quantile(p)
    } else {
        special::student_t_quantile(p, dof(n, convention))
    }
}

/// Upper part of the Lilliefors p-value as a piecewise polynomial of Stephens' modified statistic.
fn stephens_p(distance: f64, n: f64) -> f64 {
    let k = (n.sqrt() - 0.01 + 0.85 / n.sqrt()) * distance;
    let polynomial = |c: [f64; 5]| c[0] + k * (c[1] + k * (c[2] + k * (c[3] + k * c[4])));
    let p = if k <= 0.302 {
        1.0
    } else if k <= 0.5 {
        polynomial([2.76773, -19.828315, 80.709644, -138.55152, 81.218052])
    } else if k <= 0.9 {
        polynomial([-4.901232, 40.662806, -97.490286, 94.029866, -32.355711])
    } else {
        polynomial([6.198765, -19.558097, 23.186922, -12.234627, 2.423045])
    };
    p.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn too_few_values_give_nan_not_a_panic() {
        let one = summarise(&[3.0], 0.95, Convention::Correct);
        assert_eq!((one.n, one.mean), (1, 3.0));
        assert!(one.sd.is_nan() && one.mean_interval.lower.is_nan() && one.sd_interval.upper.is_nan());
        assert!(mean(&[]).is_nan());
        assert!(ln_sd(1.0, 1).value.is_nan() && ln_sd(0.0, 5).value.is_nan());
        assert!(lilliefors_distance(&[1.0; 10]).is_nan());
        assert!(trend(&[1.0, 2.0]).standard_error.is_nan());
    }

    #[test]
    fn running_values_agree_with_two_passes_over_every_prefix() {
        // A scatter of 1e-7 of the mean, and a first value a hundred standard deviations off.
        for (centre, scatter, first) in [(10.0, 1.0, 0.0), (1e4, 1e-3, 0.0), (700.0, 1e-4, 1e-2)] {
            let mut stream = Stream::new(7, "running");
            let values: Vec<f64> = (0..3000).map(|_| centre + scatter * stream.normal()).collect();
            let values = [&[centre + first], values.as_slice()].concat();
            let mut running = Running::default();
            for (at, value) in values.iter().enumerate() {
                running.push(*value);
                let n = at + 1;
                if n % 97 == 0 || n < 20 {
                    assert_eq!(running.mean(), mean(&values[..n]));
                    // Both are good to about n ε, the two passes on distances from the first as well.
                    let distances: Vec<f64> = values[..n].iter().map(|value| value - values[0]).collect();
                    let (fast, exact) = (running.sd(), sd(&distances));
                    assert!(n < 2 || (fast / exact - 1.0).abs() < n as f64 * f64::EPSILON, "n = {n}: {fast} {exact}");
                }
            }
        }
        let mut same = Running::default();
        (0..100).for_each(|_| same.push(0.1));
        assert_eq!(same.sd(), 0.0);
    }

    #[test]
    fn stability_counts_from_the_last_excursion() {
        // Running means 10, 10.5, 10, 10: the second is 5 % off the last, so stability starts at the third value.
        assert_eq!(stability_count(&[10.0, 11.0, 9.0, 10.0], 0.01), Some(3));
        assert_eq!(stability_count(&[5.0, 5.0], 0.01), Some(1));
        assert_eq!(stability_count(&[], 0.01), None);
    }

    #[test]
    fn a_line_is_its_own_trend() {
        let line = trend(&[1.0, 3.0, 5.0, 7.0]);
        assert!((line.slope - 2.0).abs() < 1e-14 && line.standard_error < 1e-14);
        // By hand: values 0, 1, 0 against 1, 2, 3 have slope 0, residual 2/3, spread 2, so se = √((2/3)/1/2).
        let bump = trend(&[0.0, 1.0, 0.0]);
        assert!(bump.slope.abs() < 1e-15);
        assert!((bump.standard_error - (1.0_f64 / 3.0).sqrt()).abs() < 1e-14);
    }

    #[test]
    fn welch_degrees_of_freedom_lie_between_those_of_the_parts() {
        // By hand: 9/3 + 16/4 = 7, 49/(9/2 + 16/3) = 294/59.
        let (variance, dof) = welch(&[variance_of_mean(3.0, 3), variance_of_mean(4.0, 4)]);
        assert!((variance - 7.0).abs() < 1e-15 && (dof - 294.0 / 59.0).abs() < 1e-14, "{variance} {dof}");
        // Equal parts have the sum of their degrees of freedom, one part alone its own.
        assert!((welch(&[variance_of_mean(2.0, 10), variance_of_mean(2.0, 10)]).1 - 18.0).abs() < 1e-13);
        assert!((welch(&[variance_of_mean(2.0, 10), variance_of_mean(0.0, 5)]).1 - 9.0).abs() < 1e-13);
        assert!(
            welch(&[variance_of_mean(f64::NAN, 1), variance_of_mean(2.0, 10)]).1.is_nan()
                && welch(&[variance_of_mean(0.0, 3)]).1.is_nan()
        );
    }

    #[test]
    fn repetitions_needed_is_the_smallest_that_suffices() {
        let half = |n: usize| mean_factor(n, 0.95, Convention::Correct) * 0.0822 / (n as f64).sqrt();
        let n = repetitions_needed(0.0822, 0.022, 0.95).unwrap_or(0);
        assert!(half(n) <= 0.022 && half(n - 1) > 0.022, "n = {n}");
        assert_eq!(repetitions_needed(1e-9, 0.5, 0.95), Some(2));
        assert_eq!(repetitions_needed(1.0, 1e-6, 0.95), None);
        assert_eq!(repetitions_needed(f64::NAN, 0.01, 0.95), None);
    }
}
