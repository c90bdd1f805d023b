//! Controls: an offset of the model that data of one origin share is taken off, and what an effect adds is still found.

use crate::support::Study;
use granulake::store::table;
use granulake::tables::{BeforeAfterRow, ResidualRow, Row, VerdictRow};

const STUDY: &[(&str, &str)] = &[
    ("refine_repetitions = 3", "refine_repetitions = 60"),
    ("anchors = 1\n", "anchors = 8\n"),
    ("anchor_repetitions = 2", "anchor_repetitions = 8"),
    ("refine_points = 4", "refine_points = 8"),
    ("interior = 2", "interior = 6"),
    ("\nrepetitions = 2\nresolution", "\nrepetitions = 4\nresolution"),
];

/// Makes data with a smaller cylinder than the model's, and an effect or none.
fn measure(study: &Study, name: &str, seed: &str, effect: &[&str]) {
    let fixed = ["challenge", "new", "--seed", seed, "--n", "20", "--n-held-out", "3", "--out", name];
    study.succeed(&[&fixed[..], &["--scale", "bulk_density.fill_height=0.93"], effect].concat());
}

fn set(name: &str, folder: &str, controls: &str) -> String {
    format!(
        "[[measured]]\nname = \"{name}\"\npath = \"{folder}/measured.csv\"\ncomparable = true\ncontrols = {controls}\n\n"
    )
}

#[test]
fn what_the_model_misses_of_its_controls_is_taken_off() {
    let study = Study::quick();
    STUDY.iter().for_each(|(from, to)| study.edit("pipeline.toml", from, to));
    study.succeed(&["repro", "train"]);
    let none = ["--effect", "none"];
    measure(&study, "first", "21", &none);
    measure(&study, "second", "22", &none);
    measure(&study, "bare", "23", &none);
    measure(&study, "sized", "24", &["--effect", "size_distribution", "--strength", "0.2"]);
    let controls = "[\"first\", \"second\"]";
    let sets = [
        set("first", "first", "[]"),
        set("second", "second", "[]"),
        set("bare", "bare", "[]"),
        set("less", "bare", controls),
        set("sized", "sized", controls),
        set("doubted", "bare", "[]"),
        set("doubted_sized", "sized", "[]"),
    ];
    // The cylinder of the data is 7 % lower than the model's.
    let doubt = |set: &str| {
        format!("[[uncertain]]\nmeasured = \"{set}\"\nsetting = \"bulk_density.fill_height\"\nsd = \"1.5 cm\"\n\n")
    };
    let more = sets.concat() + &doubt("doubted") + &doubt("doubted_sized");
    study.edit("pipeline.toml", "[metamodel]", &(more + "[metamodel]"));
    let diagnosed = ["first", "bare", "less", "sized", "doubted", "doubted_sized"].map(|name| format!("\"{name}\""));
    study.edit("pipeline.toml", "[diagnose]", &format!("[diagnose]\nmeasured = [{}]", diagnosed.join(", ")));
    study.succeed(&["repro", "diagnose"]);

    let verdicts: Vec<VerdictRow> = table::read(&study.path("artifacts"), VerdictRow::SPEC).expect("a table");
    let of = |name: &str| verdicts.iter().find(|row| row.measured == name).expect("a verdict");
    let told: Vec<_> = verdicts.iter().map(|row| (&*row.measured, &*row.verdict, &*row.effects, row.p)).collect();
    // At the level at which a verdict is given: correlations from a few dozen runs leave tests little beyond it.
    assert!(of("first").p < 0.05 && of("bare").p < 0.05, "the offset is seen: {told:?}");
    assert_eq!(of("less").verdict, "no_detectable_discrepancy", "{told:?}");
    assert_eq!((&*of("sized").verdict, &*of("sized").effects), ("effect", "size_distribution"), "{told:?}");
    assert!(of("less").advice.contains("taken off as seen in first (p = 0.0"), "{}", of("less").advice);
    assert!(!of("bare").advice.contains("taken off"), "{}", of("bare").advice);
    // A dimension that is known no better explains the same as far as it may be off, and hides nothing else.
    assert_eq!(of("doubted").verdict, "no_detectable_discrepancy", "{told:?}");
    assert!(of("doubted").advice.contains("move it by -"), "{}", of("doubted").advice);
    assert_eq!(
        (&*of("doubted_sized").verdict, &*of("doubted_sized").effects),
        ("effect", "size_distribution"),
        "{told:?}"
    );

    let residuals: Vec<ResidualRow> = table::read(&study.path("artifacts"), ResidualRow::SPEC).expect("a table");
    let error = |name: &str| {
        let is_it = |row: &&ResidualRow| row.measured == name && row.kpi == "bulk_density" && row.statistic == "mean";
        let row = residuals.iter().find(is_it).expect("a row");
        (row.measured_value, row.standard_error)
    };
    assert!(
        error("less").0 > 1.03 * error("bare").0,
        "corrected for the missing {:?} {:?}",
        error("less"),
        error("bare")
    );
    assert!(error("less").1 > error("bare").1, "the offset is not known exactly");
    let compared: Vec<BeforeAfterRow> = table::read(&study.path("artifacts"), BeforeAfterRow::SPEC).expect("a table");
    let row =
        compared.iter().find(|row| row.measured == "sized" && row.kpi == "bulk_density" && row.statistic == "mean");
    let row = row.expect("a row");
    let (lower, upper) = (row.after_lower_percent.expect("a limit"), row.after_upper_percent.expect("a limit"));
    assert!(lower < 0.0 && 0.0 < upper, "{row:?}");
}
