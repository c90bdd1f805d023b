//! How far ahead the contact lists look: a skin for every grain from its own speed, and when the lists have expired.
//!
//! A pair is listed when its gap is below the sum of the two skins; the lists hold as long as no grain has moved farther than its
//! skin. Motion common to all grains (a falling cloud) is taken off first, since it changes no gap between grains; for
//! walls it is added as an allowance, together with the motion of the walls themselves, and the lists expire when that is used up.

use super::checkpoint::Stored;
use super::particles::Particles;
use super::setup::Vec3;
use super::vector::{AlignedRows, Row4, dot, length, scale, sub, xyz};
use super::walls::WallPiece;

/// What a rebuild costs over what listing pairs in vain costs, see [`Skin::horizon`]; the run time is flat from 2 to 8.
const BALANCE: f64 = 4.0;
/// Fewest and most steps that a skin should last.
const HORIZON: [f64; 2] = [20.0, 1000.0];
/// Share of the root mean square speed added to every grain's own: a slow grain may be hit by a fast one.
const SHARE: f64 = 0.3;
/// Smallest skin over mean radius.
const FLOOR: f64 = 2e-3;
/// Largest skin over mean radius: beyond it more frequent rebuilds are cheaper than longer lists. Flat from 0.5 to 1.
const CAP: f64 = 0.8;

/// Skins and the places from which displacement counts.
#[derive(Debug, Clone)]
pub struct Skin {
    /// Place at the last rebuild and square of the skin, in the order of the grains.
    base: AlignedRows,
    spare: Vec<f64>,
    skin: Vec<f64>,
    floor: f64,
    cap: f64,
    time_step: f64,
    mean_radius: f64,
    /// Mean velocity at the last rebuild [m/s].
    drift: Vec3,
    /// Allowance for motion against walls [m].
    allowance: f64,
    age: u64,
    lifetime: u64,
}

impl Skin {
    /// Skins for grains of this mean radius [m].
    pub fn new(mean_radius: f64, time_step: f64) -> Self {
        Self {
            base: AlignedRows::default(),
            spare: Vec::new(),
            skin: Vec::new(),
            floor: FLOOR * mean_radius,
            cap: CAP * mean_radius,
            time_step,
            mean_radius,
            drift: [0.0; 3],
            allowance: 0.0,
            age: 0,
            lifetime: u64::MAX,
        }
    }

    /// Appends what does not follow from the set-up.
    pub fn store(&self, out: &mut Vec<u8>) {
        self.base.put(out);
        self.skin.put(out);
        self.drift.put(out);
        self.allowance.put(out);
        self.age.put(out);
        self.lifetime.put(out);
    }

    /// Takes back what [`Skin::store`] appended; `None` where the bytes do not fit this number of grains.
    pub fn restore(&mut self, grains: usize, input: &mut &[u8]) -> Option<()> {
        self.base = Stored::take(input)?;
        self.skin = Stored::take(input)?;
        self.drift = Stored::take(input)?;
        self.allowance = Stored::take(input)?;
        self.age = Stored::take(input)?;
        self.lifetime = Stored::take(input)?;
        (self.base.len() == grains && self.skin.len() == grains).then_some(())
    }

    /// One step has begun.
    pub fn age(&mut self) {
        self.age += 1;
    }

    /// Whether the motion common to all grains, or of a wall, has used up its allowance.
    pub fn expired(&self) -> bool {
        self.age >= self.lifetime
    }

    /// How far the common motion has carried the grains since the rebuild [m].
    pub fn offset(&self) -> Vec3 {
        scale(self.drift, self.age as f64 * self.time_step)
    }

    /// Rows (x, y, z, skin²) from which displacement counts.
    pub fn bases(&self) -> &[Row4] {
        &self.base
    }

    /// How far from touching a wall grain `i` may be and still be listed [m].
    pub fn wall_margin(&self, i: usize) -> f64 {
        self.skin[i] + self.allowance
    }

    /// Computes skins for the grains as they are, and gives the largest reach R (1 + rupture/2) + skin [m].
    pub fn renew(&mut self, grains: &Particles, walls: &[WallPiece], rupture: f64) -> f64 {
        self.age = 0;
        let share = 1.0 / grains.len().max(1) as f64;
        let total = grains.motion.iter().fold([0.0; 3], |sum, v| [sum[0] + v[0], sum[1] + v[1], sum[2] + v[2]]);
        self.drift = scale(total, share);
        let speed = |motion: &Row4| length(sub(xyz(motion), self.drift));
        let square: f64 = grains.motion.iter().map(|motion| speed(motion) * speed(motion)).sum();
        let common = SHARE * (square * share).sqrt();
        let mean = grains.motion.iter().map(speed).sum::<f64>() * share;
        let horizon = self.horizon(mean + common);
        let ahead = horizon * self.time_step;
        self.spare.clear();
        for motion in grains.motion.iter() {
            self.spare.push((ahead * (speed(motion) + common)).clamp(self.floor, self.cap));
        }
        self.allow(walls, horizon);
        let reach = |(skin, place): (&f64, &Row4)| place[3] * (1.0 + 0.5 * rupture) + skin;
        self.spare.iter().zip(grains.place.iter()).map(reach).fold(self.floor, f64::max)
    }

    /// Steps that skins should last at this mean speed v [m/s]: H = √(b R / (v Δt)). Rebuilds cost ∝ 1/H a step and pairs
    /// listed in vain ∝ H v Δt / R, so this H makes their sum least: tens of steps in a flow, hundreds in a bed at rest, whose
    /// few grains that rattle would else force one rebuild after the other.
    fn horizon(&self, speed: f64) -> f64 {
        (BALANCE * self.mean_radius / (speed * self.time_step)).sqrt().clamp(HORIZON[0], HORIZON[1])
    }

    /// Allowance and lifetime from the drift and the fastest wall.
    fn allow(&mut self, walls: &[WallPiece], horizon: f64) {
        let fastest =
            walls.iter().filter(|wall| wall.active).map(|wall| dot(wall.velocity, wall.velocity)).fold(0.0, f64::max);
        let travel = (length(self.drift) + fastest.sqrt()) * self.time_step;
        self.allowance = (horizon * travel).max(self.floor);
        // A float too large for the integer saturates, and no motion at all gives a list that lasts for ever.
        self.lifetime = (self.allowance / travel) as u64;
    }

    /// Takes the skins into the new order of the grains, and their places as the base.
    pub fn reorder(&mut self, grains: &Particles, order: &[u32]) {
        let Self { base, spare, skin, .. } = self;
        skin.clear();
        skin.extend(order.iter().map(|&k| spare[k as usize]));
        base.refill(grains.place.iter().zip(&*skin).map(|(p, s)| Row4([p[0], p[1], p[2], s * s])));
    }

    /// Rows (x, y, z, reach) for the search of pairs.
    pub fn reaches(&self, place: &[Row4], rupture: f64, rows: &mut Vec<Row4>) {
        rows.clear();
        let reach = |radius: f64, skin: f64| radius * (1.0 + 0.5 * rupture) + skin;
        rows.extend(place.iter().zip(&self.skin).map(|(p, &s)| Row4([p[0], p[1], p[2], reach(p[3], s)])));
    }
}
