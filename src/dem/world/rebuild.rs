//! The rebuild of the lists: drops grains that are gone, sorts the others by cell, lists the contacts that may come about before the
//! next rebuild, and takes along the springs of those that were listed.
//!
//! Takes the grains and walls of a [`World`] as they are, gives its lists. The order of grains and lists is the order of sums, which fixes the
//! bits.

use super::World;
use crate::dem::contact::{Coefficients, Constants, Friction, implicit};
use crate::dem::grid::{Grid, Search};
use crate::dem::lists::{Pairs, WallList};
use crate::dem::material::{Law, pair_length};
use crate::dem::outcome::Failure;
use crate::dem::particles::{Particles, touch};
use crate::dem::vector::{Row4, add, xyz};
use crate::dem::walls::{Geometry, SAME_POINT};

/// Buffers of the rebuild, swapped with the live ones.
#[derive(Debug, Clone, Default)]
pub(super) struct Spare {
    grains: Particles,
    pairs: Pairs,
    contacts: WallList,
    grid: Grid,
    /// Which grains the next rebuild keeps.
    pub(super) keep: Vec<bool>,
    reach: Vec<Row4>,
    entry: Vec<u32>,
    limit: Vec<f64>,
    /// Grains that touch a wall, and others near it.
    near: [Vec<u32>; 2],
    search: Search,
}

impl Spare {
    /// Empty buffers for lists with this number of shifts.
    pub(super) fn new(shifts: usize) -> Self {
        Self { pairs: Pairs::new(shifts), ..Self::default() }
    }
}

/// Marks a grain without an entry in the old wall list.
const NONE: u32 = u32::MAX;

impl World {
    /// Drops the grains outside the domain, sorts the rest by cell and builds the lists anew.
    pub(super) fn rebuild(&mut self) -> Result<(), Failure> {
        self.spare.keep.clear();
        self.spare.keep.resize(self.len(), true);
        self.rebuild_kept()
    }

    /// The same, and drops the grains that are not to be kept.
    pub(super) fn rebuild_kept(&mut self) -> Result<(), Failure> {
        self.check_finite()?;
        for place in self.grains.place.iter_mut().filter(|_| !self.periods.shifts().is_empty()) {
            let inside = self.periods.wrapped(xyz(place));
            place[..3].copy_from_slice(&inside);
        }
        let before = self.count(&self.spare.keep);
        for (keep, place) in self.spare.keep.iter_mut().zip(self.grains.place.iter()) {
            *keep &= self.domain.contains(xyz(place));
        }
        self.clumps.keep_whole(&mut self.spare.keep);
        self.lost += before - self.count(&self.spare.keep);
        self.rebuilds += 1;
        let rupture = self.bridges.as_ref().map_or(0.0, |law| law.rupture_gap(1.0));
        let widest = self.skin.renew(&self.grains, &self.walls, rupture);
        self.spare.grid.sort(&self.grains.place, &self.spare.keep, 2.0 * widest);
        std::mem::swap(&mut self.grains, &mut self.spare.grains);
        self.grains.gather(&self.spare.grains, &self.spare.grid.order);
        self.clumps.reorder(&self.spare.grid.order, self.spare.grains.len());
        self.skin.reorder(&self.grains, &self.spare.grid.order);
        self.list_pairs(rupture);
        for shift in 0..self.periods.shifts().len() {
            self.list_across(shift, widest);
        }
        self.list_walls(rupture);
        Ok(())
    }

    /// Lists the pairs of a grain near the ends over which a shift leads and one that has it there as an image; `widest` is the
    /// largest reach [m].
    fn list_across(&mut self, shift: usize, widest: f64) {
        let Self { grains, pairs, law, spare, periods, .. } = self;
        let differ = grains.differ_in_friction();
        let (order, way) = (&spare.grid.order, periods.shifts()[shift]);
        let near = |(_, row): &(usize, &Row4)| periods.is_near(xyz(row), way, 2.0 * widest);
        for (i, row) in spare.reach.iter().enumerate().filter(near) {
            let [x, y, z] = add(xyz(row), way);
            let (image, reach) = (Row4([x, y, z, row[3]]), row[3] + widest);
            let corners = [xyz(&image).map(|x| x - reach), xyz(&image).map(|x| x + reach)];
            spare.grid.visit_box(corners, |j| {
                if touch(&image, &spare.reach[j]) {
                    let fresh = || pair_constants(grains, law, i, j);
                    let friction = differ.then(|| pair_friction(grains, law, i, j));
                    pairs.push_across(shift, [i as u32, j as u32], &spare.pairs, [order[i], order[j]], friction, fresh);
                }
            });
        }
    }

    fn list_pairs(&mut self, rupture: f64) {
        let differ = self.grains.differ_in_friction();
        std::mem::swap(&mut self.pairs, &mut self.spare.pairs);
        let Self { grains, clumps, pairs, law, skin, spare, arch, .. } = self;
        pairs.clear();
        skin.reaches(&grains.place, rupture, &mut spare.reach);
        let order = &spare.grid.order;
        spare.grid.pairs(*arch, &spare.reach, &mut spare.search, |i, j| {
            if clumps.joins(i, j) {
                return;
            }
            let fresh = || pair_constants(grains, law, i, j);
            let friction = differ.then(|| pair_friction(grains, law, i, j));
            let touching = touch(&grains.place[i], &grains.place[j]);
            pairs.push(touching, [i as u32, j as u32], &spare.pairs, [order[i], order[j]], friction, fresh);
        });
    }

    fn list_walls(&mut self, rupture: f64) {
        std::mem::swap(&mut self.contacts, &mut self.spare.contacts);
        self.contacts.clear();
        self.spare.entry.clear();
        self.spare.entry.resize(self.spare.grains.len(), NONE);
        self.spare.limit.clear();
        let limit =
            |(i, place): (usize, &Row4)| place[3] + self.skin.wall_margin(i) + rupture * (2.0 * place[3]) + SAME_POINT;
        self.spare.limit.extend(self.grains.place.iter().enumerate().map(limit));
        let widest = self.spare.limit.iter().copied().fold(0.0, f64::max);
        for w in 0..self.walls.len() {
            self.contacts.begin();
            if self.walls[w].active {
                self.list_wall(w, widest);
            }
        }
        self.rivals.index(&self.contacts, self.grains.len());
    }

    /// Lists the grains within their limit of a wall; of one with an end only those in the cells about it are looked at.
    fn list_wall(&mut self, w: usize, widest: f64) {
        let Self { grains, contacts, law, spare, walls, .. } = self;
        for entry in spare.contacts.of_wall(w) {
            spare.entry[spare.contacts.grain[entry] as usize] = entry as u32;
        }
        let surface = walls[w].surface;
        let [touching, apart] = &mut spare.near;
        let mut look = |i: usize| {
            let (place, limit) = (&grains.place[i], spare.limit[i]);
            let distance = surface.near(xyz(place)).distance;
            if distance < place[3] {
                touching.push(i as u32);
            } else if distance < limit {
                apart.push(i as u32);
            }
        };
        match surface.bounds() {
            Some([lower, upper]) => {
                let round = [lower.map(|x| x - widest), upper.map(|x| x + widest)];
                spare.grid.visit_box(round, &mut look);
            }
            None => (0..grains.len()).for_each(&mut look),
        }
        for (is_touching, near) in [(true, touching), (false, apart)] {
            for i in near.drain(..) {
                let old = spare.entry[spare.grid.order[i as usize] as usize];
                let fresh = || wall_constants(grains, law, i as usize);
                contacts.push(is_touching, i, &spare.contacts, (old != NONE).then_some(old as usize), fresh);
            }
        }
        for entry in spare.contacts.of_wall(w) {
            spare.entry[spare.contacts.grain[entry] as usize] = NONE;
        }
    }
}

/// Friction of a pair: those of two grains mix as harmonic means, as species do in MercuryDPM; where both have factor 1 the law's
/// own numbers come out, bit for bit.
fn pair_friction(grains: &Particles, law: &Law, i: usize, j: usize) -> Friction {
    let mix = |kind: usize| {
        let (a, b) = (grains.friction[i][kind], grains.friction[j][kind]);
        if a + b > 0.0 { 2.0 * a * b / (a + b) } else { 0.0 }
    };
    Friction { sliding: law.friction.sliding * mix(0), rolling: law.friction.rolling * mix(1) }
}

/// Constants of a pair.
fn pair_constants(grains: &Particles, law: &Law, i: usize, j: usize) -> Constants {
    let damping = law.pair_damping(grains.mass(i), grains.mass(j));
    let length = pair_length(grains.place[i][3], grains.place[j][3]);
    Constants {
        damping,
        rolling_damping: rolling_damping(
            &law.pair,
            damping,
            length,
            grains.inverse_inertia[i] + grains.inverse_inertia[j],
        ),
        length,
    }
}

/// Constants of a contact with a wall: D = 2R.
fn wall_constants(grains: &Particles, law: &Law, i: usize) -> Constants {
    let damping = law.wall_damping(grains.mass(i));
    let length = 2.0 * grains.place[i][3];
    Constants {
        damping,
        rolling_damping: rolling_damping(&law.wall, damping, length, grains.inverse_inertia[i]),
        length,
    }
}

/// γ_r of a contact, taken at the end of the step, from γ_n, D and the sum of the inverse moments of inertia.
fn rolling_damping(law: &Coefficients, damping: f64, length: f64, inverse_inertia: f64) -> f64 {
    implicit(damping * law.rolling_damping_ratio, length * length * inverse_inertia, law.time_step)
}
