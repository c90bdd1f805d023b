//! The loop on data with an undeclared effect: the shipped study on the shipped demo, as a new user runs it.
//!
//! The demo was made by `challenge new` with hidden parameters, packings that no stage can draw, and an effect that the
//! study does not declare. The study must name that effect, find its strength, and come nearer to every KPI it fitted
//! and to the hopper it never saw; against the paper's values it must refuse a verdict.

use crate::support::Study;
use granulake::tables::{BeforeAfterRow, RecalibrationRow, VerdictRow};

/// What `artifacts/measured/demo/sealed.toml` declares; read by this test alone.
fn hidden_strength() -> f64 {
    let sealed: toml::Table = include_str!("../../artifacts/measured/demo/sealed.toml").parse().expect("TOML");
    sealed["effects"]["cohesion"].as_float().expect("a strength")
}

#[test]
fn the_shipped_study_names_the_hidden_effect() {
    let study = Study::new(&[
        ("pipeline.toml", include_str!("../../pipeline.toml")),
        ("artifacts/measured/fransen2022.csv", include_str!("../../artifacts/measured/fransen2022.csv")),
        ("artifacts/measured/demo/measured.csv", include_str!("../../artifacts/measured/demo/measured.csv")),
    ]);
    study.succeed(&["repro"]);
    let verdicts: Vec<VerdictRow> = study.table();
    let verdict = |name: &str| verdicts.iter().find(|row| row.measured == name).expect("a verdict");
    let demo = verdict("demo");
    assert_eq!((demo.verdict.as_str(), demo.effects.as_str()), ("effect", "cohesion"), "{}", demo.sentence);
    assert_eq!(verdict("paper").verdict, "not_attributable", "{}", verdict("paper").sentence);
    the_strength_is_recovered(&study);
    the_errors_shrink(&study);
}

/// Within three standard errors.
fn the_strength_is_recovered(study: &Study) {
    let rows: Vec<RecalibrationRow> = study.table();
    let row = rows.iter().find(|row| row.measured == "demo" && row.name == "cohesion").expect("a strength");
    let deviation = (row.value - hidden_strength()) / row.standard_error;
    assert!(deviation.abs() < 3.0, "{} ± {} against {}", row.value, row.standard_error, hidden_strength());
}

/// After the effect was added no KPI's mean differs from the measurement beyond its interval, fitted or held out, and
/// none of the four is further off than before.
fn the_errors_shrink(study: &Study) {
    let rows: Vec<BeforeAfterRow> = study.table();
    let kpis = ["angle_of_repose", "angle_of_movement", "bulk_density", "discharge_rate"];
    for kpi in kpis {
        let row = rows.iter().find(|row| row.measured == "demo" && row.kpi == kpi && row.statistic == "mean");
        let row = row.expect("a row");
        let known = |value: Option<f64>| value.expect("a simulated value");
        let (before, after) = (known(row.before_error_percent), known(row.after_error_percent));
        assert!(after.abs() <= before.abs(), "{kpi}: {before} % before, {after} % after");
        let (lower, upper) = (known(row.after_lower_percent), known(row.after_upper_percent));
        assert!(lower < 0.0 && upper > 0.0, "{kpi}: {after} % after, [{lower}, {upper}]");
        assert_eq!(row.fitted, kpi != "discharge_rate");
    }
}
