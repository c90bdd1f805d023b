//! Before and after: the calibrated model without and with the effect, both simulated anew with packings that no fit and no choice
//! has seen, against every measurement, and against the repetitions that were kept from the fits. Intervals of held-out means hold
//! what the parameters leave open, of the held-out experiment by runs ([`super::leeway`]), of held-out repetitions by the slopes of
//! the metamodels; fitted means the data themselves hold in place. Those of scatters hold the tails of the fitted observables.

use super::Tables;
use super::direct;
use super::evidence::statistic;
use super::held_out;
use super::joint::{Contender, Estimate, sds};
use super::lab::Lab;
use super::leeway::Leeway;
use super::moments::{Batch, Moment, Statistic};
use super::target::{Part, Target};
use super::verdict::Case;
use crate::config::{Measured, MeasuredSummary};
use crate::stages::StageError;
use crate::stages::optima::finite;
use crate::stats::special::{normal_quantile, student_t_quantile, trigamma};
use crate::stats::summary::{Summary, ln_sd, summarise, variance_of_mean, welch};
use crate::tables::list::{BeforeAfterRow, RecalibrationRow};
use nalgebra::{DMatrix, DVector};

/// Runs of a model.
pub struct Runs {
    fitted: Batch,
    held_out: Batch,
    /// The held-out experiment where else the parameters may be.
    leeway: Leeway,
    /// Variance that the parameters bring to every statistic of the evidence; empty where no slopes are known.
    open: Vec<f64>,
}

impl Runs {
    /// What the model says of a statistic that was measured in that part of a data set; `None` where no run has a value.
    pub fn found(&self, case: &Case, (statistic, part): (&Statistic, Part)) -> Option<Found> {
        let is_held_out = statistic.experiment == case.context.config.validate.experiment.name();
        let batch = if is_held_out { &self.held_out } else { &self.fitted };
        let values: Vec<f64> = batch.series(statistic)?.values().copied().collect();
        let open = match part {
            _ if is_held_out => self.leeway.variance(statistic),
            Part::Unseen => {
                let index = case.evidence.statistics.iter().position(|known| known == statistic);
                index.and_then(|index| self.open.get(index).copied())
            }
            Part::Seen => Some(0.0),
        };
        let statistics = &case.context.config.statistics;
        Some(Found { summary: summarise(&values, statistics.confidence, statistics.convention), open })
    }
}

/// Recalibrates with the effect, simulates both models and adds the rows of `recalibration` and `before_after`.
pub fn compare(
    (case, unseen): (&Case, &Measured),
    lab: &mut Lab,
    added: Option<&Contender>,
    tables: &mut Tables,
) -> Result<(), StageError> {
    let label = |model: &str| format!("{}/{model}", case.set.name);
    let fitted = direct::confirmation(case.context, lab, label("before confirmation"), &case.optimum, &[])?;
    let held_out = direct::held_out(case.context, lab, label("before"), &case.optimum, &[])?;
    let leeway = Leeway::simulate(case, lab, "before", (&case.optimum, &case.optimum_covariance), None)?;
    let open = variances(&case.slopes.jacobian, &case.optimum_covariance);
    let before = Runs { fitted, held_out, leeway, open };
    let sd = sds(&case.optimum_covariance);
    tables.recalibration.extend(parameter_rows(case, "before", &case.optimum, &sd, &case.at_bound));
    let found = added.map(|contender| contender.estimate(case)).transpose()?.flatten();
    let mut after = None;
    if let (Some(contender), Some(found)) = (added, found) {
        let effect = [(contender.name().to_owned(), found.strength)];
        let fitted = direct::confirmation(case.context, lab, label("after confirmation"), &found.u, &effect)?;
        let held_out = direct::held_out(case.context, lab, label("after"), &found.u, &effect)?;
        let x = found.u.clone().push(contender.place(found.strength));
        let leeway = Leeway::simulate(case, lab, "after", (&x, &found.covariance), Some(contender.axis()))?;
        let open = contender.slopes(&found).map(|slopes| variances(&slopes, &found.covariance)).unwrap_or_default();
        after = Some(Runs { fitted, held_out, leeway, open });
        tables.recalibration.extend(parameter_rows(case, "after", &found.u, &sds(&found.covariance), &found.at_bound));
        tables.recalibration.push(strength_row(case, contender, &found));
    }
    let mut rows = Vec::new();
    for (set, part) in [(case.set, Part::Seen), (unseen, Part::Unseen)] {
        for summary in set.statistics() {
            let row = |moment| row(case, (&summary, part), moment, [Some(&before), after.as_ref()]);
            rows.extend([Moment::Mean, Moment::LnSd].map(row));
        }
    }
    let mut verdict = tables.verdicts.iter_mut().find(|verdict| verdict.measured == case.set.name);
    let none_left = unseen.values.is_empty() && case.context.config.diagnose.held_out_share > 0.0;
    if let Some(verdict) = verdict.as_mut().filter(|_| none_left) {
        let pause = if verdict.advice.is_empty() { "" } else { "; " };
        verdict.advice += &format!("{pause}{NOTHING_HELD_OUT}");
    }
    if let (Some(verdict), Some(contender), Some(after)) = (verdict, added, &after) {
        let judged = held_out::rows((case, unseen), contender.name(), [&before, after]);
        verdict.sentence += &agreement(&rows, contender.name(), case.context.config.statistics.confidence);
        verdict.sentence += &held_out::sentence(&judged, contender.name());
        tables.held_out.extend(judged);
    }
    tables.before_after.extend(rows);
    Ok(())
}

/// Said where a share of the repetitions should be held out but none can be.
const NOTHING_HELD_OUT: &str = "no repetitions are held out: an observable needs two single values that are and two that are not, so \
    measure more often, or raise [diagnose] held_out_share";

/// Variances of what is linear in parameters of a covariance, given its slopes: the diagonal of J C Jᵀ.
fn variances(slopes: &DMatrix<f64>, covariance: &DMatrix<f64>) -> Vec<f64> {
    (slopes * covariance * slopes.transpose()).diagonal().iter().copied().collect()
}

/// How many fitted means agree with the measurement once the effect is in the model.
fn agreement(rows: &[BeforeAfterRow], effect: &str, confidence: f64) -> String {
    let limits = rows.iter().filter(|row| row.fitted && row.statistic == "mean");
    let limits: Vec<(f64, f64)> = limits.filter_map(|row| row.after_lower.zip(row.after_upper)).collect();
    let agree = limits.iter().filter(|(lower, upper)| *lower <= 0.0 && 0.0 <= *upper).count();
    let (all, level) = (limits.len(), (1e4 * confidence).round() / 100.0);
    format!(
        " With {effect} in the model the {level} % intervals of {agree} of {all} fitted means hold the measurement."
    )
}

fn parameter_rows(case: &Case, model: &str, u: &DVector<f64>, sd: &[f64], at_bound: &[bool]) -> Vec<RecalibrationRow> {
    let row = |(i, parameter): (usize, &crate::config::Parameter)| {
        let half = 0.5 * sd[i];
        // The width of the image of ± half a standard error is right for logarithmic scales too.
        let (low, high) = (parameter.from_unit(u[i] - half), parameter.from_unit(u[i] + half));
        RecalibrationRow {
            measured: case.set.name.clone(),
            model: model.to_owned(),
            name: parameter.name.to_owned(),
            value: parameter.from_unit(u[i]),
            standard_error: high - low,
            unit: parameter.unit.to_owned(),
            at_bound: at_bound[i],
        }
    };
    case.context.config.parameters.iter().enumerate().map(row).collect()
}

fn strength_row(case: &Case, contender: &Contender, found: &Estimate) -> RecalibrationRow {
    RecalibrationRow {
        measured: case.set.name.clone(),
        model: "after".to_owned(),
        name: contender.name().to_owned(),
        value: found.strength,
        standard_error: sds(&found.covariance).last().map_or(0.0, |sd| contender.width() * sd),
        unit: contender.unit().to_owned(),
        at_bound: found.at_bound.last().copied().unwrap_or(false),
    }
}

/// An error with its interval.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Error {
    value: Option<f64>,
    lower: Option<f64>,
    upper: Option<f64>,
}

impl Error {
    /// In percent of a value; of none there is none.
    fn percent_of(self, value: Option<f64>) -> Self {
        let percent = |error: Option<f64>| error.zip(value).and_then(|(error, value)| finite(100.0 * error / value));
        Self { value: percent(self.value), lower: percent(self.lower), upper: percent(self.upper) }
    }
}

/// What a model says of a statistic.
pub struct Found {
    /// Of the runs.
    pub summary: Summary,
    /// Variance that the parameters bring to the mean; `None` where that is not known.
    pub open: Option<f64>,
}

impl Found {
    /// Variance of the mean by the scatter of the runs, and its degrees of freedom.
    pub fn of_mean(&self) -> (f64, f64) {
        variance_of_mean(self.summary.sd, self.summary.n)
    }
}

fn row(
    case: &Case,
    (summary, part): (&MeasuredSummary, Part),
    moment: Moment,
    models: [Option<&Runs>; 2],
) -> BeforeAfterRow {
    let statistic = statistic(summary, moment);
    let target = &Target::new(case, (summary, part), moment);
    let summary = &target.summary;
    let confidence = case.context.config.statistics.confidence;
    let [before, after] = models.map(|runs| runs.and_then(|runs| runs.found(case, (&statistic, part))));
    let value = |found: &Option<Found>| {
        let found = &found.as_ref()?.summary;
        finite(if moment == Moment::Mean { found.mean } else { found.sd })
    };
    let spread = |n: usize| ln_sd_variance(case, &statistic, n);
    let error = |found: &Option<Found>| match found {
        Some(found) if moment == Moment::Mean => mean_error(found, target, confidence),
        Some(found) => sd_error(&found.summary, target, confidence, spread),
        None => Error::default(),
    };
    let (first, second) = (error(&before), error(&after));
    let whole = if moment == Moment::Mean { stands_out(summary) } else { Some(summary.sd) };
    let (first_percent, second_percent) = (first.percent_of(whole), second.percent_of(whole));
    BeforeAfterRow {
        measured: case.set.name.clone(),
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        statistic: if moment == Moment::Mean { "mean" } else { "sd" }.to_owned(),
        fitted: part == Part::Seen && case.evidence.statistics.contains(&statistic),
        held_out_repetitions: part == Part::Unseen,
        measured_value: if moment == Moment::Mean { summary.mean } else { summary.sd },
        before: value(&before),
        after: value(&after),
        before_error: first.value,
        before_lower: first.lower,
        before_upper: first.upper,
        after_error: second.value,
        after_lower: second.lower,
        after_upper: second.upper,
        before_error_percent: first_percent.value,
        before_lower_percent: first_percent.lower,
        before_upper_percent: first_percent.upper,
        after_error_percent: second_percent.value,
        after_lower_percent: second_percent.lower,
        after_upper_percent: second_percent.upper,
        unit: summary.unit.to_owned(),
    }
}

/// A difference of means and the half width of its interval, if that is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// The difference.
    pub value: f64,
    /// Half the width of its interval.
    pub half: Option<f64>,
}

/// The simulated mean less the measured one with Welch's interval, widened by the variance of the offset and of doubts and by
/// what the parameters bring to it.
pub fn mean_difference(found: &Found, target: &Target, confidence: f64) -> Difference {
    let (variance, dof) = welch(&[found.of_mean(), target.of_mean]);
    let t = student_t_quantile(0.5 + 0.5 * confidence, dof);
    let half = found.open.map(|open| t * (variance + target.unsure + open).sqrt());
    Difference { value: found.summary.mean - target.summary.mean, half }
}

/// Size of a measured mean. One that does not stand out of the scatter, as of a left-minus-right difference, is no measure of an
/// error.
fn stands_out(measured: &MeasuredSummary) -> Option<f64> {
    let lost = measured.mean.abs() < measured.sd;
    (!lost).then(|| measured.mean.abs())
}

/// Error of a mean.
fn mean_error(found: &Found, target: &Target, confidence: f64) -> Error {
    let Difference { value, half } = mean_difference(found, target, confidence);
    let limit = |sign: f64| half.and_then(|half| finite(value + sign * half));
    Error { value: finite(value), lower: limit(-1.0), upper: limit(1.0) }
}

/// Variance of ln s of n values, with the tails of an observable that the fit sees; any other is taken to be normal.
fn ln_sd_variance(case: &Case, statistic: &Statistic, n: usize) -> f64 {
    let seen = case.evidence.statistics.iter().position(|known| known == statistic);
    seen.map_or_else(|| 0.25 * trigamma(0.5 * (n as f64 - 1.0)), |i| case.shape.ln_sd_variance(i, n))
}

/// Error of a standard deviation, with the interval of the difference of two bias-corrected ln s, whose variances for n values
/// are `spread`, widened in the same way.
fn sd_error(
    found: &Summary,
    Target { summary: measured, unsure, .. }: &Target,
    confidence: f64,
    spread: impl Fn(usize) -> f64,
) -> Error {
    let (n, m) = (found.n, measured.n as usize);
    let usable = n >= 2 && m >= 2 && found.sd > 0.0 && measured.sd > 0.0;
    if !usable {
        return Error::default();
    }
    let (simulated, real) = (ln_sd(found.sd, n), ln_sd(measured.sd, m));
    let half = normal_quantile(0.5 + 0.5 * confidence) * (spread(n) + spread(m) + unsure).sqrt();
    let error = |difference: f64| finite(measured.sd * (libm::exp(difference) - 1.0));
    let difference = simulated.value - real.value;
    Error { value: error(difference), lower: error(difference - half), upper: error(difference + half) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held-out rows, standard deviations and rows without an interval are not counted.
    #[test]
    fn fitted_means_whose_interval_holds_zero_agree() {
        let row = |statistic: &str, fitted: bool, limits: Option<(f64, f64)>| BeforeAfterRow {
            measured: "blind".to_owned(),
            experiment: "pile".to_owned(),
            kpi: "angle_of_repose".to_owned(),
            statistic: statistic.to_owned(),
            fitted,
            held_out_repetitions: false,
            measured_value: 30.0,
            before: None,
            after: None,
            before_error: None,
            before_lower: None,
            before_upper: None,
            after_error: None,
            after_lower: limits.map(|limits| limits.0),
            after_upper: limits.map(|limits| limits.1),
            before_error_percent: None,
            before_lower_percent: None,
            before_upper_percent: None,
            after_error_percent: None,
            after_lower_percent: None,
            after_upper_percent: None,
            unit: "deg".to_owned(),
        };
        let rows = [
            row("mean", true, Some((-1.0, 2.0))),
            row("mean", true, Some((-2.0, 0.0))),
            row("mean", true, Some((1.0, 2.0))),
            row("mean", true, None),
            row("mean", false, Some((-1.0, 1.0))),
            row("sd", true, Some((-1.0, 1.0))),
        ];
        let expected = " With tilt in the model the 99.5 % intervals of 2 of 3 fitted means hold the measurement.";
        assert_eq!(agreement(&rows, "tilt", 0.995), expected);
    }

    /// A mean of 2 ± 3 (sd) is no measure of an error of −1, 2 ± 0.5 is.
    #[test]
    fn an_error_near_zero_has_no_percentage() {
        let of = |sd: f64| MeasuredSummary { experiment: "pile", kpi: "angle", unit: "deg", mean: -2.0, sd, n: 20 };
        let error = Error { value: Some(-1.0), lower: Some(-1.5), upper: None };
        assert_eq!(error.percent_of(stands_out(&of(3.0))), Error::default());
        let percent = Error { value: Some(-50.0), lower: Some(-75.0), upper: None };
        assert_eq!(error.percent_of(stands_out(&of(0.5))), percent);
        assert_eq!(error.percent_of(stands_out(&of(f64::NAN))), percent, "one repetition has no scatter");
    }
}
