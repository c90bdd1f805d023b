//! Forces of all listed contacts: finds those that touch, fills batches, applies the law, adds forces in list order.
//!
//! Takes grains, lists and the law, changes loads and springs. Liquid bridges are a term of their own in [`super::bridges`].

use super::contact::{Batch, Coefficients, LANES, Rows};
use super::lists::{History, PairList, WallList};
use super::material::Law;
use super::particles::Particles;
use super::setup::Vec3;
use super::vector::{Row4, Row8, xyz};
use super::walls::{Near, Surface, WallPiece, keeper, near_cylinder, near_plane, near_rectangle};
use pulp::{Simd, WithSimd};

/// Overlap over radius beyond which a run counts as exploded [-].
pub const MAX_OVERLAP: f64 = 0.5;

/// Work space of the force evaluation, kept between steps.
#[derive(Debug, Clone)]
pub struct Scratch {
    batch: Batch,
    touching: Vec<u32>,
    grains: [u32; LANES],
    entries: [u32; LANES],
    /// Dropped wall contacts and the kept ones whose springs they inherit.
    inherit: Vec<[u32; 2]>,
}

impl Scratch {
    /// Empty work space.
    pub fn new() -> Self {
        Self { batch: Batch::new(), touching: Vec::new(), grains: [0; LANES], entries: [0; LANES], inherit: Vec::new() }
    }
}

/// One evaluation of all contact forces, run with the widest vectors of the machine.
pub struct Evaluation<'a> {
    /// Grains, whose loads are added to.
    pub grains: &'a mut Particles,
    /// Listed pairs.
    pub pairs: &'a mut PairList,
    /// Listed wall contacts.
    pub contacts: &'a mut WallList,
    /// Walls.
    pub walls: &'a [WallPiece],
    /// The law.
    pub law: &'a Law,
    /// Number of this evaluation.
    pub tick: u32,
    /// Work space.
    pub work: &'a mut Scratch,
}

impl WithSimd for Evaluation<'_> {
    /// Whether an overlap is beyond [`MAX_OVERLAP`].
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Evaluation { grains, pairs, contacts, walls, law, tick, work } = self;
        let deep = add_pairs(grains, pairs, &law.pair, tick, work);
        deep | add_walls(grains, contacts, walls, &law.wall, tick, work)
    }
}

/// Adds the forces between grains. Tells whether an overlap is too deep.
#[inline(always)]
fn add_pairs(grains: &mut Particles, list: &mut PairList, law: &Coefficients, tick: u32, work: &mut Scratch) -> bool {
    work.touching.resize(list.len(), 0);
    let (count, deep) = find_touching(&grains.place, &list.ends, &mut work.touching);
    for chunk in work.touching[..count].chunks(LANES) {
        fill_pairs(&mut work.batch.rows, grains, list, chunk, tick);
        work.batch.evaluate_pairs(chunk.len(), law);
        add_pair_loads(&work.batch, &mut grains.load, &list.ends, chunk);
        store_springs(&work.batch, &mut list.history, chunk, tick);
    }
    deep
}

/// Writes the touching pairs to the front of `touching`; the write is unconditional, so that nothing depends on a guess.
#[inline(always)]
fn find_touching(place: &[Row4], ends: &[[u32; 2]], touching: &mut [u32]) -> (usize, bool) {
    let mut count = 0;
    let mut deep = false;
    for (k, &[i, j]) in ends.iter().enumerate() {
        let (a, b) = (&place[i as usize], &place[j as usize]);
        let (x, y, z, sum) = (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] + b[3]);
        let square = x * x + y * y + z * z;
        let least = sum - MAX_OVERLAP * (if a[3] < b[3] { a[3] } else { b[3] });
        touching[count] = k as u32;
        count += usize::from(square < sum * sum);
        deep |= square < least * least;
    }
    (count, deep)
}

#[inline(always)]
fn fill_pairs(batch: &mut Rows, grains: &Particles, list: &PairList, chunk: &[u32], tick: u32) {
    for (l, &k) in chunk.iter().enumerate().take(LANES) {
        let [i, j] = list.ends[k as usize].map(|end| end as usize);
        let (a, b) = (&grains.place[i], &grains.place[j]);
        batch.between[l] = Row4([a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3]]);
        let (v, w) = (&grains.motion[i], &grains.motion[j]);
        batch.velocity[l] = Row4([v[0] - w[0], v[1] - w[1], v[2] - w[2], b[3]]);
        batch.spin_i[l] = grains.spin[i];
        batch.spin_j[l] = grains.spin[j];
        batch.constants[l] = list.constants[k as usize];
        batch.springs[l] = list.history.live(k as usize, tick);
    }
}

#[inline(always)]
fn add_row(load: &mut Row8, row: &Row8) {
    for c in 0..8 {
        load[c] += row[c];
    }
}

#[inline(always)]
fn add_pair_loads(batch: &Batch, load: &mut [Row8], ends: &[[u32; 2]], chunk: &[u32]) {
    for (l, &k) in chunk.iter().enumerate().take(LANES) {
        let [i, j] = ends[k as usize];
        add_row(&mut load[i as usize], &batch.load_i(l));
        add_row(&mut load[j as usize], &batch.load_j(l));
    }
}

#[inline(always)]
fn store_springs(batch: &Batch, history: &mut History, chunk: &[u32], tick: u32) {
    for (l, &k) in chunk.iter().enumerate().take(LANES) {
        history.springs[k as usize] = batch.springs(l);
        history.touched[k as usize] = tick;
    }
}

/// Adds the forces of the walls, one loop per wall with its geometry inlined. Tells whether an overlap is too deep.
#[inline(always)]
fn add_walls(
    grains: &mut Particles,
    list: &mut WallList,
    walls: &[WallPiece],
    law: &Coefficients,
    tick: u32,
    work: &mut Scratch,
) -> bool {
    let mut deep = false;
    work.inherit.clear();
    for (w, wall) in walls.iter().enumerate() {
        let mut pass = WallPass { grains, list, walls, wall: w, law, tick, work };
        deep |= match wall.surface {
            Surface::Plane { point, normal } => pass.run(|centre| near_plane(point, normal, centre)),
            Surface::Rectangle { corner, u, v, size } => pass.run(|centre| near_rectangle(corner, u, v, size, centre)),
            Surface::Cylinder { axis, radius } => pass.run(|centre| near_cylinder(axis, radius, centre)),
        };
    }
    for &[dropped, kept] in &work.inherit {
        list.history.copy(kept as usize, dropped as usize);
    }
    deep
}

/// All contacts with one wall.
struct WallPass<'a> {
    grains: &'a mut Particles,
    list: &'a mut WallList,
    walls: &'a [WallPiece],
    wall: usize,
    law: &'a Coefficients,
    tick: u32,
    work: &'a mut Scratch,
}

impl WallPass<'_> {
    #[inline(always)]
    fn run(&mut self, near: impl Fn(Vec3) -> Near) -> bool {
        let mut deep = false;
        let mut count = 0;
        for entry in self.list.of_wall(self.wall) {
            let grain = self.list.grain[entry];
            let place = self.grains.place[grain as usize];
            let near = near(xyz(&place));
            let overlap = place[3] - near.distance;
            if overlap <= 0.0 || (near.edge && self.drop_edge(entry, grain, xyz(&place), &near)) {
                continue;
            }
            deep |= overlap > MAX_OVERLAP * place[3];
            self.fill(count, entry, place[3], overlap, near.normal);
            count += 1;
            if count == LANES {
                self.flush(count);
                count = 0;
            }
        }
        self.flush(count);
        deep
    }

    /// Whether the edge contact is dropped in favour of another piece; then notes whose springs it inherits.
    #[cold]
    fn drop_edge(&mut self, entry: usize, grain: u32, centre: Vec3, near: &Near) -> bool {
        let Some(kept) = keeper(self.walls, self.wall, centre, near) else { return false };
        if let Some(kept) = self.list.find(kept, grain) {
            self.work.inherit.push([entry as u32, kept as u32]);
        }
        true
    }

    #[inline(always)]
    fn fill(&mut self, l: usize, entry: usize, radius: f64, overlap: f64, normal: Vec3) {
        let grain = self.list.grain[entry];
        self.work.grains[l] = grain;
        self.work.entries[l] = entry as u32;
        let (motion, spin) = (&self.grains.motion[grain as usize], self.grains.spin[grain as usize]);
        let drift = self.walls[self.wall].velocity;
        let batch = &mut self.work.batch.rows;
        batch.between[l] = Row4([normal[0], normal[1], normal[2], overlap]);
        batch.velocity[l] = Row4([motion[0] - drift[0], motion[1] - drift[1], motion[2] - drift[2], radius]);
        batch.spin_i[l] = spin;
        batch.spin_j[l] = Row4::default();
        batch.constants[l] = self.list.constants[entry];
        batch.springs[l] = self.list.history.live(entry, self.tick);
    }

    #[inline(always)]
    fn flush(&mut self, count: usize) {
        self.work.batch.evaluate_walls(count, self.law);
        let batch = &self.work.batch;
        for l in 0..count.min(LANES) {
            add_row(&mut self.grains.load[self.work.grains[l] as usize], &batch.load_i(l));
        }
        store_springs(batch, &mut self.list.history, &self.work.entries[..count.min(LANES)], self.tick);
    }
}
