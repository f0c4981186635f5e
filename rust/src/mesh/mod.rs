//! Triangulated regions and outlines of point sets: the only module that names spade, and only with the feature `mesh`.

#[cfg(feature = "mesh")]
pub mod alpha_shape;
#[cfg(feature = "mesh")]
mod delaunay;
#[cfg(feature = "mesh")]
mod distinct;
#[cfg(feature = "mesh")]
pub mod even_mesh;
#[cfg(feature = "mesh")]
pub(crate) mod spacing;
#[cfg(feature = "mesh")]
pub mod triangulation;

use nalgebra::Vector2;

/// Most triangles a mesh may be asked for: about a second of work, also of needles, whose predicates are exact ones
/// (`cargo bench -p regionpose-benches --bench mesh`).
pub const MOST_TRIANGLES: usize = 100_000;

/// Cost of a mesh's triangle, in edge evaluations: a Delaunay triangulation finds and flips some
/// hundred, with exact predicates.
#[cfg(feature = "mesh")]
const EDGES_OF_TRIANGLE: usize = 500;

/// A triangulated region of the plane.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneMesh {
    /// Vertex positions, in the region's unit.
    pub vertices: Vec<Vector2<f64>>,
    /// Vertex indices of each triangle, counter-clockwise, the smallest first; sorted.
    pub triangles: Vec<[usize; 3]>,
}

impl PlaneMesh {
    /// Sum of the areas of the triangles, in the vertices' unit squared.
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|&triangle| self.triangle_area(triangle)).sum()
    }

    /// Signed area of the triangle with these vertex indices.
    fn triangle_area(&self, [a, b, c]: [usize; 3]) -> f64 {
        let origin = self.vertices[a];
        0.5 * (self.vertices[b] - origin).perp(&(self.vertices[c] - origin))
    }
}
