//! Statistics of repeated runs: means and logarithms of standard deviations, with their covariance.
//!
//! Takes the observables of a batch of repetitions; gives one value per statistic and the covariance matrix of the
//! whole vector. Observables of one experiment come from the same run and are correlated; experiments are independent.

use crate::stats::special::trigamma;
use crate::stats::summary::{ln_sd, mean, sd};
use crate::tables::list::KpiRow;
use nalgebra::{DMatrix, DVector};
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
    /// Number of points whose own mean was taken off; 0 = the values are as they were seen.
    points: usize,
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

    /// Deviations of batches at neighbouring points from the mean of their own point, as one batch of repetitions: what
    /// they say of how repetitions scatter. They are widened by √(n/(n − 1)), so that their variance is that of one value.
    pub fn deviations(points: &[&Self]) -> Self {
        let mut all = Self::default();
        let longest = points.iter().flat_map(|batch| batch.series.values()).flat_map(Series::keys).max();
        let stride = longest.map_or(1, |last| last + 1);
        for (index, batch) in (0..).zip(points) {
            for (key, series) in batch.series.iter().filter(|(_, series)| series.len() >= 2) {
                let (centre, n) = (mean(&series.values().copied().collect::<Vec<_>>()), series.len() as f64);
                let widened = |value: f64| (value - centre) * (n / (n - 1.0)).sqrt();
                let place = |repetition: u32| index * stride + repetition;
                let scaled = series.iter().map(|(repetition, value)| (place(*repetition), widened(*value)));
                all.series.entry(key.clone()).or_default().extend(scaled);
            }
        }
        all.points = points.len();
        all
    }

    /// The same values over a scale of every observable; none of those without a scale.
    pub fn over<'a>(&self, scales: impl IntoIterator<Item = (&'a Statistic, f64)>) -> Self {
        let mut scaled = Self { series: BTreeMap::new(), ..self.clone() };
        for (statistic, scale) in scales {
            let values = self.series(statistic).into_iter().flatten();
            values.for_each(|(r, value)| scaled.insert(&statistic.experiment, &statistic.kpi, *r, value / scale));
        }
        scaled
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

    /// Influence values of every repetition that has all of `statistics`, which share an experiment: on the statistics,
    /// and on ln s of their observables. Nothing where an observable has no scatter.
    fn influences(&self, statistics: &[&Statistic]) -> Vec<[DVector<f64>; 2]> {
        let columns: Option<Vec<Column>> = statistics.iter().map(|s| Column::new(self.series(s)?)).collect();
        let Some(columns) = columns else { return Vec::new() };
        let Some(first) = columns.first() else { return Vec::new() };
        let complete = first.series.keys().filter(|r| columns.iter().all(|column| column.series.contains_key(r)));
        let row = |repetition: &u32| {
            let place = DVector::from_iterator(columns.len(), columns.iter().map(|column| column.place(*repetition)));
            let scatter =
                DVector::from_iterator(columns.len(), columns.iter().zip(&place).map(|(c, z)| c.on_scatter(*z)));
            let is_scatter = |i: usize| statistics[i].moment == Moment::LnSd;
            let own = DVector::from_fn(columns.len(), |i, _| if is_scatter(i) { scatter[i] } else { place[i] });
            [own, scatter]
        };
        complete.map(row).collect()
    }

    /// Statistics with their covariance for repetitions that scatter as `shape` says; `None` where a statistic has fewer
    /// than two values or no scatter.
    pub fn moments(&self, statistics: &[Statistic], shape: &Shape) -> Option<Moments> {
        let value = |statistic: &Statistic| match statistic.moment {
            Moment::Trend => self.line(statistic).map(|line| line.slope),
            moment => value(moment, self.series(statistic)?),
        };
        let values = statistics.iter().map(value).collect::<Option<_>>()?;
        let variance = |(i, statistic): (usize, &Statistic)| {
            let values: Vec<f64> = self.series(statistic)?.values().copied().collect();
            let square = sd(&values) * sd(&values);
            Some(match statistic.moment {
                Moment::Mean => square / values.len() as f64,
                Moment::LnSd => shape.ln_sd_variance(i, values.len()),
                Moment::Trend => square / self.line(statistic)?.lever,
            })
        };
        let variances = statistics.iter().enumerate().map(variance).collect::<Option<Vec<f64>>>()?;
        Some(Moments { values, covariance: shape.covariance(&variances) })
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

/// Values of one observable with their mean and scatter.
struct Column<'a> {
    series: &'a Series,
    mean: f64,
    sd: f64,
}

impl<'a> Column<'a> {
    fn new(series: &'a Series) -> Option<Self> {
        let values: Vec<f64> = series.values().copied().collect();
        let column = Self { series, mean: mean(&values), sd: sd(&values) };
        (values.len() >= 2 && column.sd > 0.0).then_some(column)
    }

    /// (x − x̄)/s.
    fn place(&self, repetition: u32) -> f64 {
        (self.series[&repetition] - self.mean) / self.sd
    }

    /// ½(z² − 1), less what makes its sum vanish for s over n − 1.
    fn on_scatter(&self, z: f64) -> f64 {
        let n = self.series.len() as f64;
        0.5 * (z * z - (n - 1.0) / n)
    }
}

/// How the repetitions of one point scatter: what their statistics' errors have to do with each other, and how heavy the
/// tails of the observables are.
///
/// Both come from influence values, the change of a statistic by one repetition: (x − x̄)/s for a mean, ½((x − x̄)²/s² − 1)
/// for ln s. Their variances are 1 and (κ − 1)/4, κ being the kurtosis, 3 for normal values. Batches at different points
/// are pooled, each about its own mean and scatter.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Correlation of the errors of the statistics (m × m).
    pub correlation: DMatrix<f64>,
    /// Variance of ln s of every statistic's observable over that of normal values, (κ − 1)/2, at least 1: short batches
    /// do not see the ends of a tail.
    tails: Vec<f64>,
    /// Degrees of freedom behind the correlations of every statistic.
    pub correlated: Vec<usize>,
}

impl Shape {
    /// The shape that `batches` have in common; `None` where an observable has no scatter in any of them. Experiments are
    /// independent of each other, and trends of means and scatters.
    pub fn pooled(batches: &[&Batch], statistics: &[Statistic]) -> Option<Self> {
        let m = statistics.len();
        let (mut correlation, mut tails, mut correlated) = (DMatrix::zeros(m, m), vec![1.0; m], vec![0; m]);
        let group = |i: usize| (&statistics[i].experiment, statistics[i].moment == Moment::Trend);
        for first in (0..m).filter(|i| (0..*i).all(|j| group(j) != group(*i))) {
            let members: Vec<usize> = (first..m).filter(|i| group(*i) == group(first)).collect();
            let own: Vec<&Statistic> = members.iter().map(|i| &statistics[*i]).collect();
            let all: Vec<_> = batches.iter().map(|batch| batch.influences(&own)).collect();
            let freedom = all.iter().map(|rows| rows.len().saturating_sub(1)).sum::<usize>() as f64;
            let means_off = |(rows, batch): (&Vec<_>, &&Batch)| rows.len().saturating_sub(batch.points.max(1));
            let dof = all.iter().zip(batches).map(means_off).sum();
            let sum = |f: &dyn Fn(&[DVector<f64>; 2]) -> f64| all.iter().flatten().map(f).sum::<f64>();
            for (a, i) in members.iter().enumerate() {
                for (b, j) in members.iter().enumerate() {
                    correlation[(*i, *j)] = sum(&|row| row[0][a] * row[0][b]);
                }
                tails[*i] = (2.0 * sum(&|row| row[1][a] * row[1][a]) / freedom).max(1.0);
                correlated[*i] = dof;
            }
        }
        let sizes: Vec<f64> = correlation.diagonal().iter().map(|square: &f64| square.sqrt()).collect();
        let scaled = DMatrix::from_fn(m, m, |i, j| correlation[(i, j)] / (sizes[i] * sizes[j]));
        sizes.iter().all(|size| *size > 0.0).then_some(Self { correlation: scaled, tails, correlated })
    }

    /// Variance of ln s of statistic `i` from n repetitions: ψ₁(ν/2)/4 for normal values.
    pub fn ln_sd_variance(&self, i: usize, n: usize) -> f64 {
        self.tails[i] * 0.25 * trigamma(0.5 * (n as f64 - 1.0))
    }

    /// Degrees of freedom of normal values that would give a variance of statistic `i`'s observable as well known as n
    /// repetitions give it.
    pub fn freedom(&self, i: usize, n: usize) -> f64 {
        (n as f64 - 1.0) / self.tails[i]
    }

    /// The covariance of statistics with given variances.
    pub fn covariance(&self, variances: &[f64]) -> DMatrix<f64> {
        let entry = |i: usize, j: usize| self.correlation[(i, j)] * (variances[i] * variances[j]).sqrt();
        DMatrix::from_fn(variances.len(), variances.len(), entry)
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

    /// Two observables of one cause, with tails like those of a test that sometimes clogs: a chi-squared value with two
    /// degrees of freedom, skewed by 2 and with a kurtosis of 9.
    fn heavy(stream: &mut Stream, n: u32) -> Batch {
        let mut batch = Batch::default();
        for repetition in 1..=n {
            let (u, v) = (stream.normal(), stream.normal());
            batch.insert("pile", "a", repetition, u * u + v * v);
            batch.insert("pile", "b", repetition, 3.0 + 0.5 * (u * u + v * v) + stream.normal());
        }
        batch
    }

    fn covariance_is_that_of_many_batches(make: fn(&mut Stream, u32) -> Batch, n: u32, tolerance: f64) {
        let of = |kpi, moment| statistic(kpi, moment);
        let statistics = [of("a", Moment::Mean), of("b", Moment::Mean), of("a", Moment::LnSd), of("b", Moment::LnSd)];
        let mut stream = Stream::new(5, "moments");
        let known: Vec<Batch> = (0..100).map(|_| make(&mut stream, 200)).collect();
        let shape = Shape::pooled(&known.iter().collect::<Vec<_>>(), &statistics).unwrap();
        let batches: Vec<Moments> =
            (0..4000).map(|_| make(&mut stream, n).moments(&statistics, &shape).unwrap()).collect();
        let total = batches.len() as f64;
        let average = |f: &dyn Fn(&Moments) -> f64| batches.iter().map(f).sum::<f64>() / total;
        for i in 0..4 {
            for j in 0..4 {
                let (mi, mj) = (average(&|m| m.values[i]), average(&|m| m.values[j]));
                let seen = average(&|m| (m.values[i] - mi) * (m.values[j] - mj));
                let told = average(&|m| m.covariance[(i, j)]);
                let scale = (average(&|m| m.covariance[(i, i)]) * average(&|m| m.covariance[(j, j)])).sqrt();
                assert!((seen - told).abs() < tolerance * scale, "({i},{j}): seen {seen}, told {told}, scale {scale}");
            }
        }
    }

    /// Sampling error of a covariance from 4000 draws is 1.6 to 2.2 %, of the shape from 20,000 values 1 to 3 %; the rest is
    /// the first-order formula for ln s, whose error falls with n.
    #[test]
    fn covariance_of_the_statistics_is_that_of_many_batches() {
        covariance_is_that_of_many_batches(batch, 20, 0.08);
        covariance_is_that_of_many_batches(heavy, 100, 0.12);
    }

    /// Pairs of values: x and −x about their mean, widened by √2, the same for both observables of a run.
    #[test]
    fn deviations_of_neighbours_have_the_variance_of_one_value() {
        let mut points = [Batch::default(), Batch::default()];
        for (number, batch) in points.iter_mut().enumerate() {
            batch.insert("pile", "a", 1, 10.0 * number as f64 + 1.0);
            batch.insert("pile", "a", 2, 10.0 * number as f64 + 3.0);
            batch.insert("pile", "b", 1, 5.0);
            batch.insert("pile", "b", 2, 1.0);
        }
        let all = Batch::deviations(&[&points[0], &points[1]]);
        let values = |kpi: &str| all.series[&("pile".into(), kpi.into())].values().copied().collect::<Vec<f64>>();
        let root = 2.0_f64.sqrt();
        assert_eq!(
            (values("a"), values("b")),
            (vec![-root, root, -root, root], vec![2.0 * root, -2.0 * root, 2.0 * root, -2.0 * root])
        );
        let shape = Shape::pooled(&[&all], &[statistic("a", Moment::Mean), statistic("b", Moment::Mean)]).unwrap();
        assert!((shape.correlation[(0, 1)] + 1.0).abs() < 1e-12, "{}", shape.correlation);
    }

    /// Values with the tails of [`heavy`] scatter their ln s with four times the variance of normal ones: (9 − 1)/2.
    #[test]
    fn tails_are_seen_and_never_lighter_than_normal() {
        let statistics = [statistic("a", Moment::LnSd)];
        let mut stream = Stream::new(6, "tails");
        let shape = |batches: Vec<Batch>| Shape::pooled(&batches.iter().collect::<Vec<_>>(), &statistics).unwrap();
        let long = shape(vec![heavy(&mut stream, 100_000)]);
        assert!((long.freedom(0, 41) - 10.0).abs() < 0.7, "{}", long.freedom(0, 41));
        let mut flat = Batch::default();
        (1..=40).for_each(|repetition| flat.insert("pile", "a", repetition, f64::from(repetition)));
        assert_eq!(shape(vec![flat]).freedom(0, 41), 40.0);
    }

    /// Half the values with a scatter of 1, half with 5: a kurtosis of 3 · ½(1 + 5⁴)/13² of them together, 3 of each over its own.
    #[test]
    fn places_of_unequal_scatter_have_no_tails_over_their_own_scales() {
        let statistics = [statistic("a", Moment::LnSd)];
        let mut stream = Stream::new(7, "scales");
        let mut points = [Batch::default(), Batch::default()];
        for (batch, sd) in points.iter_mut().zip([1.0, 5.0]) {
            (1..=20_000).for_each(|repetition| batch.insert("pile", "a", repetition, sd * stream.normal()));
        }
        points[0].insert("pile", "b", 1, 1.0);
        let freedom = |points: &[Batch; 2]| {
            let together = Batch::deviations(&points.iter().collect::<Vec<_>>());
            Shape::pooled(&[&together], &statistics).unwrap().freedom(0, 41)
        };
        assert!((freedom(&points) - 40.0 * 2.0 * 169.0 / (3.0 * 313.0 - 169.0)).abs() < 1.0, "{}", freedom(&points));
        let scaled = [(&points[0], 1.0), (&points[1], 5.0)].map(|(batch, sd)| batch.over([(&statistics[0], sd)]));
        assert!((freedom(&scaled) - 40.0).abs() < 2.0, "{}", freedom(&scaled));
        assert!(scaled[0].series(&statistic("b", Moment::Mean)).is_none());
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
        let own = |statistics: &[Statistic]| batch.moments(statistics, &Shape::pooled(&[&batch], statistics)?);
        let moments = own(&trend).unwrap();
        // Three series of ten: Σ(place − 4.5)² = 3 · 82.5, and the alternating part tilts the line by 0.1 · 5/82.5.
        assert!((moments.values[0] - 0.5 - 0.1 * 5.0 / 82.5).abs() < 1e-12, "{:?}", moments.values);
        assert!((batch.line(&trend[0]).unwrap().lever - 247.5).abs() < 1e-9);
        let variance = 30.0 / 29.0;
        assert!((moments.covariance[(1, 1)] - variance / 247.5).abs() < 1e-9, "{}", moments.covariance);
        let mixed = [statistic("a", Moment::Trend), statistic("b", Moment::Mean)];
        assert_eq!(own(&mixed).unwrap().covariance[(0, 1)], 0.0);
    }

    #[test]
    fn a_missing_observable_gives_no_moments() {
        let shape = |batch: &Batch, kpi| Shape::pooled(&[batch], &[statistic(kpi, Moment::Mean)]);
        let (three, one) = (batch(&mut Stream::new(1, "x"), 3), batch(&mut Stream::new(1, "x"), 1));
        let known = shape(&three, "a").unwrap();
        assert!(shape(&three, "c").is_none() && shape(&one, "a").is_none());
        assert!(three.moments(&[statistic("c", Moment::Mean)], &known).is_none());
        assert!(one.moments(&[statistic("a", Moment::Mean)], &known).is_none());
    }
}
