//! Axes: round limits, round ticks, and where a value stands between the limits.

use super::super::numbers::{fixed, scientific};

/// A linear axis between two round limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Left or lower end.
    pub low: f64,
    /// Right or upper end.
    pub high: f64,
    step: f64,
}

impl Scale {
    /// An axis that holds all finite `values`, with about `ticks` round steps.
    pub fn around(values: impl IntoIterator<Item = f64>, ticks: usize) -> Self {
        let (low, high) = span(values);
        let step = round_step((high - low) / ticks.max(1) as f64);
        // A limit that is round already must not move by a step because of its last bit.
        let (first, last) = ((low / step + 1e-9).floor(), (high / step - 1e-9).ceil());
        Self { low: first * step, high: last * step, step }
    }

    /// An axis with these very limits and about `ticks` round steps inside.
    pub fn exactly(low: f64, high: f64, ticks: usize) -> Self {
        Self { low, high, step: round_step((high - low) / ticks.max(1) as f64) }
    }

    /// An axis of whole numbers from `low` to `high`.
    pub fn counting(low: u32, high: u32, ticks: usize) -> Self {
        let axis = Self::exactly(f64::from(low), f64::from(high.max(low + 1)), ticks);
        Self { step: axis.step.max(1.0), ..axis }
    }

    /// Position of a value: 0 at the lower, 1 at the upper end; values outside are put on the end.
    pub fn position(&self, value: f64) -> f64 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }

    /// Does the axis hold the value?
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Round values and their labels.
    pub fn ticks(&self) -> Vec<(f64, String)> {
        let (_, exponent) = scientific(self.step, 0);
        let decimals = (-exponent).max(0) as usize;
        let first = (self.low / self.step - 1e-9).ceil();
        let last = (self.high / self.step + 1e-9).floor();
        let count = (last - first).clamp(0.0, 50.0) as u32;
        (0..=count)
            .map(|index| (first + f64::from(index)) * self.step)
            .map(|value| (value, fixed(value, decimals)))
            .collect()
    }
}

/// Smallest and largest finite value, widened when they coincide.
fn span(values: impl IntoIterator<Item = f64>) -> (f64, f64) {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return (0.0, 1.0);
    }
    let least = if low == 0.0 { 1.0 } else { low.abs() * 1e-3 };
    if high - low < least { (low - least, high + least) } else { (low, high) }
}

/// The step 1, 2, 5 or 10 times a power of ten that is not smaller than `rough`.
fn round_step(rough: f64) -> f64 {
    if !rough.is_finite() || rough <= 0.0 {
        return 1.0;
    }
    let (_, exponent) = scientific(rough, 15);
    let power: f64 = format!("1e{exponent}").parse().unwrap_or(1.0);
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough * (1.0 - 1e-9)).unwrap_or(10.0);
    factor * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_and_ticks_are_round() {
        let scale = Scale::around([-3.2, 7.1], 5);
        assert_eq!((scale.low, scale.high), (-5.0, 10.0));
        let labels: Vec<String> = scale.ticks().into_iter().map(|tick| tick.1).collect();
        assert_eq!(labels, ["-5", "0", "5", "10"]);
        let fine = Scale::around([0.51, 0.56], 5).ticks();
        assert_eq!(fine.first().map(|tick| tick.1.as_str()), Some("0.51"));
        assert_eq!(fine.last().map(|tick| tick.1.as_str()), Some("0.56"));
    }

    #[test]
    fn degenerate_values_still_give_an_axis() {
        for values in [vec![], vec![f64::NAN], vec![0.0, 0.0], vec![2763.5; 3], vec![-1e-12]] {
            let scale = Scale::around(values.clone(), 5);
            assert!(scale.high > scale.low, "{values:?}");
            assert!(!scale.ticks().is_empty(), "{values:?}");
        }
    }

    #[test]
    fn counting_never_has_half_steps() {
        let labels: Vec<String> = Scale::counting(1, 3, 6).ticks().into_iter().map(|tick| tick.1).collect();
        assert_eq!(labels, ["1", "2", "3"]);
    }
}
