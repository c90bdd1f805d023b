//! Liquid bridges against Willett's formula.

use super::*;

const LIQUID: LiquidBridges =
    LiquidBridges { bond_number: 2.0, volume_ratio: 0.02, contact_angle: 0.4, wall_ratio: 1.0 };

/// Willett's force at a gap [m] for equal spheres: R = RADIUS, F₀ = Bo m g.
fn willett(gap: f64) -> f64 {
    let s = gap / RADIUS / LIQUID.volume_ratio.sqrt();
    LIQUID.bond_number * mass() * GRAVITY / (1.0 + 1.05 * s + 2.5 * s * s)
}

/// Gap at rupture [m].
fn rupture() -> f64 {
    let root = LIQUID.volume_ratio.cbrt();
    RADIUS * (1.0 + 0.5 * LIQUID.contact_angle) * (root + 0.1 * root * root)
}

/// Two spheres that part: gravity acts on both alike, so half their relative speed falls by F(s)/m. The measured change over a step is the mean of the
/// forces at its ends (velocity Verlet), so only the rounding of a velocity difference is left: 1e-13 / (a Δt) = 1e-6.
#[test]
fn a_liquid_bridge_pulls_with_willetts_force_and_breaks_at_its_distance() {
    let setup = Setup { bridges: Some(LIQUID), gravity: [0.0, 0.0, -GRAVITY], ..space(0.1) };
    let x = RADIUS - 1e-8;
    let grains = [moving([-x, 0.0, 0.0], [-0.5, 0.0, 0.0]), moving([x, 0.0, 0.0], [0.5, 0.0, 0.0])];
    let mut world = World::new(&setup, &grains).unwrap();
    let read = |world: &World| (world.state().x[1] - world.state().x[0] - 2.0 * RADIUS, world.state().vx[1]);
    world.step().unwrap();
    let (mut gap, mut speed) = read(&world);
    let (mut checked, mut broken) = (0, 0.0);
    while broken == 0.0 {
        world.step().unwrap();
        let (new_gap, new_speed) = read(&world);
        let measured = mass() * (speed - new_speed) / world.time_step();
        let exact = 0.5 * (willett(gap) + willett(new_gap));
        if new_gap >= rupture() {
            broken = new_gap;
        } else if gap > 0.0 {
            assert!((measured / exact - 1.0).abs() < 1e-5, "gap {new_gap}: {measured} against {exact}");
            checked += 1;
        }
        (gap, speed) = (new_gap, new_speed);
    }
    assert!(checked > 50, "{checked} gaps checked");
    steps(&mut world, 10);
    assert!(
        (read(&world).1 - speed).abs() <= 0.5 * willett(broken) / mass() * world.time_step() + 1e-14,
        "no force after rupture"
    );
}

/// A bridge forms on contact only: spheres that approach within the rupture distance feel nothing before they touch.
#[test]
fn a_liquid_bridge_forms_on_contact_only() {
    let setup = Setup { bridges: Some(LIQUID), gravity: [0.0, 0.0, -GRAVITY], ..space(0.1) };
    let x = RADIUS + 0.25 * rupture();
    let grains = [moving([-x, 0.0, 0.0], [0.1, 0.0, 0.0]), moving([x, 0.0, 0.0], [-0.1, 0.0, 0.0])];
    let mut world = World::new(&setup, &grains).unwrap();
    while world.contacts().is_empty() {
        assert_eq!(world.state().vx[0], 0.1);
        world.step().unwrap();
    }
}

/// A grain under a ceiling hangs by its bridge when 2 Bo > 1 (R = 2 R_i at a wall doubles the force), and falls when 2 Bo < 1;
/// with Bo times the ratio of the wall's force where walls are wetted less, so never where they stay dry.
#[test]
fn a_grain_hangs_from_a_ceiling_by_its_bridge() {
    let ceiling = wall("ceiling", Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, -1.0] }, SMOOTH);
    let hangs = |bond_number: f64, wall_ratio: f64| {
        let bridges = Some(LiquidBridges { bond_number, wall_ratio, ..LIQUID });
        let setup = Setup { bridges, gravity: [0.0, 0.0, -GRAVITY], walls: vec![ceiling.clone()], ..space(0.1) };
        let mut world = World::new(&setup, &[Grain::new(RADIUS, [0.0, 0.0, -RADIUS + 1e-9])]).unwrap();
        run_for(&mut world, 0.1);
        world.contacts().first().map(|contact| contact.overlap * 2.0 * setup.contact.stiffness / (mass() * GRAVITY))
    };
    // Net push of the wall: 2 Bo - 1 weights.
    assert!((hangs(0.8, 1.0).unwrap() - 0.6).abs() < 1e-6);
    assert!((hangs(1.6, 0.5).unwrap() - 0.6).abs() < 1e-6);
    assert_eq!([hangs(0.45, 1.0), hangs(0.9, 0.5), hangs(2.0, 0.0)], [None; 3]);
}
