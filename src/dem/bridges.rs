//! Liquid bridges after Willett et al. (2000): attraction that forms on contact and lasts over a gap until it breaks.
//!
//! F(s) = F₀ / (1 + 1.05 ŝ + 2.5 ŝ²) with ŝ = s √(R/V) and s the full gap; F = F₀ = 2π R γ cosθ while touching.
//! R = 2 R_i R_j / (R_i + R_j), or 2 R_i at a wall. Breaks at s_c = R (1 + θ/2) (V*^⅓ + 0.1 V*^⅔) with V* = V / R³.
//! The strength is given as Bond number at the mean radius, Bo = 2π R̄ γ cosθ / (m̄ g), so F₀ = Bo m̄ g R / R̄.
//! A term of its own, called once per evaluation on the whole list; the contact law and its friction limit do not know it.

use super::lists::{PairList, WallList};
use super::material::sphere_mass;
use super::particles::{Particles, touch};
use super::setup::{LiquidBridges, Setup, Vec3};
use super::vector::{Row8, length, scale, sub, xyz};
use super::walls::{Geometry, WallPiece, keeper};

/// The law in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bridges {
    /// F₀ / R [N/m].
    force_per_length: f64,
    /// 1 / √V* [-].
    stretch: f64,
    /// s_c / R [-].
    rupture: f64,
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
        }
    }

    /// Gap at which the bridge breaks [m], for R [m].
    pub fn rupture_gap(&self, size: f64) -> f64 {
        self.rupture * size
    }

    /// Attraction [N] at a gap [m] for R [m]; a negative gap is an overlap.
    #[inline]
    pub fn force(&self, gap: f64, size: f64) -> f64 {
        let stretch = if gap > 0.0 { gap / size * self.stretch } else { 0.0 };
        self.force_per_length * size / (1.0 + 1.05 * stretch + 2.5 * stretch * stretch)
    }

    /// Force of a bridge that exists or forms now; `None` where it breaks.
    fn pull(&self, gap: f64, size: f64, touches: bool) -> Option<f64> {
        (touches || gap < self.rupture_gap(size)).then(|| self.force(gap, size))
    }
}

/// Adds the bridges between grains.
pub fn add_pairs(grains: &mut Particles, list: &mut PairList, law: &Bridges) {
    for (k, &[i, j]) in list.ends.iter().enumerate().take(list.len()) {
        let (a, b) = (&grains.place[i as usize], &grains.place[j as usize]);
        let touches = touch(a, b);
        if !touches && !list.entries.bridge[k] {
            continue;
        }
        let between = sub(xyz(a), xyz(b));
        let distance = length(between);
        let pull = law.pull(distance - a[3] - b[3], list.entries.length(k), touches);
        list.entries.bridge[k] = pull.is_some();
        if let Some(force) = pull {
            let force = scale(between, force / distance);
            add_force(&mut grains.load[i as usize], scale(force, -1.0));
            add_force(&mut grains.load[j as usize], force);
        }
    }
}

/// Adds the bridges to walls; a contact dropped at a joint follows the piece that is kept, and pulls nothing of its own.
pub fn add_walls(grains: &mut Particles, list: &mut WallList, walls: &[WallPiece], law: &Bridges) {
    for (w, wall) in walls.iter().enumerate() {
        for entry in list.of_wall(w) {
            let grain = list.grain[entry];
            let place = grains.place[grain as usize];
            let near = wall.surface.near(xyz(&place));
            let touches = place[3] - near.distance > 0.0;
            if !touches && !list.entries.bridge[entry] {
                continue;
            }
            let kept = if near.edge { keeper(walls, w, xyz(&place), &near) } else { None };
            if let Some(kept) = kept.and_then(|kept| list.find(kept, grain)) {
                list.entries.bridge[entry] = list.entries.bridge[kept];
                continue;
            }
            let pull = law.pull(near.distance - place[3], list.entries.length(entry), touches);
            list.entries.bridge[entry] = pull.is_some();
            if let Some(force) = pull {
                add_force(&mut grains.load[grain as usize], scale(near.normal, -force));
            }
        }
    }
}

#[inline(always)]
fn add_force(load: &mut Row8, force: Vec3) {
    for c in 0..3 {
        load[c] += force[c];
    }
}
