//! The evidence: which measured statistics are compared, their values, and how well they are known.

use super::controls::Offset;
use super::doubts::Doubt;
use super::moments::{Batch, Moment, Shape, Statistic, line};
use crate::config::{Config, Measured, MeasuredSummary};
use crate::stats::special::beta_i;
use crate::stats::summary::ln_sd;
use nalgebra::{DMatrix, DVector};

/// Level of the F-test below which measured and simulated scatter are taken to differ.
const SCATTER_LEVEL: f64 = 0.01;
/// Share of its variance that an observable must keep, given the others of its test, to count as evidence of its own.
const OWN_SHARE: f64 = 0.01;

/// Measured statistics of one data set.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// What is compared.
    pub statistics: Vec<Statistic>,
    /// Measured values (n_statistics), less the model's own offset where there are controls.
    pub values: DVector<f64>,
    /// Measured repetitions behind each statistic.
    pub counts: Vec<usize>,
    /// Measured standard deviations of the observables behind the statistics.
    sds: Vec<f64>,
    /// What a variance of one value is divided by: the number of values, or the lever of a trend.
    divisors: Vec<f64>,
    /// What was taken off.
    pub offset: Option<Offset>,
    /// Settings of the apparatus that are not known exactly.
    pub doubts: Vec<Doubt>,
}

/// Covariance of measured statistics, and which share of each variance rests on few repetitions.
pub struct Noise {
    /// Covariance (n_statistics, n_statistics).
    pub covariance: DMatrix<f64>,
    /// Share of the variance that was estimated from the measured repetitions themselves.
    pub measured_share: Vec<f64>,
}

impl Evidence {
    /// Every statistic that the data set and `simulated` both have. Logarithms of standard deviations enter from
    /// `sd_from` repetitions on, of the measurement and of the simulations to be made; so do trends of the KPIs, where a
    /// candidate drifts and single values were measured, because elsewhere they only thin the evidence out. The held-out
    /// experiment never enters. An observable that follows from the others of its test (such as a mean mass from a count and a density) is
    /// left out, KPIs being kept first.
    pub fn new(config: &Config, measured: &Measured, simulated: &Batch) -> Self {
        let least = config.diagnose.thresholds.sd_from as usize;
        let fitted: Vec<&str> = config.experiments().iter().map(|experiment| experiment.name()).collect();
        let order = |name: &str| {
            let mut observables = config.experiments().into_iter().flat_map(|e| e.observables());
            observables.position(|observable| observable.name == name).unwrap_or(usize::MAX)
        };
        let mut summaries: Vec<MeasuredSummary> = measured.statistics();
        summaries.retain(|summary| fitted.contains(&summary.experiment) && summary.sd > 0.0);
        summaries.sort_by_key(|summary| order(summary.kpi));
        let mut evidence = Self::empty();
        for moment in [Moment::Mean, Moment::LnSd, Moment::Trend] {
            for summary in &summaries {
                let statistic = statistic(summary, moment);
                let repeated = summary.n.min(config.diagnose.refine_repetitions) as usize;
                let enough = match moment {
                    Moment::Mean => true,
                    Moment::LnSd => repeated >= least,
                    Moment::Trend => repeated >= least && drifts(config) && is_kpi(config, summary.kpi),
                };
                if enough && simulated.count(&statistic) >= 2 {
                    evidence.add_if_own(statistic, (measured, summary), simulated);
                }
            }
        }
        evidence
    }

    /// The same statistics of another data set; `None` where that lacks one of them.
    pub fn of(&self, measured: &Measured) -> Option<Self> {
        let summaries = measured.statistics();
        let mut evidence = Self::empty();
        for statistic in &self.statistics {
            let summary = summaries.iter().find(|summary| summary.kpi == statistic.kpi && summary.sd > 0.0)?;
            evidence.add(statistic.clone(), (measured, summary));
        }
        Some(evidence.less(self.offset.as_ref()).doubting(self.doubts.clone()))
    }

    /// The same less an offset; statistics for which it is not known are no evidence.
    #[must_use]
    pub fn less(self, offset: Option<&Offset>) -> Self {
        let Some(offset) = offset else { return self };
        let mut evidence = Self::empty();
        for (i, statistic) in self.statistics.into_iter().enumerate() {
            if let Some((shift, _)) = offset.one(&statistic) {
                evidence.statistics.push(statistic);
                evidence.values = evidence.values.push(self.values[i] - shift);
                evidence.counts.push(self.counts[i]);
                evidence.sds.push(self.sds[i]);
                evidence.divisors.push(self.divisors[i]);
            }
        }
        Self { offset: Some(offset.clone()), ..evidence }
    }

    /// The same, with settings that are not known exactly.
    #[must_use]
    pub fn doubting(self, doubts: Vec<Doubt>) -> Self {
        Self { doubts, ..self }
    }

    fn empty() -> Self {
        let values = DVector::zeros(0);
        let (statistics, counts) = (Vec::new(), Vec::new());
        Self { statistics, values, counts, sds: Vec::new(), divisors: Vec::new(), offset: None, doubts: Vec::new() }
    }

    fn add_if_own(&mut self, statistic: Statistic, from: (&Measured, &MeasuredSummary), simulated: &Batch) {
        let mut wider = self.statistics.clone();
        wider.push(statistic);
        let Some(shape) = Shape::pooled(&[simulated], &wider) else { return };
        if own_share(shape.correlation) >= OWN_SHARE {
            self.add(wider[wider.len() - 1].clone(), from);
        }
    }

    /// Adds a measured statistic; nothing where it has no trend.
    fn add(&mut self, statistic: Statistic, (measured, summary): (&Measured, &MeasuredSummary)) {
        let (value, divisor) = match statistic.moment {
            Moment::Mean => (summary.mean, f64::from(summary.n)),
            Moment::LnSd => (ln_sd(summary.sd, summary.n as usize).value, f64::from(summary.n)),
            Moment::Trend => {
                let series = measured.series_of(summary.kpi).into_iter();
                let points: Vec<(f64, f64)> =
                    series.map(|(repetition, value)| (f64::from(repetition), value)).collect();
                let Some(line) = line(&points) else { return };
                (line.slope, line.lever)
            }
        };
        self.statistics.push(statistic);
        self.values = self.values.clone().push(value);
        self.counts.push(summary.n as usize);
        self.sds.push(summary.sd);
        self.divisors.push(divisor);
    }

    /// Whether a statistic of this kind is among the evidence.
    pub fn has(&self, moment: Moment) -> bool {
        self.statistics.iter().any(|statistic| statistic.moment == moment)
    }

    /// The shape that batches of runs have in common, and the noise with the scatter of the last of them.
    pub fn scatter(&self, batches: &[Batch]) -> Option<(Shape, Noise)> {
        let shape = Shape::pooled(&batches.iter().collect::<Vec<_>>(), &self.statistics)?;
        let noise = self.noise(batches.last()?, &shape)?;
        Some((shape, noise))
    }

    /// Covariance of the measured values. Correlations and tails are those of the simulated repetitions, `shape`.
    /// Variances of the means are pooled with the simulated scatter where both agree (F-test at 1 %), else measured; those
    /// of ln s follow from the number of repetitions and the tails. Those of an offset and of doubts are added.
    pub fn noise(&self, simulated: &Batch, shape: &Shape) -> Option<Noise> {
        let moments = simulated.moments(&self.statistics, shape)?;
        let mut variances = Vec::new();
        let mut measured_share = Vec::new();
        for (index, statistic) in self.statistics.iter().enumerate() {
            let (n, m) = (self.counts[index], simulated.count(statistic));
            if statistic.moment == Moment::LnSd {
                variances.push(shape.ln_sd_variance(index, n));
                measured_share.push(0.0);
                continue;
            }
            let simulated = match statistic.moment {
                Moment::Trend => moments.covariance[(index, index)] * simulated.line(statistic)?.lever,
                _ => moments.covariance[(index, index)] * m as f64,
            };
            let measured = self.sds[index] * self.sds[index];
            let agree =
                scatter_p(measured, shape.freedom(index, n), simulated, shape.freedom(index, m)) > SCATTER_LEVEL;
            let share = if agree { (n as f64 - 1.0) / ((n + m) as f64 - 2.0) } else { 1.0 };
            variances.push((share * measured + (1.0 - share) * simulated) / self.divisors[index]);
            measured_share.push(share);
        }
        let mut covariance = shape.covariance(&variances);
        for unsure in self.common() {
            covariance += unsure;
        }
        if self.offset.is_some() || !self.doubts.is_empty() {
            for (i, share) in measured_share.iter_mut().enumerate() {
                *share *= variances[i] / covariance[(i, i)];
            }
        }
        Some(Noise { covariance, measured_share })
    }

    /// Covariances of what shifts all repetitions alike: of the offset, and of every doubt.
    fn common(&self) -> impl Iterator<Item = DMatrix<f64>> {
        let offset = self.offset.as_ref().and_then(|offset| offset.restricted(&self.statistics));
        let doubts = self.doubts.iter().map(|doubt| doubt.covariance(&self.statistics));
        offset.map(|(_, unsure)| unsure).into_iter().chain(doubts)
    }
}

/// Whether a candidate shows itself in trends.
fn drifts(config: &Config) -> bool {
    let is_drift = |name: &String| config.effects.library.find(name).is_ok_and(|effect| effect.is_drift());
    config.diagnose.candidates.iter().any(is_drift)
}

fn is_kpi(config: &Config, name: &str) -> bool {
    let mut observables = config.experiments().into_iter().flat_map(|experiment| experiment.observables());
    observables.any(|observable| observable.name == name && observable.is_kpi)
}

/// A moment of a measured observable.
pub fn statistic(summary: &MeasuredSummary, moment: Moment) -> Statistic {
    Statistic {
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        unit: summary.unit.to_owned(),
        moment,
    }
}

/// Share of the last variance that the others leave unexplained.
fn own_share(correlation: DMatrix<f64>) -> f64 {
    let last = correlation.nrows() - 1;
    correlation.cholesky().map_or(0.0, |factor| {
        let pivot = factor.l()[(last, last)];
        pivot * pivot
    })
}

/// Two-sided p-value of the F-test that two variances with ν₁ and ν₂ degrees of freedom are equal.
fn scatter_p(a: f64, nu_a: f64, b: f64, nu_b: f64) -> f64 {
    let share = nu_a * a / (nu_a * a + nu_b * b);
    let below = beta_i(0.5 * nu_a, 0.5 * nu_b, share);
    2.0 * below.min(1.0 - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Critical values of F as printed in tables: 2.774 at (10, 20), 2.5 % a side; 6.872 at (5, 10), 0.5 % a side.
    #[test]
    fn scatter_is_compared_by_the_f_test() {
        assert!((scatter_p(2.774, 10.0, 1.0, 20.0) - 0.05).abs() < 1e-4);
        assert!((scatter_p(6.872, 5.0, 1.0, 10.0) - 0.01).abs() < 1e-5);
        assert_eq!(scatter_p(3.0, 7.0, 2.0, 9.0), scatter_p(6.0, 7.0, 4.0, 9.0));
        assert!((scatter_p(3.0, 7.0, 2.0, 9.0) - scatter_p(2.0, 9.0, 3.0, 7.0)).abs() < 1e-12);
        assert!(scatter_p(1.0, 19.0, 1.0, 99.0) > 0.5 && scatter_p(4.0, 19.0, 1.0, 99.0) < 1e-5);
    }

    #[test]
    fn an_observable_that_follows_from_another_has_no_share_of_its_own() {
        let close = 2.0 / 4.0004_f64.sqrt();
        assert!(own_share(DMatrix::from_row_slice(2, 2, &[1.0, close, close, 1.0])) < OWN_SHARE);
        assert!((own_share(DMatrix::identity(3, 3)) - 1.0).abs() < 1e-12);
    }
}
