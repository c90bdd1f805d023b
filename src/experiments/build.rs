//! Parts that the four apparatuses share: grains, contact law, plates, walls, filling and deletion from the settings.

use super::SetupError;
use super::profile::DEGREES;
use crate::dem::{
    Action, ContactLaw, Damping, Event, Fill, FillArea, Fines, Grains, LiquidBridges, Reference, Rise, Shape,
    SizeDistribution, Vec3, Wall, WallSpecies, mesh,
};
use crate::settings::{Equipment, SIEVES, Settings, spec};

/// Density of air at 20 °C [kg/m³].
const AIR_DENSITY: f64 = 1.2;
/// Loosest insertion that is expected: grain volume over volume of the cloud; the apparatus is as tall as that needs.
const LOOSEST_CLOUD: f64 = 0.08;

/// Grains, with every radius times `scale`.
pub fn grains(settings: &Settings, scale: f64) -> Grains {
    Grains {
        size: sizes(settings, scale),
        aspect: settings["aspect_ratio"],
        density: settings["particle_density"],
        sliding_spread: settings["friction_spread_cv"],
        rolling_spread: rolling_spread(settings),
        fines: fines(settings, scale),
        drag: 0.5 * AIR_DENSITY * settings["drag_coefficient"],
        species: Vec::new(),
    }
}

/// Distribution of the radii, which are half of what a sieve measures.
fn sizes(settings: &Settings, scale: f64) -> SizeDistribution {
    let (mean, sd) = (settings["radius_mean"] * scale, settings["radius_sd"] * scale);
    let (below, above) = (settings["radius_cut_below"], settings["radius_cut_above"]);
    let bounds = [mean - below * sd, mean + above * sd];
    let kind = |word| settings.is("size_distribution", word);
    if kind("lognormal") {
        SizeDistribution::Lognormal { mean, sd, bounds }
    } else if kind("rosin_rammler") {
        let size = 0.5 * settings["rosin_rammler_size"] * scale;
        SizeDistribution::RosinRammler { scale: size, exponent: settings["rosin_rammler_exponent"], bounds }
    } else if kind("sieve") {
        let sieves = SIEVES.iter().filter(|(size, _)| settings[size] > 0.0);
        SizeDistribution::Sieve(sieves.map(|(size, finer)| [0.5 * settings[size] * scale, settings[finer]]).collect())
    } else {
        SizeDistribution::TruncatedNormal { mean, sd, below, above }
    }
}

/// Variation of a product of two independent lognormal factors, √((1 + a²)(1 + b²) − 1).
fn rolling_spread(settings: &Settings) -> f64 {
    let (both, alone) = (settings["friction_spread_cv"], settings["rolling_spread_cv"]);
    if alone == 0.0 { both } else { ((1.0 + both * both) * (1.0 + alone * alone) - 1.0).sqrt() }
}

fn fines(settings: &Settings, scale: f64) -> Option<Fines> {
    let fraction = settings["fines_fraction"];
    let radius = || settings["fines_size"] * sizes(settings, scale).smallest();
    (fraction > 0.0).then(|| Fines { fraction, radius: radius() })
}

/// Contact law; k_p ∝ r by eq. 1, so it carries the same scale as the radii.
pub fn contact(settings: &Settings, scale: f64) -> ContactLaw {
    ContactLaw {
        stiffness: settings["normal_stiffness"] * scale * settings["stiffness_scale"],
        wall_stiffness_ratio: settings["wall_stiffness_ratio"],
        sliding_stiffness_ratio: settings["sliding_stiffness_ratio"],
        rolling_stiffness_ratio: settings["rolling_stiffness_ratio"],
        sliding_damping_factor: settings["sliding_damping_factor"],
        rolling_damping_factor: settings["rolling_damping_factor"],
        sliding_friction: settings["sliding_friction"],
        rolling_friction: settings["rolling_friction"],
        damping: damping(settings),
        clip_normal: settings.is("clip_normal_force", "yes"),
    }
}

fn damping(settings: &Settings) -> Damping {
    let value = settings["damping"];
    let reading = |word| settings.is("damping_reading", word);
    if reading("mean_particle") {
        Damping::MeanParticle(value)
    } else if reading("per_mass") {
        Damping::PerMass(value)
    } else if reading("constant") {
        Damping::Constant(value)
    } else if reading("restitution") {
        Damping::Restitution(value)
    } else {
        Damping::Ratio(value)
    }
}

/// Liquid bridges; none at a Bond number of 0.
pub fn bridges(settings: &Settings) -> Option<LiquidBridges> {
    let bond_number = settings["bond_number"];
    (bond_number > 0.0).then(|| LiquidBridges {
        bond_number,
        volume_ratio: settings["liquid_volume_ratio"],
        contact_angle: settings["contact_angle"] / DEGREES,
        wall_ratio: settings["wall_bridge_ratio"],
    })
}

/// Gravity in the frame of the apparatus, g (sin τ, 0, −cos τ) at tilt τ.
pub fn gravity(settings: &Settings) -> Vec3 {
    let (g, tilt) = (settings["gravity"], settings["tilt"] / DEGREES);
    [g * libm::sin(tilt), 0.0, -g * libm::cos(tilt)]
}

/// Friction of the wall material `name`, times `scale`; rolling is `wall_rolling_ratio` times sliding (section 3.1).
pub fn species(settings: &Settings, name: &str, scale: f64) -> WallSpecies {
    let sliding_friction = settings[name] * scale;
    WallSpecies { sliding_friction, rolling_friction: settings["wall_rolling_ratio"] * sliding_friction }
}

/// Walls of a mesh of the user.
pub fn equipment(settings: &Settings, piece: &Equipment) -> impl Iterator<Item = Wall> {
    mesh(&piece.name, &piece.facets, species(settings, piece.friction, 1.0))
}

/// Front plate at y = 0 and back plate at y = `depth`, of acrylic.
pub fn plates(settings: &Settings, depth: f64) -> [Wall; 2] {
    let acrylic = species(settings, "wall_friction_acrylic", settings["front_back_friction_scale"]);
    [plane("front", [0.0; 3], [0.0, 1.0, 0.0], acrylic), plane("back", [0.0, depth, 0.0], [0.0, -1.0, 0.0], acrylic)]
}

/// An infinite plane.
pub fn plane(name: &str, point: Vec3, normal: Vec3, species: WallSpecies) -> Wall {
    Wall { name: name.to_owned(), shape: Shape::Plane { point, normal }, species }
}

/// A rectangle over the whole `depth`, whose section is the line from `from` to `to`, each (x, z).
pub fn sheet(name: &str, from: [f64; 2], to: [f64; 2], depth: f64, species: WallSpecies) -> Wall {
    let shape = Shape::Rectangle {
        corner: [from[0], 0.0, from[1]],
        edge_u: [to[0] - from[0], 0.0, to[1] - from[1]],
        edge_v: [0.0, depth, 0.0],
    };
    Wall { name: name.to_owned(), shape, species }
}

/// Filling of `area` from `base` upwards so that a bed of `bed_volume` [m³] will be more than full.
pub fn fill(settings: &Settings, area: FillArea, base: f64, bed_volume: f64) -> Fill {
    let density = settings["insertion_density"];
    let rise = if density > 0.0 { Rise::ToDensity(density) } else { Rise::PerAttempt(settings["insertion_step"]) };
    Fill { area, base, rise, volume: settings["insertion_ratio"] * bed_volume }
}

/// Height that no inserted grain exceeds, for walls and domain: the cloud at its loosest, and some grains.
pub fn top(fill: &Fill, ground: f64, grains: &Grains) -> f64 {
    let loosest = if let Rise::ToDensity(density) = fill.rise { density.min(LOOSEST_CLOUD) } else { LOOSEST_CLOUD };
    fill.base + fill.volume / (ground * loosest) + 10.0 * grains.size.largest()
}

/// Whether grains at rest wait for what comes next.
pub fn waits(settings: &Settings) -> bool {
    settings.is("waiting", "full")
}

/// Taking away what lies above `height`, up to which the vessel has to be full.
pub fn deletion(settings: &Settings, time: f64, height: f64) -> Event {
    let reference = if settings.is("deletion_reference", "top") { Reference::Top } else { Reference::Centre };
    Event { time, action: Action::DeleteAbove { height, reference, level: true } }
}

/// Opening: the wall `name` is pulled by `travel` [m] within the time of the release, then it is gone.
pub fn release(settings: &Settings, time: f64, name: &str, travel: Vec3) -> Vec<Event> {
    let (name, duration) = (name.to_owned(), settings["release_duration"]);
    let removal = Event { time: time + duration, action: Action::RemoveWall { name: name.clone() } };
    if duration == 0.0 {
        return vec![removal];
    }
    let velocity = travel.map(|length| length / duration);
    vec![Event { time, action: Action::MoveWall { name, velocity } }, removal]
}

/// Checks that of each pair of settings the first is below the second.
///
/// # Errors
/// The first pair that is not.
pub fn ordered(
    experiment: &'static str,
    settings: &Settings,
    pairs: &[(&'static str, &'static str)],
) -> Result<(), SetupError> {
    let wrong = pairs.iter().find(|(small, large)| settings[small] >= settings[large]);
    wrong.map_or(Ok(()), |(small, large)| {
        let unit = spec(small).map_or("", |spec| spec.unit);
        Err(SetupError { experiment, small, low: settings[small], large, high: settings[large], unit })
    })
}

/// Mass of a grain, ρ_p 4/3 π r³ [kg].
pub fn mass(settings: &Settings, radius: f64) -> f64 {
    settings["particle_density"] * volume(radius)
}

/// Volume of a sphere [m³].
pub fn volume(radius: f64) -> f64 {
    4.0 / 3.0 * std::f64::consts::PI * radius * radius * radius
}
