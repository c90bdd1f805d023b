//! The contact law: linear spring and dashpot, sliding and rolling springs.
//!
//! Takes the kinematics of a contact, gives force, torques and the new springs, for one contact or for a vector of them.
//! Knows neither lists nor walls: whoever calls it decides what a contact is. Source: Luding (2008) as implemented
//! in MercuryDPM; paper, section 3.1 and Table 4. The rolling dashpot is taken at the end of the step, see [`implicit`].

use super::lanes::{Mask, Number};
use super::vector::{add, cross, dot, minus, pick, scale, sub};

/// Contacts as they move; `i` is the grain, `j` the other grain or the wall, which has neither arm nor spin.
#[derive(Debug, Clone, Copy)]
pub struct Kinematics<T> {
    /// Unit normal from `j` to `i`.
    pub normal: [T; 3],
    /// Overlap δ, positive when touching [m].
    pub overlap: T,
    /// Relative velocity of the centres, v_i - v_j [m/s].
    pub velocity: [T; 3],
    /// Angular velocities [rad/s].
    pub spin_i: [T; 3],
    /// The same of `j`.
    pub spin_j: [T; 3],
    /// Distances from the centres to the contact point, R - δ/2 [m].
    pub arm_i: T,
    /// The same of `j`.
    pub arm_j: T,
}

/// What a contact needs besides its motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants<T = f64> {
    /// γ_n [kg/s].
    pub damping: T,
    /// γ_r as taken at the end of the step, see [`implicit`] [kg/s].
    pub rolling_damping: T,
    /// Rolling length D [m].
    pub length: T,
}

/// Friction of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction<T = f64> {
    /// Sliding friction μ_s [-].
    pub sliding: T,
    /// Rolling friction μ_r [-].
    pub rolling: T,
}

/// Springs of a contact [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Springs<T = f64> {
    /// Sliding spring ξ.
    pub sliding: [T; 3],
    /// Rolling spring ξ_r.
    pub rolling: [T; 3],
}

/// What a contact does.
#[derive(Debug, Clone, Copy)]
pub struct Response<T> {
    /// Force on `i`; that on `j` is its opposite [N].
    pub force: [T; 3],
    /// Torque on `i` [N m].
    pub torque_i: [T; 3],
    /// Opposite of the torque on `j` [N m].
    pub counter_torque_j: [T; 3],
    /// The springs at the end of the step.
    pub springs: Springs<T>,
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

/// Applies the law. Branches only on whether any contact slides, which changes no bit.
#[inline(always)]
pub fn respond<T: Number>(
    contact: &Kinematics<T>,
    constants: &Constants<T>,
    friction: &Friction<T>,
    springs: &Springs<T>,
    law: &Coefficients,
) -> Response<T> {
    let Kinematics { normal: n, overlap, velocity, spin_i, spin_j, arm_i, arm_j } = *contact;
    let like = overlap;
    let slip = slip_velocity(velocity, spin_i, spin_j, arm_i, arm_j, n);
    let approach = dot(slip, n);
    let normal = normal_force(law, overlap, constants.damping, approach);
    let slider = Slider {
        stiffness: like.splat(law.sliding),
        compliance: like.splat(law.sliding_compliance),
        damping: constants.damping * like.splat(law.sliding_damping_ratio),
        limit: friction.sliding * normal.abs(),
        time_step: like.splat(law.time_step),
    };
    let (tangential, sliding) = slider.pull(springs.sliding, sub(slip, scale(n, approach)), n);
    let slider = Slider {
        stiffness: like.splat(law.rolling),
        compliance: like.splat(law.rolling_compliance),
        damping: constants.rolling_damping,
        limit: friction.rolling * normal.abs(),
        time_step: like.splat(law.time_step),
    };
    let (pseudo, rolling) = slider.pull(springs.rolling, roll_velocity(constants.length, n, spin_i, spin_j), n);

    let lever = cross(n, tangential);
    let couple = scale(cross(n, pseudo), constants.length);
    Response {
        force: add(scale(n, normal), tangential),
        torque_i: sub(couple, scale(lever, arm_i)),
        counter_torque_j: add(couple, scale(lever, arm_j)),
        springs: Springs { sliding, rolling },
    }
}

/// Relative velocity at the contact point, v_i - v_j - (a_i ω_i + a_j ω_j) × n [m/s].
#[inline(always)]
fn slip_velocity<T: Number>(velocity: [T; 3], spin_i: [T; 3], spin_j: [T; 3], arm_i: T, arm_j: T, n: [T; 3]) -> [T; 3] {
    sub(velocity, cross(add(scale(spin_i, arm_i), scale(spin_j, arm_j)), n))
}

/// Rolling velocity v_r = -D n × (ω_i - ω_j) [m/s] (Luding 2008).
#[inline(always)]
fn roll_velocity<T: Number>(length: T, n: [T; 3], spin_i: [T; 3], spin_j: [T; 3]) -> [T; 3] {
    scale(cross(n, sub(spin_i, spin_j)), -length)
}

/// Damping of the rolling dashpot taken at the end of the step, γ / (1 + γ Δt (1/m)), with 1/m = D² (1/I_i + 1/I_j) [kg/s].
///
/// At a wall D = 2 R and the rate γ/m is eight times that between grains: at Δt = 0.15 t_c a grain in a corner would be past the
/// stability limit of an explicit dashpot, and its spin would flip sign every step for ever. The law is the same as Δt → 0.
pub fn implicit(damping: f64, inverse_mass: f64, time_step: f64) -> f64 {
    damping / (1.0 + damping * inverse_mass * time_step)
}

/// Normal force F_n = k δ - γ v·n, positive when it pushes [N]; not below the law's floor.
#[inline(always)]
fn normal_force<T: Number>(law: &Coefficients, overlap: T, damping: T, approach: T) -> T {
    let force = overlap.splat(law.normal) * overlap - damping * approach;
    if law.floor == f64::NEG_INFINITY {
        return force;
    }
    let floor = overlap.splat(law.floor);
    T::pick(force.less(floor), floor, force)
}

/// A spring and a dashpot side by side, held by a Coulomb slider, in the tangent plane.
#[derive(Clone, Copy)]
struct Slider<T> {
    stiffness: T,
    compliance: T,
    damping: T,
    limit: T,
    time_step: T,
}

impl<T: Number> Slider<T> {
    /// Force and new spring.
    ///
    /// The spring is turned with the contact by projection on the new tangent plane (its length errs by half the square of
    /// the angle turned in one step), then stretched by v Δt. The trial force -k ξ - γ v is cut to the limit; a cut spring is
    /// reset to -(F + γ v)/k, so that it holds exactly the force it gives.
    #[inline(always)]
    fn pull(self, spring: [T; 3], velocity: [T; 3], n: [T; 3]) -> ([T; 3], [T; 3]) {
        let turned = sub(spring, scale(n, dot(spring, n)));
        let stretched = add(turned, scale(velocity, self.time_step));
        let drag = scale(velocity, self.damping);
        let trial = minus(add(scale(stretched, self.stiffness), drag));
        let square = dot(trial, trial);
        let slides = (self.limit * self.limit).less(square);
        if !slides.any() {
            return (trial, stretched);
        }
        let cut = scale(trial, self.limit / square.sqrt());
        let reset = scale(add(cut, drag), -self.compliance);
        (pick(slides, cut, trial), pick(slides, reset, stretched))
    }
}

#[cfg(test)]
mod tests {
    use super::super::setup::Vec3;
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

    fn slider(limit: f64, damping: f64) -> Slider<f64> {
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
    fn response() -> Response<f64> {
        let (radius, overlap) = (0.01, 1e-3);
        let contact = Kinematics {
            normal: NORMAL,
            overlap,
            velocity: [0.3, 0.0, 0.0],
            spin_i: [5.0, 1.0, -2.0],
            spin_j: [0.0, 0.0, 3.0],
            arm_i: radius - 0.5 * overlap,
            arm_j: radius - 0.5 * overlap,
        };
        let constants = Constants { damping: 1.0, rolling_damping: 0.5, length: radius };
        let friction = Friction { sliding: 0.4, rolling: 0.2 };
        let springs = Springs { sliding: [0.1, 0.0, 0.0], rolling: [0.1, 0.0, 0.0] };
        respond(&contact, &constants, &friction, &springs, &LAW)
    }

    /// Friction is limited to μ_s |F_n| and the rolling torque to μ_r |F_n| D, which is μ_r |F_n| R between equal spheres.
    #[test]
    fn friction_and_rolling_torque_meet_their_limits() {
        let Response { force, torque_i, counter_torque_j, .. } = response();
        let normal = dot(force, NORMAL);
        let friction = sub(force, scale(NORMAL, normal));
        assert!((length(friction) / (0.4 * normal) - 1.0).abs() < 1e-12);
        // The torques of friction are equal on equal spheres, those of rolling opposite.
        let couple = scale(add(torque_i, counter_torque_j), 0.5);
        assert!((length(couple) / (0.2 * normal * 0.01) - 1.0).abs() < 1e-12);
    }

    /// No net torque about any point: T_i + T_j + (x_i - x_j) × F = 0.
    #[test]
    fn torques_balance() {
        let Response { force, torque_i, counter_torque_j, .. } = response();
        let net = add(sub(torque_i, counter_torque_j), cross(scale(NORMAL, 0.019), force));
        assert!(length(net) < 1e-13, "{net:?}");
    }
}
