//! One simulation from filling to rest: checks the setup, fills, steps, runs events, samples, stops.
//!
//! Takes a [`Setup`] and a seed, gives an [`Outcome`] or a [`Failure`]. Single-threaded; the same arguments give the same
//! bits on every machine, because nothing here or below depends on thread, clock, platform libm or order of addresses.

use super::fill::fill;
use super::outcome::{Energies, EventRecord, Failure, Outcome, Stop, TracePoint};
use super::setup::{Action, Event, Setup};
use super::validate::validate;
use super::world::World;

/// Steps between looks at energies and overlaps: a look costs about as much as a step.
const LOOK_INTERVAL: u64 = 64;

/// Runs a setup.
///
/// # Errors
/// [`Failure`] where the setup contradicts itself, the filling does not fit or the run explodes.
pub fn simulate(setup: &Setup, seed: u64) -> Result<Outcome, Failure> {
    simulate_within(setup, seed, None)
}

/// Runs a setup, but gives up on a run that needs more than `step_limit` steps. A run that needs no more is the same
/// with any limit.
///
/// # Errors
/// As [`simulate`], and [`Failure::StepLimit`].
pub fn simulate_within(setup: &Setup, seed: u64, step_limit: Option<u64>) -> Result<Outcome, Failure> {
    validate(setup)?;
    let filling = fill(setup, seed)?;
    let mut run = Run::new(setup, World::new(setup, &filling.grains)?);
    let stop = run.finish(step_limit.unwrap_or(u64::MAX))?;
    Ok(run.outcome(stop, filling.grains.len(), filling.attempts))
}

/// A simulation in progress.
struct Run<'a> {
    setup: &'a Setup,
    world: World,
    /// Events in order of time; those of equal time as in the setup.
    events: Vec<&'a Event>,
    records: Vec<EventRecord>,
    trace: Vec<TracePoint>,
    deleted: usize,
    max_overlap: f64,
    particle_steps: u64,
}

impl<'a> Run<'a> {
    fn new(setup: &'a Setup, world: World) -> Self {
        let mut events: Vec<&Event> = setup.events.iter().collect();
        events.sort_by(|a, b| a.time.total_cmp(&b.time));
        Self {
            setup,
            world,
            events,
            records: Vec::new(),
            trace: Vec::new(),
            deleted: 0,
            max_overlap: 0.0,
            particle_steps: 0,
        }
    }

    fn finish(&mut self, step_limit: u64) -> Result<Stop, Failure> {
        loop {
            self.run_due_events()?;
            self.sample();
            if self.world.steps().is_multiple_of(LOOK_INTERVAL)
                && let Some(stop) = self.look()?
            {
                return Ok(stop);
            }
            if self.world.time() >= self.setup.stop.time_cap {
                return Ok(Stop::TimeCap);
            }
            if self.world.steps() >= step_limit {
                return Err(Failure::StepLimit { limit: step_limit });
            }
            self.world.step()?;
            self.particle_steps += self.world.len() as u64;
        }
    }

    fn run_due_events(&mut self) -> Result<(), Failure> {
        while let Some(event) = self.events.get(self.records.len()).filter(|event| event.time <= self.world.time()) {
            let (time, energies) = (self.world.time(), self.world.energies());
            let deleted = act(&mut self.world, &event.action)?;
            self.deleted += deleted;
            self.records.push(EventRecord { time, deleted, energies });
        }
        Ok(())
    }

    fn sample(&mut self) {
        let Some(trace) = &self.setup.trace else { return };
        let time = self.world.time();
        if time >= trace.interval * self.trace.len() as f64 {
            self.trace.push(TracePoint { time, mass: self.world.mass_in(&trace.region) });
        }
    }

    /// Looks at energies, overlaps and the region to be emptied.
    fn look(&mut self) -> Result<Option<Stop>, Failure> {
        self.world.check_finite()?;
        self.world.sweep()?;
        self.max_overlap = self.max_overlap.max(self.world.max_overlap());
        let rule = &self.setup.stop;
        if self.world.time() < rule.check_after || self.records.len() < self.events.len() {
            return Ok(None);
        }
        if self.world.is_empty() || rule.empty.is_some_and(|region| self.world.is_clear(&region)) {
            return Ok(Some(Stop::Empty));
        }
        let rests = |ratio: f64, energies: Energies| energies.translational < ratio * energies.elastic;
        let at_rest = rule.energy_ratio.is_some_and(|ratio| rests(ratio, self.world.energies()));
        Ok(at_rest.then_some(Stop::EnergyRatio))
    }

    fn outcome(self, stop: Stop, inserted: usize, attempts: u64) -> Outcome {
        let world = &self.world;
        Outcome {
            state: world.state(),
            trace: self.trace,
            stop,
            steps: world.steps(),
            time_step: world.time_step(),
            time: world.time(),
            inserted,
            attempts,
            deleted: self.deleted,
            lost: world.lost(),
            events: self.records,
            energies: world.energies(),
            coordination_number: world.coordination_number(),
            max_overlap: self.max_overlap.max(world.max_overlap()),
            rebuilds: world.rebuilds(),
            particle_steps: self.particle_steps,
        }
    }
}

/// Does what an event says; gives the number of deleted grains. Names were checked before the run.
fn act(world: &mut World, action: &Action) -> Result<usize, Failure> {
    match action {
        Action::DeleteAbove { height, reference } => world.delete_above(*height, *reference),
        Action::RemoveWall { name } => world.remove_wall(name).map(|_| 0),
        Action::SetGravity { gravity } => {
            world.set_gravity(*gravity);
            Ok(0)
        }
        Action::MoveWall { name, velocity } => world.move_wall(name, *velocity).map(|_| 0),
    }
}
