//! A class of effects comes with the measurement that would separate them, and that measurement does.

use crate::support::Study;
use granulake::store::table;
use granulake::tables::{Row, VerdictRow};

const STUDY: &[(&str, &str)] = &[
    ("refine_repetitions = 3", "refine_repetitions = 24"),
    ("anchors = 1\n", "anchors = 8\n"),
    ("anchor_repetitions = 2", "anchor_repetitions = 6"),
    ("refine_points = 4", "refine_points = 8"),
    ("[\"size_distribution\"]", "[\"density_bias\", \"low_fill\"]"),
    ("interior = 2", "interior = 6"),
    ("\nrepetitions = 2\nresolution", "\nrepetitions = 4\nresolution"),
];
/// The density of the grains for a parameter: weighings of them tell it from a bias of the tests.
const SLIDING: &str = "[parameters.sliding_friction]\nlower = 0.2\nupper = 0.8";
const DENSITY: &str = "[parameters.particle_density]\nlower = 2000\nupper = 3500";
const LOW_FILL: &str = "[effects.low_fill]\nsetting = \"bulk_density.fill_height\"\nkind = \"shift\"\nrelative = true\n\
                        range = [-0.3, 0.3]\nsource = \"a ruler held askew\"\n\n";

#[test]
fn the_measurement_proposed_for_a_class_separates_it() {
    let study = Study::quick();
    STUDY.iter().for_each(|(from, to)| study.edit("pipeline.toml", from, to));
    study.edit("pipeline.toml", SLIDING, DENSITY);
    study.edit("pipeline.toml", "[metamodel]", &(LOW_FILL.to_owned() + "[metamodel]"));
    study.succeed(&["repro", "train"]);
    let hidden = ["challenge", "new", "--seed", "11", "--effect", "density_bias", "--strength", "0.1", "--n", "20"];
    study.succeed(&[&hidden[..], &["--n-held-out", "3", "--out", "full"]].concat());
    let all = std::fs::read_to_string(study.path("full/measured.csv")).expect("data");
    let verdict = |folder: &str, kept: &[&str]| {
        let read = |line: &&str| {
            line.starts_with("grains") || !line.contains(',') || kept.iter().any(|kpi| line.contains(kpi))
        };
        let lines: Vec<&str> = all.lines().filter(read).collect();
        std::fs::create_dir(study.path(folder)).expect("a folder");
        std::fs::write(study.path(folder).join("measured.csv"), lines.join("\n") + "\n").expect("a file");
        study.succeed(&["challenge", "solve", folder]);
        let rows: Vec<VerdictRow> =
            table::read(&study.path(&format!("{folder}/solution")), VerdictRow::SPEC).expect("a table");
        rows.into_iter().next().expect("a verdict")
    };
    let few = verdict("few", &["kpi", "angle_of_movement", ",bulk_density,"]);
    assert_eq!((&*few.verdict, few.effects.split(',').count()), ("class", 2), "{few:?}");
    let advice = few.advice.split(": ").collect::<Vec<_>>();
    assert_eq!(advice[0], "measure ledge_mass (20 repetitions of ledge)", "{few:?}");
    let leads: Vec<f64> = advice[1].split([' ', ';']).filter_map(|word| word.parse().ok()).collect();
    assert!(leads[0] < 3.0 && leads[1] > 5.0, "{few:?}");
    let more = verdict("more", &["kpi", "angle_of_movement", ",bulk_density,", "ledge_mass"]);
    assert_eq!((&*more.verdict, &*more.effects), ("effect", "density_bias"), "{more:?}");
}
