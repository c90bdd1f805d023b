//! Random insertion of grains without contact (paper, section 3.2).
//!
//! A horizontal plane rises by a small step with every attempted grain. Each attempt draws a place in the area; it is refused
//! when the grain would touch a grain or a wall, lie behind a wall or in a mesh that is closed, and the same grain is tried
//! again elsewhere. (Drawing a new radius after a refusal would favour small grains: three times as many in the same volume,
//! which is no longer the sieved distribution.)
//! The grain that reaches the volume asked for is the last.
//! Places, sizes and frictions come from streams of their own, so that an effect on one of them leaves the others as they were.

use super::material::sphere_volume;
use super::outcome::Failure;
use super::particles::Grain;
use super::setup::{FillArea, Grains, Setup, Shape, Vec3, Wall};
use super::stl::{Facet, is_closed};
use super::vector::{dot, sub};
use super::walls::{Geometry, Surface};
use crate::rng::Stream;

/// The inserted grains, at rest, and the number of attempts.
#[derive(Debug, Clone, PartialEq)]
pub struct Filling {
    /// Grains in order of insertion.
    pub grains: Vec<Grain>,
    /// Attempts made.
    pub attempts: u64,
}

/// Fills the setup's area.
///
/// # Errors
/// [`Failure::FillOverflow`] when the plane leaves the domain before the volume is reached.
pub fn fill(setup: &Setup, seed: u64) -> Result<Filling, Failure> {
    let mut inserter = Inserter::new(setup, seed);
    let step = setup.fill.plane_step * setup.grains.size.mean();
    let (mut volume, mut attempts) = (0.0, 0_u64);
    let mut sizes = Stream::new(seed, "sizes");
    let mut radius = setup.grains.size.draw(&mut sizes);
    let mut fine_volume = 0.0;
    while volume < setup.fill.volume {
        let height = setup.fill.base + step * attempts as f64;
        if height > setup.domain.upper[2] {
            let inserted = inserter.grains.len();
            return Err(Failure::FillOverflow { height, inserted, volume, wanted: setup.fill.volume });
        }
        attempts += 1;
        if inserter.attempt(height, radius) {
            volume += sphere_volume(radius);
            // A fine grain whenever there are too few of them so far; the stream of the others goes on as without.
            radius = match setup.grains.fines.filter(|fines| fine_volume < fines.fraction * volume) {
                Some(fines) => {
                    fine_volume += sphere_volume(fines.radius);
                    fines.radius
                }
                None => setup.grains.size.draw(&mut sizes),
            };
        }
    }
    let mut grains = inserter.grains;
    spread_friction(&mut grains, &setup.grains, seed);
    Ok(Filling { grains, attempts })
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

/// Lognormal friction factors of mean 1 for every grain, where the setup asks for them.
fn spread_friction(grains: &mut [Grain], law: &Grains, seed: u64) {
    if law.sliding_spread > 0.0 {
        let mut draw = lognormal(law.sliding_spread, seed, "sliding friction spread");
        grains.iter_mut().for_each(|grain| grain.sliding_factor = draw());
    }
    if law.rolling_spread > 0.0 {
        let mut draw = lognormal(law.rolling_spread, seed, "rolling friction spread");
        grains.iter_mut().for_each(|grain| grain.rolling_factor = draw());
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
    surfaces: Vec<Surface>,
    /// For every surface the closed mesh that it is a facet of, as the number of its first surface.
    solids: Vec<Option<usize>>,
    /// Surfaces that a grain in the column may touch, with the heights between which it may.
    near_columns: Vec<Vec<(usize, [f64; 2])>>,
    places: Stream,
    grains: Vec<Grain>,
    origin: [f64; 2],
    width: f64,
    shape: [usize; 2],
    columns: Vec<Vec<[f64; 4]>>,
}

impl<'a> Inserter<'a> {
    fn new(setup: &'a Setup, seed: u64) -> Self {
        let [origin, upper] = bounds(&setup.fill.area);
        let width = 2.0 * setup.grains.size.largest();
        let shape = [0, 1].map(|axis| ((upper[axis] - origin[axis]) / width) as usize + 1);
        let surfaces: Vec<Surface> = setup.walls.iter().map(|wall| Surface::new(&wall.shape)).collect();
        let mut inserter = Self {
            setup,
            surfaces,
            solids: solids(&setup.walls),
            near_columns: vec![Vec::new(); shape[0] * shape[1]],
            places: Stream::new(seed, "positions"),
            grains: Vec::new(),
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
        let reach = self.setup.grains.size.largest();
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

    /// One attempt to place the next grain, of radius `radius`; whether it was placed.
    fn attempt(&mut self, height: f64, radius: f64) -> bool {
        let [x, y] = draw_place(&self.setup.fill.area, &mut self.places);
        let place = [x, y, height];
        let column = self.column_of(x, y);
        if !self.is_free(column, place, radius)
            || !self.is_free_across(place, radius)
            || !self.clears_walls(column, place, radius)
            || !self.is_inside(place)
            || self.is_in_solid(column, place)
        {
            return false;
        }
        let reach = height - self.width;
        let column = &mut self.columns[column[1] * self.shape[0] + column[0]];
        column.retain(|row| row[2] > reach);
        column.push([x, y, height, radius]);
        self.grains.push(Grain::new(radius, place));
        true
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

    /// Whether the images of the grain beyond the ends of the period would touch none.
    fn is_free_across(&self, place: Vec3, radius: f64) -> bool {
        let Some([low, high]) = self.setup.periodic else { return true };
        [low - high, high - low].into_iter().all(|shift| {
            let image = [place[0], place[1] + shift, place[2]];
            self.is_free(self.column_of(image[0], image[1]), image, radius)
        })
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
        let mut grains = vec![Grain::new(1.0, [0.0; 3]); 100_000];
        let law = Grains { sliding_spread: 0.3, ..Grains::default() };
        spread_friction(&mut grains, &law, 5);
        let n = grains.len() as f64;
        let mean = grains.iter().map(|g| g.sliding_factor).sum::<f64>() / n;
        let variance = grains.iter().map(|g| (g.sliding_factor - mean) * (g.sliding_factor - mean)).sum::<f64>() / n;
        // Five standard errors: 0.3/√n for the mean; about 0.3 √((2 + excess)/(4 n)) with excess ≈ 1.5 for the variation.
        assert!((mean - 1.0).abs() < 0.005, "{mean}");
        assert!((variance.sqrt() - 0.3).abs() < 0.006, "{variance}");
        assert!(grains.iter().all(|g| g.rolling_factor == 1.0));
    }
}
