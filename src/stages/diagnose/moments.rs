//! Statistics of repeated runs: means and logarithms of standard deviations, with their covariance.
//!
//! Takes the observables of a batch of repetitions; gives one value per statistic and the covariance matrix of the
//! whole vector. Observables of one experiment come from the same run and are correlated; experiments are independent.

use crate::stats::special::trigamma;
use crate::stats::summary::{ln_sd, mean, sd};
use crate::tables::list::KpiRow;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Which moment of an observable a statistic is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Moment {
    /// Mean over the repetitions.
    Mean,
    /// Bias-corrected natural logarithm of the standard deviation between repetitions.
    LnSd,
    /// Slope over the place of the repetition in its series.
    Trend,
}

impl Moment {
    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::LnSd => "ln_sd",
            Self::Trend => "trend",
        }
    }
}

/// One row of the evidence: a moment of an observable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Statistic {
    /// Experiment.
    pub experiment: String,
    /// Observable.
    pub kpi: String,
    /// Unit of the observable.
    pub unit: String,
    /// Mean, scatter or trend.
    pub moment: Moment,
}

/// Values of an observable by repetition; a repetition without a value is absent.
pub type Series = BTreeMap<u32, f64>;

/// Values of every observable of a batch, by experiment and observable.
#[derive(Debug, Clone, Default)]
pub struct Batch {
    series: BTreeMap<(String, String), Series>,
    /// Repetitions of one laboratory series, after which what drifts begins anew; 0 = one series of any length.
    length: u32,
}

/// A straight line over the repetitions of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Change per repetition.
    pub slope: f64,
    /// Σ(place − mean place)²: the variance of the slope is that of one value over this.
    pub lever: f64,
}

/// Least-squares line through values at places; `None` where all places are one.
pub fn line(points: &[(f64, f64)]) -> Option<Line> {
    let n = points.len() as f64;
    let x = points.iter().map(|(x, _)| x).sum::<f64>() / n;
    let y = points.iter().map(|(_, y)| y).sum::<f64>() / n;
    let lever: f64 = points.iter().map(|(at, _)| (at - x) * (at - x)).sum();
    let product: f64 = points.iter().map(|(at, value)| (at - x) * (value - y)).sum();
    (lever > 0.0).then(|| Line { slope: product / lever, lever })
}

/// Statistics of a batch and the covariance of their errors.
#[derive(Debug, Clone)]
pub struct Moments {
    /// One value per statistic.
    pub values: Vec<f64>,
    /// Covariance of the values, shape (n_statistics, n_statistics).
    pub covariance: DMatrix<f64>,
}

impl Batch {
    /// The batch of all rows that have a value, from series of `length` repetitions.
    pub fn new<'a>(rows: impl IntoIterator<Item = &'a KpiRow>, length: u32) -> Self {
        let mut batch = Self { length, ..Self::default() };
        for row in rows {
            if let Some(value) = row.value {
                batch.insert(&row.experiment, &row.kpi, row.repetition, value);
            }
        }
        batch
    }

    /// Adds one value.
    pub fn insert(&mut self, experiment: &str, kpi: &str, repetition: u32, value: f64) {
        self.series.entry((experiment.to_owned(), kpi.to_owned())).or_default().insert(repetition, value);
    }

    /// Values of one observable.
    pub fn series(&self, statistic: &Statistic) -> Option<&Series> {
        self.series.get(&(statistic.experiment.clone(), statistic.kpi.clone()))
    }

    /// The line of an observable over the places in the series.
    pub fn line(&self, statistic: &Statistic) -> Option<Line> {
        let place = |repetition: u32| f64::from(repetition.saturating_sub(1) % self.length.max(1));
        let place = |repetition: u32| if self.length == 0 { f64::from(repetition) } else { place(repetition) };
        line(
            &self.series(statistic)?.iter().map(|(repetition, value)| (place(*repetition), *value)).collect::<Vec<_>>(),
        )
    }

    /// Number of values of an observable.
    pub fn count(&self, statistic: &Statistic) -> usize {
        self.series(statistic).map_or(0, Series::len)
    }

    /// Statistics with their covariance; `None` where one has fewer than two values or no scatter.
    pub fn moments(&self, statistics: &[Statistic]) -> Option<Moments> {
        let columns: Vec<&Series> = statistics.iter().map(|s| self.series(s)).collect::<Option<_>>()?;
        let value = |(statistic, series): (&Statistic, &&Series)| match statistic.moment {
            Moment::Trend => self.line(statistic).map(|line| line.slope),
            moment => value(moment, series),
        };
        let values = statistics.iter().zip(&columns).map(value).collect::<Option<_>>()?;
        let levers: Vec<f64> = statistics.iter().map(|s| self.line(s).map_or(0.0, |line| line.lever)).collect();
        let entry = |i: usize, j: usize| {
            let same = covariance(&statistics[i], columns[i], &statistics[j], columns[j]);
            let trends = statistics[i].moment == Moment::Trend;
            // cov(x̄, ȳ) = c/n, and the covariance of two slopes over the same places is c over their lever.
            if trends { same * columns[i].len() as f64 / (levers[i] * levers[j]).sqrt() } else { same }
        };
        Some(Moments { values, covariance: DMatrix::from_fn(statistics.len(), statistics.len(), entry) })
    }
}

fn value(moment: Moment, series: &Series) -> Option<f64> {
    let values: Vec<f64> = series.values().copied().collect();
    let value = match moment {
        Moment::Mean | Moment::Trend => mean(&values),
        Moment::LnSd => ln_sd(sd(&values), values.len()).value,
    };
    (values.len() >= 2 && value.is_finite()).then_some(value)
}

/// Covariance of two statistics of the same batch, for normal values:
/// cov(x̄, ȳ) = c/n, cov(ln s_x, ln s_y) = ρ² ψ₁(ν/2)/4, means and scatters independent.
fn covariance(a: &Statistic, x: &Series, b: &Statistic, y: &Series) -> f64 {
    if a.experiment != b.experiment || a.moment != b.moment {
        return 0.0;
    }
    let pairs: Vec<(f64, f64)> = x.iter().filter_map(|(repetition, x)| Some((*x, *y.get(repetition)?))).collect();
    let n = pairs.len() as f64;
    if pairs.len() < 2 {
        return 0.0;
    }
    let centre = |pick: fn(&(f64, f64)) -> f64| pairs.iter().map(pick).sum::<f64>() / n;
    let (x_mean, y_mean) = (centre(|p| p.0), centre(|p| p.1));
    let product =
        |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, y)| f(x - x_mean, y - y_mean)).sum::<f64>() / (n - 1.0);
    let (xy, xx, yy) = (product(&|x, y| x * y), product(&|x, _| x * x), product(&|_, y| y * y));
    match a.moment {
        Moment::Mean | Moment::Trend => xy / n,
        Moment::LnSd => xy * xy / (xx * yy) * 0.25 * trigamma(0.5 * (n - 1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;

    fn statistic(kpi: &str, moment: Moment) -> Statistic {
        Statistic { experiment: "pile".into(), kpi: kpi.into(), unit: "1".into(), moment }
    }

    /// Two observables with correlation 0.8 and standard deviations 1 and 2.
    fn batch(stream: &mut Stream, n: u32) -> Batch {
        let mut batch = Batch::default();
        for repetition in 1..=n {
            let (u, v) = (stream.normal(), stream.normal());
            batch.insert("pile", "a", repetition, 5.0 + u);
            batch.insert("pile", "b", repetition, 2.0 * (0.8 * u + 0.6 * v));
        }
        batch
    }

    #[test]
    fn covariance_of_the_statistics_is_that_of_many_batches() {
        let statistics = [
            statistic("a", Moment::Mean),
            statistic("b", Moment::Mean),
            statistic("a", Moment::LnSd),
            statistic("b", Moment::LnSd),
        ];
        let mut stream = Stream::new(5, "moments");
        let batches: Vec<Moments> = (0..4000).map(|_| batch(&mut stream, 20).moments(&statistics).unwrap()).collect();
        let n = batches.len() as f64;
        let average = |f: &dyn Fn(&Moments) -> f64| batches.iter().map(f).sum::<f64>() / n;
        for i in 0..4 {
            for j in 0..4 {
                let (mi, mj) = (average(&|m| m.values[i]), average(&|m| m.values[j]));
                let seen = average(&|m| (m.values[i] - mi) * (m.values[j] - mj));
                let told = average(&|m| m.covariance[(i, j)]);
                let scale = (average(&|m| m.covariance[(i, i)]) * average(&|m| m.covariance[(j, j)])).sqrt();
                // Sampling error of a covariance from 4000 draws is 1.6 %; the rest is the first-order formula for ln s.
                assert!((seen - told).abs() < 0.08 * scale, "({i},{j}): seen {seen}, told {told}, scale {scale}");
            }
        }
    }

    #[test]
    fn a_trend_is_the_slope_over_the_places_of_a_series() {
        let trend = [statistic("a", Moment::Trend), statistic("b", Moment::Trend)];
        let mut batch = Batch { length: 10, ..Batch::default() };
        for repetition in 1..=30 {
            let place = f64::from((repetition - 1) % 10);
            batch.insert("pile", "a", repetition, 7.0 + 0.5 * place + if repetition % 2 == 0 { 0.1 } else { -0.1 });
            batch.insert("pile", "b", repetition, if repetition <= 15 { 1.0 } else { -1.0 });
        }
        let moments = batch.moments(&trend).unwrap();
        // Three series of ten: Σ(place − 4.5)² = 3 · 82.5, and the alternating part tilts the line by 0.1 · 5/82.5.
        assert!((moments.values[0] - 0.5 - 0.1 * 5.0 / 82.5).abs() < 1e-12, "{:?}", moments.values);
        assert!((batch.line(&trend[0]).unwrap().lever - 247.5).abs() < 1e-9);
        let variance = 30.0 / 29.0;
        assert!((moments.covariance[(1, 1)] - variance / 247.5).abs() < 1e-9, "{}", moments.covariance);
        let mixed = [statistic("a", Moment::Trend), statistic("b", Moment::Mean)];
        assert_eq!(batch.moments(&mixed).unwrap().covariance[(0, 1)], 0.0);
    }

    #[test]
    fn a_missing_observable_gives_no_moments() {
        assert!(batch(&mut Stream::new(1, "x"), 3).moments(&[statistic("c", Moment::Mean)]).is_none());
        assert!(batch(&mut Stream::new(1, "x"), 1).moments(&[statistic("a", Moment::Mean)]).is_none());
    }
}
