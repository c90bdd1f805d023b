//! What a model is held against: a measured statistic less the model's own offset, and how well it is known.

use super::Offset;
use super::evidence::statistic;
use super::moments::Moment;
use super::verdict::Case;
use crate::config::MeasuredSummary;
use crate::stats::summary::variance_of_mean;

/// A part of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// What is given to the diagnosis, the held-out experiment included, which no fit takes.
    Seen,
    /// Repetitions of fitted experiments that are kept from it.
    Unseen,
}

/// A measured statistic.
pub struct Target {
    /// As measured, less the model's own offset.
    pub summary: MeasuredSummary,
    /// Variance of the mean by the scatter of repetitions, and its degrees of freedom.
    pub of_mean: (f64, f64),
    /// Variance of the offset and of doubts.
    pub unsure: f64,
}

impl Target {
    /// A statistic of a part of the data. A few held-out repetitions scatter as the others of their test do, so that the variance of
    /// their mean comes from all.
    pub fn new(case: &Case, (summary, part): (&MeasuredSummary, Part), moment: Moment) -> Self {
        let statistic = statistic(summary, moment);
        let one = |offset: &Offset| offset.one(&statistic);
        let (shift, unsure) = case.evidence.offset.as_ref().and_then(one).unwrap_or_default();
        let doubt: f64 =
            case.evidence.doubts.iter().map(|doubt| doubt.shift(&statistic) * doubt.shift(&statistic)).sum();
        let others = case.set.statistic(summary.kpi).filter(|_| part == Part::Unseen);
        let of_mean = others.map_or_else(|| own(summary), |others| pooled(summary, &others));
        Self { summary: without(summary, moment, shift), of_mean, unsure: unsure + doubt }
    }
}

/// Variance of a mean by its own repetitions.
pub fn own(summary: &MeasuredSummary) -> (f64, f64) {
    variance_of_mean(summary.sd, summary.n as usize)
}

/// Variance of a mean by its own repetitions and those of others about theirs.
fn pooled(summary: &MeasuredSummary, others: &MeasuredSummary) -> (f64, f64) {
    let (own, more) = (f64::from(summary.n) - 1.0, f64::from(others.n) - 1.0);
    let squares = own * summary.sd * summary.sd + more * others.sd * others.sd;
    (squares / (own + more) / f64::from(summary.n), own + more)
}

/// What was measured less the model's own offset: a mean loses it, a standard deviation is divided by its exponential.
fn without(summary: &MeasuredSummary, moment: Moment, offset: f64) -> MeasuredSummary {
    match moment {
        Moment::LnSd => MeasuredSummary { sd: summary.sd * libm::exp(-offset), ..summary.clone() },
        Moment::Mean | Moment::Trend => MeasuredSummary { mean: summary.mean - offset, ..summary.clone() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4 values ± 3 and 17 ± 2: (3 · 9 + 16 · 4) / 19 / 4.
    #[test]
    fn few_repetitions_scatter_as_all_do() {
        let of = |sd: f64, n: u32| MeasuredSummary {
            experiment: "pile",
            kpi: "angle_of_repose",
            unit: "deg",
            mean: 30.0,
            sd,
            n,
        };
        let (variance, dof) = pooled(&of(3.0, 4), &of(2.0, 17));
        assert!((variance - 91.0 / 76.0).abs() < 1e-15, "{variance}");
        assert_eq!((dof, own(&of(3.0, 4))), (19.0, (2.25, 3.0)));
    }
}
