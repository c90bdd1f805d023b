//! A running world: state, lists, work space, and one step of it.
//!
//! Takes a [`Setup`] and grains, gives states. A step is velocity Verlet in its leapfrog form: the velocities kept are those of
//! the half step before the positions, which merges the two half kicks of neighbouring steps; forces that depend on velocity see
//! the half-step velocity, as in MercuryDPM. Nothing is allocated in a step once the lists have seen their largest size.
//! Knows nothing of filling, events or stop rules: see [`super::run`].

mod rebuild;

use super::bridges::{self, Bridges, PairBridges};
use super::checkpoint::Stored;
use super::clumps::{Clump, ClumpMotion, Clumps};
use super::drag;
use super::forces::{AcrossForces, MAX_OVERLAP, PairForces, WallForces};
use super::integrate::Integration;
use super::lists::{Pairs, Rivals, WallList};
use super::material::{Law, time_step};
use super::observe::Other;
use super::outcome::{Failure, State};
use super::particles::{Grain, Particles};
use super::period::Periods;
use super::setup::{Reference, Region, Setup, Vec3};
use super::skin::Skin;
use super::validate;
use super::vector::{Row4, dot, xyz};
use super::walls::WallPiece;
use pulp::Arch;
use rebuild::Spare;

/// Vectors that contacts and grains are computed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vectors {
    /// The widest of the machine.
    Widest,
    /// Four numbers (AVX2).
    Avx2,
    /// One number at a time.
    Scalar,
}

impl Vectors {
    pub(super) fn arch(self) -> Arch {
        match self {
            Self::Widest => Arch::new(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 => Arch::Scalar,
            Self::Scalar => Arch::Scalar,
        }
    }
}

/// Grains, walls and contacts at one time.
#[derive(Debug, Clone)]
pub struct World {
    pub(super) grains: Particles,
    pub(super) clumps: Clumps,
    pub(super) pairs: Pairs,
    pub(super) contacts: WallList,
    pub(super) rivals: Rivals,
    pub(super) walls: Vec<WallPiece>,
    /// Whether any wall moves.
    moving: bool,
    pub(super) law: Law,
    pub(super) bridges: Option<Bridges>,
    pub(super) gravity: Vec3,
    density: f64,
    drag: f64,
    domain: Region,
    pub(super) periods: Periods,
    time_step: f64,
    steps: u64,
    lost: usize,
    rebuilds: u64,
    skin: Skin,
    spare: Spare,
    inherit: Vec<[u32; 2]>,
    met: Vec<u32>,
    arch: Arch,
}

impl World {
    /// A world with the setup's law, walls, gravity, bridges, domain and time step, and these grains at t = 0.
    ///
    /// # Errors
    /// [`Failure`] where grains overlap too far or are not finite to begin with.
    pub fn new(setup: &Setup, grains: &[Grain]) -> Result<Self, Failure> {
        Self::with_clumps(setup, grains, &[])
    }

    /// The same with rigid clumps, whose spheres are numbered after the grains.
    ///
    /// # Errors
    /// As [`World::new`], and [`Failure::InvalidSetup`] for a clump without size or beyond an aspect of 2.5, or in a period.
    pub fn with_clumps(setup: &Setup, grains: &[Grain], clumps: &[Clump]) -> Result<Self, Failure> {
        validate::clumps(setup, clumps)?;
        let mut world = Self::empty(setup);
        grains.iter().for_each(|grain| world.grains.push(grain, world.density));
        clumps.iter().for_each(|clump| world.clumps.push(clump, &mut world.grains, world.density));
        world.rebuild()?;
        world.evaluate()?;
        world.shift_velocities(-0.5);
        Ok(world)
    }

    /// Without grains, and without lists of them.
    fn empty(setup: &Setup) -> Self {
        let (time_step, periods) = (time_step(setup), Periods::new(setup.periodic));
        let shifts = periods.shifts().len();
        Self {
            grains: Particles::default(),
            clumps: Clumps::default(),
            pairs: Pairs::new(shifts),
            contacts: WallList::default(),
            rivals: Rivals::default(),
            walls: setup.walls.iter().map(WallPiece::new).collect(),
            moving: false,
            law: Law::new(setup, time_step),
            bridges: Bridges::new(setup),
            gravity: setup.gravity,
            density: setup.grains.density,
            drag: setup.grains.drag,
            domain: setup.domain,
            time_step,
            steps: 0,
            lost: 0,
            rebuilds: 0,
            skin: Skin::new(setup.grains.size.mean(), time_step),
            spare: Spare::new(shifts),
            periods,
            inherit: Vec::new(),
            met: Vec::new(),
            arch: Arch::new(),
        }
    }

    /// The same world with vectors of another width than the widest of this machine: the same bits, at another speed. A width
    /// that the machine lacks becomes scalar.
    #[must_use]
    pub fn with_vectors(self, vectors: Vectors) -> Self {
        Self { arch: vectors.arch(), ..self }
    }

    /// Appends everything that does not follow from the setup; the lists too, since their order is that of the sums.
    pub(super) fn store(&self, out: &mut Vec<u8>) {
        self.steps.put(out);
        self.lost.put(out);
        self.rebuilds.put(out);
        self.gravity.put(out);
        self.grains.put(out);
        self.clumps.put(out);
        self.pairs.put(out);
        self.contacts.put(out);
        self.walls.iter().for_each(|wall| wall.store(out));
        self.skin.store(out);
    }

    /// The world that [`World::store`] appended; `None` where the bytes are not those of a world of this setup.
    pub(super) fn restore(setup: &Setup, input: &mut &[u8]) -> Option<Self> {
        let mut world = Self::empty(setup);
        world.steps = Stored::take(input)?;
        world.lost = Stored::take(input)?;
        world.rebuilds = Stored::take(input)?;
        world.gravity = Stored::take(input)?;
        world.grains = Stored::take(input)?;
        world.clumps = Stored::take(input)?;
        world.pairs = Stored::take(input)?;
        world.contacts = Stored::take(input)?;
        for wall in &mut world.walls {
            wall.restore(input)?;
        }
        world.moving = world.walls.iter().any(WallPiece::moves);
        world.skin.restore(world.len(), input)?;
        let (grains, walls) = (world.len(), world.walls.len());
        let shifts = world.pairs.across.len() == world.periods.shifts().len();
        let lists = shifts && world.pairs.is_consistent(grains) && world.contacts.is_consistent(grains, walls);
        if !world.grains.is_consistent() || !world.clumps.is_consistent(grains) || !lists {
            return None;
        }
        world.rivals.index(&world.contacts, grains);
        Some(world)
    }

    /// One time step.
    ///
    /// # Errors
    /// [`Failure`] where the run explodes.
    pub fn step(&mut self) -> Result<(), Failure> {
        self.skin.age();
        let outrun = self.integrate();
        if self.moving {
            self.walls.iter_mut().for_each(|wall| wall.advance(self.time_step));
        }
        self.steps += 1;
        if outrun || self.skin.expired() {
            self.rebuild()?;
        }
        self.evaluate()
    }

    /// Steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Time step [s].
    pub fn time_step(&self) -> f64 {
        self.time_step
    }

    /// Time [s].
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.time_step
    }

    /// Number of grains, every sphere of a clump being one.
    pub fn len(&self) -> usize {
        self.grains.len()
    }

    /// Whether there is no grain.
    pub fn is_empty(&self) -> bool {
        self.grains.len() == 0
    }

    /// Grains that left the domain so far; looked at when lists are rebuilt, and in a run with every look at its energies.
    pub fn lost(&self) -> usize {
        self.lost
    }

    /// Lists built so far.
    pub fn rebuilds(&self) -> u64 {
        self.rebuilds
    }

    /// Pairs of grains on the list, touching or not.
    pub fn listed_pairs(&self) -> usize {
        self.pairs.len()
    }

    /// Grains in order of insertion, spheres of clumps among them, with velocities at the time of the positions.
    pub fn state(&self) -> State {
        self.state_of(|i| Some(self.grains.place[i]))
    }

    /// Masses of the grains [kg], in the order of [`World::state`]: over the volumes they tell species apart.
    pub fn masses(&self) -> Vec<f64> {
        let mut masses: Vec<(u32, f64)> = (0..self.len()).map(|i| (self.grains.id[i], self.grains.mass(i))).collect();
        masses.sort_unstable_by_key(|(id, _)| *id);
        masses.into_iter().map(|(_, mass)| mass).collect()
    }

    /// The same state, but a clump is one grain: the sphere of its volume at its centre.
    pub fn state_of_bodies(&self) -> State {
        self.state_of(|i| match self.clumps.of_grain(i) {
            None => Some(self.grains.place[i]),
            Some(body) => body.begins_with(i).then(|| body.as_sphere(self.density)),
        })
    }

    fn state_of(&self, place: impl Fn(usize) -> Option<Row4>) -> State {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_unstable_by_key(|&i| self.grains.id[i]);
        let mut state = State::default();
        for i in order {
            if let Some(place) = place(i) {
                self.append(i, &place, &mut state);
            }
        }
        state
    }

    fn append(&self, i: usize, place: &Row4, state: &mut State) {
        let ([x, y, z], radius) = (self.periods.wrapped(xyz(place)), place[3]);
        let ([vx, vy, vz], [wx, wy, wz]) = self.velocities_at(i, xyz(place));
        state.id.push(self.grains.id[i]);
        state.radius.push(radius);
        let columns = [&mut state.x, &mut state.y, &mut state.z, &mut state.vx, &mut state.vy, &mut state.vz];
        columns.into_iter().zip([x, y, z, vx, vy, vz]).for_each(|(column, value)| column.push(value));
        let columns = [&mut state.wx, &mut state.wy, &mut state.wz];
        columns.into_iter().zip([wx, wy, wz]).for_each(|(column, value)| column.push(value));
    }

    /// Velocity and angular velocity at the time of the positions: half a kick after those kept.
    pub(super) fn velocities(&self, i: usize) -> (Vec3, Vec3) {
        self.velocities_at(i, xyz(&self.grains.place[i]))
    }

    /// The same at another place of the body that grain `i` belongs to.
    fn velocities_at(&self, i: usize, place: Vec3) -> (Vec3, Vec3) {
        if let Some(body) = self.clumps.of_grain(i) {
            return body.velocities(place, &self.grains.load, self.time_step, self.gravity);
        }
        let (motion, spin, load) = (&self.grains.motion[i], &self.grains.spin[i], &self.grains.load[i]);
        let half = 0.5 * self.time_step;
        let kick = |c: usize| motion[c] + half * (load[c] * motion[3] + self.gravity[c]);
        let turn = |c: usize| spin[c] + half * (load[c + 4] * self.grains.inverse_inertia[i]);
        ([kick(0), kick(1), kick(2)], [turn(0), turn(1), turn(2)])
    }

    /// The clumps as they are, in the order they were given, less those that are gone.
    pub fn clumps(&self) -> Vec<ClumpMotion> {
        let motion = |body: &super::clumps::Body| body.motion(&self.grains.load, self.time_step, self.gravity);
        self.clumps.bodies().iter().map(motion).collect()
    }

    /// Moves the kept velocities by a fraction of a step's kick.
    fn shift_velocities(&mut self, fraction: f64) {
        let step = fraction * self.time_step;
        self.clumps.gather(&self.grains.load);
        let Particles { motion, spin, inverse_inertia, load, .. } = &mut self.grains;
        for (((motion, spin), inverse_inertia), load) in
            motion.iter_mut().zip(spin.iter_mut()).zip(inverse_inertia).zip(load)
        {
            for c in 0..3 {
                motion[c] += step * (load[c] * motion[3] + self.gravity[c]);
                spin[c] += step * (load[c + 4] * *inverse_inertia);
            }
        }
        self.clumps.shift_velocities(step, self.gravity, &mut self.grains);
    }

    fn integrate(&mut self) -> bool {
        let Self { grains, clumps, skin, gravity, time_step, .. } = self;
        // The spheres of clumps are moved as if they were free, then put where their clump takes them.
        clumps.gather(&grains.load);
        let (bases, drift) = (skin.bases(), skin.offset());
        let (gravity, time_step) = (*gravity, *time_step);
        let outrun = self.arch.dispatch(Integration { grains, bases, drift, gravity, time_step });
        clumps.step(time_step, gravity, grains, bases, drift) | outrun
    }

    fn evaluate(&mut self) -> Result<(), Failure> {
        let Self { grains, pairs, contacts, rivals, walls, law, inherit, met, arch, .. } = self;
        let Law { pair, wall, friction, .. } = law;
        let mut deep = arch.dispatch(PairForces { grains, pairs, law: pair, friction, met });
        for (list, shift) in pairs.across.iter_mut().zip(self.periods.shifts()) {
            deep |= arch.dispatch(AcrossForces { grains, list, law: pair, friction, shift: *shift });
        }
        deep |= arch.dispatch(WallForces { grains, contacts, rivals, walls, law: wall, inherit });
        if let Some(law) = &self.bridges {
            let Pairs { touching, apart, across } = &mut self.pairs;
            let shifts = [[0.0; 3]; 2].iter().chain(self.periods.shifts());
            for (list, shift) in [touching, apart].into_iter().chain(across).zip(shifts) {
                self.arch.dispatch(PairBridges { grains: &mut self.grains, list, shift: *shift, law });
            }
            bridges::add_walls(&mut self.grains, &mut self.contacts, &self.rivals, &self.walls, law);
        }
        if self.drag > 0.0 {
            drag::add(&mut self.grains, self.drag);
        }
        if deep { self.check_overlaps() } else { Ok(()) }
    }

    /// Removes the grains above a height, and clumps with one of them, and gives their number.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn delete_above(&mut self, height: f64, reference: Reference) -> Result<usize, Failure> {
        let before = self.count(&vec![true; self.len()]);
        self.spare.keep.clear();
        self.spare.keep.extend(self.grains.place.iter().map(|place| reference.height(place) <= height));
        self.clumps.keep_whole(&mut self.spare.keep);
        let kept = self.count(&self.spare.keep);
        self.rebuild_kept()?;
        Ok(before - kept)
    }

    /// Number of the grains kept, a clump being one.
    fn count(&self, keep: &[bool]) -> usize {
        keep.iter().filter(|keep| **keep).count() - self.clumps.surplus(keep)
    }

    /// Height of the highest grain [m]; -∞ without grains.
    pub(super) fn highest(&self, reference: Reference) -> f64 {
        self.grains.place.iter().map(|place| reference.height(place)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Removes a wall, or a mesh as a whole; tells whether there was one of that name.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn remove_wall(&mut self, name: &str) -> Result<bool, Failure> {
        self.change_walls(name, |wall| wall.active = false)
    }

    /// Changes gravity from the next step on; lists stay good, because no grain may outrun its skin unnoticed.
    pub fn set_gravity(&mut self, gravity: Vec3) {
        self.gravity = gravity;
    }

    /// Lets a wall move, or a mesh as a whole; tells whether there is one of that name.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn move_wall(&mut self, name: &str, velocity: Vec3) -> Result<bool, Failure> {
        self.change_walls(name, |wall| wall.velocity = velocity)
    }

    /// Changes the walls of a name that are still there, and builds the lists anew if there are any.
    fn change_walls(&mut self, name: &str, change: impl Fn(&mut WallPiece)) -> Result<bool, Failure> {
        let mut found = false;
        for wall in self.walls.iter_mut().filter(|wall| wall.name == name && wall.active) {
            change(wall);
            found = true;
        }
        self.moving = self.walls.iter().any(WallPiece::moves);
        if found { self.rebuild().map(|()| true) } else { Ok(false) }
    }

    /// Removes the grains outside the domain, which between rebuilds nobody notices.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub(super) fn sweep(&mut self) -> Result<(), Failure> {
        let left = self.grains.place.iter().any(|place| !self.domain.contains(xyz(place)));
        if left { self.rebuild() } else { Ok(()) }
    }

    /// Refuses grains whose place or kinetic energy is not a finite number.
    pub(super) fn check_finite(&self) -> Result<(), Failure> {
        let finite = |i: &usize| {
            let (v, w) = self.velocities(*i);
            (self.grains.place[*i].iter().sum::<f64>() + dot(v, v) + dot(w, w)).is_finite()
        };
        match (0..self.len()).find(|i| !finite(i)) {
            None => Ok(()),
            Some(i) => Err(Failure::NotFinite { step: self.steps, time: self.time(), grain: self.grains.id[i] }),
        }
    }

    /// Refuses overlaps beyond [`MAX_OVERLAP`] of the smaller radius, and names the deepest.
    fn check_overlaps(&self) -> Result<(), Failure> {
        let mut deepest = None;
        self.for_each_overlap(|i, other, depth| {
            if depth > deepest.map_or(MAX_OVERLAP, |(_, _, depth)| depth) {
                deepest = Some((i, other, depth));
            }
        });
        let Some((i, other, overlap)) = deepest else { return Ok(()) };
        let with = match other {
            Other::Grain(j) => format!("grain {}", self.grains.id[j]),
            Other::Wall(w) => format!("wall {}", self.walls[w].name),
        };
        let (grain, position) = (self.grains.id[i], xyz(&self.grains.place[i]));
        Err(Failure::Overlap { step: self.steps, time: self.time(), grain, position, overlap, with })
    }
}

#[cfg(test)]
mod tests {
    use super::super::fill::fill;
    use super::super::setup::*;
    use super::*;

    /// A few dozen grains that fall into a box of rectangles, with bridges, so that every kernel has work.
    fn setup() -> Setup {
        let species = WallSpecies { sliding_friction: 0.4, rolling_friction: 0.3 };
        let plate = |name: &str, corner: Vec3, edge_u: Vec3, edge_v: Vec3| Wall {
            name: name.to_owned(),
            shape: Shape::Rectangle { corner, edge_u, edge_v },
            species,
        };
        let facet = |corners| Wall { name: "mesh".to_owned(), shape: Shape::Triangle { corners }, species };
        let walls = vec![
            plate("left half", [-0.03, -0.03, 0.0], [0.03, 0.0, 0.0], [0.0, 0.06, 0.0]),
            plate("right half", [0.0, -0.03, 0.0], [0.03, 0.0, 0.0], [0.0, 0.06, 0.0]),
            Wall { name: "side".to_owned(), shape: Shape::Cylinder { axis: [0.0; 2], radius: 0.03 }, species },
            Wall {
                name: "slope".to_owned(),
                shape: Shape::Plane { point: [0.0; 3], normal: [0.1, 0.0, 1.0] },
                species,
            },
            Wall {
                name: "funnel".to_owned(),
                shape: Shape::Cone { axis: [0.0; 2], lower: [0.0, 0.02], upper: [0.02, 0.03] },
                species,
            },
            facet([[-0.03, -0.03, 0.004], [0.03, -0.03, 0.0], [0.0, 0.03, 0.0]]),
            facet([[0.0, 0.03, 0.0], [0.03, -0.03, 0.0], [0.03, 0.03, 0.01]]),
        ];
        Setup {
            grains: Grains::default(),
            contact: ContactLaw { stiffness: 3.7e4, ..ContactLaw::default() },
            bridges: Some(LiquidBridges { bond_number: 0.3, volume_ratio: 0.01, contact_angle: 0.2, wall_ratio: 1.0 }),
            gravity: [0.0, 0.0, -9.81],
            time_step_fraction: 0.1,
            walls,
            fill: Fill {
                area: FillArea::Disc { axis: [0.0; 2], radius: 0.03 },
                base: 0.0,
                rise: Rise::PerAttempt(1e-3),
                volume: 3e-5,
            },
            events: Vec::new(),
            stop: StopRule { energy_ratio: None, waits: true, empty: None, check_after: 0.0, time_cap: 1.0 },
            domain: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 1.0] },
            periodic: [None; 3],
            trace: None,
        }
    }

    const WIDTHS: [Vectors; 3] = [Vectors::Scalar, Vectors::Avx2, Vectors::Widest];

    /// State after 3000 steps.
    fn run(vectors: Vectors) -> State {
        let setup = setup();
        let grains = fill(&setup, 1).unwrap().grains;
        let mut world = World::new(&setup, &grains).unwrap().with_vectors(vectors);
        (0..3000).for_each(|_| world.step().unwrap());
        assert!(world.coordination_number() > 1.0, "the grains have met");
        world.state()
    }

    #[test]
    fn every_vector_width_gives_the_same_bits() {
        let scalar = run(Vectors::Scalar);
        for vectors in [Vectors::Avx2, Vectors::Widest] {
            assert_eq!(scalar, run(vectors), "{vectors:?}");
        }
    }

    /// Whether a pair stands among those that touched at the last rebuild or among the others changes no bit.
    #[test]
    fn a_pair_is_the_same_in_either_list() {
        let setup = setup();
        let grains = fill(&setup, 1).unwrap().grains;
        let end = |vectors, touching| {
            let mut world = World::new(&setup, &grains).unwrap().with_vectors(vectors);
            (0..2000).for_each(|_| world.step().unwrap());
            let old = std::mem::replace(&mut world.pairs, Pairs::new(0));
            let mut all: Vec<[u32; 2]> = old.lists().flat_map(|list| list.pairs().to_vec()).collect();
            all.sort_unstable();
            assert!(old.touching.len() > 20 && old.apart.len() > 20, "{} pairs", all.len());
            for ends in all {
                world.pairs.push(touching, ends, &old, ends, None, || unreachable!("the pair is in the old lists"));
            }
            (0..100).for_each(|_| world.step().unwrap());
            world.state()
        };
        for vectors in WIDTHS {
            assert_eq!(end(vectors, true), end(vectors, false), "{vectors:?}");
        }
    }

    /// Friction of its own that comes to the law's, by factors of a half, changes no bit.
    #[test]
    fn friction_is_the_same_from_the_law_or_from_the_pair() {
        let end = |vectors, factor: f64| {
            let mut setup = setup();
            setup.contact.sliding_friction /= factor;
            setup.contact.rolling_friction /= factor;
            let mut grains = fill(&setup, 1).unwrap().grains;
            for grain in &mut grains {
                (grain.sliding_factor, grain.rolling_factor) = (factor, factor);
            }
            let mut world = World::new(&setup, &grains).unwrap().with_vectors(vectors);
            (0..2000).for_each(|_| world.step().unwrap());
            let own = world.pairs.lists().map(|list| list.frictions.len()).sum::<usize>();
            assert_eq!(own > 0, factor < 1.0);
            world.state()
        };
        let law = end(Vectors::Widest, 1.0);
        for vectors in WIDTHS {
            assert_eq!(law, end(vectors, 0.5), "{vectors:?}");
        }
    }

    /// Overlaps of equal and of very different grains on either side of the limit, the smaller one first, which is grain 0.
    #[test]
    fn an_overlap_is_too_deep_by_the_smaller_of_its_two_grains() {
        let setup = setup();
        let start = |radii: [f64; 2], depth: f64| {
            let between = radii[0] + radii[1] - depth * radii[0];
            let grains = [Grain::new(radii[0], [0.0, 0.0, 0.1]), Grain::new(radii[1], [between, 0.0, 0.1])];
            World::new(&setup, &grains).map(|_| ())
        };
        for radii in [[0.005, 0.005], [0.001, 0.005], [1e-4, 0.01]] {
            for depth in [0.2, 0.3, 0.499] {
                assert_eq!(start(radii, depth), Ok(()), "{depth} of {radii:?}");
            }
            for depth in [0.501, 0.6, 0.9] {
                let refused = start(radii, depth).unwrap_err();
                let Failure::Overlap { overlap, with, grain: 0, .. } = refused else { panic!("{refused}") };
                assert!((overlap - depth).abs() < 1e-9 && with == "grain 1", "{overlap} with {with}");
            }
        }
    }

    #[test]
    fn every_vector_width_gives_the_same_bits_across_the_ends_of_a_period() {
        let mut setup = Setup { periodic: [Some([-0.05, 0.05]), Some([-0.05, 0.05]), None], ..setup() };
        setup.walls.retain(|wall| wall.name == "slope");
        setup.walls[0].shape = Shape::Plane { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
        setup.fill.area = FillArea::Rectangle { x: [-0.05, 0.05], y: [-0.05, 0.05] };
        setup.fill.base = 0.01;
        setup.fill.volume = 1e-4;
        let grains = fill(&setup, 1).unwrap().grains;
        let end = |vectors| {
            let mut world = World::new(&setup, &grains).unwrap().with_vectors(vectors);
            let mut most = [0; 4];
            for _ in 0..4000 {
                world.step().unwrap();
                most.iter_mut().zip(&world.pairs.across).for_each(|(most, list)| *most = list.len().max(*most));
            }
            assert!(most[..2].iter().all(|count| *count > 10) && most[2] + most[3] > 0, "{most:?} pairs across");
            world.state()
        };
        let scalar = end(Vectors::Scalar);
        for vectors in [Vectors::Avx2, Vectors::Widest] {
            assert_eq!(scalar, end(vectors), "{vectors:?}");
        }
    }

    /// Clumps among grains on a slope, from a checkpoint on the way, at every width.
    #[test]
    fn clumps_go_on_from_a_checkpoint_at_any_vector_width() {
        let setup = setup();
        let grains = fill(&setup, 2).unwrap().grains;
        let (bound, free) = grains.split_at(grains.len() / 2);
        let clump = |(k, grain): (usize, &Grain)| Clump {
            radius: 0.6 * grain.radius,
            aspect: 1.2 + 0.2 * (k % 5) as f64,
            axis: [1.0, 0.3 * k as f64, 0.5],
            spin: [1.0, 2.0, 3.0],
            ..Clump::new(grain.radius, 1.0, grain.position)
        };
        let clumps: Vec<Clump> = bound.iter().enumerate().map(clump).collect();
        let start = |vectors| World::with_clumps(&setup, free, &clumps).unwrap().with_vectors(vectors);
        let steps = |world: &mut World, count| (0..count).for_each(|_| world.step().unwrap());
        let mut undisturbed = start(Vectors::Scalar);
        steps(&mut undisturbed, 3000);
        assert!(undisturbed.coordination_number() > 0.5 && undisturbed.clumps().len() > 5);
        let mut world = start(Vectors::Avx2);
        steps(&mut world, 1500);
        let mut bytes = Vec::new();
        world.store(&mut bytes);
        let mut world = World::restore(&setup, &mut &bytes[..]).unwrap().with_vectors(Vectors::Widest);
        steps(&mut world, 1500);
        assert_eq!(world.state(), undisturbed.state());
        assert_eq!(world.clumps(), undisturbed.clumps());
    }

    /// A checkpoint holds nothing of the width: taken at one, continued at another, it ends with the same bits.
    #[test]
    fn a_checkpoint_goes_on_at_any_vector_width() {
        let setup = setup();
        let grains = fill(&setup, 1).unwrap().grains;
        let mut ends = Vec::new();
        for (k, &first) in WIDTHS.iter().enumerate() {
            let mut world = World::new(&setup, &grains).unwrap().with_vectors(first);
            (0..1500).for_each(|_| world.step().unwrap());
            let mut bytes = Vec::new();
            world.store(&mut bytes);
            let second = WIDTHS[(k + 1) % WIDTHS.len()];
            let mut world = World::restore(&setup, &mut &bytes[..]).unwrap().with_vectors(second);
            (0..1500).for_each(|_| world.step().unwrap());
            ends.push(world.state());
        }
        let undisturbed = run(Vectors::Scalar);
        assert!(ends.iter().all(|end| *end == undisturbed));
    }

    /// Bytes that are no world are refused, wherever they are cut.
    #[test]
    fn a_world_cut_short_is_refused() {
        let setup = setup();
        let world = World::new(&setup, &fill(&setup, 1).unwrap().grains).unwrap();
        let mut bytes = Vec::new();
        world.store(&mut bytes);
        for length in (0..bytes.len()).step_by(bytes.len() / 50) {
            assert!(World::restore(&setup, &mut &bytes[..length]).is_none(), "{length} of {} bytes", bytes.len());
        }
    }
}
