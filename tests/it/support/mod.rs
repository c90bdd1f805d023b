//! A temporary folder with a study in it, and the real binary run there.

use granulake::campaign::RunRecord;
use granulake::stages::STAGES;
use granulake::store::atomic::TEMPORARY;
use granulake::store::{Store, table};
use granulake::tables::Row;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A study in a folder of its own, which goes when this value does.
pub struct Study {
    folder: tempfile::TempDir,
}

/// What a command printed and how it ended.
pub struct Ended {
    /// Exit code, none when killed.
    pub code: Option<i32>,
    /// What it printed.
    pub out: String,
    /// What it said besides.
    pub err: String,
}

impl Study {
    /// A folder with these files.
    pub fn new(files: &[(&str, &str)]) -> Self {
        let study = Self { folder: tempfile::Builder::new().prefix("granulake tëst ").tempdir().expect("a folder") };
        for (name, text) in files {
            study.write(name, text);
        }
        study
    }

    /// The quick study, which runs the whole loop in half a second and means nothing.
    pub fn quick() -> Self {
        Self::new(&[
            ("pipeline.toml", include_str!("../../data/quick/pipeline.toml")),
            ("lab.csv", include_str!("../../data/quick/lab.csv")),
        ])
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }

    /// Replaces a text in a file, which must hold it.
    pub fn edit(&self, name: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.path(name)).expect("a file");
        assert!(text.contains(from), "{name} does not hold {from}");
        self.write(name, &text.replace(from, to));
    }

    /// The command in this folder.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_granulake"));
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    /// Runs the command to its end.
    pub fn run(&self, arguments: &[&str]) -> Ended {
        let Output { status, stdout, stderr } = self.command(arguments).output().expect("the binary starts");
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ended { code: status.code(), out: text(stdout), err: text(stderr) }
    }

    /// Runs the command, which must succeed; runs that failed are rows and no failure of the command.
    pub fn succeed(&self, arguments: &[&str]) -> Ended {
        let ended = self.run(arguments);
        assert!(
            matches!(ended.code, Some(0 | 4)),
            "{arguments:?} ended with {:?}\n{}\n{}",
            ended.code,
            ended.out,
            ended.err
        );
        ended
    }

    /// Rows of a table.
    pub fn table<R: Row>(&self) -> Vec<R> {
        table::read(&self.path("artifacts"), R::SPEC).expect("a table")
    }

    /// Bytes of every table, report and lock, by path.
    pub fn outputs(&self) -> BTreeMap<String, Vec<u8>> {
        let mut outputs = BTreeMap::new();
        for folder in ["artifacts/tables", "artifacts/report"] {
            collect(&self.path(folder), self.folder.path(), &mut outputs);
        }
        outputs.insert("pipeline.lock".to_owned(), std::fs::read(self.path("pipeline.lock")).expect("a lock"));
        outputs
    }

    /// The store as another process sees it.
    pub fn store(&self) -> Store {
        Store::at(self.path("artifacts"))
    }

    /// Number of runs that the store has.
    pub fn runs(&self) -> usize {
        self.store().ledger::<RunRecord>("runs").expect("a ledger").len()
    }

    /// Asserts that tables, report and lock are these.
    pub fn assert_outputs(&self, wanted: &BTreeMap<String, Vec<u8>>, when: &str) {
        let found = self.outputs();
        assert_eq!(found.keys().collect::<Vec<_>>(), wanted.keys().collect::<Vec<_>>(), "{when}");
        for (name, bytes) in &found {
            assert!(bytes == &wanted[name], "{when}: {name} differs");
        }
    }

    /// Asserts that every stage which is called fresh has the outputs that it has in `wanted`.
    pub fn assert_nothing_fresh_is_wrong(&self, wanted: &BTreeMap<String, Vec<u8>>, when: &str) {
        let status = self.status();
        for stage in STAGES.iter().filter(|stage| status[stage.name] == "fresh") {
            let folders = stage.writes.iter().map(|spec| format!("artifacts/tables/{}/", spec.name));
            let own: Vec<String> = folders.chain(stage.files.iter().map(|file| format!("artifacts/{file}"))).collect();
            for (name, bytes) in wanted.iter().filter(|(name, _)| own.iter().any(|start| name.starts_with(start))) {
                let found = std::fs::read(self.path(name)).unwrap_or_default();
                assert!(&found == bytes, "{when}: {} is called fresh, but {name} differs", stage.name);
            }
        }
    }

    /// The plan of one stage as JSON.
    pub fn plan(&self, stage: &str, arguments: &[&str]) -> serde_json::Value {
        let ended = self.succeed(&[&["plan", "--json"], arguments].concat());
        let plan: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
        plan.as_array().and_then(|rows| rows.iter().find(|row| row["stage"] == stage)).expect("the stage").clone()
    }

    /// The state of every stage, by name.
    pub fn status(&self) -> BTreeMap<String, String> {
        let ended = self.run(&["status", "--json"]);
        let states: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
        let text = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
        states.as_array().expect("stages").iter().map(|stage| (text(&stage["stage"]), text(&stage["state"]))).collect()
    }

    /// The stages that a repro ran, in order; each of the others was fresh.
    pub fn ran(&self, arguments: &[&str]) -> Vec<&'static str> {
        let done = self.repro(arguments);
        assert!(done.values().all(|action| action == "ran" || idle(action)), "{done:?}");
        STAGES.iter().map(|stage| stage.name).filter(|name| done.get(*name).is_some_and(|what| what == "ran")).collect()
    }

    /// What a repro did, by stage.
    pub fn repro(&self, arguments: &[&str]) -> BTreeMap<String, String> {
        let ended = self.succeed(&[&["repro", "--json"], arguments].concat());
        let done: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
        let text = |value: &serde_json::Value| value.as_str().unwrap_or_default().to_owned();
        let stages = done["stages"].as_array().expect("stages");
        stages.iter().map(|stage| (text(&stage["stage"]), text(&stage["action"]))).collect()
    }
}

/// Whether a stage had nothing to do.
pub fn idle(action: &str) -> bool {
    action == "fresh" || action == "skipped"
}

fn collect(folder: &Path, root: &Path, outputs: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, root, outputs);
        } else if !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(TEMPORARY)) {
            let name = path.strip_prefix(root).expect("inside").to_string_lossy().into_owned();
            outputs.insert(name, std::fs::read(&path).expect("a file"));
        }
    }
}

/// The coarse set-up of the shipped study: everything between `[setup]` and the measured data.
pub fn shipped_setup() -> String {
    let shipped = include_str!("../../../pipeline.toml");
    let from = shipped.find("[setup]").expect("a set-up");
    let to = shipped.find("# Measured data").expect("measured data");
    shipped[from..to].to_owned()
}
