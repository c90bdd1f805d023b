//! Rigid clumps: free rotation, rest, and many of them.

use super::*;
use granulake::dem::{Clump, ClumpMotion, State};

fn clump(aspect: f64, position: Vec3) -> Clump {
    Clump::new(RADIUS, aspect, position)
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A dumbbell that spins about an axis which is none of its own keeps energy and angular momentum to rounding, while its axis turns about L at
/// |L|/I_t; the angle errs by (L Δt/I_t)²/12 of itself, 3e-9 here.
#[test]
fn a_free_dumbbell_precesses_and_keeps_energy_and_angular_momentum() {
    let tumbling = Clump { spin: [60.0, 20.0, -10.0], velocity: [0.1, 0.2, 0.3], ..clump(1.6, [0.0; 3]) };
    let mut world = World::with_clumps(&space(0.1), &[], &[tumbling]).unwrap();
    let (before, energies): (ClumpMotion, _) = (world.clumps()[0], world.energies());
    steps(&mut world, 20_000);
    let after = world.clumps()[0];
    for c in 0..3 {
        assert!((after.momentum[c] - before.momentum[c]).abs() < 1e-12 * dot(before.momentum, before.momentum).sqrt());
        assert!((after.centre[c] - before.velocity[c] * world.time()).abs() < 1e-12);
    }
    assert!((world.energies().rotational / energies.rotational - 1.0).abs() < 1e-10);
    assert!((world.energies().translational / energies.translational - 1.0).abs() < 1e-10);
    // Rotation of u about the unit vector of L by the angle φ; I_t from L = I_t ω across the axis.
    let size = dot(before.momentum, before.momentum).sqrt();
    let pole = before.momentum.map(|c| c / size);
    let transverse = before.momentum[1] / 20.0;
    let angle = size / transverse * world.time();
    let (u, turn) = (before.axis, cross(pole, before.axis));
    let along = dot(pole, u);
    for c in 0..3 {
        let exact = u[c] * angle.cos() + turn[c] * angle.sin() + pole[c] * along * (1.0 - angle.cos());
        assert!((after.axis[c] - exact).abs() < 1e-6, "{:?} for {exact}", after.axis);
    }
    assert!(angle > 4.0, "it has turned by {angle}");
}

/// A clump that lies on a floor rests on all its spheres, each with its share of the weight.
#[test]
fn a_clump_comes_to_rest_on_all_its_spheres() {
    for (aspect, count) in [(1.4, 2), (2.2, 3)] {
        let setup = ground(0.1, WallSpecies { sliding_friction: 0.5, rolling_friction: 0.0 });
        // Dropped a little askew.
        let dropped = Clump { axis: [1.0, 0.0, 0.05], ..clump(aspect, [0.0, 0.0, 1.1 * RADIUS]) };
        let mut world = World::with_clumps(&setup, &[], &[dropped]).unwrap();
        run_for(&mut world, 0.5);
        let contacts = world.contacts();
        assert_eq!(contacts.len(), count, "aspect {aspect}");
        let share = rest_overlap(&setup) / count as f64;
        assert!(contacts.iter().all(|c| (c.overlap / share - 1.0).abs() < 1e-4), "{contacts:?}");
        let energies = world.energies();
        assert!(energies.translational < 1e-15 && energies.rotational < 1e-15, "{energies:?}");
        let [body] = world.clumps()[..] else { panic!("one clump") };
        assert!((body.mass / mass() - 1.0).abs() < 1e-12 && body.axis[2].abs() < 1e-6, "{body:?}");
        assert!((world.mass_in(&setup.domain) / mass() - 1.0).abs() < 1e-12);
    }
}

/// Clumps and spheres on a lattice, thrown together.
fn crowd() -> (Vec<Grain>, Vec<Clump>) {
    let grains = super::many::cloud(4, 0.022);
    let squeezed = |g: &Grain| [0, 1, 2].map(|c| g.velocity[c] - 20.0 * g.position[c]);
    let (free, bound): (Vec<_>, Vec<_>) = grains.iter().enumerate().partition(|(k, _)| k % 3 == 0);
    let clumps = bound.iter().map(|(k, g)| {
        let axis = [1.0, (*k as f64 * 0.618).fract() - 0.5, (*k as f64 * 0.414).fract() - 0.5];
        Clump { axis, velocity: squeezed(g), spin: g.spin, ..clump(1.2 + 0.3 * (k % 4) as f64, g.position) }
    });
    (free.iter().map(|(_, g)| Grain { velocity: squeezed(g), ..**g }).collect(), clumps.collect())
}

/// Pair forces cancel whatever they are gathered into: momentum and angular momentum of a crowd that collides stay to rounding.
#[test]
fn a_crowd_of_clumps_keeps_linear_and_angular_momentum() {
    let (grains, clumps) = crowd();
    let mut world = World::with_clumps(&space(0.1), &grains, &clumps).unwrap();
    let (linear, angular, energy) = (world.momentum(), world.angular_momentum(), world.energies().translational);
    steps(&mut world, 6000);
    assert!(world.energies().translational < 0.8 * energy, "they have collided and lost energy");
    let scale = 64.0 * mass() * 0.8;
    for c in 0..3 {
        assert!((world.momentum()[c] - linear[c]).abs() < 1e-12 * scale, "{:?} {linear:?}", world.momentum());
        assert!((world.angular_momentum()[c] - angular[c]).abs() < 1e-12 * scale * 0.05);
    }
    assert!(world.rebuilds() > 3);
}

/// Aspect 1 is the sphere, bit for bit; and clumps out of the domain, or above a height, go as a whole.
#[test]
fn a_clump_of_aspect_one_is_a_sphere_and_clumps_go_as_a_whole() {
    let setup = ground(0.1, WallSpecies { sliding_friction: 0.4, rolling_friction: 0.1 });
    let thrown = Clump { velocity: [0.3, 0.1, 0.0], spin: [5.0, 1.0, 2.0], ..clump(1.0, [0.0, 0.0, 1.2 * RADIUS]) };
    let same = Grain { velocity: thrown.velocity, spin: thrown.spin, ..Grain::new(RADIUS, thrown.position) };
    let end = |mut world: World| -> State {
        steps(&mut world, 5000);
        world.state()
    };
    let one = end(World::with_clumps(&setup, &[], &[thrown]).unwrap());
    assert_eq!(one, end(World::new(&setup, &[same]).unwrap()));
    let domain = Region { lower: [-0.1; 3], upper: [0.1; 3] };
    let leaving = Clump { velocity: [1.0, 0.0, 0.0], ..clump(1.5, [0.08, 0.0, 0.0]) };
    let standing = Clump { axis: [0.0, 0.0, 1.0], ..clump(1.5, [0.0, 0.0, 0.05]) };
    let clumps = [leaving, standing, clump(1.5, [-0.05, 0.0, 0.0])];
    let mut world = World::with_clumps(&Setup { domain, ..space(0.1) }, &[], &clumps).unwrap();
    run_for(&mut world, 0.05);
    assert_eq!((world.len(), world.lost(), world.clumps().len()), (4, 1, 2));
    assert_eq!(world.delete_above(0.05, Reference::Centre), Ok(1));
    assert_eq!((world.len(), world.clumps().len()), (2, 1));
    let refused = |aspect| World::with_clumps(&space(0.1), &[], &[clump(aspect, [0.0; 3])]).is_err();
    assert!(refused(0.9) && refused(3.0) && refused(f64::NAN) && !refused(2.5));
}
