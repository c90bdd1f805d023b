//! Bulk density test: a cylinder filled to the rim and weighed (ISO 17828 / EN 15103, 5 l).
//!
//! ```text
//!     |############|  struck off at 236 mm, rim at 237 mm
//!     |############|
//!     |############|  steel, worn by sliding
//!     |############|
//!     |############|
//!     |____________|
//!      radius 82 mm
//! ```
//!
//! Procedure (paper, sections 2.1 and 3.2): fill, settle, take away what lies above the fill height, wait for rest, weigh.
//!
//! KPI, the bulk density: mass of the grains that count over the volume of the cylinder (section 3.3). Dividing by the
//! volume below the fill height instead is `bulk_density.volume`; which grains count is `bulk_density.count`.

use super::build;
use super::{Experiment, Measurement, Observable, Reason, SetupError, extra, kpi};
use crate::dem::{Action, Event, FillArea, Region, Setup, Shape, State, StopRule, TracePoint, Wall};
use crate::settings::Settings;

const OBSERVABLES: &[Observable] = &[
    kpi("bulk_density", "kg/m3", "mass of the grains over the volume of the cylinder"),
    extra("cylinder_count", "1", "number of grains in the cylinder"),
    extra("cylinder_mean_mass", "kg", "mean mass of a grain in the cylinder"),
];

/// The bulk density test.
pub struct BulkDensity;

impl Experiment for BulkDensity {
    fn name(&self) -> &'static str {
        "bulk_density"
    }

    fn observables(&self) -> &'static [Observable] {
        OBSERVABLES
    }

    fn apparatus(&self, settings: &Settings) -> Result<Setup, SetupError> {
        build::ordered("bulk_density", settings, &[("bulk_density.deletion_time", "bulk_density.time_cap")])?;
        let grains = build::grains(settings, scale(settings));
        let (radius, height) = (settings["bulk_density.radius"], settings["bulk_density.fill_height"]);
        let fill = build::fill(settings, FillArea::Disc { axis: [0.0; 2], radius }, 0.0, ground(settings) * height);
        let top = build::top(&fill, ground(settings), &grains);
        let (mut events, tapped) = taps(settings);
        let deletion = settings["bulk_density.deletion_time"] + tapped;
        events.push(build::deletion(settings, deletion, height));
        Ok(Setup {
            contact: build::contact(settings, scale(settings)),
            bridges: build::bridges(settings),
            gravity: build::gravity(settings),
            time_step_fraction: settings["time_step_fraction"],
            walls: walls(settings, radius),
            fill,
            events,
            stop: StopRule {
                energy_ratio: Some(settings["stop_energy_ratio"]),
                waits: build::waits(settings),
                empty: None,
                check_after: deletion,
                time_cap: settings["bulk_density.time_cap"] + tapped,
            },
            domain: Region { lower: [-2.0 * radius, -2.0 * radius, -radius], upper: [2.0 * radius, 2.0 * radius, top] },
            periodic: [None; 3],
            trace: None,
            grains,
        })
    }

    fn measure(&self, settings: &Settings, state: &State, _trace: &[TracePoint]) -> Vec<Measurement> {
        let parts: Vec<f64> = (0..state.len()).map(|i| counted_part(settings, state, i)).collect();
        let mass: f64 =
            parts.iter().zip(&state.radius).map(|(part, radius)| part * build::mass(settings, *radius)).sum();
        let count = parts.iter().filter(|part| **part > 0.0).count() as f64;
        let weighed = mass + settings["bulk_density.tare"];
        let of_grains = |value: f64| if count > 0.0 { Ok(value) } else { Err(Reason::NoGrains) };
        let values = [of_grains(weighed / reference_volume(settings)), of_grains(count), of_grains(weighed / count)];
        OBSERVABLES.iter().map(|observable| observable.name).zip(values).collect()
    }
}

/// Time in which a dropped cylinder is stopped by the bench [s].
const IMPACT: f64 = 5e-3;
/// Rest after each drop [s].
const REST: f64 = 0.05;

/// Drops of the cylinder before it is struck off, and the time they take [s]. In its own frame the grains weigh nothing
/// while it falls, for √(2h/g), and the more for as long as the bench stops it: (1 + √(2h/g)/IMPACT) g.
fn taps(settings: &Settings) -> (Vec<Event>, f64) {
    let (height, gravity) = (settings["bulk_density.tap_height"], settings["gravity"]);
    if height == 0.0 || gravity == 0.0 {
        return (Vec::new(), 0.0);
    }
    let fall = (2.0 * height / gravity).sqrt();
    let cycle = fall + IMPACT + REST;
    let felt = |time: f64, factor: f64| {
        let gravity = build::gravity(settings).map(|g| factor * g);
        Event { time: settings["bulk_density.deletion_time"] + time, action: Action::SetGravity { gravity } }
    };
    let drops = settings["bulk_density.taps"] as usize;
    let drop = |i: usize| {
        let start = i as f64 * cycle;
        [felt(start, 0.0), felt(start + fall, 1.0 + fall / IMPACT), felt(start + fall + IMPACT, 1.0)]
    };
    ((0..drops).flat_map(drop).collect(), drops as f64 * cycle)
}

/// Factor on every radius.
fn scale(settings: &Settings) -> f64 {
    settings["radius_scale"] * settings["bulk_density.radius_scale"]
}

fn walls(settings: &Settings, radius: f64) -> Vec<Wall> {
    let steel = build::species(settings, "wall_friction_steel_sliding", 1.0);
    let floor = build::plane("floor", [0.0; 3], [0.0, 0.0, 1.0], steel);
    vec![floor, Wall { name: "cylinder".to_owned(), shape: Shape::Cylinder { axis: [0.0; 2], radius }, species: steel }]
}

/// Area of the base [m²].
fn ground(settings: &Settings) -> f64 {
    let radius = settings["bulk_density.radius"];
    std::f64::consts::PI * radius * radius
}

fn reference_volume(settings: &Settings) -> f64 {
    let filled = settings.is("bulk_density.volume", "filled");
    ground(settings) * settings[if filled { "bulk_density.fill_height" } else { "bulk_density.height" }]
}

/// Part of grain `i` that counts, 0 to 1.
fn counted_part(settings: &Settings, state: &State, i: usize) -> f64 {
    let (above, radius) = (state.z[i] - settings["bulk_density.fill_height"], state.radius[i]);
    let counts = |yes: bool| f64::from(u8::from(yes));
    if settings.is("bulk_density.count", "cut") {
        part_below(-above / radius)
    } else if settings.is("bulk_density.count", "whole") {
        counts(above + radius <= 0.0)
    } else if settings.is("bulk_density.count", "centre") {
        counts(above <= 0.0)
    } else {
        1.0
    }
}

/// Part of the unit sphere below the plane at height `h` over its centre: (h + 1)² (2 − h)/4, 0 to 1.
fn part_below(h: f64) -> f64 {
    let h = h.clamp(-1.0, 1.0);
    (h + 1.0) * (h + 1.0) * (2.0 - h) / 4.0
}
