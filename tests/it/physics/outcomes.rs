//! Runs that end badly, each with its typed outcome: exploded, clogged, against a wall; and a spin that never dies but does not matter.

use super::*;
use granulake::dem::Failure;
use granulake::experiments::{self, Reason};
use granulake::settings::Settings;

/// A grain shot at a wall at 100 m/s is stopped within v/ω = 4 mm, more than half its radius: the failure names grain, wall, place and time.
#[test]
fn an_explosion_at_a_wall_names_grain_wall_and_place() {
    let setup = ground(0.1, SMOOTH);
    let grains = [Grain::new(RADIUS, [0.05, 0.0, 1.0]), moving([0.0, 0.0, 2.0 * RADIUS], [0.0, 0.0, -100.0])];
    let mut world = World::new(&setup, &grains).unwrap();
    let failure = (0..100).find_map(|_| world.step().err()).expect("the wall cannot hold it");
    let Failure::Overlap { step, time, grain, position, overlap, with } = &failure else { panic!("{failure}") };
    assert_eq!((*grain, with.as_str()), (1, "wall floor"));
    assert_eq!((*step, *time), (world.steps(), world.time()));
    assert!(*overlap > 0.5 && (position[2] - RADIUS * (1.0 - overlap)).abs() < 1e-12, "{failure}");
}

/// A place or speed that is no number is refused before the first step, by the grain's number.
#[test]
fn a_grain_that_is_nowhere_is_named() {
    for bad in [moving([0.0, f64::NAN, 0.1], [0.0; 3]), moving([0.0, 0.0, 0.1], [0.0, 0.0, f64::INFINITY])] {
        let failure = World::new(&space(0.1), &[Grain::new(RADIUS, [0.05, 0.0, 0.1]), bad]).err().unwrap();
        assert!(matches!(failure, Failure::NotFinite { step: 0, grain: 1, .. }), "{failure}");
    }
}

/// Without torsion a spin about the contact normal meets no resistance: it stays to rounding. So rest is judged by translation alone, which here
/// is far below any limit while the grain still spins.
#[test]
fn spin_about_the_contact_normal_lasts_and_does_not_count_as_motion() {
    let setup = ground(0.1, WallSpecies { sliding_friction: 0.5, rolling_friction: 1.0 });
    let spinning = Grain { spin: [0.0, 0.0, 50.0], ..Grain::new(RADIUS, [0.0, 0.0, RADIUS - rest_overlap(&setup)]) };
    let mut world = World::new(&setup, &[spinning]).unwrap();
    run_for(&mut world, 0.2);
    assert!((world.state().wz[0] / 50.0 - 1.0).abs() < 1e-12);
    let energies = world.energies();
    assert!(energies.translational < 1e-12 * energies.elastic && energies.rotational > energies.elastic);
}

/// Settings of a run of a few seconds: grains of twice the size, soft, in a shallow frictionless slice.
fn coarse(changes: &[(&str, f64)]) -> Settings {
    let mut settings = Settings::default();
    let quick = [
        ("radius_scale", 2.0),
        ("radius_cut_below", 0.5),
        ("radius_cut_above", 1.5),
        ("stiffness_scale", 0.01),
        ("front_back_friction_scale", 0.0),
        ("stop_energy_ratio", 1e-3),
    ];
    quick.iter().chain(changes).for_each(|(name, value)| settings.set(name, *value).unwrap());
    settings
}

/// The first observable, the KPI, of one run.
fn kpi(name: &str, settings: &Settings) -> Result<f64, Reason> {
    let experiment = experiments::find(name).unwrap();
    let outcome = simulate(&experiment.setup(settings).unwrap(), 1).unwrap();
    experiment.measure(settings, &outcome.state, &outcome.trace)[0].1.clone()
}

/// A slot narrower than the grains lets none through: the run comes to rest long before its time cap, and the rate is `clogged`, not zero.
/// No grain starts outside the bin, where it would fall past the inclines and be lost.
#[test]
fn a_hopper_whose_slot_is_too_narrow_is_clogged() {
    let settings = coarse(&[
        ("hopper.slot", 0.015),
        ("hopper.width", 0.3),
        ("hopper.fill_height", 0.25),
        ("hopper.deletion_time", 0.5),
        ("hopper.release_time", 0.51),
        ("hopper.time_cap", 5.0),
    ]);
    let setup = experiments::find("hopper").unwrap().setup(&settings).unwrap();
    let outcome = simulate(&setup, 1).unwrap();
    assert_eq!(outcome.stop, granulake::dem::Stop::EnergyRatio);
    assert_eq!(outcome.lost, 0, "none was inserted under the inclines");
    assert!(matches!(kpi("hopper", &settings), Err(Reason::Clogged { share }) if share < 0.05));
}

/// A lower box as wide as the upper one turns the heap into a level bed: the angle is refused because the slope reaches a wall.
#[test]
fn a_heap_that_reaches_the_wall_has_no_angle() {
    let settings = coarse(&[
        ("pile.lower_width", 0.21),
        ("pile.slot", 0.15),
        ("pile.drop_height", 0.2),
        ("pile.deletion_time", 0.4),
        ("pile.release_time", 0.41),
        ("pile.time_cap", 2.0),
    ]);
    assert!(matches!(kpi("pile", &settings), Err(Reason::SlopeReachesWall { .. })), "{:?}", kpi("pile", &settings));
}
