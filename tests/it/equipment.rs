//! Meshes of the user in an apparatus: what they do to the grains, to keys and to the stages, and how mistakes are answered.

use crate::support::Study;
use granulake::config::Config;
use granulake::dem::{self, State};
use granulake::experiments;
use granulake::settings::Settings;
use granulake::tables::RunRow;
use serde_json::Value;

const STL: &str = "equipment/insert.stl";
const SECTION: &str = "\n[[equipment]]\nexperiment = \"bulk_density\"\nname = \"insert\"\nstl = \"equipment/insert.stl\"\n\
                       unit = \"mm\"\nmaterial = \"acrylic\"\n";

/// Half a side and the height of a block on the floor of the cylinder, whose radius is 40 mm [mm].
const HALF: f32 = 15.0;
const HEIGHT: f32 = 36.0;

type Triangle = [[f32; 3]; 3];

/// A closed box: twelve triangles.
fn block(half: f32, height: f32) -> Vec<Triangle> {
    let corner = |k: usize| {
        let side = |bit: usize| if k & bit == 0 { -half } else { half };
        [side(1), side(2), if k & 4 == 0 { 0.0 } else { height }]
    };
    let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    faces.iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]].map(|face| face.map(|k| corner(*k)))).collect()
}

fn binary(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        triangle.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

fn ascii(triangles: &[Triangle]) -> String {
    let vertices = |t: &Triangle| t.iter().map(|[x, y, z]| format!("vertex {x} {y} {z}\n")).collect::<String>();
    let facet = |t: &Triangle| format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", vertices(t));
    format!("solid block\n{}endsolid\n", triangles.iter().map(facet).collect::<String>())
}

/// Writes the mesh.
fn place(study: &Study, bytes: &[u8]) {
    study.write(STL, "");
    std::fs::write(study.path(STL), bytes).expect("a file");
}

/// The quick study with a block in the density cylinder.
fn equipped() -> Study {
    let study = Study::quick();
    place(&study, &binary(&block(HALF, HEIGHT)));
    equip(&study);
    study
}

fn equip(study: &Study) {
    study.edit("pipeline.toml", "\n[[measured]]", &format!("{SECTION}\n[[measured]]"));
}

fn settings(study: &Study) -> Settings {
    Config::load(&study.path("pipeline.toml")).unwrap_or_else(|e| panic!("{e}")).base_settings().clone()
}

fn simulate(settings: &Settings) -> (State, f64) {
    let test = experiments::find("bulk_density").expect("an experiment");
    let outcome = dem::simulate(&test.setup(settings).expect("a set-up"), 3).expect("a run");
    let density = test.measure(settings, &outcome.state, &outcome.trace)[0].1.clone().expect("a density");
    (outcome.state, density)
}

/// Grains lie about the block and on it, none in it, though it covers the middle of the area that is filled; so fewer fit into
/// the cylinder. A grain that lies on it sinks in by its share of the load over the stiffness, here less than a tenth of its radius.
#[test]
fn grains_rest_on_a_mesh_and_none_starts_in_it() {
    let study = equipped();
    let mut with = settings(&study);
    // Long enough to come to rest.
    for (name, value) in [("bulk_density.deletion_time", 0.4), ("bulk_density.time_cap", 0.8), ("radius_scale", 1.0)] {
        with.set(name, value).unwrap();
    }
    let mut without = with.clone();
    without.equip(Vec::new());
    let ((state, density), (_, empty)) = (simulate(&with), simulate(&without));
    let (half, top) = (f64::from(HALF) * 1e-3, f64::from(HEIGHT) * 1e-3);
    let over = |i: &usize| state.x[*i].abs() < half && state.y[*i].abs() < half;
    let lowest = |i: usize| (state.z[i] - top) / state.radius[i];
    let over: Vec<f64> = (0..state.len()).filter(over).map(lowest).collect();
    assert!(over.iter().all(|height| *height > 0.9), "{over:?}");
    assert!(over.iter().filter(|height| **height < 1.0).count() >= 2, "{over:?}");
    // The block takes 11 % of the volume below the fill height; with the layer about it in which no centre of a grain of
    // 5 mm can lie it takes 22 %. Two packings of 300 grains differ by a few per cent.
    assert!((0.75..0.93).contains(&(density / empty)), "{density} against {empty}");
}

/// The key of a run, as `sim` prints it.
fn key(study: &Study, experiment: &str, arguments: &[&str]) -> String {
    let ended = study.succeed(&[&["sim", experiment, "--json"], arguments].concat());
    let answer: Value = serde_json::from_str(&ended.out).expect("JSON");
    answer["run_key"].as_str().expect("a key").to_owned()
}

#[test]
fn a_mesh_and_the_friction_on_it_enter_the_keys_of_its_experiment_alone() {
    let study = Study::quick();
    let softer = ["--set", "wall_friction_acrylic=0.1"];
    let (bare, ledge) = (key(&study, "bulk_density", &[]), key(&study, "ledge", &[]));
    assert_eq!(key(&study, "bulk_density", &softer), bare, "there is no acrylic in the cylinder");
    place(&study, &binary(&block(HALF, HEIGHT)));
    equip(&study);
    let equipped = key(&study, "bulk_density", &["--vtk", "frames", "--every", "50 ms"]);
    assert!(study.path("frames").is_dir());
    assert_ne!(equipped, bare);
    assert_ne!(key(&study, "bulk_density", &softer), equipped, "now there is");
    assert_eq!(key(&study, "ledge", &[]), ledge);
    study.edit("pipeline.toml", "\"acrylic\"", "\"steel_impact\"");
    assert_ne!(key(&study, "bulk_density", &[]), equipped);
}

/// The simulations that `plan` announces for the design: all, and new ones.
fn planned(study: &Study) -> (u64, u64) {
    let plan = study.plan("simulate", &[]);
    (plan["runs"].as_u64().expect("a number"), plan["new_runs"].as_u64().expect("a number"))
}

#[test]
fn a_mesh_makes_the_runs_of_its_experiment_new_and_no_other() {
    let study = Study::quick();
    study.succeed(&["repro", "simulate"]);
    let bare = study.table::<RunRow>();
    assert_eq!((study.runs(), planned(&study)), (20, (20, 0)));
    place(&study, &binary(&block(HALF, HEIGHT)));
    equip(&study);
    assert_eq!(planned(&study), (20, 10), "those of the cylinder, not those of the ledge");
    let why = study.succeed(&["why", "simulate"]).out;
    assert!(why.contains("equipment.bulk_density.insert") && why.contains("12 triangles of acrylic"), "{why}");
    assert_eq!(study.repro(&["simulate"])["sample"], "fresh");
    assert_eq!(study.runs(), 30);
    // The same triangles written otherwise, elsewhere, or in another order of the sections are the same mesh.
    study.write("block.stl", &ascii(&block(HALF, HEIGHT)));
    study.edit("pipeline.toml", STL, "block.stl");
    assert_eq!((planned(&study), study.status()["simulate"].as_str()), ((20, 0), "fresh"));
    // Another file is another mesh.
    study.write("block.stl", &ascii(&block(HALF, 20.0)));
    assert_eq!(planned(&study), (20, 10));
    assert!(study.succeed(&["why", "simulate"]).out.contains("equipment.bulk_density.insert"));
    // Equipment of an experiment that the study does not run is said in the report alone.
    study.edit("pipeline.toml", "experiment = \"bulk_density\"", "experiment = \"hopper\"");
    assert_eq!(study.repro(&["simulate"])["simulate"], "restored", "the cylinder is empty again");
    assert!(study.table::<RunRow>() == bare);
    assert_eq!(study.runs(), 30);
}

/// A challenge is made in the apparatus of the study, meshes and all.
#[test]
fn a_challenge_holds_the_equipment_of_its_study() {
    let study = Study::quick();
    let measured = |out: &str| {
        let new =
            ["challenge", "new", "--seed", "5", "--effect", "none", "--n", "2", "--n-held-out", "2", "--out", out];
        study.succeed(&new);
        let text = std::fs::read_to_string(study.path(out).join("measured.csv")).expect("data");
        ["ledge,", "bulk_density,"].map(|test| text.lines().filter(|l| l.starts_with(test)).collect::<String>())
    };
    let bare = measured("bare");
    place(&study, &binary(&block(HALF, HEIGHT)));
    equip(&study);
    let with = measured("with");
    assert!(!bare[1].is_empty() && bare[1] != with[1]);
    assert_eq!(bare[0], with[0]);
}

#[test]
fn the_report_names_the_equipment() {
    let study = equipped();
    study.succeed(&["repro", "report"]);
    let report = std::fs::read_to_string(study.path("artifacts/report/report.md")).expect("a report");
    assert!(report.contains("equipment.bulk_density.insert") && report.contains("12 triangles of acrylic"));
}

#[test]
fn mistakes_are_answered_with_file_key_and_remedy() {
    let cases: [(&str, &str, &[&str]); 10] = [
        (
            STL,
            "equipment/none.stl",
            &["`equipment.bulk_density.insert.stl`", "none.stl`: No such file", "relative to the"],
        ),
        (STL, "lab.csv", &["`equipment.bulk_density.insert.stl`", "lab.csv`: this is no STL file", "export it again"]),
        (STL, "equipment", &["`equipment.bulk_density.insert.stl`", "directory"]),
        ("\"mm\"", "\"kg\"", &["`equipment.bulk_density.insert.unit`: `1 kg` is a mass, but a length", "unit alone"]),
        ("\"mm\"", "\"furlong\"", &["unit `furlong` is not known; a length"]),
        (
            "\"bulk_density\"\nname",
            "\"hoper\"\nname",
            &["`equipment.hoper.insert.experiment`", "did you mean `hopper`?"],
        ),
        ("\"acrylic\"", "\"steel\"", &["insert.material`: `steel` is not one of acrylic, steel_impact, steel_sliding"]),
        (
            "\"insert\"",
            "\"cylinder\"",
            &["cylinder.name`: is a wall of the apparatus, which has floor, cylinder; take"],
        ),
        ("\n[[measured]]", SECTION, &["a second [[equipment]] for `bulk_density.insert`; give it another"]),
        ("unit = \"mm\"\n", "", &["`equipment.bulk_density.insert.unit`: key is missing; add it"]),
    ];
    let study = equipped();
    let good = std::fs::read_to_string(study.path("pipeline.toml")).expect("a study");
    for (from, to, snippets) in cases {
        assert!(good.contains(from), "{from}");
        let text = if to == SECTION { good.replace(from, &format!("{SECTION}{from}")) } else { good.replace(from, to) };
        study.write("pipeline.toml", &text);
        let ended = study.run(&["status"]);
        assert_eq!(ended.code, Some(1), "{to}: {}", ended.err);
        assert!(ended.err.contains("pipeline.toml:"), "{}", ended.err);
        snippets.iter().for_each(|snippet| assert!(ended.err.contains(snippet), "{to}: {}", ended.err));
    }
    // A mesh far off is most likely one in another unit.
    study.write("pipeline.toml", &good);
    let far: Vec<Triangle> = block(HALF, HEIGHT).iter().map(|t| t.map(|[x, y, z]| [x + 500.0, y, z])).collect();
    place(&study, &binary(&far));
    let told = study.run(&["status"]).err;
    assert!(told.contains("insert.unit`: the mesh (x 0.485 to 0.515 m") && told.contains("is this the unit"), "{told}");
}
