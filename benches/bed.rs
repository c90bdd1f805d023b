//! Rate of the engine in a dense settled bed: spheres of the paper's gravel in the density cylinder, at full stiffness.
//!
//! `cargo bench --bench bed` settles a small cloud and prints one line. `benches/peers.sh` uses the same program to make the
//! cloud that every engine settles, and to measure what each of them gives:
//!
//! ```text
//! bed cloud N SEED DIRECTORY             cloud of N grains as ours, and as data files of LIGGGHTS and LAMMPS
//! bed settle FILE SECONDS STEPS OUT      settle a cloud, then time STEPS steps at every width of vectors; the bed goes to OUT
//! bed common FILE SECONDS OUT            settle a cloud with the law that all three engines have; the bed goes to OUT
//! bed convert FILE DIRECTORY             a bed as data files of LIGGGHTS and LAMMPS
//! bed measure FILE                       density, coordination number and heights of `id x y z r` lines
//! ```
//!
//! Time is that of the processor spent on this thread (Linux), so a busy machine disturbs it little.

use granulake::dem::{
    ContactLaw, Damping, Fill, FillArea, Grain, Grains, Region, Rise, Setup, Shape, StopRule, Vectors, Wall,
    WallSpecies, World,
};
use granulake::rng::Stream;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::time::Instant;

/// Radius of the density cylinder [m].
const CYLINDER: f64 = 0.082;
/// Solid fraction of the cloud.
const CLOUD: f64 = 0.25;
const DENSITY: f64 = 2750.0;
const FRICTION: WallSpecies = WallSpecies { sliding_friction: 0.5, rolling_friction: 0.5 };

/// Widths of vectors, by the names that `benches/peers.sh` gives them; the widest of the machine is the default of all runs.
const WIDTHS: [(&str, Vectors); 3] =
    [("ours_scalar", Vectors::Scalar), ("ours_avx2", Vectors::Avx2), ("ours", Vectors::Widest)];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let number = |word: &str| word.parse::<f64>().expect("a number");
    match words[..] {
        [] => bench(),
        ["cloud", count, seed, directory] => write(&cloud(number(count) as usize, number(seed) as u64), directory),
        ["settle", file, seconds, steps, out] => settle(&read(file), number(seconds), number(steps) as u64, out),
        ["common", file, seconds, out] => save(&settled(&common(), &read(file), number(seconds)), out),
        ["convert", file, directory] => write(&read(file), directory),
        ["measure", file] => measure(&read(file)),
        _ => panic!("see the head of benches/bed.rs"),
    }
}

/// A centre and a radius [m].
type Sphere = [f64; 4];

/// Processor time of this thread where the system tells it, else the time since the clock was made [s].
fn seconds(clock: &Instant) -> f64 {
    let spent = fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = spent.and_then(|text| text.split_whitespace().next().and_then(|word| word.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| clock.elapsed().as_secs_f64(), |time| time * 1e-9)
}

/// The gravel in the density cylinder, with the damping per mass that LIGGGHTS and LAMMPS know.
fn setup() -> Setup {
    let wall = |name: &str, shape| Wall { name: name.to_owned(), shape, species: FRICTION };
    let far = 10.0;
    Setup {
        grains: Grains { density: DENSITY, ..Grains::default() },
        contact: ContactLaw { damping: Damping::PerMass(0.3), ..ContactLaw::default() },
        bridges: None,
        gravity: [0.0, 0.0, -9.81],
        time_step_fraction: 0.1,
        walls: vec![
            wall("floor", Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] }),
            wall("cylinder", Shape::Cylinder { axis: [0.0; 2], radius: CYLINDER }),
        ],
        fill: Fill {
            area: FillArea::Disc { axis: [0.0; 2], radius: CYLINDER },
            base: 0.0,
            rise: Rise::PerAttempt(1e-3),
            volume: 1.0,
        },
        events: Vec::new(),
        stop: StopRule { energy_ratio: None, waits: true, empty: None, check_after: 0.0, time_cap: far },
        domain: Region { lower: [-far; 3], upper: [far; 3] },
        periodic: [None; 3],
        trace: None,
    }
}

/// The same with the law that LIGGGHTS and LAMMPS have too, to the letter: what LIGGGHTS does with a sliding dashpot beyond the
/// limit is its own, and its `epsd2` rolls with a torque k_s R_eff² per angle, R_eff = D/2, and no dashpot.
fn common() -> Setup {
    let setup = setup();
    let contact = ContactLaw {
        rolling_stiffness_ratio: 0.25 * setup.contact.sliding_stiffness_ratio,
        sliding_damping_factor: 0.0,
        rolling_damping_factor: 0.0,
        ..setup.contact
    };
    Setup { contact, ..setup }
}

/// Random places without contact, the largest spheres first; a column of cells keeps the search short.
fn cloud(count: usize, seed: u64) -> Vec<Sphere> {
    let size = setup().grains.size;
    let (low, high) = (size.smallest(), size.largest());
    let mut stream = Stream::new(seed, "bed");
    let mut radii: Vec<f64> = Vec::new();
    while radii.len() < count {
        let radius = size.mean() + 1.39e-3 * stream.normal();
        if (low..=high).contains(&radius) {
            radii.push(radius);
        }
    }
    radii.sort_by(|a, b| b.total_cmp(a));
    let height = radii.iter().map(|r| volume(*r)).sum::<f64>() / CLOUD / (std::f64::consts::PI * CYLINDER * CYLINDER);
    let layer = 2.0 * high;
    let mut layers: Vec<Vec<Sphere>> = vec![Vec::new(); (height / layer) as usize + 3];
    for radius in radii {
        let (sphere, k) = loop {
            let [x, y] = [0, 1].map(|_| stream.uniform_in(-CYLINDER, CYLINDER));
            let z = stream.uniform_in(radius, height - radius);
            let k = (z / layer) as usize + 1;
            let sphere = [x, y, z, radius];
            let inside = (x * x + y * y).sqrt() < CYLINDER - radius;
            if inside && layers[k - 1..=k + 1].iter().flatten().all(|other| gap(&sphere, other) > 0.0) {
                break (sphere, k);
            }
        };
        layers[k].push(sphere);
    }
    layers.concat()
}

fn volume(radius: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
}

fn gap(a: &Sphere, b: &Sphere) -> f64 {
    let square: f64 = (0..3).map(|c| (a[c] - b[c]) * (a[c] - b[c])).sum();
    square.sqrt() - a[3] - b[3]
}

/// Writes `bed.txt`, and data files for LIGGGHTS and LAMMPS, which differ in the number of atom types.
fn write(spheres: &[Sphere], directory: &str) {
    fs::create_dir_all(directory).expect("a directory");
    let path = |name: &str| Path::new(directory).join(name);
    fs::write(path("bed.txt"), lines(spheres)).expect("a file");
    for (name, types) in [("bed.liggghts", 2), ("bed.lammps", 1)] {
        fs::write(path(name), data(spheres, types)).expect("a file");
    }
}

fn lines(spheres: &[Sphere]) -> String {
    let mut text = String::new();
    for (k, [x, y, z, r]) in spheres.iter().enumerate() {
        writeln!(text, "{} {x:e} {y:e} {z:e} {r:e}", k + 1).expect("a string");
    }
    text
}

fn data(spheres: &[Sphere], types: usize) -> String {
    let top = spheres.iter().fold(0.0, |top: f64, s| top.max(s[2] + s[3])) + 0.01;
    let side = CYLINDER + 0.002;
    let mut text = format!("granular\n\n{} atoms\n{types} atom types\n\n", spheres.len());
    write!(text, "-{side} {side} xlo xhi\n-{side} {side} ylo yhi\n-0.005 {top} zlo zhi\n\nAtoms\n\n")
        .expect("a string");
    for (k, [x, y, z, r]) in spheres.iter().enumerate() {
        writeln!(text, "{} 1 {:.17e} {DENSITY} {x:.17e} {y:.17e} {z:.17e}", k + 1, 2.0 * r).expect("a string");
    }
    text
}

/// Reads `id x y z r` lines in any order; other lines, such as the heads of dumps, are skipped.
fn read(file: &str) -> Vec<Sphere> {
    let text = fs::read_to_string(file).expect("a bed");
    let mut rows: Vec<(u64, Sphere)> = text.lines().filter_map(row).collect();
    rows.sort_by_key(|(id, _)| *id);
    rows.into_iter().map(|(_, sphere)| sphere).collect()
}

fn row(line: &str) -> Option<(u64, Sphere)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, x, y, z, r] = words[..] else { return None };
    let numbers: Vec<f64> = [x, y, z, r].iter().filter_map(|word| word.parse().ok()).collect();
    Some((id.parse().ok()?, numbers.try_into().ok()?))
}

/// Settles the spheres over a time [s], then times some steps.
fn settle(spheres: &[Sphere], duration: f64, steps: u64, out: &str) {
    let mut world = settled(&setup(), spheres, duration);
    let mut rates = Vec::new();
    for (name, vectors) in WIDTHS {
        world = world.with_vectors(vectors);
        rates.push((name, rate(&mut world, steps)));
    }
    println!("listed {:.3}", world.listed_pairs() as f64 / world.len() as f64);
    println!("coordination {:.4}", world.coordination_number());
    rates.iter().for_each(|(name, rate)| println!("rate {name} {rate:.4e}"));
    save(&world, out);
}

/// The spheres after a time [s]; prints the kinetic energy on the way.
fn settled(setup: &Setup, spheres: &[Sphere], duration: f64) -> World {
    let mut world = world(setup, spheres);
    let mut report = 0.1;
    while world.time() < duration {
        world.step().expect("a step");
        if world.time() >= report {
            println!("kinetic {report:.1} {:.4e}", world.energies().translational);
            report += 0.1;
        }
    }
    world
}

fn save(world: &World, out: &str) {
    let state = world.state();
    let column = |k: usize| [state.x[k], state.y[k], state.z[k], state.radius[k]];
    fs::write(out, lines(&(0..state.len()).map(column).collect::<Vec<_>>())).expect("a file");
}

fn world(setup: &Setup, spheres: &[Sphere]) -> World {
    let grains: Vec<Grain> = spheres.iter().map(|&[x, y, z, r]| Grain::new(r, [x, y, z])).collect();
    World::new(setup, &grains).expect("a world")
}

/// Particle-steps per second of processor time.
fn rate(world: &mut World, steps: u64) -> f64 {
    let clock = Instant::now();
    let start = seconds(&clock);
    for _ in 0..steps {
        world.step().expect("a step");
    }
    (steps * world.len() as u64) as f64 / (seconds(&clock) - start)
}

fn bench() {
    let mut world = world(&setup(), &cloud(1000, 1));
    while world.time() < 0.35 {
        world.step().expect("a step");
    }
    let best = (0..5).map(|_| rate(&mut world, 2000)).fold(0.0, f64::max);
    println!("settled bed of {} grains: {best:.3e} particle-steps per CPU-second", world.len());
}

/// Prints density and coordination number away from floor and surface, and the heights below which shares of the volume lie.
fn measure(spheres: &[Sphere]) {
    let mut sorted = spheres.to_vec();
    sorted.sort_by(|a, b| a[2].total_cmp(&b[2]));
    let total: f64 = sorted.iter().map(|s| volume(s[3])).sum();
    let mut below = 0.0;
    let mut heights = Vec::new();
    for s in &sorted {
        below += volume(s[3]);
        while heights.len() < 9 && below >= total * 0.1 * (heights.len() + 1) as f64 {
            heights.push(1e3 * s[2]);
        }
    }
    let (low, high) = (heights[1] * 1e-3, heights[7] * 1e-3);
    let solid: f64 = sorted.iter().map(|s| volume(s[3]) * (part(s, high) - part(s, low))).sum();
    println!("density {:.2}", DENSITY * solid / (std::f64::consts::PI * CYLINDER * CYLINDER * (high - low)));
    println!("contacts {:.4}", contacts(&sorted));
    println!("heights_mm {}", heights.iter().map(|h| format!("{h:.1}")).collect::<Vec<_>>().join(" "));
}

/// Part of a sphere's volume below a height, (h + 1)² (2 − h)/4.
fn part([_, _, z, r]: &Sphere, height: f64) -> f64 {
    let h = ((height - z) / r).clamp(-1.0, 1.0);
    (h + 1.0) * (h + 1.0) * (2.0 - h) / 4.0
}

/// Touching grains per grain, from overlaps of spheres sorted by height.
fn contacts(sorted: &[Sphere]) -> f64 {
    let reach = 2.0 * setup().grains.size.largest();
    let ends = |k: usize| sorted[k + 1..].iter().take_while(move |other| other[2] - sorted[k][2] < reach);
    let touching: usize = (0..sorted.len()).map(|k| ends(k).filter(|other| gap(&sorted[k], other) < 0.0).count()).sum();
    2.0 * touching as f64 / sorted.len() as f64
}
