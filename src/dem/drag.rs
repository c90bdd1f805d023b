//! Air drag: every grain alone in still air. A term of its own, so that a run without it does not pay for it.

use super::particles::Particles;
use super::vector::{dot, xyz};
use std::f64::consts::PI;

/// Adds F = −c π R² |v| v with c = ½ C_d ρ_air [kg/m³] to the load of every grain.
pub fn add(grains: &mut Particles, c: f64) {
    for ((place, motion), load) in grains.place.iter().zip(grains.motion.iter()).zip(&mut grains.load) {
        let v = xyz(motion);
        let factor = c * PI * place[3] * place[3] * dot(v, v).sqrt();
        for axis in 0..3 {
            load[axis] -= factor * v[axis];
        }
    }
}
