//! Many grains: conserved quantities, and springs that survive a rebuild of the neighbour lists.

use super::*;
use granulake::dem::{Contact, Partner, State};

/// Grains on a lattice with alternating velocities and spins, dense enough to collide many times.
pub fn cloud(count: usize, spacing: f64) -> Vec<Grain> {
    let phase = |k: usize, by: f64| ((k as f64 + 1.0) * by).fract() - 0.5;
    (0..count * count * count)
        .map(|k| {
            let cell = [k % count, k / count % count, k / (count * count)];
            let position = cell.map(|c| (c as f64 - 0.5 * (count as f64 - 1.0)) * spacing);
            let velocity = [phase(k, 0.618_034), phase(k, 0.414_214), phase(k, 0.732_051)];
            let spin = [80.0 * phase(k, 0.236_068), 80.0 * phase(k, 0.645_751), 80.0 * phase(k, 0.316_625)];
            Grain { spin, ..moving(position, velocity) }
        })
        .collect()
}

/// Six planes round the origin.
fn box_walls(half: f64, species: WallSpecies) -> Vec<Wall> {
    (0..6)
        .map(|k| {
            let (axis, sign) = (k / 2, if k % 2 == 0 { 1.0 } else { -1.0 });
            let (mut point, mut normal) = ([0.0; 3], [0.0; 3]);
            point[axis] = -sign * half;
            normal[axis] = sign;
            wall(&format!("side {k}"), Shape::Plane { point, normal }, species)
        })
        .collect()
}

/// A gas without damping and friction keeps its energy. A collision's energy error is of second order in the step and of either sign, so
/// the drift falls as Δt²: within 1 % at t_c/10 over about 10 collisions per grain, and 25 and 400 times less at t_c/50 and t_c/200.
#[test]
fn an_undamped_frictionless_gas_keeps_its_energy() {
    for fraction in FRACTIONS {
        let contact = frictionless();
        let setup = Setup { contact, walls: box_walls(0.024, SMOOTH), ..space(fraction) };
        let mut world = World::new(&setup, &cloud(4, 0.0115)).unwrap();
        let total = |world: &World| world.energies().translational + world.energies().elastic;
        let before = total(&world);
        run_for(&mut world, 0.05);
        within("gas, drift of energy", fraction, total(&world) / before - 1.0, fraction * fraction);
        assert!(world.rebuilds() > 2, "neighbour lists were rebuilt");
    }
}

/// Pair forces cancel and torques match the arms, so a free cloud keeps momentum and angular momentum to rounding: 1e-13 of Σ m |v| and
/// Σ m |x||v| per thousand steps.
#[test]
fn a_free_cloud_keeps_linear_and_angular_momentum() {
    let setup = space(0.1);
    let mut grains = cloud(5, 0.0101);
    // Squeezed towards the middle, so that it collides.
    grains.iter_mut().for_each(|g| (0..3).for_each(|c| g.velocity[c] -= 20.0 * g.position[c]));
    let mut world = World::new(&setup, &grains).unwrap();
    let (linear, angular) = (world.momentum(), world.angular_momentum());
    let before = world.energies().translational;
    steps(&mut world, 3000);
    assert!(world.energies().translational < 0.8 * before, "grains have collided and lost energy");
    let scale = 125.0 * mass() * 0.5;
    for c in 0..3 {
        assert!((world.momentum()[c] - linear[c]).abs() < 3e-13 * scale);
        assert!((world.angular_momentum()[c] - angular[c]).abs() < 3e-13 * scale * 0.03);
    }
}

/// The weight of a bed at rest is what its floor and side carry, so its contacts hold springs; rebuilding the lists keeps every one to the bit.
#[test]
fn springs_survive_a_rebuild_of_the_neighbour_lists() {
    let setup = bed_setup();
    let outcome = simulate(&setup, 4).unwrap();
    let mut world = World::new(&setup, &grains_of(&outcome.state)).unwrap();
    // Long enough for the grains to touch, rub and trade places in the order of cells.
    steps(&mut world, 3000);
    let before = sorted_contacts(&world);
    let rebuilds = world.rebuilds();
    assert!(world.move_wall("floor", [0.0; 3]).unwrap());
    assert_eq!(world.rebuilds(), rebuilds + 1);
    let after = sorted_contacts(&world);
    assert_eq!(before, after);
    let sliding = before.iter().filter(|c| c.1.sliding_spring != [0.0; 3]).count();
    assert!(sliding > 50 && sliding > before.len() / 2, "{sliding} of {} contacts hold a spring", before.len());
}

/// The same when the order of the grains really changes: pairs held together by strong bridges turn on a lattice that is out of step with the
/// cells, so that in many of them now one, now the other grain comes first, while undamped sliding springs swing. At Δt = t_c/100 a spring moves by at
/// most 6 % of its amplitude in a step (ω Δt with ω² = 7 k_s/m); a lost or flipped spring would jump by its whole size or twice that.
#[test]
fn springs_survive_when_grains_change_their_order() {
    // The Bond number is relative to a weight that is all but absent: F₀ = 50 m/s² times the mass of a grain.
    let bridges = Some(LiquidBridges { bond_number: 5e10, volume_ratio: 0.01, contact_angle: 0.0, wall_ratio: 1.0 });
    let contact = ContactLaw {
        damping: Damping::Ratio(0.0),
        sliding_friction: 10.0,
        rolling_friction: 0.0,
        ..ContactLaw::default()
    };
    let setup = Setup { bridges, contact, gravity: [0.0, 0.0, -1e-9], ..space(0.01) };
    let half = RADIUS - 0.5 * 50.0 * mass() / setup.contact.stiffness;
    let mut grains = Vec::new();
    for k in 0..36 {
        let centre = [0.0237 * f64::from(k % 6), 0.0237 * f64::from(k / 6), 0.0];
        // One grain of each pair spins faster than the pair turns, which starts the swing.
        for (x, spin) in [(-half, 20.0), (half, 20.2)] {
            let grain = moving([centre[0] + x, centre[1], 0.0], [0.0, 20.0 * x, 0.0]);
            grains.push(Grain { spin: [0.0, 0.0, spin], ..grain });
        }
    }
    let mut world = World::new(&setup, &grains).unwrap();
    let (mut previous, mut amplitude, mut jump) = (vec![[0.0; 3]; 36], 0.0_f64, 0.0_f64);
    let size = |s: Vec3| (s[0] * s[0] + s[1] * s[1] + s[2] * s[2]).sqrt();
    // One turn.
    while world.time() < 2.0 * PI / 20.0 {
        world.step().unwrap();
        let contacts = world.contacts();
        assert_eq!(contacts.len(), 36);
        for contact in contacts {
            let (spring, before) = (contact.sliding_spring, &mut previous[contact.grain as usize / 2]);
            amplitude = amplitude.max(size(spring));
            jump = jump.max(size([spring[0] - before[0], spring[1] - before[1], spring[2] - before[2]]));
            *before = spring;
        }
    }
    assert!(jump < 0.07 * amplitude, "largest jump {jump} of {amplitude}");
    assert!(world.rebuilds() > 10);
}

fn grains_of(state: &State) -> Vec<Grain> {
    (0..state.len())
        .map(|i| Grain {
            velocity: [state.vx[i], state.vy[i], state.vz[i]],
            spin: [state.wx[i], state.wy[i], state.wz[i]],
            ..Grain::new(state.radius[i], [state.x[i], state.y[i], state.z[i]])
        })
        .collect()
}

fn sorted_contacts(world: &World) -> Vec<((u32, i64), Contact)> {
    let key = |c: &Contact| match c.other {
        Partner::Grain(j) => (c.grain, i64::from(j)),
        Partner::Wall(w) => (c.grain, -1 - w as i64),
    };
    let mut contacts: Vec<_> = world.contacts().into_iter().map(|c| (key(&c), c)).collect();
    contacts.sort_by_key(|(key, _)| *key);
    contacts
}
