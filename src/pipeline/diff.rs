//! What differs between two states of a study: settings, measured data and results, side by side.
//!
//! Takes two locks; the tables of results come out of the object store by the digests in the locks, so that results of
//! earlier settings can be compared without running anything. A table that the store no longer has, or that another
//! version of the program wrote, is named and left out.

use crate::store::{Lock, StageLock, Store, StoreError, table};
use crate::tables::io::from_parquet_bytes;
use crate::tables::{OptimumRow, Row, ValidationRow, VerdictRow, VerificationRow};
use std::collections::BTreeMap;

/// A setting, a stage or a measured data set that differs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SettingDiff {
    /// Name of the setting, `measured NAME`, or `stage NAME`.
    pub name: String,
    /// Value on the first side.
    pub old: Option<String>,
    /// Value on the second side.
    pub new: Option<String>,
    /// Stages that it makes stale.
    pub stages: Vec<&'static str>,
}

/// What a result is.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// A verdict.
    Text(String),
}

/// A result with its unit and the repetitions behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The result.
    pub value: Value,
    /// Its unit; empty for a text.
    pub unit: String,
    /// Repetitions behind it, where there are any.
    pub n: Option<u32>,
}

/// A result on both sides; a side without it is `None`.
#[derive(Debug, Clone, PartialEq)]
pub struct ResultDiff {
    /// `parameter`, `verification error`, `validation error` or `verdict`.
    pub kind: &'static str,
    /// What it is the result of, such as `lab sk-m sliding_friction`.
    pub name: String,
    /// On the first side.
    pub old: Option<Finding>,
    /// On the second side.
    pub new: Option<Finding>,
}

/// A table of results that cannot be shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    /// The side, 0 or 1.
    pub side: usize,
    /// Name of the table.
    pub table: &'static str,
    /// Why.
    pub why: String,
}

/// The differences between two locks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Diff {
    /// Settings that differ, by name.
    pub settings: Vec<SettingDiff>,
    /// Results that differ, by kind and name.
    pub results: Vec<ResultDiff>,
    /// Tables that could not be compared.
    pub lost: Vec<Lost>,
}

/// Compares two locks of studies that share `store`.
pub fn compare(store: &Store, locks: [&Lock; 2]) -> Diff {
    let mut lost = Vec::new();
    let [old, new] = [0, 1].map(|side| Results::read(store, locks[side], side, &mut lost).by_name);
    // A table that one side lost would look like results that came or went.
    let readable = |kind: &str| !lost.iter().any(|lost| table_of(kind) == lost.table);
    let mut names: Vec<_> = old.keys().chain(new.keys().filter(|name| !old.contains_key(name))).collect();
    names.sort();
    let differs = |name: &&&(&'static str, String)| readable(name.0) && value(old.get(*name)) != value(new.get(*name));
    let results = names.iter().filter(differs).map(|name| ResultDiff {
        kind: name.0,
        name: name.1.clone(),
        old: old.get(*name).cloned(),
        new: new.get(*name).cloned(),
    });
    Diff { settings: settings(locks), results: results.collect(), lost }
}

fn value(finding: Option<&Finding>) -> Option<&Value> {
    finding.map(|finding| &finding.value)
}

/// Settings, stages and measured data of both locks that are not the same.
fn settings(locks: [&Lock; 2]) -> Vec<SettingDiff> {
    let mut found: BTreeMap<(String, [Option<String>; 2]), Vec<&'static str>> = BTreeMap::new();
    for stage in crate::stages::STAGES {
        let [old, new] = locks.map(|lock| lock.stages.get(stage.name));
        let mut note = |name: String, old: Option<String>, new: Option<String>| {
            if old != new {
                found.entry((name, [old, new])).or_default().push(stage.name);
            }
        };
        match (old, new) {
            (Some(old), Some(new)) => {
                note("stage version".to_owned(), Some(old.version.to_string()), Some(new.version.to_string()));
                old.changes(&new.settings).into_iter().for_each(|change| note(change.name, change.old, change.new));
                let sets: BTreeMap<&String, [Option<String>; 2]> = measured(old, new);
                sets.into_iter().for_each(|(name, [old, new])| note(name.clone(), old, new));
            }
            (old, new) => {
                let ran = |lock: Option<&StageLock>| lock.map(|_| "ran".to_owned());
                note(format!("stage {}", stage.name), ran(old), ran(new));
            }
        }
    }
    found.into_iter().map(|((name, [old, new]), stages)| SettingDiff { name, old, new, stages }).collect()
}

/// Digests of the measured data, shortened, by name.
fn measured<'a>(old: &'a StageLock, new: &'a StageLock) -> BTreeMap<&'a String, [Option<String>; 2]> {
    let names = old.inputs.keys().chain(new.inputs.keys()).filter(|name| name.starts_with("measured "));
    let short =
        |lock: &StageLock, name: &String| lock.inputs.get(name).map(|digest| digest.to_string()[..12].to_owned());
    names.map(|name| (name, [short(old, name), short(new, name)])).collect()
}

const PARAMETER: &str = "parameter";
const VERIFICATION: &str = "verification error";
const VALIDATION: &str = "validation error";
const VERDICT: &str = "verdict";

/// The table behind a kind of result.
fn table_of(kind: &str) -> &'static str {
    match kind {
        PARAMETER => OptimumRow::SPEC.name,
        VERIFICATION => VerificationRow::SPEC.name,
        VALIDATION => ValidationRow::SPEC.name,
        _ => VerdictRow::SPEC.name,
    }
}

/// The results of one side by kind and name: of every calibration the one with most repetitions.
#[derive(Default)]
struct Results {
    by_name: BTreeMap<(&'static str, String), Finding>,
}

impl Results {
    fn read(store: &Store, lock: &Lock, side: usize, lost: &mut Vec<Lost>) -> Self {
        let mut results = Self::default();
        for row in rows::<OptimumRow>(store, lock, side, lost) {
            let name = name(&row.measured, &row.kind, &row.approach, &row.parameter);
            results.add(PARAMETER, name, row.n, Some(row.value), &row.unit);
        }
        for row in rows::<VerificationRow>(store, lock, side, lost) {
            let name = name(&row.measured, &row.kind, &row.approach, &row.kpi);
            results.add(VERIFICATION, name, row.n, row.target_error_percent, "%");
        }
        for row in rows::<ValidationRow>(store, lock, side, lost) {
            let name = name(&row.measured, &row.kind, &row.approach, &row.kpi);
            results.add(VALIDATION, name, row.n, row.error_percent, "%");
        }
        for row in rows::<VerdictRow>(store, lock, side, lost) {
            let text = if row.effects.is_empty() { row.verdict } else { format!("{}: {}", row.verdict, row.effects) };
            let finding = Finding { value: Value::Text(text), unit: String::new(), n: None };
            results.by_name.insert((VERDICT, row.measured), finding);
        }
        results
    }

    fn add(&mut self, kind: &'static str, name: String, n: u32, value: Option<f64>, unit: &str) {
        let Some(value) = value else { return };
        let earlier = self.by_name.get(&(kind, name.clone())).and_then(|finding| finding.n);
        if earlier.is_none_or(|earlier| earlier < n) {
            let finding = Finding { value: Value::Number(value), unit: unit.to_owned(), n: Some(n) };
            self.by_name.insert((kind, name), finding);
        }
    }
}

fn name(measured: &str, kind: &str, approach: &str, what: &str) -> String {
    format!("{measured} {kind}-{approach} {what}")
}

/// The rows of a table that a lock names; none where its stage has not run.
fn rows<R: Row>(store: &Store, lock: &Lock, side: usize, lost: &mut Vec<Lost>) -> Vec<R> {
    let index = table::index(R::SPEC);
    let Some((.., output)) = lock.outputs().find(|(_, path, _)| *path == index) else { return Vec::new() };
    let read = || -> Result<Vec<R>, StoreError> { Ok(from_parquet_bytes::<R>(&index, store.object(&output.digest)?)?) };
    read().unwrap_or_else(|error| {
        lost.push(Lost { side, table: R::SPEC.name, why: error.to_string() });
        Vec::new()
    })
}
