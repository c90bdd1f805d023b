//! What effects change in the engine: drag, gravity of a moved vessel, a gate that is pulled, fines.

use super::*;
use granulake::dem::Simulation;

/// A falling grain comes to v_t = √(m g/(c π R²)), and with v = v_t tanh(g t/v_t) on its way.
#[test]
fn a_grain_falls_through_air_as_newtons_drag_says() {
    let c = 5.0;
    let grains = Grains { drag: c, ..equal_spheres() };
    let setup = Setup { grains, gravity: [0.0, 0.0, -GRAVITY], ..space(0.1) };
    let mut world = World::new(&setup, &[moving([0.0, 0.0, 5.0], [0.0; 3])]).unwrap();
    let terminal = (mass() * GRAVITY / (c * PI * RADIUS * RADIUS)).sqrt();
    run_for(&mut world, 0.3);
    let expected = -terminal * (GRAVITY * world.time() / terminal).tanh();
    // Forces see the velocity half a step late: a relative error of g Δt/v_t.
    let tolerance = GRAVITY * world.time_step() / terminal;
    assert!((world.state().vz[0] / expected - 1.0).abs() < tolerance, "{} {expected}", world.state().vz[0]);
    let still = World::new(&Setup { grains: equal_spheres(), ..setup }, &[moving([0.0, 0.0, 5.0], [0.0; 3])]);
    let mut still = still.unwrap();
    run_for(&mut still, 0.3);
    assert!((still.state().vz[0] + GRAVITY * still.time()).abs() < 1e-9);
}

/// Drag of zero, fines of none: the same bits as without.
#[test]
fn what_is_absent_leaves_every_bit() {
    let plain = simulate(&bed_setup(), 5).unwrap();
    let with = |drag, fraction| {
        let fines = Some(Fines { fraction, radius: 2e-3 });
        let grains = Grains { drag, fines, ..bed_setup().grains };
        // The step follows the smallest grain that is possible; without any fines that is the same as without.
        let grains = if fraction == 0.0 { Grains { fines: None, ..grains } } else { grains };
        simulate(&Setup { grains, ..bed_setup() }, 5).unwrap()
    };
    assert_eq!(plain, with(0.0, 0.0));
    assert_ne!(plain.state, with(0.3, 0.0).state);
}

#[test]
fn fines_have_the_mass_they_are_said_to_have() {
    for fraction in [0.02, 0.15] {
        let radius = 2.5e-3;
        let grains = Grains { fines: Some(Fines { fraction, radius }), ..bed_setup().grains };
        let stop = StopRule { energy_ratio: None, waits: true, empty: None, check_after: 0.0, time_cap: 1e-9 };
        let state = simulate(&Setup { grains, stop: stop.clone(), ..bed_setup() }, 8).unwrap().state;
        let volume =
            |keep: &dyn Fn(f64) -> bool| -> f64 { state.radius.iter().filter(|r| keep(**r)).map(|r| r * r * r).sum() };
        let share = volume(&|r| r == radius) / volume(&|_| true);
        // The order of insertion keeps the share to the volume of one grain, at most 1.2 cm in radius, of 1e-4 m³.
        assert!((share - fraction).abs() < 0.03, "{share} of {fraction}");
        // The others are those of a filling without fines, as far as they go.
        let plain = simulate(&Setup { stop, ..bed_setup() }, 8).unwrap().state;
        let others: Vec<f64> = state.radius.iter().copied().filter(|r| *r != radius).collect();
        assert!(others.len() < plain.radius.len());
        assert_eq!(others[..others.len() - 1], plain.radius[..others.len() - 1]);
    }
}

/// Dropped by h and stopped again, a vessel leaves a resting grain where it was, and one that floats falls behind by h.
#[test]
fn a_dropped_vessel_is_a_change_of_gravity() {
    let height: f64 = 3e-3;
    let (fall, impact) = ((2.0 * height / GRAVITY).sqrt(), 5e-3);
    let mut world =
        World::new(&Setup { gravity: [0.0, 0.0, -GRAVITY], ..space(0.1) }, &[moving([0.0; 3], [0.0; 3])]).unwrap();
    world.set_gravity([0.0; 3]);
    run_for(&mut world, fall);
    // The kick of one step is shared between before and after, so it may carry a speed of g Δt through the fall.
    let slack = GRAVITY * world.time_step() * fall;
    assert!(world.state().z[0].abs() < slack, "in free fall a grain keeps its place in the vessel");
    world.set_gravity([0.0, 0.0, -GRAVITY * (1.0 + fall / impact)]);
    run_for(&mut world, impact);
    // The vessel has lost the speed g t_fall, so the grain has it downwards, and g t_impact besides.
    let expected = -GRAVITY * (fall + impact);
    let tolerance = 2.0 * GRAVITY * (1.0 + fall / impact) * world.time_step();
    assert!((world.state().vz[0] - expected).abs() < tolerance, "{} {expected}", world.state().vz[0]);
}

/// Knocks compact a bed of rough grains, and the more the higher the drop.
#[test]
fn knocks_compact_a_bed() {
    let knocks = |height: f64| {
        let fall = (2.0 * height / GRAVITY).sqrt();
        let felt =
            |time, factor: f64| Event { time, action: Action::SetGravity { gravity: [0.0, 0.0, -GRAVITY * factor] } };
        let one = |i: usize| {
            let start = 0.4 + 0.1 * i as f64;
            [felt(start, 0.0), felt(start + fall, 1.0 + fall / 5e-3), felt(start + fall + 5e-3, 1.0)]
        };
        let events = if height > 0.0 { (0..5).flat_map(one).collect() } else { Vec::new() };
        let contact =
            ContactLaw { sliding_friction: 0.8, rolling_friction: 0.5, stiffness: 3.67743e4, ..ContactLaw::default() };
        let stop = StopRule { energy_ratio: Some(1e-4), waits: true, empty: None, check_after: 0.4, time_cap: 1.5 };
        let state = simulate(&Setup { events, contact, stop, ..bed_setup() }, 2).unwrap().state;
        let mass: f64 = state.radius.iter().map(|r| r * r * r).sum();
        state.z.iter().zip(&state.radius).map(|(z, r)| z * r * r * r).sum::<f64>() / mass
    };
    let (rest, knocked) = (knocks(0.0), knocks(5e-3));
    assert!(knocked < 0.99 * rest, "centre of mass at {knocked}, {rest} without knocks");
}

/// Every experiment with a gate: pulled slowly it is gone after that time, and at once where the time is zero.
#[test]
fn a_pulled_gate_leaves_in_its_time() {
    for experiment in granulake::experiments::EXPERIMENTS.iter().filter(|e| e.name() != "bulk_density") {
        let mut settings = granulake::settings::Settings::default();
        let gone = |settings: &granulake::settings::Settings| {
            let events = experiment.setup(settings).unwrap().events;
            let removal = |event: &&Event| matches!(&event.action, Action::RemoveWall { name } if name == "gate");
            (events.len(), events.iter().find(removal).map(|event| event.time).unwrap())
        };
        let (events, at_once) = gone(&settings);
        settings.set("release_duration", 0.25).unwrap();
        let (more, later) = gone(&settings);
        assert!(more == events + 1 && (later - at_once - 0.25).abs() < 1e-12, "{}", experiment.name());
    }
}

/// Grains of the same volume whatever their shape, inserted without contact, each of them kept, taken away and weighed as a
/// whole; spheres have no stream of directions and keep every bit.
#[test]
fn a_bed_of_clumps_is_inserted_levelled_and_counted_by_the_clump() {
    for aspect in [1.4, 2.2] {
        let setup = Setup { grains: Grains { aspect, ..bed_setup().grains }, ..bed_setup() };
        let start = Simulation::new(&setup, 5).unwrap();
        let spheres = if aspect < 1.6 { 2 } else { 3 };
        assert_eq!(start.world().len(), spheres * start.world().clumps().len());
        assert!(start.world().contacts().is_empty(), "{} contacts", start.world().contacts().len());
        let outcome = simulate(&setup, 5).unwrap();
        assert_eq!(outcome.state.len() + outcome.deleted + outcome.lost, outcome.inserted);
        let moving = outcome.energies.translational / outcome.energies.elastic;
        assert!(outcome.deleted > 0 && moving < 1e-3, "{} deleted, {moving} of the energy moves", outcome.deleted);
        // The sizes of a filling are those of spheres, so that the grains that are left have radii of that filling.
        let filling = simulate(&Setup { events: Vec::new(), ..bed_setup() }, 5).unwrap().state.radius;
        let known = |r: &f64| filling.iter().any(|other| (r / other - 1.0).abs() < 1e-12);
        assert!(outcome.state.radius.iter().all(known), "aspect {aspect}");
    }
}

/// A clump is stiffer to turn the farther out it is hit: the step falls with √(1/(1 + m x²/I)), which for two touching
/// spheres of radius r, each of half the mass, is √(1/(1 + 1/(2/5 + 1))) = √(7/12).
#[test]
fn the_step_of_clumps_is_that_of_what_a_push_feels() {
    let step = |aspect| {
        World::new(&Setup { grains: Grains { aspect, ..equal_spheres() }, ..space(0.1) }, &[]).unwrap().time_step()
    };
    assert!((step(1.0 + 1e-9) / step(1.0) - 1.0).abs() < 1e-6);
    let far = step(1.5999) / step(1.0);
    assert!(far < 0.9 && far > (7.0_f64 / 12.0).sqrt(), "{far}");
}
