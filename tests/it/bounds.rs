//! The stage that finds bounds of the particle density by simulation: when it runs, what it gives, what hangs on it.

use crate::support::{Study, idle};
use granulake::store::table;
use granulake::tables::list::{BOUNDS_RUNS, BoundRow};
use granulake::tables::{KpiRow, RunRow, SampleRow};

const SOUGHT: &str = "[parameters.particle_density]\n\n[bounds]\nrepetitions = 3\n\n[experiments]";
const WEIGHED: &str = "grains,particle_density,2500,30,10,kg/m3\n";

/// The quick study with another parameter, the particle density, whose grains were weighed.
fn with_density(section: &str) -> Study {
    let study = Study::quick();
    study.edit("pipeline.toml", "[experiments]", section);
    let lab = std::fs::read_to_string(study.path("lab.csv")).expect("data");
    study.write("lab.csv", &(lab + WEIGHED));
    study
}

fn bounds(study: &Study) -> [BoundRow; 2] {
    study.table::<BoundRow>().try_into().unwrap_or_else(|rows: Vec<_>| panic!("{} bounds", rows.len()))
}

fn densities(study: &Study) -> Vec<f64> {
    let rows = study.table::<SampleRow>();
    rows.into_iter().filter(|row| row.parameter == "particle_density").map(|row| row.value).collect()
}

fn lock(study: &Study) -> String {
    std::fs::read_to_string(study.path("pipeline.lock")).expect("a lock")
}

#[test]
fn bounds_that_are_given_leave_the_stage_out() {
    let study = with_density("[parameters.particle_density]\nlower = 2000\nupper = 3500\n\n[experiments]");
    assert_eq!(study.plan("bounds", &[])["state"], "skipped");
    assert_eq!(study.repro(&["sample"])["bounds"], "skipped");
    assert_eq!((study.runs(), study.status()["bounds"].as_str()), (0, "skipped"));
    assert!(!lock(&study).contains("[stage.bounds") && !study.path("artifacts/tables/bounds").exists());
    assert!(study.succeed(&["why", "bounds"]).out.contains("skipped: the study gives the bounds"));
    let plain = Study::quick();
    assert!(plain.succeed(&["why", "bounds"]).out.contains("skipped: particle_density is no parameter"));
}

#[test]
fn bounds_that_are_left_out_are_found_before_anything_is_sampled() {
    let study = with_density(SOUGHT);
    let before = study.plan("simulate", &[]);
    // Four corners, two inside, one for validation, in two experiments, twice.
    assert_eq!((before["runs"].as_u64(), before["at_most"].as_bool()), (Some(28), Some(true)), "{before}");
    let own = study.plan("bounds", &[]);
    assert_eq!((own["runs"].as_u64(), own["at_most"].as_bool()), (Some(6), Some(false)), "{own}");
    assert_eq!(study.plan("sample", &[])["why"], "after bounds");

    study.succeed(&["repro", "kpi"]);
    assert_eq!(study.runs(), 6 + 28);
    let runs: Vec<RunRow> = table::read(&study.path("artifacts"), &BOUNDS_RUNS).expect("runs");
    assert!(runs.iter().all(|run| run.label == "bounds" && run.parameter_hash.len() == 64 && run.seed != 0));
    let [lower, upper] = bounds(&study);
    assert_eq!((lower.bound.as_str(), upper.bound.as_str(), upper.measured.as_str()), ("lower", "upper", "lab"));
    for row in [&lower, &upper] {
        // Eqs 2 and 3, with 354 and 2500 kg/m3 measured.
        let wanted = 354.0 / row.simulated_mean * 2500.0;
        assert!((row.unrounded - wanted).abs() < 1e-9 * wanted && row.standard_error > 0.0 && row.count == 3);
    }
    assert!(lower.value <= lower.unrounded && lower.unrounded < lower.value + 10.0, "{lower:?}");
    assert!(upper.value >= upper.unrounded && upper.unrounded > upper.value - 10.0, "{upper:?}");
    assert!(densities(&study).iter().all(|value| (lower.value..=upper.value).contains(value)));
    assert_eq!(densities(&study).iter().filter(|value| **value == upper.value).count(), 2, "two corners");
    let plan = study.plan("simulate", &[]);
    assert_eq!((plan["new_runs"].as_u64(), plan["at_most"].as_bool()), (Some(0), Some(false)), "{plan}");
    let why = study.succeed(&["why", "sample"]).out;
    assert!(why.contains("tables/bounds/bounds.parquet") && why.contains("particle_density.lower = "), "{why}");

    let again = study.repro(&["kpi"]);
    assert!(again.values().all(|action| idle(action)), "{again:?}");
    let printed = study.succeed(&["bounds"]).out;
    assert!(
        printed.contains(&format!("lower = \"{} kg/m3\"\nupper = \"{} kg/m3\"", lower.value, upper.value)),
        "{printed}"
    );
    assert_eq!(study.runs(), 6 + 28, "the command has the runs of the stage");
}

/// More repetitions move no point of the design, so every run is kept.
#[test]
fn repetitions_leave_the_bounds_where_they_are() {
    let study = with_density(SOUGHT);
    study.succeed(&["repro", "kpi", "--reps", "3"]);
    let (runs, rows): (usize, Vec<KpiRow>) = (study.runs(), study.table());
    assert_eq!(runs, 6 + 7 * 2 * 3);
    let done = study.repro(&["kpi", "--reps", "5"]);
    assert_eq!((done["bounds"].as_str(), done["sample"].as_str()), ("fresh", "fresh"));
    assert_eq!(study.runs() - runs, 7 * 2 * 2, "two more everywhere");
    let more: Vec<KpiRow> = study.table();
    assert!(rows.iter().all(|row| more.contains(row)), "a row of three repetitions changed");
}

#[test]
fn a_measured_density_moves_the_bounds_and_all_below() {
    let study = with_density(SOUGHT);
    study.succeed(&["repro"]);
    assert_eq!(study.run(&["status"]).code, Some(0));
    let (first, outputs, runs) = (bounds(&study), study.outputs(), study.runs());
    let report = std::fs::read_to_string(study.path("artifacts/report/report.md")).expect("a report");
    assert!(report.contains("Bounds of the particle density by simulation"), "{report}");
    std::fs::remove_file(study.path("artifacts/tables/bounds/bounds.parquet")).expect("a table");
    let done = study.repro(&[]);
    assert_eq!(done["bounds"], "restored");
    assert!(done.iter().all(|(stage, action)| stage == "bounds" || action == "fresh"), "{done:?}");
    study.assert_outputs(&outputs, "a table that was deleted");

    study.edit("lab.csv", "bulk_density,354,", "bulk_density,500,");
    assert!(study.succeed(&["why", "bounds"]).out.contains("measured lab changed"));
    assert_eq!(study.status()["sample"], "waiting");
    let ran = study.ran(&["simulate"]);
    assert_eq!(ran, ["bounds", "sample", "simulate"]);
    let second = bounds(&study);
    for (old, new) in first.iter().zip(&second) {
        assert!((new.unrounded / old.unrounded - 500.0 / 354.0).abs() < 1e-12, "{old:?} {new:?}");
    }
    assert_eq!(study.runs() - runs, 28, "the design at other densities; the runs behind the bounds are the same");
    study.edit("lab.csv", "bulk_density,500,", "bulk_density,354,");
    study.succeed(&["repro"]);
    study.assert_outputs(&outputs, "back to the first density");

    // Held fast, the same bounds give the same design, and what the stage wrote goes.
    let [lower, upper] = first;
    let section = format!("[parameters.particle_density]\nlower = {:?}\nupper = {:?}\n", lower.value, upper.value);
    study.edit("pipeline.toml", "[parameters.particle_density]\n", &section);
    let runs = study.runs();
    assert_eq!(study.repro(&["simulate"])["bounds"], "skipped");
    assert_eq!(study.runs(), runs);
    assert!(!lock(&study).contains("[stage.bounds") && !study.path("artifacts/tables/bounds/bounds.parquet").exists());
    let samples = "artifacts/tables/samples/samples.parquet";
    assert!(study.outputs()[samples] == outputs[samples]);
}

#[test]
fn a_study_whose_bounds_cannot_be_found_says_so_before_anything_runs() {
    let refused = |study: &Study, arguments: &[&str], parts: &[&str]| {
        let ended = study.run(arguments);
        assert_eq!(ended.code, Some(1), "{arguments:?}: {}", ended.err);
        for part in parts {
            assert!(ended.err.contains(part), "{arguments:?} does not say {part:?} but {}", ended.err);
        }
        assert!(!study.path("artifacts").exists(), "nothing ran");
    };
    let study = with_density(SOUGHT);
    study.edit("lab.csv", WEIGHED, "");
    let remedy = "add it, or give lower and upper";
    let parts =
        ["pipeline.toml:12: `parameters.particle_density`: ", "tells the density of the grains", "(lab)", remedy];
    refused(&study, &["repro"], &parts);
    refused(&study, &["plan"], &parts);
    study.edit("lab.csv", "bulk_density,bulk_density,354,15,12,kg/m3\n", "");
    refused(&study, &["repro"], &["no measured data set holds a bulk density", remedy]);
    refused(&study, &["bounds", "--density", "2500"], &["no measured data set holds a bulk density", "--measured"]);

    let study = with_density(SOUGHT);
    study.edit("pipeline.toml", "fitted = [\"ledge\", \"bulk_density\"]", "fitted = [\"ledge\"]");
    refused(&study, &["repro"], &["`experiments.fitted`: lacks bulk_density", remedy]);
    let hidden = ["challenge", "new", "--seed", "3", "--out", "blind"];
    refused(&with_density(SOUGHT), &hidden, &["still sought; run `granulake repro bounds`"]);

    // The command only prints, so the density of the grains may be given there.
    let study = with_density(SOUGHT);
    study.edit("lab.csv", WEIGHED, "");
    assert!(study.succeed(&["bounds", "--density", "2500"]).out.contains("particle density 2500.0 kg/m3"));
}
