//! A piece that repeats itself in y: what happens across its ends is what happens anywhere else.

use super::many::cloud;
use super::*;
use granulake::dem::{Simulation, State};

const PERIOD: [f64; 2] = [-0.02, 0.024];

fn length() -> f64 {
    PERIOD[1] - PERIOD[0]
}

fn periodic(setup: Setup) -> Setup {
    Setup { periodic: Some(PERIOD), ..setup }
}

/// Distance of two places in y, the short way round.
fn apart(a: f64, b: f64) -> f64 {
    let gap = (a - b).rem_euclid(length());
    gap.min(length() - gap)
}

/// States equal but for the place in y, which is an image: within the rounding of a coordinate, grown by the collisions.
fn same_but_for_images(one: &State, other: &State, tolerance: f64) {
    assert_eq!(one.id, other.id);
    let columns = |s: &State| {
        [s.x.clone(), s.z.clone(), s.vx.clone(), s.vy.clone(), s.vz.clone(), s.wx.clone(), s.wy.clone(), s.wz.clone()]
    };
    for (a, b) in columns(one).iter().flatten().zip(columns(other).iter().flatten()) {
        assert!((a - b).abs() < tolerance, "{a} against {b}");
    }
    for (a, b) in one.y.iter().zip(&other.y) {
        assert!(apart(*a, *b) < tolerance, "{a} against {b}");
    }
}

/// Two spheres that meet at the ends of the period, off centre and spinning, part as two that meet in its middle.
#[test]
fn a_collision_across_the_ends_is_one_like_any_other() {
    let meet = |middle: f64| {
        let grain = |side: f64| Grain {
            spin: [30.0 * side, 5.0, -20.0],
            ..moving([1e-3 * side, middle + side * 1.02 * RADIUS, 5e-4], [0.1, -0.5 * side, 0.0])
        };
        let mut world = World::new(&periodic(space(0.05)), &[grain(-1.0), grain(1.0)]).unwrap();
        let mut touched = 0;
        for _ in 0..1500 {
            world.step().unwrap();
            touched += world.contacts().len();
        }
        assert!(touched > 10 && world.contacts().is_empty());
        world.state()
    };
    let (inside, across) = (meet(0.0), meet(PERIOD[1]));
    let moved = State { y: inside.y.iter().map(|y| y + PERIOD[1]).collect(), ..inside };
    // Rounding of 24 mm, 3e-18 m, over an overlap of 1e-5 m: 1e-12 of a speed of 1 m/s; spins are 200 times larger.
    same_but_for_images(&moved, &across, 1e-9);
    assert!(across.y.iter().all(|y| (PERIOD[0]..PERIOD[1]).contains(y)), "{:?}", across.y);
}

/// A wet pair that turns about itself while it drifts through the ends several times: springs and bridges go with it, so it moves as
/// without a period, to rounding.
#[test]
fn springs_and_bridges_pass_the_ends() {
    let bridges = Some(LiquidBridges { bond_number: 5e10, volume_ratio: 0.01, contact_angle: 0.0, wall_ratio: 1.0 });
    let contact = ContactLaw { damping: Damping::Ratio(0.0), sliding_friction: 10.0, ..ContactLaw::default() };
    let setup = Setup { bridges, contact, gravity: [0.0, 0.0, -1e-9], ..space(0.1) };
    let half = RADIUS - 0.5 * 50.0 * mass() / setup.contact.stiffness;
    let grain = |side: f64, spin: f64| Grain {
        spin: [spin, 0.0, 0.0],
        ..moving([0.0, half * side, 0.0], [0.0, 0.6, 20.0 * half * side])
    };
    let grains = [grain(-1.0, 20.0), grain(1.0, 20.2)];
    let (mut plain, mut wound) = (World::new(&setup, &grains).unwrap(), World::new(&periodic(setup), &grains).unwrap());
    let mut crossings = 0;
    for _ in 0..40 {
        let before = wound.state().y[0];
        run_for(&mut plain, 0.005);
        run_for(&mut wound, 0.005);
        crossings += usize::from(wound.state().y[0] < before - 0.5 * length());
        assert_eq!(wound.contacts().len(), 1, "at {} s", wound.time());
        let (a, b) = (plain.contacts()[0], wound.contacts()[0]);
        let close = |a: Vec3, b: Vec3| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-13);
        assert!(close(a.sliding_spring, b.sliding_spring) && close(a.rolling_spring, b.rolling_spring), "{a:?} {b:?}");
    }
    assert!(crossings >= 2, "{crossings} crossings");
    assert!(plain.contacts()[0].sliding_spring.iter().any(|x| x.abs() > 1e-9), "the spring holds something");
    same_but_for_images(&plain.state(), &wound.state(), 1e-9);
}

/// A sphere rolls over a floor and out of one end into the other at 5/7 of its speed, its spring at the floor kept.
#[test]
fn a_sphere_rolls_through_the_ends() {
    let setup = periodic(ground(0.1, WallSpecies { sliding_friction: 0.4, rolling_friction: 0.0 }));
    let start = [0.0, 0.0, RADIUS - rest_overlap(&setup)];
    let mut world = World::new(&setup, &[moving(start, [0.0, 0.3, 0.0])]).unwrap();
    while world.time() < 0.3 {
        world.step().unwrap();
        assert_eq!(world.contacts().len(), 1, "at {} s", world.time());
    }
    within("rolling through the ends", 0.1, world.state().vy[0] / (5.0 / 7.0 * 0.3) - 1.0, 2e-6);
}

/// Without damping and friction a gas that streams through the ends keeps its energy, as one between walls does; with both it keeps its momentum to
/// rounding, since forces cancel whichever image a grain sees.
#[test]
fn a_gas_through_the_ends_keeps_energy_and_momentum() {
    let streaming = || {
        let mut grains = cloud(4, 0.011);
        grains.iter_mut().for_each(|grain| grain.velocity[1] += 0.7);
        grains.iter_mut().for_each(|grain| grain.position[1] += 0.002);
        grains
    };
    for fraction in FRACTIONS {
        let frictionless = ContactLaw {
            damping: Damping::Ratio(0.0),
            sliding_friction: 0.0,
            rolling_friction: 0.0,
            ..ContactLaw::default()
        };
        let side = |k: usize, axis: usize, sign: f64| {
            let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
            (point[axis], normal[axis]) = (-0.024 * sign, sign);
            wall(&format!("side {k}"), Shape::Plane { point, normal }, SMOOTH)
        };
        let walls = vec![side(0, 0, 1.0), side(1, 0, -1.0), side(2, 2, 1.0), side(3, 2, -1.0)];
        let setup = periodic(Setup { contact: frictionless, walls, ..space(fraction) });
        let mut world = World::new(&setup, &streaming()).unwrap();
        let total = |world: &World| world.energies().translational + world.energies().elastic;
        let before = total(&world);
        run_for(&mut world, 0.05);
        within("gas through the ends, drift of energy", fraction, total(&world) / before - 1.0, fraction * fraction);
    }
    let mut world = World::new(&periodic(space(0.1)), &streaming()).unwrap();
    let (before, energy) = (world.momentum(), world.energies().translational);
    steps(&mut world, 3000);
    assert!(world.energies().translational < 0.95 * energy, "grains have collided and lost energy");
    let scale = 64.0 * mass();
    assert!(
        (0..3).all(|c| (world.momentum()[c] - before[c]).abs() < 3e-13 * scale),
        "{before:?} {:?}",
        world.momentum()
    );
}

/// A bed between two planes and two ends: filled without contact across them, settled, levelled, at rest with the contacts of a bed, and its momentum
/// along the ends is that which the floor takes; the same bytes at every try, and from a checkpoint.
#[test]
fn a_periodic_bed_comes_to_rest() {
    let species = WallSpecies { sliding_friction: 0.456, rolling_friction: 0.912 };
    let plane = |name: &str, x: f64, normal: f64| {
        wall(name, Shape::Plane { point: [x, 0.0, 0.0], normal: [normal, 0.0, 0.0] }, species)
    };
    let ends = [0.0, 0.12];
    let setup = Setup {
        walls: vec![floor(species), plane("left", -0.03, 1.0), plane("right", 0.03, -1.0)],
        fill: Fill { area: FillArea::Rectangle { x: [-0.03, 0.03], y: ends }, ..bed_setup().fill },
        periodic: Some(ends),
        domain: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.2, 1.0] },
        events: vec![Event {
            time: 0.4,
            action: Action::DeleteAbove { height: 0.02, reference: Reference::Top, level: true },
        }],
        ..bed_setup()
    };
    let start = Simulation::new(&setup, 1).unwrap();
    assert!(start.world().contacts().is_empty(), "the filling is free of contacts");
    let near_ends = start.world().state().y.iter().filter(|y| apart_in(**y, ends) < 5e-3).count();
    assert!(near_ends > 5, "{near_ends} grains were put near the ends");
    let outcome = simulate(&setup, 1).unwrap();
    assert_eq!(outcome.stop, granulake::dem::Stop::EnergyRatio);
    assert!(outcome.lost == 0 && outcome.state.y.iter().all(|y| (ends[0]..ends[1]).contains(y)));
    assert!((2.5..6.0).contains(&outcome.coordination_number), "{}", outcome.coordination_number);
    let mut run = Simulation::new(&setup, 1).unwrap();
    while run.world().time() < 0.3 {
        run.step().unwrap();
    }
    let mut run = Simulation::resume(&setup, 1, &run.checkpoint()).unwrap();
    let stop = loop {
        if let Some(stop) = run.step().unwrap() {
            break stop;
        }
    };
    assert_eq!(run.outcome(stop), outcome);
}

fn apart_in(y: f64, ends: [f64; 2]) -> f64 {
    (y - ends[0]).min(ends[1] - y)
}

#[test]
fn a_period_shorter_than_eight_radii_is_refused() {
    let short = Setup { periodic: Some([0.0, 7.9 * RADIUS]), ..space(0.1) };
    assert!(simulate(&short, 1).unwrap_err().to_string().contains("eight times the largest radius"));
}
