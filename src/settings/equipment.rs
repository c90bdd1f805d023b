//! Equipment of the user: a triangle mesh that stands in the apparatus of an experiment, of one of the wall materials.
//!
//! Takes facets in metres; gives what an experiment makes walls of, and the digest that stands for the mesh in keys.

use super::WALL_FRICTIONS;
use crate::canonical::{CanonicalError, Digest, Encoder, digest};
use crate::dem::Facet;

/// Names of the wall materials; each has its friction at the same place of [`WALL_FRICTIONS`].
pub const MATERIALS: &[&str] = &["acrylic", "steel_impact", "steel_sliding"];

const MESH_CONTEXT: &str = "granulake 2026 mesh v1";

/// A mesh in an apparatus.
#[derive(Debug, Clone, PartialEq)]
pub struct Equipment {
    /// The experiment.
    pub experiment: String,
    /// Name among the walls of the experiment.
    pub name: String,
    /// Name of its material.
    pub material: &'static str,
    /// Setting of the sliding friction on it.
    pub friction: &'static str,
    /// Its triangles [m].
    pub facets: Vec<Facet>,
    /// Digest of the triangles.
    pub digest: Digest,
}

impl Equipment {
    /// The mesh `name` of a material, an index of [`MATERIALS`].
    ///
    /// # Errors
    /// A coordinate that is NaN.
    pub fn new(experiment: &str, name: &str, material: usize, facets: Vec<Facet>) -> Result<Self, CanonicalError> {
        let mut encoder = Encoder::new();
        encoder.list(facets.len());
        for coordinate in facets.iter().flatten().flatten() {
            encoder.f64(*coordinate)?;
        }
        Ok(Self {
            experiment: experiment.to_owned(),
            name: name.to_owned(),
            material: MATERIALS[material],
            friction: WALL_FRICTIONS[material],
            facets,
            digest: digest(MESH_CONTEXT, &encoder),
        })
    }

    /// What it is in words: `12 triangles of acrylic`.
    pub fn text(&self) -> String {
        format!("{} triangles of {}", self.facets.len(), self.material)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_material_is_named_as_its_friction() {
        assert!(MATERIALS.len() == WALL_FRICTIONS.len());
        let pairs = MATERIALS.iter().zip(WALL_FRICTIONS);
        pairs.for_each(|(material, friction)| assert_eq!(format!("wall_friction_{material}"), *friction));
    }
}
