//! Ledge test: a filled box loses its side wall and a slope stays.
//!
//! ```text
//!   |############################|  fill height 218 mm
//!   |############################|
//!   |############################| retractable wall, taken away
//!   |\#\#########################|
//!   |    \ \#####################|
//!   |         \ \################|
//!   |              \ \###########|        after: the slope
//!   |                   \ \######|
//!   |________________________\ \_|+  ridge 20 mm high, 2 mm thick, stays
//!   x = 0     length 238 mm      x = 0.238        depth 100 mm
//!      d_s <------- window ------> 0.228
//! ```
//!
//! Procedure (paper, sections 2.1 and 3.2): fill, settle, take away what lies above the fill height, retract the wall,
//! wait for rest. Grains beyond the ridge fall out and are gone. **Assumption**, because Fig. 2 is lost: the depth.
//!
//! KPI, the angle of movement (section 3.3): line through the highest z + r of each bin between d_s and 0.228 m, where
//! d_s = max(μ_s, μ_r)/0.9 · 0.06 m leaves out the level ground at the back.

use super::build;
use super::profile::{View, Window};
use super::{Experiment, Measurement, Observable, SetupError, extra, kpi};
use crate::dem::{FillArea, Region, Setup, State, StopRule, Trace, TracePoint, Wall};
use crate::settings::Settings;

const OBSERVABLES: &[Observable] = &[
    kpi("angle_of_movement", "deg", "angle of the slope that stays"),
    extra("ledge_mass", "kg", "mass left on the ledge"),
    extra("ledge_back_height", "m", "height of the grains within one diameter of the back wall"),
    extra("ledge_roughness", "m", "residual scatter of the outline about its line"),
    extra(
        "ledge_curvature",
        "1",
        "change of the slope dz/dx over the window by the fitted parabola, positive where hollow",
    ),
];

/// The ledge test.
pub struct Ledge;

impl Experiment for Ledge {
    fn name(&self) -> &'static str {
        "ledge"
    }

    fn observables(&self) -> &'static [Observable] {
        OBSERVABLES
    }

    fn apparatus(&self, settings: &Settings) -> Result<Setup, SetupError> {
        build::ordered("ledge", settings, ORDER)?;
        let grains = build::grains(settings, scale(settings));
        let (length, depth) = (settings["ledge.length"], settings["ledge.depth"]);
        let ground = length * depth;
        let area = FillArea::Rectangle { x: [0.0, length], y: [0.0, depth] };
        let fill = build::fill(settings, area, 0.0, ground * settings["ledge.fill_height"]);
        let top = build::top(&fill, ground, &grains);
        let release = settings["ledge.release_time"];
        // A grain this far beyond the ridge, or below the floor, touches nothing any more.
        let clear = 2.0 * grains.size.largest();
        let outside = length + settings["ledge.ridge_thickness"] + clear;
        Ok(Setup {
            contact: build::contact(settings, scale(settings)),
            bridges: build::bridges(settings),
            gravity: build::gravity(settings),
            time_step_fraction: settings["time_step_fraction"],
            walls: walls(settings, top),
            fill,
            events: std::iter::once(build::deletion(
                settings,
                settings["ledge.deletion_time"],
                settings["ledge.fill_height"],
            ))
            .chain(build::release(settings, release, "gate", [0.0, 0.0, settings["ledge.fill_height"]]))
            .collect(),
            stop: StopRule {
                energy_ratio: Some(settings["stop_energy_ratio"]),
                waits: build::waits(settings),
                empty: None,
                check_after: release + settings["release_duration"] + settings["ledge.check_delay"],
                time_cap: settings["ledge.time_cap"] + settings["release_duration"],
            },
            domain: Region { lower: [-length, -depth, -clear], upper: [outside, 2.0 * depth, top] },
            periodic: [None; 3],
            trace: Some(Trace {
                interval: settings["ledge.trace_interval"],
                region: Region { lower: [-length, -depth, 0.0], upper: [outer_edge(settings), 2.0 * depth, top] },
            }),
            grains,
        })
    }

    fn read_off_outline(&self) -> &'static [&'static str] {
        &["angle_of_movement", "ledge_back_height", "ledge_roughness", "ledge_curvature"]
    }

    fn measure(&self, settings: &Settings, state: &State, _trace: &[TracePoint]) -> Vec<Measurement> {
        let view = View::new(settings, settings["ledge.depth"], scale(settings));
        let grains = view.picture(state);
        let slope = view.slope(&grains, window(settings));
        let values = [
            slope.clone().map(|slope| -slope.angle),
            Ok(mass_left(settings, state)),
            view.height(&grains, Window { from: f64::NEG_INFINITY, to: view.diameter() }),
            slope.clone().map(|slope| slope.roughness),
            slope.map(|slope| slope.bow),
        ];
        OBSERVABLES.iter().map(|observable| observable.name).zip(values).collect()
    }
}

/// Settings that must be in this order.
const ORDER: &[(&str, &str)] = &[
    ("ledge.ridge_height", "ledge.fill_height"),
    ("ledge.deletion_time", "ledge.release_time"),
    ("ledge.release_time", "ledge.time_cap"),
];

/// Factor on every radius.
fn scale(settings: &Settings) -> f64 {
    settings["radius_scale"] * settings["ledge.radius_scale"]
}

fn walls(settings: &Settings, top: f64) -> Vec<Wall> {
    let acrylic = build::species(settings, "wall_friction_acrylic", 1.0);
    let (length, depth, ridge) = (settings["ledge.length"], settings["ledge.depth"], settings["ledge.ridge_height"]);
    let sheet = |name, from, to| build::sheet(name, from, to, depth, acrylic);
    let mut walls = build::plates(settings, depth).to_vec();
    walls.extend([
        build::plane("back wall", [0.0; 3], [1.0, 0.0, 0.0], acrylic),
        sheet("floor", [0.0, 0.0], [length, 0.0]),
        sheet("gate", [length, ridge], [length, top]),
    ]);
    if ridge > 0.0 {
        walls.extend([
            sheet("ridge", [length, 0.0], [length, ridge]),
            sheet("ridge top", [length, ridge], [outer_edge(settings), ridge]),
        ]);
    }
    walls
}

fn outer_edge(settings: &Settings) -> f64 {
    settings["ledge.length"] + settings["ledge.ridge_thickness"]
}

/// From d_s = max(μ_s, μ_r)/0.9 · 0.06 m to 0.228 m.
fn window(settings: &Settings) -> Window {
    let friction = settings["sliding_friction"].max(settings["rolling_friction"]);
    Window {
        from: friction / settings["ledge.window_friction"] * settings["ledge.window_start"],
        to: settings["ledge.window_end"],
    }
}

fn mass_left(settings: &Settings, state: &State) -> f64 {
    let left = (0..state.len()).filter(|i| state.z[*i] >= 0.0 && state.x[*i] <= outer_edge(settings));
    left.map(|i| build::mass(settings, state.radius[i])).sum()
}
