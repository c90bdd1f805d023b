//! One simulation from filling to rest: checks the setup, fills, steps, runs events, samples, stops.
//!
//! Takes a [`Setup`] and a seed, gives an [`Outcome`] or a [`Failure`]. Single-threaded; the same arguments give the same
//! bits on every machine, because nothing here or below depends on thread, clock, platform libm or order of addresses.
//! [`simulate`] does it in one go; a [`Simulation`] is driven step by step by somebody who wants to look at it or to store it
//! on the way, which changes no bit.

use super::checkpoint::{Checkpoint, CheckpointError, Stored};
use super::fill::fill;
use super::material::time_step;
use super::outcome::{Energies, EventRecord, Failure, Outcome, Stop, TracePoint};
use super::setup::{Action, Event, Setup};
use super::validate::validate;
use super::world::World;

/// Steps between looks at energies and overlaps: a look costs about as much as a step.
const LOOK_INTERVAL: u64 = 64;

/// Grains moved by one step per second of processor time, roughly, on a core of today: fewer without AVX-512, more in a bed at rest.
const RATE: f64 = 2.5e7;
/// Time of a run over that of its last event, roughly: what comes after it is seldom longer than the wait before.
const AFTERMATH: f64 = 2.0;

/// What a run may take [s of one core] before any like it was timed, within a factor of four for the tests of the paper: the grains of mean
/// radius that fill the volume asked for, moved over twice the time of the last event.
pub fn expected_seconds(setup: &Setup) -> f64 {
    let radius = setup.grains.size.mean();
    let grains = setup.fill.volume / (4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius);
    let last = setup.events.iter().map(|event| event.time).fold(0.0, f64::max);
    grains * (AFTERMATH * last).min(setup.stop.time_cap) / time_step(setup) / RATE
}

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
    let mut run = Simulation::new(setup, seed)?;
    let limit = step_limit.unwrap_or(u64::MAX);
    loop {
        if let Some(stop) = run.due()? {
            return Ok(run.outcome(stop));
        }
        if run.world.steps() >= limit {
            return Err(Failure::StepLimit { limit });
        }
        run.advance()?;
    }
}

/// A simulation in progress.
#[derive(Debug, Clone)]
pub struct Simulation<'a> {
    setup: &'a Setup,
    seed: u64,
    world: World,
    /// Events in order of time; those of equal time as in the setup.
    events: Vec<&'a Event>,
    log: Log,
}

/// What has happened so far.
#[derive(Debug, Clone, Default)]
struct Log {
    inserted: usize,
    attempts: u64,
    records: Vec<EventRecord>,
    trace: Vec<TracePoint>,
    deleted: usize,
    max_overlap: f64,
    particle_steps: u64,
    /// Waiting at rest that was skipped [s].
    skipped: f64,
}

super::checkpoint::stored!(Log { inserted, attempts, records, trace, deleted, max_overlap, particle_steps, skipped });

impl<'a> Simulation<'a> {
    /// A filled setup at t = 0.
    ///
    /// # Errors
    /// [`Failure`] where the setup contradicts itself or the filling does not fit.
    pub fn new(setup: &'a Setup, seed: u64) -> Result<Self, Failure> {
        validate(setup)?;
        let filling = fill(setup, seed)?;
        let world = World::with_clumps(setup, &filling.grains, &filling.clumps)?;
        let inserted = filling.grains.len() + filling.clumps.len();
        let log = Log { inserted, attempts: filling.attempts, ..Log::default() };
        Ok(Self::at(setup, seed, world, log))
    }

    /// The run that a checkpoint was taken of; it goes on to the same bits as the run itself.
    ///
    /// # Errors
    /// [`CheckpointError::OtherRun`] for another setup or seed, [`CheckpointError::Damaged`].
    pub fn resume(setup: &'a Setup, seed: u64, checkpoint: &Checkpoint) -> Result<Self, CheckpointError> {
        let mut state = checkpoint.state(setup, seed)?;
        let world = World::restore(setup, &mut state).ok_or(CheckpointError::Damaged)?;
        let log = Log::take(&mut state).ok_or(CheckpointError::Damaged)?;
        if state.is_empty() { Ok(Self::at(setup, seed, world, log)) } else { Err(CheckpointError::Damaged) }
    }

    fn at(setup: &'a Setup, seed: u64, world: World, log: Log) -> Self {
        let mut events: Vec<&Event> = setup.events.iter().collect();
        events.sort_by(|a, b| a.time.total_cmp(&b.time));
        Self { setup, seed, world, events, log }
    }

    /// Everything that the rest of the run depends on.
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint::new(self.setup, self.seed, |bytes| {
            self.world.store(bytes);
            self.log.put(bytes);
        })
    }

    /// Time of the run [s]: that of the grains and what was skipped while they were at rest.
    pub fn time(&self) -> f64 {
        self.world.time() + self.log.skipped
    }

    /// The grains, walls and contacts as they are.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// What the run is made of.
    pub fn setup(&self) -> &Setup {
        self.setup
    }

    /// Does what is due at this time, then one time step; where the run ends instead, tells why.
    ///
    /// # Errors
    /// [`Failure`] where the run explodes or the vessel is underfilled.
    pub fn step(&mut self) -> Result<Option<Stop>, Failure> {
        let stop = self.due()?;
        if stop.is_none() {
            self.advance()?;
        }
        Ok(stop)
    }

    /// What happens between two steps: events, samples, and whether the run ends here.
    fn due(&mut self) -> Result<Option<Stop>, Failure> {
        self.run_due_events()?;
        self.sample();
        if self.world.steps().is_multiple_of(LOOK_INTERVAL)
            && let Some(stop) = self.look()?
        {
            return Ok(Some(stop));
        }
        Ok((self.time() >= self.setup.stop.time_cap).then_some(Stop::TimeCap))
    }

    fn advance(&mut self) -> Result<(), Failure> {
        self.world.step()?;
        self.log.particle_steps += self.world.len() as u64;
        Ok(())
    }

    fn run_due_events(&mut self) -> Result<(), Failure> {
        while let Some(event) = self.events.get(self.log.records.len()).filter(|event| event.time <= self.time()) {
            let (time, energies) = (self.time(), self.world.energies());
            let deleted = act(&mut self.world, &event.action)?;
            self.log.deleted += deleted;
            self.log.records.push(EventRecord { time, deleted, energies });
        }
        Ok(())
    }

    fn sample(&mut self) {
        let Some(trace) = &self.setup.trace else { return };
        let time = self.time();
        if time >= trace.interval * self.log.trace.len() as f64 {
            self.log.trace.push(TracePoint { time, mass: self.world.mass_in(&trace.region) });
        }
    }

    /// Looks at energies, overlaps and the region to be emptied.
    fn look(&mut self) -> Result<Option<Stop>, Failure> {
        self.world.check_finite()?;
        self.world.sweep()?;
        self.log.max_overlap = self.log.max_overlap.max(self.world.max_overlap());
        let rule = &self.setup.stop;
        if self.log.records.len() < self.events.len() {
            self.skip_waiting();
            return Ok(None);
        }
        if self.time() < rule.check_after {
            return Ok(None);
        }
        if self.world.is_empty() || rule.empty.is_some_and(|region| self.world.is_clear(&region)) {
            return Ok(Some(Stop::Empty));
        }
        Ok(self.is_at_rest().then_some(Stop::EnergyRatio))
    }

    fn is_at_rest(&self) -> bool {
        let rests = |ratio: f64, energies: Energies| energies.translational < ratio * energies.elastic;
        self.setup.stop.energy_ratio.is_some_and(|ratio| rests(ratio, self.world.energies()))
    }

    /// Lets the clock jump to the next event where the grains are at rest and the setup does not want them to wait. The trace
    /// goes on over the jump. Under a changed gravity or a moving wall time matters.
    fn skip_waiting(&mut self) {
        let (past, coming) = self.events.split_at(self.log.records.len());
        let is_still = |event: &&Event| matches!(event.action, Action::DeleteAbove { .. } | Action::RemoveWall { .. });
        if self.setup.stop.waits || !past.iter().all(is_still) || !self.is_at_rest() {
            return;
        }
        let Some(next) = coming.first().map(|event| event.time) else { return };
        self.log.skipped += next - self.time();
        let Some(trace) = &self.setup.trace else { return };
        let mass = self.world.mass_in(&trace.region);
        let due = (self.log.trace.len()..).map(|sample| trace.interval * sample as f64).take_while(|time| *time < next);
        self.log.trace.extend(due.map(|time| TracePoint { time, mass }));
    }

    /// The result of a run that ended for this reason.
    pub fn outcome(self, stop: Stop) -> Outcome {
        let time = self.time();
        let Self { world, log, .. } = self;
        Outcome {
            state: world.state_of_bodies(),
            trace: log.trace,
            stop,
            steps: world.steps(),
            time_step: world.time_step(),
            time,
            inserted: log.inserted,
            attempts: log.attempts,
            deleted: log.deleted,
            lost: world.lost(),
            events: log.records,
            energies: world.energies(),
            coordination_number: world.coordination_number(),
            max_overlap: log.max_overlap.max(world.max_overlap()),
            rebuilds: world.rebuilds(),
            particle_steps: log.particle_steps,
        }
    }
}

/// Does what an event says; gives the number of deleted grains. Names were checked before the run.
fn act(world: &mut World, action: &Action) -> Result<usize, Failure> {
    match action {
        Action::DeleteAbove { height, reference, level } => {
            let highest = world.highest(*reference);
            if *level && highest <= *height {
                return Err(Failure::Underfilled { step: world.steps(), time: world.time(), height: *height, highest });
            }
            world.delete_above(*height, *reference)
        }
        Action::RemoveWall { name } => world.remove_wall(name).map(|_| 0),
        Action::SetGravity { gravity } => {
            world.set_gravity(*gravity);
            Ok(0)
        }
        Action::MoveWall { name, velocity } => world.move_wall(name, *velocity).map(|_| 0),
    }
}
