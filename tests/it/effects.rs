//! Generic tests over the list of effects: whoever adds one is held to them without writing a line.

use granulake::effects::{self, EFFECTS, EffectError};
use granulake::rng::Stream;
use granulake::settings::{Scope, Settings, WALL_FRICTIONS};

const EXPERIMENTS: [&str; 4] = ["pile", "ledge", "bulk_density", "hopper"];

fn applied(name: &str, strength: f64, seed: u64) -> Settings {
    let mut settings = Settings::default();
    effects::apply(effects::find(name).unwrap(), strength, &mut settings, seed).unwrap();
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
            effects::apply(*effect, zero, &mut settings, 7).unwrap();
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
            let error = effects::apply(*effect, strength, &mut settings, 1).unwrap_err();
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
        effects::apply(effects::find("size_distribution").unwrap(), 0.1, &mut settings, 1).unwrap();
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
    let (before, after) = (Settings::default(), applied("camera_roll", 2.0, 1));
    for experiment in EXPERIMENTS {
        assert_eq!(
            before.for_experiment(experiment, Scope::Simulate),
            after.for_experiment(experiment, Scope::Simulate)
        );
    }
    assert_ne!(before.for_experiment("ledge", Scope::Measure), after.for_experiment("ledge", Scope::Measure));
}

#[test]
fn only_the_scatter_varies_between_repetitions() {
    for effect in EFFECTS {
        let strength = 0.5 * effect.range().1;
        let same = applied(effect.name(), strength, 1) == applied(effect.name(), strength, 2);
        assert_eq!(same, effect.name() != "wall_friction_scatter", "{}", effect.name());
        assert_eq!(applied(effect.name(), strength, 1), applied(effect.name(), strength, 1), "{}", effect.name());
    }
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
