//! A test of ours as input of LIGGGHTS, so that another engine makes measured data; `benches/twin.sh` runs it.
//!
//! ```text
//! twin STUDY EXPERIMENT SEED FOLDER [NAME=VALUE ...]     settings of the study, changed; `size_classes` and `bond_number` are ours
//! ```
//!
//! Writes into the folder what `benches/twin/in.twin` includes: the inserted grains (`grains.data`), the contact law
//! (`materials.in`), the walls (`walls.in` and STL meshes) and the programme (`program.in`). Insertion is geometry and is
//! taken from here; every motion is LIGGGHTS's. The conversion of the contact law stands in `docs/twin.md`.

use granulake::config::Config;
use granulake::dem::{Action, ContactLaw, Damping, Setup, Shape, Simulation, State, Vec3, Wall, WallSpecies};
use granulake::experiments;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Classes of size, each an atom type of its own, so that every pair of classes has its own dashpots.
const SIZE_CLASSES: usize = 10;
/// Liquid in a bridge between equal spheres over R³, as `liquid_volume_ratio` has it by default.
const BRIDGE_VOLUME: f64 = 1e-3;
const NO_WALL: WallSpecies = WallSpecies { sliding_friction: 0.0, rolling_friction: 0.0 };

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let [study, experiment, seed, folder, changes @ ..] = &arguments[..] else {
        return eprintln!("twin STUDY EXPERIMENT SEED FOLDER [NAME=VALUE ...]");
    };
    let config = Config::load(Path::new(study)).expect("a study");
    let mut settings = config.base_settings().clone();
    for change in changes {
        let (name, value) = change.split_once('=').expect("NAME=VALUE");
        settings.set_text(name, value).expect("a setting");
    }
    let setup = experiments::find(experiment).expect("an experiment").setup(&settings).expect("a set-up");
    let start = Simulation::new(&setup, seed.parse().expect("a seed")).expect("a filling");
    let write = |name: &str, text: String| fs::write(Path::new(folder).join(name), text).expect("a file");
    fs::create_dir_all(folder).expect("a folder");
    let species = species(&setup.walls);
    write("grains.data", data(&setup, &start.world().state(), species.len()));
    write("materials.in", materials(&setup, &species));
    write("program.in", program(&setup, start.world().time_step()));
    let (walls, meshes) = walls(&setup, &species);
    write("walls.in", walls);
    meshes.into_iter().for_each(|(name, text)| write(&name, text));
}

/// The wall materials in the order of their first wall; their atom types come after the size classes.
fn species(walls: &[Wall]) -> Vec<WallSpecies> {
    let mut found: Vec<WallSpecies> = Vec::new();
    for wall in walls {
        if !found.contains(&wall.species) {
            found.push(wall.species);
        }
    }
    found
}

/// Class of a radius: equal ratios from the smallest to the largest.
fn class(setup: &Setup, radius: f64) -> usize {
    let (low, high) = (setup.grains.size.smallest(), setup.grains.size.largest());
    let part = (radius / low).ln() / (high / low).ln();
    ((part * SIZE_CLASSES as f64) as usize).min(SIZE_CLASSES - 1)
}

/// Radius in the (geometric) middle of a class [m].
fn middle(setup: &Setup, class: usize) -> f64 {
    let (low, high) = (setup.grains.size.smallest(), setup.grains.size.largest());
    low * (high / low).powf((class as f64 + 0.5) / SIZE_CLASSES as f64)
}

/// Lower and upper corner of the box, with room behind the back plate for the gate [m].
fn domain(setup: &Setup) -> (Vec3, Vec3) {
    let (low, high) = (setup.domain.lower, setup.domain.upper);
    (low, [high[0], 2.0 * high[1], high[2]])
}

fn data(setup: &Setup, state: &State, species: usize) -> String {
    let (low, high) = domain(setup);
    let mut text = format!("granular\n\n{} atoms\n{} atom types\n\n", state.len(), SIZE_CLASSES + species);
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        text += &format!("{:e} {:e} {name}lo {name}hi\n", low[axis], high[axis]);
    }
    text += "\nAtoms\n\n";
    for i in 0..state.len() {
        let (radius, density) = (state.radius[i], setup.grains.density);
        let place = [state.x[i], state.y[i], state.z[i]].map(|x| format!("{x:.17e}")).join(" ");
        writeln!(text, "{} {} {:.17e} {density} {place}", i + 1, class(setup, radius) + 1, 2.0 * radius)
            .expect("a string");
    }
    text
}

/// Mass, radius and inverse mass of one side of a contact; a wall has no radius of its own.
#[derive(Clone, Copy)]
enum Side {
    Grain { mass: f64, radius: f64 },
    Wall(WallSpecies),
}

/// Constants of a pair of atom types.
struct Pair {
    normal: f64,
    tangential: f64,
    /// γ/m_eff of the normal and the tangential dashpot [1/s].
    damping: [f64; 2],
    sliding: f64,
    /// Torque limit over |F_n| R_eff: LIGGGHTS's R_eff is half our D.
    rolling: f64,
    /// Dashpot of `epsd` over its critical one.
    rolling_viscosity: f64,
    /// Energy density of SJKR that takes away half of the spring [J/m³].
    cohesion: f64,
}

impl Pair {
    fn new(law: &ContactLaw, a: Side, b: Side, mean_radius: f64) -> Self {
        let Damping::Ratio(zeta) = law.damping else { panic!("only damping_reading = \"pair_ratio\" is converted") };
        let (wall, effective, arm, inertia) = match (a, b) {
            (Side::Grain { mass: m, radius: r }, Side::Grain { mass: n, radius: s }) => {
                let (i, j) = (m * r * r, n * s * s);
                (None, m * n / (m + n), 2.0 * r * s / (r + s), 1.4 * i * j / (i + j))
            }
            (Side::Grain { mass, radius }, Side::Wall(wall)) | (Side::Wall(wall), Side::Grain { mass, radius }) => {
                (Some(wall), mass, 2.0 * radius, 1.4 * mass * radius * radius)
            }
            // Walls never touch walls; any numbers that make a symmetric matrix do.
            (Side::Wall(_), Side::Wall(_)) => (Some(NO_WALL), 1.0, 1.0, 1.0),
        };
        let normal = law.stiffness * wall.map_or(1.0, |_| law.wall_stiffness_ratio);
        let tangential = normal * law.sliding_stiffness_ratio;
        Self {
            normal,
            tangential,
            damping: [normal, tangential].map(|k| 2.0 * zeta * (k / effective).sqrt()),
            sliding: wall.map_or(law.sliding_friction, |wall| wall.sliding_friction),
            rolling: 2.0 * wall.map_or(law.rolling_friction, |wall| wall.rolling_friction),
            rolling_viscosity: zeta * arm * (effective / inertia).sqrt(),
            // The contact area is 2π R_eff δ, R_eff = R/2 between equal spheres.
            cohesion: 0.5 * law.stiffness / (PI * mean_radius),
        }
    }
}

fn materials(setup: &Setup, species: &[WallSpecies]) -> String {
    let grain = |class| {
        let radius = middle(setup, class);
        Side::Grain { mass: setup.grains.density * 4.0 / 3.0 * PI * radius.powi(3), radius }
    };
    let sides: Vec<Side> = (0..SIZE_CLASSES).map(grain).chain(species.iter().map(|s| Side::Wall(*s))).collect();
    let mean = setup.grains.size.mean();
    let matrix = |name: &str, value: &dyn Fn(&Pair) -> f64| {
        let pairs = sides.iter().flat_map(|a| sides.iter().map(|b| Pair::new(&setup.contact, *a, *b, mean)));
        let values = pairs.map(|pair| format!(" {:.8e}", value(&pair))).collect::<String>();
        format!("fix {name} all property/global {name} peratomtypepair {}{values}\n", sides.len())
    };
    let each = |name: &str, value: f64| {
        format!("fix {name} all property/global {name} peratomtype{}\n", format!(" {value:e}").repeat(sides.len()))
    };
    let scalar = |name: &str, value: f64| format!("fix {name} all property/global {name} scalar {value:e}\n");
    // Soulie's force between mean grains is π γ R (exp B + C), which is the weight of one at Bond number 1.
    let weight = setup.grains.density * 4.0 / 3.0 * PI * mean.powi(3) * setup.gravity[2].abs();
    let log = BRIDGE_VOLUME.ln();
    let shape = (-0.0082 * log + 0.48).exp() + 0.0018 * log + 0.078;
    // A grain gives half of its liquid, times 1 − √(3/4), to a bridge with its like.
    let content = BRIDGE_VOLUME / (4.0 / 3.0 * PI * (1.0 - 0.75_f64.sqrt()));
    [
        matrix("kn", &|pair| pair.normal),
        matrix("kt", &|pair| pair.tangential),
        matrix("gamman", &|pair| pair.damping[0]),
        matrix("gammat", &|pair| pair.damping[1]),
        matrix("coefficientFriction", &|pair| pair.sliding),
        matrix("coefficientRollingFriction", &|pair| pair.rolling),
        matrix("coefficientRollingViscousDamping", &|pair| pair.rolling_viscosity),
        matrix("cohesionEnergyDensity", &|pair| pair.cohesion),
        each("youngsModulus", 1e7),
        each("poissonsRatio", 0.3),
        each("contactAngle", 0.0),
        scalar("surfaceLiquidContentInitial", content),
        scalar("surfaceTension", weight / (PI * mean * shape)),
        scalar("fluidViscosity", 0.0),
        scalar("minSeparationDistanceRatio", 1.01),
        scalar("maxSeparationDistanceRatio", 1.1),
    ]
    .concat()
}

/// Commands that make the walls, and the STL files they name. Sheets of one material that stay are one mesh.
fn walls(setup: &Setup, species: &[WallSpecies]) -> (String, Vec<(String, String)>) {
    let number = |wall: &Wall| SIZE_CLASSES + 1 + species.iter().position(|s| *s == wall.species).unwrap_or(0);
    let (mut text, mut meshes) = (String::new(), Vec::new());
    let model = "model hooke/stiffness tangential history cohesion ${wall_cohesion} rolling_friction ${wall_rolling}";
    for (k, wall) in setup.walls.iter().enumerate() {
        let primitive = match wall.shape {
            Shape::Plane { point, normal } => {
                let axis = (0..3).max_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(2);
                format!("{}plane {:e}", ["x", "y", "z"][axis], point[axis])
            }
            Shape::Cylinder { axis, radius } => format!("zcylinder {radius:e} {:e} {:e}", axis[0], axis[1]),
            _ => continue,
        };
        writeln!(text, "fix wall{k} all wall/gran {model} primitive type {} {primitive}", number(wall))
            .expect("a string");
    }
    // LIGGGHTS allows one wall of meshes; the gate is a mesh of its own in it, so that it can be pulled.
    for gate in [false, true] {
        let sheets = setup.walls.iter().filter(|wall| (wall.name == "gate") == gate);
        let sheets = sheets.filter_map(|wall| match wall.shape {
            Shape::Rectangle { corner, edge_u, edge_v } => Some((number(wall), tiles(corner, edge_u, edge_v))),
            _ => None,
        });
        let sheets: Vec<(usize, String)> = sheets.collect();
        let Some((kind, _)) = sheets.first() else { continue };
        assert!(sheets.iter().all(|(other, _)| other == kind), "sheets of one material");
        let name = if gate { "gate" } else { "sheets" };
        let facets = sheets.iter().map(|(_, facets)| facets.as_str()).collect::<String>();
        writeln!(text, "fix {name} all mesh/surface file {name}.stl type {kind}").expect("a string");
        meshes.push((format!("{name}.stl"), format!("solid {name}\n{facets}endsolid {name}\n")));
    }
    if !meshes.is_empty() {
        writeln!(text, "fix meshes all wall/gran {model} mesh n_meshes {} meshes sheets gate", meshes.len())
            .expect("a string");
    }
    (text, meshes)
}

/// A rectangle as triangles no longer than four times their width, which LIGGGHTS refuses.
fn tiles(corner: Vec3, u: Vec3, v: Vec3) -> String {
    let length = |a: Vec3| (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    let side = 4.0 * length(u).min(length(v));
    let [m, n] = [u, v].map(|edge| (length(edge) / side).ceil().max(1.0) as usize);
    let at = |i: usize, j: usize| {
        let (a, b) = (i as f64 / m as f64, j as f64 / n as f64);
        [0, 1, 2].map(|c| corner[c] + a * u[c] + b * v[c])
    };
    let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let words = |p: Vec3| p.map(|x| format!("{x:.9e}")).join(" ");
    let facet = |corners: [Vec3; 3]| {
        let vertices = corners.map(|p| format!("vertex {}\n", words(p))).concat();
        format!("facet normal {}\nouter loop\n{vertices}endloop\nendfacet\n", words(cross.map(|x| x / length(cross))))
    };
    let cells = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
    cells
        .map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            facet([a, b, c]) + &facet([a, c, d])
        })
        .collect()
}

/// Times in steps, heights and regions as variables.
fn program(setup: &Setup, step: f64) -> String {
    let time = |wanted: fn(&Action) -> bool| setup.events.iter().find(|event| wanted(&event.action));
    let deletion = time(|action| matches!(action, Action::DeleteAbove { .. })).expect("a deletion");
    let Action::DeleteAbove { height, .. } = deletion.action else { return String::new() };
    let release = time(|action| matches!(action, Action::RemoveWall { .. })).map(|event| event.time);
    let opens = release.unwrap_or(deletion.time);
    let steps = |from: f64, to: f64| ((to - from) / step).round();
    let region = setup.trace.as_ref().map_or(setup.domain, |trace| trace.region);
    let interval = setup.trace.as_ref().map_or(0.1, |trace| trace.interval);
    let mut text = String::new();
    let mut variable = |name: &str, value: String| text += &format!("variable {name} string {value}\n");
    variable("dt", format!("{step:.10e}"));
    variable("skin", format!("{:e}", 0.25 * setup.grains.size.smallest()));
    variable("settle", steps(0.0, deletion.time).to_string());
    variable("height", format!("{height:e}"));
    variable("wait", steps(deletion.time, opens).to_string());
    variable("opens", release.map_or("0", |_| "1").to_owned());
    // The domain ends one depth behind the back plate: as far as the gate is pulled, in one step.
    variable("pull", format!("{:e}", setup.domain.upper[1] / step));
    variable("flow", steps(opens, setup.stop.time_cap).to_string());
    variable("sample", steps(0.0, interval).to_string());
    for (axis, name) in ["x", "y", "z"].iter().enumerate() {
        variable(&format!("{name}low"), format!("{:e}", region.lower[axis]));
        variable(&format!("{name}high"), format!("{:e}", region.upper[axis]));
    }
    text
}
