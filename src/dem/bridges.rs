//! Liquid bridges after Willett et al. (2000): attraction that forms on contact and lasts over a gap until it breaks.
//!
//! F(s) = F₀ / (1 + 1.05 ŝ + 2.5 ŝ²) with ŝ = s √(R/V) and s the full gap; F = F₀ = 2π R γ cosθ while touching.
//! R = 2 R_i R_j / (R_i + R_j), or 2 R_i at a wall. Breaks at s_c = R (1 + θ/2) (V*^⅓ + 0.1 V*^⅔) with V* = V / R³.
//! The strength is given as Bond number at the mean radius, Bo = 2π R̄ γ cosθ / (m̄ g), so F₀ = Bo m̄ g R / R̄; at walls
//! times a ratio of their own, 0 where they stay dry.
//! A term of its own, called once per evaluation on the whole list; the contact law and its friction limit do not know it.

use super::lanes::{Lanes, Mask, Number, Transposer, WIDTH};
use super::lists::{PairList, Rivals, WallList};
use super::material::sphere_mass;
use super::particles::Particles;
use super::setup::{LiquidBridges, Setup, Vec3};
use super::vector::{Row8, dot, length, pick, scale, splat, sub, xyz};
use super::walls::{Geometry, WallPiece, keeper};
use pulp::{Simd, WithSimd};

/// The law in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bridges {
    /// F₀ / R [N/m].
    force_per_length: f64,
    /// 1 / √V* [-].
    stretch: f64,
    /// s_c / R [-].
    rupture: f64,
    /// Force at walls over that between grains of the same R [-].
    wall: f64,
}

impl Bridges {
    /// The law of a setup; `None` where bridges are absent or their Bond number is 0.
    pub fn new(setup: &Setup) -> Option<Self> {
        setup.bridges.filter(|bridges| bridges.bond_number > 0.0).map(|bridges| Self::of(&bridges, setup))
    }

    fn of(bridges: &LiquidBridges, setup: &Setup) -> Self {
        let radius = setup.grains.size.mean();
        let weight = sphere_mass(setup.grains.density, radius) * length(setup.gravity);
        let root = libm::cbrt(bridges.volume_ratio);
        Self {
            force_per_length: bridges.bond_number * weight / radius,
            stretch: 1.0 / bridges.volume_ratio.sqrt(),
            rupture: (1.0 + 0.5 * bridges.contact_angle) * (root + 0.1 * root * root),
            wall: bridges.wall_ratio,
        }
    }

    /// Gap at which the bridge breaks [m], for R [m].
    pub fn rupture_gap(&self, size: f64) -> f64 {
        self.rupture * size
    }

    /// Attraction [N] at a gap [m] for R [m]; a negative gap is an overlap.
    #[inline(always)]
    pub fn force<T: Number>(&self, gap: T, size: T) -> T {
        let zero = gap.splat(0.0);
        let stretch = T::pick(zero.less(gap), gap / size * zero.splat(self.stretch), zero);
        let weakening = zero.splat(1.0) + zero.splat(1.05) * stretch + zero.splat(2.5) * stretch * stretch;
        zero.splat(self.force_per_length) * size / weakening
    }

    /// Force of a bridge that exists or forms now; `None` where it breaks.
    fn pull(&self, gap: f64, size: f64, touches: bool) -> Option<f64> {
        (touches || gap < self.rupture_gap(size)).then(|| self.force(gap, size))
    }
}

/// Bridges between grains, evaluated with the widest vectors of the machine.
pub struct PairBridges<'a> {
    /// Grains, whose loads are added to.
    pub grains: &'a mut Particles,
    /// Listed pairs.
    pub list: &'a mut PairList,
    /// How far below itself the second grain is seen [m].
    pub shift: Vec3,
    /// The law.
    pub law: &'a Bridges,
}

impl WithSimd for PairBridges<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let blocks = self.list.entries.blocks.len();
        for (block, part) in (0..blocks).flat_map(|block| (0..WIDTH / S::F64_LANES).map(move |part| (block, part))) {
            self.add(simd, block, part);
        }
    }
}

impl PairBridges<'_> {
    /// Adds the bridges of one vector of pairs.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, block: usize, part: usize) {
        let first = block * WIDTH + part * S::F64_LANES;
        let ends = &self.list.ends[first..first + S::F64_LANES];
        let filled = Lanes::filled(simd, part, self.list.len() - block * WIDTH);
        let (transposer, place) = (Transposer(simd), &self.grains.place);
        let [x, y, z, radius_i] = transposer.gather(|l| *place[ends[l][0] as usize]);
        let [u, v, w, radius_j] = transposer.gather(|l| *place[ends[l][1] as usize]);
        let between = sub([x, y, z], sub([u, v, w], splat(u, self.shift)));
        let (square, sum, zero) = (dot(between, between), radius_i + radius_j, Lanes::zero(simd));
        let touches = square.less(sum * sum) & filled;
        let bridge = &mut self.list.entries.bridge[block];
        let candidates = touches | zero.less(Lanes::load(simd, bridge, part));
        if !candidates.any() {
            return;
        }
        let distance = square.sqrt();
        let gap = distance - radius_i - radius_j;
        let size = Lanes::load(simd, &self.list.entries.blocks[block].constants[2], part);
        let exists = candidates & (touches | gap.less(zero.splat(self.law.rupture) * size));
        Lanes::pick(exists, zero.splat(1.0), zero).store(bridge, part);
        let force = scale(between, self.law.force(gap, size) / distance);
        let rows = transposer.rows(pick(exists, force, [zero; 3]));
        for (l, &[i, j]) in ends.iter().enumerate() {
            let [x, y, z, _] = *rows.of(l);
            add_force(&mut self.grains.load[i as usize], [-x, -y, -z, 0.0]);
            add_force(&mut self.grains.load[j as usize], [x, y, z, 0.0]);
        }
    }
}

/// Adds the bridges to walls; a contact dropped at a joint follows the piece that is kept, and pulls nothing of its own.
pub fn add_walls(grains: &mut Particles, list: &mut WallList, rivals: &Rivals, walls: &[WallPiece], law: &Bridges) {
    for (w, wall) in walls.iter().enumerate() {
        for entry in list.of_wall(w) {
            let grain = list.grain[entry];
            let place = grains.place[grain as usize];
            let near = wall.surface.near(xyz(&place));
            let touches = place[3] - near.distance > 0.0;
            if !touches && !list.entries.has_bridge(entry) {
                continue;
            }
            let kept = if near.edge { keeper(walls, rivals.of_grain(grain), w, xyz(&place), &near) } else { None };
            if let Some(kept) = kept.and_then(|kept| list.find(kept, grain)) {
                let exists = list.entries.has_bridge(kept);
                list.entries.set_bridge(entry, exists);
                continue;
            }
            let pull = law.pull(near.distance - place[3], list.entries.length(entry), touches);
            list.entries.set_bridge(entry, pull.is_some());
            if let Some(force) = pull {
                let [x, y, z] = scale(near.normal, -law.wall * force);
                add_force(&mut grains.load[grain as usize], [x, y, z, 0.0]);
            }
        }
    }
}

/// All four numbers, the last of them zero: a row written in pieces stalls whoever reads it next.
#[inline(always)]
fn add_force(load: &mut Row8, force: [f64; 4]) {
    for c in 0..4 {
        load[c] += force[c];
    }
}
