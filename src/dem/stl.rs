//! Triangle meshes from STL files, binary or ASCII, as walls for equipment of any shape.
//!
//! Takes the bytes of a file and a factor that turns its numbers into metres; gives facets, and of facets one wall piece
//! each, all under one name. The facets' own normals are ignored: triangles are touched from both sides. Vertices that are equal in the file
//! are equal here, so neighbours share their edges exactly. Facets without area cover nothing and are left out.

use super::setup::{Shape, Vec3, Wall, WallSpecies};
use super::vector::{cross, length, scale, sub};

/// Bytes before the facets of a binary file: a text and the number of facets.
const HEAD: usize = 84;
/// Bytes of a facet: normal and three vertices in single precision, and two bytes that mean nothing.
const FACET: usize = 50;

/// Corners of a triangle [m].
pub type Facet = [Vec3; 3];

/// Why a file gives no mesh.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StlError {
    /// Neither form of an STL file.
    #[error(
        "this is no STL file: it neither starts with `solid` and holds vertices, nor has it the {expected} bytes that a binary \
         file of {facets} facets has, but {found}; export it again"
    )]
    NotStl {
        /// Facets that the head of a binary file claims.
        facets: u32,
        /// Bytes such a file has.
        expected: u64,
        /// Bytes found.
        found: usize,
    },
    /// A vertex that is no point.
    #[error("line {line}: `{text}` is no vertex of three finite numbers")]
    Vertex {
        /// Line, from 1.
        line: usize,
        /// What stands there.
        text: String,
    },
    /// A number of vertices that makes no triangles, or a coordinate that is not finite.
    #[error("facet {facet} has not three finite vertices; export the file again")]
    Facet {
        /// Facet, from 1.
        facet: usize,
    },
    /// No facet has an area.
    #[error("the file holds no facet with an area")]
    Empty,
}

/// The triangles of a file that have an area, with every coordinate times `factor` [m].
///
/// # Errors
/// [`StlError`] for bytes that are no STL file.
pub fn facets(bytes: &[u8], factor: f64) -> Result<Vec<Facet>, StlError> {
    let points = vertices(bytes)?;
    let (triples, rest) = points.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(StlError::Facet { facet: triples.len() + 1 });
    }
    let mut facets = Vec::new();
    for (k, triple) in triples.iter().enumerate() {
        let corners = triple.map(|point| scale(point, factor));
        if !corners.iter().flatten().all(|x| x.is_finite()) {
            return Err(StlError::Facet { facet: k + 1 });
        }
        if length(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0]))) > 0.0 {
            facets.push(corners);
        }
    }
    if facets.is_empty() { Err(StlError::Empty) } else { Ok(facets) }
}

/// Facets as wall pieces of one name.
pub fn mesh(name: &str, facets: &[Facet], species: WallSpecies) -> impl Iterator<Item = Wall> {
    facets.iter().map(move |corners| Wall {
        name: name.to_owned(),
        shape: Shape::Triangle { corners: *corners },
        species,
    })
}

/// Whether facets enclose a space: every edge belongs to an even number of them. Vertices are one where they are equal in
/// every bit.
pub(super) fn is_closed(facets: &[Facet]) -> bool {
    // Negative zero is zero.
    let bits = |point: Vec3| point.map(|x| (x + 0.0).to_bits());
    let edge = |a: Vec3, b: Vec3| (bits(a).min(bits(b)), bits(a).max(bits(b)));
    let mut edges: Vec<_> = facets.iter().flat_map(|[a, b, c]| [edge(*a, *b), edge(*b, *c), edge(*c, *a)]).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).all(|same| same.len() % 2 == 0)
}

/// The vertices in order, three to a facet. A binary file is known by its length, since its text too may start with `solid`.
fn vertices(bytes: &[u8]) -> Result<Vec<Vec3>, StlError> {
    let claimed = bytes.get(HEAD - 4..HEAD).and_then(|count| count.try_into().ok()).map_or(0, u32::from_le_bytes);
    let expected = HEAD as u64 + FACET as u64 * u64::from(claimed);
    if bytes.len() >= HEAD && bytes.len() as u64 == expected {
        return Ok(binary(&bytes[HEAD..]));
    }
    let text = std::str::from_utf8(bytes).unwrap_or_default();
    if text.trim_start().starts_with("solid") && text.contains("vertex") {
        return ascii(text);
    }
    Err(StlError::NotStl { facets: claimed, expected, found: bytes.len() })
}

fn binary(facets: &[u8]) -> Vec<Vec3> {
    let number = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
    let points = |facet: &[u8; FACET]| -> Vec<Vec3> {
        // Twelve numbers, the first three of them the normal.
        let (numbers, _) = facet[12..48].as_chunks::<4>();
        numbers
            .as_chunks::<3>()
            .0
            .iter()
            .map(|point| [number(&point[0]), number(&point[1]), number(&point[2])])
            .collect()
    };
    facets.as_chunks::<FACET>().0.iter().flat_map(points).collect()
}

fn ascii(text: &str) -> Result<Vec<Vec3>, StlError> {
    let vertex = |(line, text): (usize, &str)| {
        let words = text.trim().strip_prefix("vertex")?;
        let numbers: Vec<f64> = words.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let point: Option<Vec3> = numbers.try_into().ok().filter(|p: &Vec3| p.iter().all(|x| x.is_finite()));
        Some(point.ok_or_else(|| StlError::Vertex { line: line + 1, text: text.trim().to_owned() }))
    };
    text.lines().enumerate().filter_map(vertex).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron in millimetres.
    const FACETS: [[[f32; 3]; 3]; 4] = [
        [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, 10.5], [10.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.5]],
        [[10.0, 0.0, 0.0], [0.0, 0.0, 10.5], [0.0, 10.0, 0.0]],
    ];

    fn binary_file(facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = b"solid although it is binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend((facets.len() as u32).to_le_bytes());
        for facet in facets {
            bytes.extend([0; 12]);
            facet.iter().flatten().for_each(|x| bytes.extend(x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii_file(facets: &[[[f32; 3]; 3]]) -> String {
        let facet = |corners: &[[f32; 3]; 3]| {
            let vertices: String = corners.iter().map(|[x, y, z]| format!("   vertex {x:e} {y} {z}\r\n")).collect();
            format!(" facet normal 0 0 1\r\n  outer loop\r\n{vertices}  endloop\r\n endfacet\r\n")
        };
        format!("solid tetrahedron\r\n{}endsolid\r\n", facets.iter().map(facet).collect::<String>())
    }

    #[test]
    fn both_forms_of_a_file_give_the_same_walls() {
        let read = facets(&binary_file(&FACETS), 1e-3).unwrap();
        assert_eq!(read, facets(ascii_file(&FACETS).as_bytes(), 1e-3).unwrap());
        let corners = [[0.0, 0.0, 0.0], [0.0, 0.0, 10.5e-3], [10.0e-3, 0.0, 0.0]];
        assert_eq!((read.len(), read[1]), (4, corners));
        let species = WallSpecies { sliding_friction: 0.5, rolling_friction: 1.0 };
        let walls: Vec<Wall> = mesh("part", &read, species).collect();
        assert_eq!((walls.len(), &walls[1].shape), (4, &Shape::Triangle { corners }));
        assert!(walls.iter().all(|wall| wall.name == "part"));
    }

    #[test]
    fn a_mesh_without_a_hole_is_closed() {
        let read = facets(&binary_file(&FACETS), 1e-3).unwrap();
        assert!(is_closed(&read) && !is_closed(&read[1..]) && !is_closed(&read[..1]));
    }

    #[test]
    fn facets_without_area_are_left_out_and_what_is_no_mesh_is_refused() {
        let sliver = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
        let with = [FACETS[0], sliver, FACETS[1]];
        assert_eq!(facets(&binary_file(&with), 1.0).unwrap().len(), 2);
        assert_eq!(facets(&binary_file(&[sliver]), 1.0), Err(StlError::Empty));
        let mut cut = binary_file(&FACETS);
        cut.truncate(200);
        assert!(matches!(facets(&cut, 1.0), Err(StlError::NotStl { facets: 4, expected: 284, found: 200 })));
        assert!(matches!(facets(b"", 1.0), Err(StlError::NotStl { found: 0, .. })));
        let word = ascii_file(&FACETS).replacen("vertex 0e0 0 10.5", "vertex 0e0 0 nan", 1);
        assert!(matches!(facets(word.as_bytes(), 1.0), Err(StlError::Vertex { line: 12, .. })));
        let nan = [[[0.0, 0.0, 0.0], [f32::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]]];
        assert_eq!(facets(&binary_file(&nan), 1.0), Err(StlError::Facet { facet: 1 }));
        let odd = ascii_file(&FACETS).replacen("   vertex 0e0 0 0\r\n", "", 1);
        assert_eq!(facets(odd.as_bytes(), 1.0), Err(StlError::Facet { facet: 4 }));
    }
}
