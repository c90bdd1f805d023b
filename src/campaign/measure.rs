//! Observables of runs: read off final state and trace, once per run and way of measuring.

use super::records::{FAILED, KpiRecord, OK, state_from, trace_from};
use super::{Campaign, CampaignError, Request};
use crate::canonical::{Digest, Encoder, digest};
use crate::dem::{State, TracePoint};
use crate::settings::{Scope, Settings};
use crate::tables::list::{KpiRow, RunRow};
use rayon::prelude::*;

const KPI_CONTEXT: &str = "granulake 2026 kpi key v1";
/// Raised when the meaning of an observable changes.
pub const KPI_VERSION: u64 = 3;

impl Campaign {
    /// One row per request and observable, in order; `runs` are the rows of the same requests.
    ///
    /// # Errors
    /// A final state that the store lost, or a store that cannot be written.
    pub fn measure(&self, requests: &[Request], runs: &[RunRow]) -> Result<Vec<KpiRow>, CampaignError> {
        let bar = self.progress.bar("kpi", requests.len());
        let rows: Result<Vec<Vec<KpiRow>>, CampaignError> = self.pool.install(|| {
            requests
                .par_iter()
                .zip(runs)
                .map(|(request, run)| {
                    let records = self.records(request, run)?;
                    bar.inc(1);
                    Ok(records.into_iter().map(|record| row(request, run, record)).collect())
                })
                .collect()
        });
        bar.finish_and_clear();
        Ok(rows?.into_iter().flatten().collect())
    }

    fn records(&self, request: &Request, run: &RunRow) -> Result<Vec<KpiRecord>, CampaignError> {
        let settings = request.resolve()?;
        let key = kpi_key(request, &run.run_key, run.state.as_deref().unwrap_or_default(), &settings)?.to_string();
        let (Some(state), Some(trace)) = (&run.state, &run.trace) else {
            // Never stored: they follow from the row of the run, which may become another when it is tried again.
            return Ok(unmeasured(&key, request, run.reason.as_deref().unwrap_or("the run has no final state")));
        };
        if let Some(records) = self.kpis.get(&key) {
            return Ok(records);
        }
        let (state, trace) = self.load(state, trace)?;
        let records = measured(&key, request, &settings, &state, &trace);
        self.kpis.append(&records)?;
        Ok(records)
    }

    /// Final state and trace of a run.
    fn load(&self, state: &str, trace: &str) -> Result<(State, Vec<TracePoint>), CampaignError> {
        let bytes = |text: &str| -> Result<Vec<u8>, CampaignError> { Ok(self.store.object(&text.parse::<Digest>()?)?) };
        Ok((state_from(state, bytes(state)?)?, trace_from(trace, bytes(trace)?)?))
    }
}

/// Content key of the observables of a run with a final state: the run, the state, and the settings of the measurement.
///
/// # Errors
/// A setting that is NaN.
pub fn kpi_key(request: &Request, run_key: &str, state: &str, settings: &Settings) -> Result<Digest, CampaignError> {
    let mut encoder = Encoder::new();
    encoder.u64(KPI_VERSION).str(run_key).str(state).append(&request.told(settings, Scope::Measure)?);
    Ok(digest(KPI_CONTEXT, &encoder))
}

fn measured(key: &str, request: &Request, settings: &Settings, state: &State, trace: &[TracePoint]) -> Vec<KpiRecord> {
    let values = request.experiment.measure(settings, state, trace);
    let units = request.experiment.observables().iter().map(|observable| observable.unit);
    values
        .into_iter()
        .zip(units)
        .map(|((name, value), unit)| KpiRecord {
            kpi_key: key.to_owned(),
            kpi: name.to_owned(),
            value: value.as_ref().ok().copied(),
            unit: unit.to_owned(),
            reason: value.err().map(|reason| format!("{}: {reason}", reason.code())),
        })
        .collect()
}

fn unmeasured(key: &str, request: &Request, reason: &str) -> Vec<KpiRecord> {
    let observables = request.experiment.observables().iter();
    observables
        .map(|observable| KpiRecord {
            kpi_key: key.to_owned(),
            kpi: observable.name.to_owned(),
            value: None,
            unit: observable.unit.to_owned(),
            reason: Some(format!("run_failed: {reason}")),
        })
        .collect()
}

fn row(request: &Request, run: &RunRow, record: KpiRecord) -> KpiRow {
    KpiRow {
        label: request.label.clone(),
        experiment: run.experiment.clone(),
        point: run.point,
        parameter_hash: run.parameter_hash.clone(),
        seed: run.seed,
        repetition: run.repetition,
        run_key: run.run_key.clone(),
        kpi: record.kpi,
        status: if record.value.is_some() { OK } else { FAILED }.to_owned(),
        value: record.value,
        unit: record.unit,
        reason: record.reason,
    }
}
