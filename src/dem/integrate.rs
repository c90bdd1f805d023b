//! One kick and drift of all grains: the velocity Verlet step in its leapfrog form.
//!
//! Takes loads, gives places and velocities; also tells whether a grain has outrun its skin, since its place is at hand here.

use super::particles::Particles;
use super::setup::Vec3;
use super::vector::{Row4, Row8};
use pulp::{Simd, WithSimd};

/// One integration step, run with the widest vectors of the machine.
pub struct Integration<'a> {
    /// Grains to move; their loads are cleared.
    pub grains: &'a mut Particles,
    /// Rows (x, y, z, skin²) from which displacement counts.
    pub bases: &'a [Row4],
    /// How far the common motion has carried the grains since then [m].
    pub drift: Vec3,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// Time step [s].
    pub time_step: f64,
}

impl WithSimd for Integration<'_> {
    /// Whether a grain has outrun its skin, or is not finite.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let [gx, gy, gz] = self.gravity;
        let gravity = [gx, gy, gz, 0.0];
        let drift = [self.drift[0], self.drift[1], self.drift[2], 0.0];
        // The fourth number of each row stays as it is, because its step is zero.
        let step = [self.time_step, self.time_step, self.time_step, 0.0];
        let Particles { place, motion, spin, inverse_inertia, load, .. } = self.grains;
        let rows = place.iter_mut().zip(motion).zip(spin).zip(inverse_inertia).zip(load).zip(self.bases);
        let mut outrun = false;
        for (((((place, motion), spin), inverse_inertia), load), base) in rows {
            // Whole rows are read first and written last, so that the compiler may take each as one vector.
            let (mut x, mut v, mut w, f, from) = (place.0, motion.0, spin.0, load.0, base.0);
            let (inverse_mass, inverse_inertia) = (v[3], *inverse_inertia);
            let mut moved = [0.0; 4];
            for c in 0..4 {
                v[c] += step[c] * (f[c] * inverse_mass + gravity[c]);
                w[c] += step[c] * (f[c + 4] * inverse_inertia);
                x[c] += step[c] * v[c];
                moved[c] = x[c] - from[c] - drift[c];
            }
            (place.0, motion.0, spin.0) = (x, v, w);
            *load = Row8::default();
            // Written so that a NaN counts as outrun.
            let inside = moved[0] * moved[0] + moved[1] * moved[1] + moved[2] * moved[2] <= from[3];
            outrun |= !inside;
        }
        outrun
    }
}
