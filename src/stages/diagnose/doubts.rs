//! Doubts: settings of an apparatus that are known only to a standard deviation.
//!
//! The drop of a pile or the depth of a box is the same in every repetition: what it is off by shifts all observables
//! together, and no number of repetitions averages that out. So the model is run with the setting one standard deviation down
//! and up; half the difference, d, is what one standard deviation does, and ddᵀ joins the covariance of the data. That is the same
//! as a column d of its own with a prior of mean 0 and variance 1 (SCIENCE.md, section 5, nuisance columns). Assumes that
//! d is linear within the standard deviation and the same wherever the parameters end up; the scatter of its runs counts as doubt.

use super::anchors::point_with;
use super::controls::known;
use super::lab::{Job, Lab};
use super::moments::{Batch, Moment, Statistic};
use crate::config::Uncertain;
use crate::experiments::Experiment;
use crate::settings::SettingSpec;
use crate::stages::{Context, StageError};
use crate::stats::summary::{mean, sd};
use nalgebra::{DMatrix, DVector};

/// What a setting may be off by, and what that shifts.
#[derive(Debug, Clone)]
pub struct Doubt {
    setting: &'static SettingSpec,
    /// Standard deviation of the setting, in its unit.
    sd: f64,
    /// What one standard deviation does to every statistic that depends on the setting.
    shifts: Vec<(Statistic, f64)>,
}

impl Doubt {
    /// Runs the model with the setting off either way, at the parameters `u` in the unit cube; `None` where a fitted one of the
    /// `statistics` could not be measured. What is held out and could not be measured counts as not shifted.
    pub fn see(
        context: &Context,
        lab: &mut Lab,
        (uncertain, u): (&Uncertain, &[f64]),
        statistics: &[Statistic],
    ) -> Result<Option<Self>, StageError> {
        let mut shifts = Vec::new();
        for (experiment, repetitions) in tests(context, uncertain.setting) {
            let wanted = statistics.iter().filter(|s| s.experiment == experiment.name() && s.moment != Moment::Trend);
            let [down, up] = sides(context, lab, (uncertain, u), (experiment, repetitions))?;
            for statistic in wanted {
                match value(&down, statistic).zip(value(&up, statistic)) {
                    Some((low, high)) => shifts.push((statistic.clone(), 0.5 * (high - low))),
                    None if experiment.name() == context.config.validate.experiment.name() => {}
                    None => return Ok(None),
                }
            }
        }
        Ok(Some(Self { setting: uncertain.setting, sd: uncertain.sd, shifts }))
    }

    /// What one standard deviation does to a statistic.
    pub fn shift(&self, statistic: &Statistic) -> f64 {
        self.shifts.iter().find(|(known, _)| known == statistic).map_or(0.0, |(_, shift)| *shift)
    }

    /// What one standard deviation does to all `statistics` (m).
    fn column(&self, statistics: &[Statistic]) -> DVector<f64> {
        DVector::from_iterator(statistics.len(), statistics.iter().map(|statistic| self.shift(statistic)))
    }

    /// Covariance that the doubt brings to `statistics` (m × m).
    pub fn covariance(&self, statistics: &[Statistic]) -> DMatrix<f64> {
        let column = self.column(statistics);
        &column * column.transpose()
    }

    /// A sentence about the doubt, with the most likely deviation of the setting given what calibration leaves of `statistics`
    /// and its `covariance`, this doubt included: dᵀΣ⁻¹r standard deviations.
    pub fn sentence(&self, statistics: &[Statistic], residual: &DVector<f64>, covariance: &DMatrix<f64>) -> String {
        let solved = covariance.clone().cholesky().map(|factor| factor.solve(residual));
        let asked = solved.map_or(0.0, |solved| self.column(statistics).dot(&solved));
        let unit = if self.setting.unit == "1" { String::new() } else { format!(" {}", self.setting.unit) };
        format!(
            "{} counts as known to {}{unit}; without any effect the data would move it by {:+.1} of that",
            self.setting.name, self.sd, asked
        )
    }
}

/// The fitted and held-out tests that depend on a setting, with the repetitions that a direct run of each has.
fn tests(context: &Context, setting: &SettingSpec) -> Vec<(&'static dyn Experiment, u32)> {
    let config = context.config;
    let fitted = config.experiments().into_iter().map(|test| (test, config.diagnose.refine_repetitions));
    let all = fitted.chain([(config.validate.experiment, config.validate.repetitions)]);
    all.filter(|(test, _)| config.base_settings().is_read(setting, test.name())).collect()
}

/// A test with the setting one standard deviation down and up.
fn sides(
    context: &Context,
    lab: &mut Lab,
    (uncertain, u): (&Uncertain, &[f64]),
    (test, repetitions): (&'static dyn Experiment, u32),
) -> Result<[Batch; 2], StageError> {
    let Uncertain { measured, setting, sd } = uncertain;
    let label = format!("{measured}/doubt of {}, {}", setting.name, test.name());
    let nominal = context.config.base_settings()[setting.name];
    let job = |number: u32, off: f64| -> Result<Job, StageError> {
        let point = point_with(context, number, u, &[(setting.name.to_owned(), nominal + off)])?;
        Ok(Job { label: label.clone(), point, experiments: vec![test], repetitions })
    };
    let mut batches = lab.run(&[job(1, -sd)?, job(2, *sd)?])?;
    let up = batches.pop().unwrap_or_default();
    Ok([batches.pop().unwrap_or_default(), up])
}

/// A statistic of a batch; `None` without a value, and of a scatter without two different ones.
fn value(batch: &Batch, statistic: &Statistic) -> Option<f64> {
    let values: Vec<f64> = batch.series(statistic)?.values().copied().collect();
    let (found, _) = known(statistic.moment, mean(&values), sd(&values), values.len());
    found.is_finite().then_some(found)
}
