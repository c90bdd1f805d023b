//! Rigid clumps: two or three equal spheres in a row that move as one body.
//!
//! The spheres are grains of the world like any other, with contacts of their own; the body gathers their forces in a fixed
//! order, moves, and puts them back. Mass and moments of inertia are those of the union of the spheres, which has the volume
//! of the sphere the clump stands for. A row is symmetric about its axis u, so its state of rotation is u and the angular
//! momentum L: u turns about L at |L|/I_t whatever the spin about u itself, which needs no quaternion, and a free clump keeps
//! L, L·u and with them its energy to rounding at any time step.
//! Damping sees the mass of the whole body at each of its spheres. Spheres of one clump do not touch each other.

use super::checkpoint::stored;
use super::particles::{Grain, Particles};
use super::setup::Vec3;
use super::vector::{Row4, Row8, add, cross, dot, length, scale, sub, xyz};
use std::f64::consts::PI;

/// Aspect up to which two spheres do; beyond it three leave a shallower waist.
const TWO: f64 = 1.6;

/// A row of spheres put into a world by hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clump {
    /// Radius of the sphere of the same volume [m].
    pub radius: f64,
    /// Length over width [-]; 1 is the sphere itself, at most 2.5.
    pub aspect: f64,
    /// Direction of the row, of any length.
    pub axis: Vec3,
    /// Centre of mass [m].
    pub position: Vec3,
    /// Velocity of the centre of mass [m/s].
    pub velocity: Vec3,
    /// Angular velocity [rad/s].
    pub spin: Vec3,
    /// Own sliding friction over the law's [-], usually 1.
    pub sliding_factor: f64,
    /// Own rolling friction over the law's [-], usually 1.
    pub rolling_factor: f64,
}

impl Clump {
    /// A clump at rest along x.
    pub fn new(radius: f64, aspect: f64, position: Vec3) -> Self {
        let (velocity, spin) = ([0.0; 3], [0.0; 3]);
        Self {
            radius,
            aspect,
            axis: [1.0, 0.0, 0.0],
            position,
            velocity,
            spin,
            sliding_factor: 1.0,
            rolling_factor: 1.0,
        }
    }
}

/// A row of unit spheres: what its shape alone decides.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Places of the centres along the axis, in radii.
    pub centres: Vec<f64>,
    /// Volume over that of one of the spheres [-].
    pub volume: f64,
    /// Moments of inertia about the axis and across it, over mass times radius squared [-].
    pub inertia: [f64; 2],
}

impl Row {
    /// The row of an aspect. With y² = 1 - (x - c)² the section's radius, c the nearest centre: V = π ∫ y² dx,
    /// I_a = π/2 ∫ y⁴ dx and I_t = π ∫ (y⁴/4 + x² y²) dx. Three points of Gauss are exact for these polynomials.
    pub fn new(aspect: f64) -> Self {
        let count = if aspect <= TWO { 2 } else { 3 };
        let spacing = 2.0 * (aspect - 1.0) / (count - 1) as f64;
        let middle = 0.5 * (count - 1) as f64;
        let centres: Vec<f64> = (0..count).map(|k| spacing * (k as f64 - middle)).collect();
        let half = 0.5 * spacing;
        let root = (0.6_f64).sqrt();
        let (mut volume, mut axial, mut transverse) = (0.0, 0.0, 0.0);
        for (k, centre) in centres.iter().enumerate() {
            let from = if k == 0 { -1.0 } else { -half };
            let to = if k + 1 == count { 1.0 } else { half };
            for (point, weight) in [(-root, 5.0 / 18.0), (0.0, 8.0 / 18.0), (root, 5.0 / 18.0)] {
                let local = 0.5 * (from + to) + 0.5 * (to - from) * point;
                let (x, square, share) = (centre + local, 1.0 - local * local, PI * weight * (to - from));
                volume += share * square;
                axial += share * 0.5 * square * square;
                transverse += share * (0.25 * square * square + x * x * square);
            }
        }
        Self { centres, volume: volume / (4.0 / 3.0 * PI), inertia: [axial / volume, transverse / volume] }
    }
}

impl Row {
    /// Radius of each of the spheres, for a clump with the volume of a sphere of this radius [m].
    pub fn sphere_radius(&self, radius: f64) -> f64 {
        radius / libm::cbrt(self.volume)
    }

    /// Mass felt by a push across the axis at the last centre over that of the clump, 1/(1 + m x²/I_t) [-]: the least that any
    /// push through a centre of its spheres feels.
    pub fn lightness(&self) -> f64 {
        let end = self.centres.last().copied().unwrap_or(0.0);
        1.0 / (1.0 + end * end / self.inertia[1])
    }
}

/// A clump in a running world.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its grains, by their place in the arrays.
    members: Vec<u32>,
    /// Their places along the axis [m].
    offsets: Vec<f64>,
    centre: Vec3,
    /// Unit vector along the row.
    axis: Vec3,
    /// Velocity at the half step before [m/s].
    velocity: Vec3,
    /// Angular momentum about the centre at the half step before [kg m²/s].
    momentum: Vec3,
    mass: f64,
    /// Moments of inertia about the axis and across it [kg m²].
    inertia: [f64; 2],
    /// Force and torque about the centre as last gathered.
    force: Vec3,
    torque: Vec3,
}

stored!(Body { members, offsets, centre, axis, velocity, momentum, mass, inertia, force, torque });

/// Marks a grain that belongs to no clump.
const FREE: u32 = u32::MAX;

/// All clumps of a world.
#[derive(Debug, Clone, Default)]
pub struct Clumps {
    bodies: Vec<Body>,
    /// Clump of every grain, by its place in the arrays; empty without clumps.
    owner: Vec<u32>,
}

stored!(Clumps { bodies, owner });

impl Clumps {
    /// Adds a clump and its spheres; one of aspect 1 is a grain like any other.
    pub fn push(&mut self, clump: &Clump, grains: &mut Particles, density: f64) {
        let Clump { velocity, spin, sliding_factor, rolling_factor, .. } = *clump;
        let sphere = Grain::new(clump.radius, clump.position);
        let whole = Grain { velocity, spin, sliding_factor, rolling_factor, ..sphere };
        if clump.aspect == 1.0 {
            grains.push(&whole, density);
            return;
        }
        let row = Row::new(clump.aspect);
        let radius = row.sphere_radius(clump.radius);
        let first = grains.len() as u32;
        grains.push(&whole, density);
        let mass = grains.mass(first as usize);
        for _ in 1..row.centres.len() {
            grains.push(&whole, density);
        }
        let axis = scale(clump.axis, 1.0 / length(clump.axis));
        let inertia = row.inertia.map(|factor| factor * mass * radius * radius);
        let along = dot(clump.spin, axis);
        let momentum = add(scale(clump.spin, inertia[1]), scale(axis, along * (inertia[0] - inertia[1])));
        let members: Vec<u32> = (first..grains.len() as u32).collect();
        for &i in &members {
            grains.set_radius(i as usize, radius);
            grains.inverse_inertia[i as usize] = 1.0 / inertia[1];
        }
        self.owner.resize(first as usize, FREE);
        self.owner.resize(grains.len(), self.bodies.len() as u32);
        let body = Body {
            members,
            offsets: row.centres.iter().map(|centre| centre * radius).collect(),
            centre: clump.position,
            axis,
            velocity: clump.velocity,
            momentum,
            mass,
            inertia,
            force: [0.0; 3],
            torque: [0.0; 3],
        };
        body.put_back(grains);
        self.bodies.push(body);
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Whether two grains belong to one clump.
    pub fn joins(&self, i: usize, j: usize) -> bool {
        let owner = |k: usize| self.owner.get(k).copied().unwrap_or(FREE);
        !self.is_empty() && owner(i) != FREE && owner(i) == owner(j)
    }

    /// The clump of a grain.
    pub fn of_grain(&self, i: usize) -> Option<&Body> {
        self.bodies.get(self.owner.get(i).copied().unwrap_or(FREE) as usize)
    }

    /// All clumps.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Whether every grain named is there.
    pub fn is_consistent(&self, grains: usize) -> bool {
        let known = |body: &Body| {
            let inside = body.members.iter().all(|&i| (i as usize) < grains);
            inside && body.members.len() == body.offsets.len() && !body.members.is_empty()
        };
        self.bodies.iter().all(known) && self.owner.len() <= grains
    }

    /// Gathers the loads of all members.
    pub fn gather(&mut self, load: &[Row8]) {
        self.bodies.iter_mut().for_each(|body| body.gather(load));
    }

    /// Kicks the clumps by a fraction of a step, without moving them.
    pub fn shift_velocities(&mut self, step: f64, gravity: Vec3, grains: &mut Particles) {
        for body in &mut self.bodies {
            body.kick(step, gravity);
            body.put_back(grains);
        }
    }

    /// One step of all clumps; whether a member has outrun its skin, given the rows (x, y, z, skin²) and the common drift.
    pub fn step(&mut self, step: f64, gravity: Vec3, grains: &mut Particles, bases: &[Row4], drift: Vec3) -> bool {
        let mut outrun = false;
        for body in &mut self.bodies {
            body.kick(step, gravity);
            body.drift(step);
            body.put_back(grains);
            for &i in &body.members {
                let (place, base) = (&grains.place[i as usize], &bases[i as usize]);
                let moved = sub(sub(xyz(place), xyz(base)), drift);
                let inside = dot(moved, moved) <= base[3];
                outrun |= !inside;
            }
        }
        outrun
    }

    /// How many grains of the kept clumps are more than one for each of them.
    pub fn surplus(&self, keep: &[bool]) -> usize {
        let kept = self.bodies.iter().filter(|body| keep[body.members[0] as usize]);
        kept.map(|body| body.members.len() - 1).sum()
    }

    /// A clump goes as a whole: where one of its grains is not kept, none is.
    pub fn keep_whole(&self, keep: &mut [bool]) {
        for body in &self.bodies {
            if !body.members.iter().all(|&i| keep[i as usize]) {
                body.members.iter().for_each(|&i| keep[i as usize] = false);
            }
        }
    }

    /// Takes over the new order of the grains; entry k of `order` is the old number of grain k.
    pub fn reorder(&mut self, order: &[u32], grains: usize) {
        if self.is_empty() {
            return;
        }
        let mut place = vec![FREE; grains];
        order.iter().enumerate().for_each(|(k, &old)| place[old as usize] = k as u32);
        self.bodies.retain_mut(|body| {
            body.members.iter_mut().for_each(|i| *i = place[*i as usize]);
            body.members[0] != FREE
        });
        self.owner.clear();
        self.owner.resize(order.len(), FREE);
        for (b, body) in self.bodies.iter().enumerate() {
            body.members.iter().for_each(|&i| self.owner[i as usize] = b as u32);
        }
    }
}

impl Body {
    /// Force ΣF and torque Σ (x - X) × F + T of the members, in their order.
    fn gather(&mut self, load: &[Row8]) {
        (self.force, self.torque) = self.load(load);
    }

    fn load(&self, load: &[Row8]) -> (Vec3, Vec3) {
        let (mut force, mut torque) = ([0.0; 3], [0.0; 3]);
        for (&i, &offset) in self.members.iter().zip(&self.offsets) {
            let row = &load[i as usize];
            let (f, t) = ([row[0], row[1], row[2]], [row[4], row[5], row[6]]);
            force = add(force, f);
            torque = add(torque, add(t, cross(scale(self.axis, offset), f)));
        }
        (force, torque)
    }

    fn kick(&mut self, step: f64, gravity: Vec3) {
        self.velocity = add(self.velocity, scale(add(scale(self.force, 1.0 / self.mass), gravity), step));
        self.momentum = add(self.momentum, scale(self.torque, step));
    }

    /// Moves the centre, and turns the axis by θ = L Δt/I_t: u + (θ × u + ½ θ × (θ × u))/(1 + θ²/4), which keeps |u| and L·u.
    fn drift(&mut self, step: f64) {
        self.centre = add(self.centre, scale(self.velocity, step));
        let angle = scale(self.momentum, step / self.inertia[1]);
        let turn = cross(angle, self.axis);
        let share = 1.0 / (1.0 + 0.25 * dot(angle, angle));
        let axis = add(self.axis, scale(add(turn, scale(cross(angle, turn), 0.5)), share));
        self.axis = scale(axis, 1.0 / length(axis));
    }

    /// ω = L/I_t + u (L·u) (1/I_a - 1/I_t) [rad/s].
    fn spin(&self, momentum: Vec3) -> Vec3 {
        let along = dot(momentum, self.axis) * (1.0 / self.inertia[0] - 1.0 / self.inertia[1]);
        add(scale(momentum, 1.0 / self.inertia[1]), scale(self.axis, along))
    }

    /// Places and velocities of the members.
    fn put_back(&self, grains: &mut Particles) {
        let spin = self.spin(self.momentum);
        for (&i, &offset) in self.members.iter().zip(&self.offsets) {
            let arm = scale(self.axis, offset);
            set(&mut grains.place[i as usize], add(self.centre, arm));
            set(&mut grains.motion[i as usize], add(self.velocity, cross(spin, arm)));
            set(&mut grains.spin[i as usize], spin);
        }
    }

    /// Velocity and angular momentum at the time of the positions, from the present loads.
    fn at_positions(&self, load: &[Row8], time_step: f64, gravity: Vec3) -> (Vec3, Vec3) {
        let ((force, torque), half) = (self.load(load), 0.5 * time_step);
        let velocity = add(self.velocity, scale(add(scale(force, 1.0 / self.mass), gravity), half));
        (velocity, add(self.momentum, scale(torque, half)))
    }

    /// Velocity of a place of the body, and angular velocity, at the time of the positions.
    pub fn velocities(&self, place: Vec3, load: &[Row8], time_step: f64, gravity: Vec3) -> (Vec3, Vec3) {
        let (velocity, momentum) = self.at_positions(load, time_step, gravity);
        let spin = self.spin(momentum);
        (add(velocity, cross(spin, sub(place, self.centre))), spin)
    }

    /// What the whole body has at the time of the positions.
    pub fn motion(&self, load: &[Row8], time_step: f64, gravity: Vec3) -> ClumpMotion {
        let (velocity, momentum) = self.at_positions(load, time_step, gravity);
        let spin = self.spin(momentum);
        ClumpMotion {
            mass: self.mass,
            centre: self.centre,
            axis: self.axis,
            velocity,
            momentum,
            rotational: 0.5 * dot(momentum, spin),
        }
    }

    /// Whether grain `i` is its first.
    pub fn begins_with(&self, i: usize) -> bool {
        self.members[0] as usize == i
    }

    /// Centre, and radius of the sphere of its volume [m].
    pub fn as_sphere(&self, density: f64) -> Row4 {
        let [x, y, z] = self.centre;
        Row4([x, y, z, libm::cbrt(self.mass / (density * 4.0 / 3.0 * PI))])
    }

    /// Number of spheres.
    pub fn len(&self) -> usize {
        self.members.len()
    }
}

/// A clump as a whole at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClumpMotion {
    /// Mass [kg].
    pub mass: f64,
    /// Centre of mass [m].
    pub centre: Vec3,
    /// Unit vector along the row.
    pub axis: Vec3,
    /// Velocity of the centre [m/s].
    pub velocity: Vec3,
    /// Angular momentum about the centre [kg m²/s].
    pub momentum: Vec3,
    /// Rotational energy ½ ω·L [J].
    pub rotational: f64,
}

fn set(row: &mut Row4, v: Vec3) {
    row[..3].copy_from_slice(&v);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Stream;

    /// Volume and moments of the union of spheres by counting random points, five standard errors.
    #[test]
    fn a_row_has_the_volume_and_the_moments_of_its_union() {
        for aspect in [1.0, 1.3, 1.6, 1.7, 2.2] {
            let row = Row::new(aspect);
            let mut stream = Stream::new(1, "clump");
            let (count, mut inside) = (200_000, Vec::new());
            for _ in 0..count {
                let x = aspect * stream.uniform_in(-1.0, 1.0);
                let (y, z) = (stream.uniform_in(-1.0, 1.0), stream.uniform_in(-1.0, 1.0));
                if row.centres.iter().any(|c| (x - c) * (x - c) + y * y + z * z < 1.0) {
                    inside.push([y * y + z * z, x * x + z * z]);
                }
            }
            let share = inside.len() as f64 / f64::from(count);
            let volume = share * 8.0 * aspect / (4.0 / 3.0 * PI);
            let error = ((1.0 - share) / inside.len() as f64).sqrt();
            assert!((volume / row.volume - 1.0).abs() < 5.0 * error, "{aspect}: {volume} for {}", row.volume);
            for (k, exact) in row.inertia.into_iter().enumerate() {
                let n = inside.len() as f64;
                let mean = inside.iter().map(|square| square[k]).sum::<f64>() / n;
                let variance = inside.iter().map(|square| (square[k] - mean) * (square[k] - mean)).sum::<f64>() / n;
                assert!((mean - exact).abs() < 5.0 * (variance / n).sqrt(), "{aspect}: {mean} for {exact}");
            }
        }
        assert!(Row::new(1.0).inertia.iter().all(|i| (i - 0.4).abs() < 1e-15));
    }
}
