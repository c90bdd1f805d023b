//! What is stale and why, without doing anything.

use super::Study;
use crate::canonical::{Digest, Encoder, digest};
use crate::config::Measured;
use crate::stages::{STAGES, Stage, find};
use crate::store::{Lock, StageLock, lock::Change, table};
use crate::tables::TableSpec;
use std::collections::BTreeMap;
use std::fmt;

const MEASURED_CONTEXT: &str = "granulake 2026 measured data v1";
const STAGE_CONTEXT: &str = "granulake 2026 stage key v1";

/// Where a stage stands.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// Its outputs belong to its settings and inputs.
    Fresh,
    /// It has to run, for these reasons.
    Stale(Vec<Reason>),
    /// Earlier stages have to run first; whether this one has to is known then.
    Waiting(Vec<&'static str>),
    /// The study has no need of it, for this reason.
    Skipped(&'static str),
}

/// Why a stage is stale.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// It never ran.
    NeverRan,
    /// Its code has a new version.
    Version {
        /// Version in the lock.
        old: u32,
        /// Version now.
        new: u32,
    },
    /// A setting changed.
    Setting(Change),
    /// An input has other content.
    Input(String),
    /// An output is missing or is not the one in the lock.
    Output(String),
    /// The lock gives it a key that its settings and inputs do not have.
    Edited,
    /// A table has a file that belongs to none of its outputs.
    Leftover(String),
}

/// One stage of a plan.
#[derive(Debug, Clone)]
pub struct Step {
    /// Name of the stage.
    pub stage: &'static str,
    /// Where it stands.
    pub state: State,
}

/// A stage's key with what it is made of.
#[derive(Debug, Clone)]
pub struct Recipe {
    /// Key of the stage.
    pub key: Digest,
    /// Settings as text.
    pub settings: BTreeMap<String, String>,
    /// Digests of the inputs, by path or name.
    pub inputs: BTreeMap<String, Digest>,
}

impl State {
    /// Whether there is nothing to do.
    pub const fn is_settled(&self) -> bool {
        matches!(self, Self::Fresh | Self::Skipped(_))
    }

    /// One word.
    pub const fn word(&self) -> &'static str {
        match self {
            Self::Fresh => "fresh",
            Self::Stale(_) => "stale",
            Self::Waiting(_) => "waiting",
            Self::Skipped(_) => "skipped",
        }
    }

    /// The reasons in words, empty when fresh.
    pub fn detail(&self) -> String {
        match self {
            Self::Fresh => String::new(),
            Self::Stale(reasons) => listed(reasons),
            Self::Waiting(stages) => format!("after {}", stages.join(", ")),
            Self::Skipped(why) => (*why).to_owned(),
        }
    }
}

/// Reasons in words; of files that are not as they should be the first few are named, and the rest are counted.
fn listed(reasons: &[Reason]) -> String {
    const NAMED: usize = 3;
    let (files, others): (Vec<_>, Vec<_>) =
        reasons.iter().partition(|reason| matches!(reason, Reason::Output(_) | Reason::Leftover(_)));
    let mut words: Vec<String> = others.iter().chain(files.iter().take(NAMED)).map(ToString::to_string).collect();
    if files.len() > NAMED {
        words.push(format!("the same of {} more files", files.len() - NAMED));
    }
    words.join("; ")
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |value: &Option<String>| value.clone().unwrap_or_else(|| "unset".to_owned());
        match self {
            Self::NeverRan => write!(f, "never ran"),
            Self::Version { old, new } => write!(f, "stage version {old} -> {new}"),
            Self::Setting(change) => write!(f, "{}: {} -> {}", change.name, text(&change.old), text(&change.new)),
            Self::Input(name) => write!(f, "{name} changed"),
            Self::Output(path) => write!(f, "{path} is missing or is not the one in the lock"),
            Self::Edited => write!(f, "its key in the lock belongs to other settings or inputs"),
            Self::Leftover(path) => write!(f, "{path} is left over from an earlier run"),
        }
    }
}

/// Every stage with its state, in order.
pub fn assess(study: &Study, lock: &Lock) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    for stage in STAGES {
        let unsettled: Vec<&'static str> = steps
            .iter()
            .filter(|step| !step.state.is_settled() && feeds(step.stage, stage))
            .map(|step| step.stage)
            .collect();
        let state = if unsettled.is_empty() { assess_stage(study, lock, stage) } else { State::Waiting(unsettled) };
        steps.push(Step { stage: stage.name, state });
    }
    steps
}

/// The state of one stage whose inputs are settled.
pub fn assess_stage(study: &Study, lock: &Lock, stage: &Stage) -> State {
    if let Some(why) = (stage.skipped)(&study.config) {
        return State::Skipped(why);
    }
    let Some(locked) = lock.stages.get(stage.name) else { return State::Stale(vec![Reason::NeverRan]) };
    let mut reasons = Vec::new();
    let recipe = recipe(study, lock, stage);
    // The key follows from the settings and inputs beside it, unless someone edited the lock.
    let written = (locked.key, &locked.settings, &locked.inputs, locked.version);
    if written != (recipe.key, &recipe.settings, &recipe.inputs, stage.version) {
        reasons = differences(stage, locked, &recipe);
    }
    let missing = locked.outputs.iter().filter(|(path, output)| !study.store().has_output(path, output));
    reasons.extend(missing.map(|(path, _)| Reason::Output(path.clone())));
    reasons.extend(leftovers(study, locked, stage).into_iter().map(Reason::Leftover));
    if reasons.is_empty() { State::Fresh } else { State::Stale(reasons) }
}

/// Files in the folders of the tables of a stage that are none of its outputs. A folder that cannot be read has none:
/// its outputs are missing then.
pub fn leftovers(study: &Study, locked: &StageLock, stage: &Stage) -> Vec<String> {
    let listed = locked.outputs.keys().map(String::as_str).collect();
    let of = |spec: &&TableSpec| table::leftovers(study.store().root(), spec, &listed).unwrap_or_default();
    stage.writes.iter().flat_map(of).collect()
}

/// The key of a stage from its settings and from what the lock says of its inputs.
pub fn recipe(study: &Study, lock: &Lock, stage: &Stage) -> Recipe {
    let settings = (stage.settings)(&study.config);
    // What a stage wrote before it came to be skipped is no input any more.
    let needed = |name: &str| find(name).is_none_or(|stage| (stage.skipped)(&study.config).is_none());
    let outputs = lock.outputs().filter(|(stage, ..)| needed(stage));
    let outputs: BTreeMap<&str, Digest> = outputs.map(|(_, path, output)| (path, output.digest)).collect();
    let mut inputs: BTreeMap<String, Digest> = stage
        .reads
        .iter()
        .map(|spec| table::index(spec))
        .filter_map(|path| outputs.get(path.as_str()).map(|digest| (path.clone(), *digest)))
        .collect();
    if stage.measured {
        inputs.extend(study.measured.iter().map(|set| (format!("measured {}", set.name), content(set))));
    }
    Recipe { key: key(stage, &settings, &inputs), settings, inputs }
}

/// Digest of the bytes of the files of a data set, whatever they are called, and of the values that were read off raw
/// records. A file that is gone counts as empty: reading the data has failed by then with a better message.
fn content(set: &Measured) -> Digest {
    let mut encoder = Encoder::new();
    encoder.list(set.files.len());
    for file in &set.files {
        encoder.bytes(&std::fs::read(file).unwrap_or_default());
    }
    for value in set.values.iter().filter(|_| set.raw) {
        encoder.u64(value.value.to_bits());
    }
    digest(MEASURED_CONTEXT, &encoder)
}

fn key(stage: &Stage, settings: &BTreeMap<String, String>, inputs: &BTreeMap<String, Digest>) -> Digest {
    let mut encoder = Encoder::new();
    encoder.str(stage.name).u64(u64::from(stage.version)).list(settings.len());
    for (name, value) in settings {
        encoder.str(name).str(value);
    }
    encoder.list(inputs.len());
    for (name, digest) in inputs {
        encoder.str(name).bytes(&digest.0);
    }
    digest(STAGE_CONTEXT, &encoder)
}

fn differences(stage: &Stage, locked: &StageLock, now: &Recipe) -> Vec<Reason> {
    let mut reasons = Vec::new();
    if locked.version != stage.version {
        reasons.push(Reason::Version { old: locked.version, new: stage.version });
    }
    reasons.extend(locked.changes(&now.settings).into_iter().map(Reason::Setting));
    let names = locked.inputs.keys().chain(now.inputs.keys().filter(|name| !locked.inputs.contains_key(*name)));
    let changed = names.filter(|name| locked.inputs.get(*name) != now.inputs.get(*name));
    reasons.extend(changed.map(|name| Reason::Input(name.clone())));
    if reasons.is_empty() {
        reasons.push(Reason::Edited);
    }
    reasons
}

/// Whether `stage` reads, directly or through others, what `earlier` writes.
pub fn feeds(earlier: &str, stage: &Stage) -> bool {
    let Some(earlier) = crate::stages::find(earlier) else { return false };
    let mut reached: Vec<&str> = earlier.writes.iter().map(|table| table.name).collect();
    for next in STAGES {
        let reads = next.reads.iter().any(|table| reached.contains(&table.name));
        if reads && next.name == stage.name {
            return true;
        }
        if reads {
            reached.extend(next.writes.iter().map(|table| table.name));
        }
    }
    false
}

/// The stages that `target` needs, itself included, in order; all stages without a target.
pub fn selection(target: Option<&'static Stage>) -> Vec<&'static Stage> {
    let wanted = |stage: &Stage| target.is_none_or(|target| stage.name == target.name || feeds(stage.name, target));
    STAGES.iter().copied().filter(|stage| wanted(stage)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(name: &str) -> &'static Stage {
        crate::stages::find(name).unwrap()
    }

    #[test]
    fn a_few_files_are_named_and_the_rest_counted() {
        let output = |k: usize| Reason::Output(format!("tables/{k}.parquet"));
        let reasons: Vec<Reason> = (0..5).map(output).chain([Reason::Input("measured".to_owned())]).collect();
        let detail = State::Stale(reasons).detail();
        assert!(detail.starts_with("measured changed; tables/0.parquet is missing"), "{detail}");
        assert!(detail.ends_with("; the same of 2 more files") && !detail.contains("tables/3"), "{detail}");
    }

    #[test]
    fn data_flow_one_way() {
        assert!(feeds("sample", stage("simulate")));
        assert!(feeds("sample", stage("report")));
        assert!(!feeds("report", stage("sample")));
        assert!(!feeds("verify", stage("verify")));
        let names: Vec<_> = selection(Some(stage("aggregate"))).iter().map(|stage| stage.name).collect();
        assert_eq!(names, ["bounds", "sample", "simulate", "kpi", "aggregate"]);
        assert_eq!(selection(None).len(), STAGES.len());
    }

    #[test]
    fn reasons_name_old_and_new_values() {
        let change = Change { name: "study.repetitions".into(), old: Some("3".into()), new: Some("5".into()) };
        assert_eq!(Reason::Setting(change).to_string(), "study.repetitions: 3 -> 5");
        assert_eq!(Reason::Version { old: 1, new: 2 }.to_string(), "stage version 1 -> 2");
    }
}
