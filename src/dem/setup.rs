//! What a simulation is made of: grains, contact law, walls, filling, programme and stop rule.
//!
//! Takes nothing, gives plain data that [`simulate`](super::simulate) runs. SI units throughout, z points up.
//! Deliberately ignorant of experiments and settings: whoever builds a [`Setup`] decides what its numbers mean.

use super::material::sphere_mass;
use super::sizes::SizeDistribution;

/// A point or vector, (x, y, z).
pub type Vec3 = [f64; 3];

/// Everything that defines a run apart from its seed.
#[derive(Debug, Clone, PartialEq)]
pub struct Setup {
    /// The grains to insert.
    pub grains: Grains,
    /// Contact law between grains, and between grains and walls.
    pub contact: ContactLaw,
    /// Liquid bridges; `None` and a Bond number of zero are bit-identical.
    pub bridges: Option<LiquidBridges>,
    /// Gravity [m/s²], usually `[0, 0, -9.81]`; tilt it to tilt the apparatus.
    pub gravity: Vec3,
    /// Time step over the undamped collision time of two of the smallest grains [-]; 0.1 in the paper, section 3.1.
    pub time_step_fraction: f64,
    /// Walls; names are unique, the order decides ties at joints.
    pub walls: Vec<Wall>,
    /// How the grains are inserted at t = 0.
    pub fill: Fill,
    /// What happens at which time; events of equal time run in this order.
    pub events: Vec<Event>,
    /// When to stop.
    pub stop: StopRule,
    /// Grains whose centre leaves this box are removed and counted.
    pub domain: Region,
    /// Ends along x, y and z [m] of a piece that repeats itself: grains that leave at one end come in at the other and touch
    /// across it. Walls are not repeated; they have to reach beyond both ends by a largest diameter.
    pub periodic: [Option<[f64; 2]>; 3],
    /// Samples of the mass in a region over time.
    pub trace: Option<Trace>,
}

/// The grains: spheres, or rigid clumps of spheres, of one material, and spheres of further species among them.
#[derive(Debug, Clone, PartialEq)]
pub struct Grains {
    /// Distribution of the radius; of a clump that of the sphere of its volume.
    pub size: SizeDistribution,
    /// Length over width [-]: 1 are spheres, up to 2.5 rigid clumps of two or three spheres in a row.
    pub aspect: f64,
    /// Particle density ρ_p [kg/m³].
    pub density: f64,
    /// Coefficient of variation of each grain's own sliding friction (lognormal, mean kept) [-]; 0 is off.
    pub sliding_spread: f64,
    /// Coefficient of variation of each grain's own rolling friction (lognormal, mean kept) [-]; 0 is off.
    pub rolling_spread: f64,
    /// Grains below the distribution's lower cut, besides.
    pub fines: Option<Fines>,
    /// ½ C_d ρ_air of the drag ½ C_d ρ_air π R² v² against a grain's velocity [kg/m³]; 0 is off.
    pub drag: f64,
    /// Further species; none of them with clumps.
    pub species: Vec<Species>,
}

/// A further species of spheres, with the stiffness and damping of the contact law.
#[derive(Debug, Clone, PartialEq)]
pub struct Species {
    /// Share of the volume of all grains [-], between 0 and 1.
    pub fraction: f64,
    /// Distribution of the radius.
    pub size: SizeDistribution,
    /// Particle density [kg/m³].
    pub density: f64,
    /// Sliding friction between two grains of it [-]; between grains of two species the harmonic mean, as in MercuryDPM.
    pub sliding_friction: f64,
    /// Rolling friction between two grains of it [-], mixed in the same way.
    pub rolling_friction: f64,
}

/// Grains of one small size among the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fines {
    /// Their mass over the mass of all grains [-], below 1.
    pub fraction: f64,
    /// Their radius [m].
    pub radius: f64,
}

impl Grains {
    /// Mass of the lightest possible grain [kg].
    pub fn lightest(&self) -> f64 {
        let smallest = self.fines.map_or(self.size.smallest(), |fines| fines.radius.min(self.size.smallest()));
        let others = self.species.iter().map(|species| sphere_mass(species.density, species.size.smallest()));
        others.fold(sphere_mass(self.density, smallest), f64::min)
    }

    /// Largest possible radius [m].
    pub fn largest(&self) -> f64 {
        self.species.iter().map(|species| species.size.largest()).fold(self.size.largest(), f64::max)
    }
}

/// Linear visco-elastic contact with sliding and rolling springs (Luding 2008; paper, Table 4).
#[derive(Debug, Clone, PartialEq)]
pub struct ContactLaw {
    /// Normal stiffness k_p between grains [N/m]; paper: 3.67743e5.
    pub stiffness: f64,
    /// Wall stiffness over k_p [-]; paper: 2.
    pub wall_stiffness_ratio: f64,
    /// Sliding stiffness over normal stiffness [-]; paper: 2/7.
    pub sliding_stiffness_ratio: f64,
    /// Rolling stiffness over normal stiffness [-]; paper: 2/7.
    pub rolling_stiffness_ratio: f64,
    /// Sliding dashpot over what `damping` says [-]; 0 is none.
    pub sliding_damping_factor: f64,
    /// Rolling dashpot over what `damping` says [-]; 0 is none, as in LIGGGHTS `epsd2`.
    pub rolling_damping_factor: f64,
    /// Sliding friction μ_s between grains [-].
    pub sliding_friction: f64,
    /// Rolling friction μ_r between grains [-]; torque limit μ_r |F_n| D with D = 2 R_i R_j / (R_i + R_j).
    pub rolling_friction: f64,
    /// Reading of the paper's "damping 0.3".
    pub damping: Damping,
    /// Clip the normal force at zero, so that damping cannot pull late in a rebound. Default: not clipped.
    pub clip_normal: bool,
}

/// Readings of the damping coefficient; each applies to the normal, sliding and rolling dashpots, x = n, s, r.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damping {
    /// γ_x = 2 ζ √(k_x m_eff) of each pair: every pair has the same restitution (default, ζ = 0.3).
    Ratio(f64),
    /// γ_x = 2 ζ √(k_x m̄/2), with m̄ the mass of a sphere of mean radius: one constant for all contacts (MercuryDPM's form).
    MeanParticle(f64),
    /// γ_x / m_eff = 2 ζ √(k_x / (m̄/2)): one rate for all contacts (the form of LIGGGHTS and LAMMPS).
    PerMass(f64),
    /// γ_n = γ_s = γ_r = this constant [kg/s].
    Constant(f64),
    /// The damping ratio that gives this restitution e: ζ = -ln e / √(π² + ln² e), then as `Ratio`.
    Restitution(f64),
}

/// Liquid bridges after Willett; see [`super::bridges`] for the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiquidBridges {
    /// Bond number Bo = 2π R̄ γ cosθ / (m̄ g) at the mean radius [-]; 0 is off.
    pub bond_number: f64,
    /// Liquid volume over R³, V* [-], with R = 2 R_i R_j / (R_i + R_j), or 2 R_i at a wall.
    pub volume_ratio: f64,
    /// Contact angle θ [rad].
    pub contact_angle: f64,
    /// Force of a bridge to a wall over that to a wall which the liquid wets as it wets the grains [-]; 0: walls stay dry.
    pub wall_ratio: f64,
}

/// Friction of a wall material, used directly, without mixing with the grains' own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallSpecies {
    /// Sliding friction [-]; paper, Table 1.
    pub sliding_friction: f64,
    /// Rolling friction [-]; paper: twice the sliding friction.
    pub rolling_friction: f64,
}

/// One wall piece.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Name by which events address the wall; triangles may share one, every other wall has its own.
    pub name: String,
    /// Shape and place.
    pub shape: Shape,
    /// Friction.
    pub species: WallSpecies,
}

/// Wall primitives. They compose: see [`super::walls`] for the rule where two pieces meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// Infinite plane; grains are on the side to which `normal` points (any length).
    Plane {
        /// A point of the plane [m].
        point: Vec3,
        /// Normal, towards the grains.
        normal: Vec3,
    },
    /// Bounded rectangle, touched from both sides and round its edges: `corner + a·edge_u + b·edge_v`, a, b in [0, 1].
    Rectangle {
        /// One corner [m].
        corner: Vec3,
        /// First edge [m].
        edge_u: Vec3,
        /// Second edge [m], perpendicular to the first.
        edge_v: Vec3,
    },
    /// Inside of an infinite vertical cylinder.
    Cylinder {
        /// Axis, (x, y) [m].
        axis: [f64; 2],
        /// Inner radius [m].
        radius: f64,
    },
    /// Frustum of a vertical cone, touched from inside and outside and round its rims; equal radii make a piece of pipe.
    Cone {
        /// Axis, (x, y) [m].
        axis: [f64; 2],
        /// Height and radius of the lower rim [m].
        lower: [f64; 2],
        /// Height and radius of the upper rim [m].
        upper: [f64; 2],
    },
    /// Triangle, touched from both sides and round its edges; those of one name make a mesh, see [`mesh`](super::mesh).
    Triangle {
        /// Corners [m].
        corners: [Vec3; 3],
    },
}

/// Random insertion without contact, from a horizontal plane that rises (paper, section 3.2).
#[derive(Debug, Clone, PartialEq)]
pub struct Fill {
    /// Where the centres are drawn.
    pub area: FillArea,
    /// Height at which the plane starts [m]; grains that would touch a wall are refused like any other contact.
    pub base: f64,
    /// How the plane rises.
    pub rise: Rise,
    /// Total grain volume to insert [m³]; the grain that reaches it is the last.
    pub volume: f64,
}

/// How the plane of insertion rises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Rise {
    /// By this with every attempted grain, over the mean radius [-]; paper: 1e-4 (**assumption**: per attempt).
    PerAttempt(f64),
    /// With the volume of the grains, once the first has found a place: the cloud has this solid fraction over the area [-].
    ToDensity(f64),
}

/// Horizontal area of insertion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FillArea {
    /// Uniform over a rectangle.
    Rectangle {
        /// Range of x [m].
        x: [f64; 2],
        /// Range of y [m].
        y: [f64; 2],
    },
    /// Angle and distance from the axis both uniform, as the paper describes it.
    Disc {
        /// Axis, (x, y) [m].
        axis: [f64; 2],
        /// Radius [m].
        radius: f64,
    },
}

/// Something done to the set-up while it runs, at the first step whose time is not below `time`.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Time [s].
    pub time: f64,
    /// What to do.
    pub action: Action,
}

/// What an event does.
#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Deletes every grain above a height.
    DeleteAbove {
        /// Height z [m].
        height: f64,
        /// Which point of the grain counts.
        reference: Reference,
        /// Whether grains have to reach that height: if none does, the vessel is underfilled and the run has failed.
        level: bool,
    },
    /// Removes the wall of that name.
    RemoveWall {
        /// Name of the wall.
        name: String,
    },
    /// Changes gravity: in the frame of a vessel that is lifted, dropped or shaken, the grains feel its acceleration.
    SetGravity {
        /// Gravity from now on [m/s²].
        gravity: Vec3,
    },
    /// Lets the wall of that name move at a constant velocity from now on (zero stops it).
    MoveWall {
        /// Name of the wall.
        name: String,
        /// Velocity [m/s].
        velocity: Vec3,
    },
}

/// Point of a grain that decides whether it lies above a height.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// Highest point, z + R.
    Top,
    /// Centre, z.
    Centre,
}

/// When a run stops; whichever holds first.
#[derive(Debug, Clone, PartialEq)]
pub struct StopRule {
    /// Stop when translational kinetic energy over elastic energy falls below this [-]; paper: 1e-6. `None` is off.
    pub energy_ratio: Option<f64>,
    /// Whether grains at rest, by the same ratio, wait for the next event. If not, the clock jumps to it, as long as nothing
    /// but deletions and removed walls came before; what comes after keeps its distance.
    pub waits: bool,
    /// Stop when no grain's centre is in this region. `None` is off.
    pub empty: Option<Region>,
    /// Neither of the two is looked at before this time [s]; choose it after the last release.
    pub check_after: f64,
    /// The run ends here in any case [s].
    pub time_cap: f64,
}

/// An axis-aligned box, boundaries included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Lower corner [m].
    pub lower: Vec3,
    /// Upper corner [m].
    pub upper: Vec3,
}

/// Sampling of the mass in a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// Interval between samples [s]; 0.02 in the paper (50 Hz). The first sample is at t = 0.
    pub interval: f64,
    /// Grains whose centre is in this box are counted.
    pub region: Region,
}

impl Reference {
    /// Height of that point of a sphere (x, y, z, R) [m].
    pub(super) fn height(self, sphere: &[f64; 4]) -> f64 {
        match self {
            Self::Top => sphere[2] + sphere[3],
            Self::Centre => sphere[2],
        }
    }
}

impl Region {
    /// Whether the point is in the box.
    pub fn contains(&self, point: Vec3) -> bool {
        (0..3).all(|axis| self.lower[axis] <= point[axis] && point[axis] <= self.upper[axis])
    }
}

impl Default for ContactLaw {
    /// The paper's Table 4 with the default readings, and its centre point μ_s = μ_r = 0.5.
    fn default() -> Self {
        Self {
            stiffness: 3.67743e5,
            wall_stiffness_ratio: 2.0,
            sliding_stiffness_ratio: 2.0 / 7.0,
            rolling_stiffness_ratio: 2.0 / 7.0,
            sliding_damping_factor: 1.0,
            rolling_damping_factor: 1.0,
            sliding_friction: 0.5,
            rolling_friction: 0.5,
            damping: Damping::Ratio(0.3),
            clip_normal: false,
        }
    }
}

impl Default for Grains {
    /// The paper's gravel (Table 3) at ρ_p = 2750 kg/m³.
    fn default() -> Self {
        Self {
            size: SizeDistribution::TruncatedNormal { mean: 5.02e-3, sd: 1.39e-3, below: 1.5, above: 5.0 },
            aspect: 1.0,
            density: 2750.0,
            sliding_spread: 0.0,
            rolling_spread: 0.0,
            fines: None,
            drag: 0.0,
            species: Vec::new(),
        }
    }
}
