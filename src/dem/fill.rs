//! Random insertion of grains without contact (paper, section 3.2).
//!
//! A horizontal plane rises by a small step with every attempted grain, or with the volume below it. Each attempt draws a place in the area; it is refused
//! when the grain would touch a grain or a wall, lie behind a wall or in a mesh that is closed, and the same grain is tried
//! again elsewhere. (Drawing a new radius after a refusal would favour small grains: three times as many in the same volume,
//! which is no longer the sieved distribution.)
//! The grain that reaches the volume asked for is the last. A clump lies in any direction, with its lowest sphere in the plane.
//! Places, sizes, directions and frictions come from streams of their own, so that an effect on one of them leaves the others
//! as they were.

use super::clumps::{Clump, Row};
use super::material::sphere_volume;
use super::outcome::Failure;
use super::particles::Grain;
use super::period::Periods;
use super::setup::{FillArea, Grains, Rise, Setup, Shape, Vec3, Wall};
use super::stl::{Facet, is_closed};
use super::vector::{add, dot, length, scale, sub};
use super::walls::{Geometry, Surface};
use crate::rng::Stream;

/// The inserted grains, at rest, and the number of attempts.
#[derive(Debug, Clone, PartialEq)]
pub struct Filling {
    /// Spheres in order of insertion.
    pub grains: Vec<Grain>,
    /// Clumps in order of insertion: all grains are of one kind or the other.
    pub clumps: Vec<Clump>,
    /// Attempts made.
    pub attempts: u64,
}

/// Attempts in a row that may be refused at one height before the cloud counts as too dense to be made.
const MOST_REFUSED: u64 = 1_000_000;

/// Fills the setup's area.
///
/// # Errors
/// [`Failure::FillOverflow`] when the plane leaves the domain before the volume is reached, [`Failure::FillJammed`] when there
/// is no room at the density asked for.
pub fn fill(setup: &Setup, seed: u64) -> Result<Filling, Failure> {
    let mut inserter = Inserter::new(setup, seed);
    let mut plane = Plane::new(setup);
    let mut volume = 0.0;
    let mut sizes = Sizes::new(&setup.grains, seed);
    let mut bodies = Bodies::new(setup, seed);
    let mut body = bodies.draw(sizes.next(volume));
    while volume < setup.fill.volume {
        let (height, inserted) = (plane.height(volume), inserter.placed.len());
        if height > setup.domain.upper[2] {
            return Err(Failure::FillOverflow { height, inserted, volume, wanted: setup.fill.volume });
        }
        let placed = inserter.attempt(height, &body);
        if !plane.moves_on(placed, height) {
            return Err(Failure::FillJammed { height, inserted, attempts: MOST_REFUSED });
        }
        if placed {
            volume += sphere_volume(body.radius);
            body = bodies.draw(sizes.next(volume));
        }
    }
    let Frictions { sliding, rolling } = Frictions::draw(inserter.placed.len(), &setup.grains, seed);
    let own = |factors: &[f64], k: usize| factors.get(k).map_or(1.0, |factor| *factor);
    let mut filling = Filling { grains: Vec::new(), clumps: Vec::new(), attempts: plane.attempts };
    for (k, (body, centre)) in inserter.placed.iter().enumerate() {
        let [density_factor, of_sliding, of_rolling] = factors(setup, body.species);
        let (sliding_factor, rolling_factor) = (own(&sliding, k) * of_sliding, own(&rolling, k) * of_rolling);
        let grain = Grain { sliding_factor, rolling_factor, density_factor, ..Grain::new(body.radius, *centre) };
        match body.axis {
            None => filling.grains.push(grain),
            Some(axis) => {
                let clump = Clump::new(body.radius, setup.grains.aspect, *centre);
                filling.clumps.push(Clump { axis, sliding_factor, rolling_factor, ..clump });
            }
        }
    }
    Ok(filling)
}

/// The plane of insertion.
struct Plane<'a> {
    setup: &'a Setup,
    attempts: u64,
    /// Attempts refused since the last grain was placed.
    refused: u64,
    /// Where the first grain was placed [m].
    first: Option<f64>,
}

impl<'a> Plane<'a> {
    /// Rise per attempt until the first grain is placed, over the mean radius: where a density is asked for.
    const START: f64 = 1e-2;

    fn new(setup: &'a Setup) -> Self {
        Self { setup, attempts: 0, refused: 0, first: None }
    }

    /// Its height with this volume below it [m].
    fn height(&self, volume: f64) -> f64 {
        let rising = |step: f64| self.setup.fill.base + step * self.setup.grains.size.mean() * self.attempts as f64;
        match (self.setup.fill.rise, self.first) {
            (Rise::PerAttempt(step), _) => rising(step),
            (Rise::ToDensity(_), None) => rising(Self::START),
            (Rise::ToDensity(density), Some(first)) => first + volume / (density * extent(&self.setup.fill.area)),
        }
    }

    /// Takes note of an attempt at a height; whether there is hope for the next one.
    fn moves_on(&mut self, placed: bool, height: f64) -> bool {
        self.attempts += 1;
        self.refused = if placed { 0 } else { self.refused + 1 };
        self.first = self.first.or(placed.then_some(height));
        matches!(self.setup.fill.rise, Rise::PerAttempt(_)) || self.first.is_none() || self.refused < MOST_REFUSED
    }
}

/// Size of an area [m²].
fn extent(area: &FillArea) -> f64 {
    match *area {
        FillArea::Rectangle { x, y } => (x[1] - x[0]) * (y[1] - y[0]),
        FillArea::Disc { radius, .. } => std::f64::consts::PI * radius * radius,
    }
}

/// Density, sliding and rolling friction of a species over those of the setup [-].
fn factors(setup: &Setup, species: Option<usize>) -> [f64; 3] {
    let Some(species) = species.map(|k| &setup.grains.species[k]) else { return [1.0; 3] };
    let over = |own: f64, law: f64| if own == law { 1.0 } else { own / law };
    [
        over(species.density, setup.grains.density),
        over(species.sliding_friction, setup.contact.sliding_friction),
        over(species.rolling_friction, setup.contact.rolling_friction),
    ]
}

/// Gives the next grain its species and its radius.
struct Sizes<'a> {
    grains: &'a Grains,
    main: Stream,
    /// One stream per further species.
    others: Vec<Stream>,
    /// Volume so far of every further species, then of the fines [m³].
    volumes: Vec<f64>,
}

impl<'a> Sizes<'a> {
    fn new(grains: &'a Grains, seed: u64) -> Self {
        let others = (1..=grains.species.len()).map(|k| Stream::new(seed, &format!("sizes of species {k}"))).collect();
        Self { grains, main: Stream::new(seed, "sizes"), others, volumes: vec![0.0; grains.species.len() + 1] }
    }

    /// A grain of a further species, or a fine one, whenever there are too few of them in the volume so far [m³]; the
    /// stream of the others goes on as without.
    fn next(&mut self, volume: f64) -> (Option<usize>, f64) {
        let Grains { species, fines, size, .. } = self.grains;
        let missing = species.iter().zip(&self.volumes).position(|(species, own)| *own < species.fraction * volume);
        let place = missing.unwrap_or(species.len());
        let radius = match (missing, fines.filter(|fines| self.volumes[place] < fines.fraction * volume)) {
            (Some(k), _) => species[k].size.draw(&mut self.others[k]),
            (None, Some(fines)) => fines.radius,
            (None, None) => return (None, size.draw(&mut self.main)),
        };
        self.volumes[place] += sphere_volume(radius);
        (missing, radius)
    }
}

/// A grain to be placed.
#[derive(Clone)]
struct Body {
    /// Number of the further species, if it is of one.
    species: Option<usize>,
    /// Radius of the sphere of its volume [m].
    radius: f64,
    /// Direction of a clump.
    axis: Option<Vec3>,
    /// Its spheres: centres about its own and radii [m].
    spheres: Vec<[f64; 4]>,
}

/// Gives grains their shape.
struct Bodies {
    /// The row of spheres, where grains are clumps.
    row: Option<Row>,
    directions: Stream,
}

impl Bodies {
    fn new(setup: &Setup, seed: u64) -> Self {
        let aspect = setup.grains.aspect;
        Self { row: (aspect != 1.0).then(|| Row::new(aspect)), directions: Stream::new(seed, "directions") }
    }

    fn draw(&mut self, (species, radius): (Option<usize>, f64)) -> Body {
        let Some(row) = &self.row else {
            return Body { species, radius, axis: None, spheres: vec![[0.0, 0.0, 0.0, radius]] };
        };
        let direction = [(); 3].map(|()| self.directions.normal());
        let axis = scale(direction, 1.0 / length(direction));
        let size = row.sphere_radius(radius);
        let sphere = |centre: &f64| {
            let [x, y, z] = scale(axis, centre * size);
            [x, y, z, size]
        };
        Body { species, radius, axis: Some(axis), spheres: row.centres.iter().map(sphere).collect() }
    }
}

/// Draws a place in the area [m].
fn draw_place(area: &FillArea, stream: &mut Stream) -> [f64; 2] {
    match *area {
        FillArea::Rectangle { x, y } => [stream.uniform_in(x[0], x[1]), stream.uniform_in(y[0], y[1])],
        FillArea::Disc { axis, radius } => {
            let angle = stream.uniform_in(0.0, 2.0 * std::f64::consts::PI);
            let distance = stream.uniform_in(0.0, radius);
            [axis[0] + distance * libm::cos(angle), axis[1] + distance * libm::sin(angle)]
        }
    }
}

/// Bounding rectangle of the area: lower and upper corner.
fn bounds(area: &FillArea) -> [[f64; 2]; 2] {
    match *area {
        FillArea::Rectangle { x, y } => [[x[0], y[0]], [x[1], y[1]]],
        FillArea::Disc { axis: [x, y], radius } => [[x - radius, y - radius], [x + radius, y + radius]],
    }
}

/// Friction of every grain over the law's; empty where all grains are alike.
struct Frictions {
    sliding: Vec<f64>,
    rolling: Vec<f64>,
}

impl Frictions {
    /// Lognormal factors of mean 1 where the setup asks for them.
    fn draw(grains: usize, law: &Grains, seed: u64) -> Self {
        let factors = |variation: f64, purpose: &str| match variation > 0.0 {
            true => std::iter::repeat_with(lognormal(variation, seed, purpose)).take(grains).collect(),
            false => Vec::new(),
        };
        Self {
            sliding: factors(law.sliding_spread, "sliding friction spread"),
            rolling: factors(law.rolling_spread, "rolling friction spread"),
        }
    }
}

/// Lognormal numbers of mean 1 and coefficient of variation cv: ln X ~ N(-σ²/2, σ²) with σ² = ln(1 + cv²).
fn lognormal(variation: f64, seed: u64, purpose: &str) -> impl FnMut() -> f64 {
    let variance = libm::log(1.0 + variation * variation);
    let mut stream = Stream::new(seed, purpose);
    move || libm::exp(variance.sqrt() * stream.normal() - 0.5 * variance)
}

/// Insertion in progress: columns of grains that the plane can still touch.
struct Inserter<'a> {
    setup: &'a Setup,
    periods: Periods,
    surfaces: Vec<Surface>,
    /// For every surface the closed mesh that it is a facet of, as the number of its first surface.
    solids: Vec<Option<usize>>,
    /// Surfaces that a grain in the column may touch, with the heights between which it may.
    near_columns: Vec<Vec<(usize, [f64; 2])>>,
    places: Stream,
    /// Grains with their centres [m].
    placed: Vec<(Body, Vec3)>,
    origin: [f64; 2],
    width: f64,
    shape: [usize; 2],
    columns: Vec<Vec<[f64; 4]>>,
}

impl<'a> Inserter<'a> {
    fn new(setup: &'a Setup, seed: u64) -> Self {
        let [origin, upper] = bounds(&setup.fill.area);
        let width = 2.0 * setup.grains.largest();
        let shape = [0, 1].map(|axis| ((upper[axis] - origin[axis]) / width) as usize + 1);
        let surfaces: Vec<Surface> = setup.walls.iter().map(|wall| Surface::new(&wall.shape)).collect();
        let mut inserter = Self {
            setup,
            periods: Periods::new(setup.periodic),
            surfaces,
            solids: solids(&setup.walls),
            near_columns: vec![Vec::new(); shape[0] * shape[1]],
            places: Stream::new(seed, "positions"),
            placed: Vec::new(),
            origin,
            width,
            shape,
            columns: vec![Vec::new(); shape[0] * shape[1]],
        };
        inserter.place_surfaces();
        inserter
    }

    /// Notes in every column the surfaces about it, so that a mesh of many triangles costs no more than a few of them.
    fn place_surfaces(&mut self) {
        let reach = self.setup.grains.largest();
        for (k, surface) in self.surfaces.iter().enumerate() {
            let everywhere = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
            let [lower, upper] = surface.bounds().unwrap_or(everywhere);
            let (lower, upper) = (lower.map(|x| x - reach), upper.map(|x| x + reach));
            let ([x0, y0], [x1, y1]) = (self.column_of(lower[0], lower[1]), self.column_of(upper[0], upper[1]));
            for (y, x) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (y, x))) {
                self.near_columns[y * self.shape[0] + x].push((k, [lower[2], upper[2]]));
            }
        }
    }

    /// One attempt to place a grain; whether it was placed.
    fn attempt(&mut self, height: f64, body: &Body) -> bool {
        let [x, y] = draw_place(&self.setup.fill.area, &mut self.places);
        let lowest = body.spheres.iter().fold(0.0_f64, |lowest, sphere| lowest.min(sphere[2]));
        let centre = [x, y, height - lowest];
        if !body.spheres.iter().all(|sphere| self.fits(add(centre, [sphere[0], sphere[1], sphere[2]]), sphere[3])) {
            return false;
        }
        let passed = height - self.width;
        for sphere in &body.spheres {
            let [x, y, z] = add(centre, [sphere[0], sphere[1], sphere[2]]);
            let column = self.column_of(x, y);
            let column = &mut self.columns[column[1] * self.shape[0] + column[0]];
            column.retain(|row| row[2] > passed);
            column.push([x, y, z, sphere[3]]);
        }
        self.placed.push((body.clone(), centre));
        true
    }

    /// Whether a sphere here would touch nothing and be inside.
    fn fits(&self, place: Vec3, radius: f64) -> bool {
        let column = self.column_of(place[0], place[1]);
        self.is_free(column, place, radius)
            && self.is_free_across(place, radius)
            && self.clears_walls(column, place, radius)
            && self.is_inside(place)
            && !self.is_in_solid(column, place)
    }

    fn column_of(&self, x: f64, y: f64) -> [usize; 2] {
        let index =
            |value: f64, axis: usize| (((value - self.origin[axis]) / self.width) as usize).min(self.shape[axis] - 1);
        [index(x, 0), index(y, 1)]
    }

    /// Whether a grain here would touch none; the column itself is looked at first, because it refuses most often.
    fn is_free(&self, [cx, cy]: [usize; 2], place: Vec3, radius: f64) -> bool {
        let free = |x: usize, y: usize| {
            self.columns[y * self.shape[0] + x].iter().rev().all(|row| {
                let (d, sum) = (sub(place, [row[0], row[1], row[2]]), row[3] + radius);
                dot(d, d) > sum * sum
            })
        };
        let near = |c: usize, axis: usize| c.saturating_sub(1)..=(c + 1).min(self.shape[axis] - 1);
        free(cx, cy) && near(cy, 1).all(|y| near(cx, 0).all(|x| (x == cx && y == cy) || free(x, y)))
    }

    /// Whether the images of the grain beyond the ends of a period would touch none.
    fn is_free_across(&self, place: Vec3, radius: f64) -> bool {
        let free = |image: Vec3| self.is_free(self.column_of(image[0], image[1]), image, radius);
        self.periods.images(place).all(free)
    }

    fn clears_walls(&self, [cx, cy]: [usize; 2], place: Vec3, radius: f64) -> bool {
        self.near_columns[cy * self.shape[0] + cx].iter().all(|(k, [low, high])| {
            !(*low..=*high).contains(&place[2]) || self.surfaces[*k].near(place).distance > radius
        })
    }

    /// Whether no wall stands between the place and the middle of the area at its height: under the incline of a hopper is outside.
    fn is_inside(&self, place: Vec3) -> bool {
        let [lower, upper] = bounds(&self.setup.fill.area);
        let middle = [0.5 * (lower[0] + upper[0]), 0.5 * (lower[1] + upper[1]), place[2]];
        let mut bare = self.surfaces.iter().zip(&self.solids).filter(|(_, solid)| solid.is_none());
        bare.all(|(surface, _)| !surface.separates(middle, place))
    }

    /// Whether the place lies in a closed mesh: the way straight up leaves it an odd number of times.
    fn is_in_solid(&self, [cx, cy]: [usize; 2], place: Vec3) -> bool {
        let mut left: Vec<usize> = Vec::new();
        for (k, [_, high]) in &self.near_columns[cy * self.shape[0] + cx] {
            let above = [place[0], place[1], high.max(place[2]) + self.width];
            left.extend(self.solids[*k].filter(|_| self.surfaces[*k].separates(place, above)));
        }
        left.sort_unstable();
        left.chunk_by(|a, b| a == b).any(|same| same.len() % 2 == 1)
    }
}

/// For every wall the closed mesh that it belongs to, as the number of the mesh's first wall.
fn solids(walls: &[Wall]) -> Vec<Option<usize>> {
    let corners = |wall: &Wall| match &wall.shape {
        Shape::Triangle { corners } => Some(*corners),
        _ => None,
    };
    let mut solids = Vec::new();
    for mesh in walls.chunk_by(|a, b| a.name == b.name) {
        let facets: Option<Vec<Facet>> = mesh.iter().map(corners).collect();
        let solid = facets.filter(|facets| is_closed(facets)).map(|_| solids.len());
        solids.resize(solids.len() + mesh.len(), solid);
    }
    solids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_spread_has_mean_one_and_the_stated_variation() {
        let law = Grains { sliding_spread: 0.3, ..Grains::default() };
        let Frictions { sliding, rolling } = Frictions::draw(100_000, &law, 5);
        let n = sliding.len() as f64;
        let mean = sliding.iter().sum::<f64>() / n;
        let variance = sliding.iter().map(|factor| (factor - mean) * (factor - mean)).sum::<f64>() / n;
        // Five standard errors: 0.3/√n for the mean; about 0.3 √((2 + excess)/(4 n)) with excess ≈ 1.5 for the variation.
        assert!((mean - 1.0).abs() < 0.005, "{mean}");
        assert!((variance.sqrt() - 0.3).abs() < 0.006, "{variance}");
        assert!(rolling.is_empty());
    }
}
