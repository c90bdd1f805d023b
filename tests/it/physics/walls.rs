//! A sphere on every wall primitive and on every joint: sliding, rolling, swinging, tipping over an edge.

use super::*;

const FRICTION: f64 = 0.4;
const SPEED: f64 = 0.3;
const ROUGH: WallSpecies = WallSpecies { sliding_friction: FRICTION, rolling_friction: 0.0 };

fn rectangle(name: &str, corner: Vec3, edge_u: Vec3, edge_v: Vec3, species: WallSpecies) -> Wall {
    wall(name, Shape::Rectangle { corner, edge_u, edge_v }, species)
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn place(world: &World) -> Vec3 {
    let state = world.state();
    [state.x[0], state.y[0], state.z[0]]
}

fn velocity(world: &World) -> Vec3 {
    let state = world.state();
    [state.vx[0], state.vy[0], state.vz[0]]
}

/// A wall to slide on: pieces, unit normal towards the grain, centre of a grain that rests on it, and direction of motion.
struct Track {
    name: &'static str,
    walls: Vec<Wall>,
    normal: Vec3,
    centre: Vec3,
    along: Vec3,
}

/// Every primitive, both faces of the one that has two, and a joint in the way.
fn tracks() -> Vec<Track> {
    let up = [0.0, 0.0, 1.0];
    let x = [1.0, 0.0, 0.0];
    let third = 1.0 / 3.0_f64.sqrt();
    let tilted = [third, third, third];
    let plate = |from: f64, to: f64| {
        rectangle(&format!("plate {from}"), [from, -0.05, 0.0], [to - from, 0.0, 0.0], [0.0, 0.1, 0.0], ROUGH)
    };
    let cylinder = wall("cylinder", Shape::Cylinder { axis: [0.01, 0.0], radius: 0.05 }, ROUGH);
    let slope = wall("slope", Shape::Plane { point: [0.0; 3], normal: tilted }, ROUGH);
    let half = 1.0 / 2.0_f64.sqrt();
    let track = |name, walls, normal: Vec3, centre, along| Track { name, walls, normal, centre, along };
    vec![
        track("plane", vec![floor(ROUGH)], up, [0.0, 0.0, RADIUS], x),
        track("tilted plane", vec![slope], tilted, tilted.map(|c| c * RADIUS), [half, -half, 0.0]),
        track("rectangle, upper face", vec![plate(-0.05, 0.05)], up, [0.0, 0.0, RADIUS], x),
        track("rectangle, lower face", vec![plate(-0.05, 0.05)], [0.0, 0.0, -1.0], [0.0, 0.0, -RADIUS], x),
        track("joint", vec![plate(-0.05, 0.002), plate(0.002, 0.05)], up, [0.0, 0.0, RADIUS], x),
        track("edge", vec![plate(-0.05, 0.0)], x, [RADIUS, 0.0, 0.0], [0.0, 1.0, 0.0]),
        track("cylinder, along the axis", vec![cylinder], [-1.0, 0.0, 0.0], [0.06 - RADIUS, 0.0, 0.0], up),
    ]
}

/// A sphere pressed on a wall by g and set sliding along it loses speed at μ g and rolls at 5/7 v₀ from t = 2 v₀/(7 μ g) on, on every primitive,
/// with one contact at every step. Friction is constant while it slides, so only rounding is left; rolling, the arm R - δ/2
/// shows, with δ/2R = 2e-6.
#[test]
fn a_sphere_slides_and_then_rolls_on_every_primitive() {
    for Track { name, walls, normal, centre, along } in tracks() {
        for fraction in FRACTIONS {
            let setup = Setup { walls: walls.clone(), gravity: normal.map(|c| -c * GRAVITY), ..space(fraction) };
            let sunk = [0, 1, 2].map(|c| centre[c] - normal[c] * rest_overlap(&setup));
            let mut world = World::new(&setup, &[moving(sunk, along.map(|c| c * SPEED))]).unwrap();
            let slope = FRICTION * GRAVITY;
            let stick = 2.0 * SPEED / (7.0 * slope);
            while world.time() < 0.9 * stick {
                world.step().unwrap();
                assert_eq!(world.contacts().len(), 1, "{name} at {} s", world.time());
            }
            let speed = dot(velocity(&world), along);
            within(&format!("{name}, sliding"), fraction, (speed - SPEED + slope * world.time()) / SPEED, 1e-11);
            while world.time() < 1.5 * stick {
                world.step().unwrap();
                assert_eq!(world.contacts().len(), 1, "{name} at {} s", world.time());
            }
            let rolling = dot(velocity(&world), along) / (5.0 / 7.0 * SPEED) - 1.0;
            within(&format!("{name}, rolling"), fraction, rolling, 2e-6);
            assert!(dot(velocity(&world), normal).abs() < 1e-9, "{name}: stays on the wall");
        }
    }
}

/// A sphere in a groove of two walls at right angles, each loaded with m a: both slow it, each turns it about an axis of its own, so that it rolls
/// at 5/9 v₀ from t = 4 v₀/(18 μ a) on. The joint is an inner corner, for two rectangles as for a plane and a cylinder's generator.
#[test]
fn a_sphere_in_a_right_angled_groove_rolls_at_five_ninths() {
    let bottom = || rectangle("bottom", [0.0, -0.1, 0.0], [0.1, 0.0, 0.0], [0.0, 0.2, 0.0], ROUGH);
    let side = || rectangle("side", [0.0, -0.1, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.1], ROUGH);
    let upright = || wall("upright", Shape::Plane { point: [0.0; 3], normal: [1.0, 0.0, 0.0] }, ROUGH);
    for walls in [vec![bottom(), side()], vec![bottom(), upright()], vec![floor(ROUGH), upright()]] {
        for fraction in FRACTIONS {
            let setup = Setup { walls: walls.clone(), gravity: [-GRAVITY, 0.0, -GRAVITY], ..space(fraction) };
            let out = RADIUS - rest_overlap(&setup);
            let mut world = World::new(&setup, &[moving([out, 0.0, out], [0.0, SPEED, 0.0])]).unwrap();
            let slope = 2.0 * FRICTION * GRAVITY;
            let stick = 4.0 * SPEED / (9.0 * slope);
            run_for(&mut world, 0.9 * stick);
            let sliding = (velocity(&world)[1] - SPEED + slope * world.time()) / SPEED;
            within("groove, sliding", fraction, sliding, 1e-11);
            run_for(&mut world, 0.6 * stick);
            within("groove, rolling", fraction, velocity(&world)[1] / (5.0 / 9.0 * SPEED) - 1.0, 2e-6);
            assert_eq!(world.contacts().len(), 2);
        }
    }
}

/// Floor and cylinder meet in an inner corner: a sphere pressed into it rests on both, each with its share of the load.
#[test]
fn a_sphere_rests_in_the_corner_of_floor_and_cylinder() {
    let cylinder = wall("cylinder", Shape::Cylinder { axis: [0.0; 2], radius: 0.05 }, ROUGH);
    let setup = Setup { walls: vec![floor(ROUGH), cylinder], gravity: [0.5 * GRAVITY, 0.0, -GRAVITY], ..space(0.1) };
    let mut world = World::new(&setup, &[Grain::new(RADIUS, [0.05 - RADIUS, 0.0, RADIUS])]).unwrap();
    run_for(&mut world, 0.1);
    let contacts = world.contacts();
    assert_eq!(contacts.iter().map(|c| c.other).collect::<Vec<_>>(), [Partner::Wall(0), Partner::Wall(1)]);
    // The friction of each wall carries some of the other's load as long as the start still pulls at the springs, so the loads add up in the mean only:
    // overlap and sliding spring together balance gravity to rounding.
    let law = &setup.contact;
    let (k, ks) = (2.0 * law.stiffness, 2.0 * law.stiffness * law.sliding_stiffness_ratio);
    let across = k * contacts[1].overlap + ks * contacts[0].sliding_spring[0];
    let down = k * contacts[0].overlap - ks * contacts[1].sliding_spring[2];
    assert!((across / (0.5 * mass() * GRAVITY) - 1.0).abs() < 1e-7, "{across}");
    assert!((down / (mass() * GRAVITY) - 1.0).abs() < 1e-7, "{down}");
}

/// A smooth sphere inside a smooth cylinder is a pendulum of length R_c - R: a quarter period is (π/2)√(L/g)(1 + φ²/16). The crossing is timed
/// to a step, and interpolated within it.
#[test]
fn a_smooth_sphere_swings_in_a_cylinder_like_a_pendulum() {
    let (radius, angle) = (0.05, 0.05_f64);
    let length = radius - RADIUS;
    for fraction in FRACTIONS {
        let cylinder = wall("cylinder", Shape::Cylinder { axis: [0.0; 2], radius }, SMOOTH);
        let setup = Setup { walls: vec![cylinder], gravity: [GRAVITY, 0.0, 0.0], ..space(fraction) };
        let reach = length + rest_overlap(&setup);
        let start = Grain::new(RADIUS, [reach * angle.cos(), reach * angle.sin(), 0.0]);
        let mut world = World::new(&setup, &[start]).unwrap();
        let (mut y, mut time) = (place(&world)[1], 0.0);
        while y > 0.0 {
            time = world.time() + y / -velocity(&world)[1].min(-1e-9);
            world.step().unwrap();
            y = place(&world)[1];
        }
        let exact = 0.5 * PI * (length / GRAVITY).sqrt() * (1.0 + angle * angle / 16.0);
        within("pendulum, quarter period", fraction, time / exact - 1.0, 1e-6);
    }
}

/// A smooth sphere that slides slowly over a convex edge turns about it and leaves it where cos θ = 2/3 + v₀²/(3 g R), with one contact until then,
/// on a bare edge as on an outer corner of two pieces. The dashpot sees the velocity of half a step ago, which
/// still points a little outwards: a pull of ζ ω Δt of the centripetal force, 9 % at t_c/10, that keeps the sphere on the edge for longer.
#[test]
fn a_smooth_sphere_leaves_a_convex_edge_at_the_angle_of_theory() {
    let top = || rectangle("top", [-0.05, -0.05, 0.0], [0.05, 0.0, 0.0], [0.0, 0.1, 0.0], SMOOTH);
    let down = || rectangle("down", [0.0, -0.05, -0.05], [0.0, 0.1, 0.0], [0.0, 0.0, 0.05], SMOOTH);
    let speed = 0.1;
    for walls in [vec![top()], vec![top(), down()], vec![down(), top()]] {
        for fraction in FRACTIONS {
            let setup = Setup { walls: walls.clone(), ..ground(fraction, SMOOTH) };
            let start = [-0.1 * RADIUS, 0.0, RADIUS - rest_overlap(&setup)];
            let mut world = World::new(&setup, &[moving(start, [speed, 0.0, 0.0])]).unwrap();
            let mut last = place(&world);
            while !world.contacts().is_empty() {
                assert_eq!(world.contacts().len(), 1);
                last = place(&world);
                world.step().unwrap();
            }
            let exact = 2.0 / 3.0 + speed * speed / (3.0 * GRAVITY * RADIUS);
            within("edge, angle of departure", fraction, last[2] / RADIUS / exact - 1.0, 0.36 * fraction + 1e-3);
        }
    }
}
