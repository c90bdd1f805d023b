//! A temporary folder with a study in it, and the real binary run there.

use granulake::store::table;
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

    /// The plan of one stage as JSON.
    pub fn plan(&self, stage: &str, arguments: &[&str]) -> serde_json::Value {
        let ended = self.succeed(&[&["plan", "--json"], arguments].concat());
        let plan: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
        plan.as_array().and_then(|rows| rows.iter().find(|row| row["stage"] == stage)).expect("the stage").clone()
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

fn collect(folder: &Path, root: &Path, outputs: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            collect(&path, root, outputs);
        } else {
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
