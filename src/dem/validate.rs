//! Checks a setup before it runs: every number finite and in range, every name known, walls well formed.

use super::clumps::Clump;
use super::outcome::Failure;
use super::setup::{Action, Damping, FillArea, Region, Rise, Setup, Shape, Species, Vec3, Wall};
use super::vector::{cross, dot, length, sub};

/// Shortest period over the largest radius: below it a pair could be near both inside and across the ends.
const SHORTEST_PERIOD: f64 = 8.0;

/// Refuses a setup that contradicts itself.
///
/// # Errors
/// [`Failure::InvalidSetup`] with the first thing that is wrong.
pub fn validate(setup: &Setup) -> Result<(), Failure> {
    grains(setup)?;
    contact(setup)?;
    positive("time step fraction", setup.time_step_fraction)?;
    require(
        setup.gravity.iter().all(|g| g.is_finite()),
        || "gravity is not finite".into(),
        "give three finite numbers",
    )?;
    setup.walls.iter().enumerate().try_for_each(|(w, piece)| wall(piece, &setup.walls[..w]))?;
    fill(setup)?;
    events(setup)?;
    region("domain", &setup.domain)?;
    periods(setup)?;
    if let Some(trace) = &setup.trace {
        positive("trace interval", trace.interval)?;
        region("trace region", &trace.region)?;
    }
    positive("time cap", setup.stop.time_cap)?;
    not_negative("time of the first stop check", setup.stop.check_after)
}

fn periods(setup: &Setup) -> Result<(), Failure> {
    let least = SHORTEST_PERIOD * setup.grains.largest();
    for (axis, [low, high]) in ["x", "y", "z"].iter().zip(setup.periodic).filter_map(|(axis, ends)| Some((axis, ends?)))
    {
        let sound = low.is_finite() && high.is_finite() && high - low >= least;
        let what = || format!("the period from {axis} = {low} to {high} m is shorter than {least:.4} m, or not finite");
        require(sound, what, "give it at least eight times the largest radius")?;
    }
    let rises = || "a period in z, along which the vessel is filled".into();
    require(setup.periodic[2].is_none(), rises, "take it away, or place the grains by hand in a World")
}

/// Refuses clumps that are none, and clumps in a period, whose spheres would not see each other across its ends.
///
/// # Errors
/// [`Failure::InvalidSetup`] with the first thing that is wrong.
pub fn clumps(setup: &Setup, clumps: &[Clump]) -> Result<(), Failure> {
    let open = clumps.is_empty() || setup.periodic == [None; 3];
    require(open, || "clumps in a period".into(), "take the period away, or give spheres")?;
    clumps.iter().try_for_each(|clump| {
        positive("radius of a clump", clump.radius)?;
        let sound = (1.0..=2.5).contains(&clump.aspect) && clump.axis.iter().all(|c| c.is_finite());
        let what = || format!("clump of aspect {} along {:?}", clump.aspect, clump.axis);
        require(sound && length(clump.axis) > 0.0, what, "give an aspect of 1 to 2.5 and a direction")
    })
}

fn require(holds: bool, what: impl FnOnce() -> String, remedy: &'static str) -> Result<(), Failure> {
    if holds { Ok(()) } else { Err(Failure::InvalidSetup { what: what(), remedy }) }
}

fn positive(name: &str, value: f64) -> Result<(), Failure> {
    require(value.is_finite() && value > 0.0, || format!("{name} is {value}"), "give a finite number above zero")
}

fn not_negative(name: &str, value: f64) -> Result<(), Failure> {
    require(value.is_finite() && value >= 0.0, || format!("{name} is {value}"), "give a finite number, zero or more")
}

fn grains(setup: &Setup) -> Result<(), Failure> {
    if let Some(remedy) = setup.grains.size.fault() {
        let what = format!("size distribution {:?} makes no radii", setup.grains.size);
        return Err(Failure::InvalidSetup { what, remedy });
    }
    positive("particle density", setup.grains.density)?;
    let aspect = setup.grains.aspect;
    require((1.0..=2.5).contains(&aspect), || format!("the aspect ratio of the grains is {aspect}"), "give 1 to 2.5")?;
    not_negative("sliding friction spread", setup.grains.sliding_spread)?;
    not_negative("rolling friction spread", setup.grains.rolling_spread)?;
    not_negative("drag", setup.grains.drag)?;
    setup.grains.species.iter().try_for_each(|one| species(setup, one))?;
    let others: f64 = setup.grains.species.iter().map(|species| species.fraction).sum();
    let fines = setup.grains.fines.map_or(0.0, |fines| fines.fraction);
    let room = || format!("further species and fines are {} of the grains", others + fines);
    require(others + fines < 1.0, room, "leave a share to the first species")?;
    let Some(fines) = setup.grains.fines else { return Ok(()) };
    positive("radius of the fines", fines.radius)?;
    let share = (0.0..1.0).contains(&fines.fraction);
    require(share, || format!("the fraction of fines is {}", fines.fraction), "give a number from 0 to below 1")
}

fn species(setup: &Setup, species: &Species) -> Result<(), Failure> {
    if let Some(remedy) = species.size.fault() {
        let what = format!("size distribution {:?} of a species makes no radii", species.size);
        return Err(Failure::InvalidSetup { what, remedy });
    }
    positive("fraction of a species", species.fraction)?;
    positive("density of a species", species.density)?;
    not_negative("sliding friction of a species", species.sliding_friction)?;
    not_negative("rolling friction of a species", species.rolling_friction)?;
    let spheres = setup.grains.aspect == 1.0;
    require(spheres, || "further species beside clumps".into(), "give an aspect ratio of 1")?;
    // Frictions are kept as multiples of the first species'.
    let law = &setup.contact;
    let expressible = |own: f64, law: f64| own == 0.0 || law > 0.0;
    let both = expressible(species.sliding_friction, law.sliding_friction)
        && expressible(species.rolling_friction, law.rolling_friction);
    require(both, || "a species has a friction that the first lacks".into(), "begin with a species that has it")
}

fn contact(setup: &Setup) -> Result<(), Failure> {
    let law = &setup.contact;
    positive("stiffness", law.stiffness)?;
    positive("wall stiffness ratio", law.wall_stiffness_ratio)?;
    positive("sliding stiffness ratio", law.sliding_stiffness_ratio)?;
    positive("rolling stiffness ratio", law.rolling_stiffness_ratio)?;
    not_negative("sliding damping factor", law.sliding_damping_factor)?;
    not_negative("rolling damping factor", law.rolling_damping_factor)?;
    not_negative("sliding friction", law.sliding_friction)?;
    not_negative("rolling friction", law.rolling_friction)?;
    match law.damping {
        Damping::Ratio(value) | Damping::MeanParticle(value) | Damping::PerMass(value) | Damping::Constant(value) => {
            not_negative("damping", value)?;
        }
        Damping::Restitution(value) => {
            require(value > 0.0 && value <= 1.0, || format!("restitution is {value}"), "give a number in (0, 1]")?;
        }
    }
    let Some(bridges) = &setup.bridges else { return Ok(()) };
    not_negative("bond number", bridges.bond_number)?;
    positive("liquid volume ratio", bridges.volume_ratio)?;
    not_negative("contact angle", bridges.contact_angle)?;
    not_negative("wall ratio of the liquid bridges", bridges.wall_ratio)
}

fn wall(wall: &Wall, before: &[Wall]) -> Result<(), Failure> {
    let name = &wall.name;
    let facet = |wall: &Wall| matches!(wall.shape, Shape::Triangle { .. });
    // The pieces of a mesh stand one after the other, so that the last wall tells.
    let of_mesh = facet(wall) && before.last().is_some_and(|last| facet(last) && last.name == *name);
    let fresh = of_mesh || before.iter().all(|other| other.name != *name);
    require(fresh, || format!("two walls are named `{name}`"), "give every wall and every mesh a name of its own")?;
    not_negative(&format!("sliding friction of wall `{name}`"), wall.species.sliding_friction)?;
    not_negative(&format!("rolling friction of wall `{name}`"), wall.species.rolling_friction)?;
    let real = |v: &Vec3| v.iter().all(|c| c.is_finite());
    let sound = match &wall.shape {
        Shape::Plane { point, normal } => real(point) && real(normal) && length(*normal) > 0.0,
        Shape::Rectangle { corner, edge_u, edge_v } => {
            let area = length(*edge_u) * length(*edge_v);
            // Edges written in decimals are perpendicular to rounding only.
            real(corner) && area > 0.0 && area.is_finite() && dot(*edge_u, *edge_v).abs() <= 1e-9 * area
        }
        Shape::Cone { axis, lower, upper } => {
            let numbers = axis.iter().chain(lower).chain(upper).all(|c| c.is_finite());
            numbers && lower[0] < upper[0] && lower[1].min(upper[1]) >= 0.0 && lower[1].max(upper[1]) > 0.0
        }
        Shape::Triangle { corners: [a, b, c] } => {
            real(a) && real(b) && real(c) && length(cross(sub(*b, *a), sub(*c, *a))) > 0.0
        }
        Shape::Cylinder { axis, radius } => axis.iter().all(|c| c.is_finite()) && radius.is_finite() && *radius > 0.0,
    };
    let what = || format!("wall `{name}` is degenerate or not finite: {:?}", wall.shape);
    require(sound, what, "give non-zero sizes, a rectangle two perpendicular edges, a cone its lower rim first")
}

fn fill(setup: &Setup) -> Result<(), Failure> {
    positive("fill volume", setup.fill.volume)?;
    match setup.fill.rise {
        Rise::PerAttempt(step) => positive("plane step of the filling", step)?,
        Rise::ToDensity(density) => {
            let share = density > 0.0 && density < 1.0;
            require(share, || format!("the density of the insertion is {density}"), "give a solid fraction")?;
        }
    }
    let sound = match setup.fill.area {
        FillArea::Rectangle { x, y } => {
            [x, y].iter().all(|[low, high]| low.is_finite() && high.is_finite() && low < high)
        }
        FillArea::Disc { axis, radius } => axis.iter().all(|c| c.is_finite()) && radius.is_finite() && radius > 0.0,
    };
    let sound = sound && setup.fill.base.is_finite();
    require(
        sound,
        || format!("fill area {:?} is empty or not finite", setup.fill.area),
        "give lower before upper bounds",
    )
}

fn events(setup: &Setup) -> Result<(), Failure> {
    for event in &setup.events {
        not_negative("time of an event", event.time)?;
        if let Action::RemoveWall { name } | Action::MoveWall { name, .. } = &event.action {
            let known = setup.walls.iter().any(|wall| wall.name == *name);
            let names = || setup.walls.iter().map(|wall| wall.name.as_str()).collect::<Vec<_>>().join(", ");
            require(
                known,
                || format!("an event names wall `{name}`, known are: {}", names()),
                "use one of these names",
            )?;
        }
        if let Action::SetGravity { gravity } = &event.action {
            let what = || "a gravity to come is not finite".to_owned();
            require(gravity.iter().all(|g| g.is_finite()), what, "give three finite numbers")?;
        }
        if let Action::MoveWall { name, velocity } = &event.action {
            let what = || format!("velocity of wall `{name}` is not finite");
            require(velocity.iter().all(|v| v.is_finite()), what, "give three finite numbers")?;
        }
    }
    Ok(())
}

fn region(name: &str, region: &Region) -> Result<(), Failure> {
    let sound = (0..3).all(|axis| region.lower[axis] < region.upper[axis]);
    require(sound, || format!("{name} is empty: {region:?}"), "give lower before upper bounds")
}
