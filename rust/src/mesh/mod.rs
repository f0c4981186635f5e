//! Triangulated regions and outlines of point sets: the only module that names spade.

pub mod alpha_shape;
mod delaunay;
pub mod even_mesh;
pub mod triangulation;

use nalgebra::Vector2;

use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;

/// Most triangles a mesh may be asked for: about a second of work and 100 MB.
pub const MOST_TRIANGLES: usize = 1_000_000;

/// Relative difference allowed between the areas of a mesh and of its region; rounding stays far below it, while a
/// triangle lost or gained in a mesh of [`MOST_TRIANGLES`] does not.
const AREA_TOLERANCE: f64 = 1e-9;

/// Rounding of a new vertex, in units of the largest coordinate: it moves the boundary, hence the area, by this much.
const VERTEX_ROUNDING: f64 = 4.0 * f64::EPSILON;

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

    /// The mesh itself if it covers just the area of `region`.
    fn covering(self, region: &PlaneRings) -> Result<Self> {
        let (found, needed) = (self.area(), region.area());
        let (lower, upper) = region.bounds();
        let perimeter: f64 = region.edges().map(|(a, b)| (b - a).norm()).sum();
        let rounding = VERTEX_ROUNDING * lower.amax().max(upper.amax()) * perimeter;
        if (found - needed).abs() <= AREA_TOLERANCE * needed + rounding {
            Ok(self)
        } else {
            Err(Error::MeshArea { found, needed })
        }
    }
}
