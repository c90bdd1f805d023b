//! Checkpoints: a run that goes on from stored bytes ends with the bits of the run that was never stopped.

use super::*;
use granulake::dem::{Checkpoint, CheckpointError, Outcome, Simulation, Species};

/// Wet grains of two species and unlike friction that settle on a trapdoor, are levelled at 0.2 s, are knocked at 0.22 s, and flow past a
/// moving plate against the air from 0.25 s on.
fn flow_setup() -> Setup {
    let plate = Shape::Rectangle { corner: [-0.04, -0.01, 0.06], edge_u: [0.0, 0.02, 0.0], edge_v: [0.0, 0.0, 0.02] };
    let mut setup = bed_setup();
    setup.grains.rolling_spread = 0.3;
    let size = SizeDistribution::TruncatedNormal { mean: 4e-3, sd: 2e-4, below: 1.5, above: 1.5 };
    let heavy = Species { fraction: 0.3, size, density: 4000.0, sliding_friction: 0.3, rolling_friction: 0.02 };
    setup.grains.species = vec![heavy];
    setup.grains.drag = 0.3;
    setup.bridges = Some(LiquidBridges { bond_number: 0.3, volume_ratio: 0.01, contact_angle: 0.2, wall_ratio: 1.0 });
    setup.walls.push(wall("plate", plate, WallSpecies { sliding_friction: 0.5, rolling_friction: 0.1 }));
    let action = |time, action| Event { time, action };
    setup.events = vec![
        action(0.1, Action::MoveWall { name: "plate".into(), velocity: [0.1, 0.0, -0.05] }),
        action(0.2, Action::DeleteAbove { height: 0.02, reference: Reference::Top, level: true }),
        action(0.22, Action::SetGravity { gravity: [0.0, 0.0, 3.0] }),
        action(0.23, Action::SetGravity { gravity: setup.gravity }),
        action(0.25, Action::RemoveWall { name: "floor".into() }),
    ];
    setup.stop = StopRule { energy_ratio: None, waits: true, empty: None, check_after: 0.0, time_cap: 0.3 };
    setup
}

/// Everything that a run gives, with numbers as bits.
fn bits(outcome: &Outcome) -> String {
    let state = &outcome.state;
    let columns =
        [&state.radius, &state.x, &state.y, &state.z, &state.vx, &state.vy, &state.vz, &state.wx, &state.wy, &state.wz];
    let numbers: Vec<u64> = columns.into_iter().flatten().map(|x| x.to_bits()).collect();
    format!("{:?} {numbers:?}", Outcome { state: Default::default(), ..outcome.clone() })
}

fn finish(mut run: Simulation) -> Outcome {
    loop {
        if let Some(stop) = run.step().expect("a run") {
            return run.outcome(stop);
        }
    }
}

/// A checkpoint after the clock has jumped knows that it has.
#[test]
fn a_run_that_skipped_its_waiting_goes_on_to_the_same_bits() {
    let mut setup = bed_setup();
    (setup.events[0].time, setup.stop.check_after, setup.stop.waits) = (1.0, 1.0, false);
    let mut run = Simulation::new(&setup, 7).unwrap();
    while run.time() < 1.0 {
        assert!(run.step().unwrap().is_none());
    }
    assert!(run.world().time() < 0.8, "nothing was skipped until {}", run.world().time());
    let stored = run.checkpoint();
    assert_eq!(bits(&finish(run)), bits(&finish(Simulation::resume(&setup, 7, &stored).unwrap())));
}

/// While grains rain, touch, settle, right after they were levelled, right after the trapdoor opened, and in the flow.
#[test]
fn a_run_goes_on_from_any_moment_to_the_same_bits() {
    let setup = flow_setup();
    let mut run = Simulation::new(&setup, 7).unwrap();
    let step = run.world().time_step();
    let moments = [0.0, 0.03, 0.15, 0.2 + step, 0.225, 0.25 + step, 0.25 + 40.0 * step, 0.28];
    let mut stored = Vec::new();
    let end = loop {
        if stored.len() < moments.len() && run.world().time() >= moments[stored.len()] {
            stored.push(run.checkpoint());
        }
        if let Some(stop) = run.step().unwrap() {
            break run.outcome(stop);
        }
    };
    assert_eq!(stored.len(), moments.len());
    assert!(end.deleted > 0 && end.events.len() == 5 && end.coordination_number > 0.5, "{end:?}");
    assert_eq!(bits(&end), bits(&simulate(&setup, 7).unwrap()), "looking at a run changes nothing");
    for (checkpoint, moment) in stored.iter().zip(moments) {
        let bytes = Checkpoint::from_bytes(checkpoint.as_bytes().to_vec()).unwrap();
        let resumed = Simulation::resume(&setup, 7, &bytes).unwrap();
        assert_eq!(resumed.checkpoint(), *checkpoint, "stored at {moment} s");
        assert_eq!(bits(&finish(resumed)), bits(&end), "stored at {moment} s");
    }
}

#[test]
fn a_checkpoint_of_another_run_or_with_a_damaged_byte_is_refused() {
    let setup = flow_setup();
    let mut run = Simulation::new(&setup, 7).unwrap();
    (0..2000).for_each(|_| assert_eq!(run.step(), Ok(None)));
    let checkpoint = run.checkpoint();
    let refused = |setup: &Setup, seed| Simulation::resume(setup, seed, &checkpoint).err();
    assert_eq!(refused(&setup, 8), Some(CheckpointError::OtherRun));
    let mut other = flow_setup();
    other.contact.sliding_friction += 1e-15;
    assert_eq!(refused(&other, 7), Some(CheckpointError::OtherRun));
    assert_eq!(refused(&setup, 7), None);
    let bytes = checkpoint.as_bytes();
    for length in [0, 10, 100, bytes.len() / 2, bytes.len() - 1] {
        assert_eq!(Checkpoint::from_bytes(bytes[..length].to_vec()), Err(CheckpointError::Damaged), "{length} bytes");
    }
    for place in [0, 30, 200, bytes.len() / 2, bytes.len() - 1] {
        let mut bytes = bytes.to_vec();
        bytes[place] ^= 1;
        assert_eq!(Checkpoint::from_bytes(bytes), Err(CheckpointError::Damaged), "byte {place}");
    }
}
