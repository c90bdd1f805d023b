//! The grains of a running world: rows of four numbers, one array per kind of row.
//!
//! A contact reads a grain's whole row at once, so rows of 32 bytes beat one array per component; the state that leaves the
//! engine is structure of arrays. Velocities are those of the half step before the positions (leapfrog form of velocity Verlet).

use super::checkpoint::stored;
use super::material::sphere_mass;
use super::setup::Vec3;
use super::vector::{AlignedRows, Row4, Row8, dot, sub, xyz};

/// A grain put into a world by hand or by the insertion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Radius [m].
    pub radius: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Angular velocity [rad/s].
    pub spin: Vec3,
    /// Own sliding friction over the law's [-], usually 1.
    pub sliding_factor: f64,
    /// Own rolling friction over the law's [-], usually 1.
    pub rolling_factor: f64,
    /// Own density over the setup's [-], usually 1.
    pub density_factor: f64,
}

impl Grain {
    /// A grain at rest.
    pub fn new(radius: f64, position: Vec3) -> Self {
        let at_rest = [0.0; 3];
        let factors = 1.0;
        Self {
            radius,
            position,
            velocity: at_rest,
            spin: at_rest,
            sliding_factor: factors,
            rolling_factor: factors,
            density_factor: factors,
        }
    }
}

/// All grains, one entry per grain in every array, in the order of the last rebuild.
#[derive(Debug, Clone, Default)]
pub struct Particles {
    /// Centre and radius: x, y, z, R [m].
    pub place: AlignedRows,
    /// Velocity [m/s] and inverse mass [1/kg].
    pub motion: AlignedRows,
    /// Angular velocity [rad/s] and, again, the radius R [m]: a contact needs both at once.
    pub spin: AlignedRows,
    /// Inverse moment of inertia, 5/(2 m R²) for a sphere [1/(kg m²)].
    pub inverse_inertia: Vec<f64>,
    /// Force [N], 0, torque [N m], 0.
    pub load: Vec<Row8>,
    /// Own sliding and rolling friction over the law's [-].
    pub friction: Vec<[f64; 2]>,
    /// Number in order of insertion.
    pub id: Vec<u32>,
}

stored!(Particles { place, motion, spin, inverse_inertia, load, friction, id });

impl Particles {
    /// Whether every array has one entry per grain.
    pub fn is_consistent(&self) -> bool {
        let Self { place, motion, spin, inverse_inertia, load, friction, id } = self;
        let lengths = [motion.len(), spin.len(), inverse_inertia.len(), load.len(), friction.len(), id.len()];
        lengths == [place.len(); 6]
    }

    /// Number of grains.
    pub fn len(&self) -> usize {
        self.place.len()
    }

    /// Appends a grain; its number is the count so far.
    pub fn push(&mut self, grain: &Grain, density: f64) {
        let mass = sphere_mass(density * grain.density_factor, grain.radius);
        let inertia = 0.4 * mass * grain.radius * grain.radius;
        let row = |v: Vec3, last: f64| Row4([v[0], v[1], v[2], last]);
        self.id.push(self.len() as u32);
        self.place.push(row(grain.position, grain.radius));
        self.motion.push(row(grain.velocity, 1.0 / mass));
        self.spin.push(row(grain.spin, grain.radius));
        self.inverse_inertia.push(1.0 / inertia);
        self.load.push(Row8::default());
        self.friction.push([grain.sliding_factor, grain.rolling_factor]);
    }

    /// Whether any grain has a friction of its own.
    pub fn differ_in_friction(&self) -> bool {
        self.friction.iter().any(|factors| *factors != [1.0; 2])
    }

    /// Mass of grain `i` [kg].
    pub fn mass(&self, i: usize) -> f64 {
        1.0 / self.motion[i][3]
    }

    /// Changes the radius of grain `i` [m], and nothing that follows from it.
    pub fn set_radius(&mut self, i: usize, radius: f64) {
        self.place[i][3] = radius;
        self.spin[i][3] = radius;
    }

    /// Becomes `other`'s grains in the given order, keeping only those listed.
    pub fn gather(&mut self, other: &Self, order: &[u32]) {
        self.place.refill(order.iter().map(|&k| other.place[k as usize]));
        self.motion.refill(order.iter().map(|&k| other.motion[k as usize]));
        self.spin.refill(order.iter().map(|&k| other.spin[k as usize]));
        gather(&mut self.inverse_inertia, &other.inverse_inertia, order);
        gather(&mut self.load, &other.load, order);
        gather(&mut self.friction, &other.friction, order);
        gather(&mut self.id, &other.id, order);
    }
}

/// Whether two grains touch, |x_i - x_j|² < (R_i + R_j)², from rows (x, y, z, R).
#[inline(always)]
pub fn touch(a: &Row4, b: &Row4) -> bool {
    let (between, sum) = (sub(xyz(a), xyz(b)), a[3] + b[3]);
    dot(between, between) < sum * sum
}

fn gather<T: Copy>(target: &mut Vec<T>, source: &[T], order: &[u32]) {
    target.clear();
    target.extend(order.iter().map(|&k| source[k as usize]));
}
