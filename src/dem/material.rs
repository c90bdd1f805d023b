//! From the contact law's settings to the numbers of a run: damping, time step, masses.
//!
//! Takes a [`Setup`], gives [`Law`]. Pure; the only place that knows the readings of "damping".

use super::clumps::Row;
use super::contact::{Coefficients, Friction};
use super::setup::{ContactLaw, Damping, Setup};
use std::f64::consts::PI;

/// Mass of a sphere, ρ 4/3 π R³ [kg].
pub fn sphere_mass(density: f64, radius: f64) -> f64 {
    density * sphere_volume(radius)
}

/// Volume of a sphere, 4/3 π R³ [m³].
pub fn sphere_volume(radius: f64) -> f64 {
    4.0 / 3.0 * PI * (radius * radius * radius)
}

/// m_eff = m_i m_j / (m_i + m_j) [kg].
pub fn effective_mass(mass_i: f64, mass_j: f64) -> f64 {
    mass_i * mass_j / (mass_i + mass_j)
}

/// R = 2 R_i R_j / (R_i + R_j) [m]: the rolling length, and the size of a liquid bridge.
pub fn pair_length(radius_i: f64, radius_j: f64) -> f64 {
    2.0 * radius_i * radius_j / (radius_i + radius_j)
}

/// Undamped collision time of two grains of equal mass, t_c = π √(m/2 / k) [s].
pub fn collision_time(mass: f64, stiffness: f64) -> f64 {
    PI * (0.5 * mass / stiffness).sqrt()
}

/// Time step of a setup [s]: its fraction of the collision time of two of the lightest possible grains.
///
/// The lightest *possible* grain, not the lightest drawn, so that the step follows from the settings alone. A clump that is hit
/// beside its centre gives way like a lighter grain, see `clumps.rs`.
pub fn time_step(setup: &Setup) -> f64 {
    let mass = setup.grains.lightest();
    let lightness = if setup.grains.aspect == 1.0 { 1.0 } else { Row::new(setup.grains.aspect).lightness() };
    setup.time_step_fraction * collision_time(lightness * mass, setup.contact.stiffness)
}

/// How γ_n follows from m_eff.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Dashpot {
    /// γ = 2 ζ √(k m_eff).
    Ratio(f64),
    /// γ = rate · m_eff.
    Rate(f64),
    /// γ.
    Constant(f64),
}

/// The contact law in numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    /// Grain against grain.
    pub pair: Coefficients,
    /// Grain against wall.
    pub wall: Coefficients,
    /// Friction between grains whose own factors are 1.
    pub friction: Friction,
    dashpot: Dashpot,
}

impl Law {
    /// The law of a setup at a time step [s].
    pub fn new(setup: &Setup, time_step: f64) -> Self {
        let contact = &setup.contact;
        let mean_mass = sphere_mass(setup.grains.density, setup.grains.size.mean());
        Self {
            pair: coefficients(contact, contact.stiffness, time_step),
            wall: coefficients(contact, contact.stiffness * contact.wall_stiffness_ratio, time_step),
            friction: Friction { sliding: contact.sliding_friction, rolling: contact.rolling_friction },
            dashpot: dashpot(contact, mean_mass),
        }
    }

    /// Normal damping γ_n of a contact between grains [kg/s].
    pub fn pair_damping(&self, mass_i: f64, mass_j: f64) -> f64 {
        self.damping(self.pair.normal, effective_mass(mass_i, mass_j))
    }

    /// Normal damping γ_n of a contact with a wall [kg/s]; m_eff = m, because a wall has inverse mass 0.
    pub fn wall_damping(&self, mass: f64) -> f64 {
        self.damping(self.wall.normal, mass)
    }

    fn damping(&self, stiffness: f64, effective_mass: f64) -> f64 {
        match self.dashpot {
            Dashpot::Ratio(ratio) => 2.0 * ratio * (stiffness * effective_mass).sqrt(),
            Dashpot::Rate(rate) => rate * effective_mass,
            Dashpot::Constant(constant) => constant,
        }
    }
}

fn dashpot(contact: &ContactLaw, mean_mass: f64) -> Dashpot {
    let mean = 0.5 * mean_mass;
    match contact.damping {
        Damping::Ratio(ratio) => Dashpot::Ratio(ratio),
        Damping::MeanParticle(ratio) => Dashpot::Constant(2.0 * ratio * (contact.stiffness * mean).sqrt()),
        Damping::PerMass(ratio) => Dashpot::Rate(2.0 * ratio * (contact.stiffness / mean).sqrt()),
        Damping::Constant(constant) => Dashpot::Constant(constant),
        Damping::Restitution(restitution) => Dashpot::Ratio(damping_ratio(restitution)),
    }
}

/// ζ = -ln e / √(π² + ln² e) [-], the damping ratio of restitution e.
pub fn damping_ratio(restitution: f64) -> f64 {
    let log = libm::log(restitution);
    -log / (PI * PI + log * log).sqrt()
}

fn coefficients(contact: &ContactLaw, normal: f64, time_step: f64) -> Coefficients {
    let (sliding, rolling) = (normal * contact.sliding_stiffness_ratio, normal * contact.rolling_stiffness_ratio);
    // γ_x = 2 ζ √(k_x m): the ratio to γ_n is √(k_x / k_n), except where one constant serves all three.
    let ratio = |stiffness_ratio: f64| match contact.damping {
        Damping::Constant(_) => 1.0,
        _ => stiffness_ratio.sqrt(),
    };
    Coefficients {
        normal,
        sliding,
        rolling,
        sliding_compliance: 1.0 / sliding,
        rolling_compliance: 1.0 / rolling,
        sliding_damping_ratio: contact.sliding_damping_factor * ratio(contact.sliding_stiffness_ratio),
        rolling_damping_ratio: contact.rolling_damping_factor * ratio(contact.rolling_stiffness_ratio),
        floor: if contact.clip_normal { 0.0 } else { f64::NEG_INFINITY },
        time_step,
    }
}
