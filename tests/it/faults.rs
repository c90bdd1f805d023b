//! Faults: kills, damage, full and read-only disks, two processes at once, clocks and paths. Whatever happens, nothing is
//! lost, nothing wrong is called up to date, and the end is byte for byte that of an undisturbed run.

use crate::support::{Study, idle};
use granulake::rng::Stream;
use granulake::stages::STAGES;
use granulake::store::table;
use std::collections::BTreeMap;
use std::fs::{self, File, FileTimes};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime};

type Files = BTreeMap<String, Vec<u8>>;

/// A finished quick study and its outputs.
fn finished() -> (Study, Files) {
    let study = Study::quick();
    study.succeed(&["repro"]);
    let outputs = study.outputs();
    (study, outputs)
}

/// Kills the real binary at random moments, 200 times or as often as `GRANULAKE_KILLS` says.
#[test]
fn random_kills_lose_nothing_and_leave_nothing_wrong() {
    let kills = std::env::var("GRANULAKE_KILLS").map_or(200, |text| text.parse().expect("a number"));
    let clock = Instant::now();
    let (_, undisturbed) = finished();
    let longest = clock.elapsed().as_secs_f64() / 8.0;
    let mut random = Stream::new(2022, "kills");
    let (mut killed, mut ends) = (0, 0);
    let mut study = Study::quick();
    while killed < kills {
        let mut command = study.command(&["repro", "--jobs", "2"]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the binary starts");
        std::thread::sleep(Duration::from_secs_f64(random.uniform() * longest));
        // SIGKILL on Unix: the process has no chance to tidy up.
        child.kill().expect("a process");
        let status = child.wait().expect("an ended process");
        if status.code().is_none() {
            killed += 1;
            study.assert_nothing_fresh_is_wrong(&undisturbed, &format!("after kill {killed}"));
        } else {
            assert_eq!(status.code(), Some(0), "a disturbed study fails");
            study.assert_outputs(&undisturbed, &format!("after {killed} kills"));
            ends += 1;
            study = Study::quick();
        }
    }
    study.succeed(&["repro"]);
    study.assert_outputs(&undisturbed, "after the last kill");
    assert!(study.succeed(&["gc", "--delete"]).out.contains("deleted"));
    study.assert_outputs(&undisturbed, "after what the kills left was deleted");
    let again = study.repro(&[]);
    assert!(again.values().all(|action| idle(action)), "{again:?}");
    assert_eq!(study.run(&["fsck", "--full"]).code, Some(0));
    eprintln!("{killed} kills, {ends} studies to their end between them, {:.0} s", clock.elapsed().as_secs_f64());
}

/// Every file of the artifacts folder but the guard.
fn files_of(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.extend(files_of(&path));
        } else if path.file_name().is_some_and(|name| name != ".guard") {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn flip(path: &Path, random: &mut Stream) {
    let mut bytes = fs::read(path).expect("a file");
    let at = random.index(bytes.len());
    bytes[at] ^= 1 << random.index(8);
    fs::write(path, bytes).expect("a file");
}

fn truncate(path: &Path, random: &mut Stream) {
    let bytes = fs::read(path).expect("a file");
    fs::write(path, &bytes[..random.index(bytes.len())]).expect("a file");
}

fn remove(path: &Path, _: &mut Stream) {
    fs::remove_file(path).expect("a file");
}

/// Looks for damage, computes what is gone, and finds the store whole then.
fn heal(study: &Study, what: &str) {
    let found = study.run(&["fsck", "--full"]);
    study.succeed(&["repro"]);
    let left = study.run(&["fsck", "--full"]);
    assert_eq!(left.code, Some(0), "{what} does not heal:\n{}\n{}", found.out, left.out);
}

#[test]
fn a_damaged_file_of_any_kind_is_found_and_healed() {
    let mut random = Stream::new(7, "damage");
    for kind in ["runs", "kpis", "stages", "tables", "report", "objects", "objects", "objects"] {
        for damage in [flip, truncate, remove] {
            let (study, undisturbed) = finished();
            let (artifacts, runs) = (study.path("artifacts"), study.runs());
            let under =
                |path: &Path| path.strip_prefix(&artifacts).is_ok_and(|path| path.iter().any(|part| part == kind));
            let files: Vec<PathBuf> = files_of(&artifacts).into_iter().filter(|path| under(path)).collect();
            let path = &files[random.index(files.len())];
            damage(path, &mut random);
            nothing_fresh_is_wrong_but_parts(&study, &undisturbed, path);
            heal(&study, &path.display().to_string());
            study.assert_outputs(&undisturbed, &format!("after damage to {}", path.display()));
            assert_eq!(study.runs(), runs, "the runs in the tables are not forgotten: {}", path.display());
        }
    }
}

/// A part carries its digest in its name and is not read to see whether it is fresh: `fsck --full` does that.
fn nothing_fresh_is_wrong_but_parts(study: &Study, undisturbed: &Files, damaged: &Path) {
    if !damaged.file_name().is_some_and(|name| name.to_string_lossy().starts_with("part-")) {
        study.assert_nothing_fresh_is_wrong(undisturbed, &format!("damaged {}", damaged.display()));
    }
}

#[test]
fn a_damaged_lock_is_refused_or_healed() {
    let (study, undisturbed) = finished();
    let mut random = Stream::new(8, "lock");
    let lock = study.path("pipeline.lock");
    let mut refused = 0;
    for round in 0..24 {
        let damage = if round % 6 == 0 { truncate } else { flip };
        damage(&lock, &mut random);
        let ended = study.run(&["repro"]);
        if ended.code == Some(1) {
            assert!(ended.err.contains("pipeline.lock") && ended.err.contains("remove it"), "{}", ended.err);
            fs::remove_file(&lock).expect("a lock");
            refused += 1;
        }
        heal(&study, "a lock");
        study.assert_outputs(&undisturbed, &format!("round {round}"));
    }
    assert!(refused > 2, "{refused} of 24 damaged locks were refused");
}

/// Neither decides whether a stage is fresh: the number of rows of a table, which people read, and the comment at the head.
#[test]
fn what_no_stage_asks_of_a_lock_is_mended_too() {
    let (study, undisturbed) = finished();
    for (from, to) in [("rows = ", "rows = 9"), ("# Written by", "# Written for")] {
        let lock = fs::read_to_string(study.path("pipeline.lock")).expect("a lock");
        study.write("pipeline.lock", &lock.replacen(from, to, 1));
        study.succeed(&["repro"]);
        study.assert_outputs(&undisturbed, from);
    }
}

#[test]
fn journals_of_killed_processes_are_checked_too() {
    let (_, undisturbed) = finished();
    let mut random = Stream::new(9, "journal");
    for damage in [flip, truncate] {
        let study = Study::quick();
        let mut child =
            study.command(&["repro", "--jobs", "2"]).stderr(Stdio::null()).spawn().expect("the binary starts");
        let journal = study.path("artifacts/ledger/runs/journal");
        let begun = || fs::read_dir(&journal).is_ok_and(|entries| entries.count() > 3);
        let clock = Instant::now();
        while !begun() && clock.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().expect("a process");
        child.wait().expect("an ended process");
        let files = files_of(&journal);
        damage(&files[random.index(files.len())], &mut random);
        study.succeed(&["repro"]);
        study.assert_outputs(&undisturbed, "after damage to a journal");
    }
}

#[test]
fn two_processes_do_not_get_in_each_others_way() {
    let (_, undisturbed) = finished();
    let study = Study::quick();
    let held = study.store();
    held.claim().expect("a free store");
    for arguments in [&["repro"][..], &["gc", "--delete"], &["fsck"]] {
        let ended = study.run(arguments);
        assert_eq!(ended.code, Some(1), "{arguments:?}");
        assert!(ended.err.contains("is in use by another granulake (process "), "{}", ended.err);
    }
    assert!(matches!(study.run(&["status"]).code, Some(3)), "looking is allowed");
    drop(held);

    let start = || study.command(&["repro"]).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("it starts");
    let (first, second) = (start(), start());
    let ended = [first, second].map(|child| child.wait_with_output().expect("an end"));
    assert!(ended.iter().any(|ended| ended.status.success()), "one of two gets through");
    for loser in ended.iter().filter(|ended| !ended.status.success()) {
        let said = String::from_utf8_lossy(&loser.stderr);
        assert!(said.contains("is in use by another granulake"), "{said}");
    }
    study.assert_outputs(&undisturbed, "after two at once");
}

#[test]
fn no_time_of_any_file_matters() {
    let (study, _) = finished();
    let mut files = files_of(&study.path("artifacts"));
    files.extend(["pipeline.toml", "lab.csv", "pipeline.lock"].map(|name| study.path(name)));
    let past = SystemTime::UNIX_EPOCH + Duration::from_secs(1);
    let future = SystemTime::now() + Duration::from_secs(1_000_000_000);
    for times in [[past, future], [future, past], [past, past], [future, future]] {
        for (number, path) in files.iter().enumerate() {
            let times = FileTimes::new().set_modified(times[number % 2]).set_accessed(times[number % 2]);
            File::options().write(true).open(path).and_then(|file| file.set_times(times)).expect("a file");
        }
        assert_eq!(study.run(&["status"]).code, Some(0));
        assert_eq!(study.ran(&[]), [""; 0]);
    }
}

#[test]
fn a_full_disk_stops_with_a_reason_and_the_next_run_goes_on() {
    if !cfg!(unix) {
        return;
    }
    let (_, undisturbed) = finished();
    // No file may grow beyond so many blocks of 512 bytes; the signal is ignored, so that the write itself fails.
    for blocks in [4, 16, 64] {
        let study = Study::quick();
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" repro");
        let mut command = std::process::Command::new("sh");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_granulake")]).current_dir(study.path("."));
        let output = command.output().expect("a shell");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{blocks} blocks: {said}");
        assert!(said.contains("cannot write `") && said.contains("finished runs are kept"), "{said}");
        study.assert_nothing_fresh_is_wrong(&undisturbed, "on a full disk");
        let (kept, lost) = (study.runs(), files_of(&study.path("artifacts")));
        assert!(
            lost.iter().all(|path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(".tmp-")))
        );
        study.succeed(&["repro"]);
        assert!(study.runs() >= kept);
        study.assert_outputs(&undisturbed, "after the disk was full");
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let study = Study::quick();
    study.write("artifacts", "a file where the folder should be");
    let ended = study.run(&["repro"]);
    assert_eq!(ended.code, Some(1));
    assert!(ended.err.contains("artifacts"), "{}", ended.err);
    fs::remove_file(study.path("artifacts")).expect("a file");
    study.succeed(&["repro", "sample"]);

    let folders = [study.path("artifacts/tables"), study.path("artifacts/ledger"), study.path("artifacts")];
    let writable = |readonly: bool| {
        for folder in &folders {
            let mut permissions = fs::metadata(folder).expect("a folder").permissions();
            permissions.set_readonly(readonly);
            fs::set_permissions(folder, permissions).expect("an own folder");
        }
    };
    writable(true);
    let ignored = fs::write(study.path("artifacts/probe"), "").is_ok();
    let ended = study.run(&["repro"]);
    let status = study.run(&["status"]);
    writable(false);
    if ignored {
        eprintln!("skipped: this user may write where nobody may");
        return;
    }
    assert_eq!(ended.code, Some(1));
    assert!(ended.err.contains("make the folder writable"), "{}", ended.err);
    assert_eq!(status.code, Some(3), "reading needs no permission to write");
    study.succeed(&["repro", "aggregate"]);
}

#[test]
fn spaces_and_letters_beyond_ascii_are_fine_in_every_path() {
    let (_, undisturbed) = finished();
    let text = include_str!("../data/quick/pipeline.toml");
    let text = text.replace("resolution = ", "artifacts = \"der läke, 2 砂\"\nresolution = ");
    let text = text.replace("\"lab.csv\"", "\"im Labor/größe 1.csv\"");
    let study = Study::new(&[
        ("eine Studie/størrelse 'x'.toml", &text),
        ("eine Studie/im Labor/größe 1.csv", include_str!("../data/quick/lab.csv")),
    ]);
    let with = |arguments: &[&str]| study.run(&[&["--study", "eine Studie/størrelse 'x'.toml"], arguments].concat());
    for arguments in [&["repro"][..], &["status"], &["fsck", "--full"], &["gc"], &["why", "train"], &["plan"]] {
        let ended = with(arguments);
        assert_eq!(ended.code, Some(0), "{arguments:?}: {}", ended.err);
    }
    let root = study.path("eine Studie/der läke, 2 砂");
    for stage in STAGES {
        // A stage that is skipped writes nothing.
        for spec in
            stage.writes.iter().filter(|spec| undisturbed.contains_key(&format!("artifacts/{}", table::index(spec))))
        {
            let name = format!("artifacts/{}", table::index(spec));
            assert!(fs::read(root.join(table::index(spec))).expect("a table") == undisturbed[&name], "{name} differs");
        }
    }
}
