//! Failures are data: a run without a result is a row with a reason, and everything else goes on.

use crate::support::{Study, idle};
use granulake::campaign::RunRecord;
use granulake::tables::{AggregateRow, KpiRow, RunRow};

/// A quick study whose runs of the ledge need different numbers of steps, because they end when they come to rest.
fn uneven() -> Study {
    let study = Study::quick();
    study.edit("pipeline.toml", "stop_energy_ratio = 1e-3", "stop_energy_ratio = 0.8");
    study
}

#[test]
fn a_limit_of_steps_makes_typed_failures_and_the_rest_goes_on() {
    let study = uneven();
    study.succeed(&["repro"]);
    let (whole, stored) = (study.outputs(), study.runs());
    let steps: Vec<u64> = study.table::<RunRow>().iter().filter_map(|run| run.steps).collect();
    let limit = steps.iter().max().expect("steps") - 1;
    let long = steps.iter().filter(|steps| **steps > limit).count();
    assert!(long < 5, "the longest run is one of few, not of {long}");

    study.edit("pipeline.toml", "seed = 7", &format!("seed = 7\nstep_limit = {limit}"));
    let stopped = study.run(&["repro", "--keep-going=false"]);
    assert_eq!(stopped.code, Some(1), "{}", stopped.err);
    assert!(stopped.err.contains("simulations of stage simulate failed"), "{}", stopped.err);
    assert!(!stopped.err.contains("\ntrain"), "nothing after it ran: {}", stopped.err);
    let ended = study.run(&["repro", "--keep-going"]);
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    let known = study.plan("simulate", &[]);
    assert_eq!((known["new_runs"].as_u64(), study.runs() >= stored), (Some(0), true), "{known}");
    failed_rows_keep_their_place(&study, limit, long);
    let report = std::fs::read_to_string(study.path("artifacts/report/report.md")).expect("a report");
    assert!(report.contains("Observables with fewer than 2 values"), "the report says what that does to n");
    assert!(report.contains("needs more than"), "the report says why");
    assert_eq!(study.run(&["status"]).code, Some(0), "failed rows are results");

    // The same limit from the start gives the same tables, and taking it away gives back the whole ones.
    let other = uneven();
    other.edit("pipeline.toml", "seed = 7", &format!("seed = 7\nstep_limit = {limit}"));
    assert_eq!(other.run(&["repro"]).code, Some(4));
    other.assert_outputs(&study.outputs(), "the limit was there from the start");
    for study in [&other, &study] {
        study.edit("pipeline.toml", &format!("\nstep_limit = {limit}"), "");
        study.succeed(&["repro"]);
        study.assert_outputs(&whole, "the limit was taken away");
    }
}

fn failed_rows_keep_their_place(study: &Study, limit: u64, long: usize) {
    let failed: Vec<RunRow> = study.table::<RunRow>().into_iter().filter(|run| run.status == "failed").collect();
    assert_eq!(failed.len(), long);
    assert!(failed.iter().all(|run| run.stop.as_deref() == Some("step_limit") && run.state.is_none()));
    let (kpis, aggregates) = (study.table::<KpiRow>(), study.table::<AggregateRow>());
    for run in &failed {
        let reason = run.reason.as_deref().expect("a reason");
        assert!(reason.starts_with(&format!("needs more than {limit} time steps")), "{reason}");
        let own: Vec<&KpiRow> = kpis.iter().filter(|kpi| kpi.run_key == run.run_key).collect();
        assert!(!own.is_empty(), "a failed run has rows of observables");
        assert!(own.iter().all(|kpi| kpi.value.is_none() && kpi.reason.as_ref().is_some_and(|r| r.contains(reason))));
        let alike =
            failed.iter().filter(|other| (&other.experiment, other.point) == (&run.experiment, run.point)).count();
        let of_point = |row: &&AggregateRow| row.experiment == run.experiment && row.point == run.point && row.n == 2;
        assert!(aggregates.iter().filter(of_point).all(|row| row.count == 2 - alike as u32), "n less what failed");
    }
}

#[test]
fn a_failed_run_is_tried_again_on_demand_only() {
    let study = Study::quick();
    study.succeed(&["repro"]);
    let whole = study.outputs();
    let run = study.table::<RunRow>().swap_remove(3);
    // As if the run had exploded: its record, and nothing that was made of it.
    {
        let store = study.store();
        let ledger = store.ledger::<RunRecord>("runs").expect("a ledger");
        let record = ledger.get(&run.run_key).expect("a run").swap_remove(0);
        let reason = Some("exploded at step 12".to_owned());
        let failed = RunRecord { status: "failed".into(), reason, stop: None, state: None, trace: None, ..record };
        ledger.replace(&[failed]).expect("a writable ledger");
        ledger.compact().expect("a writable ledger");
    }
    std::fs::remove_dir_all(study.path("artifacts/ledger/stages")).expect("a ledger");
    std::fs::remove_dir_all(study.path("artifacts/tables")).expect("tables");
    std::fs::remove_file(study.path("pipeline.lock")).expect("a lock");

    assert_eq!(study.run(&["repro"]).code, Some(4));
    let failed = |study: &Study| study.table::<RunRow>().iter().filter(|run| run.status == "failed").count();
    assert_eq!(failed(&study), 1);
    let again = study.run(&["repro"]);
    assert_eq!((again.code, failed(&study)), (Some(4), 1), "a failure is not tried again by itself");
    let retried = study.run(&["repro", "--retry-failed"]);
    assert_eq!((retried.code, failed(&study)), (Some(0), 0), "{}", retried.err);
    study.assert_outputs(&whole, "after the failed run came to its end");
    let done = study.repro(&["--retry-failed"]);
    assert!(done.values().all(|action| idle(action)), "there is nothing to try again: {done:?}");
}

#[test]
fn an_experiment_that_always_fails_stops_nothing() {
    let study = Study::quick();
    study.edit("pipeline.toml", "seed = 7", "seed = 7\nstep_limit = 1");
    let ended = study.run(&["repro"]);
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    assert!(study.table::<RunRow>().iter().all(|run| run.status == "failed"));
    assert!(study.path("artifacts/report/index.html").is_file());
}

mod earlier {
    granulake::table! {
        /// What a stage gave, as an earlier version kept it.
        pub struct OutputRecord in "ledger_stages" version 1 keyed by stage_key sorted by (stage_key) {
            /// Key of the stage.
            stage_key: String [""],
        }
    }
}

/// What a store no longer counts is said by every command that looks at it, and nothing is deleted on such ground.
#[test]
fn rows_that_count_as_missing_are_told_to_the_user() {
    let study = Study::quick();
    let row = earlier::OutputRecord { stage_key: granulake::canonical::Digest::of_content(b"a stage").to_string() };
    study.store().ledger::<earlier::OutputRecord>("stages").and_then(|l| l.append(&[row])).expect("an old ledger");
    let said = "was written by an earlier version of this program";
    assert!(study.run(&["status"]).err.contains(said));
    assert!(study.run(&["fsck"]).out.contains(said));
    let ended = study.succeed(&["repro", "--json"]);
    assert!(ended.err.contains(&format!("{said}; its keys count as missing, it was moved to")), "{}", ended.err);
    let done: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
    assert_eq!(done["warnings"].as_array().map(Vec::len), Some(1), "{done}");
    let status = study.run(&["status"]);
    assert!(
        status.code == Some(0) && status.err.contains("1 damaged or outdated files were set aside"),
        "{}",
        status.err
    );
    assert!(study.succeed(&["gc", "--delete"]).out.contains("damaged file: 1 files"));
    assert_eq!(study.run(&["status"]).err, "");
    assert_eq!(study.run(&["repro"]).err.matches("warning").count(), 0);
}

/// A ledger that lost rows no longer knows which states are needed: nothing goes until `fsck` has looked.
#[test]
fn nothing_is_deleted_while_a_ledger_has_lost_rows() {
    let study = Study::quick();
    study.succeed(&["repro"]);
    let (outputs, runs) = (study.outputs(), study.runs());
    let folder = study.path("artifacts/ledger/runs");
    let files = || std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let part = files().find(|path| path.extension().is_some_and(|end| end == "parquet")).expect("a part");
    let bytes = std::fs::read(&part).expect("bytes");
    std::fs::write(&part, &bytes[..bytes.len() / 2]).expect("half of it");
    assert!(study.run(&["status"]).err.contains("is truncated or altered"));
    let refused = study.run(&["gc", "--delete"]);
    assert!(refused.code == Some(1) && refused.err.contains("granulake fsck"), "{}", refused.err);
    assert_eq!(study.run(&["fsck"]).code, Some(3), "the damaged part is missing");
    study.succeed(&["gc", "--delete"]);
    study.succeed(&["repro"]);
    study.assert_outputs(&outputs, "after the ledger was damaged");
    assert_eq!(study.runs(), runs, "every run in a table was taken back or made again");
}
