//! What a change runs again, counted: exactly the stages and simulations below it.

use crate::support::Study;
use granulake::stages::STAGES;
use granulake::store::{Lock, Output};
use granulake::tables::{AggregateRow, SampleRow};
use std::collections::BTreeSet;

/// Runs of the quick study: 5 points, 2 repetitions, 2 fitted experiments.
const DESIGN_RUNS: usize = 5 * 2 * 2;

/// A finished quick study.
fn finished() -> Study {
    let study = Study::quick();
    study.succeed(&["repro"]);
    study
}

/// Changes the study; gives the stages that ran for it and the number of new runs.
fn change(study: &Study, from: &str, to: &str) -> (Vec<&'static str>, usize) {
    let before = study.runs();
    study.edit("pipeline.toml", from, to);
    (study.ran(&[]), study.runs() - before)
}

/// The simulations that `plan` announces for a stage.
fn planned(study: &Study, stage: &str) -> (u64, u64) {
    let plan = study.plan(stage, &[]);
    (plan["runs"].as_u64().expect("a number"), plan["new_runs"].as_u64().expect("a number"))
}

#[test]
fn repetitions_grow_and_shrink_without_waste() {
    let study = Study::quick();
    study.succeed(&["repro", "simulate"]);
    assert_eq!((study.runs(), planned(&study, "simulate")), (DESIGN_RUNS, (20, 0)));
    study.edit("pipeline.toml", "repetitions = 2\nresolution", "repetitions = 3\nresolution");
    assert_eq!(planned(&study, "simulate"), (30, 10));
    let done = study.repro(&["simulate"]);
    assert_eq!((done["sample"].as_str(), done["simulate"].as_str()), ("fresh", "ran"));
    assert_eq!(study.runs() - DESIGN_RUNS, 10, "one repetition of every point in both experiments");

    let study = finished();
    let two = study.outputs();
    study.edit("pipeline.toml", "repetitions = 2\nresolution", "repetitions = 3\nresolution");
    study.succeed(&["repro"]);

    let runs = study.runs();
    study.edit("pipeline.toml", "repetitions = 3\nresolution", "repetitions = 2\nresolution");
    let done = study.repro(&[]);
    // Neither the design nor what was measured depends on the repetitions.
    let same = |stage: &str| stage == "sample" || stage == "analyse";
    let expected = |stage: &str| match stage {
        "bounds" => "skipped",
        stage if same(stage) => "fresh",
        _ => "restored",
    };
    assert!(STAGES.iter().all(|stage| done[stage.name] == expected(stage.name)), "{done:?}");
    study.assert_outputs(&two, "back to two repetitions");
    assert_eq!(study.runs(), runs);

    // Shrinking to what was never asked for computes no simulation of the design either.
    let one = Study::quick();
    for study in [&study, &one] {
        study.edit("pipeline.toml", "repetitions = 2\nresolution", "repetitions = 1\nresolution");
        study.edit("pipeline.toml", "counts = [2]", "counts = [1]");
    }
    assert_eq!(planned(&study, "simulate"), (10, 0));
    study.succeed(&["repro"]);
    one.succeed(&["repro"]);
    study.assert_outputs(&one.outputs(), "shrunk to one repetition, which was asked for at once elsewhere");
}

#[test]
fn a_repetition_more_rewrites_one_part_and_gives_the_bytes_of_a_study_made_at_once() {
    let study = Study::quick();
    // Path, digest and size of every output.
    let outputs = || -> Vec<(String, Output)> {
        let lock = Lock::read(&study.path("pipeline.lock")).expect("a lock");
        lock.outputs().map(|(_, path, output)| (path.to_owned(), *output)).collect()
    };
    let parts = || -> BTreeSet<String> {
        outputs().into_iter().map(|(path, _)| path).filter(|path| path.contains("/part-")).collect()
    };
    // One point gets a run of its own, which counts at the largest number of repetitions only.
    study.write("points.csv", "sliding_friction,extra_repetitions\n0.5,1\n");
    study.edit("pipeline.toml", "validation = 1", "validation = 1\npoints = \"points.csv\"");
    study.succeed(&["repro", "aggregate", "--reps", "9"]);
    let nine = parts();
    study.succeed(&["repro", "aggregate", "--reps", "10"]);
    let ten = parts();
    // In two experiments runs and observables of 1..=8 and 9..=10, where ten is the extra run alone, then 11 as well; and
    // aggregates of 1..=8 and 9, then 9..=10.
    assert_eq!((nine.len(), ten.len(), nine.intersection(&ten).count()), (12, 16, 6), "{nine:?}\n{ten:?}");

    // Made anew from the ledgers every part is the same, or this says so.
    let grown = outputs();
    for stage in ["simulate", "kpi", "aggregate"] {
        study.succeed(&["repro", stage, "--reps", "10", "--force"]);
    }
    assert_eq!(outputs(), grown);
    let aggregates: Vec<AggregateRow> = study.table();
    let of_chosen = |n: u32| aggregates.iter().filter(move |row| row.n == n && row.count > n).count();
    assert_eq!((of_chosen(8), of_chosen(9)), (0, 0));
    assert!(of_chosen(10) > 0, "the extra run counts at the largest n");
}

#[test]
fn an_added_point_costs_one_point() {
    let study = finished();
    study.edit("pipeline.toml", "validation = 1", "validation = 1\nadded = 1");
    let runs = study.runs();
    assert_eq!(planned(&study, "simulate"), (24, 4), "the design as it will be, not the one that was written");
    study.succeed(&["repro", "simulate"]);
    assert_eq!(study.runs() - runs, 4, "two repetitions in two experiments");
    study.edit("pipeline.toml", "added = 1", "added = 3");
    study.succeed(&["repro", "simulate"]);
    assert_eq!(study.runs() - runs, 12, "the first added point stays where it is");
}

/// Where the optima will be is not known before calibration, how many runs they take is.
#[test]
fn runs_at_the_optima_are_foreseen() {
    let study = Study::quick();
    let foreseen: Vec<_> = ["simulate", "verify", "validate"].map(|stage| planned(&study, stage)).to_vec();
    // One metamodel and approach at n = 2: two runs in two fitted experiments, two held-out ones.
    assert_eq!(foreseen, [(20, 20), (4, 4), (2, 2)]);
    assert!(study.succeed(&["plan"]).out.contains("<=4"));
    study.succeed(&["repro"]);
    assert_eq!(
        ["simulate", "verify", "validate"].map(|stage| planned(&study, stage)).to_vec(),
        [(20, 0), (4, 0), (2, 0)]
    );
    study.edit("pipeline.toml", "[verify]", "[calibrate.weights]\nbulk_density = 0.25\n\n[verify]");
    assert_eq!(planned(&study, "verify"), (4, 4), "the optimum of other weights is another one");
}

#[test]
fn a_design_without_a_boundary_is_a_plain_hypercube() {
    let study = Study::quick();
    study.edit("pipeline.toml", "boundary_levels = 2", "boundary_levels = 0");
    study.edit("pipeline.toml", "interior = 2", "interior = 6");
    study.succeed(&["repro", "sample"]);
    let rows = study.table::<SampleRow>();
    assert_eq!(rows.iter().filter(|row| row.set == "interior").count(), 6);
    assert!(rows.iter().all(|row| row.set != "boundary"));
}

#[test]
fn a_weight_leaves_all_before_the_calibration_alone() {
    let study = finished();
    let (ran, _) = change(&study, "[verify]", "[calibrate.weights]\nbulk_density = 0.25\n\n[verify]");
    assert_eq!(ran.first(), Some(&"calibrate"));
    assert!(!ran.contains(&"diagnose"), "the diagnosis weighs by scatter: {ran:?}");
    assert_eq!(ran.last(), Some(&"report"));
}

#[test]
fn a_new_candidate_costs_its_own_anchors() {
    let study = finished();
    let runs = study.runs();
    assert_eq!(planned(&study, "diagnose"), (6 + 4, 0), "the centre and the anchor");
    study.edit("pipeline.toml", "[\"size_distribution\"]", "[\"cohesion\", \"size_distribution\"]");
    assert_eq!(planned(&study, "diagnose"), (6 + 8, 4), "one anchor more");
    let (ran, new) = change(&study, "[\"cohesion\", \"size", "[\"cohesion\", \"size");
    assert_eq!(ran, ["diagnose", "report"]);
    // One anchor twice and the effect's own optimum three times, in two experiments, are the most that it can take.
    assert!((4..=4 + 12).contains(&new), "{new} new runs");
    let back = study.runs();
    study.edit("pipeline.toml", "[\"cohesion\", ", "[");
    assert_eq!(study.repro(&[])["diagnose"], "restored");
    assert_eq!((study.runs(), back - runs), (back, new));
}

#[test]
fn a_new_measured_row_leaves_the_metamodels_alone() {
    let study = finished();
    study.edit("lab.csv", "pile,", "ledge,ledge_back_height,0.1,0.01,12,m\npile,");
    let why = study.succeed(&["why", "calibrate"]).out;
    assert!(why.contains("measured lab changed"), "{why}");
    let ran = study.ran(&[]);
    assert_eq!(ran[..3], ["analyse", "feasibility", "calibrate"]);
    assert!(ran.contains(&"diagnose") && ran.contains(&"report") && !ran.contains(&"train"), "{ran:?}");
}

#[test]
fn a_dimension_runs_its_own_experiment_again() {
    let study = finished();
    let before = study.runs();
    study.edit(
        "pipeline.toml",
        "fill_height = 0.06\ndeletion_time = 0.1\ntime_cap = 0.15",
        "fill_height = 0.05\ndeletion_time = 0.1\ntime_cap = 0.15",
    );
    assert!(study.succeed(&["why", "simulate"]).out.contains("setup.bulk_density.fill_height: 0.06 -> 0.05"));
    assert_eq!(planned(&study, "simulate"), (20, 10));
    assert_eq!(study.repro(&["simulate"])["sample"], "fresh");
    assert_eq!(study.runs() - before, DESIGN_RUNS / 2, "the ledge keeps its runs");
}

#[test]
fn a_dimension_of_the_held_out_experiment_leaves_the_fit_alone() {
    let study = finished();
    let (ran, new) = change(&study, "drop_height = 0.1", "drop_height = 0.11");
    assert_eq!(ran, ["validate", "diagnose", "report"]);
    // Twice at the calibrated optimum, twice at the diagnosed one, twice more if an effect was added.
    assert!((4..=6).contains(&new), "{new} new runs");
}

#[test]
fn a_setting_of_the_measurement_moves_no_grain() {
    let study = finished();
    let (ran, new) = change(&study, "[setup.ledge]\n", "[setup.ledge]\nwindow_end = 0.2\n");
    assert_eq!(ran.first(), Some(&"kpi"), "{ran:?}");
    // The optima may move with the measurement, and are verified again then; the design is simulated once.
    assert_eq!(planned(&study, "simulate"), (20, 0));
    assert!(new <= 40, "{new} new runs");
}

#[test]
fn a_setting_of_an_experiment_that_is_not_in_the_study_changes_only_what_the_report_says() {
    let study = finished();
    assert_eq!(change(&study, "[setup.ledge]", "[setup.hopper]\nslot = 0.2\n\n[setup.ledge]"), (vec!["report"], 0));
    assert_eq!(change(&study, "comparable = true", "comparable = true\nnote = \"by hand\""), (vec!["report"], 0));
    assert_eq!(change(&study, "name = \"quick\"", "name = \"quick-2\""), (vec!["report"], 0));
}

#[test]
fn a_removed_experiment_simulates_nothing_new_in_the_design() {
    let study = finished();
    let before = study.runs();
    study.edit("pipeline.toml", "fitted = [\"ledge\", \"bulk_density\"]", "fitted = [\"ledge\"]");
    assert_eq!(planned(&study, "simulate"), (10, 0));
    let done = study.repro(&["aggregate"]);
    assert_eq!((done["sample"].as_str(), done["simulate"].as_str(), done["kpi"].as_str()), ("fresh", "ran", "ran"));
    assert_eq!(study.runs(), before);
    study.succeed(&["repro"]);
}

/// The diagnosis trains metamodels of its own, so what trains metamodels makes it stale even if the tables of `train`
/// come out the same.
#[test]
fn a_setting_of_the_metamodels_reaches_the_diagnosis() {
    let study = finished();
    let (ran, _) = change(&study, "kinds = [\"sk\"]\nstarts = 4", "kinds = [\"sk\"]\nstarts = 5");
    assert!(ran.contains(&"train") && ran.contains(&"diagnose"), "{ran:?}");
}

#[test]
fn two_studies_in_one_store_share_runs_and_do_not_take_each_others_tables_for_theirs() {
    let study = finished();
    let (first, runs) = (study.outputs(), study.runs());
    let text = std::fs::read_to_string(study.path("pipeline.toml")).expect("a study");
    study.write("second.toml", &text.replace("\"quick\"", "\"second\""));
    study.succeed(&["--study", "second.toml", "repro"]);
    assert_eq!(study.runs(), runs, "the same settings under another name");

    // Another seed gives tables of the same shape, some of the very same size, but other numbers.
    study.write("second.toml", &text.replace("seed = 7", "seed = 8"));
    let second = study.succeed(&["--study", "second.toml", "repro"]);
    assert!(study.runs() > runs);
    study.assert_nothing_fresh_is_wrong(&first, "the other study's tables lie there");
    assert_eq!(study.run(&["status"]).code, Some(3));
    let done = study.repro(&[]);
    assert!(done.values().all(|action| action != "ran"), "{done:?}");
    study.assert_outputs(&first, "after another study in the same store");
    assert_eq!(study.run(&["--study", "second.toml", "repro"]).code, second.code);
}
