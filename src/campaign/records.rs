//! What the store keeps of every run: its record, its observables, its cost, and the layout of its final state.

use crate::canonical::Digest;
use crate::dem::{Failure, Outcome, State, Stop, TracePoint};
use crate::table;
use crate::tables::TableError;
use crate::tables::columns::{Column, ColumnFile};

/// Status of a row that has its value.
pub const OK: &str = "ok";
/// Status of a row that has a reason instead.
pub const FAILED: &str = "failed";

table! {
    /// One run of the engine, whoever asked for it.
    pub struct RunRecord in "ledger_runs" version 1 keyed by run_key sorted by (run_key) {
        /// Content key: physics version, experiment, resolved settings and seed.
        run_key: String [""],
        /// `ok` or `failed`.
        status: String [""],
        /// Why the run failed.
        reason: Option<String> [""],
        /// Which criterion ended the run: energy_ratio, empty or time_cap.
        stop: Option<String> [""],
        /// Simulated time at the end.
        time_s: Option<f64> ["s"],
        /// Time steps.
        steps: Option<u64> ["1"],
        /// Particles in the final state.
        particles: Option<u32> ["1"],
        /// Mean number of contacts per particle at the end.
        coordination_number: Option<f64> ["1"],
        /// Largest overlap over the smaller radius.
        max_overlap: Option<f64> ["1"],
        /// Digest of the final state.
        state: Option<String> [""],
        /// Digest of the mass trace.
        trace: Option<String> [""],
    }
}

table! {
    /// One observable of one run under one way of measuring.
    pub struct KpiRecord in "ledger_kpis" version 1 keyed by kpi_key sorted by (kpi_key, kpi) {
        /// Content key: run and settings of the measurement.
        kpi_key: String [""],
        /// Observable.
        kpi: String [""],
        /// Value in `unit`.
        value: Option<f64> ["see unit"],
        /// Unit of `value`.
        unit: String [""],
        /// Why there is no value.
        reason: Option<String> [""],
    }
}

table! {
    /// What a run cost here; provenance, never an input of a result.
    pub struct TimingRecord in "ledger_timings" version 1 keyed by run_key sorted by (run_key) {
        /// Content key of the run.
        run_key: String [""],
        /// Experiment.
        experiment: String [""],
        /// Seconds of one core.
        cpu_seconds: f64 ["s"],
    }
}

impl RunRecord {
    /// A run that came to its end.
    pub(super) fn finished(key: Digest, outcome: &Outcome, state: Digest, trace: Digest) -> Self {
        Self {
            run_key: key.to_string(),
            status: OK.to_owned(),
            reason: None,
            stop: Some(stop_code(outcome.stop).to_owned()),
            time_s: Some(outcome.time),
            steps: Some(outcome.steps),
            particles: u32::try_from(outcome.state.len()).ok(),
            coordination_number: Some(outcome.coordination_number),
            max_overlap: Some(outcome.max_overlap),
            state: Some(state.to_string()),
            trace: Some(trace.to_string()),
        }
    }

    /// A run that failed.
    pub(super) fn failed(key: Digest, failure: &Failure) -> Self {
        Self {
            run_key: key.to_string(),
            status: FAILED.to_owned(),
            reason: Some(failure.to_string()),
            stop: None,
            time_s: None,
            steps: None,
            particles: None,
            coordination_number: None,
            max_overlap: None,
            state: None,
            trace: None,
        }
    }
}

const fn stop_code(stop: Stop) -> &'static str {
    match stop {
        Stop::EnergyRatio => "energy_ratio",
        Stop::Empty => "empty",
        Stop::TimeCap => "time_cap",
    }
}

/// Final particle states as Parquet bytes: one row per particle, SI units.
pub(super) fn state_bytes(state: &State) -> Result<Vec<u8>, TableError> {
    let number = |name: &str, unit: &str, values: &[f64]| Column::f64(name, unit, values.to_vec());
    ColumnFile::new(
        STATE,
        vec![
            Column::u32("id", "1", state.id.clone()),
            number("radius", "m", &state.radius),
            number("x", "m", &state.x),
            number("y", "m", &state.y),
            number("z", "m", &state.z),
            number("vx", "m/s", &state.vx),
            number("vy", "m/s", &state.vy),
            number("vz", "m/s", &state.vz),
            number("wx", "rad/s", &state.wx),
            number("wy", "rad/s", &state.wy),
            number("wz", "rad/s", &state.wz),
        ],
    )?
    .to_parquet_bytes(STATE)
}

/// Reads what [`state_bytes`] wrote.
pub(super) fn state_from(origin: &str, bytes: Vec<u8>) -> Result<State, TableError> {
    let file = ColumnFile::from_parquet_bytes(STATE, origin, bytes)?;
    let number = |name: &str| file.f64(name).map(<[f64]>::to_vec).unwrap_or_default();
    Ok(State {
        id: file.u32("id").map(<[u32]>::to_vec).unwrap_or_default(),
        radius: number("radius"),
        x: number("x"),
        y: number("y"),
        z: number("z"),
        vx: number("vx"),
        vy: number("vy"),
        vz: number("vz"),
        wx: number("wx"),
        wy: number("wy"),
        wz: number("wz"),
    })
}

/// The mass trace as Parquet bytes: one row per sample.
pub(super) fn trace_bytes(trace: &[TracePoint]) -> Result<Vec<u8>, TableError> {
    let columns = vec![
        Column::f64("time", "s", trace.iter().map(|point| point.time).collect()),
        Column::f64("mass", "kg", trace.iter().map(|point| point.mass).collect()),
    ];
    ColumnFile::new(TRACE, columns)?.to_parquet_bytes(TRACE)
}

/// Reads what [`trace_bytes`] wrote.
pub(super) fn trace_from(origin: &str, bytes: Vec<u8>) -> Result<Vec<TracePoint>, TableError> {
    let file = ColumnFile::from_parquet_bytes(TRACE, origin, bytes)?;
    let (time, mass) = (file.f64("time").unwrap_or_default(), file.f64("mass").unwrap_or_default());
    Ok(time.iter().zip(mass).map(|(&time, &mass)| TracePoint { time, mass }).collect())
}

const STATE: &str = "particle_states";
const TRACE: &str = "mass_trace";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_and_traces_come_back_bit_for_bit() {
        let ramp = |start: f64| vec![start, start + 1e-17, -0.0];
        let state = State {
            id: vec![0, 3, 7],
            radius: ramp(0.005),
            x: ramp(1.0),
            y: ramp(2.0),
            z: ramp(3.0),
            vx: ramp(4.0),
            vy: ramp(5.0),
            vz: ramp(6.0),
            wx: ramp(7.0),
            wy: ramp(8.0),
            wz: ramp(9.0),
        };
        assert_eq!(state_from("test", state_bytes(&state).unwrap()).unwrap(), state);
        let trace = vec![TracePoint { time: 0.0, mass: 1.5 }, TracePoint { time: 0.02, mass: 1.25 }];
        assert_eq!(trace_from("test", trace_bytes(&trace).unwrap()).unwrap(), trace);
    }
}
