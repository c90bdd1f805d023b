//! Experiments: what they measure on states of known shape, what they refuse, and one small real run of each.

use granulake::dem::{self, Action, ContactLaw, Event, Grains, Reference, Rise, State, TracePoint};
use granulake::experiments::{self, EXPERIMENTS, Measurement, Reason};
use granulake::settings::{SIEVES, Scope, Settings, specs};

const RADIUS: f64 = 2e-3;

fn with(changes: &[(&str, f64)]) -> Settings {
    let mut settings = Settings::default();
    changes.iter().for_each(|(name, value)| settings.set(name, *value).unwrap());
    settings
}

fn push(state: &mut State, x: f64, y: f64, z: f64, radius: f64) {
    for (array, value) in [(&mut state.x, x), (&mut state.y, y), (&mut state.z, z), (&mut state.radius, radius)] {
        array.push(value);
    }
    for array in [&mut state.vx, &mut state.vy, &mut state.vz, &mut state.wx, &mut state.wy, &mut state.wz] {
        array.push(0.0);
    }
    state.id.push(state.id.len() as u32);
}

/// A surface of small grains every 2 mm in x and y over 0.1 m of depth, with tops on z = height(x).
fn surface(from: f64, to: f64, height: impl Fn(f64) -> f64) -> State {
    let mut state = State::default();
    let columns = ((to - from) / 2e-3).round() as usize;
    for i in 0..columns {
        let x = from + (i as f64 + 0.5) * 2e-3;
        (0..50).for_each(|j| push(&mut state, x, f64::from(j) * 2e-3 + 1e-3, height(x) - RADIUS, RADIUS));
    }
    state
}

fn measure(name: &str, settings: &Settings, state: &State, trace: &[TracePoint]) -> Vec<Measurement> {
    experiments::find(name).unwrap().measure(settings, state, trace)
}

fn value(measurements: &[Measurement], name: &str) -> Result<f64, Reason> {
    measurements.iter().find(|(observable, _)| *observable == name).unwrap().1.clone()
}

fn tangent(degrees: f64) -> f64 {
    libm::tan(degrees * std::f64::consts::PI / 180.0)
}

/// Slopes of `left` and `right` degrees that meet at 0.15 m above the floor.
fn heap(left: f64, right: f64) -> State {
    surface(-0.12, 0.12, |x| 0.15 - if x < 0.0 { -x * tangent(left) } else { x * tangent(right) })
}

#[test]
fn names_units_and_order_are_a_contract() {
    let kpis: Vec<_> =
        EXPERIMENTS.iter().map(|e| (e.name(), e.observables()[0].name, e.observables()[0].unit)).collect();
    let expected = [
        ("pile", "angle_of_repose", "deg"),
        ("ledge", "angle_of_movement", "deg"),
        ("bulk_density", "bulk_density", "kg/m3"),
        ("hopper", "discharge_rate", "kg/s"),
    ];
    assert_eq!(kpis, expected);
    let mut names: Vec<_> = EXPERIMENTS.iter().flat_map(|e| e.observables()).map(|o| o.name).collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    for experiment in EXPERIMENTS {
        assert_eq!(experiment.observables().iter().filter(|o| o.is_kpi).count(), 1, "{}", experiment.name());
        let measured: Vec<_> =
            measure(experiment.name(), &Settings::default(), &State::default(), &[]).into_iter().map(|m| m.0).collect();
        assert_eq!(measured, experiment.observables().iter().map(|o| o.name).collect::<Vec<_>>());
    }
    assert!(experiments::find("piles").is_err());
}

#[test]
fn a_heap_of_known_slopes_is_measured_by_every_operator() {
    for operator in ["front", "slices", "silhouette"] {
        let mut settings = Settings::default();
        settings.set_text("slope_operator", operator).unwrap();
        let measured = measure("pile", &settings, &heap(30.0, 24.0), &[]);
        // Marks are the first column of a bin on one side and the last on the other, all on the line: rounding only.
        assert!((value(&measured, "angle_of_repose").unwrap() - 27.0).abs() < 1e-9, "{operator}");
        assert!((value(&measured, "pile_angle_difference").unwrap() - 6.0).abs() < 1e-9, "{operator}");
        assert!(value(&measured, "pile_roughness").unwrap() < 1e-12, "{operator}");
        // The apex is at most one column, 1 mm, from the centre line.
        assert!((value(&measured, "pile_apex_height").unwrap() - 0.15).abs() < 1e-3, "{operator}");
    }
}

#[test]
fn a_symmetric_heap_has_no_left_and_right() {
    let measured = measure("pile", &Settings::default(), &heap(26.0, 26.0), &[]);
    assert!(value(&measured, "pile_angle_difference").unwrap().abs() < 1e-9);
    // Columns at ±1, ±3 … ±119 mm weigh the same: rms = √((4·60² − 1)/3) mm.
    let rms = 1e-3 * ((4.0 * 3600.0 - 1.0) / 3.0_f64).sqrt();
    assert!((value(&measured, "pile_spread").unwrap() - rms).abs() < 1e-12);
}

#[test]
fn a_rolled_camera_splits_left_from_right_by_twice_the_roll() {
    let measured = measure("pile", &with(&[("camera_roll", 1.5)]), &heap(26.0, 26.0), &[]);
    // Rolling moves the apex by 0.15 m sin 1.5° = 4 mm into one window: a tenth of a degree.
    assert!((value(&measured, "pile_angle_difference").unwrap() - 3.0).abs() < 0.1);
    assert!((value(&measured, "angle_of_repose").unwrap() - 26.0).abs() < 0.1);
}

#[test]
fn an_arch_over_the_slot_is_no_pile_test() {
    let mut state = heap(26.0, 26.0);
    assert!(value(&measure("pile", &Settings::default(), &state, &[]), "angle_of_repose").is_ok());
    let (drop, slot) = (Settings::default()["pile.drop_height"], Settings::default()["pile.slot"]);
    push(&mut state, 0.6 * slot, 0.05, drop + 0.01, 5e-3);
    assert!(value(&measure("pile", &Settings::default(), &state, &[]), "angle_of_repose").is_ok(), "on a shelf");
    let clear = measure("pile", &Settings::default(), &state, &[]);
    push(&mut state, -0.5 * slot, 0.05, drop - 4e-3, 5e-3);
    assert_eq!(measure("pile", &Settings::default(), &state, &[]), clear, "a grain that hangs on the edge is no heap");
    push(&mut state, 0.1 * slot, 0.05, drop + 0.01, 5e-3);
    for (name, value) in measure("pile", &Settings::default(), &state, &[]) {
        assert_eq!(value.map_err(|reason| reason.code()), Err("arched"), "{name}");
    }
}

#[test]
fn the_pile_weighs_its_shelves_and_times_its_discharge() {
    let mut state = heap(26.0, 26.0);
    (0..3).for_each(|i| push(&mut state, 0.08, 0.01 * f64::from(i), 0.45, 5e-3));
    let trace: Vec<_> = (0..400)
        .map(|i| f64::from(i) * 0.01)
        .map(|time| TracePoint { time, mass: 3.0 - 1.5 * (time - 1.65).clamp(0.0, 1.0) })
        .collect();
    let measured = measure("pile", &Settings::default(), &state, &trace);
    let grain = 2750.0 * 4.0 / 3.0 * std::f64::consts::PI * 1.25e-7;
    assert!((value(&measured, "pile_shelf_mass").unwrap() - 3.0 * grain).abs() < 1e-12);
    assert!((value(&measured, "pile_rate").unwrap() - 1.5).abs() < 1e-9);
    assert!((value(&measured, "pile_t50").unwrap() - 0.5).abs() < 1e-9);
}

#[test]
fn a_grain_in_flight_and_a_stray_one_are_no_heap_but_one_against_a_wall_is() {
    let mut state = heap(26.0, 26.0);
    push(&mut state, -0.015, 0.005, 0.3, 5e-3);
    assert!(
        value(&measure("pile", &Settings::default(), &state, &[]), "angle_of_repose").unwrap() > 40.0,
        "a grain that rests is seen"
    );
    *state.vz.last_mut().unwrap() = -1.4;
    let falling = value(&measure("pile", &Settings::default(), &state, &[]), "angle_of_repose").unwrap();
    assert!((falling - 26.0).abs() < 1e-9, "a grain in flight is no outline: {falling}");
    push(&mut state, 0.493, 0.05, 4e-3, 5e-3);
    assert!(
        value(&measure("pile", &Settings::default(), &state, &[]), "angle_of_repose").is_ok(),
        "a stray grain on the floor is no heap"
    );
    push(&mut state, 0.493, 0.05, 14e-3, 5e-3);
    let measured = measure("pile", &Settings::default(), &state, &[]);
    assert_eq!(value(&measured, "angle_of_repose"), Err(Reason::SlopeReachesWall { x: 0.493 }));
    assert_eq!(value(&measured, "pile_t50"), Err(Reason::NoTrace));
    assert!(value(&measured, "pile_apex_height").is_ok());
}

#[test]
fn a_ledge_is_measured_beyond_the_level_ground_at_its_back() {
    // Level at 0.2 m up to 20 mm from the back wall, then 41.4 degrees down.
    let state = surface(0.0, 0.238, |x| 0.2 - (x - 0.02).max(0.0) * tangent(41.4));
    for operator in ["front", "slices"] {
        // d_s = 0.5/0.9·60 mm = 33 mm lies on the slope, d_s at friction 0.1 = 6.7 mm does not.
        let mut settings = Settings::default();
        settings.set_text("slope_operator", operator).unwrap();
        let measured = measure("ledge", &settings, &state, &[]);
        assert!((value(&measured, "angle_of_movement").unwrap() - 41.4).abs() < 1e-9, "{operator}");
        assert!(value(&measured, "ledge_curvature").unwrap().abs() < 1e-9, "{operator}");
        assert!((value(&measured, "ledge_back_height").unwrap() - 0.2).abs() < 1e-12, "{operator}");
        settings.set("sliding_friction", 0.1).unwrap();
        settings.set("rolling_friction", 0.1).unwrap();
        assert!(value(&measure("ledge", &settings, &state, &[]), "angle_of_movement").unwrap() < 41.0, "{operator}");
    }
    let grain = 2750.0 * 4.0 / 3.0 * std::f64::consts::PI * RADIUS * RADIUS * RADIUS;
    let measured = measure("ledge", &Settings::default(), &state, &[]);
    assert!((value(&measured, "ledge_mass").unwrap() - state.len() as f64 * grain).abs() < 1e-9);
}

#[test]
fn a_hollow_ledge_has_positive_curvature() {
    let state = surface(0.0, 0.238, |x| 0.2 - 0.9 * x + 1.5 * x * x);
    let measured = measure("ledge", &Settings::default(), &state, &[]);
    // Over the window from 33 to 228 mm dz/dx changes by 3 L; the columns of marks sample the parabola exactly.
    assert!((value(&measured, "ledge_curvature").unwrap() - 3.0 * (0.228 - 0.06 * 0.5 / 0.9)).abs() < 1e-9);
}

#[test]
fn an_emptied_ledge_names_its_reason() {
    let state = surface(0.0, 0.04, |_| 0.01);
    let measured = measure("ledge", &Settings::default(), &state, &[]);
    assert_eq!(value(&measured, "angle_of_movement"), Err(Reason::TooFewBins { filled: 1, needed: 3 }));
    let mut settings = Settings::default();
    settings.set_text("empty_bins", "refuse").unwrap();
    assert_eq!(value(&measure("ledge", &settings, &state, &[]), "angle_of_movement").unwrap_err().code(), "empty_bin");
    let wrong = with(&[("ledge.window_end", 0.03)]);
    assert_eq!(value(&measure("ledge", &wrong, &state, &[]), "ledge_roughness").unwrap_err().code(), "empty_window");
}

#[test]
fn the_cylinder_counts_grains_as_its_rule_says() {
    let mut state = State::default();
    // Wholly below 236 mm, cut with the centre below, cut with the centre above, wholly above.
    [0.1, 0.234, 0.238, 0.25].into_iter().for_each(|z| push(&mut state, 0.0, 0.0, z, 5e-3));
    let volume = std::f64::consts::PI * 0.082 * 0.082;
    let grain = 2750.0 * 4.0 / 3.0 * std::f64::consts::PI * 1.25e-7;
    for (rule, count, mass) in [("remaining", 4.0, 4.0), ("centre", 2.0, 2.0), ("whole", 1.0, 1.0), ("cut", 3.0, 2.0)] {
        let mut settings = Settings::default();
        settings.set_text("bulk_density.count", rule).unwrap();
        let measured = measure("bulk_density", &settings, &state, &[]);
        // The two cut grains are mirror images about the plane, so their parts add up to one.
        assert!((value(&measured, "bulk_density").unwrap() - mass * grain / (volume * 0.237)).abs() < 1e-12, "{rule}");
        assert_eq!(value(&measured, "cylinder_count"), Ok(count), "{rule}");
        assert!((value(&measured, "cylinder_mean_mass").unwrap() - mass * grain / count).abs() < 1e-15, "{rule}");
    }
    let mut settings = with(&[("bulk_density.tare", 0.1)]);
    let full = value(&measure("bulk_density", &settings, &state, &[]), "bulk_density").unwrap();
    assert!((full - (4.0 * grain + 0.1) / (volume * 0.237)).abs() < 1e-12);
    settings.set_text("bulk_density.volume", "filled").unwrap();
    let filled = value(&measure("bulk_density", &settings, &state, &[]), "bulk_density").unwrap();
    assert!((filled / full - 237.0 / 236.0).abs() < 1e-12);
    assert_eq!(
        value(&measure("bulk_density", &settings, &State::default(), &[]), "bulk_density"),
        Err(Reason::NoGrains)
    );
}

#[test]
fn the_hopper_reads_rate_and_gain_off_its_trace() {
    let trace: Vec<_> = (0..400)
        .map(|i| f64::from(i) * 0.02)
        .map(|time| TracePoint { time, mass: (20.0 - 3.7 * (time - 1.6).max(0.0)).max(0.0) })
        .collect();
    let rate =
        |settings: &Settings| value(&measure("hopper", settings, &State::default(), &trace), "discharge_rate").unwrap();
    assert!((rate(&Settings::default()) - 3.7).abs() < 1e-9);
    assert!((rate(&with(&[("hopper.load_cell_gain", 0.02)])) - 3.7 * 1.02).abs() < 1e-9);
    let clogged: Vec<_> = trace[..150].to_vec();
    let measured = measure("hopper", &Settings::default(), &State::default(), &clogged);
    assert_eq!(value(&measured, "discharge_rate").unwrap_err().code(), "clogged");
}

#[test]
fn contradicting_dimensions_are_refused_by_name() {
    let refused = |name: &str, changes: &[(&str, f64)]| {
        experiments::find(name).unwrap().setup(&with(changes)).unwrap_err().to_string()
    };
    assert_eq!(
        refused("pile", &[("pile.slot", 0.3)]),
        "pile: `pile.slot` (0.3 m) must be below `pile.upper_width` (0.2 m)"
    );
    assert!(refused("ledge", &[("ledge.release_time", 1.0)]).contains("ledge.deletion_time"));
    assert!(refused("hopper", &[("hopper.slot", 0.7)]).contains("hopper.width"));
    assert!(refused("bulk_density", &[("bulk_density.time_cap", 1.0)]).contains("bulk_density.deletion_time"));
}

#[test]
fn a_key_holds_exactly_the_settings_that_move_setup_or_measurement() {
    // Every setting, changed alone, changes the set-up of the experiments it claims (simulate) and of no other.
    for spec in granulake::settings::specs() {
        let base = where_it_speaks(spec.name);
        let mut settings = base.clone();
        let value = settings[spec.name];
        // Sensible small steps: some settings are compared with others. Drops are counted.
        let step = if spec.name == "bulk_density.taps" { 1.0 } else { value * 0.01 + 1e-3 };
        let changed =
            [value + step, value * 0.99, 1.0].into_iter().find(|next| *next != value && spec.accepts(*next)).unwrap();
        settings.set(spec.name, changed).unwrap();
        for experiment in EXPERIMENTS {
            let moved = experiment.setup(&settings) != experiment.setup(&base);
            let claimed = spec.scope == Scope::Simulate && spec.is_used_by(experiment.name());
            // Bridges exist only at a Bond number above 0, so their other numbers are silent by default.
            let silent = ["liquid_volume_ratio", "contact_angle", "wall_bridge_ratio"].contains(&spec.name);
            assert_eq!(moved, claimed && !silent, "{} {}", experiment.name(), spec.name);
        }
    }
}

/// The defaults, but with fines, with knocks, and with the kind of size distribution that reads the setting.
fn where_it_speaks(name: &str) -> Settings {
    let mut settings = Settings::default();
    settings.set("fines_fraction", 0.1).unwrap();
    settings.set("bulk_density.tap_height", 0.01).unwrap();
    for kind in ["rosin_rammler", "sieve"].into_iter().filter(|kind| name.starts_with(kind)) {
        settings.set_text("size_distribution", kind).unwrap();
        for (number, (size, _)) in SIEVES.iter().enumerate() {
            settings.set(size, 0.01 * (number + 1) as f64).unwrap();
        }
    }
    settings
}

#[test]
fn the_default_is_the_papers_full_scale_study() {
    let setup = |name: &str| experiments::find(name).unwrap().setup(&Settings::default()).unwrap();
    for experiment in EXPERIMENTS {
        let setup = setup(experiment.name());
        assert_eq!(setup.contact, ContactLaw { sliding_friction: 0.5, rolling_friction: 0.5, ..ContactLaw::default() });
        assert_eq!(setup.grains, Grains::default());
        assert_eq!(setup.gravity, [0.0, 0.0, -9.81]);
        assert_eq!((setup.time_step_fraction, setup.fill.rise), (0.1, Rise::PerAttempt(1e-4)));
        assert_eq!((setup.bridges, setup.stop.energy_ratio), (None, Some(1e-6)));
    }
    let species = |name: &str, wall: &str| {
        let wall = setup(name).walls.into_iter().find(|w| w.name == wall).unwrap();
        (wall.species.sliding_friction, wall.species.rolling_friction)
    };
    // Table 1 and μ_r = 2 μ_s.
    assert_eq!(species("pile", "front"), (0.446, 0.892));
    assert_eq!(species("ledge", "floor"), (0.446, 0.892));
    assert_eq!(species("bulk_density", "cylinder"), (0.456, 0.912));
    assert_eq!(species("hopper", "left incline"), (0.523, 1.046));
    assert_eq!(species("hopper", "back"), (0.446, 0.892));
    // Table 5: fill height and deletion time, and the times of release.
    for (name, height, deletion, release) in
        [("pile", 0.51, 1.55, 1.65), ("ledge", 0.218, 1.55, 1.65), ("hopper", 0.66, 1.5, 1.6)]
    {
        let events = setup(name).events;
        assert_eq!(
            events[0],
            Event { time: deletion, action: Action::DeleteAbove { height, reference: Reference::Centre, level: true } },
            "{name}"
        );
        assert_eq!(
            events[1],
            Event { time: release, action: Action::RemoveWall { name: "gate".to_owned() } },
            "{name}"
        );
    }
    // The hopper's bed: 602 × 660 × 50 mm without two wedges of 251 × 251 / 2 mm², times the insertion ratio.
    let bed = 0.05 * (0.602 * 0.66 - 0.251 * 0.251);
    assert!((setup("hopper").fill.volume / (0.66 * bed) - 1.0).abs() < 1e-12);
}

/// The default study's coarse set-up.
const COARSE: &[(&str, f64)] = &[
    ("radius_scale", 2.0),
    ("pile.radius_scale", 0.75),
    ("radius_cut_below", 0.5),
    ("radius_cut_above", 1.5),
    ("stiffness_scale", 0.01),
    ("time_step_fraction", 0.12),
    ("front_back_friction_scale", 0.0),
    ("slope_operator", 1.0),
    ("insertion_ratio", 0.62),
    ("stop_energy_ratio", 1e-3),
    ("pile.depth", 0.06),
    ("pile.slot", 0.13),
    ("pile.drop_height", 0.27),
    ("pile.deletion_time", 0.4),
    ("pile.release_time", 0.41),
    ("pile.time_cap", 1.6),
    ("ledge.depth", 0.06),
    ("ledge.deletion_time", 0.45),
    ("ledge.release_time", 0.46),
    ("ledge.time_cap", 1.6),
    ("bulk_density.deletion_time", 0.4),
    ("bulk_density.time_cap", 1.0),
    ("hopper.slot", 0.24),
    ("hopper.deletion_time", 0.8),
    ("hopper.release_time", 0.81),
    ("hopper.time_cap", 8.0),
];

/// Measurements of one coarse run at both frictions `friction` and 2700 kg/m³, after `change`.
fn coarse_run(name: &str, friction: f64, seed: u64, change: (&str, f64)) -> Vec<Measurement> {
    let mut settings = with(COARSE);
    let point = [("sliding_friction", friction), ("rolling_friction", friction), ("particle_density", 2700.0), change];
    point.iter().for_each(|(name, value)| settings.set(name, *value).unwrap());
    let experiment = experiments::find(name).unwrap();
    let outcome = dem::simulate(&experiment.setup(&settings).unwrap(), seed).unwrap();
    experiment.measure(&settings, &outcome.state, &outcome.trace)
}

const NO_CHANGE: (&str, f64) = ("bond_number", 0.0);

fn coarse_mean(name: &str, observable: &str, friction: f64, change: (&str, f64)) -> f64 {
    (1..=4).map(|seed| value(&coarse_run(name, friction, seed, change), observable).unwrap()).sum::<f64>() / 4.0
}

#[test]
fn coarse_runs_give_plausible_kpis_that_follow_friction() {
    // Means of 12 other seeds at friction 0.1 and 0.5, give or take four standard errors of a mean of four.
    let cases = [
        ("pile", "angle_of_repose", (7.5, 4.6), (21.6, 10.2)),
        ("ledge", "angle_of_movement", (26.7, 5.6), (36.5, 6.6)),
        ("bulk_density", "bulk_density", (1516.8, 18.0), (1371.0, 25.6)),
    ];
    for (experiment, kpi, smooth, rough) in cases {
        for (friction, (mean, reach)) in [(0.1, smooth), (0.5, rough)] {
            let found = coarse_mean(experiment, kpi, friction, NO_CHANGE);
            assert!((found - mean).abs() < reach, "{kpi} at friction {friction}: {found}, expected {mean} ± {reach}");
        }
    }
}

#[test]
fn a_coarse_hopper_empties_at_a_plausible_rate_and_the_same_seed_gives_the_same_bits() {
    let measured = coarse_run("hopper", 0.5, 1, NO_CHANGE);
    let rate = value(&measured, "discharge_rate").unwrap();
    // At friction 0.1 and 0.9 the rate is 25 and 11 kg/s; a slot of 240 mm, not the laboratory's 100 mm.
    assert!((11.0..20.0).contains(&rate), "{rate}");
    for experiment in ["pile", "ledge", "bulk_density"] {
        assert_eq!(
            coarse_run(experiment, 0.5, 1, NO_CHANGE),
            coarse_run(experiment, 0.5, 1, NO_CHANGE),
            "{experiment}"
        );
        assert_ne!(
            coarse_run(experiment, 0.5, 1, NO_CHANGE),
            coarse_run(experiment, 0.5, 2, NO_CHANGE),
            "{experiment}"
        );
    }
}

#[test]
fn the_extra_observables_see_what_they_are_there_to_see() {
    // Shifts in a mean of four against sd/2 = 0.02 kg and 4 grains: +2.5 sd of one run for cohesion, −14 sd for size.
    let shelf = |bond_number| coarse_mean("pile", "pile_shelf_mass", 0.4, ("bond_number", bond_number));
    assert!(shelf(1.0) - shelf(0.0) > 0.04);
    let count = |radius| coarse_mean("bulk_density", "cylinder_count", 0.4, ("radius_mean", radius));
    let (nominal, larger) = (count(5.02e-3), count(1.1 * 5.02e-3));
    // Only the mean is raised here, not the width, so the mass of a grain rises by somewhat less than 1.1³.
    assert!((0.70..0.85).contains(&(larger / nominal)), "{nominal} {larger}");
}

/// Keys of runs, of observables and of stages hold only what `used_by` and `scope` declare, so nothing else may be read.
#[test]
fn an_experiment_reads_only_the_settings_that_enter_its_keys() {
    let settings = Settings::default();
    let (state, trace) = (heap(30.0, 28.0), [TracePoint { time: 0.0, mass: 1.0 }, TracePoint { time: 1.0, mass: 0.1 }]);
    for experiment in EXPERIMENTS {
        let (setup, measured) = (experiment.setup(&settings).unwrap(), experiment.measure(&settings, &state, &trace));
        for spec in specs() {
            let mut other = settings.clone();
            let moved = [1.01 * settings[spec.name] + 1e-6, settings[spec.name] + 1.0];
            if moved.into_iter().all(|value| other.set(spec.name, value).is_err()) {
                continue;
            }
            let keyed =
                |scope| other.for_experiment(experiment.name(), scope).iter().any(|(name, _)| *name == spec.name);
            if !keyed(Scope::Simulate) {
                let found = experiment.setup(&other);
                assert!(found.as_ref() == Ok(&setup), "{} is set up with {}", experiment.name(), spec.name);
            }
            if !keyed(Scope::Simulate) && !keyed(Scope::Measure) {
                let found = experiment.measure(&other, &state, &trace);
                assert!(found == measured, "{} is measured with {}", experiment.name(), spec.name);
            }
        }
    }
}
