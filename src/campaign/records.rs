//! What the store keeps of every run: its record, its observables, its cost, and the layout of its final state.

use crate::canonical::Digest;
use crate::dem::{Failure, Outcome, State, TracePoint};
use crate::table;
use crate::tables::columns::{Column, ColumnFile};
use crate::tables::{RunRow, TableError};

/// Status of a row that has its value.
pub const OK: &str = "ok";
/// Status of a row that has a reason instead.
pub const FAILED: &str = "failed";
/// What ended a run that was given up.
const STEP_LIMIT: &str = "step_limit";

table! {
    /// One run of the engine, whoever asked for it.
    pub struct RunRecord in "ledger_runs" version 2 keyed by run_key sorted by (run_key) {
        /// Content key: physics version, experiment, resolved settings and seed.
        run_key: String [""],
        /// `ok` or `failed`.
        status: String [""],
        /// Why the run failed.
        reason: Option<String> [""],
        /// Which criterion ended the run: energy_ratio, empty or time_cap; step_limit where it was given up.
        stop: Option<String> [""],
        /// Simulated time at the end.
        time_s: Option<f64> ["s"],
        /// Time steps.
        steps: Option<u64> ["1"],
        /// Grains inserted.
        inserted: Option<u32> ["1"],
        /// Attempts of the insertion, accepted or not.
        insertion_attempts: Option<u64> ["1"],
        /// Grains deleted because they lay above the fill height.
        deleted: Option<u32> ["1"],
        /// Grains that left the domain.
        lost: Option<u32> ["1"],
        /// Particles in the final state.
        particles: Option<u32> ["1"],
        /// Translational kinetic over elastic energy at the end; null where no contact is left.
        energy_ratio: Option<f64> ["1"],
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

impl RunRecord {
    /// A run that came to its end.
    pub(super) fn finished(key: Digest, outcome: &Outcome, state: Digest, trace: Digest) -> Self {
        Self {
            run_key: key.to_string(),
            status: OK.to_owned(),
            reason: None,
            stop: Some(outcome.stop.name().to_owned()),
            time_s: Some(outcome.time),
            steps: Some(outcome.steps),
            inserted: u32::try_from(outcome.inserted).ok(),
            insertion_attempts: Some(outcome.attempts),
            deleted: u32::try_from(outcome.deleted).ok(),
            lost: u32::try_from(outcome.lost).ok(),
            particles: u32::try_from(outcome.state.len()).ok(),
            energy_ratio: outcome.energies.ratio(),
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
            stop: matches!(failure, Failure::StepLimit { .. }).then(|| STEP_LIMIT.to_owned()),
            time_s: None,
            steps: failure.steps(),
            inserted: None,
            insertion_attempts: None,
            deleted: None,
            lost: None,
            particles: None,
            energy_ratio: None,
            coordination_number: None,
            max_overlap: None,
            state: None,
            trace: None,
        }
    }

    /// The record that a row of a table was made from.
    pub(super) fn of_row(row: &RunRow) -> Self {
        let row = row.clone();
        Self {
            run_key: row.run_key,
            status: row.status,
            reason: row.reason,
            stop: row.stop,
            time_s: row.time_s,
            steps: row.steps,
            inserted: row.inserted,
            insertion_attempts: row.insertion_attempts,
            deleted: row.deleted,
            lost: row.lost,
            particles: row.particles,
            energy_ratio: row.energy_ratio,
            coordination_number: row.coordination_number,
            max_overlap: row.max_overlap,
            state: row.state,
            trace: row.trace,
        }
    }

    /// What the record says under a limit of steps; `None` where the run was given up at a smaller limit, so that it has
    /// to be made again. The limit is no part of the run's key: changing it loses no run, and the same limit gives the
    /// same rows whatever it was before.
    pub(super) fn under(self, key: Digest, limit: Option<u64>) -> Option<Self> {
        let given_up = self.stop.as_deref() == Some(STEP_LIMIT);
        let beyond = |limit: &u64| self.steps.is_some_and(|steps| steps > *limit || given_up && steps == *limit);
        match limit.filter(beyond) {
            Some(limit) => Some(Self::failed(key, &Failure::StepLimit { limit })),
            None if given_up => None,
            None => Some(self),
        }
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

/// Digest under which the store keeps a final state; the `state` of its row in `runs`.
///
/// # Errors
/// A state that holds a NaN.
pub fn state_digest(state: &State) -> Result<Digest, TableError> {
    Ok(Digest::of_content(&state_bytes(state)?))
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
    fn a_limit_of_steps_gives_the_same_rows_whatever_it_was_before() {
        let key = Digest::of_content(b"run");
        let gave_up = |limit| RunRecord::failed(key, &Failure::StepLimit { limit });
        let exploded = RunRecord::failed(key, &Failure::NotFinite { step: 64, time: 0.1, grain: 3 });
        let done = RunRecord { status: OK.to_owned(), reason: None, stop: None, steps: Some(100), ..exploded.clone() };
        for record in [&done, &gave_up(10), &gave_up(20), &exploded] {
            assert_eq!(record.clone().under(key, Some(10)), Some(gave_up(10)), "{record:?}");
        }
        for limit in [Some(100), None] {
            assert_eq!(done.clone().under(key, limit), Some(done.clone()));
            assert_eq!(exploded.clone().under(key, limit), Some(exploded.clone()));
            assert_eq!(gave_up(10).under(key, limit), None, "it has to be made again");
        }
    }

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
