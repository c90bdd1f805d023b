//! Generic tests over the list of effects: whoever adds one is held to them without writing a line.

use granulake::dem::{Grain, Region, Setup, State, World};
use granulake::effects::{self, Declared, EFFECTS, Effect, EffectError, Library, Way};
use granulake::experiments::Experiment;
use granulake::rng::Stream;
use granulake::settings::{Scope, Settings, WALL_FRICTIONS};

const EXPERIMENTS: [&str; 4] = ["pile", "ledge", "bulk_density", "hopper"];

fn applied(name: &str, strength: f64, seed: u64) -> Settings {
    let mut settings = Settings::default();
    effects::apply(effects::find(name).unwrap(), strength, &mut settings, seed, 1).unwrap();
    settings
}

fn keys(settings: &Settings) -> Vec<(&'static str, u64)> {
    let scopes = [Scope::Simulate, Scope::Measure];
    let lists =
        EXPERIMENTS.iter().flat_map(|experiment| scopes.map(|scope| settings.for_experiment(experiment, scope)));
    lists.flatten().map(|(name, value)| (name, value.to_bits())).collect()
}

#[test]
fn names_are_unique_and_every_effect_describes_itself() {
    for (i, effect) in EFFECTS.iter().enumerate() {
        let (lower, upper) = effect.range();
        assert!(lower <= 0.0 && 0.0 < upper, "{}: 0 must be in the range", effect.name());
        assert_eq!(effect.one_sided(), lower == 0.0, "{}", effect.name());
        assert!(
            !effect.unit().is_empty() && effect.meaning().len() > 10 && effect.source().len() > 10,
            "{}",
            effect.name()
        );
        assert!(EFFECTS[..i].iter().all(|other| other.name() != effect.name()), "{}", effect.name());
    }
}

#[test]
fn strength_zero_leaves_every_bit_as_it_was() {
    let before = keys(&Settings::default());
    for effect in EFFECTS {
        for zero in [0.0, -0.0] {
            // Both the guarded way and the effect's own law.
            let mut settings = Settings::default();
            effects::apply(*effect, zero, &mut settings, 7, 1).unwrap();
            effect.apply(zero, &mut settings, &mut Stream::new(7, "any")).unwrap();
            assert_eq!(keys(&settings), before, "{}", effect.name());
        }
    }
}

#[test]
fn any_other_strength_changes_what_a_run_or_its_measurement_is() {
    let before = keys(&Settings::default());
    for effect in EFFECTS {
        let (lower, upper) = effect.range();
        for strength in [lower, 0.5 * upper, upper].into_iter().filter(|strength| *strength != 0.0) {
            assert_ne!(keys(&applied(effect.name(), strength, 7)), before, "{} {strength}", effect.name());
        }
    }
}

#[test]
fn strengths_outside_the_range_are_refused() {
    for effect in EFFECTS {
        for strength in [effect.range().0 - 0.01, effect.range().1 + 0.01, f64::NAN] {
            let mut settings = Settings::default();
            let error = effects::apply(*effect, strength, &mut settings, 1, 1).unwrap_err();
            assert!(matches!(error, EffectError::OutOfRange { .. }), "{}: {error}", effect.name());
            assert_eq!(settings, Settings::default());
        }
    }
    let error = effects::find("cohesio").err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("cohesion, wall_friction_scatter"), "{error}");
}

/// Whatever the kind of curve, a shift of 10 % makes the largest and the smallest grain 10 % larger.
#[test]
fn a_size_shift_moves_every_kind_of_size_distribution() {
    let bulk_density = granulake::experiments::find("bulk_density").unwrap();
    for kind in ["normal", "lognormal", "rosin_rammler", "sieve"] {
        let mut settings = Settings::default();
        settings.set_text("size_distribution", kind).unwrap();
        let sieves = [("sieve_size_1", 6e-3), ("sieve_size_2", 0.01), ("sieve_size_4", 0.02)];
        let shares = [("sieve_finer_1", 0.0), ("sieve_finer_2", 0.3), ("sieve_finer_4", 1.0)];
        sieves.iter().chain(&shares).for_each(|(name, value)| settings.set(name, *value).unwrap());
        let size = |settings: &Settings| bulk_density.setup(settings).unwrap().grains.size;
        let before = size(&settings);
        effects::apply(effects::find("size_distribution").unwrap(), 0.1, &mut settings, 1, 1).unwrap();
        let after = size(&settings);
        for (old, new) in
            [(before.smallest(), after.smallest()), (before.largest(), after.largest()), (before.mean(), after.mean())]
        {
            assert!((new / old - 1.1).abs() < 1e-12, "{kind}: {old} to {new}");
        }
    }
}

#[test]
fn an_effect_of_the_instrument_leaves_the_simulation_alone() {
    for (name, experiment) in [
        ("camera_roll", "ledge"),
        ("layer_thickness", "ledge"),
        ("bin_width", "pile"),
        ("scale_tare", "bulk_density"),
        ("load_cell_gain", "hopper"),
    ] {
        let upper = effects::find(name).unwrap().range().1;
        let (before, after) = (Settings::default(), applied(name, upper, 1));
        let read = |settings: &Settings, experiment, scope| settings.for_experiment(experiment, scope);
        for other in EXPERIMENTS {
            assert_eq!(read(&before, other, Scope::Simulate), read(&after, other, Scope::Simulate), "{name}");
        }
        assert_ne!(read(&before, experiment, Scope::Measure), read(&after, experiment, Scope::Measure), "{name}");
    }
}

#[test]
fn only_scatters_vary_between_repetitions() {
    for effect in EFFECTS {
        let strength = 0.5 * effect.range().1;
        assert_eq!(effect.is_scatter(), effect.name().ends_with("_scatter"), "{}", effect.name());
        let same = applied(effect.name(), strength, 1) == applied(effect.name(), strength, 2);
        assert_eq!(same, !effect.is_scatter(), "{}", effect.name());
        assert_eq!(applied(effect.name(), strength, 1), applied(effect.name(), strength, 1), "{}", effect.name());
    }
}

/// A slope per repetition about the middle of the series, which begins anew after its end.
#[test]
fn a_drift_grows_by_its_strength_and_leaves_the_mean_of_the_series() {
    for effect in EFFECTS.iter().filter(|effect| effect.is_drift()) {
        let strength = 0.5 * effect.range().1;
        let at = |repetition| {
            let mut settings = Settings::default();
            settings.set("series_length", 20.0).unwrap();
            effects::apply(*effect, strength, &mut settings, 7, repetition).unwrap();
            settings
        };
        let friction: Vec<f64> = (1..=20).map(|r| at(r)["wall_friction_acrylic"] / 0.446).collect();
        assert!(friction.windows(2).all(|pair| (pair[1] - pair[0] - strength).abs() < 1e-12), "{friction:?}");
        assert!((friction.iter().sum::<f64>() / 20.0 - 1.0).abs() < 1e-12, "{friction:?}");
        assert_eq!((at(21), at(40)), (at(1), at(20)));
    }
    assert!(EFFECTS.iter().any(|effect| effect.is_drift() && effect.name() == "wall_friction_drift"));
}

#[test]
fn wall_friction_scatter_has_the_mean_and_variation_it_states() {
    let (strength, n) = (0.2, 20_000);
    let factor = |seed| applied("wall_friction_scatter", strength, seed).get("wall_friction_acrylic").unwrap() / 0.446;
    let factors: Vec<f64> = (0..n).map(factor).collect();
    let mean = factors.iter().sum::<f64>() / n as f64;
    let sd = (factors.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>() / n as f64).sqrt();
    // Five standard errors: 0.2/√n for the mean; for the sd 0.2 √((κ − 1)/4n) with kurtosis κ = 3.7 of this lognormal.
    assert!((mean - 1.0).abs() < 0.0071, "{mean}");
    assert!((sd - strength).abs() < 0.0059, "{sd}");
}

#[test]
fn wall_effects_move_every_wall_by_one_factor() {
    for name in ["wall_friction_scatter", "wall_friction_shift"] {
        let (before, after) = (Settings::default(), applied(name, 0.3, 5));
        let ratio = |wall: &str| after[wall] / before[wall];
        assert!(WALL_FRICTIONS.iter().all(|wall| (ratio(wall) - ratio(WALL_FRICTIONS[0])).abs() < 1e-12), "{name}");
        assert!((ratio(WALL_FRICTIONS[0]) - 1.0).abs() > 1e-3, "{name}");
        // Rolling friction is a multiple of sliding friction, so it follows.
        assert_eq!(after["wall_rolling_ratio"], before["wall_rolling_ratio"]);
    }
}

#[test]
fn a_size_shift_leaves_the_analyst_ignorant() {
    let after = applied("size_distribution", 0.1, 1);
    assert!((after["radius_mean"] - 1.1 * 5.02e-3).abs() < 1e-15 && (after["radius_sd"] - 1.1 * 1.39e-3).abs() < 1e-15);
    assert_eq!(after["nominal_radius"], 5.02e-3);
    assert_eq!(after["normal_stiffness"], Settings::default()["normal_stiffness"]);
}

/// Every effect of the grains or the apparatus changes the set-up of an experiment that a study can name, and the set-up
/// with strength zero is the one without it.
#[test]
fn an_effect_of_the_simulation_changes_a_set_up() {
    for effect in EFFECTS {
        let after = applied(effect.name(), effect.range().1, 7);
        let changes = |experiment: &&&dyn Experiment| {
            experiment.setup(&after).unwrap() != experiment.setup(&Settings::default()).unwrap()
        };
        let measured = |experiment: &&&dyn Experiment| {
            after.for_experiment(experiment.name(), Scope::Measure)
                != Settings::default().for_experiment(experiment.name(), Scope::Measure)
        };
        assert!(granulake::experiments::EXPERIMENTS.iter().any(|e| changes(&e) || measured(&e)), "{}", effect.name());
    }
}

fn declared(way: Way, relative: bool, range: (f64, f64)) -> Declared {
    let setting = granulake::settings::spec("pile.drop_height").unwrap();
    Declared::new("drop", (setting, way, relative), range, "a ruler held askew")
}

#[test]
fn a_study_declares_a_shift_a_scatter_or_a_drift_of_any_setting() {
    let height = |effect: &Declared, strength, seed, repetition| {
        let mut settings = Settings::default();
        effects::apply(effect, strength, &mut settings, seed, repetition).unwrap();
        settings["pile.drop_height"]
    };
    let shift = declared(Way::Shift, false, (-0.1, 0.1));
    assert_eq!((shift.unit(), shift.one_sided()), ("m", false));
    assert!((height(&shift, 0.05, 1, 1) - 0.45).abs() < 1e-15);
    let share = declared(Way::Shift, true, (0.0, 0.5));
    assert_eq!((share.unit(), share.one_sided()), ("1", true));
    assert!((height(&share, 0.25, 1, 1) - 0.5).abs() < 1e-15);
    let drift = declared(Way::Drift, false, (-0.001, 0.001));
    assert!((height(&drift, 0.001, 1, 2) - height(&drift, 0.001, 1, 1) - 0.001).abs() < 1e-12);
    for relative in [false, true] {
        let scatter = declared(Way::Scatter, relative, (0.0, 0.1));
        let values: Vec<f64> = (0..4000).map(|seed| height(&scatter, 0.1, seed, 1)).collect();
        let mean = values.iter().sum::<f64>() / 4000.0;
        let sd = (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 4000.0).sqrt();
        let wanted = if relative { 0.04 } else { 0.1 };
        // Five standard errors of the mean, sd/√4000, and of the sd, sd/√8000.
        assert!((mean - 0.4).abs() < 5.0 * wanted / 63.2 && (sd / wanted - 1.0).abs() < 0.056, "{mean} {sd}");
    }
    // A draw beyond what the setting takes is held at its bound.
    let wild = declared(Way::Scatter, false, (0.0, 10.0));
    assert!((0..50).any(|seed| height(&wild, 10.0, seed, 1) == 0.01));
    let mut library = Library::default();
    library.add(shift);
    assert!(library.find("drop").is_ok() && library.find("tilt").is_ok());
    let error = library.find("drip").err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("cohesion_dry_walls, drop"), "{error}");
}

/// Two grains, each with friction of its own, that meet off centre in empty space keep their momentum with every effect on but
/// drag, whose partner is the air.
#[test]
fn pair_forces_cancel_with_every_effect() {
    for effect in EFFECTS.iter().filter(|effect| effect.name() != "air_drag") {
        let settings = applied(effect.name(), effect.range().1, 7);
        let setup = granulake::experiments::find("bulk_density").unwrap().setup(&settings).unwrap();
        let domain = Region { lower: [-1.0; 3], upper: [1.0; 3] };
        let setup = Setup { walls: Vec::new(), events: Vec::new(), gravity: [0.0; 3], domain, ..setup };
        let grain = |radius, position, velocity| Grain { velocity, ..Grain::new(radius, position) };
        let mut pair = [grain(5e-3, [0.0; 3], [0.3, 0.0, 0.1]), grain(6e-3, [0.0109, 0.002, 0.001], [-0.2, 0.1, 0.0])];
        (pair[0].sliding_factor, pair[1].rolling_factor) = (0.6, 1.4);
        let mut world = World::new(&setup, &pair).unwrap();
        let before = momentum(&world.state());
        (0..2000).for_each(|_| world.step().unwrap());
        let after = world.state();
        assert!(after.wx.iter().chain(&after.wy).any(|w| w.abs() > 1e-3), "{}: they met", effect.name());
        for (a, b) in before.into_iter().zip(momentum(&after)) {
            // Terms are about 4e-8; 2000 steps that each round a velocity by 1e-16 of it add up to far below 1e-11 of that.
            assert!((a - b).abs() < 4e-19, "{}: {a:e} and {b:e}", effect.name());
        }
    }
}

/// Momentum over the density, Σ r³ v, up to 4π/3 [m⁴/s].
fn momentum(state: &State) -> [f64; 3] {
    let sum = |v: &[f64]| v.iter().zip(&state.radius).map(|(v, r)| r * r * r * v).sum();
    [sum(&state.vx), sum(&state.vy), sum(&state.vz)]
}
