//! Whole runs: reproducibility, stop rules, events, typed failures.

use super::*;
use granulake::dem::{Failure, Outcome, Simulation, Stop};

/// Hash over the bits of a state and its trace.
fn digest(outcome: &Outcome) -> String {
    let state = &outcome.state;
    let mut hasher = blake3::Hasher::new();
    let columns =
        [&state.radius, &state.x, &state.y, &state.z, &state.vx, &state.vy, &state.vz, &state.wx, &state.wy, &state.wz];
    for value in columns.into_iter().flatten() {
        hasher.update(&value.to_bits().to_le_bytes());
    }
    for point in &outcome.trace {
        hasher.update(&point.time.to_bits().to_le_bytes());
        hasher.update(&point.mass.to_bits().to_le_bytes());
    }
    hasher.update(&outcome.steps.to_le_bytes());
    hasher.finalize().to_hex().to_string()
}

/// The same setup and seed give the same bytes; another seed does not. The golden hash pins them across machines, compilers and
/// vector widths: it may change only together with the physics version.
#[test]
fn a_run_is_reproducible_to_the_bit() {
    let setup = bed_setup();
    let (first, second) = (simulate(&setup, 1).unwrap(), simulate(&setup, 1).unwrap());
    assert_eq!(first, second);
    assert_ne!(first.state, simulate(&setup, 2).unwrap().state);
    assert_eq!(digest(&first), "3ddf39c73f01cbb92a1e1eb85d9e27f1b67c17846935950d03023842a03ae65e");
}

/// A bed comes to rest, keeps its contacts, loses no grain, and its trace holds the mass that is there.
#[test]
fn a_bed_settles_and_stops_by_its_energy_ratio() {
    let outcome = simulate(&bed_setup(), 3).unwrap();
    assert_eq!(outcome.stop, Stop::EnergyRatio);
    assert!(outcome.energies.translational < 1e-6 * outcome.energies.elastic);
    assert!(outcome.time >= 0.4 && outcome.time < 2.0);
    assert_eq!(outcome.state.len() + outcome.deleted + outcome.lost, outcome.inserted);
    assert!(outcome.deleted > 0 && outcome.lost == 0);
    assert!(outcome.state.z.iter().zip(&outcome.state.radius).all(|(z, r)| z + r < 0.0305));
    // Frictional spheres at rest have between 3.3 and 6 contacts; walls and the few loose grains keep the mean of a small bed lower.
    assert!((2.5..6.0).contains(&outcome.coordination_number), "{}", outcome.coordination_number);
    let mass: f64 = outcome.state.radius.iter().map(|r| sphere_mass(DENSITY, *r)).sum();
    assert!((outcome.trace.last().unwrap().mass / mass - 1.0).abs() < 1e-12);
    assert!((outcome.trace.len() as f64 - outcome.time / 0.02).abs() <= 1.0);
    assert_eq!(outcome.events.len(), 1);
    // m g Σz must be carried: the elastic energy of a bed at rest is far below its potential energy, but not zero.
    assert!(outcome.energies.elastic > 0.0 && outcome.energies.elastic < outcome.energies.potential);
}

/// A hopper-like release: the floor goes, the grains fall out, the region empties; with a time cap in between the run says so.
#[test]
fn a_released_bed_empties_or_meets_its_time_cap() {
    let release = vec![Event { time: 0.3, action: Action::RemoveWall { name: "floor".into() } }];
    let region = Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 1.0] };
    let stop = StopRule { energy_ratio: None, waits: true, empty: Some(region), check_after: 0.3, time_cap: 1.0 };
    let domain = Region { lower: [-0.1, -0.1, -0.05], upper: [0.1, 0.1, 1.0] };
    let setup = Setup { events: release, stop: stop.clone(), domain, ..bed_setup() };
    let outcome = simulate(&setup, 1).unwrap();
    assert_eq!(outcome.stop, Stop::Empty);
    assert!(outcome.lost > 0, "the first grains have left the domain");
    assert!(outcome.trace.last().unwrap().mass < 0.5 * outcome.trace[0].mass);
    let capped = Setup { stop: StopRule { time_cap: 0.35, ..stop }, ..setup };
    let outcome = simulate(&capped, 1).unwrap();
    assert_eq!(outcome.stop, Stop::TimeCap);
    assert!((outcome.time - 0.35).abs() <= outcome.time_step);
}

/// A bed at rest that does not wait is levelled at the same time of its clock, from the same grains, after fewer steps; its
/// trace has no gap.
#[test]
fn a_bed_that_does_not_wait_at_rest_is_the_same_bed() {
    let mut setup = bed_setup();
    setup.events[0].time = 1.0;
    setup.stop.check_after = 1.0;
    let waiting = simulate(&setup, 1).unwrap();
    setup.stop.waits = false;
    let skipping = simulate(&setup, 1).unwrap();
    assert!(skipping.steps < waiting.steps * 7 / 10, "{} of {} steps", skipping.steps, waiting.steps);
    assert!((skipping.events[0].time - waiting.events[0].time).abs() < 2.0 * waiting.time_step);
    assert_eq!((skipping.deleted, skipping.stop), (waiting.deleted, waiting.stop));
    for (a, b) in skipping.state.z.iter().zip(&waiting.state.z) {
        assert!((a - b).abs() < 0.02 * RADIUS, "{a} and {b}: levelling moves a bed at rest by far less than a grain");
    }
    for (place, point) in skipping.trace.iter().enumerate() {
        assert!(
            (point.time - 0.02 * place as f64).abs() < 2.0 * skipping.time_step,
            "sample {place} at {}",
            point.time
        );
    }
    assert!((skipping.trace.len() as f64 - skipping.time / 0.02).abs() <= 1.0);
    // Where a wall moves, time matters.
    let slide = Event { time: 0.01, action: Action::MoveWall { name: "floor".into(), velocity: [0.0; 3] } };
    setup.events.insert(0, slide);
    let moved = simulate(&setup, 1).unwrap();
    assert_eq!(moved.steps, waiting.steps);
}

/// The insertion leaves no contact, respects walls and area, and keeps places and sizes when frictions are spread.
#[test]
fn insertion_is_free_of_contacts_and_paired_between_effects() {
    let setup = Setup {
        stop: StopRule { energy_ratio: None, waits: true, empty: None, check_after: 0.0, time_cap: 1e-9 },
        ..bed_setup()
    };
    let outcome = simulate(&setup, 8).unwrap();
    // One step has been made before the cap was seen: nothing can have touched yet beyond the distance of one step.
    assert_eq!(outcome.coordination_number, 0.0);
    let grains = Grains { rolling_spread: 0.5, ..setup.grains.clone() };
    let spread = simulate(&Setup { grains, ..setup.clone() }, 8).unwrap();
    assert_eq!(outcome.state, spread.state);
    let volume: f64 = outcome.state.radius.iter().map(|r| 4.0 / 3.0 * PI * r * r * r).sum();
    let largest = 4.0 / 3.0 * PI * 1.2e-2 * 1.2e-2 * 1.2e-2;
    assert!((1e-4..1e-4 + largest).contains(&volume));
}

/// Friction spread changes the bed; spread zero is the same as none, bit for bit, and so are bridges of Bond number zero.
#[test]
fn absent_effects_are_bit_identical_to_zero_strength() {
    let plain = simulate(&bed_setup(), 5).unwrap();
    let with = |bond_number| {
        let bridges = Some(LiquidBridges { bond_number, volume_ratio: 0.01, contact_angle: 0.3, wall_ratio: 1.0 });
        simulate(&Setup { bridges, ..bed_setup() }, 5).unwrap()
    };
    assert_eq!(plain, with(0.0));
    assert_ne!(plain.state, with(0.5).state);
    let spread = |rolling_spread| {
        let grains = Grains { rolling_spread, ..bed_setup().grains };
        simulate(&Setup { grains, ..bed_setup() }, 5).unwrap()
    };
    assert_eq!(plain, spread(0.0));
    assert_ne!(plain.state, spread(0.3).state);
}

/// Up to the radii by which the first and the last grain stand out of the cloud, 1.2 cm at most each, of 16 to 80 cm.
#[test]
fn the_inserted_cloud_has_the_density_that_is_asked_for() {
    let filled = |density: f64| {
        let fill = Fill { rise: Rise::ToDensity(density), volume: 2e-4, ..bed_setup().fill };
        let setup = Setup { fill, ..bed_setup() };
        Simulation::new(&setup, 4).map(|run| run.world().state())
    };
    for density in [0.05, 0.15, 0.25] {
        let state = filled(density).unwrap();
        let volume: f64 = state.radius.iter().map(|r| 4.0 / 3.0 * PI * r * r * r).sum();
        let height = state.z.iter().fold(0.0_f64, |top, z| top.max(*z));
        let wanted = volume / (PI * 0.04 * 0.04) / density;
        assert!((height - wanted).abs() < 0.015, "{density}: {height} m for {wanted}");
        // None lies deeper than one that was placed before it.
        assert!(state.z.windows(2).all(|pair| pair[0] <= pair[1]));
    }
    let jammed = filled(0.7).unwrap_err();
    assert!(matches!(jammed, Failure::FillJammed { inserted, .. } if inserted > 0), "{jammed}");
    assert!(jammed.to_string().contains("lower the insertion density"), "{jammed}");
}

#[test]
fn failures_say_what_where_and_what_to_do() {
    let unknown = Event { time: 0.1, action: Action::RemoveWall { name: "flor".into() } };
    let message = simulate(&Setup { events: vec![unknown], ..bed_setup() }, 1).unwrap_err().to_string();
    assert!(message.contains("`flor`") && message.contains("floor, side"), "{message}");
    let low = Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 0.02] };
    let failure = simulate(&Setup { domain: low, ..bed_setup() }, 1).unwrap_err();
    assert!(matches!(failure, Failure::FillOverflow { inserted, .. } if inserted > 0), "{failure}");
    // A step beyond the stability limit 2/ω = 0.64 t_c blows up, and the failure names step and grain.
    let failure = simulate(&Setup { time_step_fraction: 0.9, ..bed_setup() }, 1).unwrap_err();
    assert!(matches!(failure, Failure::Overlap { .. } | Failure::NotFinite { .. }), "{failure}");
    assert!(failure.to_string().contains("exploded at step"), "{failure}");
}

#[test]
fn impossible_setups_are_refused() {
    let refused = |setup: Setup| matches!(simulate(&setup, 1), Err(Failure::InvalidSetup { .. }));
    let contact = |change: fn(&mut ContactLaw)| {
        let mut setup = bed_setup();
        change(&mut setup.contact);
        setup
    };
    assert!(refused(contact(|law| law.stiffness = 0.0)));
    assert!(refused(contact(|law| law.sliding_friction = f64::NAN)));
    assert!(refused(contact(|law| law.damping = Damping::Restitution(0.0))));
    assert!(refused(Setup { time_step_fraction: -0.1, ..bed_setup() }));
    let mut twins = bed_setup();
    twins.walls[1].name = "floor".into();
    assert!(refused(twins));
    let skewed = Shape::Rectangle { corner: [0.0; 3], edge_u: [1.0, 0.0, 0.0], edge_v: [1.0, 1.0, 0.0] };
    assert!(refused(Setup { walls: vec![wall("skewed", skewed, SMOOTH)], ..bed_setup() }));
}

/// A bed that never reached the height at which it is levelled is a failure that says how high it stood; without the claim to be
/// full the same run goes on.
#[test]
fn an_underfilled_vessel_is_a_typed_failure() {
    let level = |height, level| {
        let events =
            vec![Event { time: 0.4, action: Action::DeleteAbove { height, reference: Reference::Top, level } }];
        simulate(&Setup { events, ..bed_setup() }, 3)
    };
    let failure = level(0.2, true).unwrap_err();
    let Failure::Underfilled { time, height, highest, step } = failure else { panic!("{failure}") };
    assert!((0.4..0.401).contains(&time) && step > 0 && height == 0.2);
    assert!((0.03..0.1).contains(&highest), "{highest}");
    assert!(failure.to_string().starts_with("underfilled: at t = 0.4"), "{failure}");
    let outcome = level(0.2, false).unwrap();
    assert_eq!((outcome.deleted, outcome.lost, outcome.state.len()), (0, 0, outcome.inserted));
    let ratio = outcome.energies.ratio().expect("a bed holds elastic energy");
    assert!(ratio < 1e-6 && outcome.attempts > outcome.inserted as u64);
}

/// A grain that flies out of the domain is removed and counted.
#[test]
fn grains_that_leave_the_domain_are_counted() {
    let domain = Region { lower: [-0.1; 3], upper: [0.1; 3] };
    let setup = Setup { domain, ..space(0.1) };
    let mut world =
        World::new(&setup, &[moving([0.0; 3], [1.0, 0.0, 0.0]), moving([0.0, 0.05, 0.0], [-0.5, 0.0, 0.0])]).unwrap();
    run_for(&mut world, 0.15);
    assert_eq!((world.len(), world.lost()), (1, 1));
    assert_eq!(world.state().id, [1]);
}
