//! Wall pieces: where a grain is nearest to them, and which of two pieces a grain touches where they meet.
//!
//! Takes a grain's centre, gives distance, normal and foot point. Wall contacts and their springs live in the contact lists.
//!
//! **Where two pieces meet.** A rectangle's edge is round: the foot of a grain beside it lies on the edge. Such an edge contact
//! is dropped when its foot also lies on another piece that is touched with its face, or whose edge is nearer to the grain's
//! centre, or equally near and earlier in the list. So a grain that crosses the joint of two coplanar rectangles, or an outer corner, always has one contact; in an inner
//! corner it has two, as it should. The dropped contact inherits the springs of the kept one, so that nothing is lost
//! on the way across. Pieces may share edges; they must not overlap with their faces.

use super::checkpoint::Stored;
use super::lanes::Number;
use super::setup::{Shape, Vec3, Wall, WallSpecies};
use super::vector::{add, cross, dot, length, pick, scale, splat, sub};

/// Two points closer than this are one point [m]: far above rounding of coordinates in metres, far below an overlap.
const SAME_POINT: f64 = 1e-9;

/// A wall in a running world.
#[derive(Debug, Clone)]
pub struct WallPiece {
    /// Name given in the setup.
    pub name: String,
    /// Friction.
    pub species: WallSpecies,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Whether it is still there.
    pub active: bool,
    /// Where it is now.
    pub surface: Surface,
}

/// A shape prepared for distances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Surface {
    /// Infinite plane.
    Plane(Plane),
    /// Bounded rectangle.
    Rectangle(Rectangle),
    /// Inside of a vertical cylinder.
    Cylinder(Cylinder),
}

/// Infinite plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of it [m].
    point: Vec3,
    /// Unit normal, towards the grains.
    normal: Vec3,
}

/// Bounded rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Corner [m].
    corner: Vec3,
    /// Unit direction of the first edge.
    u: Vec3,
    /// Unit direction of the second edge.
    v: Vec3,
    /// Lengths of the edges [m].
    size: [f64; 2],
}

/// Inside of a vertical cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Axis [m].
    axis: [f64; 2],
    /// Radius [m].
    radius: f64,
}

/// A surface that knows its nearest point, for one centre or a vector of them.
pub trait Geometry {
    /// Nearest point as seen from `centre`.
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T>;
}

/// Nearest point of a surface as seen from a grain's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Near<T: Number = f64> {
    /// Distance of the centre, negative behind a plane or outside a cylinder [m].
    pub distance: T,
    /// Unit vector from the surface to the centre.
    pub normal: [T; 3],
    /// Whether the nearest point lies on an edge, where another piece may begin.
    pub edge: T::Mask,
}

impl WallPiece {
    /// A wall of a setup, at rest.
    pub fn new(wall: &Wall) -> Self {
        Self {
            name: wall.name.clone(),
            species: wall.species,
            velocity: [0.0; 3],
            active: true,
            surface: Surface::new(&wall.shape),
        }
    }

    /// Appends how the wall moves and where it has got to.
    pub fn store(&self, out: &mut Vec<u8>) {
        self.velocity.put(out);
        self.active.put(out);
        self.surface.anchor().put(out);
    }

    /// Takes back what [`WallPiece::store`] appended.
    pub fn restore(&mut self, input: &mut &[u8]) -> Option<()> {
        self.velocity = Stored::take(input)?;
        self.active = Stored::take(input)?;
        self.surface.set_anchor(Stored::take(input)?);
        Some(())
    }

    /// Moves the wall by its velocity over a time [s].
    pub fn advance(&mut self, time: f64) {
        if self.velocity != [0.0; 3] {
            self.surface.shift(scale(self.velocity, time));
        }
    }
}

impl Surface {
    /// Prepares a shape.
    pub fn new(shape: &Shape) -> Self {
        match *shape {
            Shape::Plane { point, normal } => Self::Plane(Plane { point, normal: unit(normal) }),
            Shape::Rectangle { corner, edge_u, edge_v } => {
                let size = [length(edge_u), length(edge_v)];
                Self::Rectangle(Rectangle { corner, u: unit(edge_u), v: unit(edge_v), size })
            }
            Shape::Cylinder { axis, radius } => Self::Cylinder(Cylinder { axis, radius }),
        }
    }

    /// The point by which the surface is placed; a cylinder is endless in z and has none there.
    fn anchor(&self) -> Vec3 {
        match self {
            Self::Plane(plane) => plane.point,
            Self::Rectangle(rectangle) => rectangle.corner,
            Self::Cylinder(cylinder) => [cylinder.axis[0], cylinder.axis[1], 0.0],
        }
    }

    fn set_anchor(&mut self, anchor: Vec3) {
        match self {
            Self::Plane(plane) => plane.point = anchor,
            Self::Rectangle(rectangle) => rectangle.corner = anchor,
            Self::Cylinder(cylinder) => cylinder.axis = [anchor[0], anchor[1]],
        }
    }

    fn shift(&mut self, by: Vec3) {
        self.set_anchor(add(self.anchor(), by));
    }

    /// Whether the straight line from `a` to `b` goes through a rectangle; the far side of the other shapes is refused
    /// as a contact.
    pub fn separates(&self, a: Vec3, b: Vec3) -> bool {
        let Self::Rectangle(Rectangle { corner, u, v, size }) = *self else { return false };
        let normal = cross(u, v);
        let (from, to) = (dot(sub(a, corner), normal), dot(sub(b, corner), normal));
        if from * to >= 0.0 {
            return false;
        }
        let crossing = sub(add(a, scale(sub(b, a), from / (from - to))), corner);
        (0.0..=size[0]).contains(&dot(crossing, u)) && (0.0..=size[1]).contains(&dot(crossing, v))
    }
}

impl Geometry for Surface {
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        match self {
            Self::Plane(plane) => plane.near(centre),
            Self::Rectangle(rectangle) => rectangle.near(centre),
            Self::Cylinder(cylinder) => cylinder.near(centre),
        }
    }
}

fn unit(a: Vec3) -> Vec3 {
    scale(a, 1.0 / length(a))
}

impl Geometry for Plane {
    /// Distance s = (x - p)·n.
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        let Self { point, normal } = *self;
        let like = centre[0];
        let normal = splat(like, normal);
        let nowhere = like.less(like);
        Near { distance: dot(sub(centre, splat(like, point)), normal), normal, edge: nowhere }
    }
}

impl Geometry for Rectangle {
    /// Distance to the point `corner + a u + b v` with a, b clamped to the rectangle.
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        let Self { corner, u, v, size } = *self;
        let like = centre[0];
        let face = splat(like, cross(u, v));
        let (u, v) = (splat(like, u), splat(like, v));
        let from = sub(centre, splat(like, corner));
        let (a, edge_u) = clamp(dot(from, u), size[0]);
        let (b, edge_v) = clamp(dot(from, v), size[1]);
        let gap = sub(sub(from, scale(u, a)), scale(v, b));
        let distance = length(gap);
        // A centre exactly on the plate has no direction of its own; the face normal is as good as its opposite.
        let normal = pick(like.splat(0.0).less(distance), scale(gap, like.splat(1.0) / distance), face);
        Near { distance, normal, edge: edge_u | edge_v }
    }
}

impl Geometry for Cylinder {
    /// Distance R - ρ from the inside; the normal points to the axis.
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        let Self { axis, radius } = *self;
        let like = centre[0];
        let (x, y) = (centre[0] - like.splat(axis[0]), centre[1] - like.splat(axis[1]));
        let rho = (x * x + y * y).sqrt();
        let zero = like.splat(0.0);
        // On the axis every direction is the same.
        let inverse = T::pick(zero.less(rho), like.splat(1.0) / rho, zero);
        let nowhere = like.less(like);
        Near { distance: like.splat(radius) - rho, normal: [-x * inverse, -y * inverse, zero], edge: nowhere }
    }
}

/// The nearest value in [0, size], and whether it is on the boundary (within rounding).
#[inline(always)]
fn clamp<T: Number>(value: T, size: f64) -> (T, T::Mask) {
    let (zero, size) = (value.splat(0.0), value.splat(size));
    let point = value.splat(SAME_POINT);
    let edge = value.at_most(point) | (size - point).at_most(value);
    (T::pick(value.less(zero), zero, T::pick(size.less(value), size, value)), edge)
}

/// The wall that a grain really touches where its edge contact with `wall` falls on another piece, if so.
///
/// A piece touched with its face always wins over an edge that lies on it. Of two edges the nearer wins, then the earlier: an exact
/// comparison of the same two numbers from either side, so that never both are dropped or both kept.
pub fn keeper(walls: &[WallPiece], wall: usize, centre: Vec3, near: &Near) -> Option<usize> {
    let foot = sub(centre, scale(near.normal, near.distance));
    walls.iter().enumerate().position(|(other, piece)| {
        if other == wall || !piece.active || piece.surface.near(foot).distance.abs() > SAME_POINT {
            return false;
        }
        let rival = piece.surface.near(centre);
        !rival.edge || rival.distance < near.distance || (rival.distance == near.distance && other < wall)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(name: &str, corner: Vec3, edge_u: Vec3, edge_v: Vec3) -> WallPiece {
        let species = WallSpecies { sliding_friction: 0.5, rolling_friction: 1.0 };
        WallPiece::new(&Wall { name: name.to_owned(), shape: Shape::Rectangle { corner, edge_u, edge_v }, species })
    }

    #[test]
    fn a_rectangle_separates_what_lies_on_its_two_sides_only() {
        let incline = Shape::Rectangle { corner: [0.0; 3], edge_u: [1.0, 0.0, 1.0], edge_v: [0.0, 1.0, 0.0] };
        let surface = Surface::new(&incline);
        let parted = |x: f64, z: f64| surface.separates([-0.5, 0.5, z], [x, 0.5, z]);
        assert!(parted(0.6, 0.5) && parted(5.0, 0.99), "under the incline");
        assert!(
            !parted(0.4, 0.5) && !parted(5.0, 1.01) && !parted(0.6, -0.01),
            "above it, over its top, below its foot"
        );
    }

    /// Two coplanar squares that share the edge x = 1, and a wall that rises from it.
    fn pieces() -> Vec<WallPiece> {
        vec![
            piece("left", [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            piece("right", [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            piece("down", [2.0, 0.0, -1.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
        ]
    }

    /// Walls kept by a grain of radius 0.1 at `centre`.
    fn kept(centre: Vec3) -> Vec<usize> {
        let walls = pieces();
        (0..walls.len())
            .filter(|&w| {
                let near = walls[w].surface.near(centre);
                near.distance < 0.1 && !(near.edge && keeper(&walls, w, centre, &near).is_some())
            })
            .collect()
    }

    #[test]
    fn a_coplanar_joint_gives_one_contact_on_either_side_and_on_top_of_it() {
        assert_eq!(kept([0.98, 0.5, 0.09]), [0]);
        assert_eq!(kept([1.0, 0.5, 0.09]), [0]);
        assert_eq!(kept([1.02, 0.5, 0.09]), [1]);
        // Offsets around every scale at which a tolerance could flip the choice.
        for power in 3..18 {
            let offset = (0..power).fold(1.0, |x, _| x * 0.1);
            assert_eq!(kept([1.0 - offset, 0.5, 0.09]).len(), 1, "offset -{offset}");
            assert_eq!(kept([1.0 + offset, 0.5, 0.09]).len(), 1, "offset {offset}");
        }
    }

    #[test]
    fn an_outer_corner_gives_one_contact_all_the_way_round() {
        assert_eq!(kept([1.98, 0.5, 0.09]), [1]);
        assert_eq!(kept([2.05, 0.5, 0.05]), [1]);
        assert_eq!(kept([2.09, 0.5, -0.02]), [2]);
    }

    #[test]
    fn an_inner_corner_gives_two_contacts() {
        assert_eq!(kept([1.92, 0.5, -0.09]), [1, 2]);
    }

    #[test]
    fn a_free_edge_pushes_away_from_the_edge() {
        let near = pieces()[0].surface.near([-0.03, 0.5, 0.04]);
        assert!((near.distance - 0.05).abs() < 1e-15 && near.edge);
        assert!((near.normal[0] + 0.6).abs() < 1e-12 && (near.normal[2] - 0.8).abs() < 1e-12);
    }
}
