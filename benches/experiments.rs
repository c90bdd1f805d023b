//! What a run of every experiment costs with the shipped coarse set-up, and the rate of the engine.
//!
//! `cargo bench` prints one line per experiment: seconds per run and particle-steps per second of one core. Timings of a
//! shared machine are noisy; compare figures of one invocation.

use granulake::config::Config;
use granulake::dem;
use granulake::experiments::EXPERIMENTS;
use std::path::Path;
use std::time::Instant;

const RUNS: u64 = 5;

fn main() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("pipeline.toml");
    let config = Config::load(&file).expect("the shipped study");
    println!("{:<14} {:>10} {:>22}", "experiment", "s per run", "particle-steps per s");
    for experiment in EXPERIMENTS {
        let setup = experiment.setup(config.base_settings()).expect("a set-up");
        let clock = Instant::now();
        let steps: u64 = (0..RUNS).map(|seed| dem::simulate(&setup, seed).expect("a run").particle_steps).sum();
        let seconds = clock.elapsed().as_secs_f64();
        println!("{:<14} {:>10.3} {:>22.3e}", experiment.name(), seconds / RUNS as f64, steps as f64 / seconds);
    }
}
