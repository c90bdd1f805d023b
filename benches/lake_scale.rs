//! A store with many finished runs that nobody simulated, for `lake_scale.sh`.
//!
//! `cargo bench --bench lake_scale -- FOLDER N` writes a study of 127 points in three experiments with N/381 repetitions
//! and ledgers that hold a made-up record of every run: the scale of the paper's study for N = 19,050. Everything from
//! `repro simulate` on is then done by the real binary.

use granulake::campaign::{KpiRecord, Options, Request, RunRecord, kpi_key};
use granulake::canonical::Digest;
use granulake::pipeline::{Study, run};
use granulake::stages::{self, Demand};
use granulake::store::{Ledger, Store};
use std::error::Error;
use std::path::Path;

/// Runs of one repetition: 27 points on the boundary and 100 inside, three experiments.
const RUNS_PER_REPETITION: u32 = 127 * 3;
/// Records appended at a time.
const CHUNK: usize = 20_000;

fn main() -> Result<(), Box<dyn Error>> {
    // cargo passes `--bench` on to the binary.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [folder, runs] = arguments.as_slice() else {
        println!("lake_scale: no folder given, nothing to do; see benches/lake_scale.sh");
        return Ok(());
    };
    let path = Path::new(folder).join("pipeline.toml");
    std::fs::create_dir_all(folder)?;
    std::fs::write(path.with_file_name("paper.csv"), include_str!("../artifacts/measured/fransen2022.csv"))?;
    std::fs::write(&path, study((runs.parse::<u32>()? / RUNS_PER_REPETITION).max(1)))?;
    fill(&mut Study::load(&path)?)
}

fn study(repetitions: u32) -> String {
    let shipped = include_str!("../studies/fransen2022.toml");
    let end = shipped.find("[[measured]]").unwrap_or(shipped.len());
    let mut lines: Vec<String> = shipped[..end].lines().map(str::to_owned).collect();
    for line in &mut lines {
        if line.starts_with("repetitions") {
            *line = format!("repetitions = {repetitions}");
        }
        if line.starts_with("artifacts") {
            "artifacts = \"artifacts\"".clone_into(line);
        }
        if line.starts_with("validation") {
            "validation = 0".clone_into(line);
        }
    }
    lines.join("\n") + "\n[[measured]]\nname = \"paper\"\npath = \"paper.csv\"\ncomparable = true\n"
}

fn fill(study: &mut Study) -> Result<(), Box<dyn Error>> {
    run::repro(study, &run::Request { target: stages::find("sample"), ..run::Request::default() }, |_, _| {})?;
    let simulate = stages::find("simulate").ok_or("no stage simulate")?;
    let demand = (simulate.demand)(&study.context(&study.campaign(Options::default())?))?;
    let Demand::Runs(requests) = demand else { return Err("no samples".into()) };
    let store: &Store = study.store();
    let object = store.put_object(b"the final state of a run that was never made")?;
    let (runs, kpis): (Ledger<RunRecord>, Ledger<KpiRecord>) = (store.ledger("runs")?, store.ledger("kpis")?);
    for chunk in requests.chunks(CHUNK) {
        let mut run_records = Vec::new();
        let mut kpi_records = Vec::new();
        for request in chunk {
            let (record, observables) = made_up(request, object)?;
            run_records.push(record);
            kpi_records.extend(observables);
        }
        runs.append(&run_records)?;
        kpis.append(&kpi_records)?;
    }
    runs.compact()?;
    kpis.compact()?;
    println!("{} runs in {}", requests.len(), store.root().display());
    Ok(())
}

/// A finished run and its observables, varied with the seed.
fn made_up(request: &Request, object: Digest) -> Result<(RunRecord, Vec<KpiRecord>), Box<dyn Error>> {
    let settings = request.resolve()?;
    let (key, state) = (request.key(&settings)?.to_string(), object.to_string());
    let kpi_key = kpi_key(request, &key, &state, &settings)?.to_string();
    let noise = (request.seed >> 11) as f64 / (1_u64 << 53) as f64;
    let observable = |observable: &granulake::experiments::Observable| KpiRecord {
        kpi_key: kpi_key.clone(),
        kpi: observable.name.to_owned(),
        value: Some(10.0 + noise),
        unit: observable.unit.to_owned(),
        reason: None,
    };
    let kpis = request.experiment.observables().iter().map(observable).collect();
    let run = RunRecord {
        run_key: key,
        status: "ok".to_owned(),
        reason: None,
        stop: Some("energy_ratio".to_owned()),
        time_s: Some(1.0 + noise),
        steps: Some(100_000),
        inserted: Some(5_100),
        insertion_attempts: Some(400_000),
        deleted: Some(900),
        lost: Some(0),
        particles: Some(4_200),
        energy_ratio: Some(1e-6 * noise),
        coordination_number: Some(4.5 + noise),
        max_overlap: Some(0.01),
        state: Some(state.clone()),
        trace: Some(state),
    };
    Ok((run, kpis))
}
