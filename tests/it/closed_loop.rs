//! The loop on data with an undeclared effect: what was hidden is named, what was not is not.
//!
//! One study, four blind data sets made by `challenge`: two hide an effect of the library, with parameters drawn by
//! their seed and packings that no stage can draw; one hides nothing; one hides a change that no candidate describes.
//! The measured sets hold twenty repetitions of each test and the extra observables. Beside them stand the paper's
//! targets, which a coarse set-up may not judge.

use crate::support::{Study, shipped_setup};
use granulake::campaign::Point;
use granulake::config::Measured;
use granulake::store::table;
use granulake::tables::{
    AttributionRow, BeforeAfterRow, DIAGNOSE_KPIS, DIAGNOSE_RUNS, HeldOutRow, KpiRow, PointRow, PriorWidthRow,
    RecalibrationRow, RunRow, VerdictRow,
};
use std::collections::{BTreeMap, BTreeSet};

const HEAD: &str = r#"
[study]
name = "blind"
seed = 5
repetitions = 3
resolution = "coarse"

[parameters.sliding_friction]
lower = 0.1
upper = 0.9

[parameters.rolling_friction]
lower = 0.1
upper = 0.9

[parameters.particle_density]
lower = 2542.9
upper = 2834.7

[design]
boundary_levels = 3
interior = 20
validation = 1

[metamodel]
kinds = ["sk"]

[calibrate]
approaches = ["m"]

[verify]
counts = [3]

[validate]
repetitions = 2

[diagnose]
candidates = ["cohesion", "wall_friction_scatter", "size_distribution"]
anchors = 36
anchor_repetitions = 4
refine_points = 24
refine_repetitions = 40
bootstrap = 400

"#;

/// Name of the data set and how it is made.
const SETS: [(&str, &[&str]); 4] = [
    ("wet", &["--seed", "101", "--effect", "cohesion", "--strength", "1.0"]),
    ("large", &["--seed", "102", "--effect", "size_distribution", "--strength", "0.15"]),
    ("plain", &["--seed", "104", "--effect", "none"]),
    ("foreign", &["--seed", "105", "--effect", "none", "--scale", "ledge.fill_height=0.8"]),
];

fn study() -> Study {
    let mut text = HEAD.to_owned() + &shipped_setup();
    for (name, _) in SETS {
        text += &format!("[[measured]]\nname = \"{name}\"\npath = \"{name}/measured.csv\"\ncomparable = true\n\n");
    }
    text += "[[measured]]\nname = \"paper\"\npath = \"paper.csv\"\ncomparable = false\n";
    let paper = include_str!("../../artifacts/measured/fransen2022.csv");
    let study = Study::new(&[("pipeline.toml", &text), ("paper.csv", paper)]);
    for (name, arguments) in SETS {
        study.succeed(
            &[&["challenge", "new", "--out", name, "--n-held-out", "4", "--weighings", "0"], arguments].concat(),
        );
        // The loop is run with the seal gone: no stage can have read it.
        std::fs::remove_file(study.path(&format!("{name}/sealed.toml"))).expect("a seal");
    }
    study
}

#[test]
fn hidden_effects_are_named_and_nothing_else_is() {
    let study = study();
    study.succeed(&["repro"]);
    let verdicts: Vec<VerdictRow> = study.table();
    let verdict = |name: &str| verdicts.iter().find(|row| row.measured == name).expect("a verdict");
    for (name, effect, strength) in [("wet", "cohesion", 1.0), ("large", "size_distribution", 0.15)] {
        let row = verdict(name);
        assert_eq!((row.verdict.as_str(), row.effects.as_str()), ("effect", effect), "{name}: {}", row.sentence);
        assert!(
            row.sentence.contains(&format!(" With {effect} in the model the 95 % intervals of ")),
            "{}",
            row.sentence
        );
        strength_is_recovered(&study, name, effect, strength);
        errors_shrink(&study, name);
        held_out_means_are_within(&study, name);
        held_out_means_have_a_say(&study, name, effect, &row.sentence);
    }
    priors_are_varied(&study, &verdicts);
    assert_eq!(verdict("plain").verdict, "no_detectable_discrepancy", "{}", verdict("plain").sentence);
    assert_eq!(verdict("foreign").verdict, "none_of_the_candidates", "{}", verdict("foreign").sentence);
    assert_eq!(verdict("paper").verdict, "not_attributable", "{}", verdict("paper").sentence);
    assert_eq!(optimum_is_where_runs_stand(&study, "paper"), 1, "no closer look, so the optimum stays");
    for (name, _) in SETS {
        let places = optimum_is_where_runs_stand(&study, name);
        assert!((1..=4).contains(&places), "{name}: {places}");
    }
    errors_are_confirmed_by_runs_of_their_own(&study);
    every_run_has_its_parameters(&study);
    repetitions_are_held_out(&study, "wet", "cohesion");
}

/// A fifth of the repetitions is kept from the fits: every fifth value, against which both models are held like the hopper.
fn repetitions_are_held_out(study: &Study, name: &str, effect: &str) {
    let all: Vec<BeforeAfterRow> = study.table();
    assert!(all.iter().all(|row| !row.held_out_repetitions), "none are held out unless it is asked for");
    let share = format!("[diagnose]\nmeasured = [\"{name}\"]\nheld_out_share = 0.2");
    study.edit("pipeline.toml", "[diagnose]", &share);
    study.succeed(&["repro", "diagnose"]);
    let verdicts: Vec<VerdictRow> = study.table();
    assert_eq!((verdicts.len(), verdicts[0].effects.as_str()), (1, effect), "{}", verdicts[0].sentence);
    let rows: Vec<BeforeAfterRow> = study.table();
    let measured = Measured::read(name, &study.path(&format!("{name}/measured.csv"))).expect("measured data");
    let (mut count, mut within) = (0, 0);
    for row in rows.iter().filter(|row| row.experiment != "hopper" && row.statistic == "mean") {
        let is_out = |repetition: u32| repetition.is_multiple_of(5) == row.held_out_repetitions;
        let values = measured.series_of(&row.kpi).into_iter().filter(|(repetition, _)| is_out(*repetition));
        let values: Vec<f64> = values.map(|(_, value)| value).collect();
        assert_eq!(values.len(), if row.held_out_repetitions { 4 } else { 16 }, "{row:?}");
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        assert!((row.measured_value - mean).abs() < 1e-9 * mean.abs().max(1.0), "{row:?}, not {mean}");
        assert!(!(row.fitted && row.held_out_repetitions), "{row:?}");
        if let (true, Some(lower), Some(upper)) =
            (row.held_out_repetitions, row.after_lower_percent, row.after_upper_percent)
        {
            count += 1;
            within += usize::from(lower <= 0.0 && 0.0 <= upper);
        }
    }
    assert!(count >= 6 && within + 2 >= count, "{within} of {count} held-out means within their intervals");
    let judged: Vec<HeldOutRow> = study.table();
    let of_repetitions = judged.iter().filter(|row| row.experiment != "hopper");
    let compared = rows.iter().filter(|row| row.held_out_repetitions && row.statistic == "mean");
    assert!(of_repetitions.clone().map(|row| &row.kpi).eq(compared.map(|row| &row.kpi)), "{judged:?}");
    assert!(of_repetitions.clone().any(|row| row.judgement == "better"), "{judged:?}");
    assert!(judged.iter().all(|row| row.judgement != "worse"), "{judged:?}");
}

/// Eight widths of the priors beside the study's own. What is hidden plainly is named by all of them; where any says something
/// else, the advice tells.
fn priors_are_varied(study: &Study, verdicts: &[VerdictRow]) {
    let widths: Vec<PriorWidthRow> = study.table();
    for (name, _) in SETS {
        let own = verdicts.iter().find(|row| row.measured == name).expect("a verdict");
        let of_set: Vec<_> = widths.iter().filter(|row| row.measured == name).collect();
        assert_eq!(of_set.len(), 8, "{name}");
        assert!(of_set.iter().all(|row| (row.strength_factor, row.other_factor) != (1.0, 1.0)), "{of_set:?}");
        let differs = |row: &&&PriorWidthRow| (&row.verdict, &row.effects) != (&own.verdict, &own.effects);
        let differ = of_set.iter().filter(differs).count();
        let told = format!("{differ} of 8 other widths of the priors");
        assert_eq!(own.advice.contains("other widths of the priors"), differ > 0, "{}", own.advice);
        assert!(differ == 0 || own.advice.contains(&told), "{name}: {} but {of_set:?}", own.advice);
        assert!(own.verdict != "effect" || differ == 0, "{name}: {of_set:?}");
    }
}

/// One row per mean of the hopper, which tells what the sentence says, with the errors of the table beside it.
fn held_out_means_have_a_say(study: &Study, name: &str, effect: &str, sentence: &str) {
    let rows: Vec<HeldOutRow> = study.table();
    let rows: Vec<_> = rows.iter().filter(|row| row.measured == name).collect();
    let compared: Vec<BeforeAfterRow> = study.table();
    let is_mean = |row: &&BeforeAfterRow| row.measured == name && row.experiment == "hopper" && row.statistic == "mean";
    let means: Vec<_> = compared.iter().filter(is_mean).collect();
    assert!(!rows.is_empty() && rows.len() == means.len(), "{name}: {rows:?}");
    let close = |a: Option<f64>, b: Option<f64>| a.zip(b).map_or(a == b, |(a, b)| (a - b).abs() < 1e-9);
    for (row, mean) in rows.iter().zip(means) {
        assert_eq!((&row.kpi, row.effect.as_str()), (&mean.kpi, effect));
        assert!(close(row.before_error, mean.before.map(|before| before - mean.measured_value)), "{row:?}");
        assert!(close(row.change, mean.after.zip(mean.before).map(|(after, before)| after - before)), "{row:?}");
    }
    // The effect is in the data, so that it makes nothing worse.
    assert!(rows.iter().all(|row| row.judgement != "worse"), "{name}: {rows:?}");
    assert!(!sentence.contains("is kept") && sentence.to_lowercase().contains("held"), "{sentence}");
}

/// Where a run stands is told: the parameters and effects of its point hash to what the run has, and no point is told without runs.
fn every_run_has_its_parameters(study: &Study) {
    let loaded = granulake::pipeline::Study::load(&study.path("pipeline.toml")).expect("a study");
    let config = &loaded.config;
    let is_effect = |row: &&PointRow| config.effects.library.find(&row.name).is_ok();
    let values = |rows: &[&PointRow]| rows.iter().map(|row| (row.name.clone(), row.value)).collect::<Vec<_>>();
    let told: Vec<PointRow> = study.table();
    let mut of_point: BTreeMap<(String, u32), Vec<&PointRow>> = BTreeMap::new();
    for row in &told {
        of_point.entry((row.label.clone(), row.point)).or_default().push(row);
    }
    let runs: Vec<RunRow> = table::read(&study.path("artifacts"), &DIAGNOSE_RUNS).expect("a table");
    let places: BTreeSet<(String, u32)> = runs.iter().map(|run| (run.label.clone(), run.point)).collect();
    assert!(places.iter().eq(of_point.keys()), "points of runs are not those that are told");
    let hashes = of_point.iter().map(|(place, rows)| {
        let (effects, parameters): (Vec<&PointRow>, Vec<&PointRow>) = rows.iter().copied().partition(is_effect);
        assert_eq!(parameters.len(), config.parameters.len(), "{place:?}");
        let point = Point::new(place.1, config.base_settings(), &values(&parameters)).expect("a point");
        (place, point.with_effects(&values(&effects)).hash().expect("a hash").to_string())
    });
    let hashes: BTreeMap<_, _> = hashes.collect();
    for run in &runs {
        assert_eq!(run.parameter_hash, hashes[&(run.label.clone(), run.point)], "{} {}", run.label, run.point);
    }
}

/// Runs behind the errors of fitted tests have seeds that no other run of the diagnosis has: no fit and no choice knows them.
fn errors_are_confirmed_by_runs_of_their_own(study: &Study) {
    let runs: Vec<RunRow> = table::read(&study.path("artifacts"), &DIAGNOSE_RUNS).expect("a table");
    let (own, others): (Vec<&RunRow>, Vec<&RunRow>) = runs.iter().partition(|run| run.label.ends_with(" confirmation"));
    let seeds: BTreeSet<u64> = others.iter().map(|run| run.seed).collect();
    assert!(own.iter().all(|run| !seeds.contains(&run.seed)), "a run that confirms was seen before");
    let places: BTreeSet<&str> = own.iter().map(|run| run.label.as_str()).collect();
    let before = ["foreign", "large", "paper", "plain", "wet"].map(|name| format!("{name}/before confirmation"));
    let after = ["large", "wet"].map(|name| format!("{name}/after confirmation"));
    let expected: BTreeSet<&str> = before.iter().chain(&after).map(String::as_str).collect();
    assert_eq!(places, expected);
}

/// "Before" is the mean of the confirming runs at the last place at which the optimum was simulated; gives the number of such
/// places.
fn optimum_is_where_runs_stand(study: &Study, name: &str) -> u32 {
    let kpis: Vec<KpiRow> = table::read(&study.path("artifacts"), &DIAGNOSE_KPIS).expect("a table");
    let of = |label: String| kpis.iter().filter(move |row| row.label == label && row.kpi == "angle_of_repose");
    let places = of(format!("{name}/before")).map(|row| row.point).max().expect("runs at the optimum");
    let hash = |row: &KpiRow| row.parameter_hash.clone();
    let place = of(format!("{name}/before")).filter(|row| row.point == places).map(hash).collect::<BTreeSet<_>>();
    let confirming: Vec<&KpiRow> = of(format!("{name}/before confirmation")).collect();
    assert_eq!(confirming.iter().map(|row| hash(row)).collect::<BTreeSet<_>>(), place, "{name}: another place");
    let values: Vec<f64> = confirming.iter().filter_map(|row| row.value).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let rows: Vec<BeforeAfterRow> = study.table();
    let is_it = |row: &&BeforeAfterRow| row.measured == name && row.kpi == "angle_of_repose" && row.statistic == "mean";
    let before = rows.iter().find(is_it).and_then(|row| row.before).expect("a mean");
    assert!((before - mean).abs() < 1e-9 * mean.abs(), "{name}: {before} in the table, {mean} of the runs");
    places
}

/// Within three standard errors, and the model that is simulated has what the verdict says.
fn strength_is_recovered(study: &Study, name: &str, effect: &str, strength: f64) {
    let rows: Vec<RecalibrationRow> = study.table();
    let row = rows.iter().find(|row| row.measured == name && row.name == effect).expect("a strength");
    let deviation = (row.value - strength) / row.standard_error;
    assert!(deviation.abs() < 3.0, "{name}: {effect} {} ± {} against {strength}", row.value, row.standard_error);
    let attribution: Vec<AttributionRow> = study.table();
    let named = attribution.iter().find(|row| row.measured == name && row.effect == effect).expect("an attribution");
    assert_eq!((row.value, row.standard_error), (named.strength, named.strength_sd), "{name}: {effect}");
}

/// Every fitted mean has an error and an interval before and after. The mean square of the errors, each over the half width of its
/// interval, shrinks by half or more.
fn errors_shrink(study: &Study, name: &str) {
    let rows: Vec<BeforeAfterRow> = study.table();
    let (mut before, mut after, mut count) = (0.0, 0.0, 0);
    for row in rows.iter().filter(|row| row.measured == name && row.fitted && row.statistic == "mean") {
        let known = (row.before_error, row.after_error, row.before_lower);
        let (Some(old), Some(new), Some(lower)) = known else { panic!("{row:?}") };
        let width = old - lower;
        before += old * old / (width * width);
        after += new * new / (width * width);
        count += 1;
    }
    assert!(count >= 6, "{name}: only {count} fitted means");
    assert!(after < 0.5 * before, "{name}: {after} after, {before} before, over {count} means");
}

/// Held-out means are off by no more than twice the half width of an interval for which the held-out experiment was simulated at
/// both ends of as many axes as parameters and strength are open, and nothing else was.
fn held_out_means_are_within(study: &Study, name: &str) {
    let runs: Vec<RunRow> = table::read(&study.path("artifacts"), &DIAGNOSE_RUNS).expect("a table");
    let found: Vec<RecalibrationRow> = study.table();
    for model in ["before", "after"] {
        let of_model = found.iter().filter(|row| row.measured == name && row.model == model);
        let open = of_model.filter(|row| row.standard_error > 0.0).count();
        let label = format!("{name}/{model} leeway");
        let of_model: Vec<&RunRow> = runs.iter().filter(|row| row.label == label).collect();
        assert!(of_model.iter().all(|row| row.experiment == "hopper"), "{label}");
        assert_eq!(of_model.iter().map(|row| row.point).collect::<BTreeSet<_>>().len(), 2 * open, "{label}");
    }
    let rows: Vec<BeforeAfterRow> = study.table();
    let mut count = 0;
    for row in rows.iter().filter(|row| row.measured == name && !row.fitted && row.statistic == "mean") {
        let Some(error) = row.after_error_percent else { continue };
        let half = row.after_upper_percent.expect("a limit") - error;
        assert!(error.abs() < 2.0 * half, "{name}: {} {error} ± {half} %", row.kpi);
        count += usize::from(row.experiment == "hopper");
    }
    assert!(count >= 1, "{name}: no held-out mean has an error");
}

/// The verdict names nothing in the quick study; a name in its place adds that effect all the same, and nothing with "none".
#[test]
fn an_effect_is_added_as_the_study_accepts_it() {
    let study = Study::quick();
    study.succeed(&["repro"]);
    let models = || {
        let rows: Vec<RecalibrationRow> = study.table();
        rows.into_iter().map(|row| (row.model, row.name)).collect::<BTreeSet<_>>()
    };
    let (after, strength) = ("after".to_owned(), ("after".to_owned(), "size_distribution".to_owned()));
    let plain = models();
    assert!(plain.iter().all(|(model, _)| *model != after), "{plain:?}");
    study.edit("pipeline.toml", "[diagnose]", "[effects]\naccept = \"size_distribution\"\n\n[diagnose]");
    study.succeed(&["repro"]);
    assert!(models().contains(&strength), "{:?}", models());
    let added: Vec<BeforeAfterRow> = study.table();
    assert!(added.iter().any(|row| row.after_error_percent.is_some()), "{added:?}");
    let judged: Vec<HeldOutRow> = study.table();
    let told: Vec<_> = judged.iter().map(|row| (row.kpi.as_str(), row.change, row.judgement.as_str())).collect();
    assert_eq!(told, [("angle_of_repose", None, "cannot_judge")], "an arch over the slot of this pile, in every run");
    let verdicts: Vec<VerdictRow> = study.table();
    let said = " The held-out data cannot judge size_distribution.";
    assert!(verdicts[0].sentence.ends_with(said), "{}", verdicts[0].sentence);
    study.edit("pipeline.toml", "accept = \"size_distribution\"", "accept = \"none\"");
    study.edit("pipeline.toml", "[diagnose]", "[diagnose]\nheld_out_share = 0.2");
    study.succeed(&["repro"]);
    let verdicts: Vec<VerdictRow> = study.table();
    assert!(verdicts[0].advice.contains("no repetitions are held out"), "{}", verdicts[0].advice);
    assert_eq!(models(), plain);
    let judged: Vec<HeldOutRow> = study.table();
    assert!(judged.is_empty(), "{judged:?}");
}
