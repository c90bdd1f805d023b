//! Whether the held-out experiment and held-out repetitions bear out an effect that was added.
//!
//! No fit saw them, so they may contradict: where the error of one of its means grows and the interval of that error does not hold
//! zero, the model without the effect is kept. Where the effect moves no mean by more than runs and measurements scatter, the
//! held-out data cannot judge it; agreement would say nothing then.

use super::before_after::{Difference, Found, Runs, mean_difference};
use super::evidence::statistic;
use super::moments::Moment;
use super::target::{Part, Target};
use super::verdict::Case;
use crate::config::{Measured, MeasuredSummary};
use crate::stages::optima::finite;
use crate::stats::special::student_t_quantile;
use crate::stats::summary::welch;
use crate::tables::list::HeldOutRow;

const BETTER: &str = "better";
const WITHIN: &str = "within";
const WORSE: &str = "worse";
const CANNOT_JUDGE: &str = "cannot_judge";

/// One row per mean that was measured and that no fit saw, by the models without the effect and with it.
pub fn rows((case, unseen): (&Case, &Measured), effect: &str, models: [&Runs; 2]) -> Vec<HeldOutRow> {
    let held_out = case.context.config.validate.experiment.name();
    let of_experiment = case.set.statistics().into_iter().filter(|summary| summary.experiment == held_out);
    let repetitions = unseen.statistics().into_iter().map(|summary| (summary, Part::Unseen));
    let summaries: Vec<(MeasuredSummary, Part)> =
        of_experiment.map(|summary| (summary, Part::Seen)).chain(repetitions).collect();
    // Any one of them may contradict, so the level is shared out among them (Bonferroni).
    let level = 1.0 - (1.0 - case.context.config.statistics.confidence) / summaries.len().max(1) as f64;
    let row = |(summary, part): &(MeasuredSummary, Part)| {
        let found = models.map(|runs| runs.found(case, (&statistic(summary, Moment::Mean), *part)));
        row((&case.set.name, effect), &Target::new(case, (summary, *part), Moment::Mean), &found, level)
    };
    summaries.iter().map(row).collect()
}

fn row((measured, effect): (&str, &str), target: &Target, found: &[Option<Found>; 2], level: f64) -> HeldOutRow {
    let [before, after] = found.each_ref().map(|found| Some(mean_difference(found.as_ref()?, target, level)));
    let change = before.zip(after).map(|(before, after)| after.value - before.value);
    let noise = noise(target, found, level);
    HeldOutRow {
        measured: measured.to_owned(),
        effect: effect.to_owned(),
        experiment: target.summary.experiment.to_owned(),
        kpi: target.summary.kpi.to_owned(),
        before_error: before.map(|error| error.value),
        after_error: after.map(|error| error.value),
        after_half_width: after.and_then(|error| error.half).and_then(finite),
        change,
        noise,
        judgement: judgement(change.zip(noise), before.zip(after)).to_owned(),
        unit: target.summary.unit.to_owned(),
    }
}

/// The change that the scatter of the runs of both models and of the measurement would hide.
fn noise(target: &Target, found: &[Option<Found>; 2], level: f64) -> Option<f64> {
    let [before, after] = found.each_ref().map(|found| found.as_ref().map(Found::of_mean));
    let (variance, dof) = welch(&[before?, after?, target.of_mean]);
    finite(student_t_quantile(0.5 + 0.5 * level, dof) * variance.sqrt())
}

/// What a held-out mean says of an effect, from its change and what would hide that, and the errors before and after.
fn judgement(change: Option<(f64, f64)>, errors: Option<(Difference, Difference)>) -> &'static str {
    let seen = change.is_some_and(|(change, noise)| change.abs() > noise);
    let known = errors.and_then(|(before, after)| Some((before.value.abs(), after.value.abs(), after.half?)));
    match known.filter(|_| seen) {
        None => CANNOT_JUDGE,
        Some((before, after, half)) if after > before && after > half => WORSE,
        Some((before, after, _)) if after > before => WITHIN,
        Some(_) => BETTER,
    }
}

/// What the held-out experiment says of an effect, as a sentence; nothing where it was not measured.
pub fn sentence(rows: &[HeldOutRow], effect: &str) -> String {
    let of = |judgement: &str| -> Vec<&str> {
        rows.iter().filter(|row| row.judgement == judgement).map(|row| row.kpi.as_str()).collect()
    };
    let (worse, better, within, blind) = (of(WORSE), of(BETTER), of(WITHIN), of(CANNOT_JUDGE));
    if rows.is_empty() {
        String::new()
    } else if !worse.is_empty() {
        format!(" Held-out {} got worse beyond the interval: the model without {effect} is kept.", worse.join(", "))
    } else if blind.len() == rows.len() {
        format!(" The held-out data cannot judge {effect}.")
    } else {
        let parts = [("came nearer", better), ("stayed within the interval", within), ("cannot judge it", blind)];
        let parts = parts.iter().filter(|(_, kpis)| !kpis.is_empty());
        let parts: Vec<String> = parts.map(|(what, kpis)| format!("{} {what}", kpis.join(", "))).collect();
        format!(" Held out: {}.", parts.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::diagnose::target::own;

    fn of(change: f64, before: f64, half: Option<f64>) -> &'static str {
        let error = |value: f64| Difference { value, half };
        judgement(Some((change, 0.5)), Some((error(before), error(before + change))))
    }

    #[test]
    fn a_mean_judges_an_effect_that_moves_it_beyond_its_noise() {
        assert_eq!(of(-1.0, 1.2, Some(0.6)), BETTER);
        assert_eq!(of(-1.0, 0.6, Some(0.5)), BETTER, "nearer on the other side");
        assert_eq!(of(1.0, -0.3, Some(0.8)), WITHIN);
        assert_eq!(of(1.0, 0.3, Some(0.8)), WORSE);
        assert_eq!(of(-0.5, 1.2, Some(0.6)), CANNOT_JUDGE, "no more than the noise");
        assert_eq!(of(5.0, 0.3, None), CANNOT_JUDGE, "no interval");
        assert_eq!(judgement(None, None), CANNOT_JUDGE, "not simulated");
    }

    fn row(kpi: &str, judgement: &str) -> HeldOutRow {
        HeldOutRow {
            measured: "blind".to_owned(),
            effect: "tilt".to_owned(),
            experiment: "hopper".to_owned(),
            kpi: kpi.to_owned(),
            before_error: None,
            after_error: None,
            after_half_width: None,
            change: None,
            noise: None,
            judgement: judgement.to_owned(),
            unit: "kg/s".to_owned(),
        }
    }

    #[test]
    fn one_mean_that_got_worse_keeps_the_old_model() {
        let said = |judgements: &[&str]| {
            let kpis = ["rate", "mass", "time"];
            let rows: Vec<HeldOutRow> = kpis.iter().zip(judgements).map(|(kpi, j)| row(kpi, j)).collect();
            sentence(&rows, "tilt")
        };
        let worse = " Held-out mass got worse beyond the interval: the model without tilt is kept.";
        assert_eq!(said(&[BETTER, WORSE, CANNOT_JUDGE]), worse);
        assert_eq!(said(&[CANNOT_JUDGE, CANNOT_JUDGE]), " The held-out data cannot judge tilt.");
        let mixed = " Held out: rate came nearer; mass stayed within the interval; time cannot judge it.";
        assert_eq!(said(&[BETTER, WITHIN, CANNOT_JUDGE]), mixed);
        assert_eq!(said(&[]), "");
    }

    /// Means of 2 ± 0.1 and 3 ± 0.1 of four runs each against 3.1 ± 0.2 of 16: 0.05², 0.05², 0.05² and 27/4 degrees of
    /// freedom in the noise, 9.2 in the error.
    #[test]
    fn noise_is_that_of_both_models_and_of_the_measurement() {
        let found = |mean: f64| Some(Found { summary: summarise_of(mean), open: Some(0.0) });
        let summary =
            MeasuredSummary { experiment: "hopper", kpi: "discharge_rate", unit: "kg/s", mean: 3.1, sd: 0.2, n: 16 };
        let target = Target { of_mean: own(&summary), summary, unsure: 0.0 };
        let row = super::row(("blind", "tilt"), &target, &[found(2.0), found(3.0)], 0.95);
        let dof = 0.0075f64.powi(2) / (2.0 * 0.0025f64.powi(2) / 3.0 + 0.0025f64.powi(2) / 15.0);
        let expected = student_t_quantile(0.975, dof) * 0.0075f64.sqrt();
        assert!((row.noise.expect("a noise") - expected).abs() < 1e-12, "{row:?}");
        let is = |value: Option<f64>, expected: f64| value.is_some_and(|value| (value - expected).abs() < 1e-12);
        assert!(is(row.change, 1.0) && is(row.before_error, -1.1) && is(row.after_error, -0.1), "{row:?}");
        assert_eq!(row.judgement, BETTER);
        let clogged = super::row(("blind", "tilt"), &target, &[found(2.0), None], 0.95);
        assert_eq!((clogged.change, clogged.judgement.as_str()), (None, CANNOT_JUDGE), "a row all the same");
    }

    fn summarise_of(mean: f64) -> crate::stats::summary::Summary {
        use crate::stats::summary::{Interval, Summary};
        let nowhere = Interval { lower: f64::NAN, upper: f64::NAN };
        Summary { n: 4, mean, sd: 0.1, mean_interval: nowhere, sd_interval: nowhere }
    }
}
