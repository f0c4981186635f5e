//! Points of the world: their coordinates checked, their extent.

use nalgebra::Vector3;

use crate::error::{Error, Result};

/// Refuses coordinates that are not finite, naming the first.
pub(crate) fn check_finite(item: &str, points: &[Vector3<f64>]) -> Result<()> {
    for (index, point) in points.iter().enumerate() {
        if let Some(&value) = point.iter().find(|value| !value.is_finite()) {
            return Err(Error::NotFinite { item: item.into(), index, value });
        }
    }
    Ok(())
}

/// Largest side of the bounding box.
pub(super) fn extent(points: &[Vector3<f64>]) -> f64 {
    (0..3).map(|axis| span(points.iter().map(|p| p[axis]))).fold(0.0, f64::max)
}

pub(super) fn span(values: impl Iterator<Item = f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    (high - low).max(0.0)
}
