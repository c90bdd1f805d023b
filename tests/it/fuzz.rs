//! Fuzzing: what comes from outside never makes the program panic, and what is accepted keeps its promises.
//!
//! Seeded mutations of good inputs. `GRANULAKE_FUZZ` is the number of cases of every target, `GRANULAKE_FUZZ_SEED` the
//! seed; a case that fails is printed with its number and its bytes.

use crate::support::Study;
use granulake::canonical::Digest;
use granulake::config::{Config, Measured};
use granulake::rng::Stream;
use granulake::store::ledger::layout::{Found, Manifest};
use granulake::store::{Lock, Output, StageLock, table};
use granulake::tables::{Row, RunRow, io};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

const STUDY: &str = include_str!("../data/quick/pipeline.toml");
const LAB: &str = include_str!("../data/quick/lab.csv");

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

/// Runs `check` on mutations of `seeds`; `words` are pieces that the format knows.
fn fuzz(target: &str, cases: u64, seeds: &[Vec<u8>], words: &[&str], check: impl Fn(&[u8]) -> bool) {
    let cases = setting("GRANULAKE_FUZZ", cases);
    let mut random = Stream::new(setting("GRANULAKE_FUZZ_SEED", 1), target);
    let mut accepted = 0;
    for case in 0..cases {
        let mut bytes = seeds[random.index(seeds.len())].clone();
        for _ in 0..=random.index(4) {
            mutate(&mut bytes, seeds, words, &mut random);
        }
        match catch_unwind(AssertUnwindSafe(|| check(&bytes))) {
            Ok(taken) => accepted += u64::from(taken),
            Err(_) => panic!("{target}, case {case}: {:?}", String::from_utf8_lossy(&bytes)),
        }
    }
    eprintln!("{target}: {cases} cases, {accepted} accepted");
    assert!(cases < 1000 || accepted > 0, "{target}: no mutation is accepted, so nothing beyond refusal was tested");
    assert!(cases < 1000 || accepted < cases, "{target}: every mutation is accepted");
}

/// Numbers and texts on which parsers stumble.
const HARD: &[&str] = &[
    "nan",
    "inf",
    "-0",
    "1e999",
    "-1",
    "0",
    "4294967296",
    "18446744073709551616",
    "9223372036854775807",
    "1e-400",
    "\"\"",
    "[]",
    "{}",
    "null",
    "\u{0}",
    "\u{feff}",
    "\r\n",
    "'",
    "\"",
    "\\",
    "#",
    ",",
    "=",
    "..",
    "/",
    "ä",
    "砂",
    "1 mm",
    "5 kg",
];

fn mutate(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], words: &[&str], random: &mut Stream) {
    let at = random.index(bytes.len() + 1);
    let end = (at + random.index(40)).min(bytes.len());
    match random.index(8) {
        0 if at < bytes.len() => bytes[at] ^= 1 << random.index(8),
        1 => drop(bytes.splice(at..end, [])),
        2 => {
            let piece = bytes[at..end].to_vec();
            bytes.splice(at..at, piece);
        }
        3 => bytes.truncate(at),
        4 => drop(bytes.splice(at..at, HARD[random.index(HARD.len())].bytes())),
        5 => drop(bytes.splice(at..at, words[random.index(words.len())].bytes())),
        6 => replace_token(bytes, words, random),
        _ => {
            let other = &seeds[random.index(seeds.len())];
            let from = random.index(other.len() + 1);
            let to = (from + random.index(200)).min(other.len());
            bytes.splice(at..end, other[from..to].iter().copied());
        }
    }
}

/// Puts a hard or a known piece in the place of a whole number or word, which keeps the rest of the form.
fn replace_token(bytes: &mut Vec<u8>, words: &[&str], random: &mut Stream) {
    let plain = |byte: &u8| byte.is_ascii_alphanumeric() || b"_.-+".contains(byte);
    let starts: Vec<usize> =
        (0..bytes.len()).filter(|at| plain(&bytes[*at]) && (*at == 0 || !plain(&bytes[at - 1]))).collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[random.index(starts.len())];
    let length = bytes[start..].iter().take_while(|byte| plain(byte)).count();
    let piece = if random.index(2) == 0 { HARD[random.index(HARD.len())] } else { words[random.index(words.len())] };
    bytes.splice(start..start + length, piece.bytes());
}

/// A file that every case writes anew; in memory where the system has such a place.
fn scratch(name: &str) -> (tempfile::TempDir, PathBuf) {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.expect("a folder");
    let path = folder.path().join(name);
    (folder, path)
}

#[test]
fn studies() {
    let words: Vec<&str> = STUDY.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| w.len() > 1).collect();
    let shipped = include_str!("../../pipeline.toml");
    let full = include_str!("../../studies/fransen2022.toml");
    let seeds = [STUDY, shipped, full].map(|text| text.as_bytes().to_vec());
    fuzz("study", 2000, &seeds, &words, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Ok(config) = Config::parse(text, Path::new("pipeline.toml")) else { return false };
        assert!(!config.parameters.is_empty() && !config.measured.is_empty() && !config.experiments().is_empty());
        assert!((1..=100_000).contains(&config.study.repetitions) && !config.verify.counts.is_empty());
        for parameter in &config.parameters {
            assert!(parameter.lower.is_finite() && parameter.lower < parameter.upper && parameter.upper.is_finite());
            let middle = parameter.from_unit(0.5);
            assert!(parameter.lower <= middle && middle <= parameter.upper, "{parameter:?}");
        }
        for spec in granulake::settings::specs() {
            assert!(spec.accepts(config.base_settings()[spec.name]), "{}", spec.name);
        }
        let held_out = config.validate.experiment;
        assert!(config.experiments().iter().all(|experiment| experiment.name() != held_out.name()));
        for experiment in config.experiments().into_iter().chain([held_out]) {
            experiment.setup(config.base_settings()).expect("settings that describe an apparatus");
        }
        // The same text means the same settings, and so do more repetitions but for what depends on them.
        let again = Config::parse(text, Path::new("pipeline.toml")).expect("the same text");
        assert_eq!(again.settings_text(&["study", "setup"]), config.settings_text(&["study", "setup"]));
        true
    });
}

/// What holds for every data set that is accepted.
fn sound(measured: &Measured) {
    assert!(!measured.values.is_empty() || !measured.summaries.is_empty());
    assert!(measured.values.iter().all(|value| value.value.is_finite() && value.repetition > 0));
    for summary in measured.statistics() {
        assert!(
            summary.mean.is_finite() && summary.sd.is_finite() && summary.sd > 0.0 && summary.n >= 2,
            "{summary:?}"
        );
    }
    let names: Vec<_> = measured.statistics().iter().map(|summary| (summary.experiment, summary.kpi)).collect();
    assert!(names.windows(2).all(|pair| pair[0] < pair[1]), "{names:?}");
}

#[test]
fn measured_csv() {
    let values = "experiment,repetition,kpi,value,unit,note\nledge,1,angle_of_movement,33.5,deg,\n\
                  ledge,2,angle_of_movement,0.61,rad,\"a, b\"\n# a comment\nledge,3,angle_of_movement,35,deg,x\n";
    let seeds =
        [LAB, values, include_str!("../../artifacts/measured/fransen2022.csv")].map(|text| text.as_bytes().to_vec());
    let words =
        ["ledge", "pile", "bulk_density", "angle_of_movement", "kg/m3", "deg", "rad", "mean", "value", "\n", "2"];
    let (_folder, path) = scratch("measured.csv");
    fuzz("measured_csv", 4000, &seeds, &words, |bytes| {
        std::fs::write(&path, bytes).expect("a file");
        Measured::read("lab", &path).inspect(sound).is_ok()
    });
}

granulake::table! {
    /// A measured data set as pandas or DuckDB would write it.
    pub struct LabRow in "lab" version 1 sorted by (experiment) {
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Mean.
        mean: f64 ["1"],
        /// Standard deviation.
        sd: Option<f64> ["1"],
        /// Number.
        n: u32 ["1"],
        /// Unit.
        unit: String ["1"],
    }
}

/// Measured data sets in Parquet.
fn measured_tables() -> [Vec<u8>; 3] {
    let row = |experiment: &str, kpi: &str, mean, sd, unit: &str| LabRow {
        experiment: experiment.to_owned(),
        kpi: kpi.to_owned(),
        mean,
        sd,
        n: 12,
        unit: unit.to_owned(),
    };
    let rows = [
        row("ledge", "angle_of_movement", 33.0, Some(4.0), "deg"),
        row("bulk_density", "bulk_density", 1400.0, Some(15.0), "kg/m3"),
    ];
    let bytes = |rows: &[LabRow]| io::to_parquet_bytes(rows).expect("a table");
    [bytes(&rows), bytes(&rows[..1]), bytes(&[row("ledge", "ledge_mass", 2.0, None, "kg")])]
}

#[test]
fn measured_parquet() {
    let (_folder, path) = scratch("measured.parquet");
    fuzz("measured_parquet", 4000, &measured_tables(), &["PAR1", "ledge", "deg", "\u{1}", "\u{15}"], |bytes| {
        std::fs::write(&path, bytes).expect("a file");
        Measured::read("lab", &path).inspect(sound).is_ok()
    });
}

/// Reads a whole file as the reader of measured data does.
fn read_parquet(bytes: Vec<u8>) -> Result<usize, parquet::errors::ParquetError> {
    let reader = ParquetRecordBatchReaderBuilder::try_new(bytes::Bytes::from(bytes))?.build()?;
    Ok(reader.take_while(Result::is_ok).count())
}

#[test]
fn a_file_on_which_the_parquet_crate_panics_is_one_clear_error() {
    let [whole, ..] = measured_tables();
    let mut random = Stream::new(10, "panic");
    let flipped = |_| {
        let mut bytes = whole.clone();
        let at = random.index(bytes.len());
        bytes[at] ^= 1 << random.index(8);
        bytes
    };
    let panics = |bytes: &Vec<u8>| catch_unwind(|| read_parquet(bytes.clone())).is_err();
    let found = (0..50_000).map(flipped).find(panics).expect("a flipped bit on which the reader panics");
    let study = Study::quick();
    study.edit("pipeline.toml", "path = \"lab.csv\"", "path = \"lab.parquet\"");
    std::fs::write(study.path("lab.parquet"), found).expect("a file");
    let ended = study.run(&["status"]);
    assert_eq!(ended.code, Some(1), "{}", ended.err);
    assert!(ended.err.starts_with("error: ") && ended.err.contains("lab.parquet"), "{}", ended.err);
    assert!(!ended.err.contains("panicked"), "{}", ended.err);
}

/// A lock as a study has it.
fn lock() -> Lock {
    let digest = |text: &str| Digest::of_content(text.as_bytes());
    let output = |bytes, rows| Output { digest: digest("output"), bytes, rows };
    let stage = StageLock {
        key: digest("key"),
        version: 2,
        settings: BTreeMap::from([("design.points".into(), "27".into()), ("study.title".into(), "\"a\"\n ä".into())]),
        inputs: BTreeMap::from([("measured lab".into(), digest("lab"))]),
        outputs: BTreeMap::from([
            ("tables/kpis/manifest.json".into(), output(80, None)),
            ("tables/aggregates/aggregates.parquet".into(), output(4000, Some(12))),
        ]),
    };
    Lock { stages: BTreeMap::from([("aggregate".into(), stage.clone()), ("kpi".into(), stage)]) }
}

#[test]
fn locks() {
    let seed = lock().to_text().expect("a lock").into_bytes();
    let words = ["stage", "aggregate", "outputs", "digest", "bytes", "rows", "version", "[", "]", "\n", "key = "];
    fuzz("lock", 8000, &[seed, b"version = 1\n".to_vec()], &words, |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        let Ok(lock) = Lock::parse(text) else { return false };
        let written = lock.to_text().expect("what was read can be written");
        assert_eq!(Lock::parse(&written).expect("what was written can be read"), lock);
        assert_eq!(Lock::parse(&written).expect("a lock").to_text().expect("a text"), written);
        true
    });
}

#[test]
fn ledger_manifests() {
    let digest = Digest::of_content(b"part");
    let part = format!("{{ \"digest\": \"{digest}\", \"bytes\": 812, \"rows\": 7, \"keys\": 7 }}");
    let seed = format!("{{\n  \"version\": 1,\n  \"folded\": 3,\n  \"parts\": [\n    {part},\n    {part}\n  ]\n}}\n");
    let Found::Whole(_) = Manifest::find(Some(seed.as_bytes())) else { panic!("the seed is a manifest") };
    let words = ["version", "folded", "parts", "digest", "bytes", "rows", "keys", "{", "}", "[", "]", ":"];
    fuzz("ledger_manifest", 20_000, &[seed.into_bytes()], &words, |bytes| match Manifest::find(Some(bytes)) {
        Found::Nothing => panic!("there is something"),
        Found::Damaged(why) => why.is_empty(),
        Found::Whole(manifest) => {
            for part in &manifest.parts {
                let name = part.file_name();
                let digest = name.strip_prefix("part-").and_then(|name| name.strip_suffix(".parquet"));
                assert!(digest.is_some_and(|digest| digest.parse::<Digest>().is_ok()), "{name}");
            }
            true
        }
    });
}

#[test]
fn table_manifests() {
    let digest = Digest::of_content(b"part");
    let part = format!("\"experiment=ledge/part-{digest}.parquet\"");
    let seed = format!("{{\n  \"table\": \"runs\",\n  \"parts\": [\n    {part},\n    {part}\n  ]\n}}\n");
    let words = ["table", "parts", "runs", "../", "/", "./", "//", "\\u002e", "experiment=", "part-", "\u{0}"];
    let (folder, _) = scratch("");
    let path = folder.path().join(table::index(RunRow::SPEC));
    let own = path.parent().expect("a folder");
    std::fs::create_dir_all(own).expect("a folder");
    fuzz("table_manifest", 8000, &[seed.into_bytes()], &words, |bytes| {
        std::fs::write(&path, bytes).expect("a file");
        let Ok(files) = table::data_files(folder.path(), RunRow::SPEC) else { return false };
        for file in &files {
            let inside = file.strip_prefix(own).expect("a path in the table's own folder");
            assert!(
                inside.components().all(|part| matches!(part, std::path::Component::Normal(_))),
                "{}",
                file.display()
            );
        }
        true
    });
}
