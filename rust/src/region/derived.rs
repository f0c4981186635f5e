//! What follows from a world region's outline alone: worked out when it is first asked for, once for all problems that
//! the region and its copies are in.

use std::sync::{Arc, OnceLock};

use nalgebra::{Vector2, Vector3};

use super::WorldRegion;
use crate::geometry::edge_field::EdgeField;
use crate::geometry::rings::signed_area;
use crate::geometry::simplified::simplified;
use crate::moments::shape::NormalizedShape;

/// Distance of a ring from its lines where only a first look is taken, as a share of the square root of its area:
/// around a square (a perimeter of 4 such roots) the area is then right to 4 x 0.003, about a hundredth.
const COARSE: f64 = 0.003;

/// Distance of an outline from the line between two of its corners, as a share of the square root of its area: curves
/// keep corners every 20 degrees, masks lose their staircase.
pub(crate) const CORNER_TOLERANCE: f64 = 0.015;

/// What follows from an outline on a plane.
#[derive(Debug, Default)]
pub(crate) struct Derived {
    field: OnceLock<Arc<EdgeField>>,
    coarse: OnceLock<Vec<Vec<Vector2<f64>>>>,
    corners: OnceLock<Vec<Vec<Vector3<f64>>>>,
    shape: OnceLock<Option<NormalizedShape>>,
}

impl WorldRegion {
    /// The edges of the outline in plane coordinates.
    pub(crate) fn edge_field(&self) -> Arc<EdgeField> {
        self.derived.field.get_or_init(|| EdgeField::new(self.outline.rings()).into()).clone()
    }

    /// The outline's rings by fewer vertices, in plane coordinates, for a first look.
    pub(crate) fn coarse(&self) -> &[Vec<Vector2<f64>>] {
        let fewer = |ring: &Vec<Vector2<f64>>| {
            let fewer = simplified(ring, COARSE * signed_area(ring).abs().sqrt());
            if fewer.len() < 3 { ring.clone() } else { fewer }
        };
        self.derived.coarse.get_or_init(|| self.outline.rings().iter().map(fewer).collect())
    }

    /// The corners of each boundary ring, world.
    pub(crate) fn corners(&self) -> &[Vec<Vector3<f64>>] {
        let tolerance = CORNER_TOLERANCE * self.outline.area().sqrt();
        let corners = || self.rings().iter().map(|ring| simplified(ring, tolerance)).collect();
        self.derived.corners.get_or_init(corners)
    }

    /// The outline's shape whatever affine map it is seen under; `None` where it is too slender for one.
    pub(crate) fn shape(&self) -> Option<&NormalizedShape> {
        self.derived.shape.get_or_init(|| NormalizedShape::of(self.outline.rings())).as_ref()
    }
}
