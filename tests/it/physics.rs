//! The engine against theory: every number has a closed form, and every tolerance says why it is that size.
//!
//! Where the error is one of time discretisation the test runs at several steps and the tolerance shrinks with the step.

use granulake::dem::material::{damping_ratio, sphere_mass, time_step};
use granulake::dem::{
    Action, ContactLaw, Damping, Event, Fill, FillArea, Fines, Grain, Grains, LiquidBridges, Partner, Reference,
    Region, Rise, Setup, Shape, SizeDistribution, StopRule, Trace, Vec3, Wall, WallSpecies, World, simulate,
};
use std::f64::consts::PI;

mod bridges;
mod changes;
mod checkpoint;
mod clumps;
mod many;
mod oblique;
mod outcomes;
mod periodic;
mod runs;
mod species;
mod walls;

const RADIUS: f64 = 5e-3;
const DENSITY: f64 = 2750.0;
const GRAVITY: f64 = 9.81;
const SMOOTH: WallSpecies = WallSpecies { sliding_friction: 0.0, rolling_friction: 0.0 };

/// Time steps over the collision time at which errors of discretisation are looked at.
const FRACTIONS: [f64; 3] = [1.0 / 10.0, 1.0 / 50.0, 1.0 / 200.0];

/// Asserts that an error is within its tolerance, and prints both for `--nocapture`.
fn within(what: &str, fraction: f64, error: f64, tolerance: f64) {
    println!("{what}, step {fraction} t_c: error {error:+.2e}, tolerance {tolerance:.1e}");
    assert!(error.abs() <= tolerance, "{what}, step {fraction} t_c: error {error:+.3e} beyond {tolerance:.1e}");
}

/// e = exp(-π ζ/√(1 - ζ²)): restitution of a contact that lasts half a period, δ > 0.
fn restitution(ratio: f64) -> f64 {
    (-PI * ratio / (1.0 - ratio * ratio).sqrt()).exp()
}

/// Restitution of a contact that ends where its force would begin to pull: e = exp(-ζ t/√(1 - ζ²)) with
/// t = π - atan2(2 ζ √(1 - ζ²), 1 - 2 ζ²) (Schwager and Pöschel 2007).
fn clipped_restitution(ratio: f64) -> f64 {
    let root = (1.0 - ratio * ratio).sqrt();
    let phase = PI - (2.0 * ratio * root).atan2(1.0 - 2.0 * ratio * ratio);
    (-ratio / root * phase).exp()
}

fn equal_spheres() -> Grains {
    let size = SizeDistribution::TruncatedNormal { mean: RADIUS, sd: 0.0, below: 1.5, above: 5.0 };
    Grains { size, density: DENSITY, ..Grains::default() }
}

fn mass() -> f64 {
    sphere_mass(DENSITY, RADIUS)
}

/// Neither damping nor friction.
fn frictionless() -> ContactLaw {
    ContactLaw { damping: Damping::Ratio(0.0), sliding_friction: 0.0, rolling_friction: 0.0, ..ContactLaw::default() }
}

/// Empty space with equal spheres: no gravity, no walls.
fn space(fraction: f64) -> Setup {
    Setup {
        grains: equal_spheres(),
        contact: ContactLaw::default(),
        bridges: None,
        gravity: [0.0; 3],
        time_step_fraction: fraction,
        walls: Vec::new(),
        fill: Fill {
            area: FillArea::Disc { axis: [0.0; 2], radius: 0.04 },
            base: 0.0,
            rise: Rise::PerAttempt(1e-3),
            volume: 4e-5,
        },
        events: Vec::new(),
        stop: StopRule { energy_ratio: Some(1e-6), waits: true, empty: None, check_after: 0.0, time_cap: 1.0 },
        domain: Region { lower: [-10.0; 3], upper: [10.0; 3] },
        periodic: [None; 3],
        trace: None,
    }
}

fn wall(name: &str, shape: Shape, species: WallSpecies) -> Wall {
    Wall { name: name.to_owned(), shape, species }
}

fn floor(species: WallSpecies) -> Wall {
    wall("floor", Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] }, species)
}

/// A floor under gravity.
fn ground(fraction: f64, species: WallSpecies) -> Setup {
    Setup { gravity: [0.0, 0.0, -GRAVITY], walls: vec![floor(species)], ..space(fraction) }
}

/// Overlap of a grain at rest on a wall, m g / k_w.
fn rest_overlap(setup: &Setup) -> f64 {
    mass() * GRAVITY / (setup.contact.stiffness * setup.contact.wall_stiffness_ratio)
}

/// A small bed in a cylinder: it falls, is levelled at 0.4 s, and comes to rest.
fn bed_setup() -> Setup {
    let species = WallSpecies { sliding_friction: 0.456, rolling_friction: 0.912 };
    let radius = 0.04;
    Setup {
        grains: Grains { density: DENSITY, ..Grains::default() },
        // Low rolling friction, so that no grain is left standing on a single contact, about which a stack may turn without end.
        contact: ContactLaw { stiffness: 3.67743e4, rolling_friction: 0.05, ..ContactLaw::default() },
        gravity: [0.0, 0.0, -GRAVITY],
        time_step_fraction: 0.15,
        walls: vec![floor(species), wall("side", Shape::Cylinder { axis: [0.0; 2], radius }, species)],
        fill: Fill {
            area: FillArea::Disc { axis: [0.0; 2], radius },
            base: 0.0,
            rise: Rise::PerAttempt(1e-3),
            volume: 1e-4,
        },
        events: vec![Event {
            time: 0.4,
            action: Action::DeleteAbove { height: 0.03, reference: Reference::Top, level: true },
        }],
        stop: StopRule { energy_ratio: Some(1e-6), waits: true, empty: None, check_after: 0.4, time_cap: 2.0 },
        domain: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 1.0] },
        trace: Some(Trace { interval: 0.02, region: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 0.05] } }),
        ..space(0.15)
    }
}

fn steps(world: &mut World, count: u64) {
    (0..count).for_each(|_| world.step().expect("the run is stable"));
}

fn run_for(world: &mut World, time: f64) {
    let count = (time / world.time_step()).round() as u64;
    steps(world, count);
}

fn moving(position: Vec3, velocity: Vec3) -> Grain {
    Grain { velocity, ..Grain::new(RADIUS, position) }
}

// ---- collisions -------------------------------------------------------------------------------------------------------

/// Restitution and contact time of a head-on collision of two equal spheres, averaged over when within a step they meet.
fn collide(setup: &Setup) -> (f64, f64) {
    const PHASES: usize = 16;
    let (mut restitution, mut time) = (0.0, 0.0);
    for phase in 0..PHASES {
        let (e, t) = collide_at(setup, (phase as f64 + 0.5) / PHASES as f64);
        restitution += e / PHASES as f64;
        time += t / PHASES as f64;
    }
    (restitution, time)
}

/// The same for spheres that meet a fraction of a step after the start.
fn collide_at(setup: &Setup, phase: f64) -> (f64, f64) {
    let speed = 0.5;
    let gap = phase * speed * time_step(setup);
    let grains =
        [moving([-RADIUS - gap, 0.0, 0.0], [speed, 0.0, 0.0]), moving([RADIUS + gap, 0.0, 0.0], [-speed, 0.0, 0.0])];
    let mut world = World::new(setup, &grains).unwrap();
    let mut touching = 0;
    for _ in 0..(3.0 / setup.time_step_fraction) as usize {
        world.step().unwrap();
        touching += world.contacts().len();
    }
    assert!(world.contacts().is_empty(), "the spheres have parted");
    (-world.state().vx[0] / speed, touching as f64 * world.time_step())
}

/// e = exp(-γ t_c / (2 m_eff)) = exp(-π ζ / √(1 - ζ²)) = 0.3723 at ζ = 0.3.
///
/// The dashpot sees the velocity half a step ago, which acts like a mass smaller by γ Δt/2 and costs 6 % at t_c/10; when the last step of the
/// contact falls just behind its end, a pull is missing and e is 16 % too high instead. So a single collision is within 2 Δt/t_c, and the mean over
/// the phase within 0.6 Δt/t_c.
#[test]
fn restitution_follows_from_the_damping_ratio_and_converges_with_the_step() {
    let exact = restitution(0.3);
    assert!((exact - 0.3723).abs() < 5e-5);
    for fraction in FRACTIONS {
        let error = collide(&space(fraction)).0 / exact - 1.0;
        within("restitution, mean over the phase", fraction, error, 0.6 * fraction);
        for phase in [0.001, 0.5, 0.999] {
            let error = collide_at(&space(fraction), phase).0 / exact - 1.0;
            within(&format!("restitution at phase {phase}"), fraction, error, 2.0 * fraction);
        }
    }
}

/// t_c = π / √(k/m_eff - (γ/2m_eff)²). Averaged over the phase, counting whole steps leaves the law's own error: a
/// mass smaller by γ Δt/2 shortens the contact by 0.5 Δt.
#[test]
fn contact_time_converges_with_the_step() {
    for fraction in FRACTIONS {
        let setup = space(fraction);
        let omega = (setup.contact.stiffness / (0.5 * mass())).sqrt();
        let exact = PI / (omega * (1.0 - 0.09_f64).sqrt());
        within("contact time", fraction, collide(&setup).1 / exact - 1.0, 0.6 * fraction);
    }
}

/// Each reading of "damping" gives equal spheres the restitution it should: the three forms built on a ratio agree for spheres of
/// mean size, the constant follows e = exp(-γ t_c / 2 m_eff), and a stated restitution comes out. Error as above, at t_c/200.
#[test]
fn every_reading_of_damping_gives_its_restitution() {
    let at = |damping| collide(&Setup { contact: ContactLaw { damping, ..ContactLaw::default() }, ..space(0.005) }).0;
    let effective = 0.5 * mass();
    let constant_ratio = 0.3 / (2.0 * (ContactLaw::default().stiffness * effective).sqrt());
    let cases = [
        (Damping::Ratio(0.3), restitution(0.3)),
        (Damping::MeanParticle(0.3), restitution(0.3)),
        (Damping::PerMass(0.3), restitution(0.3)),
        (Damping::Constant(0.3), restitution(constant_ratio)),
        (Damping::Restitution(0.3), 0.3),
    ];
    for (damping, exact) in cases {
        let measured = at(damping);
        within(&format!("restitution of {damping:?}"), 0.005, measured / exact - 1.0, 0.9 * 0.005);
    }
    assert!((damping_ratio(restitution(0.3)) - 0.3).abs() < 1e-14);
}

/// An unclipped contact pulls late in the rebound; clipped it does not, so the spheres part sooner and faster, at e = 0.4325
/// (Schwager and Pöschel 2007).
#[test]
fn clipping_the_normal_force_ends_the_contact_where_it_would_pull() {
    let exact = clipped_restitution(0.3);
    assert!(exact > 1.1 * restitution(0.3));
    for fraction in FRACTIONS {
        let clipped = Setup { contact: ContactLaw { clip_normal: true, ..ContactLaw::default() }, ..space(fraction) };
        within("restitution, clipped", fraction, collide(&clipped).0 / exact - 1.0, 0.35 * fraction);
    }
}

// ---- single grains ----------------------------------------------------------------------------------------------------

/// Velocity Verlet is exact for constant force: only rounding remains, 1e-12 of the distance fallen.
#[test]
fn free_fall_is_exact() {
    let setup = Setup { walls: Vec::new(), ..ground(0.1, SMOOTH) };
    let mut world = World::new(&setup, &[moving([0.0; 3], [0.2, 0.0, 1.0])]).unwrap();
    steps(&mut world, 10_000);
    let (t, state) = (world.time(), world.state());
    assert!((state.z[0] - (t - 0.5 * GRAVITY * t * t)).abs() < 1e-12);
    assert!((state.vz[0] - (1.0 - GRAVITY * t)).abs() < 1e-11);
    assert!((state.x[0] - 0.2 * t).abs() < 1e-12);
}

/// A sphere set sliding loses speed at μ g, rolls at 5/7 v₀ after t = 2 v₀/(7 μ g), having gone 12 v₀²/(49 μ g).
///
/// While it slides the force is μ m g, so only rounding is left. The slip does not end at an instant: it dies over the contact's own relaxation
/// time γ_s/k_s (0.2 % of the stick time here), which bounds the error of time and distance. Rolling, the arm R - δ/2 shows, with δ/2R = 2e-6.
#[test]
fn a_sliding_sphere_ends_up_rolling_at_five_sevenths() {
    let (friction, speed) = (0.4, 0.3);
    let species = WallSpecies { sliding_friction: friction, rolling_friction: 0.0 };
    for fraction in FRACTIONS {
        let setup = ground(fraction, species);
        let start = [0.0, 0.0, RADIUS - rest_overlap(&setup)];
        let mut world = World::new(&setup, &[moving(start, [speed, 0.0, 0.0])]).unwrap();
        let slope = friction * GRAVITY;
        let stick = 2.0 * speed / (7.0 * slope);
        run_for(&mut world, 0.9 * stick);
        let (state, time) = (world.state(), world.time());
        within("sliding, speed", fraction, state.vx[0] / (speed - slope * time) - 1.0, 1e-11);
        within("sliding, spin", fraction, state.wy[0] * RADIUS / (2.5 * slope * time) - 1.0, 3e-6);
        while world.state().vx[0] > world.state().wy[0] * RADIUS {
            world.step().unwrap();
        }
        let sliding_stiffness = 2.0 / 7.0 * 2.0 * setup.contact.stiffness;
        let relaxation = 2.0 * 0.3 * (mass() / sliding_stiffness).sqrt();
        let tolerance = (relaxation + world.time_step()) / stick;
        within("stick time", fraction, world.time() / stick - 1.0, tolerance);
        let distance = 12.0 * speed * speed / (49.0 * slope);
        within("distance until it sticks", fraction, world.state().x[0] / distance - 1.0, tolerance);
        run_for(&mut world, 0.02);
        let (state, rolling) = (world.state(), 5.0 / 7.0 * speed);
        within("rolling, speed", fraction, state.vx[0] / rolling - 1.0, 2e-6);
        within("rolling, spin", fraction, state.wy[0] * RADIUS / rolling - 1.0, 2e-6);
    }
}

/// A rolling sphere is slowed by the torque μ_r m g D with D = 2R at a wall: a = (10/7) μ_r g. Error in units of the speed lost: the arm R - δ/2,
/// with δ/2R = 2e-6; the rolling spring winds up over 1e-9 m of travel and does not show.
#[test]
fn rolling_resistance_slows_a_rolling_sphere() {
    let (rolling, speed) = (0.02, 0.06);
    for fraction in FRACTIONS {
        let setup = ground(fraction, WallSpecies { sliding_friction: 0.8, rolling_friction: rolling });
        let start = [0.0, 0.0, RADIUS - rest_overlap(&setup)];
        let rolling_grain = Grain { spin: [0.0, speed / RADIUS, 0.0], ..moving(start, [speed, 0.0, 0.0]) };
        let mut world = World::new(&setup, &[rolling_grain]).unwrap();
        run_for(&mut world, 0.1);
        let exact = speed - 10.0 / 7.0 * rolling * GRAVITY * world.time();
        within("rolling resistance, speed", fraction, (world.state().vx[0] - exact) / (speed - exact), 3e-6);
        // It then stops and stays: within the limit the rolling spring holds the torque.
        run_for(&mut world, 0.2);
        let stopped = world.state();
        run_for(&mut world, 0.05);
        assert!(stopped.vx[0].abs() < 1e-6 && (world.state().x[0] - stopped.x[0]).abs() < 1e-8);
    }
}

/// Frames in which a grain rests on each primitive, and the name of the wall that carries it.
fn resting_places() -> Vec<(Setup, Vec3, &'static str)> {
    let rough = WallSpecies { sliding_friction: 0.5, rolling_friction: 1.0 };
    let plate = |name: &str, x: f64| {
        let shape = Shape::Rectangle { corner: [x, -0.05, 0.0], edge_u: [0.05, 0.0, 0.0], edge_v: [0.0, 0.1, 0.0] };
        wall(name, shape, rough)
    };
    let on = |walls: Vec<Wall>, gravity: Vec3| Setup { walls, gravity, ..space(0.1) };
    let down = [0.0, 0.0, -GRAVITY];
    let cylinder = wall("cylinder", Shape::Cylinder { axis: [0.01, 0.0], radius: 0.05 }, rough);
    let pipe = Shape::Cone { axis: [0.01, 0.0], lower: [-0.1, 0.05], upper: [0.3, 0.05] };
    let pipe = || wall("pipe", pipe, rough);
    let cup = wall("cup", Shape::Cone { axis: [0.0; 2], lower: [0.0, 0.0], upper: [0.05, 0.05] }, rough);
    let facet = |corners| wall("mesh", Shape::Triangle { corners }, rough);
    let vertex = [0.001, 0.002, 0.0];
    let fan = vec![
        facet([[-0.05, -0.05, 0.0], [0.05, -0.05, 0.0], vertex]),
        facet([[0.05, -0.05, 0.0], [0.0, 0.05, 0.0], vertex]),
        facet([[0.0, 0.05, 0.0], [-0.05, -0.05, 0.0], vertex]),
    ];
    let ridge = vec![
        facet([[-0.05, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, 0.05, -0.05]]),
        facet([[-0.05, 0.0, 0.0], [0.05, 0.0, 0.0], [0.0, -0.05, -0.05]]),
    ];
    // The weight on the side of the cup acts along its normal.
    let lean = GRAVITY / 2.0_f64.sqrt();
    let in_cup = [0.03 - RADIUS / 2.0_f64.sqrt(), 0.0, 0.03 + RADIUS / 2.0_f64.sqrt()];
    let plates = || vec![plate("left", -0.05), plate("right", 0.0)];
    vec![
        (on(vec![floor(rough)], down), [0.0, 0.0, RADIUS], "plane"),
        (on(vec![plate("plate", -0.02)], down), [0.0, 0.0, RADIUS], "rectangle, upper face"),
        (on(vec![plate("plate", -0.02)], [0.0, 0.0, GRAVITY]), [0.0, 0.0, -RADIUS], "rectangle, lower face"),
        (on(plates(), down), [0.0, 0.0, RADIUS], "joint of two rectangles"),
        (on(plates(), down), [0.3 * RADIUS, 0.0, RADIUS], "beside the joint"),
        (on(plates(), down), [-1e-7, 0.01, RADIUS], "a hair beside the joint"),
        (on(vec![plate("plate", 0.0)], [GRAVITY, 0.0, 0.0]), [-RADIUS, 0.0, 0.0], "edge of a rectangle"),
        (on(vec![cylinder], [GRAVITY, 0.0, 0.0]), [0.06 - RADIUS, 0.0, 0.2], "cylinder"),
        (on(vec![pipe()], [GRAVITY, 0.0, 0.0]), [0.06 - RADIUS, 0.0, 0.2], "pipe, inside"),
        (on(vec![pipe()], [-GRAVITY, 0.0, 0.0]), [0.06 + RADIUS, 0.0, 0.2], "pipe, outside"),
        (on(vec![pipe()], down), [0.06, 0.0, 0.3 + RADIUS], "rim of a pipe"),
        (on(vec![cup], [lean, 0.0, -lean]), in_cup, "cone"),
        (on(fan.clone(), down), [0.0, -0.02, RADIUS], "triangle"),
        (on(fan.clone(), [0.0, 0.0, GRAVITY]), [0.0, -0.02, -RADIUS], "triangle from below"),
        (on(fan, down), [0.001, 0.002, RADIUS], "vertex of three triangles"),
        (on(ridge, down), [0.01, 0.0, RADIUS], "ridge of two triangles"),
    ]
}

/// A grain at rest has one contact with overlap m g / k_w. The start rings at 30 % of critical damping: after 200 periods nothing but rounding
/// of coordinates (1e-17 of 7e-8 m) is left, so 1e-8 relative.
#[test]
fn a_sphere_rests_on_every_wall_with_the_equilibrium_overlap_and_one_contact() {
    for (setup, place, name) in resting_places() {
        let mut world = World::new(&setup, &[Grain::new(RADIUS, place)]).unwrap();
        run_for(&mut world, 0.1);
        let contacts = world.contacts();
        assert_eq!(contacts.len(), 1, "{name}");
        let error = contacts[0].overlap / rest_overlap(&setup) - 1.0;
        assert!(error.abs() < 1e-8, "{name}: overlap error {error}");
        let energies = world.energies();
        assert!(energies.translational < 1e-20 && energies.rotational < 1e-20, "{name}: {energies:?}");
    }
}

/// A grain in an inner corner touches both pieces.
#[test]
fn an_inner_corner_carries_a_sphere_on_both_pieces() {
    let rectangle = |edge_v| Shape::Rectangle { corner: [0.0, -0.05, 0.0], edge_u: [0.0, 0.1, 0.0], edge_v };
    let walls =
        vec![wall("bottom", rectangle([0.1, 0.0, 0.0]), SMOOTH), wall("side", rectangle([0.0, 0.0, 0.1]), SMOOTH)];
    let lean = GRAVITY / 2.0_f64.sqrt();
    let setup = Setup { walls, gravity: [-lean, 0.0, -lean], ..space(0.1) };
    let mut world = World::new(&setup, &[Grain::new(RADIUS, [RADIUS, 0.0, RADIUS])]).unwrap();
    run_for(&mut world, 0.1);
    let contacts = world.contacts();
    assert_eq!(contacts.iter().map(|c| c.other).collect::<Vec<_>>(), [Partner::Wall(0), Partner::Wall(1)]);
    let exact = rest_overlap(&setup) / 2.0_f64.sqrt();
    assert!(contacts.iter().all(|c| (c.overlap / exact - 1.0).abs() < 1e-7));
}

/// A sphere that slides and rolls over the joint of two coplanar rectangles moves as on one piece: one contact at every step, springs handed over.
/// The two runs differ by rounding of the rectangles' corners, which friction does not amplify: 1e-9 of the speed.
#[test]
fn a_sphere_crosses_a_joint_as_if_it_were_not_there() {
    let species = WallSpecies { sliding_friction: 0.3, rolling_friction: 0.02 };
    let plate = |name: &str, from: f64, to: f64| {
        let shape =
            Shape::Rectangle { corner: [from, -0.1, 0.0], edge_u: [to - from, 0.0, 0.0], edge_v: [0.0, 0.2, 0.0] };
        wall(name, shape, species)
    };
    let run = |walls: Vec<Wall>| {
        let setup = Setup { walls, ..ground(0.1, species) };
        let start = [-0.01, 0.0, RADIUS - rest_overlap(&setup)];
        let mut world = World::new(&setup, &[moving(start, [0.3, 0.05, 0.0])]).unwrap();
        for _ in 0..10_000 {
            world.step().unwrap();
            assert_eq!(world.contacts().len(), 1);
        }
        world.state()
    };
    let (one, two) =
        (run(vec![plate("all", -0.1, 0.2)]), run(vec![plate("left", -0.1, 0.0), plate("right", 0.0, 0.2)]));
    assert!(one.x[0] > 0.002, "the sphere crossed the joint: {}", one.x[0]);
    for (a, b) in [(one.vx[0], two.vx[0]), (one.vy[0], two.vy[0]), (one.wy[0] * RADIUS, two.wy[0] * RADIUS)] {
        assert!((a - b).abs() < 3e-10, "{a} against {b}");
    }
    assert!((one.z[0] - two.z[0]).abs() < 1e-13);
}

/// A floor that rises at constant velocity carries the grain with it.
#[test]
fn a_moving_wall_carries_a_sphere() {
    let setup = ground(0.1, SMOOTH);
    let mut world = World::new(&setup, &[Grain::new(RADIUS, [0.0, 0.0, RADIUS])]).unwrap();
    assert!(world.move_wall("floor", [0.0, 0.0, 0.02]).unwrap());
    run_for(&mut world, 0.5);
    // The impact of the first instant has rung out: 1e-9 m/s.
    assert!((world.state().vz[0] - 0.02).abs() < 1e-9);
    let height = 0.02 * world.time() + RADIUS - rest_overlap(&setup);
    assert!((world.state().z[0] - height).abs() < 1e-10);
}
