//! The tool as a user sees it: a tiny study in a temporary folder, run by the real binary.

use crate::support::{Study, shipped_setup};
use granulake::tables::{AggregateRow, KpiRow, RunRow, SampleRow, VerdictRow};
use std::time::{Duration, Instant};

const HEAD: &str = r#"
[study]
name = "tiny"
seed = 7
repetitions = 2
resolution = "coarse"

[parameters.sliding_friction]
lower = 0.2
upper = 0.8

[parameters.particle_density]
lower = 2500
upper = "2.8 g/cm3"

[experiments]
fitted = ["ledge", "bulk_density"]

[design]
boundary_levels = 2
interior = 3
validation = 2

[[measured]]
name = "lab"
path = "lab.csv"
comparable = true

[metamodel]
kinds = ["ibm", "sk"]
starts = 20

[calibrate]
approaches = ["m"]
starts = 20

[verify]
counts = [2]

[validate]
experiment = "pile"
repetitions = 2

[diagnose]
candidates = ["size_distribution"]
anchors = 2
anchor_repetitions = 10
refine_points = 4
refine_repetitions = 12
bootstrap = 200

"#;

const LAB: &str = "experiment,kpi,mean,sd,n,unit
ledge,angle_of_movement,33,4,12,deg
ledge,ledge_mass,2.6,0.2,12,kg
ledge,ledge_back_height,0.2,0.01,12,m
bulk_density,bulk_density,1400,15,12,kg/m3
bulk_density,cylinder_count,480,9,12,1
pile,angle_of_repose,22,4,5,deg
";

fn tiny() -> Study {
    let study = HEAD.replace("g/cm3", "kg/m3").replace("\"2.8 kg/m3\"", "2800") + &shipped_setup();
    Study::new(&[("pipeline.toml", &study), ("lab.csv", LAB)])
}

const STAGES: [&str; 10] =
    ["sample", "simulate", "kpi", "aggregate", "train", "calibrate", "verify", "validate", "diagnose", "report"];

#[test]
fn the_whole_study_runs_once_and_then_does_nothing() {
    let study = tiny();
    let first = study.succeed(&["repro"]);
    assert!(first.out.contains("report: "), "{}", first.out);
    let report = std::fs::read_to_string(study.path("artifacts/report/index.html")).expect("a report");
    assert!(report.contains("Angle of movement"));
    assert_eq!(study.table::<SampleRow>().len(), (4 + 3 + 2) * 2);
    let runs: Vec<RunRow> = study.table();
    assert_eq!(runs.len(), 9 * 2 * 2);
    assert!(runs.iter().all(|run| run.parameter_hash.len() == 64 && run.seed != 0 && run.status == "ok"));
    let verdicts: Vec<VerdictRow> = study.table();
    assert_eq!(verdicts.len(), 1);
    assert_eq!(study.run(&["status"]).code, Some(0));

    let before = study.outputs();
    let clock = Instant::now();
    let second = study.repro(&[]);
    assert!(clock.elapsed() < Duration::from_secs(1), "a repro with nothing to do took {:?}", clock.elapsed());
    assert!(STAGES.iter().all(|stage| second[*stage] == "fresh"), "{second:?}");
    assert_eq!(study.outputs(), before);

    only_new_repetitions_are_computed(&study, &before);
    a_changed_weight_leaves_the_simulations_alone(&study);
    a_damaged_table_is_found_and_made_anew(&study);
    tables_answer_queries(&study);
}

fn only_new_repetitions_are_computed(study: &Study, before: &std::collections::BTreeMap<String, Vec<u8>>) {
    let old: Vec<KpiRow> = study.table();
    let plan = study.plan("simulate", &["--reps", "3"]);
    assert_eq!((plan["runs"].as_u64(), plan["new_runs"].as_u64()), (Some(54), Some(18)), "{plan}");
    let more = study.repro(&["--reps", "3"]);
    assert_eq!(more["sample"], "fresh");
    assert_eq!(more["simulate"], "ran");
    let new: Vec<KpiRow> = study.table();
    assert!(old.iter().all(|row| new.contains(row)), "growing the repetitions changed a row");
    let aggregates: Vec<AggregateRow> = study.table();
    assert!(aggregates.iter().any(|row| row.n == 3 && row.count == 3));

    let less = study.repro(&[]);
    assert!(STAGES[1..].iter().all(|stage| less[*stage] == "restored"), "{less:?}");
    assert_eq!(&study.outputs(), before, "going back to two repetitions gives the tables of two");
}

fn a_changed_weight_leaves_the_simulations_alone(study: &Study) {
    study.edit("pipeline.toml", "approaches = [\"m\"]\n", "approaches = [\"m\"]\nc = 0.25\n");
    let why = study.succeed(&["why", "calibrate"]).out;
    assert!(why.contains("calibrate.c: 0.5 -> 0.25"), "{why}");
    let done = study.repro(&[]);
    assert!(STAGES[..5].iter().all(|stage| done[*stage] == "fresh"), "{done:?}");
    assert_eq!(done["calibrate"], "ran");
    study.edit("pipeline.toml", "c = 0.25\n", "");
    study.repro(&[]);
}

fn a_damaged_table_is_found_and_made_anew(study: &Study) {
    let before = study.outputs();
    assert_eq!(study.run(&["fsck", "--full"]).code, Some(0));
    let path = study.path("artifacts/tables/samples/samples.parquet");
    let mut bytes = std::fs::read(&path).expect("a table");
    // In the first page, behind the magic bytes: the footer stays whole.
    bytes[20] ^= 1;
    std::fs::write(&path, bytes).expect("a table");
    assert_eq!(study.run(&["fsck"]).code, Some(0), "sizes alone do not show a flipped bit");
    let full = study.run(&["fsck", "--full"]);
    assert_eq!(full.code, Some(3), "{}", full.out);
    assert!(full.out.contains("samples.parquet"), "{}", full.out);
    study.repro(&[]);
    assert_eq!(study.outputs(), before);
    assert_eq!(study.run(&["fsck", "--full"]).code, Some(0));
    assert!(study.succeed(&["gc", "--dry-run"]).out.contains("could be deleted"));
}

#[cfg(feature = "query")]
fn tables_answer_queries(study: &Study) {
    let sql = "SELECT count(*) AS n, count(DISTINCT run_key) AS runs FROM kpis WHERE kpi = 'bulk_density'";
    let answer = study.succeed(&["query", sql, "--format", "json"]).out;
    let answer: serde_json::Value = serde_json::from_str(&answer).expect("JSON");
    assert_eq!((answer[0]["n"].as_i64(), answer[0]["runs"].as_i64()), (Some(18), Some(18)), "{answer}");
    // polars counts the rows of several files in a type of its own.
    assert_eq!(study.succeed(&["query", "SELECT count(*) FROM runs", "--format", "csv"]).out, "len\n36\n");
    assert!(
        study.succeed(&["query", "SELECT * FROM verdicts", "--format", "csv"]).out.starts_with("measured,verdict,")
    );
}

#[cfg(not(feature = "query"))]
fn tables_answer_queries(study: &Study) {
    assert!(study.run(&["query", "SELECT 1"]).err.contains("without the `query` feature"));
}

#[test]
fn one_and_two_threads_give_the_same_bytes_and_a_kill_loses_nothing() {
    let (one, two) = (tiny(), tiny());
    one.succeed(&["repro", "--jobs", "1"]);
    for pause in [300, 700, 1500] {
        let mut child = two.command(&["repro", "--jobs", "2"]).spawn().expect("the binary starts");
        std::thread::sleep(Duration::from_millis(pause));
        // SIGKILL on Unix: the process has no chance to tidy up.
        child.kill().expect("a running process");
        child.wait().expect("an ended process");
    }
    two.succeed(&["repro", "--jobs", "2"]);
    let (one, two) = (one.outputs(), two.outputs());
    assert_eq!(one.keys().collect::<Vec<_>>(), two.keys().collect::<Vec<_>>());
    for (name, bytes) in &one {
        assert!(bytes == &two[name], "{name} differs");
    }
}

#[test]
fn a_single_simulation_prints_its_kpis() {
    let study = tiny();
    let arguments = ["sim", "bulk_density", "--set", "sliding_friction=0.4", "--seed", "3", "--json"];
    let ended = study.succeed(&arguments);
    let answer: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
    let density = &answer["kpis"]["bulk_density"];
    assert_eq!(density["unit"], "kg/m3");
    assert!((1000.0..2000.0).contains(&density["value"].as_f64().expect("a number")), "{answer}");
    let count = |name: &str| answer[name].as_u64().unwrap_or_else(|| panic!("{name} is a count: {answer}"));
    assert_eq!(count("inserted"), count("deleted") + count("lost") + count("particles"));
    assert!(count("insertion_attempts") > count("inserted") && count("deleted") > 0, "{answer}");
    let limit = answer["energy_ratio"].as_f64().expect("a number");
    // The words of the column `stop` of the table of runs.
    let stop = answer["stop"].as_str().expect("a word");
    assert!(["energy_ratio", "empty", "time_cap"].contains(&stop), "{answer}");
    assert!(stop != "energy_ratio" || limit < 1e-3, "{answer}");
    let underfilled = study.run(&["sim", "bulk_density", "--set", "insertion_ratio=0.2"]);
    assert_eq!(underfilled.code, Some(1));
    assert!(
        underfilled.err.contains("underfilled") && underfilled.err.contains("`insertion_ratio`"),
        "{}",
        underfilled.err
    );
    assert_eq!(study.succeed(&arguments).out, ended.out, "the same seed gives the same bytes");
    let with_zero = study.succeed(&[&arguments[..], &["--effect", "cohesion=0"]].concat()).out;
    assert_eq!(with_zero, ended.out, "strength 0 is the same as absent");
    let with = study.succeed(&[&arguments[..], &["--effect", "cohesion=1"]].concat()).out;
    assert_ne!(with, ended.out);
}

/// Frames, trace and checkpoints change no bit of a run; the last checkpoint of it goes on to the same end.
#[test]
fn a_watched_simulation_ends_with_the_same_bits() {
    use granulake::tables::columns::ColumnFile;
    let study = tiny();
    let plain = ["sim", "bulk_density", "--seed", "5", "--json"];
    let end = study.succeed(&plain).out;
    let watch =
        ["--vtk", "frames", "--trace", "out/trace.parquet", "--checkpoint", "run.checkpoint", "--every", "50 ms"];
    assert_eq!(study.succeed(&[&plain[..], &watch].concat()).out, end);
    assert_eq!(study.succeed(&[&plain[..], &["--resume", "run.checkpoint"]].concat()).out, end);
    let answer: serde_json::Value = serde_json::from_str(&end).expect("JSON");

    let trace = ColumnFile::read("run_trace", &study.path("out/trace.parquet")).expect("a trace");
    let numbers = |name: &str| trace.f64(name).unwrap_or_else(|| panic!("no column {name}")).to_vec();
    let rows = (answer["time_s"].as_f64().expect("a time") / 0.05) as usize + 2;
    assert_eq!(trace.rows(), rows);
    let units: Vec<_> = trace.columns().iter().map(|column| column.unit.as_str()).collect();
    assert_eq!(units, ["s", "J", "J", "J", "J", "kg", "1", "1", "1"]);
    let (kinetic, elastic) = (numbers("translational_energy"), numbers("elastic_energy"));
    assert_eq!(Some(kinetic[rows - 1] / elastic[rows - 1]), answer["energy_ratio"].as_f64());
    assert!(kinetic[0] < 1e-6 && elastic[0] == 0.0, "grains start at rest and apart, within half a step of falling");

    let frames = std::fs::read_to_string(study.path("frames/grains.pvd")).expect("a list of frames");
    assert_eq!(frames.matches("<DataSet").count(), rows);
    let last = std::fs::read(study.path(&format!("frames/grains_{:06}.vtp", rows - 1))).expect("the last frame");
    let particles = answer["particles"].as_u64().expect("a count");
    let head = String::from_utf8_lossy(&last);
    assert!(head.contains(&format!("NumberOfPoints=\"{particles}\"")) && head.contains("Name=\"radius_m\""), "{head}");
    // Time, points, vertices twice, id, radius, velocity, spin: a length of 8 bytes before each array.
    let body = (1 + particles * (3 + 2 + 1 + 1 + 3 + 3) + 8) * 8;
    let start = last.windows(3).position(|w| w == b">\n_").expect("data") + 3;
    let tail = b"\n</AppendedData>\n</VTKFile>\n".len();
    assert_eq!((last.len() - start - tail) as u64, body);

    let refused = |arguments: &[&str], part: &str| {
        let ended = study.run(&[&plain[..], arguments].concat());
        assert!(ended.code == Some(1) && ended.err.contains(part), "{}", ended.err);
    };
    refused(
        &["--resume", "run.checkpoint", "--set", "sliding_friction=0.3"],
        "run.checkpoint`: this checkpoint belongs to another",
    );
    refused(&["--resume", "out/trace.parquet"], "trace.parquet`: this is no whole checkpoint");
    refused(&["--resume", "absent"], "`absent`: ");
}

/// The end of a run, written as a table and measured as if another engine had made it, has the observables of the run.
#[test]
fn grains_of_any_engine_are_measured_as_our_own() {
    let study = tiny();
    let written = ["--particles", "grains.csv", "--flow", "flow.csv", "--json"];
    let answer = |text: &str| serde_json::from_str::<serde_json::Value>(text).expect("JSON");
    let soft = ["--set", "pile.time_cap=0.8 s", "--set", "particle_density=2600"];
    let run = study.run(&[&["sim", "pile", "--seed", "3"][..], &soft, &written].concat());
    let measured = study.run(&[&["measure", "pile"][..], &soft, &written].concat());
    assert_eq!(run.code, measured.code, "{}", measured.err);
    let (run, measured) = (answer(&run.out), answer(&measured.out));
    assert_eq!(run["particles"], measured["particles"]);
    let kpis = run["kpis"].as_object().expect("observables");
    assert!(kpis.len() == 8 && kpis["pile_t50"]["value"].is_f64(), "{run}");
    for (name, entry) in kpis {
        let found = &measured["kpis"][name];
        match (entry["value"].as_f64(), found["value"].as_f64()) {
            // Times count from the release in the file, so that they are rounded once more.
            (Some(value), Some(other)) => assert!((value / other - 1.0).abs() < 1e-12, "{name}: {value} {other}"),
            _ => assert_eq!(entry, found, "{name}"),
        }
    }
    let rows = study
        .run(&[&["measure", "pile"][..], &soft, &["--particles", "grains.csv", "grains.csv", "--csv"]].concat())
        .out;
    assert!(rows.starts_with("experiment,repetition,kpi,value,unit\npile,1,"), "{rows}");
    assert!(rows.contains("\npile,2,pile_shelf_mass,") && !rows.contains("pile_t50"), "{rows}");
    let refused = |arguments: &[&str], part: &str| {
        let ended = study.run(&[&["measure"][..], arguments].concat());
        assert!(ended.code == Some(1) && ended.err.contains(part), "{arguments:?}: {}", ended.err);
    };
    refused(&["pile"], "nothing to measure; give --particles, --flow or both");
    refused(&["pile", "--particles", "flow.csv"], "flow.csv:1: unknown column `time`");
    refused(&["pile", "--particles", "absent.csv"], "absent.csv: cannot be read");
    refused(
        &["pile", "--particles", "grains.csv", "grains.csv", "--flow", "flow.csv"],
        "2 files of grains and 1 of flow",
    );
    refused(&["hopper", "--particles", "grains.csv"], "--particles shows nothing of hopper; give --flow");
}

#[test]
fn mistakes_are_told_with_place_and_remedy() {
    let study = tiny();
    let message = |arguments: &[&str], code: i32, parts: &[&str]| {
        let ended = study.run(arguments);
        assert_eq!(ended.code, Some(code), "{arguments:?}: {}", ended.err);
        for part in parts {
            assert!(ended.err.contains(part), "{arguments:?} does not say {part:?} but {}", ended.err);
        }
    };
    message(&["repro", "trian"], 1, &["no stage is called `trian`", "train"]);
    message(&["sim", "heap"], 1, &["no experiment is called `heap`", "pile"]);
    message(&["sim", "pile", "--set", "sliding_fricton=0.3"], 1, &["sliding_friction"]);
    message(&["sim", "pile", "--set", "pile.depth=3 kg"], 1, &["kg"]);
    // Before the run, not after it.
    message(&["sim", "bulk_density", "--particles", "grains.csv", "--flow", "flow.csv"], 1, &["leave --flow out"]);
    assert!(!study.path("grains.csv").exists());
    message(&["--study", "absent.toml", "status"], 1, &["absent.toml", "granulake init"]);
    message(&["repro", "--reps", "0"], 1, &["--reps"]);
    message(&["frobnicate"], 2, &["unrecognized subcommand"]);
    study.edit("pipeline.toml", "[design]", "[desing]");
    message(&["plan"], 1, &["pipeline.toml:", "desing", "design"]);
    study.edit("pipeline.toml", "[desing]", "[design]");
    study.edit("lab.csv", "1400,15,12,kg/m3", "NaN,15,12,kg/m3");
    message(&["repro"], 1, &["lab.csv:5", "NaN"]);
}

#[test]
fn init_writes_a_study_that_plans() {
    let study = Study::new(&[]);
    study.succeed(&["init", "new study"]);
    let again = study.run(&["init", "new study"]);
    assert_eq!(again.code, Some(1));
    assert!(again.err.contains("nothing that exists is overwritten"), "{}", again.err);
    let plan = study.succeed(&["--study", "new study/pipeline.toml", "plan"]).out;
    assert!(plan.contains("sample") && plan.contains("never ran"), "{plan}");
}

#[test]
fn the_full_study_plans() {
    let study = Study::new(&[
        ("studies/fransen2022.toml", include_str!("../../studies/fransen2022.toml")),
        ("artifacts/measured/fransen2022.csv", include_str!("../../artifacts/measured/fransen2022.csv")),
    ]);
    let ended = study.succeed(&["--study", "studies/fransen2022.toml", "plan", "--json"]);
    let plan: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
    let runs = |stage: &str| {
        let row = plan.as_array().expect("rows").iter().find(|row| row["stage"] == stage).expect("the stage");
        assert!(row["cpu_hours"].as_f64().is_some_and(|hours| hours > 0.0), "{row}");
        (row["runs"].as_u64().expect("a number"), row["at_most"].as_bool().expect("a flag"))
    };
    // Nothing was ever simulated, not even the design is drawn.
    assert_eq!(runs("simulate"), ((27 + 100 + 32) * 50 * 3, false));
    let verified: u64 = (1..=10).chain([15, 20, 30, 40, 50]).sum();
    let methods = 3 * 2;
    assert_eq!(runs("verify"), (methods * verified * 3, true));
    assert_eq!(runs("validate"), (methods * 15 * 5, true));
}
