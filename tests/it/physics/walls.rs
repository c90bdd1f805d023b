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
    let pipe = |from: f64, to: f64| {
        let shape = Shape::Cone { axis: [0.01, 0.0], lower: [from, 0.05], upper: [to, 0.05] };
        wall(&format!("pipe {from}"), shape, ROUGH)
    };
    let funnel = |from: f64, to: f64| {
        let shape = Shape::Cone { axis: [0.0; 2], lower: [from, 0.05 + from], upper: [to, 0.05 + to] };
        wall(&format!("funnel {from}"), shape, ROUGH)
    };
    // At radius 0.05 and z = 0 the funnel's normal points inwards and up.
    let steep = [-half, 0.0, half];
    let in_funnel = [0.05 - half * RADIUS, 0.0, half * RADIUS];
    let facet = |corners| wall("mesh", Shape::Triangle { corners }, ROUGH);
    let [a, b, c, d] = [[-0.05, -0.04, 0.0], [0.05, -0.06, 0.0], [0.06, 0.05, 0.0], [-0.05, 0.05, 0.0]];
    let whole = || facet([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.2, 0.0]]);
    // The vertex lies on the way.
    let fan = |m: Vec3| vec![facet([a, b, m]), facet([b, c, m]), facet([c, d, m]), facet([d, a, m])];
    let track = |name, walls, normal: Vec3, centre, along| Track { name, walls, normal, centre, along };
    vec![
        track("plane", vec![floor(ROUGH)], up, [0.0, 0.0, RADIUS], x),
        track("tilted plane", vec![slope], tilted, tilted.map(|c| c * RADIUS), [half, -half, 0.0]),
        track("rectangle, upper face", vec![plate(-0.05, 0.05)], up, [0.0, 0.0, RADIUS], x),
        track("rectangle, lower face", vec![plate(-0.05, 0.05)], [0.0, 0.0, -1.0], [0.0, 0.0, -RADIUS], x),
        track("joint", vec![plate(-0.05, 0.002), plate(0.002, 0.05)], up, [0.0, 0.0, RADIUS], x),
        track("edge", vec![plate(-0.05, 0.0)], x, [RADIUS, 0.0, 0.0], [0.0, 1.0, 0.0]),
        track("cylinder, along the axis", vec![cylinder], [-1.0, 0.0, 0.0], [0.06 - RADIUS, 0.0, 0.0], up),
        track("pipe, inside", vec![pipe(-0.05, 0.05)], [-1.0, 0.0, 0.0], [0.06 - RADIUS, 0.0, 0.0], up),
        track("pipe, outside", vec![pipe(-0.05, 0.05)], x, [0.06 + RADIUS, 0.0, 0.0], up),
        track(
            "joint of pipes",
            vec![pipe(0.002, 0.05), pipe(-0.05, 0.002)],
            [-1.0, 0.0, 0.0],
            [0.06 - RADIUS, 0.0, 0.0],
            up,
        ),
        track("cone, inside", vec![funnel(-0.04, 0.04)], steep, in_funnel, [half, 0.0, half]),
        track("joint of cones", vec![funnel(-0.04, 0.001), funnel(0.001, 0.04)], steep, in_funnel, [half, 0.0, half]),
        track("triangle, upper face", vec![whole()], up, [0.0, 0.0, RADIUS], x),
        track("triangle, lower face", vec![whole()], [0.0, 0.0, -1.0], [0.0, 0.0, -RADIUS], x),
        track("edge of a triangle", vec![whole()], [0.0, -1.0, 0.0], [0.0, -0.1 - RADIUS, 0.0], x),
        track("joints of triangles", fan([0.002, 0.003, 0.0]), up, [0.0, 0.0, RADIUS], x),
        track("vertex of triangles", fan([0.002, 0.0, 0.0]), up, [0.0, 0.0, RADIUS], x),
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

/// A flat mesh of triangles smaller than the grain, out of step with its way, is a plane: one contact at every step, and springs handed from facet to
/// facet so that friction and rolling resistance are those of the plane, to rounding of the facets' normals (as at a joint: 1e-9 of the speed).
#[test]
fn a_sphere_crosses_a_mesh_as_if_it_were_a_plane() {
    let species = WallSpecies { sliding_friction: 0.3, rolling_friction: 0.02 };
    let node = |i: i32, j: i32| {
        let jitter = |a: i32, b: i32| 6e-4 * (f64::from(a * 7 + b * 13) * 0.618).sin();
        [3e-3 * f64::from(i) + jitter(i, j), 3e-3 * f64::from(j) + jitter(j, i), 0.0]
    };
    let mut walls = Vec::new();
    for (i, j) in (-8..16).flat_map(|i| (-8..16).map(move |j| (i, j))) {
        let corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            walls.push(wall("mesh", Shape::Triangle { corners: [corners[a], corners[b], corners[c]] }, species));
        }
    }
    let run = |walls: Vec<Wall>| {
        let setup = Setup { walls, ..ground(0.1, species) };
        let start = [-0.01, 0.0, RADIUS - rest_overlap(&setup)];
        let mut world = World::new(&setup, &[moving(start, [0.3, 0.1, 0.0])]).unwrap();
        for _ in 0..10_000 {
            world.step().unwrap();
            assert_eq!(world.contacts().len(), 1);
        }
        world.state()
    };
    let (plane, mesh) = (run(vec![floor(species)]), run(walls));
    assert!(plane.x[0] > 0.002, "the sphere crossed several facets: {}", plane.x[0]);
    for (a, b) in [(plane.vx[0], mesh.vx[0]), (plane.vy[0], mesh.vy[0]), (plane.wy[0] * RADIUS, mesh.wy[0] * RADIUS)] {
        assert!((a - b).abs() < 3e-10, "{a} against {b}");
    }
    assert!((plane.z[0] - mesh.z[0]).abs() < 1e-13);
}

/// A grain in the corner between a funnel and the cylinder above it touches both; one on the rim of a pipe touches the rim alone, which
/// is a joint where a plate closes the pipe.
#[test]
fn corners_between_round_walls_and_others_carry_a_sphere() {
    let funnel = || wall("funnel", Shape::Cone { axis: [0.0; 2], lower: [-0.04, 0.01], upper: [0.0, 0.05] }, SMOOTH);
    let barrel = || wall("barrel", Shape::Cylinder { axis: [0.0; 2], radius: 0.05 }, SMOOTH);
    let rest = |walls: Vec<Wall>, gravity: Vec3, place: Vec3| {
        let setup = Setup { walls, gravity, ..space(0.1) };
        let mut world = World::new(&setup, &[Grain::new(RADIUS, place)]).unwrap();
        run_for(&mut world, 0.1);
        let weight = GRAVITY * mass() / (setup.contact.stiffness * setup.contact.wall_stiffness_ratio);
        world.contacts().iter().map(|c| (c.other, c.overlap / weight)).collect::<Vec<_>>()
    };
    // Pressed outwards with 2 g and down with g: the 45 degree funnel carries √2 m g, the barrel what is left of the push, m g.
    let corner = [0.05 - RADIUS, 0.0, (2.0_f64.sqrt() - 1.0) * RADIUS];
    let held = rest(vec![funnel(), barrel()], [2.0 * GRAVITY, 0.0, -GRAVITY], corner);
    assert_eq!(held.iter().map(|(other, _)| *other).collect::<Vec<_>>(), [Partner::Wall(0), Partner::Wall(1)]);
    assert!((held[0].1 / 2.0_f64.sqrt() - 1.0).abs() < 1e-5 && (held[1].1 - 1.0).abs() < 1e-5, "{held:?}");
    let pipe = || wall("pipe", Shape::Cone { axis: [0.0; 2], lower: [-0.04, 0.05], upper: [0.0, 0.05] }, SMOOTH);
    let lid = || rectangle("lid", [0.0, -0.05, 0.0], [0.05, 0.0, 0.0], [0.0, 0.1, 0.0], SMOOTH);
    for walls in [vec![pipe()], vec![pipe(), lid()], vec![lid(), pipe()]] {
        let held = rest(walls, [0.0, 0.0, -GRAVITY], [0.05, 0.0, RADIUS]);
        assert!(held.len() == 1 && (held[0].1 - 1.0).abs() < 1e-6, "{held:?}");
    }
}

/// A mesh goes, or moves, as a whole under its one name; a name that two other walls share is refused.
#[test]
fn a_mesh_is_addressed_by_its_name() {
    let facet = |corners| wall("mesh", Shape::Triangle { corners }, ROUGH);
    let [a, b, c, d] = [[-0.05, -0.05, 0.0], [0.05, -0.05, 0.0], [0.05, 0.05, 0.0], [-0.05, 0.05, 0.0]];
    let walls = vec![facet([a, b, c]), facet([a, c, d])];
    let setup = Setup { walls, ..ground(0.1, ROUGH) };
    let grains = [Grain::new(RADIUS, [0.02, -0.02, RADIUS]), Grain::new(RADIUS, [-0.02, 0.02, RADIUS])];
    let mut world = World::new(&setup, &grains).unwrap();
    assert!(world.move_wall("mesh", [0.0, 0.0, 0.02]).unwrap());
    run_for(&mut world, 0.5);
    assert!(world.state().vz.iter().all(|v| (v - 0.02).abs() < 1e-9), "{:?}", world.state().vz);
    assert!(world.remove_wall("mesh").unwrap() && !world.remove_wall("mesh").unwrap());
    run_for(&mut world, 0.1);
    assert!(world.contacts().is_empty() && world.state().vz.iter().all(|v| *v < -0.9));
    let shared = Setup { walls: vec![facet([a, b, c]), floor(ROUGH), facet([a, c, d])], ..setup };
    assert!(simulate(&shared, 1).unwrap_err().to_string().contains("two walls are named `mesh`"));
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
