//! Discharge read off a trace of mass: the share that left, the rate of the steady part, the time of a share.
//!
//! Takes samples (time, mass still above the opening) and the time of release; gives what a load cell gives. The
//! steady part is a range of the discharged share, not of time, so that it needs no eye (paper, Fig. 5).

use super::reason::Reason;
use crate::dem::TracePoint;

/// The part of a trace after the release.
#[derive(Debug, Clone, PartialEq)]
pub struct Discharge {
    /// Samples (time since release [s], mass that has left [kg]).
    samples: Vec<(f64, f64)>,
    /// Mass above the opening at release [kg].
    initial: f64,
    /// Mass that has left at the end [kg].
    total: f64,
}

impl Discharge {
    /// The discharge after `release` [s]; mass at release is that of the first sample at or after it.
    ///
    /// # Errors
    /// [`Reason::NoTrace`] without samples after the release, [`Reason::Clogged`] where less than `least_share` left.
    pub fn new(trace: &[TracePoint], release: f64, least_share: f64) -> Result<Self, Reason> {
        let after: Vec<_> = trace.iter().filter(|point| point.time >= release).collect();
        let (first, last) =
            after.first().zip(after.last()).filter(|(first, _)| first.mass > 0.0).ok_or(Reason::NoTrace)?;
        let (initial, total) = (first.mass, first.mass - last.mass);
        if total < least_share * initial || total <= 0.0 {
            return Err(Reason::Clogged { share: total / initial });
        }
        let samples = after.iter().map(|point| (point.time - release, initial - point.mass)).collect();
        Ok(Self { samples, initial, total })
    }

    /// Mass above the opening at release [kg].
    pub fn initial(&self) -> f64 {
        self.initial
    }

    /// Time since release at which `share` of the discharged mass had left, between samples by a straight line [s].
    pub fn time_of(&self, share: f64) -> f64 {
        let target = share * self.total;
        let after = self.samples.iter().position(|(_, gone)| *gone >= target).unwrap_or(self.samples.len() - 1);
        let Some(before) = after.checked_sub(1) else { return self.samples[after].0 };
        let ((t0, m0), (t1, m1)) = (self.samples[before], self.samples[after]);
        t0 + (t1 - t0) * (target - m0) / (m1 - m0)
    }

    /// Steady rate: least-squares slope of the samples between the shares `from` and `to` of the discharged mass [kg/s].
    ///
    /// # Errors
    /// [`Reason::NoSteadyFlow`] with fewer than `needed` samples there.
    pub fn steady_rate(&self, from: f64, to: f64, needed: usize) -> Result<f64, Reason> {
        let bounds = from * self.total..=to * self.total;
        let steady: Vec<_> = self.samples.iter().filter(|(_, gone)| bounds.contains(gone)).collect();
        if steady.len() < needed {
            return Err(Reason::NoSteadyFlow { samples: steady.len(), needed });
        }
        let n = steady.len() as f64;
        let t_mean = steady.iter().map(|(t, _)| t).sum::<f64>() / n;
        let covariance: f64 = steady.iter().map(|(t, gone)| (t - t_mean) * gone).sum();
        let variance: f64 = steady.iter().map(|(t, _)| (t - t_mean) * (t - t_mean)).sum();
        Ok(covariance / variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 kg until t = 1 s, then 2 kg/s, sampled at 50 Hz until `end`.
    fn trace(end: f64) -> Vec<TracePoint> {
        let samples = (end * 50.0) as usize;
        (0..=samples)
            .map(|i| i as f64 / 50.0)
            .map(|time| TracePoint { time, mass: (10.0 - 2.0 * (time - 1.0).max(0.0)).max(0.0) })
            .collect()
    }

    #[test]
    fn a_trace_of_known_rate_gives_rate_and_times() {
        let discharge = Discharge::new(&trace(8.0), 1.0, 0.9).unwrap();
        let rate = discharge.steady_rate(0.2, 0.8, 5).unwrap();
        // The trace is exactly linear there, so only rounding is left.
        assert!((rate - 2.0).abs() < 1e-12, "{rate}");
        assert!((discharge.time_of(0.5) - 2.5).abs() < 1e-12);
        assert!((discharge.time_of(0.95) - 4.75).abs() < 1e-12);
        assert_eq!(discharge.initial(), 10.0);
    }

    #[test]
    fn a_time_between_samples_is_interpolated() {
        let points = [(0.0, 4.0), (1.0, 3.0), (2.0, 0.0)].map(|(time, mass)| TracePoint { time, mass });
        let discharge = Discharge::new(&points, 0.0, 0.5).unwrap();
        assert!((discharge.time_of(0.5) - (1.0 + 1.0 / 3.0)).abs() < 1e-12);
        assert_eq!(discharge.time_of(0.0), 0.0);
    }

    #[test]
    fn a_clogged_opening_is_named_with_its_share() {
        // Cut off at t = 3 s, 4 of 10 kg have left.
        let reason = Discharge::new(&trace(3.0), 1.0, 0.9).unwrap_err();
        assert_eq!(reason, Reason::Clogged { share: 0.4 });
        assert_eq!(reason.code(), "clogged");
    }

    #[test]
    fn a_trace_without_samples_gives_no_rate() {
        assert_eq!(Discharge::new(&[], 1.0, 0.9).unwrap_err().code(), "no_trace");
        assert_eq!(Discharge::new(&trace(0.5), 1.0, 0.9).unwrap_err().code(), "no_trace");
        let coarse: Vec<_> = trace(8.0).into_iter().step_by(50).collect();
        let reason = Discharge::new(&coarse, 1.0, 0.9).unwrap().steady_rate(0.2, 0.8, 5).unwrap_err();
        assert_eq!(reason, Reason::NoSteadyFlow { samples: 4, needed: 5 });
    }
}
