//! Forces of all listed contacts: takes them a vector at a time, applies the law, adds forces in list order.
//!
//! Takes grains, lists and the law, changes loads and springs. Liquid bridges are a term of their own in [`super::bridges`].
//! Listed contacts that do not touch go along in their lane and give zero; a vector in which none touches is left early, and of a
//! list of which few touch full vectors of these are made.

use super::contact::{Coefficients, Constants, Friction, Kinematics, Response, Springs, respond};
use super::lanes::{LaneRows, Lanes, Mask, Number, Transposer, Truths, WIDTH};
use super::lists::{Block, Entries, PairList, Pairs, Rivals, Row, WallList};
use super::particles::Particles;
use super::setup::Vec3;
use super::vector::{Row4, Row8, add, dot, pick, scale, splat, sub, xyz};
use super::walls::{Geometry, Surface, WallPiece, keeper};
use pulp::{Simd, WithSimd};

/// Overlap over the smaller radius beyond which a run counts as exploded [-].
pub const MAX_OVERLAP: f64 = 0.5;

/// Forces between grains, evaluated with the widest vectors of the machine.
pub struct PairForces<'a> {
    /// Grains, whose loads are added to.
    pub grains: &'a mut Particles,
    /// Listed pairs.
    pub pairs: &'a mut Pairs,
    /// The law between grains.
    pub law: &'a Coefficients,
    /// Friction of pairs without one of their own.
    pub friction: &'a Friction,
    /// Work space: pairs that have met since the last rebuild.
    pub met: &'a mut Vec<u32>,
}

impl WithSimd for PairForces<'_> {
    /// Whether an overlap is too deep.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let kernel = Kernel::new(simd, self.law);
        let deep = kernel.add_pairs::<false>(self.grains, &mut self.pairs.touching, self.friction, [0.0; 3]);
        deep | kernel.add_met_pairs(self.grains, &mut self.pairs.apart, self.friction, self.met)
    }
}

/// Forces between grains that touch across the ends of a period.
pub struct AcrossForces<'a> {
    /// Grains, whose loads are added to.
    pub grains: &'a mut Particles,
    /// Listed pairs.
    pub list: &'a mut PairList,
    /// The law between grains.
    pub law: &'a Coefficients,
    /// Friction of pairs without one of their own.
    pub friction: &'a Friction,
    /// How far below itself the second grain is seen [m].
    pub shift: Vec3,
}

impl WithSimd for AcrossForces<'_> {
    /// Whether an overlap is too deep.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let kernel = Kernel::new(simd, self.law);
        kernel.add_pairs::<true>(self.grains, self.list, self.friction, self.shift)
    }
}

/// Forces of the walls, evaluated with the widest vectors of the machine.
pub struct WallForces<'a> {
    /// Grains, whose loads are added to.
    pub grains: &'a mut Particles,
    /// Listed wall contacts.
    pub contacts: &'a mut WallList,
    /// Which walls every grain may touch.
    pub rivals: &'a Rivals,
    /// Walls.
    pub walls: &'a [WallPiece],
    /// The law at walls.
    pub law: &'a Coefficients,
    /// Work space: dropped wall contacts and the kept ones whose springs they inherit.
    pub inherit: &'a mut Vec<[u32; 2]>,
}

impl WithSimd for WallForces<'_> {
    /// Whether an overlap is too deep.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { grains, contacts: list, rivals, walls, law, inherit } = self;
        let kernel = Kernel::new(simd, law);
        let mut deep = false;
        inherit.clear();
        // One loop per wall, with its geometry inlined. Of a mesh most triangles are listed for no grain and stay unread.
        for (w, wall) in walls.iter().enumerate() {
            if list.of_wall(w).is_empty() {
                continue;
            }
            let mut pass = WallPass { kernel, rows: Rows::of(grains), list, rivals, walls, wall: w, inherit };
            deep |= match &wall.surface {
                Surface::Plane(plane) => pass.run(plane),
                Surface::Rectangle(rectangle) => pass.run(rectangle),
                Surface::Cylinder(cylinder) => pass.run(cylinder),
                Surface::Cone(cone) => pass.run(cone),
                Surface::Triangle(triangle) => pass.run(triangle),
            };
        }
        for &[dropped, kept] in inherit.iter() {
            list.entries.inherit(kept as usize, dropped as usize);
        }
        deep
    }
}

/// The loops for one width of vectors.
#[derive(Clone, Copy)]
struct Kernel<'a, S: Simd> {
    simd: S,
    transposer: Transposer<S>,
    law: &'a Coefficients,
}

/// Rows of all grains, cut to one length: an index that is good for one of them is good for all, and is checked once.
struct Rows<'a> {
    place: &'a [Row4],
    motion: &'a [Row4],
    spin: &'a [Row4],
    load: &'a mut [Row8],
}

impl<'a> Rows<'a> {
    #[inline(always)]
    fn of(grains: &'a mut Particles) -> Self {
        let Particles { place, motion, spin, load, .. } = grains;
        let count = place.len();
        Self { place, motion: &motion[..count], spin: &spin[..count], load: &mut load[..count] }
    }

    /// The grains of up to a vector of pairs, checked here once for all rows.
    #[inline(always)]
    fn indices(&self, ends: &[[u32; 2]]) -> Ends {
        let count = self.place.len();
        let mut indices = Ends::default();
        for (index, &[i, j]) in indices.iter_mut().zip(ends) {
            *index = [i as usize, j as usize];
            assert!(index[0] < count && index[1] < count, "a listed grain is not there");
        }
        indices
    }
}

/// The grains of a vector of pairs; only the first `S::F64_LANES` mean something.
type Ends = [[usize; 2]; WIDTH];

/// Pairs of one vector, as far as their places tell.
#[derive(Clone, Copy)]
struct Touch<S: Simd> {
    /// d = x_i - x_j.
    between: [Lanes<S>; 3],
    /// 1/|d|.
    inverse: Lanes<S>,
    /// Overlap δ = R_i + R_j - |d|.
    overlap: Lanes<S>,
    /// Which pairs touch.
    active: Truths<S>,
}

impl<'a, S: Simd> Kernel<'a, S> {
    /// Vectors per block.
    const PARTS: usize = WIDTH / S::F64_LANES;

    #[inline(always)]
    fn new(simd: S, law: &'a Coefficients) -> Self {
        Self { simd, transposer: Transposer(simd), law }
    }

    /// Adds the forces between grains, with ACROSS of those whose second grain is seen a shift lower. Tells whether an
    /// overlap is too deep.
    ///
    /// Places of the next vector are looked at before the law is applied to this one, so that its root and division are under way
    /// meanwhile.
    #[inline(always)]
    fn add_pairs<const ACROSS: bool>(
        self,
        grains: &mut Particles,
        list: &mut PairList,
        friction: &Friction,
        shift: Vec3,
    ) -> bool {
        let (mut rows, count) = (Rows::of(grains), list.len());
        let (friction, every) = (self.splat_friction(friction), Lanes::filled(self.simd, 0, WIDTH));
        let mut vectors = list.ends.chunks_exact(S::F64_LANES);
        let Some(mut coming) = vectors.next() else { return false };
        let filled = Lanes::filled(self.simd, 0, count);
        let mut next = self.touch::<ACROSS>(&rows, &rows.indices(coming), filled, shift);
        let Entries { blocks, live, .. } = &mut list.entries;
        let (mut v, mut deep) = (0, false);
        for (b, (block, live)) in blocks.iter_mut().zip(live).enumerate() {
            let was_live = *live;
            let mut touches = false;
            for part in 0..Self::PARTS {
                let (ends, touch) = (coming, next);
                if let Some(ends) = vectors.next() {
                    coming = ends;
                    v += 1;
                    let filled = if v < count / S::F64_LANES { every } else { Lanes::filled(self.simd, v, count) };
                    next = self.touch::<ACROSS>(&rows, &rows.indices(ends), filled, shift);
                }
                if touch.active.any() {
                    let ends = rows.indices(ends);
                    let friction = self.friction(list.frictions.get(b), part, friction);
                    deep |= self.add_touching(&mut rows, &ends, &touch, block, part, &friction);
                    touches = true;
                } else if was_live {
                    self.void_springs(block, part);
                }
            }
            if touches != was_live {
                *live = touches;
            }
        }
        deep
    }

    /// The same friction in every lane.
    #[inline(always)]
    fn splat_friction(self, friction: &Friction) -> Friction<Lanes<S>> {
        let zero = Lanes::zero(self.simd);
        Friction { sliding: zero.splat(friction.sliding), rolling: zero.splat(friction.rolling) }
    }

    /// Friction of the pairs of a vector: their own, or that of all.
    #[inline(always)]
    fn friction(self, own: Option<&[Row; 2]>, part: usize, of_all: Friction<Lanes<S>>) -> Friction<Lanes<S>> {
        match own {
            Some([sliding, rolling]) => Friction {
                sliding: Lanes::load(self.simd, sliding, part),
                rolling: Lanes::load(self.simd, rolling, part),
            },
            None => of_all,
        }
    }

    /// Adds the forces of pairs of which few touch: those are looked for first and then taken a full vector at a time.
    #[inline(always)]
    fn add_met_pairs(
        self,
        grains: &mut Particles,
        list: &mut PairList,
        friction: &Friction,
        met: &mut Vec<u32>,
    ) -> bool {
        let mut rows = Rows::of(grains);
        self.find_met(&rows, list, met);
        let PairList { ends, entries: Entries { blocks, .. }, frictions, .. } = list;
        let mut deep = false;
        for met in met.chunks(S::F64_LANES) {
            let (mut few, mut block, mut own) = ([[0; 2]; WIDTH], Block::default(), [Row::default(); 2]);
            for (lane, &k) in met.iter().enumerate() {
                let (b, from) = (k as usize / WIDTH, k as usize % WIDTH);
                few[lane] = ends[k as usize];
                block.copy_constants(lane, &blocks[b], from);
                block.copy_springs(lane, &blocks[b], from);
                if let Some(frictions) = frictions.get(b) {
                    (0..2).for_each(|kind| own[kind][lane] = frictions[kind][from]);
                }
            }
            let few = rows.indices(&few);
            let touch = self.touch::<false>(&rows, &few, Lanes::filled(self.simd, 0, met.len()), [0.0; 3]);
            let friction = self.friction((!frictions.is_empty()).then_some(&own), 0, self.splat_friction(friction));
            deep |= self.add_touching(&mut rows, &few, &touch, &mut block, 0, &friction);
            for (lane, &k) in met.iter().enumerate() {
                blocks[k as usize / WIDTH].copy_springs(k as usize % WIDTH, &block, lane);
            }
        }
        deep
    }

    /// Lists the pairs that touch, in order, and voids the springs of the others.
    #[inline(always)]
    fn find_met(self, rows: &Rows, list: &mut PairList, met: &mut Vec<u32>) {
        let count = list.len();
        met.resize(list.ends.len() + WIDTH, 0);
        let mut found = 0;
        let (ends, _) = list.ends.as_chunks::<WIDTH>();
        let Entries { blocks, live, .. } = &mut list.entries;
        for (b, ((block, live), ends)) in blocks.iter_mut().zip(live).zip(ends).enumerate() {
            let was_live = std::mem::replace(live, false);
            for (part, ends) in ends.chunks_exact(S::F64_LANES).enumerate().take(Self::PARTS) {
                let filled = Lanes::filled(self.simd, part, count - b * WIDTH);
                let active = self.touch::<false>(rows, &rows.indices(ends), filled, [0.0; 3]).active;
                if was_live {
                    self.store_springs(&self.springs(block, part), active, block, part);
                }
                if active.any() {
                    let first = b * WIDTH + part * S::F64_LANES;
                    found = self.note(active, first, met, found);
                    *live = true;
                }
            }
        }
        met.truncate(found);
    }

    /// Writes the entries of the lanes that touch behind the first `found`, and gives the new number. The write is
    /// unconditional, so that nothing depends on a guess.
    #[inline(always)]
    fn note(self, active: Truths<S>, first: usize, met: &mut [u32], mut found: usize) -> usize {
        let zero = Lanes::zero(self.simd);
        let touches = Lanes::pick(active, zero.splat(1.0), zero).numbers();
        for (l, touches) in touches.iter().enumerate().take(S::F64_LANES) {
            met[found] = (first + l) as u32;
            found += usize::from(*touches > 0.0);
        }
        found
    }

    /// Applies the law to pairs that touch, keeps their springs and adds their loads; tells whether an overlap is too deep.
    #[inline(always)]
    fn add_touching(
        self,
        rows: &mut Rows,
        ends: &Ends,
        touch: &Touch<S>,
        block: &mut Block,
        part: usize,
        friction: &Friction<Lanes<S>>,
    ) -> bool {
        let (response, deep) = self.respond_pairs(rows, ends, touch, block, part, friction);
        self.store_springs(&response.springs, touch.active, block, part);
        self.add_pair_loads(&response, touch.active, rows.load, ends);
        deep
    }

    /// Which pairs touch.
    #[inline(always)]
    fn touch<const ACROSS: bool>(self, rows: &Rows, ends: &Ends, filled: Truths<S>, shift: Vec3) -> Touch<S> {
        let (a, b) = (|l: usize| *rows.place[ends[l][0]], |l: usize| *rows.place[ends[l][1]]);
        let [x, y, z, sum] = self.transposer.gather_between(a, b);
        let apart = [x, y, z];
        let between = if ACROSS { add(apart, splat(x, shift)) } else { apart };
        let square = dot(between, between);
        let distance = square.sqrt();
        Touch {
            between,
            inverse: distance.splat(1.0) / distance,
            overlap: sum - distance,
            active: square.less(sum * sum) & filled,
        }
    }

    /// Applies the law to pairs that touch, with normals n = d/|d| and arms R - δ/2; tells whether an overlap is too deep.
    #[inline(always)]
    fn respond_pairs(
        self,
        rows: &Rows,
        ends: &Ends,
        touch: &Touch<S>,
        block: &Block,
        part: usize,
        friction: &Friction<Lanes<S>>,
    ) -> (Response<Lanes<S>>, bool) {
        let (a, b) = (|l: usize| *rows.motion[ends[l][0]], |l: usize| *rows.motion[ends[l][1]]);
        let [vx, vy, vz, _] = self.transposer.gather_difference(a, b);
        let [ax, ay, az, radius_i] = self.transposer.gather(|l| *rows.spin[ends[l][0]]);
        let [bx, by, bz, radius_j] = self.transposer.gather(|l| *rows.spin[ends[l][1]]);
        let overlap = touch.overlap;
        let deep = self.is_deep(touch.active, overlap, radius_i.min(radius_j));
        let half = overlap.splat(0.5) * overlap;
        let contact = Kinematics {
            normal: scale(touch.between, touch.inverse),
            overlap,
            velocity: [vx, vy, vz],
            spin_i: [ax, ay, az],
            spin_j: [bx, by, bz],
            arm_i: radius_i - half,
            arm_j: radius_j - half,
        };
        let (constants, springs) = (self.constants(block, part), self.springs(block, part));
        (respond(&contact, &constants, friction, &springs, self.law), deep)
    }

    /// Whether an overlap is too deep for the smaller radius. Which one is not asked here: in this loop even a path that is never
    /// taken costs registers.
    #[inline(always)]
    fn is_deep(self, active: Truths<S>, overlap: Lanes<S>, smaller: Lanes<S>) -> bool {
        (active & (smaller.splat(MAX_OVERLAP) * smaller).less(overlap)).any()
    }

    #[inline(always)]
    fn constants(self, block: &Block, part: usize) -> Constants<Lanes<S>> {
        let [damping, rolling_damping, length] = &block.constants;
        Constants {
            damping: Lanes::load(self.simd, damping, part),
            rolling_damping: Lanes::load(self.simd, rolling_damping, part),
            length: Lanes::load(self.simd, length, part),
        }
    }

    #[inline(always)]
    fn springs(self, block: &Block, part: usize) -> Springs<Lanes<S>> {
        let [a, b, c, d, e, f] = &block.springs;
        Springs { sliding: self.load([a, b, c], part), rolling: self.load([d, e, f], part) }
    }

    #[inline(always)]
    fn load(self, rows: [&Row; 3], part: usize) -> [Lanes<S>; 3] {
        [
            Lanes::load(self.simd, rows[0], part),
            Lanes::load(self.simd, rows[1], part),
            Lanes::load(self.simd, rows[2], part),
        ]
    }

    /// Springs of the lanes that touch; those of the others are void.
    #[inline(always)]
    fn store_springs(self, springs: &Springs<Lanes<S>>, active: Truths<S>, block: &mut Block, part: usize) {
        let zero = Lanes::zero(self.simd);
        for c in 0..3 {
            Lanes::pick(active, springs.sliding[c], zero).store(&mut block.springs[c], part);
            Lanes::pick(active, springs.rolling[c], zero).store(&mut block.springs[c + 3], part);
        }
    }

    #[inline(always)]
    fn void_springs(self, block: &mut Block, part: usize) {
        for row in &mut block.springs {
            Lanes::zero(self.simd).store(row, part);
        }
    }

    /// Adds zero for the lanes that do not touch, which changes no bit of a load.
    ///
    /// In a sorted list a first grain comes several times in a row, and its sum is kept at hand meanwhile: to read a row back that was
    /// just stored takes several times as long as to add to it. No pair of such a row has that grain as its second.
    #[inline(always)]
    fn add_pair_loads(self, response: &Response<Lanes<S>>, active: Truths<S>, load: &mut [Row8], ends: &Ends) {
        let force = self.rows(active, response.force);
        let (torque_i, counter_torque_j) =
            (self.rows(active, response.torque_i), self.rows(active, response.counter_torque_j));
        let (mut sum, mut last) = (Row8::default(), usize::MAX);
        for (l, &[i, j]) in ends.iter().enumerate().take(S::F64_LANES) {
            if i != last {
                (sum, last) = (load[i], i);
            }
            for c in 0..4 {
                sum[c] += force.of(l)[c];
                sum[c + 4] += torque_i.of(l)[c];
            }
            load[i] = sum;
            let row = &mut load[j];
            for c in 0..4 {
                row[c] -= force.of(l)[c];
                row[c + 4] -= counter_torque_j.of(l)[c];
            }
        }
    }

    /// Rows of the lanes that touch, zero for the others.
    #[inline(always)]
    fn rows(self, active: Truths<S>, lanes: [Lanes<S>; 3]) -> LaneRows<S> {
        self.transposer.rows(pick(active, lanes, [Lanes::zero(self.simd); 3]))
    }
}

/// All contacts with one wall.
struct WallPass<'a, S: Simd> {
    kernel: Kernel<'a, S>,
    rows: Rows<'a>,
    list: &'a mut WallList,
    rivals: &'a Rivals,
    walls: &'a [WallPiece],
    wall: usize,
    inherit: &'a mut Vec<[u32; 2]>,
}

impl<S: Simd> WallPass<'_, S> {
    #[inline(always)]
    fn run(&mut self, surface: &impl Geometry) -> bool {
        let range = self.list.of_wall(self.wall);
        let mut deep = false;
        for first in range.clone().step_by(WIDTH) {
            let mut live = false;
            for part in 0..Kernel::<'_, S>::PARTS {
                let filled = Lanes::filled(self.kernel.simd, part, range.end - first);
                let base = first + part * S::F64_LANES;
                let (touches, is_deep) = self.part(base, part, filled, surface);
                live |= touches;
                deep |= is_deep;
            }
            self.list.entries.live[first / WIDTH] = live;
        }
        deep
    }

    /// Evaluates the contacts from entry `base` on; tells whether any touches, and whether one is too deep.
    #[inline(always)]
    fn part(&mut self, base: usize, part: usize, filled: Truths<S>, surface: &impl Geometry) -> (bool, bool) {
        let Kernel { simd, transposer, .. } = self.kernel;
        let mut grain = [0; WIDTH];
        grain[..S::F64_LANES].copy_from_slice(&self.list.grain[base..base + S::F64_LANES]);
        let [x, y, z, radius] = transposer.gather(|l| *self.rows.place[grain[l] as usize]);
        let near = surface.near([x, y, z]);
        let overlap = radius - near.distance;
        let zero = Lanes::zero(simd);
        let mut active = zero.less(overlap) & filled;
        if (active & near.edge).any() {
            active = active & self.keep_edges(base, active & near.edge);
        }
        let block = &mut self.list.entries.blocks[base / WIDTH];
        if !active.any() {
            if self.list.entries.live[base / WIDTH] {
                self.kernel.void_springs(block, part);
            }
            return (false, false);
        }
        let [vx, vy, vz, _] = transposer.gather(|l| *self.rows.motion[grain[l] as usize]);
        let [wx, wy, wz, _] = transposer.gather(|l| *self.rows.spin[grain[l] as usize]);
        let contact = Kinematics {
            normal: near.normal,
            overlap,
            velocity: sub([vx, vy, vz], splat(zero, self.walls[self.wall].velocity)),
            spin_i: [wx, wy, wz],
            spin_j: [zero; 3],
            arm_i: radius - radius.splat(0.5) * overlap,
            arm_j: zero,
        };
        let (constants, springs) = (self.kernel.constants(block, part), self.kernel.springs(block, part));
        let deep = self.kernel.is_deep(active, overlap, radius);
        let species = self.walls[self.wall].species;
        let friction =
            Friction { sliding: zero.splat(species.sliding_friction), rolling: zero.splat(species.rolling_friction) };
        let response = respond(&contact, &constants, &friction, &springs, self.kernel.law);
        self.kernel.store_springs(&response.springs, active, block, part);
        add_loads(&self.kernel, &response, active, self.rows.load, &grain);
        (true, deep)
    }

    /// Which of the edge contacts are not dropped in favour of another piece; notes whose springs the dropped ones inherit.
    #[cold]
    #[inline(never)]
    fn keep_edges(&mut self, base: usize, edges: Truths<S>) -> Truths<S> {
        let zero = Lanes::zero(self.kernel.simd);
        let mut kept = Lanes::pick(edges, zero, zero.splat(1.0)).numbers();
        for (l, kept) in kept.iter_mut().enumerate().take(S::F64_LANES).filter(|(_, kept)| **kept == 0.0) {
            let grain = self.list.grain[base + l];
            *kept = f64::from(u8::from(!self.drops(base + l, grain, xyz(&self.rows.place[grain as usize]))));
        }
        zero.less(Lanes::load(self.kernel.simd, &kept, 0))
    }

    /// Whether the edge contact is dropped; then notes whose springs it inherits.
    fn drops(&mut self, entry: usize, grain: u32, centre: Vec3) -> bool {
        let near = self.walls[self.wall].surface.near(centre);
        let Some(kept) = keeper(self.walls, self.rivals.of_grain(grain), self.wall, centre, &near) else {
            return false;
        };
        if let Some(kept) = self.list.find(kept, grain) {
            self.inherit.push([entry as u32, kept as u32]);
        }
        true
    }
}

/// Adds force and torque on the grains at a wall.
#[inline(always)]
fn add_loads<S: Simd>(
    kernel: &Kernel<'_, S>,
    response: &Response<Lanes<S>>,
    active: Truths<S>,
    load: &mut [Row8],
    grain: &[u32],
) {
    let (force, torque) = (kernel.rows(active, response.force), kernel.rows(active, response.torque_i));
    for (l, &i) in grain.iter().enumerate().take(S::F64_LANES) {
        let row = &mut load[i as usize];
        for c in 0..4 {
            row[c] += force.of(l)[c];
            row[c + 4] += torque.of(l)[c];
        }
    }
}
