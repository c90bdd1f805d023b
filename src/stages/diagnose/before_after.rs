//! Before and after: the calibrated model without and with the effect, both simulated anew, against every measurement.

use super::Tables;
use super::direct;
use super::evidence::statistic;
use super::joint::{Contender, Estimate};
use super::lab::Lab;
use super::moments::{Batch, Moment};
use super::verdict::Case;
use crate::config::MeasuredSummary;
use crate::stages::StageError;
use crate::stages::optima::finite;
use crate::stats::special::{normal_quantile, student_t_quantile, trigamma};
use crate::stats::summary::{Summary, ln_sd, summarise};
use crate::tables::list::{BeforeAfterRow, RecalibrationRow};
use nalgebra::DVector;

/// Both models with the runs of the fitted and of the held-out experiments.
struct Runs {
    before: [Batch; 2],
    after: Option<[Batch; 2]>,
}

/// Recalibrates with the effect, simulates both models and adds the rows of `recalibration` and `before_after`.
pub fn compare(case: &Case, lab: &mut Lab, added: Option<&Contender>, tables: &mut Tables) -> Result<(), StageError> {
    let label = |model: &str| format!("{}/{model}", case.set.name);
    let held_out = direct::held_out(case.context, lab, label("before"), &case.optimum, &[])?;
    let mut runs = Runs { before: [case.before.clone(), held_out], after: None };
    let sd = case.optimum_covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    tables.recalibration.extend(parameter_rows(case, "before", &case.optimum, sd.as_slice(), &case.at_bound));
    let found = added.map(|contender| contender.estimate(case)).transpose()?.flatten();
    if let (Some(contender), Some(found)) = (added, found) {
        let effect = [(contender.name().to_owned(), found.strength)];
        let fitted_runs = direct::batch(case.context, lab, label("after"), &found.u, &effect)?;
        let held_out = direct::held_out(case.context, lab, label("after"), &found.u, &effect)?;
        runs.after = Some([fitted_runs, held_out]);
        tables.recalibration.extend(parameter_rows(case, "after", &found.u, &found.sd, &found.at_bound));
        tables.recalibration.push(strength_row(case, contender, &found));
    }
    for summary in case.set.statistics() {
        tables.before_after.extend([Moment::Mean, Moment::LnSd].map(|moment| row(case, &summary, moment, &runs)));
    }
    Ok(())
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
        standard_error: found.sd.last().map_or(0.0, |sd| contender.width() * sd),
        unit: contender.unit().to_owned(),
        at_bound: found.at_bound.last().copied().unwrap_or(false),
    }
}

/// An error in percent with its interval.
#[derive(Default)]
struct ErrorPercent {
    value: Option<f64>,
    lower: Option<f64>,
    upper: Option<f64>,
}

fn row(case: &Case, summary: &MeasuredSummary, moment: Moment, runs: &Runs) -> BeforeAfterRow {
    let held_out = summary.experiment == case.context.config.validate.experiment.name();
    let statistic = statistic(summary, moment);
    let (shift, unsure) = case.evidence.offset.as_ref().and_then(|offset| offset.one(&statistic)).unwrap_or_default();
    let summary = &without(summary, moment, shift);
    let confidence = case.context.config.statistics.confidence;
    let found = |batches: &[Batch; 2]| {
        let values: Vec<f64> = batches[usize::from(held_out)].series(&statistic)?.values().copied().collect();
        Some(summarise(&values, confidence, case.context.config.statistics.convention))
    };
    let (before, after) = (found(&runs.before), runs.after.as_ref().and_then(found));
    let value = |found: &Option<Summary>| {
        found.as_ref().and_then(|found| finite(if moment == Moment::Mean { found.mean } else { found.sd }))
    };
    let error = |found: &Option<Summary>| match found {
        Some(found) if moment == Moment::Mean => mean_error(found, (summary, unsure), confidence),
        Some(found) => sd_error(found, (summary, unsure), confidence),
        None => ErrorPercent::default(),
    };
    let (first, second) = (error(&before), error(&after));
    BeforeAfterRow {
        measured: case.set.name.clone(),
        experiment: summary.experiment.to_owned(),
        kpi: summary.kpi.to_owned(),
        statistic: if moment == Moment::Mean { "mean" } else { "sd" }.to_owned(),
        fitted: case.evidence.statistics.contains(&statistic),
        measured_value: if moment == Moment::Mean { summary.mean } else { summary.sd },
        before: value(&before),
        after: value(&after),
        before_error_percent: first.value,
        before_lower_percent: first.lower,
        before_upper_percent: first.upper,
        after_error_percent: second.value,
        after_lower_percent: second.lower,
        after_upper_percent: second.upper,
        unit: summary.unit.to_owned(),
    }
}

/// What was measured less the model's own offset: a mean loses it, a standard deviation is divided by its exponential.
fn without(summary: &MeasuredSummary, moment: Moment, offset: f64) -> MeasuredSummary {
    match moment {
        Moment::LnSd => MeasuredSummary { sd: summary.sd * libm::exp(-offset), ..summary.clone() },
        Moment::Mean | Moment::Trend => MeasuredSummary { mean: summary.mean - offset, ..summary.clone() },
    }
}

/// Error of a mean with Welch's interval, widened by the variance of the offset. Where the measured mean does not stand out of the scatter, as for a
/// left-minus-right difference, a percentage of it means nothing and is left out.
fn mean_error(found: &Summary, (measured, unsure): (&MeasuredSummary, f64), confidence: f64) -> ErrorPercent {
    if measured.mean.abs() < measured.sd {
        return ErrorPercent::default();
    }
    let (n, m) = (found.n as f64, f64::from(measured.n));
    let (simulated, real) = (found.sd * found.sd / n, measured.sd * measured.sd / m);
    let variance = simulated + real;
    let dof = variance * variance / (simulated * simulated / (n - 1.0) + real * real / (m - 1.0));
    let half = student_t_quantile(0.5 + 0.5 * confidence, dof) * (variance + unsure).sqrt();
    let percent = |difference: f64| finite(100.0 * difference / measured.mean.abs());
    let difference = found.mean - measured.mean;
    ErrorPercent { value: percent(difference), lower: percent(difference - half), upper: percent(difference + half) }
}

/// Error of a standard deviation, with the interval of the difference of two bias-corrected ln s, widened in the same way.
fn sd_error(found: &Summary, (measured, unsure): (&MeasuredSummary, f64), confidence: f64) -> ErrorPercent {
    let usable = found.n >= 2 && measured.n >= 2 && found.sd > 0.0 && measured.sd > 0.0;
    if !usable {
        return ErrorPercent::default();
    }
    let (simulated, real) = (ln_sd(found.sd, found.n), ln_sd(measured.sd, measured.n as usize));
    let spread = |n: f64| 0.25 * trigamma(0.5 * (n - 1.0));
    let variance = spread(found.n as f64) + spread(f64::from(measured.n)) + unsure;
    let half = normal_quantile(0.5 + 0.5 * confidence) * variance.sqrt();
    let percent = |difference: f64| finite(100.0 * (libm::exp(difference) - 1.0));
    let difference = simulated.value - real.value;
    ErrorPercent { value: percent(difference), lower: percent(difference - half), upper: percent(difference + half) }
}
