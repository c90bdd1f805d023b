//! Golden hashes: the same bits on every machine. One for `simulate`, two for `train`.
//!
//! A change of these numbers is a change of results: raise `dem::PHYSICS_VERSION` or the version of the stage with it.

use granulake::canonical::{Digest, Encoder, digest};
use granulake::experiments::find;
use granulake::settings::Settings;
use granulake::stats::gp::kernel::Kernel;
use granulake::stats::metamodel::{Kind, Metamodel, Observations, Options, Reading};
use granulake::stats::points::Points;
use granulake::{dem, units};

const SIMULATE: &str = "f7ac894ee1403ac8f0624cba7bd40a2d276717a7f1aa2c919310bac04b86c33c";
/// With a squared exponential and with a Matérn kernel for `sk`.
const TRAIN: [&str; 2] = [
    "cb300caa10fdcdfe0ed5b4308ea395398b9daa7909d568d95b5e26f9cbaeb504",
    "d31ffc5742314783a98a7b4c88618137f0040dce175879d9ba72eea094abbdf3",
];

fn hash(numbers: impl IntoIterator<Item = f64>) -> Digest {
    let mut encoder = Encoder::new();
    for number in numbers {
        encoder.u64(number.to_bits());
    }
    digest("golden", &encoder)
}

/// The coarse ledge with cohesion and friction spread, so that every term of the contact law takes part.
#[test]
fn simulate_gives_the_golden_bits() {
    let mut settings = Settings::default();
    for (name, value) in [
        ("radius_scale", "2"),
        ("radius_cut_below", "0.5"),
        ("radius_cut_above", "1.5"),
        ("stiffness_scale", "0.01"),
        ("time_step_fraction", "0.12"),
        ("bond_number", "0.5"),
        ("friction_spread_cv", "0.3"),
        ("ledge.depth", "0.06"),
        ("ledge.deletion_time", "0.3"),
        ("ledge.release_time", "0.31"),
        ("ledge.time_cap", "0.6"),
    ] {
        let spec = granulake::settings::spec(name).expect("a setting");
        settings.set(name, units::parse(value, spec.unit).expect("a value")).expect("in bounds");
    }
    let setup = find("ledge").expect("an experiment").setup(&settings).expect("a set-up");
    let outcome = dem::simulate(&setup, 2022).expect("a run");
    let state = outcome.state;
    assert!(state.len() > 50, "{} grains", state.len());
    let columns =
        [&state.radius, &state.x, &state.y, &state.z, &state.vx, &state.vy, &state.vz, &state.wx, &state.wy, &state.wz];
    let trace = outcome.trace.iter().flat_map(|point| [point.time, point.mass]);
    let found = hash(columns.into_iter().flatten().copied().chain(trace));
    assert_eq!(found.to_string(), SIMULATE);
}

#[test]
fn train_gives_the_golden_bits() {
    let data: serde_json::Value = serde_json::from_str(include_str!("../data/gp_rbm.json")).expect("JSON");
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    let rows: Vec<Vec<f64>> = data["X"].as_array().expect("points").iter().map(numbers).collect();
    let (means, cvs) = (numbers(&data["y"]), numbers(&data["cv"]));
    let observations = Observations {
        points: Points::from_rows(&rows, 3).expect("points"),
        sds: means.iter().zip(&cvs).map(|(mean, cv)| mean * cv).collect(),
        counts: vec![10; means.len()],
        means,
    };
    let trained = |kernel: Kernel| {
        let mut all = Vec::new();
        for kind in [Kind::Ibm, Kind::Rbm, Kind::Sk] {
            let reading = Reading { kernel, ..Reading::default() };
            let options = Options { starts: 20, reading, ..Options::default() };
            let model = Metamodel::fit(kind, &observations, &options).expect("a metamodel");
            for record in model.records() {
                let numbers = [record.scale, record.variance, record.log_likelihood];
                all.extend(record.log10_a.iter().copied().chain(numbers));
            }
            let prediction = model.predict(&[0.3, 0.6, 0.4]);
            all.extend([prediction.mean.value, prediction.epistemic_sd]);
            all.extend(prediction.sd.map(|sd| sd.value));
        }
        hash(all).to_string()
    };
    assert_eq!([Kernel::SquaredExponential, Kernel::Matern52].map(trained), TRAIN);
}
