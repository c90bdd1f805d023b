//! The contact law on a batch of touching contacts: linear spring and dashpot, sliding and rolling springs.
//!
//! Takes the kinematics of up to [`LANES`] contacts, gives forces, torques and the new springs.
//! Knows neither lists nor walls: whoever fills the batch decides what a contact is. Source: Luding (2008) as implemented
//! in MercuryDPM; paper, section 3.1 and Table 4. The rolling dashpot is taken at the end of the step, see [`implicit`]. Loops carry no dependence between lanes and no branches, so that the compiler
//! may run them in vectors of any width: every lane sees the same operations in the same order, hence the same bits.

use super::setup::Vec3;
use super::vector::{Row4, Row8, add, cross, dot, scale, sub};

/// Contacts per batch. Large enough to hide the cost of filling, small enough to stay in the first-level cache.
pub const LANES: usize = 64;

/// Contacts per pass of the law: the widest vector. Passes of a fixed width leave no remainder for scalar code.
const WIDTH: usize = 8;

/// One number per contact.
pub type Lane = [f64; LANES];

/// Rows of the contacts in a batch as they come from the grains and lists: copied whole, because that is what a copy costs least.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Between grains: x_i - x_j [m] and R_i [m]. At a wall: unit normal, and overlap [m].
    pub between: [Row4; LANES],
    /// v_i - v_j [m/s] and R_j [m]. At a wall the last is R_i.
    pub velocity: [Row4; LANES],
    /// Angular velocity of `i` [rad/s] and inverse moment of inertia [1/(kg m²)].
    pub spin_i: [Row4; LANES],
    /// The same of `j`; 0 for a wall.
    pub spin_j: [Row4; LANES],
    /// γ_n [kg/s], rolling length D [m], sliding friction, rolling friction.
    pub constants: [Row4; LANES],
    /// Sliding spring ξ, 0, rolling spring ξ_r, 0 [m].
    pub springs: [Row8; LANES],
}

/// Contacts in flight, one lane per contact. `i` is the grain, `j` the other grain or the wall; the normal is from `j` to `i`.
#[derive(Debug, Clone)]
pub struct Batch {
    /// Where contacts are filled in.
    pub rows: Rows,
    /// Unit normal from `j` to `i`, and overlap δ, positive when touching [m].
    normal: [Lane; 4],
    /// Relative velocity of the centres [m/s], and a radius [m].
    velocity: [Lane; 4],
    /// Angular velocity [rad/s] and inverse moment of inertia [1/(kg m²)], 0 for a wall.
    spin_i: [Lane; 4],
    spin_j: [Lane; 4],
    constants: [Lane; 4],
    arm_i: Lane,
    arm_j: Lane,
    springs: [Lane; 8],
    /// Out: force on `i` [N].
    force: [Lane; 3],
    /// Out: torque on `i` [N m].
    torque_i: [Lane; 3],
    /// Out: torque on `j` [N m].
    torque_j: [Lane; 3],
}

/// Constants of one kind of contact (grain and grain, or grain and wall).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Normal stiffness k [N/m].
    pub normal: f64,
    /// Sliding stiffness k_s [N/m].
    pub sliding: f64,
    /// Rolling stiffness k_r [N/m].
    pub rolling: f64,
    /// 1 / k_s [m/N].
    pub sliding_compliance: f64,
    /// 1 / k_r [m/N].
    pub rolling_compliance: f64,
    /// γ_s / γ_n [-].
    pub sliding_damping_ratio: f64,
    /// γ_r / γ_n [-].
    pub rolling_damping_ratio: f64,
    /// Smallest normal force: 0 when clipped, else -∞ [N].
    pub floor: f64,
    /// Time step [s].
    pub time_step: f64,
}

impl Batch {
    /// An empty batch.
    pub fn new() -> Self {
        const ROWS: [Row4; LANES] = [Row4([0.0; 4]); LANES];
        const LANE: Lane = [0.0; LANES];
        const LONG: [Row8; LANES] = [Row8([0.0; 8]); LANES];
        let rows = Rows { between: ROWS, velocity: ROWS, spin_i: ROWS, spin_j: ROWS, constants: ROWS, springs: LONG };
        Self {
            rows,
            normal: [LANE; 4],
            velocity: [LANE; 4],
            spin_i: [LANE; 4],
            spin_j: [LANE; 4],
            constants: [LANE; 4],
            arm_i: LANE,
            arm_j: LANE,
            springs: [LANE; 8],
            force: [LANE; 3],
            torque_i: [LANE; 3],
            torque_j: [LANE; 3],
        }
    }

    /// Evaluates `count` contacts between grains.
    #[inline(always)]
    pub fn evaluate_pairs(&mut self, count: usize, law: &Coefficients) {
        let count = self.unpack(count);
        for base in (0..count).step_by(WIDTH) {
            normals(self, base);
            apply(self, base, law);
        }
    }

    /// Evaluates `count` contacts with walls.
    #[inline(always)]
    pub fn evaluate_walls(&mut self, count: usize, law: &Coefficients) {
        let count = self.unpack(count);
        for l in 0..count {
            self.arm_i[l] = self.velocity[3][l] - 0.5 * self.normal[3][l];
            self.arm_j[l] = 0.0;
        }
        for base in (0..count).step_by(WIDTH) {
            apply(self, base, law);
        }
    }

    /// Rows to lanes; gives the count rounded up to whole vectors, whose surplus lanes hold numbers of earlier contacts.
    #[inline(always)]
    fn unpack(&mut self, count: usize) -> usize {
        let count = count.next_multiple_of(WIDTH).min(LANES);
        unpack4(&self.rows.between, &mut self.normal, count);
        unpack4(&self.rows.velocity, &mut self.velocity, count);
        unpack4(&self.rows.spin_i, &mut self.spin_i, count);
        unpack4(&self.rows.spin_j, &mut self.spin_j, count);
        unpack4(&self.rows.constants, &mut self.constants, count);
        for l in 0..count {
            for c in 0..8 {
                self.springs[c][l] = self.rows.springs[l][c];
            }
        }
        count
    }

    /// Force and torque on `i` as a row of loads.
    #[inline(always)]
    pub fn load_i(&self, l: usize) -> Row8 {
        let (f, t) = (get(&self.force, l), get(&self.torque_i, l));
        Row8([f[0], f[1], f[2], 0.0, t[0], t[1], t[2], 0.0])
    }

    /// Force and torque on `j` as a row of loads.
    #[inline(always)]
    pub fn load_j(&self, l: usize) -> Row8 {
        let (f, t) = (get(&self.force, l), get(&self.torque_j, l));
        Row8([-f[0], -f[1], -f[2], 0.0, t[0], t[1], t[2], 0.0])
    }

    /// The new springs as a row.
    #[inline(always)]
    pub fn springs(&self, l: usize) -> Row8 {
        let s = &self.springs;
        Row8([s[0][l], s[1][l], s[2][l], 0.0, s[4][l], s[5][l], s[6][l], 0.0])
    }
}

#[inline(always)]
fn unpack4(rows: &[Row4; LANES], lanes: &mut [Lane; 4], count: usize) {
    let [a, b, c, d] = lanes;
    for l in 0..count.min(LANES) {
        let row = rows[l];
        a[l] = row[0];
        b[l] = row[1];
        c[l] = row[2];
        d[l] = row[3];
    }
}

#[inline(always)]
fn get(lanes: &[Lane], l: usize) -> Vec3 {
    [lanes[0][l], lanes[1][l], lanes[2][l]]
}

#[inline(always)]
fn put(lanes: &mut [Lane], l: usize, value: Vec3) {
    lanes[0][l] = value[0];
    lanes[1][l] = value[1];
    lanes[2][l] = value[2];
}

/// Normals n = d/|d|, overlaps δ = R_i + R_j - |d| and arms R - δ/2 of `WIDTH` contacts between grains from `base` on.
#[inline(always)]
fn normals(batch: &mut Batch, base: usize) {
    // The bound is always met; it tells the compiler that no index is out of range.
    let base = base.min(LANES - WIDTH);
    for l in base..base + WIDTH {
        let d = get(&batch.normal, l);
        let (radius_i, radius_j) = (batch.normal[3][l], batch.velocity[3][l]);
        let distance = dot(d, d).sqrt();
        let overlap = radius_i + radius_j - distance;
        put(&mut batch.normal, l, scale(d, 1.0 / distance));
        batch.normal[3][l] = overlap;
        batch.arm_i[l] = radius_i - 0.5 * overlap;
        batch.arm_j[l] = radius_j - 0.5 * overlap;
    }
}

/// Applies the law to `WIDTH` contacts from `base` on.
#[inline(always)]
fn apply(batch: &mut Batch, base: usize, law: &Coefficients) {
    let base = base.min(LANES - WIDTH);
    for l in base..base + WIDTH {
        let n = get(&batch.normal, l);
        let (arm_i, arm_j) = (batch.arm_i[l], batch.arm_j[l]);
        let (spin_i, spin_j) = (get(&batch.spin_i, l), get(&batch.spin_j, l));
        let [damping, length, sliding_friction, rolling_friction] = [0, 1, 2, 3].map(|c| batch.constants[c][l]);
        let slip = slip_velocity(get(&batch.velocity, l), spin_i, spin_j, arm_i, arm_j, n);
        let approach = dot(slip, n);
        let normal = normal_force(law, batch.normal[3][l], damping, approach);
        let slider = Slider {
            stiffness: law.sliding,
            compliance: law.sliding_compliance,
            damping: damping * law.sliding_damping_ratio,
            limit: sliding_friction * normal.abs(),
            time_step: law.time_step,
        };
        let tangential = sub(slip, scale(n, approach));
        let (friction, spring) = slider.pull(get(&batch.springs[..3], l), tangential, n);
        put(&mut batch.springs[..3], l, spring);
        let slider = Slider {
            stiffness: law.rolling,
            compliance: law.rolling_compliance,
            damping: implicit(
                damping * law.rolling_damping_ratio,
                length * length * (batch.spin_i[3][l] + batch.spin_j[3][l]),
                law.time_step,
            ),
            limit: rolling_friction * normal.abs(),
            time_step: law.time_step,
        };
        let rolling = roll_velocity(length, n, spin_i, spin_j);
        let (pseudo, spring) = slider.pull(get(&batch.springs[4..], l), rolling, n);
        put(&mut batch.springs[4..], l, spring);

        let lever = cross(n, friction);
        let couple = scale(cross(n, pseudo), length);
        put(&mut batch.force, l, add(scale(n, normal), friction));
        put(&mut batch.torque_i, l, sub(couple, scale(lever, arm_i)));
        put(&mut batch.torque_j, l, scale(add(couple, scale(lever, arm_j)), -1.0));
    }
}

/// Relative velocity at the contact point, v_i - v_j - (a_i ω_i + a_j ω_j) × n [m/s].
#[inline(always)]
fn slip_velocity(velocity: Vec3, spin_i: Vec3, spin_j: Vec3, arm_i: f64, arm_j: f64, n: Vec3) -> Vec3 {
    sub(velocity, cross(add(scale(spin_i, arm_i), scale(spin_j, arm_j)), n))
}

/// Rolling velocity v_r = -D n × (ω_i - ω_j) [m/s] (Luding 2008).
#[inline(always)]
fn roll_velocity(length: f64, n: Vec3, spin_i: Vec3, spin_j: Vec3) -> Vec3 {
    scale(cross(n, sub(spin_i, spin_j)), -length)
}

/// Damping of the rolling dashpot taken at the end of the step, γ / (1 + γ Δt (1/m)), with 1/m = D² (1/I_i + 1/I_j) [kg/s].
///
/// At a wall D = 2 R and the rate γ/m is eight times that between grains: at Δt = 0.15 t_c a grain in a corner would be past the
/// stability limit of an explicit dashpot, and its spin would flip sign every step for ever. The law is the same as Δt → 0.
#[inline(always)]
fn implicit(damping: f64, inverse_mass: f64, time_step: f64) -> f64 {
    damping / (1.0 + damping * inverse_mass * time_step)
}

/// Normal force F_n = k δ - γ v·n, positive when it pushes [N]; not below the law's floor.
#[inline(always)]
fn normal_force(law: &Coefficients, overlap: f64, damping: f64, approach: f64) -> f64 {
    let force = law.normal * overlap - damping * approach;
    if force < law.floor { law.floor } else { force }
}

/// A spring and a dashpot side by side, held by a Coulomb slider, in the tangent plane.
#[derive(Clone, Copy)]
struct Slider {
    stiffness: f64,
    compliance: f64,
    damping: f64,
    limit: f64,
    time_step: f64,
}

impl Slider {
    /// Force and new spring.
    ///
    /// The spring is turned with the contact by projection on the new tangent plane (its length errs by half the square of
    /// the angle turned in one step), then stretched by v Δt. The trial force -k ξ - γ v is cut to the limit; a cut spring is
    /// reset to -(F + γ v)/k, so that it holds exactly the force it gives.
    #[inline(always)]
    fn pull(self, spring: Vec3, velocity: Vec3, n: Vec3) -> (Vec3, Vec3) {
        let turned = sub(spring, scale(n, dot(spring, n)));
        let stretched = add(turned, scale(velocity, self.time_step));
        let drag = scale(velocity, self.damping);
        let trial = scale(add(scale(stretched, self.stiffness), drag), -1.0);
        let square = dot(trial, trial);
        let slides = square > self.limit * self.limit;
        let cut = if slides { self.limit / square.sqrt() } else { 1.0 };
        let force = scale(trial, cut);
        let reset = scale(add(force, drag), -self.compliance);
        let keep = |a: f64, b: f64| if slides { a } else { b };
        (force, [keep(reset[0], stretched[0]), keep(reset[1], stretched[1]), keep(reset[2], stretched[2])])
    }
}

#[cfg(test)]
mod tests {
    use super::super::vector::length;
    use super::*;

    const LAW: Coefficients = Coefficients {
        normal: 1e5,
        sliding: 3e4,
        rolling: 3e4,
        sliding_compliance: 1.0 / 3e4,
        rolling_compliance: 1.0 / 3e4,
        sliding_damping_ratio: 0.5,
        rolling_damping_ratio: 0.5,
        floor: f64::NEG_INFINITY,
        time_step: 1e-6,
    };
    const NORMAL: Vec3 = [0.0, 0.6, 0.8];

    fn slider(limit: f64, damping: f64) -> Slider {
        Slider { stiffness: 2.0, compliance: 0.5, damping, limit, time_step: 0.1 }
    }

    fn close(a: Vec3, b: Vec3) -> bool {
        length(sub(a, b)) < 1e-12
    }

    #[test]
    fn below_the_limit_the_spring_holds_and_the_dashpot_drags() {
        let (force, spring) = slider(10.0, 0.3).pull([1.0, 0.0, 0.0], [2.0, 0.0, 0.0], NORMAL);
        assert!(close(spring, [1.2, 0.0, 0.0]));
        assert!(close(force, [-(2.0 * 1.2 + 0.3 * 2.0), 0.0, 0.0]));
    }

    #[test]
    fn above_the_limit_the_force_is_cut_and_the_spring_holds_what_is_left() {
        let (force, spring) = slider(1.0, 0.3).pull([1.0, 0.0, 0.0], [2.0, 0.0, 0.0], NORMAL);
        assert!(close(force, [-1.0, 0.0, 0.0]));
        assert!(close(spring, [-(force[0] + 0.3 * 2.0) / 2.0, 0.0, 0.0]));
    }

    #[test]
    fn the_spring_stays_in_the_tangent_plane() {
        let (force, spring) = slider(10.0, 0.0).pull([1.0, 1.0, 1.0], [0.0; 3], NORMAL);
        assert!(dot(spring, NORMAL).abs() < 1e-15 && dot(force, NORMAL).abs() < 1e-15);
    }

    /// Two grains of equal size with 1 mm overlap, wound up far beyond both limits.
    fn evaluated() -> Batch {
        let (radius, overlap) = (0.01, 1e-3);
        let mut batch = Batch::new();
        let d = scale(NORMAL, 2.0 * radius - overlap);
        batch.rows.between[0] = Row4([d[0], d[1], d[2], radius]);
        batch.rows.velocity[0] = Row4([0.3, 0.0, 0.0, radius]);
        batch.rows.spin_i[0] = Row4([5.0, 1.0, -2.0, 1e6]);
        batch.rows.spin_j[0] = Row4([0.0, 0.0, 3.0, 1e6]);
        batch.rows.constants[0] = Row4([1.0, radius, 0.4, 0.2]);
        batch.rows.springs[0] = Row8([0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        batch.evaluate_pairs(1, &LAW);
        batch
    }

    /// Friction is limited to μ_s |F_n| and the rolling torque to μ_r |F_n| D, which is μ_r |F_n| R between equal spheres.
    #[test]
    fn friction_and_rolling_torque_meet_their_limits() {
        let batch = evaluated();
        let (i, j) = (batch.load_i(0), batch.load_j(0));
        let force = [i[0], i[1], i[2]];
        let normal = dot(force, NORMAL);
        let friction = sub(force, scale(NORMAL, normal));
        assert!((length(friction) / (0.4 * normal) - 1.0).abs() < 1e-12);
        // The torques of friction are equal on equal spheres, those of rolling opposite.
        let couple = [0, 1, 2].map(|c| 0.5 * (i[4 + c] - j[4 + c]));
        assert!((length(couple) / (0.2 * normal * 0.01) - 1.0).abs() < 1e-12);
    }

    /// Newton's third law to the bit, and no net torque about any point: T_i + T_j + (x_i - x_j) × F = 0.
    #[test]
    fn forces_cancel_and_torques_balance() {
        let batch = evaluated();
        let (i, j) = (batch.load_i(0), batch.load_j(0));
        assert!((0..3).all(|c| i[c] == -j[c]));
        let between = scale(NORMAL, 0.019);
        let net = add(add([i[4], i[5], i[6]], [j[4], j[5], j[6]]), cross(between, [i[0], i[1], i[2]]));
        assert!(length(net) < 1e-13, "{net:?}");
    }
}
