//! Pile test: grains fall through a slot and form a heap.
//!
//! ```text
//!      |         upper box          |
//!      |############################|  fill height 110 mm
//!      |############################|
//!      |______              ________|  z = drop height 400 mm
//!       shelf  <- slot 100 ->  shelf     the shelves keep two wedges of grains
//!      <------- 200 mm wide -------->
//!
//!  |                /\                 |
//!  |             /######\              |   lower box, wide enough for any slope
//!  |__________/############\___________|   z = 0, depth 100 mm
//!         -0.1   -0.01 0.01   0.1           windows of the two angles
//! ```
//!
//! Procedure (paper, sections 2.1 and 3.2): fill the upper box, settle, take away what lies above the fill height, open
//! the slot, wait for rest. **Assumptions**, because Fig. 2 is lost: widths, slot, depth and drop height.
//!
//! KPI, the angle of repose (section 3.3): line through the highest z + r of each bin between 0.1 m and 0.01 m from the
//! centre, left and right, averaged.

use super::build;
use super::flow::Discharge;
use super::profile::{Grain, View, Window};
use super::{Experiment, Measurement, Observable, Reason, SetupError, extra, kpi};
use crate::dem::{FillArea, Region, Setup, State, StopRule, Trace, TracePoint, Wall};
use crate::settings::Settings;

const OBSERVABLES: &[Observable] = &[
    kpi("angle_of_repose", "deg", "mean angle of the left and the right slope"),
    extra("pile_angle_difference", "deg", "angle of the left slope minus that of the right"),
    extra("pile_roughness", "m", "residual scatter of the outline about its lines, both slopes averaged"),
    extra("pile_shelf_mass", "kg", "mass kept on the shelves of the upper box"),
    extra("pile_t50", "s", "time from the release until half of the mass that will fall has fallen"),
    extra("pile_rate", "kg/s", "steady rate of discharge through the slot"),
    extra("pile_spread", "m", "root mean square distance of the heap's mass from the centre line"),
    extra("pile_apex_height", "m", "height of the heap within one diameter of the centre line"),
];

/// The pile test.
pub struct Pile;

impl Experiment for Pile {
    fn name(&self) -> &'static str {
        "pile"
    }

    fn observables(&self) -> &'static [Observable] {
        OBSERVABLES
    }

    fn apparatus(&self, settings: &Settings) -> Result<Setup, SetupError> {
        build::ordered("pile", settings, ORDER)?;
        let grains = build::grains(settings, scale(settings));
        let (half, depth, drop) =
            (0.5 * settings["pile.upper_width"], settings["pile.depth"], settings["pile.drop_height"]);
        let ground = 2.0 * half * depth;
        let area = FillArea::Rectangle { x: [-half, half], y: [0.0, depth] };
        let fill = build::fill(settings, area, drop, ground * settings["pile.fill_height"]);
        let top = build::top(&fill, ground, &grains);
        let release = settings["pile.release_time"];
        let side = 0.5 * settings["pile.lower_width"];
        Ok(Setup {
            contact: build::contact(settings, scale(settings)),
            bridges: build::bridges(settings),
            gravity: build::gravity(settings),
            time_step_fraction: settings["time_step_fraction"],
            walls: walls(settings, top),
            fill,
            events: std::iter::once(build::deletion(
                settings,
                settings["pile.deletion_time"],
                drop + settings["pile.fill_height"],
            ))
            .chain(build::release(settings, release, "gate", [0.0, -depth, 0.0]))
            .collect(),
            stop: StopRule {
                energy_ratio: Some(settings["stop_energy_ratio"]),
                waits: build::waits(settings),
                empty: None,
                check_after: release + settings["release_duration"] + settings["pile.check_delay"],
                time_cap: settings["pile.time_cap"] + settings["release_duration"],
            },
            domain: Region { lower: [-side, -depth, -drop], upper: [side, 2.0 * depth, top] },
            periodic: [None; 3],
            trace: Some(Trace {
                interval: settings["pile.trace_interval"],
                region: Region { lower: [-half, -depth, drop], upper: [half, 2.0 * depth, top] },
            }),
            grains,
        })
    }

    fn read_off_force(&self) -> &'static [&'static str] {
        &["pile_t50", "pile_rate"]
    }

    fn read_off_outline(&self) -> &'static [&'static str] {
        &["angle_of_repose", "pile_angle_difference", "pile_roughness", "pile_apex_height"]
    }

    fn measure(&self, settings: &Settings, state: &State, trace: &[TracePoint]) -> Vec<Measurement> {
        let names = OBSERVABLES.iter().map(|observable| observable.name);
        let arch = arch_mass(settings, state);
        if arch > 0.0 {
            return names.map(|name| (name, Err(Reason::Arched { mass: arch }))).collect();
        }
        let view = View::new(settings, settings["pile.depth"], scale(settings));
        let picture = view.picture(state);
        let heap = Heap { settings, view, grains: below_slot(settings, &picture) };
        let slopes = heap.slopes();
        let discharge = discharge(settings, trace);
        let values = [
            slopes.clone().map(|(left, right)| 0.5 * (left.angle - right.angle)),
            slopes.clone().map(|(left, right)| left.angle + right.angle),
            slopes.map(|(left, right)| 0.5 * (left.roughness + right.roughness)),
            Ok(shelf_mass(settings, state)),
            discharge.clone().map(|discharge| discharge.time_of(0.5)),
            discharge.and_then(|discharge| steady_rate(settings, &discharge)),
            heap.spread(),
            heap.apex_height(),
        ];
        names.zip(values).collect()
    }
}

/// Settings that must be in this order.
const ORDER: &[(&str, &str)] = &[
    ("pile.slot", "pile.upper_width"),
    ("pile.upper_width", "pile.lower_width"),
    ("pile.deletion_time", "pile.release_time"),
    ("pile.release_time", "pile.time_cap"),
];

/// Factor on every radius.
fn scale(settings: &Settings) -> f64 {
    settings["radius_scale"] * settings["pile.radius_scale"]
}

fn walls(settings: &Settings, top: f64) -> Vec<Wall> {
    let acrylic = build::species(settings, "wall_friction_acrylic", 1.0);
    let (half, slot, depth) = (0.5 * settings["pile.upper_width"], 0.5 * settings["pile.slot"], settings["pile.depth"]);
    let (drop, side) = (settings["pile.drop_height"], 0.5 * settings["pile.lower_width"]);
    let sheet = |name, from, to| build::sheet(name, from, to, depth, acrylic);
    let mut walls = build::plates(settings, depth).to_vec();
    walls.extend([
        build::plane("floor", [0.0; 3], [0.0, 0.0, 1.0], acrylic),
        build::plane("lower left", [-side, 0.0, 0.0], [1.0, 0.0, 0.0], acrylic),
        build::plane("lower right", [side, 0.0, 0.0], [-1.0, 0.0, 0.0], acrylic),
        sheet("left shelf", [-half, drop], [-slot, drop]),
        sheet("right shelf", [slot, drop], [half, drop]),
        sheet("gate", [-slot, drop], [slot, drop]),
        sheet("upper left", [-half, drop], [-half, top]),
        sheet("upper right", [half, drop], [half, top]),
    ]);
    walls
}

/// The grains under the shelf. One that reaches up to it hangs on its edge, held by liquid or by its neighbours, and is no
/// part of the heap: a single one multiplies the roughness of a slope and turns it by several degrees.
fn below_slot(settings: &Settings, picture: &[Grain]) -> Vec<Grain> {
    picture.iter().filter(|grain| grain.top() < settings["pile.drop_height"]).copied().collect()
}

fn shelf_mass(settings: &Settings, state: &State) -> f64 {
    let kept = (0..state.len()).filter(|i| state.z[*i] >= settings["pile.drop_height"]);
    kept.map(|i| build::mass(settings, state.radius[i])).sum()
}

/// Mass at rest over the middle half of the slot, where only an arch can hold it: a heap on a shelf ends at its edge.
fn arch_mass(settings: &Settings, state: &State) -> f64 {
    let reach = 0.25 * settings["pile.slot"];
    let held = |i: &usize| state.z[*i] >= settings["pile.drop_height"] && state.x[*i].abs() < reach;
    (0..state.len()).filter(held).map(|i| build::mass(settings, state.radius[i])).sum()
}

fn discharge(settings: &Settings, trace: &[TracePoint]) -> Result<Discharge, Reason> {
    Discharge::new(trace, settings["pile.release_time"], settings["pile.clogged_share"])
}

fn steady_rate(settings: &Settings, discharge: &Discharge) -> Result<f64, Reason> {
    discharge.steady_rate(settings["pile.steady_from"], settings["pile.steady_to"], settings["steady_points"] as usize)
}

/// The grains in the lower box.
struct Heap<'a> {
    settings: &'a Settings,
    view: View,
    grains: Vec<Grain>,
}

impl Heap<'_> {
    /// Left and right slope; the left one rises with x, the right one falls.
    fn slopes(&self) -> Result<(super::Slope, super::Slope), Reason> {
        self.clear_of_walls()?;
        let (outer, inner) = (self.settings["pile.window_outer"], self.settings["pile.window_inner"]);
        let left = self.view.slope(&self.grains, Window { from: -outer, to: -inner })?;
        let right = self.view.slope(&self.grains, Window { from: inner, to: outer })?;
        Ok((left, right))
    }

    /// A heap leans on a wall where a grain that lies on others is nearer to it than one diameter and the clearance.
    fn clear_of_walls(&self) -> Result<(), Reason> {
        let free =
            0.5 * self.settings["pile.lower_width"] - self.settings["pile.wall_clearance"] - self.view.diameter();
        let leaning = self.grains.iter().find(|grain| grain.x.abs() > free && grain.z > self.view.diameter());
        leaning.map_or(Ok(()), |grain| Err(Reason::SlopeReachesWall { x: grain.x }))
    }

    /// √(Σ m x²/Σ m).
    fn spread(&self) -> Result<f64, Reason> {
        let sum = |term: fn(&Grain) -> f64| {
            self.grains.iter().map(|grain| build::volume(grain.radius) * term(grain)).sum::<f64>()
        };
        let total = sum(|_| 1.0);
        if total == 0.0 { Err(Reason::NoGrains) } else { Ok((sum(|grain| grain.x * grain.x) / total).sqrt()) }
    }

    fn apex_height(&self) -> Result<f64, Reason> {
        let reach = self.view.diameter();
        self.view.height(&self.grains, Window { from: -reach, to: reach })
    }
}
