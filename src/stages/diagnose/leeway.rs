//! What the held-out experiment may do while the parameters stay where the data allow them.
//!
//! The held-out experiment has no metamodel. It is simulated at both ends of every principal axis of the parameters' covariance,
//! √d standard deviations away in d dimensions (the sigma points of Julier & Uhlmann 1997), of which a mean that is linear in
//! the parameters gets exactly its variance: Σ_j ((m_j⁺ − m_j⁻)/2√d)². The scatter of the runs, which would add to it, is taken off.

use super::direct::{self, Axis};
use super::lab::Lab;
use super::moments::{Batch, Statistic};
use super::verdict::Case;
use crate::stages::StageError;
use crate::stats::linalg::symmetric_eigen;
use crate::stats::summary::{mean, sd};
use nalgebra::{DMatrix, DVector};

/// Runs of the held-out experiment at both ends of every axis along which the parameters are open.
pub struct Leeway(Vec<[Batch; 2]>);

impl Leeway {
    /// Simulates it around `x`, the parameters in the unit cube and, with an axis, the place of the strength, of that covariance.
    pub fn simulate(
        case: &Case,
        lab: &mut Lab,
        label: &str,
        (x, covariance): (&DVector<f64>, &DMatrix<f64>),
        axis: Option<Axis>,
    ) -> Result<Self, StageError> {
        let ends = ends(x, covariance);
        let job = |(index, place): (usize, &DVector<f64>)| {
            let label = format!("{}/{label} leeway", case.set.name);
            direct::held_out_job(case.context, (label, index as u32 + 1), place.as_slice(), axis)
        };
        let jobs = ends.as_flattened().iter().enumerate().map(job).collect::<Result<Vec<_>, _>>()?;
        let mut batches = lab.run(&jobs)?.into_iter();
        let pair = || Some([batches.next()?, batches.next()?]);
        Ok(Self(std::iter::from_fn(pair).collect()))
    }

    /// Variance that the parameters bring to the mean of an observable; `None` where an end has no value of it, as of a
    /// hopper that clogs, or no end has two.
    pub fn variance(&self, statistic: &Statistic) -> Option<f64> {
        if self.0.is_empty() {
            return Some(0.0);
        }
        let ends = self.0.as_flattened().iter().map(|batch| values(batch, statistic)).collect::<Option<Vec<_>>>()?;
        let scatter = pooled_variance(&ends)?;
        let along = ends.as_chunks::<2>().0.iter().map(|[high, low]| {
            let apart = mean(high) - mean(low);
            apart * apart - scatter / high.len() as f64 - scatter / low.len() as f64
        });
        Some((along.sum::<f64>() / (4.0 * self.0.len() as f64)).max(0.0))
    }
}

/// Values of an observable, at least one.
fn values(batch: &Batch, statistic: &Statistic) -> Option<Vec<f64>> {
    let values: Vec<f64> = batch.series(statistic)?.values().copied().collect();
    (!values.is_empty()).then_some(values)
}

/// Variance of groups of values, each about its own mean; `None` where no group has two.
fn pooled_variance(groups: &[Vec<f64>]) -> Option<f64> {
    let (mut squares, mut freedom) = (0.0, 0);
    for group in groups.iter().filter(|group| group.len() >= 2) {
        let (s, dof) = (sd(group), group.len() - 1);
        squares += s * s * dof as f64;
        freedom += dof;
    }
    (freedom > 0).then(|| squares / freedom as f64)
}

/// Both ends of every axis, within the cube; none of an axis without variance, as of a parameter that a bound holds.
fn ends(x: &DVector<f64>, covariance: &DMatrix<f64>) -> Vec<[DVector<f64>; 2]> {
    let rows: Vec<Vec<f64>> = covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let axes: Vec<_> = symmetric_eigen(&rows).into_iter().filter(|(variance, _)| *variance > 0.0).collect();
    let length = (axes.len() as f64).sqrt();
    let end = |(variance, axis): &(f64, Vec<f64>), sign: f64| {
        let step = sign * length * variance.sqrt();
        DVector::from_fn(x.len(), |i, _| (x[i] + step * axis[i]).clamp(0.0, 1.0))
    };
    axes.iter().map(|axis| [end(axis, 1.0), end(axis, -1.0)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::diagnose::moments::Moment;

    fn rate() -> Statistic {
        let [experiment, kpi, unit] = ["hopper", "discharge_rate", "kg/s"].map(str::to_owned);
        Statistic { experiment, kpi, unit, moment: Moment::Mean }
    }

    /// Two runs ± `scatter` about a value.
    fn batch(value: f64, scatter: f64) -> Batch {
        let mut batch = Batch::default();
        let statistic = rate();
        for (repetition, sign) in [(1, 1.0), (2, -1.0)] {
            batch.insert(&statistic.experiment, &statistic.kpi, repetition, value + sign * scatter);
        }
        batch
    }

    fn of(places: Vec<[DVector<f64>; 2]>, scatter: f64) -> Leeway {
        let seen = |x: &DVector<f64>| batch(3.0 + 2.0 * x[0] - 5.0 * x[1], scatter);
        Leeway(places.iter().map(|[a, b]| [seen(a), seen(b)]).collect())
    }

    /// 2² · 0.01 + 5² · 0.0025 − 2 · 2 · 5 · 0.003.
    const VARIANCE: f64 = 0.0425;

    fn open() -> (DVector<f64>, DMatrix<f64>) {
        (DVector::from_vec(vec![0.5, 0.5]), DMatrix::from_row_slice(2, 2, &[0.01, 0.003, 0.003, 0.0025]))
    }

    #[test]
    fn a_linear_mean_has_exactly_the_variance_of_the_parameters() {
        let (x, covariance) = open();
        let found = of(ends(&x, &covariance), 0.0).variance(&rate()).expect("values at both ends");
        assert!((found - VARIANCE).abs() < 1e-12, "{found}");
    }

    /// Runs ± 0.1 have a variance of 0.02, a mean of two 0.01; of four means with a weight of 1/8 that is 0.005.
    #[test]
    fn the_scatter_of_the_runs_is_taken_off() {
        let (x, covariance) = open();
        let found = of(ends(&x, &covariance), 0.1).variance(&rate()).expect("values at both ends");
        assert!((found - (VARIANCE - 0.005)).abs() < 1e-12, "{found}");
        assert_eq!(of(ends(&x, &covariance), 1.0).variance(&rate()), Some(0.0));
    }

    #[test]
    fn a_bound_cuts_an_axis_and_a_parameter_that_it_holds_has_none() {
        let held = DMatrix::from_row_slice(2, 2, &[0.04, 0.0, 0.0, 0.0]);
        let places = ends(&DVector::from_vec(vec![0.9, 1.0]), &held);
        assert_eq!(places.len(), 1);
        let [high, low] = &places[0];
        assert!((high[0] - 1.0).abs() < 1e-12 && (low[0] - 0.7).abs() < 1e-12 && high[1] == 1.0 && low[1] == 1.0);
    }

    /// A run that fails costs its end a value. The mean of one is as unsure as the scatter at the other ends says.
    #[test]
    fn an_end_needs_one_value_and_an_end_without_any_leaves_the_variance_unknown() {
        let (x, covariance) = open();
        let mut leeway = of(ends(&x, &covariance), 0.1);
        let all = leeway.variance(&rate()).expect("values at both ends");
        let (statistic, mean) = (rate(), leeway.0[1][0].series(&rate()).expect("values").values().sum::<f64>() / 2.0);
        let mut single = Batch::default();
        single.insert(&statistic.experiment, &statistic.kpi, 1, mean);
        leeway.0[1][0] = single;
        let found = leeway.variance(&statistic).expect("values at both ends");
        assert!((found - (all - 0.01 / 8.0)).abs() < 1e-12, "{found} against {all}");
        leeway.0[1][0] = Batch::default();
        assert_eq!(leeway.variance(&statistic), None);
    }

    #[test]
    fn nothing_is_open_without_axes() {
        assert_eq!(of(Vec::new(), 0.1).variance(&rate()), Some(0.0));
    }
}
