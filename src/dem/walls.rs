//! Wall pieces: where a grain is nearest to them, and which of two pieces a grain touches where they meet.
//!
//! Takes a grain's centre, gives distance, normal and foot point. Wall contacts and their springs live in the contact lists.
//!
//! **Where two pieces meet.** A rectangle's edge is round: the foot of a grain beside it lies on the edge. Such an edge contact
//! is dropped when its foot also lies on another piece that is touched with its face, or whose edge is nearer to the grain's
//! centre, or equally near and earlier in the list. So a grain that crosses the joint of two coplanar rectangles, or an outer corner, always has one contact; in an inner
//! corner it has two, as it should. The same holds for rims of cones and for the edges and vertices of triangles. The dropped contact inherits the springs of the kept one, so that nothing is lost
//! on the way across. Pieces may share edges; they must not overlap with their faces.

use super::checkpoint::Stored;
use super::lanes::Number;
use super::setup::{Shape, Vec3, Wall, WallSpecies};
use super::vector::{add, cross, dot, length, pick, scale, splat, sub};

/// Two points closer than this are one point [m]: far above rounding of coordinates in metres, far below an overlap.
pub const SAME_POINT: f64 = 1e-9;

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
    /// Frustum of a vertical cone.
    Cone(Cone),
    /// Triangle.
    Triangle(Triangle),
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

/// Frustum of a vertical cone: in the plane of axis and centre the line from the lower rim to the upper one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Axis [m].
    axis: [f64; 2],
    /// Radius and height of the lower rim [m].
    from: [f64; 2],
    /// Unit direction (radius, height) to the upper rim.
    along: [f64; 2],
    /// Distance between the rims along the surface [m].
    size: f64,
}

/// Triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// First corner [m].
    corner: Vec3,
    /// Unit normal.
    normal: Vec3,
    /// The three edges, in order round the triangle.
    edges: [Edge; 3],
}

/// An edge of a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Edge {
    /// Where it starts, relative to the first corner [m].
    from: Vec3,
    /// Unit direction.
    along: Vec3,
    /// Unit vector in the plane, towards the inside.
    inward: Vec3,
    /// Length [m].
    size: f64,
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

    /// Whether the wall moves.
    pub fn moves(&self) -> bool {
        self.velocity != [0.0; 3]
    }

    /// Moves the wall by its velocity over a time [s].
    pub fn advance(&mut self, time: f64) {
        if self.moves() {
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
            Shape::Cone { axis, lower: [bottom, inner], upper: [top, outer] } => {
                let (out, up) = (outer - inner, top - bottom);
                let size = (out * out + up * up).sqrt();
                Self::Cone(Cone { axis, from: [inner, bottom], along: [out / size, up / size], size })
            }
            Shape::Triangle { corners } => Self::Triangle(Triangle::new(corners)),
        }
    }

    /// Lower and upper corner of the smallest box round the surface [m]; `None` where it has no end.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let round = |points: &[Vec3]| {
            let extreme = |pick: fn(f64, f64) -> f64| {
                [0, 1, 2].map(|c| points.iter().map(|point| point[c]).fold(points[0][c], pick))
            };
            Some([extreme(f64::min), extreme(f64::max)])
        };
        match *self {
            Self::Plane(_) | Self::Cylinder(_) => None,
            Self::Rectangle(Rectangle { corner, u, v, size }) => {
                let (a, b) = (add(corner, scale(u, size[0])), add(corner, scale(v, size[1])));
                round(&[corner, a, b, add(a, sub(b, corner))])
            }
            Self::Cone(Cone { axis: [x, y], from: [radius, bottom], along, size }) => {
                let (widest, top) = (radius.max(radius + along[0] * size), bottom + along[1] * size);
                round(&[[x - widest, y - widest, bottom], [x + widest, y + widest, top]])
            }
            Self::Triangle(Triangle { corner, edges, .. }) => round(&edges.map(|edge| add(corner, edge.from))),
        }
    }

    /// The point by which the surface is placed; a cylinder is endless in z and has none there.
    fn anchor(&self) -> Vec3 {
        match self {
            Self::Plane(plane) => plane.point,
            Self::Rectangle(rectangle) => rectangle.corner,
            Self::Cylinder(cylinder) => [cylinder.axis[0], cylinder.axis[1], 0.0],
            Self::Cone(cone) => [cone.axis[0], cone.axis[1], cone.from[1]],
            Self::Triangle(triangle) => triangle.corner,
        }
    }

    fn set_anchor(&mut self, anchor: Vec3) {
        match self {
            Self::Plane(plane) => plane.point = anchor,
            Self::Rectangle(rectangle) => rectangle.corner = anchor,
            Self::Cylinder(cylinder) => cylinder.axis = [anchor[0], anchor[1]],
            Self::Cone(cone) => (cone.axis, cone.from[1]) = ([anchor[0], anchor[1]], anchor[2]),
            Self::Triangle(triangle) => triangle.corner = anchor,
        }
    }

    fn shift(&mut self, by: Vec3) {
        self.set_anchor(add(self.anchor(), by));
    }

    /// Whether the straight line from `a` to `b` goes through a rectangle, a triangle or a cone; the far side of a plane or a
    /// cylinder is refused as a contact.
    pub fn separates(&self, a: Vec3, b: Vec3) -> bool {
        match self {
            Self::Rectangle(Rectangle { corner, u, v, size }) => {
                crossing(*corner, cross(*u, *v), a, b).is_some_and(|point| {
                    (0.0..=size[0]).contains(&dot(point, *u)) && (0.0..=size[1]).contains(&dot(point, *v))
                })
            }
            Self::Triangle(Triangle { corner, normal, edges }) => crossing(*corner, *normal, a, b)
                .is_some_and(|point| edges.iter().all(|edge| dot(sub(point, edge.from), edge.inward) >= 0.0)),
            Self::Cone(cone) => cone.separates(a, b),
            Self::Plane(_) | Self::Cylinder(_) => false,
        }
    }
}

/// Where the straight line from `a` to `b` goes through a plane, relative to `origin` in it.
fn crossing(origin: Vec3, normal: Vec3, a: Vec3, b: Vec3) -> Option<Vec3> {
    let (from, to) = (dot(sub(a, origin), normal), dot(sub(b, origin), normal));
    (from * to < 0.0).then(|| sub(add(a, scale(sub(b, a), from / (from - to))), origin))
}

impl Triangle {
    fn new(corners: [Vec3; 3]) -> Self {
        let [a, b, c] = corners;
        let normal = unit(cross(sub(b, a), sub(c, a)));
        let edge = |from: Vec3, to: Vec3| {
            let along = sub(to, from);
            let direction = unit(along);
            Edge { from: sub(from, a), along: direction, inward: cross(normal, direction), size: length(along) }
        };
        Self { corner: a, normal, edges: [edge(a, b), edge(b, c), edge(c, a)] }
    }
}

impl Cone {
    /// Whether the straight line from `a` to `b` goes through the surface: ρ² = r(z)² is a quadratic equation along it.
    fn separates(&self, a: Vec3, b: Vec3) -> bool {
        let Self { axis, from, along, size } = *self;
        let [x, y, z] = [a[0] - axis[0], a[1] - axis[1], a[2] - from[1]];
        let [u, v, w] = sub(b, a);
        let slope = along[0] / along[1];
        let (radius, widening) = (from[0] + slope * z, slope * w);
        let second = u * u + v * v - widening * widening;
        let first = x * u + y * v - radius * widening;
        let zeroth = x * x + y * y - radius * radius;
        let hits = |s: f64| (0.0..=1.0).contains(&s) && (0.0..=along[1] * size).contains(&(z + s * w));
        if second == 0.0 {
            return first != 0.0 && hits(-0.5 * zeroth / first);
        }
        let root = first * first - second * zeroth;
        root >= 0.0 && (hits((-first - root.sqrt()) / second) || hits((-first + root.sqrt()) / second))
    }
}

impl Geometry for Surface {
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        match self {
            Self::Plane(plane) => plane.near(centre),
            Self::Rectangle(rectangle) => rectangle.near(centre),
            Self::Cylinder(cylinder) => cylinder.near(centre),
            Self::Cone(cone) => cone.near(centre),
            Self::Triangle(triangle) => triangle.near(centre),
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

impl Geometry for Cone {
    /// Distance to the nearest point of the line between the rims, in the plane of axis and centre.
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        let Self { axis, from, along, size } = *self;
        let like = centre[0];
        let (zero, one) = (like.splat(0.0), like.splat(1.0));
        let (x, y) = (centre[0] - like.splat(axis[0]), centre[1] - like.splat(axis[1]));
        let rho = (x * x + y * y).sqrt();
        // On the axis every direction is the same.
        let off_axis = zero.less(rho);
        let (cosine, sine) = (T::pick(off_axis, x / rho, one), T::pick(off_axis, y / rho, zero));
        let (out, up) = (like.splat(along[0]), like.splat(along[1]));
        let (a, b) = (rho - like.splat(from[0]), centre[2] - like.splat(from[1]));
        let (t, edge) = clamp(a * out + b * up, size);
        let (a, b) = (a - out * t, b - up * t);
        let distance = (a * a + b * b).sqrt();
        // A centre exactly on the surface has no direction of its own; the one towards the axis is as good as its opposite.
        let apart = zero.less(distance);
        let (radial, axial) = (T::pick(apart, a / distance, -up), T::pick(apart, b / distance, out));
        Near { distance, normal: [radial * cosine, radial * sine, axial], edge }
    }
}

impl Geometry for Triangle {
    /// Distance to the plane where the centre's foot lies inside, else to the nearest of the edges.
    #[inline(always)]
    fn near<T: Number>(&self, centre: [T; 3]) -> Near<T> {
        let Self { corner, normal, edges } = *self;
        let like = centre[0];
        let from = sub(centre, splat(like, corner));
        let face = splat(like, normal);
        let (side_a, gap_a) = edges[0].gap(from);
        let (side_b, gap_b) = edges[1].gap(from);
        let (side_c, gap_c) = edges[2].gap(from);
        let gap = pick(dot(gap_b, gap_b).less(dot(gap_a, gap_a)), gap_b, gap_a);
        let gap = pick(dot(gap_c, gap_c).less(dot(gap, gap)), gap_c, gap);
        let (zero, point) = (like.splat(0.0), like.splat(SAME_POINT));
        let inside = zero.at_most(side_a) & zero.at_most(side_b) & zero.at_most(side_c);
        let gap = pick(inside, scale(face, dot(from, face)), gap);
        let distance = length(gap);
        let normal = pick(zero.less(distance), scale(gap, like.splat(1.0) / distance), face);
        let edge = side_a.at_most(point) | side_b.at_most(point) | side_c.at_most(point);
        Near { distance, normal, edge }
    }
}

impl Edge {
    /// How far inside of the edge a point lies in the plane, and the way from the edge's nearest point to it.
    #[inline(always)]
    fn gap<T: Number>(&self, point: [T; 3]) -> (T, [T; 3]) {
        let like = point[0];
        let from = sub(point, splat(like, self.from));
        let along = splat(like, self.along);
        let (t, _) = clamp(dot(from, along), self.size);
        (dot(from, splat(like, self.inward)), sub(from, scale(along, t)))
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

/// The wall that a grain really touches where its edge contact with `wall` falls on another piece, if so; `rivals` are the
/// walls that the grain may touch, in order.
///
/// A piece touched with its face always wins over an edge that lies on it. Of two edges the nearer wins, then the earlier: an exact
/// comparison of the same two numbers from either side, so that never both are dropped or both kept. Many triangles meet at a
/// vertex; there the one is named that wins over all, since springs are handed to it.
pub fn keeper(walls: &[WallPiece], rivals: &[u32], wall: usize, centre: Vec3, near: &Near) -> Option<usize> {
    let foot = sub(centre, scale(near.normal, near.distance));
    let mut winners = rivals.iter().map(|&other| other as usize).filter_map(|other| {
        let piece = &walls[other];
        if other == wall || !piece.active || piece.surface.near(foot).distance.abs() > SAME_POINT {
            return None;
        }
        let rival = piece.surface.near(centre);
        let wins = !rival.edge || rival.distance < near.distance || (rival.distance == near.distance && other < wall);
        wins.then_some((other, rival))
    });
    if !matches!(walls[wall].surface, Surface::Triangle(_)) {
        return winners.next().map(|(other, _)| other);
    }
    let better = |a: (usize, Near), b: (usize, Near)| {
        let first = match (a.1.edge, b.1.edge) {
            (true, true) => a.1.distance <= b.1.distance,
            (a_on_edge, _) => !a_on_edge,
        };
        if first { a } else { b }
    };
    winners.reduce(better).map(|(other, _)| other)
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
        touched(&pieces(), centre)
    }

    fn touched(walls: &[WallPiece], centre: Vec3) -> Vec<usize> {
        let all: Vec<u32> = (0..walls.len() as u32).collect();
        (0..walls.len())
            .filter(|&w| {
                let near = walls[w].surface.near(centre);
                near.distance < 0.1 && !(near.edge && keeper(walls, &all, w, centre, &near).is_some())
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

    /// Nearest point of a triangle by the regions of its corners, edges and face (Ericson, Real-Time Collision Detection, 5.1.5).
    fn nearest([a, b, c]: [Vec3; 3], p: Vec3) -> Vec3 {
        let (ab, ac, ap, bp, cp) = (sub(b, a), sub(c, a), sub(p, a), sub(p, b), sub(p, c));
        let (d1, d2, d3, d4, d5, d6) = (dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp));
        let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
        if d1 <= 0.0 && d2 <= 0.0 {
            a
        } else if d3 >= 0.0 && d4 <= d3 {
            b
        } else if d6 >= 0.0 && d5 <= d6 {
            c
        } else if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            add(a, scale(ab, d1 / (d1 - d3)))
        } else if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            add(a, scale(ac, d2 / (d2 - d6)))
        } else if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            add(b, scale(sub(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6))))
        } else {
            add(a, add(scale(ab, vb / (va + vb + vc)), scale(ac, vc / (va + vb + vc))))
        }
    }

    #[test]
    fn a_triangle_is_as_near_as_its_nearest_point() {
        let mut stream = crate::rng::Stream::new(1, "triangles");
        for _ in 0..2000 {
            let mut point = || [0.0; 3].map(|_: f64| stream.uniform_in(-1.0, 1.0));
            let (corners, centre) = ([point(), point(), point()], point());
            let surface = Surface::new(&Shape::Triangle { corners });
            let (near, foot) = (surface.near(centre), nearest(corners, centre));
            let gap = sub(centre, foot);
            assert!((near.distance - length(gap)).abs() < 1e-9, "{corners:?} {centre:?}");
            assert!(length(sub(scale(near.normal, near.distance), gap)) < 1e-7);
            let [lower, upper] = surface.bounds().expect("a triangle has ends");
            assert!((0..3).all(|c| lower[c] - 1e-12 <= foot[c] && foot[c] <= upper[c] + 1e-12));
        }
    }

    #[test]
    fn a_cone_is_near_inside_outside_and_at_its_rims() {
        // 45 degrees, from radius 1 at z = 0 to radius 2 at z = 1, about the axis through (3, 4).
        let cone = Shape::Cone { axis: [3.0, 4.0], lower: [0.0, 1.0], upper: [1.0, 2.0] };
        let surface = Surface::new(&cone);
        let half = 0.5_f64.sqrt();
        let seen = |out: f64, z: f64| surface.near([3.0 + 0.6 * out, 4.0 + 0.8 * out, z]);
        let is = |near: Near, distance: f64, out: f64, up: f64, edge: bool| {
            let exact = [0.6 * out, 0.8 * out, up];
            let close = (near.distance - distance).abs() < 1e-12 && length(sub(near.normal, exact)) < 1e-12;
            assert!(close && near.edge == edge, "{near:?}");
        };
        is(seen(1.5 - 0.2 * half, 0.5 + 0.2 * half), 0.2, -half, half, false);
        is(seen(1.5 + 0.2 * half, 0.5 - 0.2 * half), 0.2, half, -half, false);
        is(seen(2.0, 1.3), 0.3, 0.0, 1.0, true);
        is(seen(0.6, 0.0), 0.4, -1.0, 0.0, true);
        assert_eq!(surface.bounds(), Some([[1.0, 2.0, 0.0], [5.0, 6.0, 1.0]]));
        let parted = |out: f64, z: f64| surface.separates([3.0, 4.0, z], [3.0 + out, 4.0, z]);
        assert!(parted(1.6, 0.5) && !parted(1.4, 0.5) && !parted(5.0, 1.1) && parted(5.0, 0.9));
        assert!(surface.separates([3.0, 4.0, -0.5], [5.5, 4.0, 1.0]), "through the side");
        assert!(!surface.separates([3.0, 4.0, -1.0], [5.5, 4.0, 1.0]), "out through the bottom");
        assert!(!surface.separates([3.0, 4.0, -1.0], [3.5, 4.0, 2.0]), "along the inside");
        let pipe = Surface::new(&Shape::Cone { axis: [0.0; 2], lower: [0.0, 1.0], upper: [1.0, 1.0] });
        assert!(pipe.separates([0.0, 0.0, 0.5], [2.0, 0.0, 0.5]) && !pipe.separates([0.0, 0.0, 1.5], [2.0, 0.0, 1.5]));
    }

    /// Six triangles round a vertex, flat: wherever a grain lies it touches one of them.
    #[test]
    fn a_vertex_of_many_triangles_gives_one_contact_all_round() {
        let species = WallSpecies { sliding_friction: 0.5, rolling_friction: 1.0 };
        let rim =
            [[1.0, 0.0, 0.0], [0.5, 0.9, 0.0], [-0.5, 0.8, 0.0], [-1.0, 0.1, 0.0], [-0.4, -0.9, 0.0], [0.6, -0.8, 0.0]];
        let facet = |k: usize| Shape::Triangle { corners: [[0.0; 3], rim[k], rim[(k + 1) % 6]] };
        let walls: Vec<WallPiece> =
            (0..6).map(|k| WallPiece::new(&Wall { name: "fan".to_owned(), shape: facet(k), species })).collect();
        for power in 1..18 {
            let offset = (0..power).fold(1.0, |x, _| x * 0.1);
            for k in 0..24 {
                let angle = f64::from(k) * 0.2618;
                let centre = [offset * angle.cos(), offset * angle.sin(), 0.09];
                assert_eq!(touched(&walls, centre).len(), 1, "offset {offset}, angle {angle}");
            }
        }
    }
}
