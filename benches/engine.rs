//! Costs of the engine's parts: a step of a settled bed, a rebuild of the lists, the insertion, and whole coarse runs.
//!
//! `cargo bench --bench engine` runs all, `cargo bench --bench engine -- step` one of them; criterion compares with the
//! last time and says whether the difference is noise. Throughput is in grains (step, rebuild), grains inserted, or
//! particle-steps (runs). `benches/bed.rs` times the bed beside other engines.

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use granulake::config::Config;
use granulake::dem::{Setup, Simulation, simulate};
use granulake::experiments::{self, EXPERIMENTS};
use granulake::settings::Settings;
use std::path::Path;
use std::time::Duration;

/// The shipped coarse study's settings.
fn coarse() -> Settings {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline.toml");
    Config::load(&file).expect("the shipped study").base_settings().clone()
}

fn setup(name: &str, settings: &Settings) -> Setup {
    experiments::find(name).expect("an experiment").setup(settings).expect("a set-up")
}

/// A bed of the coarse density test just before it is levelled.
fn settled(setup: &Setup) -> Simulation<'_> {
    let level = setup.events[0].time;
    let mut run = Simulation::new(setup, 1).expect("a filling");
    while run.world().time() < 0.95 * level {
        run.step().expect("a step");
    }
    run
}

fn parts(criterion: &mut Criterion) {
    let settings = coarse();
    let density = setup("bulk_density", &settings);
    let bed = settled(&density);
    let mut group = criterion.benchmark_group("bed");
    group.throughput(Throughput::Elements(bed.world().len() as u64));
    let mut moving = bed.world().clone();
    group.bench_function("step", |bencher| bencher.iter(|| moving.step().expect("a step")));
    let mut world = bed.world().clone();
    // A wall that is told to stand still costs a rebuild and changes nothing.
    group.bench_function("rebuild", |bencher| bencher.iter(|| world.move_wall("floor", [0.0; 3]).expect("a rebuild")));
    group.finish();
    let mut group = criterion.benchmark_group("insertion");
    for experiment in EXPERIMENTS {
        let setup = setup(experiment.name(), &settings);
        let inserted = Simulation::new(&setup, 1).expect("a filling").world().len();
        group.throughput(Throughput::Elements(inserted as u64));
        group.bench_function(experiment.name(), |bencher| {
            bencher.iter_with_large_drop(|| Simulation::new(&setup, 1).expect("a filling"));
        });
    }
    group.finish();
}

fn runs(criterion: &mut Criterion) {
    let settings = coarse();
    let mut group = criterion.benchmark_group("run");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).measurement_time(Duration::from_secs(2));
    for experiment in EXPERIMENTS {
        let setup = setup(experiment.name(), &settings);
        group.throughput(Throughput::Elements(simulate(&setup, 1).expect("a run").particle_steps));
        group.bench_function(experiment.name(), |bencher| bencher.iter(|| simulate(&setup, 1).expect("a run")));
    }
    group.finish();
}

criterion_group!(engine, parts, runs);
criterion_main!(engine);
