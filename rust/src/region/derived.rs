//! Quantities of a world region's outline alone, computed on demand, once for all problems of the region and its copies.

use std::sync::{Arc, OnceLock};

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::geometry::edge_field::EdgeField;
use crate::geometry::rings::{PlaneRings, signed_area};
use crate::geometry::simplified::simplified;
use crate::moments::shape::NormalizedShape;

/// Tolerance of a ring's simplification for coarse evaluations, as a share of the square root of its area:
/// around a square (a perimeter of 4 such roots) the area is then right to 4 x 0.003, about a hundredth.
const COARSE: f64 = 0.003;

/// Distance of an outline from the line between two of its corners, as a share of the square root of its area: curves
/// keep corners every 20 degrees, masks lose their staircase.
pub(crate) const CORNER_TOLERANCE: f64 = 0.015;

/// Quantities of an outline on a plane, computed on demand.
#[derive(Debug, Default)]
pub(crate) struct Derived {
    field: OnceLock<Arc<EdgeField>>,
    coarse: OnceLock<Vec<Vec<Vector2<f64>>>>,
    corners: OnceLock<Vec<Vec<Vector3<f64>>>>,
    shape: OnceLock<Option<NormalizedShape>>,
}

impl Derived {
    /// The edges of an outline.
    pub(super) fn edge_field(&self, outline: &PlaneRings) -> Arc<EdgeField> {
        self.field.get_or_init(|| EdgeField::new(outline.rings()).into()).clone()
    }

    /// An outline's rings by fewer vertices.
    pub(super) fn coarse(&self, outline: &PlaneRings, budget: &Budget) -> &[Vec<Vector2<f64>>] {
        let fewer = |ring: &Vec<Vector2<f64>>| {
            let fewer = simplified(ring, COARSE * signed_area(ring).abs().sqrt(), budget);
            if fewer.len() < 3 { ring.clone() } else { fewer }
        };
        self.coarse.get_or_init(|| outline.rings().iter().map(fewer).collect())
    }

    /// The corners of each ring of the world that an outline stands for.
    pub(super) fn corners(
        &self,
        outline: &PlaneRings,
        rings: impl FnOnce() -> Vec<Vec<Vector3<f64>>>,
        budget: &Budget,
    ) -> &[Vec<Vector3<f64>>] {
        let tolerance = CORNER_TOLERANCE * outline.area().sqrt();
        let corners = || rings().iter().map(|ring| simplified(ring, tolerance, budget)).collect();
        self.corners.get_or_init(corners)
    }

    /// An outline's shape whatever affine map it is seen under; `None` where it is too slender for one.
    pub(super) fn shape(&self, outline: &PlaneRings) -> Option<&NormalizedShape> {
        self.shape.get_or_init(|| NormalizedShape::of(outline.rings())).as_ref()
    }
}
