//! A piece that repeats itself along y, or along several axes: what happens across its ends is what happens anywhere else.

use super::many::cloud;
use super::*;
use granulake::dem::{Simulation, State};

const PERIOD: [f64; 2] = [-0.02, 0.024];

fn length() -> f64 {
    PERIOD[1] - PERIOD[0]
}

fn periodic(setup: Setup) -> Setup {
    along(setup, [0.0, 1.0, 0.0])
}

/// Periods along the axes that a direction has a part in.
fn along(setup: Setup, direction: Vec3) -> Setup {
    Setup { periodic: direction.map(|part| (part != 0.0).then_some(PERIOD)), ..setup }
}

/// Distance of two coordinates, the short way round.
fn apart(a: f64, b: f64) -> f64 {
    let gap = (a - b).rem_euclid(length());
    gap.min(length() - gap)
}

/// States equal but for the places, which are images: within the rounding of a coordinate, grown by the collisions.
fn same_but_for_images(one: &State, other: &State, tolerance: f64) {
    assert_eq!(one.id, other.id);
    let columns = |s: &State| [s.vx.clone(), s.vy.clone(), s.vz.clone(), s.wx.clone(), s.wy.clone(), s.wz.clone()];
    let places = |s: &State| [s.x.clone(), s.y.clone(), s.z.clone()];
    for (a, b) in columns(one).iter().flatten().zip(columns(other).iter().flatten()) {
        assert!((a - b).abs() < tolerance, "{a} against {b}");
    }
    for (a, b) in places(one).iter().flatten().zip(places(other).iter().flatten()) {
        assert!(apart(*a, *b) < tolerance, "{a} against {b}");
    }
}

/// Two spheres that meet at the ends of a period, at the edge of two or the corner of three, off centre and spinning, part as two
/// that meet in its middle.
#[test]
fn a_collision_across_the_ends_is_one_like_any_other() {
    let directions = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0],
        [1.0, -1.0, 0.0],
        [0.0, 1.0, -1.0],
        [-1.0, 0.0, 1.0],
        [1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [-1.0, -1.0, 1.0],
    ];
    for way in directions {
        let size = way.iter().map(|part| part * part).sum::<f64>().sqrt();
        let meet = |middle: Vec3| {
            let grain = |side: f64| {
                let off = [1e-3 * way[1], -1e-3 * way[2], 1e-3 * way[0]];
                let place = |c: usize| middle[c] + side * (1.02 * RADIUS * way[c] / size + 0.3 * off[c]);
                Grain {
                    spin: [30.0 * side, 5.0, -20.0],
                    ..moving([0, 1, 2].map(place), way.map(|part| 0.1 * part * part - 0.5 * side * part / size))
                }
            };
            let mut world = World::new(&along(space(0.05), way), &[grain(-1.0), grain(1.0)]).unwrap();
            let mut touched = 0;
            for _ in 0..1500 {
                world.step().unwrap();
                touched += world.contacts().len();
            }
            assert!(touched > 10 && world.contacts().is_empty(), "{way:?}: {touched}");
            world.state()
        };
        // Where the direction falls the first grain comes from the upper end.
        let end = way.map(|part| if part == 0.0 { 0.0 } else { PERIOD[usize::from(part > 0.0)] });
        let (inside, across) = (meet([0.0; 3]), meet(end));
        let move_by = |column: &[f64], by: f64| column.iter().map(|x| x + by).collect::<Vec<f64>>();
        let (x, y, z) = (move_by(&inside.x, end[0]), move_by(&inside.y, end[1]), move_by(&inside.z, end[2]));
        // Rounding of 24 mm, 3e-18 m, over an overlap of 1e-5 m: 1e-12 of a speed of 1 m/s; spins are 200 times larger.
        same_but_for_images(&State { x, y, z, ..inside }, &across, 1e-9);
        for (column, part) in [&across.x, &across.y, &across.z].into_iter().zip(way) {
            let whole = part == 0.0 || column.iter().all(|x| (PERIOD[0]..PERIOD[1]).contains(x));
            assert!(whole, "{way:?}: {column:?}");
        }
    }
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
        let frictionless = frictionless();
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
    for way in [[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0; 3]] {
        let mut world = World::new(&along(space(0.1), way), &streaming()).unwrap();
        let (before, energy) = (world.momentum(), world.energies().translational);
        steps(&mut world, 3000);
        assert!(world.energies().translational < 0.95 * energy, "grains have collided and lost energy");
        let (scale, after) = (64.0 * mass(), world.momentum());
        assert!((0..3).all(|c| (after[c] - before[c]).abs() < 3e-13 * scale), "{way:?}: {before:?} {after:?}");
    }
}

/// Without walls nothing takes energy from a frictionless gas in a box that repeats itself along every axis.
#[test]
fn a_gas_in_a_box_without_walls_keeps_its_energy() {
    for fraction in FRACTIONS {
        let contact = frictionless();
        let setup = along(Setup { contact, ..space(fraction) }, [1.0; 3]);
        let mut grains = cloud(4, 0.011);
        grains.iter_mut().for_each(|grain| grain.position.iter_mut().for_each(|x| *x += 0.002));
        let mut world = World::new(&setup, &grains).unwrap();
        let total = |world: &World| world.energies().translational + world.energies().elastic;
        let (before, mut left) = (total(&world), 0);
        for _ in 0..50 {
            run_for(&mut world, 0.001);
            left += world.contacts().len();
        }
        assert!(left > 20, "{left} contacts seen");
        within("gas without walls, drift of energy", fraction, total(&world) / before - 1.0, fraction * fraction);
    }
}

/// A bed between two planes and two ends, or between ends on all four sides: filled without contact across them, settled, levelled, at
/// rest with the contacts of a bed, none lost; the same bytes at every try, and from a checkpoint.
#[test]
fn a_periodic_bed_comes_to_rest() {
    let species = WallSpecies { sliding_friction: 0.456, rolling_friction: 0.912 };
    let plane = |name: &str, x: f64, normal: f64| {
        wall(name, Shape::Plane { point: [x, 0.0, 0.0], normal: [normal, 0.0, 0.0] }, species)
    };
    let (sides, ends) = ([-0.05, 0.05], [0.0, 0.12]);
    let between = vec![floor(species), plane("left", sides[0], 1.0), plane("right", sides[1], -1.0)];
    for (walls, periodic) in
        [(between, [None, Some(ends), None]), (vec![floor(species)], [Some(sides), Some(ends), None])]
    {
        let setup = Setup {
            walls,
            fill: Fill { area: FillArea::Rectangle { x: sides, y: ends }, volume: 2e-4, ..bed_setup().fill },
            periodic,
            domain: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.2, 1.0] },
            events: vec![Event {
                time: 0.4,
                action: Action::DeleteAbove { height: 0.02, reference: Reference::Top, level: true },
            }],
            ..bed_setup()
        };
        let start = Simulation::new(&setup, 1).unwrap();
        assert!(start.world().contacts().is_empty(), "the filling is free of contacts");
        let near = |places: &[f64], ends: [f64; 2]| places.iter().filter(|x| apart_in(**x, ends) < 5e-3).count();
        let State { x, y, .. } = start.world().state();
        assert!(near(&y, ends) > 5 && (periodic[0].is_none() || near(&x, sides) > 5));
        let outcome = simulate(&setup, 1).unwrap();
        assert_eq!(outcome.stop, granulake::dem::Stop::EnergyRatio);
        let State { x, y, .. } = &outcome.state;
        let inside = |places: &[f64], ends: [f64; 2]| places.iter().all(|x| (ends[0]..ends[1]).contains(x));
        assert!(outcome.lost == 0 && inside(y, ends) && inside(x, sides));
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
}

fn apart_in(y: f64, ends: [f64; 2]) -> f64 {
    (y - ends[0]).min(ends[1] - y)
}

#[test]
fn periods_that_cannot_be_are_refused() {
    for axis in 0..3 {
        let mut setup = space(0.1);
        setup.periodic[axis] = Some([0.0, 7.9 * RADIUS]);
        assert!(simulate(&setup, 1).unwrap_err().to_string().contains("eight times the largest radius"));
    }
    let upwards = along(space(0.1), [0.0, 0.0, 1.0]);
    assert!(simulate(&upwards, 1).unwrap_err().to_string().contains("along which the vessel is filled"));
}
