//! What can be read off a world without changing it: energies, overlaps, coordination number, mass in a region.

use super::clumps::ClumpMotion;
use super::contact::Springs;
use super::outcome::Energies;
use super::particles::touch;
use super::setup::{Region, Vec3};
use super::vector::{add, cross, dot, length, scale, sub, xyz};
use super::walls::{Geometry, keeper};
use super::world::World;

/// The other side of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Other {
    /// A grain, by its place in the arrays.
    Grain(usize),
    /// A wall, by its place in the setup.
    Wall(usize),
}

/// A contact as seen from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Number of the grain in order of insertion.
    pub grain: u32,
    /// Number of the other grain, or place of the wall in the setup.
    pub other: Partner,
    /// Overlap [m].
    pub overlap: f64,
    /// Sliding spring, of the motion of `grain` relative to `other` [m].
    pub sliding_spring: Vec3,
    /// Rolling spring [m].
    pub rolling_spring: Vec3,
}

/// The other side of a [`Contact`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Partner {
    /// Number of a grain in order of insertion.
    Grain(u32),
    /// Place of a wall in the setup.
    Wall(usize),
}

impl World {
    /// Energies of grains and contacts [J].
    pub fn energies(&self) -> Energies {
        let mut sum = Energies::default();
        for body in self.clumps() {
            sum.translational += 0.5 * body.mass * dot(body.velocity, body.velocity);
            sum.rotational += body.rotational;
            sum.potential -= body.mass * dot(self.gravity, body.centre);
        }
        for i in (0..self.len()).filter(|i| self.clumps.of_grain(*i).is_none()) {
            let (v, w) = self.velocities(i);
            let (mass, inertia) = (self.grains.mass(i), 1.0 / self.grains.inverse_inertia[i]);
            sum.translational += 0.5 * mass * dot(v, v);
            sum.rotational += 0.5 * inertia * dot(w, w);
            sum.potential -= mass * dot(self.gravity, xyz(&self.grains.place[i]));
        }
        self.for_each_contact(|_, other, overlap, springs| {
            let law = if matches!(other, Other::Wall(_)) { &self.law.wall } else { &self.law.pair };
            let (slide, roll) = (dot(springs.sliding, springs.sliding), dot(springs.rolling, springs.rolling));
            sum.elastic += 0.5 * (law.normal * overlap * overlap + law.sliding * slide + law.rolling * roll);
        });
        sum
    }

    /// Mean number of touching grains and walls per grain [-]; 0 without grains.
    pub fn coordination_number(&self) -> f64 {
        let mut touching = 0_u32;
        self.for_each_contact(|_, other, _, _| touching += if matches!(other, Other::Grain(_)) { 2 } else { 1 });
        f64::from(touching) / self.len().max(1) as f64
    }

    /// Largest overlap over the radius of the smaller grain [-].
    pub fn max_overlap(&self) -> f64 {
        let mut largest = 0.0;
        self.for_each_overlap(|_, _, depth| largest = if depth > largest { depth } else { largest });
        largest
    }

    /// Mass of the grains whose centre is in the region [kg].
    pub fn mass_in(&self, region: &Region) -> f64 {
        let inside = |i: &usize| region.contains(xyz(&self.grains.place[*i]));
        // Summed in order of insertion, so that the sum does not depend on how the grains were last sorted.
        let mut masses: Vec<(u32, f64)> =
            (0..self.len()).filter(inside).map(|i| (self.grains.id[i], self.share_of_mass(i))).collect();
        masses.sort_unstable_by_key(|(id, _)| *id);
        masses.iter().fold(0.0, |sum, (_, mass)| sum + mass)
    }

    /// Mass of a grain; a sphere of a clump has an equal share of it [kg].
    fn share_of_mass(&self, i: usize) -> f64 {
        let mass = self.grains.mass(i);
        self.clumps.of_grain(i).map_or(mass, |body| mass / body.len() as f64)
    }

    /// Whether no grain's centre is in the region.
    pub fn is_clear(&self, region: &Region) -> bool {
        !self.grains.place.iter().any(|place| region.contains(xyz(place)))
    }

    /// Sum of m v [kg m/s].
    pub fn momentum(&self) -> Vec3 {
        self.sum(|_, mass, v, _| scale(v, mass), |body| scale(body.velocity, body.mass))
    }

    /// Sum of x × m v + I ω about the origin [kg m²/s]; a period does not conserve it.
    pub fn angular_momentum(&self) -> Vec3 {
        self.sum(
            |i, mass, v, w| {
                let orbital = cross(xyz(&self.grains.place[i]), v);
                let inertia = 1.0 / self.grains.inverse_inertia[i];
                [0, 1, 2].map(|c| mass * orbital[c] + inertia * w[c])
            },
            |body| add(scale(cross(body.centre, body.velocity), body.mass), body.momentum),
        )
    }

    /// Sum over the free grains, then over the clumps.
    fn sum(&self, term: impl Fn(usize, f64, Vec3, Vec3) -> Vec3, of_clump: impl Fn(&ClumpMotion) -> Vec3) -> Vec3 {
        let free = (0..self.len()).filter(|i| self.clumps.of_grain(*i).is_none());
        let grains = free.fold([0.0; 3], |sum, i| {
            let (v, w) = self.velocities(i);
            add(sum, term(i, self.grains.mass(i), v, w))
        });
        self.clumps().iter().fold(grains, |sum, body| add(sum, of_clump(body)))
    }

    /// All touching contacts, with their springs.
    pub fn contacts(&self) -> Vec<Contact> {
        let mut contacts = Vec::new();
        self.for_each_contact(|i, other, overlap, springs| {
            let id = self.grains.id[i];
            // Seen from the grain inserted first, whatever their order in the arrays.
            let (grain, other, sign) = match other {
                Other::Wall(w) => (id, Partner::Wall(w), 1.0),
                Other::Grain(j) if id < self.grains.id[j] => (id, Partner::Grain(self.grains.id[j]), 1.0),
                Other::Grain(j) => (self.grains.id[j], Partner::Grain(id), -1.0),
            };
            let sliding_spring = scale(springs.sliding, sign);
            contacts.push(Contact { grain, other, overlap, sliding_spring, rolling_spring: springs.rolling });
        });
        contacts
    }

    /// Calls `visit(grain, other, overlap over radius of the smaller)` for every touching contact.
    pub(super) fn for_each_overlap(&self, mut visit: impl FnMut(usize, Other, f64)) {
        self.for_each_contact(|i, other, overlap, _| {
            let own = self.grains.place[i][3];
            let radius = match other {
                Other::Grain(j) => own.min(self.grains.place[j][3]),
                Other::Wall(_) => own,
            };
            visit(i, other, overlap / radius);
        });
    }

    /// Calls `visit(grain, other, overlap, springs)` for every touching contact, in list order.
    fn for_each_contact(&self, mut visit: impl FnMut(usize, Other, f64, &Springs)) {
        let shifts = [[0.0; 3]; 2].iter().chain(self.periods.shifts());
        for (list, shift) in self.pairs.lists().zip(shifts) {
            for (k, &[i, j]) in list.pairs().iter().enumerate() {
                let (a, mut b) = (self.grains.place[i as usize], self.grains.place[j as usize]);
                b.iter_mut().zip(shift).for_each(|(place, shift)| *place -= shift);
                if touch(&a, &b) {
                    let overlap = a[3] + b[3] - length(sub(xyz(&a), xyz(&b)));
                    visit(i as usize, Other::Grain(j as usize), overlap, &list.entries.springs(k));
                }
            }
        }
        for (w, wall) in self.walls.iter().enumerate() {
            for k in self.contacts.by_grain(w) {
                let number = self.contacts.grain[k];
                let (grain, rivals) = (number as usize, self.rivals.of_grain(number));
                let place = &self.grains.place[grain];
                let near = wall.surface.near(xyz(place));
                let overlap = place[3] - near.distance;
                let dropped = near.edge && keeper(&self.walls, rivals, w, xyz(place), &near).is_some();
                if overlap > 0.0 && !dropped {
                    visit(grain, Other::Wall(w), overlap, &self.contacts.entries.springs(k));
                }
            }
        }
    }
}
