//! `diff` and `gc`: earlier results beside present ones, for as long as something refers to them.

use crate::support::Study;
use std::process::Command;

fn finished() -> Study {
    let study = Study::quick();
    study.succeed(&["repro"]);
    study
}

fn git(study: &Study, arguments: &[&str]) {
    let identity = ["-c", "user.name=Test", "-c", "user.email=test@example.org", "-c", "commit.gpgsign=false"];
    let output = Command::new("git").args(identity).args(arguments).current_dir(study.path(".")).output().expect("git");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

fn diff(study: &Study, arguments: &[&str]) -> serde_json::Value {
    serde_json::from_str(&study.succeed(&[&["diff", "--json"], arguments].concat()).out).expect("JSON")
}

fn kinds(diff: &serde_json::Value) -> Vec<&str> {
    let results = diff["results"].as_array().expect("results");
    let mut kinds: Vec<&str> = results.iter().filter_map(|result| result["kind"].as_str()).collect();
    kinds.dedup();
    kinds
}

/// Other bounds of the parameter, so that every result moves.
fn move_everything(study: &Study) {
    study.edit("pipeline.toml", "lower = 0.2", "lower = 0.3");
    study.edit("lab.csv", "angle_of_movement,4,", "angle_of_movement,7,");
    study.succeed(&["repro"]);
}

#[test]
fn a_revision_and_a_file_show_settings_and_results_side_by_side() {
    let study = finished();
    git(&study, &["init", "--quiet"]);
    git(&study, &["add", "pipeline.toml", "pipeline.lock", "lab.csv"]);
    git(&study, &["commit", "--quiet", "-m", "first"]);
    let nothing = study.succeed(&["diff", "HEAD"]).out;
    assert_eq!(nothing, "no setting differs\nno result differs\n");
    std::fs::copy(study.path("pipeline.lock"), study.path("first.lock")).expect("a lock");
    move_everything(&study);

    let by_revision = diff(&study, &["HEAD"]);
    let settings = by_revision["settings"].as_array().expect("settings");
    let bound =
        settings.iter().find(|change| change["name"] == "parameters.sliding_friction.lower").expect("the bound");
    assert_eq!((bound["old"].as_str(), bound["new"].as_str()), (Some("0.2"), Some("0.3")));
    assert_eq!(bound["stages"][0], "sample");
    assert!(settings.iter().any(|change| change["name"] == "measured lab"));
    assert_eq!(settings.len(), 2, "{settings:?}");
    let kinds = kinds(&by_revision);
    assert!(kinds.contains(&"parameter") && kinds.contains(&"verification error"), "{by_revision}");
    let parameter = &by_revision["results"][0];
    assert_eq!(parameter["name"], "lab sk-m sliding_friction");
    let (old, new) = (&parameter["old"]["value"], &parameter["new"]["value"]);
    let change = new.as_f64().expect("a number") - old.as_f64().expect("a number");
    // The JSON reader of the test rounds the last digit of a number its own way.
    assert!((parameter["change"].as_f64().expect("a number") - change).abs() < 1e-14);
    assert_eq!((parameter["new"]["n"].as_u64(), parameter["new"]["unit"].as_str()), (Some(2), Some("1")));

    let by_file = diff(&study, &["first.lock", "pipeline.lock"]);
    assert_eq!((&by_file["settings"], &by_file["results"]), (&by_revision["settings"], &by_revision["results"]));
    let back = diff(&study, &["pipeline.lock", "HEAD"]);
    assert_eq!(&back["results"][0]["old"], &parameter["new"]);
    let text = study.succeed(&["diff", "HEAD"]).out;
    assert!(text.contains("parameters.sliding_friction.lower") && text.contains("lab sk-m sliding_friction"), "{text}");
}

#[test]
fn more_repetitions_are_compared_at_their_own_largest_number() {
    let study = finished();
    std::fs::copy(study.path("pipeline.lock"), study.path("two.lock")).expect("a lock");
    study.edit("pipeline.toml", "counts = [2]", "counts = [2, 3]");
    study.succeed(&["repro", "--reps", "3"]);
    let diff = diff(&study, &["two.lock"]);
    let setting =
        |name: &str| diff["settings"].as_array().expect("settings").iter().any(|change| change["name"] == name);
    assert!(setting("study.repetitions") && setting("verify.counts"), "{diff}");
    for result in diff["results"].as_array().expect("results").iter().filter(|result| result["kind"] != "verdict") {
        let counts = (result["old"]["n"].as_u64(), result["new"]["n"].as_u64());
        assert!(matches!(counts, (None | Some(2), None | Some(3))), "{result}");
    }
}

#[test]
fn a_side_that_cannot_be_read_is_named() {
    let study = finished();
    let message = |arguments: &[&str], parts: &[&str]| {
        let ended = study.run(&[&["diff"], arguments].concat());
        assert_eq!(ended.code, Some(1), "{arguments:?}: {}", ended.out);
        for part in parts {
            assert!(ended.err.contains(part), "{arguments:?} does not say {part:?} but {}", ended.err);
        }
    };
    message(&["no-such-thing"], &["`no-such-thing` is no lock file", "pipeline.lock"]);
    study.write("bad.lock", "version = 9");
    message(&["bad.lock"], &["bad.lock", "lock version 9, this program reads 1"]);
    message(&["--", "--output=x"], &["no revision begins with a dash"]);
    std::fs::copy(study.path("pipeline.lock"), study.path("kept.lock")).expect("a lock");
    std::fs::remove_file(study.path("pipeline.lock")).expect("a lock");
    message(&["kept.lock"], &["there is no `pipeline.lock` yet"]);
    assert!(study.run(&["diff", "--help"]).out.contains("granulake diff HEAD~1"));
}

#[test]
fn results_that_are_gone_are_named_and_pins_keep_them() {
    let study = finished();
    std::fs::copy(study.path("pipeline.lock"), study.path("first.lock")).expect("a lock");
    let pinned = study.succeed(&["gc", "--pin", "first"]).out;
    assert!(pinned.contains("first.lock"), "{pinned}");
    study.succeed(&["gc", "--pin", "first"]);
    move_everything(&study);
    let before = diff(&study, &["first.lock"]);
    let (now, runs) = (study.outputs(), study.runs());

    let listed = study.succeed(&["gc", "--unrooted"]).out;
    assert!(listed.ends_with("0 files, 0 bytes could be deleted\n"), "the pin and the lock need all: {listed}");
    let taken = study.run(&["gc", "--pin", "first"]);
    assert!(taken.code == Some(1) && taken.err.contains("keeps other results"), "{}", taken.err);
    assert!(study.run(&["gc", "--pin", "../x"]).err.contains("cannot name a pin"));

    std::fs::remove_file(study.path("artifacts/pins/first.lock")).expect("a pin");
    let listed = study.succeed(&["gc"]).out;
    assert!(listed.ends_with("0 files, 0 bytes could be deleted\n"), "the ledgers remember all: {listed}");
    let listed = study.succeed(&["gc", "--unrooted", "--lock", "first.lock"]).out;
    assert!(listed.ends_with("0 files, 0 bytes could be deleted\n"), "a named lock is a root: {listed}");
    let listed = study.succeed(&["gc", "--unrooted"]).out;
    assert!(listed.contains("object nothing refers to: ") && listed.contains("could be deleted"), "{listed}");
    assert_eq!(diff(&study, &["first.lock"]), before, "a list deletes nothing");
    let absent = study.run(&["gc", "--unrooted", "--delete", "--lock", "frist.lock"]);
    assert!(absent.code == Some(1) && absent.err.contains("frist.lock"), "{}", absent.err);
    assert!(study.succeed(&["gc", "--unrooted", "--delete"]).out.contains("deleted"));

    let lost = diff(&study, &["first.lock"]);
    assert_eq!(lost["settings"], before["settings"], "settings stand in the lock");
    // Of the four tables that are compared, one that came out the same is still held by the other lock.
    let count = |part: &str| lost[part].as_array().map(Vec::len);
    assert!(count("results") == Some(0) && matches!(count("lost"), Some(3 | 4)), "{lost}");
    assert!(lost["lost"][0]["why"].as_str().is_some_and(|why| why.contains("is missing")), "{lost}");
    assert!(study.succeed(&["diff", "first.lock"]).out.contains("optima of first.lock cannot be compared"));

    // What is rooted is untouched, and what went is computed again when it is asked for.
    study.assert_outputs(&now, "after gc");
    assert_eq!((study.run(&["fsck", "--full"]).code, study.ran(&[])), (Some(0), vec![]));
    study.edit("pipeline.toml", "lower = 0.3", "lower = 0.2");
    study.edit("lab.csv", "angle_of_movement,7,", "angle_of_movement,4,");
    study.succeed(&["repro"]);
    assert_eq!(study.runs(), runs, "the same runs under the same keys");
    let none = diff(&study, &["first.lock"]);
    assert_eq!((none["results"].as_array().map(Vec::len), none["lost"].as_array().map(Vec::len)), (Some(0), Some(0)));
}

#[test]
fn without_a_lock_nothing_can_be_told_to_be_unneeded() {
    let study = finished();
    std::fs::remove_file(study.path("pipeline.lock")).expect("a lock");
    let ended = study.run(&["gc", "--unrooted", "--delete"]);
    assert!(ended.code == Some(1) && ended.err.contains("nobody can tell what is still needed"), "{}", ended.err);
    assert!(study.run(&["gc", "--pin", "x"]).err.contains("pipeline.lock"));
}
