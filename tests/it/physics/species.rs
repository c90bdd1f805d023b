//! Grains of several species: their share, masses, frictions, and the time step that follows from the lightest.

use super::*;
use granulake::dem::{Simulation, Species};

fn steel(fraction: f64) -> Species {
    let size = SizeDistribution::TruncatedNormal { mean: 3e-3, sd: 3e-4, below: 1.5, above: 1.5 };
    Species { fraction, size, density: 7800.0, sliding_friction: 0.2, rolling_friction: 0.1 }
}

fn mixed(species: Vec<Species>) -> Setup {
    Setup { grains: Grains { species, ..bed_setup().grains }, ..bed_setup() }
}

#[test]
fn every_species_has_the_share_the_sizes_and_the_density_it_is_said_to_have() {
    let glass = Species { fraction: 0.2, density: 2500.0, ..steel(0.2) };
    let setup = mixed(vec![steel(0.3), glass]);
    let run = Simulation::new(&setup, 8).unwrap();
    let radii = run.world().state().radius;
    let volume = |r: &f64| 4.0 / 3.0 * PI * r * r * r;
    let densities: Vec<f64> = run.world().masses().iter().zip(&radii).map(|(mass, r)| mass / volume(r)).collect();
    let of = |density: f64| -> Vec<f64> {
        let own = radii.iter().zip(&densities).filter(|(_, own)| (*own / density - 1.0).abs() < 1e-9);
        own.map(|(r, _)| *r).collect()
    };
    let total: f64 = radii.iter().map(volume).sum();
    for (density, fraction) in [(7800.0, 0.3), (2500.0, 0.2), (DENSITY, 0.5)] {
        let share = of(density).iter().map(volume).sum::<f64>() / total;
        // The order of insertion keeps a share to the volume of a grain or two, of 1.2 cm at most, of 1e-4 m³.
        assert!((share - fraction).abs() < 0.06, "{density}: {share} of {fraction}");
    }
    assert_eq!(of(7800.0).len() + of(2500.0).len() + of(DENSITY).len(), radii.len());
    assert!(of(7800.0).iter().all(|r| (2.55e-3..=3.45e-3).contains(r)));
    // The first species is that of a filling without others, as far as it goes.
    let plain = bed_setup();
    let plain = Simulation::new(&plain, 8).unwrap().world().state().radius;
    let first = of(DENSITY);
    assert!(first.len() > 10 && first[..first.len() - 1] == plain[..first.len() - 1]);
}

/// Two grains of unlike mass and friction meet: momentum is kept, they part with the law's restitution, and friction takes the
/// harmonic mean of both coefficients times the impulse of the normal force, which cannot pull here. Tolerances: a relative
/// error of Δt/t_c of the restitution; 1 % of the friction, since the normal turns by 1e-3 while they slide past each other.
#[test]
fn grains_of_two_species_collide_with_their_own_masses_and_the_mean_of_their_frictions() {
    let (approach, along, friction) = (0.02, 0.06, 0.1);
    let (factor, heavy) = (3.0, 2.5);
    let mixed_friction = friction * 2.0 * factor / (1.0 + factor);
    let contact =
        ContactLaw { sliding_friction: friction, rolling_friction: 0.0, clip_normal: true, ..ContactLaw::default() };
    let effective = mass() * heavy / (1.0 + heavy);
    for fraction in FRACTIONS {
        let setup = Setup { contact: contact.clone(), ..space(fraction) };
        let other = Grain::new(RADIUS, [2.0 * RADIUS + 1e-8, 0.0, 0.0]);
        let grains = [
            moving([0.0; 3], [approach, along, 0.0]),
            Grain { sliding_factor: factor, density_factor: heavy, ..other },
        ];
        let mut world = World::new(&setup, &grains).unwrap();
        assert!((world.masses()[1] / world.masses()[0] - heavy).abs() < 1e-12);
        run_for(&mut world, 3.0 * PI * (effective / contact.stiffness).sqrt());
        assert!(world.contacts().is_empty(), "they have parted");
        let state = world.state();
        let momentum = mass() * (state.vx[0] + heavy * state.vx[1]);
        assert!((momentum / (mass() * approach) - 1.0).abs() < 1e-12, "{momentum}");
        let parting = (state.vx[1] - state.vx[0]) / approach;
        within("restitution", fraction, parting / clipped_restitution(0.3) - 1.0, fraction + 0.01);
        let rubbed = (along - state.vy[0]) / (approach - state.vx[0]);
        within("friction", fraction, rubbed / mixed_friction - 1.0, 0.01);
    }
}

#[test]
fn frictions_of_a_species_act_and_may_be_zero() {
    let mut setup = mixed(vec![steel(0.5)]);
    setup.stop.time_cap = 0.2;
    setup.stop.energy_ratio = None;
    let run = |sliding_friction, rolling_friction| {
        let mut setup = setup.clone();
        setup.grains.species = vec![Species { sliding_friction, rolling_friction, ..steel(0.5) }];
        simulate(&setup, 3).unwrap().state
    };
    let smooth = run(0.0, 0.0);
    assert!(smooth.x.iter().chain(&smooth.wz).all(|x| x.is_finite()));
    assert_ne!(smooth, run(0.2, 0.0));
    assert_ne!(run(0.2, 0.0), run(0.2, 0.04));
}

#[test]
fn the_time_step_is_that_of_the_lightest_grain_of_any_species() {
    let plain = time_step(&bed_setup());
    assert_eq!(time_step(&mixed(vec![Species { density: 1e6, ..steel(0.1) }])), plain);
    let light = Species { density: 300.0, ..steel(0.1) };
    let mass = sphere_mass(300.0, 2.55e-3);
    let expected = 0.15 * PI * (0.5 * mass / bed_setup().contact.stiffness).sqrt();
    assert!(expected < plain && (time_step(&mixed(vec![light])) / expected - 1.0).abs() < 1e-12);
}

#[test]
fn species_that_make_no_sense_are_refused() {
    let refused = |setup: Setup, part: &str| {
        let why = simulate(&setup, 1).unwrap_err().to_string();
        assert!(why.contains(part), "{why}");
    };
    refused(mixed(vec![steel(0.6), steel(0.4)]), "leave a share to the first species");
    refused(mixed(vec![steel(0.0)]), "fraction of a species is 0");
    refused(mixed(vec![Species { density: -1.0, ..steel(0.1) }]), "density of a species is -1");
    let smooth = ContactLaw { rolling_friction: 0.0, ..bed_setup().contact };
    refused(Setup { contact: smooth, ..mixed(vec![steel(0.1)]) }, "begin with a species that has it");
    let mut clumps = mixed(vec![steel(0.1)]);
    clumps.grains.aspect = 1.5;
    refused(clumps, "give an aspect ratio of 1");
}
