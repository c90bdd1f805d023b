//! One kick and drift of all grains: the velocity Verlet step in its leapfrog form.
//!
//! Takes loads, gives places and velocities; also tells whether a grain has outrun its skin, since its place is at hand here.
//! Two grains are moved at a time, their rows side by side in the widest vector.

use super::particles::Particles;
use super::setup::Vec3;
use super::vector::{Row4, Row8, dot};
use pulp::{Simd, WithSimd};
use std::hint::black_box;

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

/// Grains whose displacements are looked at together.
const GROUP: usize = 64;
/// A displacement is within the skin where no component times the root of this is beyond it, however these are rounded.
const CUBE: f64 = 3.0 * (1.0 + 1e-12);

impl WithSimd for Integration<'_> {
    /// Whether a grain has outrun its skin, or is not finite.
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        // Hidden from the compiler, which would take rows apart for the zeros in them.
        let zero = black_box(0.0);
        let row = |[x, y, z]: Vec3| [x, y, z, zero, x, y, z, zero];
        let step = Step {
            length: row([self.time_step; 3]),
            gravity: row(self.gravity),
            drift: row(self.drift),
            cube: row([CUBE; 3]),
        };
        let Particles { place, motion, spin, inverse_inertia, load, .. } = self.grains;
        let groups = place.chunks_mut(GROUP).zip(motion.chunks_mut(GROUP)).zip(spin.chunks_mut(GROUP));
        let groups =
            groups.zip(inverse_inertia.chunks(GROUP)).zip(load.chunks_mut(GROUP)).zip(self.bases.chunks(GROUP));
        let mut outrun = false;
        for (((((place, motion), spin), inverse_inertia), load), bases) in groups {
            outrun |= Group { place, motion, spin, inverse_inertia, load, bases }.advance(&step);
        }
        outrun
    }
}

/// Rows of consecutive grains.
struct Group<'a> {
    place: &'a mut [Row4],
    motion: &'a mut [Row4],
    spin: &'a mut [Row4],
    inverse_inertia: &'a [f64],
    load: &'a mut [Row8],
    bases: &'a [Row4],
}

impl Group<'_> {
    /// Moves the grains, and tells whether one has outrun its skin.
    #[inline(always)]
    fn advance(self, step: &Step) -> bool {
        let mut far = [false; 8];
        let (place, last_place) = self.place.as_chunks_mut();
        let (motion, last_motion) = self.motion.as_chunks_mut();
        let (spin, last_spin) = self.spin.as_chunks_mut();
        let (inverse_inertia, last_inverse_inertia) = self.inverse_inertia.as_chunks();
        let (load, last_load) = self.load.as_chunks_mut();
        let (base, last_base) = self.bases.as_chunks();
        let twos = place.iter_mut().zip(motion).zip(spin).zip(inverse_inertia).zip(load).zip(base);
        for (((((place, motion), spin), inverse_inertia), load), base) in twos {
            step.advance(Pair { place, motion, spin, inverse_inertia, load, base }, &mut far);
        }
        // An odd one is moved beside itself.
        let last = last_place.iter_mut().zip(last_motion).zip(last_spin).zip(last_load).zip(last_inverse_inertia);
        for (((((place, motion), spin), load), inverse_inertia), base) in last.zip(last_base) {
            let (mut places, mut motions, mut spins, mut loads) = ([*place; 2], [*motion; 2], [*spin; 2], [*load; 2]);
            let pair = Pair {
                place: &mut places,
                motion: &mut motions,
                spin: &mut spins,
                inverse_inertia: &[*inverse_inertia; 2],
                load: &mut loads,
                base: &[*base; 2],
            };
            step.advance(pair, &mut far);
            (*place, *motion, *spin, *load) = (places[0], motions[0], spins[0], loads[0]);
        }
        far.contains(&true) && !self.place.iter().zip(self.bases).all(|(place, base)| step.is_inside(place, base))
    }
}

/// Rows of two grains.
struct Pair<'a> {
    place: &'a mut [Row4; 2],
    motion: &'a mut [Row4; 2],
    spin: &'a mut [Row4; 2],
    inverse_inertia: &'a [f64; 2],
    load: &'a mut [Row8; 2],
    base: &'a [Row4; 2],
}

/// Numbers of two grains side by side.
type Two = [f64; 8];

#[inline(always)]
fn side_by_side([a, b]: &[Row4; 2]) -> Two {
    [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
}

#[inline(always)]
fn rows(x: Two) -> [Row4; 2] {
    [Row4([x[0], x[1], x[2], x[3]]), Row4([x[4], x[5], x[6], x[7]])]
}

/// One number of each grain in the place of all four.
#[inline(always)]
fn fourfold([a, b]: [f64; 2]) -> Two {
    [a, a, a, a, b, b, b, b]
}

/// What is the same for all grains, twice. The fourth number of each row of a grain stays as it is, because its step is zero, and is
/// within every cube.
struct Step {
    /// Time step [s].
    length: Two,
    /// Gravity [m/s²].
    gravity: Two,
    /// How far the common motion has carried the grains [m].
    drift: Two,
    /// [`CUBE`].
    cube: Two,
}

impl Step {
    /// Moves two grains; notes which components may be beyond a skin, as every one that is not a number may.
    #[inline(always)]
    fn advance(&self, grains: Pair, far: &mut [bool; 8]) {
        // Whole rows are read first and written last, so that the compiler may take two as one vector.
        let mut x = side_by_side(grains.place);
        let mut v = side_by_side(grains.motion);
        let mut w = side_by_side(grains.spin);
        let base = side_by_side(grains.base);
        let [a, b] = *grains.load;
        let force = [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]];
        let torque = [a[4], a[5], a[6], a[7], b[4], b[5], b[6], b[7]];
        let (inverse_mass, inverse_inertia) = (fourfold([v[3], v[7]]), fourfold(*grains.inverse_inertia));
        let skin = fourfold([base[3], base[7]]);
        for c in 0..8 {
            v[c] += self.length[c] * (force[c] * inverse_mass[c] + self.gravity[c]);
            w[c] += self.length[c] * (torque[c] * inverse_inertia[c]);
            x[c] += self.length[c] * v[c];
            let moved = x[c] - base[c] - self.drift[c];
            let within = moved * moved * self.cube[c] <= skin[c];
            far[c] |= !within;
        }
        (*grains.place, *grains.motion, *grains.spin) = (rows(x), rows(v), rows(w));
        *grains.load = [Row8::default(); 2];
    }

    /// Whether a grain is within its skin; one that is not a number is not.
    #[inline(always)]
    fn is_inside(&self, place: &Row4, base: &Row4) -> bool {
        let moved = [0, 1, 2].map(|c| place[c] - base[c] - self.drift[c]);
        dot(moved, moved) <= base[3]
    }
}

#[cfg(test)]
mod tests {
    use super::super::particles::Grain;
    use super::super::world::Vectors;
    use super::*;

    const SKIN: f64 = 1e-3;
    const TIME_STEP: f64 = 1e-4;
    const GRAVITY: Vec3 = [0.0, 0.0, -9.81];
    const DRIFT: Vec3 = [2e-4, 0.0, -1e-4];
    const WIDTHS: [Vectors; 3] = [Vectors::Widest, Vectors::Avx2, Vectors::Scalar];

    fn grains(count: usize) -> Particles {
        let mut grains = Particles::default();
        for i in 0..count {
            let x = i as f64;
            grains.push(
                &Grain { velocity: [0.1 * x, -0.2, 0.3], spin: [x, 2.0, -3.0], ..Grain::new(0.01, [x, 1.0, 2.0]) },
                2500.0,
            );
            grains.load[i] = Row8([0.1, 0.2 * x, 0.3, 0.0, 1e-4, -1e-4 * x, 2e-4, 0.0]);
        }
        grains
    }

    /// Bases from which the grains will have moved by the drift, and grain `i` by `moved` on top of it.
    fn bases(grains: &Particles, i: usize, moved: Vec3) -> Vec<Row4> {
        let mut after = grains.clone();
        step(&mut after, &vec![Row4::default(); grains.len()], Vectors::Scalar);
        let base = |place: &Row4| Row4([place[0] - DRIFT[0], place[1] - DRIFT[1], place[2] - DRIFT[2], SKIN * SKIN]);
        let mut bases: Vec<Row4> = after.place.iter().map(base).collect();
        (0..3).for_each(|c| bases[i][c] -= moved[c]);
        bases
    }

    fn step(grains: &mut Particles, bases: &[Row4], width: Vectors) -> bool {
        width.arch().dispatch(Integration { grains, bases, drift: DRIFT, gravity: GRAVITY, time_step: TIME_STEP })
    }

    /// Every grain moves by the same three lines, whether it has a neighbour in its vector or is the odd one of its group.
    #[test]
    fn every_grain_is_kicked_and_drifts() {
        for (count, width) in [1, 2, 64, 65, 131].into_iter().flat_map(|count| WIDTHS.map(|width| (count, width))) {
            let before = grains(count);
            let mut after = before.clone();
            step(&mut after, &vec![Row4::default(); count], width);
            for i in 0..count {
                let (load, motion, spin) = (before.load[i], before.motion[i], before.spin[i]);
                for c in 0..3 {
                    let v = motion[c] + TIME_STEP * (load[c] * motion[3] + GRAVITY[c]);
                    assert_eq!(after.motion[i][c], v);
                    assert_eq!(after.place[i][c], before.place[i][c] + TIME_STEP * v);
                    assert_eq!(after.spin[i][c], spin[c] + TIME_STEP * (load[c + 4] * before.inverse_inertia[i]));
                }
                let fourth = |grains: &Particles| [grains.place[i][3], grains.motion[i][3], grains.spin[i][3]];
                assert_eq!(fourth(&after), fourth(&before));
                assert_eq!(after.load[i], Row8::default());
            }
        }
    }

    /// A grain outruns its skin where it has moved farther than that, in whatever direction: a component beyond the cube in the
    /// skin is not enough.
    #[test]
    fn a_grain_outruns_its_skin_in_every_direction() {
        let directions = [[1.0, 0.0, 0.0], [0.0, -0.8, 0.6], [3f64.sqrt().recip(); 3]];
        for (count, i) in [(1, 0), (65, 63), (65, 64), (130, 129)] {
            for (direction, width) in
                directions.into_iter().flat_map(|direction| WIDTHS.map(|width| (direction, width)))
            {
                for (share, outrun) in [(0.9, false), (0.999, false), (1.001, true), (10.0, true)] {
                    let before = grains(count);
                    let bases = bases(&before, i, direction.map(|x| share * SKIN * x));
                    assert_eq!(
                        step(&mut before.clone(), &bases, width),
                        outrun,
                        "{share} {direction:?} of {i} in {count}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_grain_that_is_not_a_number_has_outrun_its_skin() {
        for (i, width) in [0, 1, 64].into_iter().flat_map(|i| WIDTHS.map(|width| (i, width))) {
            let mut grains = grains(65);
            let bases = bases(&grains, 0, [0.0; 3]);
            grains.load[i][1] = f64::NAN;
            assert!(step(&mut grains, &bases, width), "{i}");
        }
    }
}
