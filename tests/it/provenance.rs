//! By what and at what cost results were made stands beside them, and in none of them.

use crate::support::Study;
use granulake::campaign::PROVENANCE;
use granulake::store::Lock;
use granulake::tables::{ProvenanceRow, RunRow};

fn provenance(study: &Study) -> Vec<ProvenanceRow> {
    study.store().ledger::<ProvenanceRow>(PROVENANCE).expect("a ledger").rows().collect()
}

#[test]
fn every_run_and_every_stage_has_its_provenance() {
    let study = Study::quick();
    study.succeed(&["repro"]);
    let rows = provenance(&study);
    let of = |key: &str| rows.iter().find(|row| row.key == key).expect("a provenance");
    for run in study.table::<RunRow>() {
        let row = of(&run.run_key);
        assert_eq!((row.subject.as_str(), &row.name), ("run", &run.experiment));
        assert!(row.cpu_s.is_some_and(|cpu| cpu > 0.0) && row.wall_s > 0.0);
        assert_eq!(row.version, env!("CARGO_PKG_VERSION"));
        assert!(row.compiler.starts_with("rustc ") && !row.commit.is_empty() && !row.processor.is_empty());
    }
    let lock = Lock::read(&study.path("pipeline.lock")).expect("a lock");
    assert!(!lock.stages.is_empty());
    for (name, stage) in &lock.stages {
        let row = of(&stage.key.to_string());
        assert_eq!((row.subject.as_str(), &row.name), ("stage", name));
    }

    // What is up to date or put back costs nothing, so it leaves no row.
    study.succeed(&["repro"]);
    assert_eq!(provenance(&study), rows);
}

#[cfg(feature = "query")]
#[test]
fn provenance_answers_queries() {
    let study = Study::quick();
    study.succeed(&["repro", "simulate"]);
    let sql = "SELECT subject, count(*) AS n FROM provenance GROUP BY subject ORDER BY subject";
    assert_eq!(study.succeed(&["query", sql, "--format", "csv"]).out, "subject,n\nrun,20\nstage,2\n");
}
