//! Hopper: the equipment that calibrated models are validated on. Never fitted.
//!
//! ```text
//!   |##############################|  fill height 0.66 m above the outlet
//!   |##############################|
//!   |##############################|
//!    \############################/   z = 0.251 m
//!      \########################/     45 degrees, steel worn by impact
//!        \####################/
//!          \________________/         z = 0, outlet, closed by a bar
//!   <--------- 602 mm ------------>
//!             slot 100 mm             depth 50 mm, front and back of acrylic
//! ```
//!
//! Procedure (paper, sections 2.2 and 3.2): fill, settle, take away what lies above the fill height, open the outlet,
//! record the mass at 50 Hz until the hopper is empty.
//!
//! KPI, the discharge rate: slope of mass over time in steady flow, 20 to 80 % of the discharged mass (**assumption**).

use super::build;
use super::flow::Discharge;
use super::profile::DEGREES;
use super::{Experiment, Measurement, Observable, SetupError, extra, kpi};
use crate::dem::{FillArea, Region, Setup, State, StopRule, Trace, TracePoint, Wall};
use crate::settings::Settings;

const OBSERVABLES: &[Observable] = &[
    kpi("discharge_rate", "kg/s", "slope of mass over time in steady flow"),
    extra("hopper_emptying_time", "s", "time from the release until 95 % of the discharged mass has left"),
    extra("hopper_mass", "kg", "mass in the hopper at release"),
];

/// The hopper.
pub struct Hopper;

impl Experiment for Hopper {
    fn name(&self) -> &'static str {
        "hopper"
    }

    fn observables(&self) -> &'static [Observable] {
        OBSERVABLES
    }

    fn apparatus(&self, settings: &Settings) -> Result<Setup, SetupError> {
        build::ordered("hopper", settings, ORDER)?;
        let grains = build::grains(settings, scale(settings));
        let (half, depth) = (0.5 * settings["hopper.width"], settings["hopper.depth"]);
        let ground = 2.0 * half * depth;
        let area = FillArea::Rectangle { x: [-half, half], y: [0.0, depth] };
        let fill = build::fill(settings, area, 0.0, bed_volume(settings));
        let top = build::top(&fill, ground, &grains) + knee(settings);
        let release = settings["hopper.release_time"];
        let inside = Region { lower: [-2.0 * half, -depth, 0.0], upper: [2.0 * half, 2.0 * depth, top] };
        Ok(Setup {
            contact: build::contact(settings, scale(settings)),
            bridges: build::bridges(settings),
            gravity: build::gravity(settings),
            time_step_fraction: settings["time_step_fraction"],
            walls: walls(settings),
            fill,
            events: std::iter::once(build::deletion(
                settings,
                settings["hopper.deletion_time"],
                settings["hopper.fill_height"],
            ))
            .chain(build::release(settings, release, "gate", [0.0, -depth, 0.0]))
            .collect(),
            stop: StopRule {
                energy_ratio: Some(settings["stop_energy_ratio"]),
                waits: build::waits(settings),
                empty: Some(inside),
                check_after: release + settings["release_duration"] + settings["hopper.check_delay"],
                time_cap: settings["hopper.time_cap"] + settings["release_duration"],
            },
            // A grain this far below the outlet touches nothing any more.
            domain: Region { lower: [inside.lower[0], -depth, -2.0 * grains.size.largest()], upper: inside.upper },
            periodic: [None; 3],
            trace: Some(Trace { interval: settings["hopper.trace_interval"], region: inside }),
            grains,
        })
    }

    fn read_off_force(&self) -> &'static [&'static str] {
        &["discharge_rate", "hopper_emptying_time", "hopper_mass"]
    }

    fn measure(&self, settings: &Settings, _state: &State, trace: &[TracePoint]) -> Vec<Measurement> {
        let gain = 1.0 + settings["hopper.load_cell_gain"];
        let discharge = Discharge::new(trace, settings["hopper.release_time"], settings["hopper.clogged_share"]);
        let (from, to, needed) =
            (settings["hopper.steady_from"], settings["hopper.steady_to"], settings["steady_points"] as usize);
        let values = [
            discharge.clone().and_then(|discharge| discharge.steady_rate(from, to, needed)).map(|rate| gain * rate),
            discharge.clone().map(|discharge| discharge.time_of(0.95)),
            discharge.map(|discharge| gain * discharge.initial()),
        ];
        OBSERVABLES.iter().map(|observable| observable.name).zip(values).collect()
    }
}

/// Settings that must be in this order.
const ORDER: &[(&str, &str)] = &[
    ("hopper.slot", "hopper.width"),
    ("hopper.deletion_time", "hopper.release_time"),
    ("hopper.release_time", "hopper.time_cap"),
];

/// Height at which the inclined walls meet the upright ones [m].
fn knee(settings: &Settings) -> f64 {
    0.5 * (settings["hopper.width"] - settings["hopper.slot"]) * libm::tan(settings["hopper.wall_angle"] / DEGREES)
}

/// Volume of the hopper below the fill height: the box without the two wedges under the inclined walls [m³].
fn bed_volume(settings: &Settings) -> f64 {
    let (width, slot, fill, knee) =
        (settings["hopper.width"], settings["hopper.slot"], settings["hopper.fill_height"], knee(settings));
    // Below the knee the width grows linearly from the slot; a fill below the knee ends there.
    let level = fill.min(knee);
    let width_at_level = slot + (width - slot) * level / knee;
    settings["hopper.depth"] * (0.5 * (slot + width_at_level) * level + width * (fill - level))
}

/// Factor on every radius.
fn scale(settings: &Settings) -> f64 {
    settings["radius_scale"] * settings["hopper.radius_scale"]
}

fn walls(settings: &Settings) -> Vec<Wall> {
    let steel = build::species(settings, "wall_friction_steel_impact", 1.0);
    let (half, slot, depth, knee) =
        (0.5 * settings["hopper.width"], 0.5 * settings["hopper.slot"], settings["hopper.depth"], knee(settings));
    let sheet = |name, from, to| build::sheet(name, from, to, depth, steel);
    let mut walls = build::plates(settings, depth).to_vec();
    walls.extend([
        build::plane("left", [-half, 0.0, 0.0], [1.0, 0.0, 0.0], steel),
        build::plane("right", [half, 0.0, 0.0], [-1.0, 0.0, 0.0], steel),
        sheet("left incline", [-slot, 0.0], [-half, knee]),
        sheet("right incline", [slot, 0.0], [half, knee]),
        sheet("gate", [-slot, 0.0], [slot, 0.0]),
    ]);
    walls
}
