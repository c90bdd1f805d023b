//! Oblique impact of a sphere on a wall, without gravity: sliding, sticking, and what lies between.
//!
//! With k_s = 2/7 k the slip of a sticking contact swings as fast as its overlap, so the regimes are those of Maw et al. (1976): sliding
//! throughout at grazing incidence, sticking near the normal. Sliding and sticking have closed forms; between them the law is integrated
//! a second time, by other code, at a step so small that its own error does not count.

use super::*;

/// Speed of approach [m/s]; so small that the arm R - δ/2 is R to 1e-4.
const APPROACH: f64 = 0.02;

/// What a grain keeps of its motion: velocities [m/s] along the wall, off the wall, and of its surface, R ω_y.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    along: f64,
    off: f64,
    surface: f64,
}

/// Motion after an impact with speed `along`, averaged over when within a step the wall is met.
fn bounce(setup: &Setup, along: f64) -> Motion {
    const PHASES: usize = 16;
    let mut mean = Motion::default();
    for phase in 0..PHASES {
        let gap = (phase as f64 + 0.5) / PHASES as f64 * APPROACH * time_step(setup);
        let grain = moving([0.0, 0.0, RADIUS + gap], [along, 0.0, -APPROACH]);
        let mut world = World::new(setup, &[grain]).unwrap();
        steps(&mut world, (3.0 / setup.time_step_fraction) as u64);
        assert!(world.contacts().is_empty(), "the grain has left the wall");
        let state = world.state();
        mean.along += state.vx[0] / PHASES as f64;
        mean.off += state.vz[0] / PHASES as f64;
        mean.surface += state.wy[0] * RADIUS / PHASES as f64;
    }
    mean
}

fn target(fraction: f64, sliding_friction: f64, clip_normal: bool) -> Setup {
    let species = WallSpecies { sliding_friction, rolling_friction: 0.0 };
    let contact = ContactLaw { clip_normal, ..ContactLaw::default() };
    Setup { walls: vec![floor(species)], contact, ..space(fraction) }
}

/// ∫|F_n| dt over the impulse of approach, m v. The push ends at the speed e_p v of [`clipped_restitution`]; what the dashpot pulls
/// back from there to e v counts with the same sign, because friction is limited by |F_n|.
fn normal_impulse(clip_normal: bool) -> f64 {
    let (push, pull) = (clipped_restitution(0.3), clipped_restitution(0.3) - restitution(0.3));
    1.0 + push + if clip_normal { 0.0 } else { pull }
}

/// Grazing impact slides throughout: v_t' = v_t - μ J/m and R ω' = (5/2) μ J/m. Tolerance 0.1 Δt/t_c of the change, which is what a
/// restitution off by 0.5 Δt/t_c leaves in 1 + e, and 1e-4 for the arm R - δ/2.
#[test]
fn a_grazing_impact_slides_throughout() {
    let (friction, along) = (0.1, 20.0 * APPROACH);
    for clip_normal in [false, true] {
        let change = friction * normal_impulse(clip_normal) * APPROACH;
        for fraction in FRACTIONS {
            let after = bounce(&target(fraction, friction, clip_normal), along);
            let tolerance = 0.1 * fraction + 1e-4;
            within("sliding impact, loss of speed", fraction, (along - after.along) / change - 1.0, tolerance);
            within("sliding impact, gain of spin", fraction, after.surface / (2.5 * change) - 1.0, tolerance);
        }
    }
}

/// With endless friction the slip u is a damped oscillator, m u'' = -(7/2)(k_s u + γ_s u'), for as long as the contact lasts.
/// Momentum about the contact point, v_t + (2/5) R ω, is kept, but for the arm.
/// Tolerance in units of the slip at the start; the sliding dashpot is late by half a step like the normal one.
#[test]
fn an_impact_without_slip_follows_its_oscillator() {
    let along = APPROACH;
    for fraction in FRACTIONS {
        let setup = target(fraction, 1e9, false);
        let (k, m) = (2.0 * setup.contact.stiffness, mass());
        let contact_time = PI / ((k / m).sqrt() * (1.0 - 0.09_f64).sqrt());
        let stiffness = 3.5 * 2.0 / 7.0 * k / m;
        let decay = 3.5 * 0.3 * (2.0 / 7.0 * k / m).sqrt();
        let omega = (stiffness - decay * decay).sqrt();
        let phase = omega * contact_time;
        let slip = (-decay * contact_time).exp() * (phase.cos() - decay / omega * phase.sin());
        let after = bounce(&setup, along);
        within("sticking impact, slip", fraction, (after.along - after.surface) / along - slip, 0.4 * fraction);
        within("sticking impact, momentum", fraction, (after.along + 0.4 * after.surface) / along - 1.0, 3e-5);
    }
}

/// The same law in one plane, by explicit Euler steps of t_c/200,000.
fn reference(setup: &Setup, friction: f64, along: f64) -> Motion {
    let (k, m) = (2.0 * setup.contact.stiffness, mass());
    let (ks, inertia) = (2.0 / 7.0 * k, 0.4 * mass() * RADIUS * RADIUS);
    let (damping, sliding_damping) = (0.6 * (k * m).sqrt(), 0.6 * (ks * m).sqrt());
    let step = PI * (m / k).sqrt() / 2e5;
    let (mut overlap, mut approach, mut speed, mut spin, mut spring) = (0.0_f64, APPROACH, along, 0.0, 0.0_f64);
    while overlap >= 0.0 {
        let normal = k * overlap + damping * approach;
        let arm = RADIUS - 0.5 * overlap;
        let slip = speed - arm * spin;
        spring += slip * step;
        let mut force = -ks * spring - sliding_damping * slip;
        if force.abs() > friction * normal.abs() {
            force = friction * normal.abs() * force.signum();
            spring = -(force + sliding_damping * slip) / ks;
        }
        overlap += approach * step;
        approach -= normal / m * step;
        speed += force / m * step;
        spin -= arm * force / inertia * step;
    }
    Motion { along: speed, off: -approach, surface: spin * RADIUS }
}

/// From near normal to grazing incidence the engine converges to an independent integration of the same law. Errors in units of the
/// speed of approach.
#[test]
fn an_oblique_impact_agrees_with_an_independent_integration() {
    let friction = 0.3;
    for ratio in [0.2, 0.6, 1.2, 2.0, 3.0] {
        let exact = reference(&target(0.1, friction, false), friction, ratio * APPROACH);
        for fraction in FRACTIONS {
            let after = bounce(&target(fraction, friction, false), ratio * APPROACH);
            let errors = [after.along - exact.along, after.off - exact.off, after.surface - exact.surface];
            for (name, error) in ["along", "off", "surface"].into_iter().zip(errors) {
                let what = format!("oblique impact at v_t/v_n = {ratio}, {name}");
                within(&what, fraction, error / APPROACH, 0.2 * fraction);
            }
        }
    }
}
