//! Blind data on the quick study: what `challenge` hides, that solving never reads the seal, and how answers are scored.

use crate::support::Study;
use granulake::challenge::{Declaration, Score, Solution, parameters_off, score};
use granulake::effects;
use granulake::store::table;
use granulake::tables::{AttributionRow, ConfusionRow, RecalibrationRow, Row, SampleRow, VerdictRow};
use std::collections::BTreeMap;

/// The quick study with its metamodels trained, and a challenge in `blind`.
fn study(arguments: &[&str]) -> Study {
    let study = Study::quick();
    // Enough runs of everything for a diagnosis.
    study.edit("pipeline.toml", "refine_repetitions = 3", "refine_repetitions = 12");
    study.edit("pipeline.toml", "anchors = 1\n", "anchors = 4\n");
    study.succeed(&["repro", "train"]);
    study.succeed(
        &[&["challenge", "new", "--seed", "11", "--n", "12", "--n-held-out", "3", "--out", "blind"], arguments]
            .concat(),
    );
    study
}

fn seal(study: &Study) -> toml::Table {
    std::fs::read_to_string(study.path("blind/sealed.toml")).expect("a seal").parse().expect("TOML")
}

/// Bytes of every table of the solution, by path.
fn solution(study: &Study) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![study.path("blind/solution")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.display().to_string(), std::fs::read(&path).expect("a file"));
            }
        }
    }
    files
}

#[test]
fn a_solution_has_the_same_bytes_with_the_seal_gone() {
    let study = study(&["--effect", "size_distribution"]);
    study.succeed(&["challenge", "solve", "blind"]);
    let open = solution(&study);
    assert!(open.keys().any(|path| path.contains("verdicts")), "{:?}", open.keys());
    std::fs::rename(study.path("blind/sealed.toml"), study.path("elsewhere.toml")).expect("a seal");
    study.succeed(&["challenge", "solve", "blind", "--jobs", "1"]);
    assert!(solution(&study) == open, "the bytes differ");
    let ended = study.run(&["challenge", "score", "blind"]);
    assert!(ended.code != Some(0) && ended.err.contains("cannot read sealed.toml"), "{}", ended.err);
    std::fs::rename(study.path("elsewhere.toml"), study.path("blind/sealed.toml")).expect("a seal");
    let ended = study.succeed(&["challenge", "score", "blind", "--json"]);
    let scores: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
    assert!(scores[0]["correct"].is_boolean() && scores[0]["verdict"].is_string(), "{}", ended.out);
    assert!(scores[0]["parameters_off"].is_object(), "{}", ended.out);
    assert!(scores[0]["t0"].is_f64() && scores[0]["dof"].is_u64() && scores[0]["p"].is_f64(), "{}", ended.out);
    assert_ne!(scores[0]["verdict"], "not_attributable", "{}", ended.out);
    assert_eq!((&scores[0]["truth"], &scores[0]["in_library"]), (&"size_distribution".into(), &true.into()));
    let ended = study.succeed(&["challenge", "score", "blind", "blind"]);
    assert!(ended.out.contains(" of 2 correct (0.") && !ended.out.contains("alarms"), "{}", ended.out);
    // The confusion matrix: one row, both answers in one column.
    let row = ended.out.lines().find(|line| line.starts_with("size distribution ")).expect("a row of the matrix");
    assert_eq!(row.split_whitespace().filter(|cell| *cell != "-").collect::<Vec<_>>(), ["size", "distribution", "2"]);
    // A declaration that was changed afterwards is refused.
    study.edit("blind/sealed.toml", "seed = 11", "seed = 12");
    let ended = study.run(&["challenge", "score", "blind"]);
    assert!(ended.code != Some(0) && ended.err.contains("it was changed"), "{}", ended.err);
}

#[test]
fn what_is_hidden_lies_inside_the_bounds_and_is_no_design_point() {
    let study = study(&["--effect", "cohesion"]);
    let hidden = seal(&study);
    let friction = hidden["parameters"]["sliding_friction"].as_float().expect("a number");
    assert!(0.2 < friction && friction < 0.8, "{friction}");
    let samples: Vec<SampleRow> = study.table();
    assert!(!samples.is_empty() && samples.iter().all(|row| (row.value - friction).abs() > 1e-3), "{friction}");
    let upper = effects::find("cohesion").expect("an effect").range().1;
    let strength = hidden["effects"]["cohesion"].as_float().expect("a number");
    assert!((upper * 2.0 / 3.0..=upper).contains(&strength), "{strength} of {upper}");
    // Another seed hides something else; the same seed the same.
    let text = || std::fs::read_to_string(study.path("blind/measured.csv")).expect("data");
    let first = text();
    let again =
        ["challenge", "new", "--effect", "cohesion", "--n", "12", "--n-held-out", "3", "--out", "blind", "--seed"];
    study.succeed(&[&again[..], &["11"]].concat());
    assert_eq!(text(), first);
    study.succeed(&[&again[..], &["12"]].concat());
    assert_ne!(seal(&study)["parameters"], hidden["parameters"]);
    assert!(first.lines().filter(|line| line.starts_with("ledge,")).count() >= 12);
}

#[test]
fn a_random_effect_is_a_candidate_and_none_hides_nothing() {
    let random = study(&["--effect", "random"]);
    let names: Vec<String> = seal(&random)["effects"].as_table().expect("effects").keys().cloned().collect();
    assert_eq!(names, ["size_distribution"]);
    random.succeed(&["challenge", "new", "--seed", "3", "--effect", "none", "--n", "3", "--out", "blind"]);
    assert!(seal(&random)["effects"].as_table().expect("effects").is_empty());
    let ended = random.run(&["challenge", "new", "--seed", "3", "--effect", "cohesio", "--out", "blind"]);
    assert!(ended.code != Some(0) && ended.err.contains("no effect is called `cohesio`"), "{}", ended.err);
    let ended = random.run(&["challenge", "solve", "blind", "--without", "tilt"]);
    assert!(ended.code != Some(0) && ended.err.contains("`tilt` is no candidate"), "{}", ended.err);
}

#[test]
fn an_effect_left_out_of_the_library_is_never_named() {
    let study = study(&["--effect", "size_distribution", "--strength", "0.2"]);
    study.succeed(&["challenge", "solve", "blind", "--without", "size_distribution"]);
    let ended = study.succeed(&["challenge", "score", "blind", "--json"]);
    let scores: serde_json::Value = serde_json::from_str(&ended.out).expect("JSON");
    assert_eq!(scores[0]["in_library"], false, "{}", ended.out);
    assert!(scores[0]["decidable"].is_boolean() && scores[0]["named"].as_array().is_some_and(Vec::is_empty));
}

/// A density that is calibrated takes a wrong density up; only what was weighed tells the two apart.
#[test]
fn an_effect_on_the_bulk_density_alone_is_absorbed_unless_the_grains_were_weighed() {
    let study = Study::quick();
    for (from, to) in [
        ("refine_repetitions = 3", "refine_repetitions = 24"),
        ("anchors = 1\n", "anchors = 24\n"),
        ("anchor_repetitions = 2", "anchor_repetitions = 8"),
        ("refine_points = 4", "refine_points = 16"),
        ("[\"size_distribution\"]", "[\"density_bias\"]"),
        ("interior = 2", "interior = 16"),
        ("\nrepetitions = 2\nresolution", "\nrepetitions = 8\nresolution"),
        ("[experiments]", "[parameters.particle_density]\nlower = 2000\nupper = 3500\n\n[experiments]"),
    ] {
        study.edit("pipeline.toml", from, to);
    }
    study.succeed(&["repro", "train"]);
    let hidden = ["challenge", "new", "--seed", "11", "--effect", "density_bias", "--strength", "0.15", "--n", "20"];
    let mut found = Vec::new();
    for (name, weighings) in [("unweighed", "0"), ("weighed", "10")] {
        study.succeed(&[&hidden[..], &["--n-held-out", "3", "--out", name, "--weighings", weighings]].concat());
        study.succeed(&["challenge", "solve", name]);
        let tables = study.path(&format!("{name}/solution"));
        let rows: Vec<AttributionRow> = table::read(&tables, AttributionRow::SPEC).expect("a table");
        let verdicts: Vec<VerdictRow> = table::read(&tables, VerdictRow::SPEC).expect("a table");
        found.push((verdicts[0].verdict.clone(), rows[0].part.clone(), rows[0].visibility));
    }
    assert_eq!((found[0].0.as_str(), found[0].1.as_str()), ("no_detectable_discrepancy", "absorbed"), "{found:?}");
    assert_eq!((found[1].0.as_str(), found[1].1.as_str()), ("effect", "named"), "{found:?}");
}

/// Rows of an attribution with one effect that is detected from 0.5 on.
fn row(effect: &str, part: &str) -> AttributionRow {
    AttributionRow {
        measured: "challenge".to_owned(),
        effect: effect.to_owned(),
        unit: "1".to_owned(),
        strength: 1.0,
        strength_sd: 0.1,
        a: 10.0,
        z: 10.0,
        p_family: 0.0,
        leftover: 5.0,
        leftover_p: 0.5,
        visibility: 0.5,
        resolved: true,
        physical: true,
        ln_odds: 10.0,
        strength_90: Some(0.5),
        part: part.to_owned(),
    }
}

fn is_right(hidden: Option<(&str, f64)>, foreign: bool, verdict: (&str, &str), part: &str, separation: f64) -> bool {
    scored(hidden, foreign, verdict, part, separation).correct
}

fn scored(hidden: Option<(&str, f64)>, foreign: bool, verdict: (&str, &str), part: &str, separation: f64) -> Score {
    score(&declared(hidden, foreign), &solved(verdict, part, separation))
}

fn declared(hidden: Option<(&str, f64)>, foreign: bool) -> Declaration {
    let parameters = [("sliding_friction".to_owned(), 0.5)].into();
    Declaration { effect: hidden.map(|(name, strength)| (name.to_owned(), strength)), foreign, parameters }
}

fn solved(verdict: (&str, &str), part: &str, separation: f64) -> Solution {
    let verdict = VerdictRow {
        measured: "challenge".to_owned(),
        verdict: verdict.0.to_owned(),
        effects: verdict.1.to_owned(),
        sentence: String::new(),
        t0: 30.0,
        dof: 10,
        p: 0.0,
        direction: String::new(),
        advice: String::new(),
    };
    let confusion = vec![ConfusionRow {
        measured: "challenge".to_owned(),
        effect: "cohesion".to_owned(),
        other: "tilt".to_owned(),
        cosine: 0.0,
        separation,
    }];
    let attribution = vec![row("cohesion", part), row("tilt", "rejected")];
    Solution { verdict, attribution, confusion }
}

/// 0.5 is hidden; the plain model says 0.4 and the one with the effect 0.55, both ± 0.05.
#[test]
fn parameters_are_compared_with_those_of_the_model_that_holds_what_is_hidden() {
    let row = |model: &str, name: &str, value: f64| RecalibrationRow {
        measured: "challenge".to_owned(),
        model: model.to_owned(),
        name: name.to_owned(),
        value,
        standard_error: 0.05,
        unit: "1".to_owned(),
        at_bound: false,
    };
    let rows =
        ["sliding_friction", "cohesion"].map(|name| [row("before", name, 0.4), row("after", name, 0.55)]).concat();
    let off = |hidden: Option<(&str, f64)>, verdict: (&str, &str)| {
        let (declared, solved) = (declared(hidden, false), solved(verdict, "named", 0.0));
        parameters_off(&declared, &score(&declared, &solved), &rows)
    };
    let one = |off: BTreeMap<String, f64>| off.get("sliding_friction").map(|off| (off * 1e9).round() / 1e9);
    assert_eq!(one(off(Some(("cohesion", 1.0)), ("effect", "cohesion"))), Some(1.0));
    assert_eq!(one(off(None, ("no_detectable_discrepancy", ""))), Some(-2.0));
    assert!(off(Some(("cohesion", 1.0)), ("effect", "tilt")).is_empty(), "another effect's parameters");
    assert!(off(None, ("none_of_the_candidates", "")).is_empty(), "a false alarm");
}

#[test]
fn answers_are_scored_as_the_truth_allows() {
    let none = ("none_of_the_candidates", "");
    let quiet = ("no_detectable_discrepancy", "");
    let strong = Some(("cohesion", 0.8));
    let told = |verdict| is_right(strong, false, verdict, "named", 0.0);
    assert!(told(("effect", "cohesion")) && told(("class", "tilt,cohesion")) && told(("class", "a,b,cohesion")));
    assert!(
        !told(("pair", "cohesion,tilt"))
            && !told(("class", "a,b,c,cohesion"))
            && !told(("effect", "tilt"))
            && !told(quiet)
            && !told(none)
    );
    // Below the detection limit nothing need be seen.
    let weak = |verdict| is_right(Some(("cohesion", 0.4)), false, verdict, "named", 0.0);
    assert!(weak(quiet) && weak(("effect", "cohesion")) && !weak(none) && !weak(("effect", "tilt")));
    assert!(
        is_right(None, false, quiet, "rejected", 0.0) && !is_right(None, false, ("effect", "tilt"), "rejected", 0.0)
    );
    assert!(is_right(None, true, none, "rejected", 0.0) && !is_right(None, true, quiet, "rejected", 0.0));
    // Left out: none of them, unless the nearest looks the same.
    let left_out = |verdict, separation| is_right(strong, false, verdict, "left_out", separation);
    assert!(left_out(none, 50.0) && !left_out(("effect", "tilt"), 50.0) && !left_out(quiet, 50.0));
    assert!(left_out(none, 1.0) && left_out(("effect", "tilt"), 1.0) && left_out(quiet, 1.0));
}

#[test]
fn a_name_alone_is_due_where_no_rival_comes_near() {
    // Half of D² at the strength of 1 that was found; 0.8 is hidden, so that D² is 1.28 times this.
    let of = |verdict, part, separation| scored(Some(("cohesion", 0.8)), false, verdict, part, separation);
    let far = of(("effect", "cohesion"), "named", 8.0);
    assert!((far.separation.expect("a rival") - 10.24).abs() < 1e-12);
    assert!(far.is_due_alone() && far.is_alone());
    let class = of(("class", "tilt,cohesion"), "named", 8.0);
    assert!(class.correct && class.is_due_alone() && !class.is_alone());
    assert!(!of(("class", "tilt,cohesion"), "named", 7.5).is_due_alone(), "D² = 9.6");
    assert!(!of(("effect", "tilt"), "named", 8.0).is_alone(), "another name");
    assert!(!of(("none_of_the_candidates", ""), "left_out", 80.0).is_due_alone(), "no candidate");
    let quiet = ("no_detectable_discrepancy", "");
    assert!(of(quiet, "named", 8.0).is_due_alone(), "a miss");
    let weak = scored(Some(("cohesion", 0.4)), false, quiet, "named", 80.0);
    assert!(weak.separation > Some(10.0) && !weak.is_due_alone(), "nothing need be seen below the detection limit");
}

#[test]
fn a_score_tells_how_far_a_strength_is_off_and_whether_it_could_be_found() {
    let of = |strength, verdict| scored(Some(("cohesion", strength)), false, verdict, "named", 0.0);
    let named = of(0.8, ("class", "tilt,cohesion"));
    assert!(named.is_detectable() && named.names_truth());
    assert!((named.off().expect("a strength") - 2.0).abs() < 1e-12);
    let missed = of(0.4, ("effect", "tilt"));
    assert!(!missed.is_detectable() && !missed.names_truth() && missed.off().is_none());
    assert!(!scored(Some(("cohesion", 0.8)), false, ("effect", "tilt"), "left_out", 0.0).is_detectable());
}
