//! Spherical moments of a mask as a sum over its pixels (paper eq. 6 and 7, the authors' earlier scheme).

use super::SphereMoments;
use super::sphere::{Bearing, solid_angle};
use crate::error::{Error, Result};

/// Moments to `order` of a set of pixels: `sum over pixels of r^e dS`, each pixel at its center's bearing (unit;
/// `docs/math.md`, eq. 4.5).
///
/// `solid_angles` holds a pixel's `dS` in steradians, times its coverage where the mask is soft; for pixels of angular
/// size `h` the error is of order `h^2`. Fails when the two lists differ in length.
///
/// # Panics
/// When `order` is above [`super::MAX_ORDER`].
pub fn pixel_moments(bearings: &[Bearing], solid_angles: &[f64], order: usize) -> Result<SphereMoments> {
    if bearings.len() != solid_angles.len() {
        return Err(Error::InvalidObservation {
            item: "the number of solid angles",
            found: solid_angles.len().to_string(),
            needed: format!("the number of bearings, {}", bearings.len()),
        });
    }
    let mut moments = SphereMoments::zero(order);
    for (bearing, &weight) in bearings.iter().zip(solid_angles) {
        moments.add_point(bearing, weight);
    }
    Ok(moments)
}

/// Signed solid angle of each pixel from the bearings of its four corners in turn, in steradians.
///
/// Two spherical triangles share the diagonal, so pixels that share corners tile without gaps. Positive when the
/// corners turn from x towards y (camera frame: x right, y down), as top left, top right, bottom right, bottom left.
pub fn quad_solid_angles(corners: &[[Bearing; 4]]) -> Vec<f64> {
    corners.iter().map(|&[a, b, c, d]| solid_angle(&[a, b, c]) + solid_angle(&[a, c, d])).collect()
}
