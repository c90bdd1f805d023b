//! A running world: state, lists, work space, and one step of it.
//!
//! Takes a [`Setup`] and grains, gives states. A step is velocity Verlet in its leapfrog form: the velocities kept are those of
//! the half step before the positions, which merges the two half kicks of neighbouring steps; forces that depend on velocity see
//! the half-step velocity, as in MercuryDPM. Nothing is allocated in a step once the lists have seen their largest size.
//! Knows nothing of filling, events or stop rules: see [`super::run`].

use super::bridges::{self, Bridges, PairBridges};
use super::contact::{Coefficients, Constants, implicit};
use super::drag;
use super::forces::{MAX_OVERLAP, PairForces, WallForces};
use super::grid::Grid;
use super::integrate::Integration;
use super::lists::{Pairs, WallList};
use super::material::{Law, pair_length, time_step};
use super::outcome::{Failure, State};
use super::particles::{Grain, Particles, touch};
use super::setup::{Reference, Region, Setup, Vec3, WallSpecies};
use super::skin::Skin;
use super::vector::{Row4, dot, xyz};
use super::walls::{Geometry, WallPiece};
use pulp::Arch;

/// Grains, walls and contacts at one time.
#[derive(Debug, Clone)]
pub struct World {
    pub(super) grains: Particles,
    pub(super) pairs: Pairs,
    pub(super) contacts: WallList,
    pub(super) walls: Vec<WallPiece>,
    pub(super) law: Law,
    pub(super) bridges: Option<Bridges>,
    pub(super) gravity: Vec3,
    density: f64,
    drag: f64,
    domain: Region,
    time_step: f64,
    steps: u64,
    lost: usize,
    rebuilds: u64,
    skin: Skin,
    spare: Spare,
    inherit: Vec<[u32; 2]>,
    arch: Arch,
}

/// Buffers of the rebuild, swapped with the live ones.
#[derive(Debug, Clone, Default)]
struct Spare {
    grains: Particles,
    pairs: Pairs,
    contacts: WallList,
    grid: Grid,
    keep: Vec<bool>,
    reach: Vec<Row4>,
    entry: Vec<u32>,
    hits: Vec<u32>,
}

/// Marks a grain without an entry in the old wall list.
const NONE: u32 = u32::MAX;

impl World {
    /// A world with the setup's law, walls, gravity, bridges, domain and time step, and these grains at t = 0.
    ///
    /// # Errors
    /// [`Failure`] where grains overlap too far or are not finite to begin with.
    pub fn new(setup: &Setup, grains: &[Grain]) -> Result<Self, Failure> {
        let time_step = time_step(setup);
        let mut world = Self {
            grains: Particles::default(),
            pairs: Pairs::default(),
            contacts: WallList::default(),
            walls: setup.walls.iter().map(WallPiece::new).collect(),
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
            skin: Skin::new(setup.grains.size.mean(), time_step, setup.gravity),
            spare: Spare::default(),
            inherit: Vec::new(),
            arch: Arch::new(),
        };
        grains.iter().for_each(|grain| world.grains.push(grain, world.density));
        world.rebuild()?;
        world.evaluate()?;
        world.shift_velocities(-0.5);
        Ok(world)
    }

    /// One time step.
    ///
    /// # Errors
    /// [`Failure`] where the run explodes.
    pub fn step(&mut self) -> Result<(), Failure> {
        self.skin.age();
        let outrun = self.integrate();
        for wall in &mut self.walls {
            wall.advance(self.time_step);
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

    /// Number of grains.
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

    /// Grains in order of insertion, with velocities at the time of the positions.
    pub fn state(&self) -> State {
        let mut order: Vec<usize> = (0..self.len()).collect();
        order.sort_unstable_by_key(|&i| self.grains.id[i]);
        let mut state = State::default();
        for i in order {
            self.append(i, &mut state);
        }
        state
    }

    fn append(&self, i: usize, state: &mut State) {
        let [x, y, z, radius] = *self.grains.place[i];
        let ([vx, vy, vz], [wx, wy, wz]) = self.velocities(i);
        state.id.push(self.grains.id[i]);
        state.radius.push(radius);
        let columns = [&mut state.x, &mut state.y, &mut state.z, &mut state.vx, &mut state.vy, &mut state.vz];
        columns.into_iter().zip([x, y, z, vx, vy, vz]).for_each(|(column, value)| column.push(value));
        let columns = [&mut state.wx, &mut state.wy, &mut state.wz];
        columns.into_iter().zip([wx, wy, wz]).for_each(|(column, value)| column.push(value));
    }

    /// Velocity and angular velocity at the time of the positions: half a kick after those kept.
    pub(super) fn velocities(&self, i: usize) -> (Vec3, Vec3) {
        let (motion, spin, load) = (&self.grains.motion[i], &self.grains.spin[i], &self.grains.load[i]);
        let half = 0.5 * self.time_step;
        let kick = |c: usize| motion[c] + half * (load[c] * motion[3] + self.gravity[c]);
        let turn = |c: usize| spin[c] + half * (load[c + 4] * spin[3]);
        ([kick(0), kick(1), kick(2)], [turn(0), turn(1), turn(2)])
    }

    /// Moves the kept velocities by a fraction of a step's kick.
    fn shift_velocities(&mut self, fraction: f64) {
        let step = fraction * self.time_step;
        for ((motion, spin), load) in self.grains.motion.iter_mut().zip(&mut self.grains.spin).zip(&self.grains.load) {
            for c in 0..3 {
                motion[c] += step * (load[c] * motion[3] + self.gravity[c]);
                spin[c] += step * (load[c + 4] * spin[3]);
            }
        }
    }

    fn integrate(&mut self) -> bool {
        self.arch.dispatch(Integration {
            grains: &mut self.grains,
            bases: self.skin.bases(),
            drift: self.skin.offset(),
            gravity: self.gravity,
            time_step: self.time_step,
        })
    }

    fn evaluate(&mut self) -> Result<(), Failure> {
        let Self { grains, pairs, contacts, walls, law, inherit, arch, .. } = self;
        let deep = arch.dispatch(PairForces { grains, pairs, law: &law.pair });
        let deep = deep | arch.dispatch(WallForces { grains, contacts, walls, law: &law.wall, inherit });
        if let Some(law) = &self.bridges {
            for list in [&mut self.pairs.touching, &mut self.pairs.apart] {
                self.arch.dispatch(PairBridges { grains: &mut self.grains, list, law });
            }
            bridges::add_walls(&mut self.grains, &mut self.contacts, &self.walls, law);
        }
        if self.drag > 0.0 {
            drag::add(&mut self.grains, self.drag);
        }
        if deep { Err(self.deepest_overlap()) } else { Ok(()) }
    }

    /// Removes the grains above a height and gives their number.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn delete_above(&mut self, height: f64, reference: Reference) -> Result<usize, Failure> {
        let before = self.len();
        let above = |place: &Row4| match reference {
            Reference::Top => place[2] + place[3] > height,
            Reference::Centre => place[2] > height,
        };
        self.spare.keep.clear();
        self.spare.keep.extend(self.grains.place.iter().map(|place| !above(place)));
        let kept = self.spare.keep.iter().filter(|keep| **keep).count();
        self.rebuild_kept()?;
        Ok(before - kept)
    }

    /// Removes a wall; tells whether there was one of that name.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn remove_wall(&mut self, name: &str) -> Result<bool, Failure> {
        let Some(wall) = self.walls.iter_mut().find(|wall| wall.name == name && wall.active) else { return Ok(false) };
        wall.active = false;
        self.rebuild().map(|()| true)
    }

    /// Changes gravity from the next step on; lists stay good, because no grain may outrun its skin unnoticed.
    pub fn set_gravity(&mut self, gravity: Vec3) {
        self.gravity = gravity;
    }

    /// Lets a wall move; tells whether there is one of that name.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub fn move_wall(&mut self, name: &str, velocity: Vec3) -> Result<bool, Failure> {
        let Some(wall) = self.walls.iter_mut().find(|wall| wall.name == name && wall.active) else { return Ok(false) };
        wall.velocity = velocity;
        self.rebuild().map(|()| true)
    }

    /// Removes the grains outside the domain, which between rebuilds nobody notices.
    ///
    /// # Errors
    /// [`Failure::NotFinite`] from the rebuild.
    pub(super) fn sweep(&mut self) -> Result<(), Failure> {
        let left = self.grains.place.iter().any(|place| !self.domain.contains(xyz(place)));
        if left { self.rebuild() } else { Ok(()) }
    }

    fn rebuild(&mut self) -> Result<(), Failure> {
        self.spare.keep.clear();
        self.spare.keep.resize(self.len(), true);
        self.rebuild_kept()
    }

    /// Drops the grains not kept and those outside the domain, sorts the rest by cell and builds the lists anew.
    fn rebuild_kept(&mut self) -> Result<(), Failure> {
        self.check_finite()?;
        for (keep, place) in self.spare.keep.iter_mut().zip(&self.grains.place) {
            let inside = self.domain.contains(xyz(place));
            self.lost += usize::from(*keep && !inside);
            *keep &= inside;
        }
        self.rebuilds += 1;
        let rupture = self.bridges.as_ref().map_or(0.0, |law| law.rupture_gap(1.0));
        let widest = self.skin.renew(&self.grains, &self.walls, rupture);
        self.spare.grid.sort(&self.grains.place, &self.spare.keep, 2.0 * widest);
        std::mem::swap(&mut self.grains, &mut self.spare.grains);
        self.grains.gather(&self.spare.grains, &self.spare.grid.order);
        self.skin.reorder(&self.grains, &self.spare.grid.order);
        self.list_pairs(rupture);
        self.list_walls(rupture);
        Ok(())
    }

    fn list_pairs(&mut self, rupture: f64) {
        std::mem::swap(&mut self.pairs, &mut self.spare.pairs);
        let Self { grains, pairs, law, skin, spare, .. } = self;
        pairs.clear();
        skin.reaches(&grains.place, rupture, &mut spare.reach);
        let order = &spare.grid.order;
        spare.grid.pairs(&spare.reach, &mut spare.hits, |i, j| {
            let fresh = || pair_constants(grains, law, i, j);
            let touching = touch(&grains.place[i], &grains.place[j]);
            pairs.push(touching, [i as u32, j as u32], &spare.pairs, [order[i], order[j]], fresh);
        });
    }

    fn list_walls(&mut self, rupture: f64) {
        std::mem::swap(&mut self.contacts, &mut self.spare.contacts);
        self.contacts.clear();
        for w in 0..self.walls.len() {
            self.contacts.begin();
            if self.walls[w].active {
                self.list_wall(w, rupture);
            }
        }
    }

    fn list_wall(&mut self, w: usize, rupture: f64) {
        let Self { grains, contacts, law, skin, spare, walls, .. } = self;
        spare.entry.clear();
        spare.entry.resize(spare.grains.len(), NONE);
        for entry in spare.contacts.of_wall(w) {
            spare.entry[spare.contacts.grain[entry] as usize] = entry as u32;
        }
        let species = walls[w].species;
        for (i, place) in grains.place.iter().enumerate() {
            let size = 2.0 * place[3];
            let limit = place[3] + skin.wall_margin(i) + rupture * size;
            if walls[w].surface.near(xyz(place)).distance < limit {
                let old = spare.entry[spare.grid.order[i] as usize];
                let fresh = || wall_constants(grains, law, i, species);
                contacts.push(i as u32, &spare.contacts, (old != NONE).then_some(old as usize), fresh);
            }
        }
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

    /// The failure that names the deepest overlap.
    fn deepest_overlap(&self) -> Failure {
        let (mut overlap, mut grain, mut with) = (MAX_OVERLAP, 0, String::new());
        self.for_each_overlap(|i, other, depth| {
            if depth >= overlap {
                (overlap, grain) = (depth, i);
                with = match other {
                    super::observe::Other::Grain(j) => format!("grain {}", self.grains.id[j]),
                    super::observe::Other::Wall(w) => format!("wall {}", self.walls[w].name),
                };
            }
        });
        let position = xyz(&self.grains.place[grain]);
        Failure::Overlap { step: self.steps, time: self.time(), grain: self.grains.id[grain], position, overlap, with }
    }
}

/// Constants of a pair. The frictions of two grains mix as harmonic means, as species do in MercuryDPM; where
/// all grains have factor 1 the law's own numbers come out, bit for bit.
fn pair_constants(grains: &Particles, law: &Law, i: usize, j: usize) -> Constants {
    let mix = |kind: usize| {
        let (a, b) = (grains.friction[i][kind], grains.friction[j][kind]);
        2.0 * a * b / (a + b)
    };
    let damping = law.pair_damping(grains.mass(i), grains.mass(j));
    let length = pair_length(grains.place[i][3], grains.place[j][3]);
    Constants {
        damping,
        rolling_damping: rolling_damping(&law.pair, damping, length, grains.spin[i][3] + grains.spin[j][3]),
        length,
        sliding_friction: law.sliding_friction * mix(0),
        rolling_friction: law.rolling_friction * mix(1),
    }
}

/// Constants of a contact with a wall: D = 2R, friction of the wall.
fn wall_constants(grains: &Particles, law: &Law, i: usize, species: WallSpecies) -> Constants {
    let damping = law.wall_damping(grains.mass(i));
    let length = 2.0 * grains.place[i][3];
    Constants {
        damping,
        rolling_damping: rolling_damping(&law.wall, damping, length, grains.spin[i][3]),
        length,
        sliding_friction: species.sliding_friction,
        rolling_friction: species.rolling_friction,
    }
}

/// γ_r of a contact, taken at the end of the step, from γ_n, D and the sum of the inverse moments of inertia.
fn rolling_damping(law: &Coefficients, damping: f64, length: f64, inverse_inertia: f64) -> f64 {
    implicit(damping * law.rolling_damping_ratio, length * length * inverse_inertia, law.time_step)
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
        let walls = vec![
            plate("left half", [-0.03, -0.03, 0.0], [0.03, 0.0, 0.0], [0.0, 0.06, 0.0]),
            plate("right half", [0.0, -0.03, 0.0], [0.03, 0.0, 0.0], [0.0, 0.06, 0.0]),
            Wall { name: "side".to_owned(), shape: Shape::Cylinder { axis: [0.0; 2], radius: 0.03 }, species },
            Wall {
                name: "slope".to_owned(),
                shape: Shape::Plane { point: [0.0; 3], normal: [0.1, 0.0, 1.0] },
                species,
            },
        ];
        Setup {
            grains: Grains::default(),
            contact: ContactLaw { stiffness: 3.7e4, ..ContactLaw::default() },
            bridges: Some(LiquidBridges { bond_number: 0.3, volume_ratio: 0.01, contact_angle: 0.2 }),
            gravity: [0.0, 0.0, -9.81],
            time_step_fraction: 0.1,
            walls,
            fill: Fill {
                area: FillArea::Disc { axis: [0.0; 2], radius: 0.03 },
                base: 0.0,
                plane_step: 1e-3,
                volume: 3e-5,
            },
            events: Vec::new(),
            stop: StopRule { energy_ratio: None, empty: None, check_after: 0.0, time_cap: 1.0 },
            domain: Region { lower: [-0.1, -0.1, -0.01], upper: [0.1, 0.1, 1.0] },
            trace: None,
        }
    }

    /// State after 3000 steps, with the vectors of `arch`.
    fn run(arch: Arch) -> State {
        let setup = setup();
        let grains = fill(&setup, 1).unwrap().grains;
        let mut world = World { arch, ..World::new(&setup, &grains).unwrap() };
        (0..3000).for_each(|_| world.step().unwrap());
        assert!(world.coordination_number() > 1.0, "the grains have met");
        world.state()
    }

    #[test]
    fn every_vector_width_gives_the_same_bits() {
        let scalar = run(Arch::Scalar);
        assert_eq!(scalar, run(Arch::new()), "widest vectors of this machine");
        #[cfg(target_arch = "x86_64")]
        if let Some(v3) = pulp::x86::V3::try_new() {
            assert_eq!(scalar, run(Arch::V3(v3)), "AVX2");
        }
    }
}
