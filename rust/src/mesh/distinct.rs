//! Points of the plane for a triangulation: distinct, and scaled.

use nalgebra::Vector2;

use super::delaunay;
use crate::error::{Error, Result};
use crate::geometry::rings::predicates::by_x_then_y;
use crate::geometry::rings::{LARGEST_COORDINATE, NEGLIGIBLE_FRACTION, SMALLEST_SIZE};

/// The points without repetition, by x then y, and the power of two by which they are scaled.
pub(super) fn distinct_scaled(points: &[Vector2<f64>]) -> Result<(Vec<Vector2<f64>>, f64)> {
    let mut largest = 0.0_f64;
    for (index, point) in points.iter().enumerate() {
        if let Some(&value) = point.iter().find(|x| !x.is_finite()) {
            return Err(Error::NotFinite { item: "point".to_owned(), index, value });
        }
        largest = largest.max(point.amax());
    }
    if largest > LARGEST_COORDINATE || (largest > 0.0 && largest < SMALLEST_SIZE) {
        return Err(Error::InvalidGeometry {
            item: "the largest coordinate of the points",
            found: format!("{largest:e}"),
            needed: format!("from {SMALLEST_SIZE:.1e} to {LARGEST_COORDINATE:.1e}"),
        });
    }
    let scale = delaunay::scale_for(largest);
    let smallest = NEGLIGIBLE_FRACTION * largest;
    let scaled = |x: f64| if x.abs() < smallest || x == 0.0 { 0.0 } else { x * scale };
    let mut distinct: Vec<Vector2<f64>> = points.iter().map(|point| point.map(scaled)).collect();
    distinct.sort_by(by_x_then_y);
    distinct.dedup();
    Ok((distinct, scale))
}
