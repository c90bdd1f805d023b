//! A store with many finished runs that nobody simulated, for `lake_scale.sh`.
//!
//! `cargo bench --bench lake_scale -- FOLDER N POINTS` writes a study of so many points in three experiments with
//! N/(3 POINTS) repetitions and ledgers that hold a made-up record of every run: the scale of the paper's study for
//! N = 19,050 and 127 points. `… -- FOLDER more` asks for one repetition more and makes up its records, as a campaign
//! leaves them. Everything from `repro simulate` on is then done by the real binary.

use granulake::campaign::{KpiRecord, Options, PROVENANCE, Request, RunRecord, kpi_key};
use granulake::canonical::Digest;
use granulake::pipeline::{Study, run};
use granulake::stages::{self, Demand};
use granulake::store::{Ledger, Store};
use granulake::tables::ProvenanceRow;
use std::error::Error;
use std::path::Path;

/// Fitted experiments of the study.
const EXPERIMENTS: u32 = 3;
/// Points on the boundary of the design.
const BOUNDARY: u32 = 27;
/// Records appended at a time.
const CHUNK: usize = 20_000;

fn main() -> Result<(), Box<dyn Error>> {
    // cargo passes `--bench` on to the binary.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        [folder, "more"] => grow(&Path::new(folder).join("pipeline.toml")),
        [folder, runs, points] => start(Path::new(folder), runs.parse()?, points.parse()?),
        _ => {
            println!("lake_scale: no folder given, nothing to do; see benches/lake_scale.sh");
            Ok(())
        }
    }
}

/// Writes the study and its ledgers.
fn start(folder: &Path, runs: u32, points: u32) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    std::fs::write(folder.join("paper.csv"), include_str!("../artifacts/measured/fransen2022.csv"))?;
    let path = folder.join("pipeline.toml");
    std::fs::write(&path, study((runs / (EXPERIMENTS * points)).max(1), points.saturating_sub(BOUNDARY)))?;
    let mut study = Study::load(&path)?;
    run::repro(&mut study, &run::Request { target: stages::find("sample"), ..run::Request::default() }, |_, _| {})?;
    let requests = requests(&study)?;
    make_up(study.store(), &requests)?;
    study.campaign(Options::default())?.compact()?;
    println!("{} runs in {}", requests.len(), study.store().root().display());
    Ok(())
}

/// One repetition more of every point.
fn grow(path: &Path) -> Result<(), Box<dyn Error>> {
    let study = Study::load(path)?;
    study.store().claim()?;
    let before = study.config.study.repetitions;
    drop(study);
    let text = std::fs::read_to_string(path)?;
    let line = |repetitions: u32| format!("repetitions = {repetitions}\n");
    std::fs::write(path, text.replacen(&line(before), &line(before + 1), 1))?;
    let study = Study::load(path)?;
    let new: Vec<Request> = requests(&study)?.into_iter().filter(|request| request.repetition == before + 1).collect();
    make_up(study.store(), &new)?;
    println!("{} runs more in {}", new.len(), study.store().root().display());
    Ok(())
}

fn study(repetitions: u32, interior: u32) -> String {
    let shipped = include_str!("../studies/fransen2022.toml");
    let end = shipped.find("[[measured]]").unwrap_or(shipped.len());
    let changed = [
        ("repetitions", format!("repetitions = {repetitions}")),
        ("artifacts", "artifacts = \"artifacts\"".to_owned()),
        // Spreading thousands of points well would take longer than all the rest.
        ("interior", format!("interior = {interior}\nfilling = \"sobol\"")),
        ("validation", "validation = 0".to_owned()),
    ];
    let line = |line: &str| {
        let new = changed.iter().find(|(name, _)| line.starts_with(name));
        new.map_or_else(|| line.to_owned(), |(_, new)| new.clone())
    };
    let lines: Vec<String> = shipped[..end].lines().map(line).collect();
    lines.join("\n") + "\n[[measured]]\nname = \"paper\"\npath = \"paper.csv\"\ncomparable = true\n"
}

/// The runs that the study asks for.
fn requests(study: &Study) -> Result<Vec<Request>, Box<dyn Error>> {
    let simulate = stages::find("simulate").ok_or("no stage simulate")?;
    match (simulate.demand)(&study.context(&study.campaign(Options::default())?))? {
        Demand::Runs(requests) => Ok(requests),
        Demand::Besides(..) | Demand::AtMost(_) => Err("not all runs are asked for".into()),
    }
}

/// Puts a record of each of these runs into the ledgers.
fn make_up(store: &Store, requests: &[Request]) -> Result<(), Box<dyn Error>> {
    let object = store.put_object(b"the final state of a run that was never made")?;
    let (runs, kpis): (Ledger<RunRecord>, Ledger<KpiRecord>) = (store.ledger("runs")?, store.ledger("kpis")?);
    let provenance: Ledger<ProvenanceRow> = store.ledger(PROVENANCE)?;
    for chunk in requests.chunks(CHUNK) {
        let (mut run_records, mut kpi_records, mut costs) = (Vec::new(), Vec::new(), Vec::new());
        for request in chunk {
            let (record, observables) = made_up(request, object)?;
            costs.push(cost(&record, request));
            run_records.push(record);
            kpi_records.extend(observables);
        }
        runs.append(&run_records)?;
        kpis.append(&kpi_records)?;
        provenance.replace(&costs)?;
    }
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

/// What the run cost.
fn cost(record: &RunRecord, request: &Request) -> ProvenanceRow {
    let noise = record.time_s.unwrap_or_default();
    ProvenanceRow {
        key: record.run_key.clone(),
        subject: "run".to_owned(),
        name: request.experiment.name().to_owned(),
        wall_s: 60.0 * noise,
        cpu_s: Some(59.0 * noise),
        version: "0.1.0".to_owned(),
        commit: "none".to_owned(),
        compiler: "none".to_owned(),
        target: "none".to_owned(),
        processor: "none".to_owned(),
    }
}
