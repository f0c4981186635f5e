//! Labeled samples of a region's plane: places that a sensor measured inside or outside of the region.

use nalgebra::{Vector2, Vector3};

use super::plane::PlaneFrame;
use super::points::{check_finite, extent};
use crate::error::{Error, Result};

/// Largest distance of a sample from the region's plane, as a share of the extent of all samples: the range noise of a small
/// face seen from afar, and far less than any edge between two planes.
const OFF_PLANE: f64 = 0.1;

/// Places on a plane, in its coordinates: inside the region, and outside of it.
///
/// A scanner doesn't measure an outline: each of its beams met the region or passed its plane beside it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    inside: Vec<Vector2<f64>>,
    outside: Vec<Vector2<f64>>,
    enclosed: Vec<Vector2<f64>>,
}

impl Samples {
    /// Samples of a region on the plane of a frame, moved onto it along its normal.
    ///
    /// # Errors
    /// No samples inside, a coordinate that is not finite, or a sample off the plane by more than a tenth of the extent.
    pub fn new(frame: &PlaneFrame, inside: &[Vector3<f64>], outside: &[Vector3<f64>]) -> Result<Self> {
        if inside.is_empty() {
            let needed = "at least 1".into();
            return Err(Error::InvalidGeometry {
                item: "the number of samples inside the region",
                found: "0".into(),
                needed,
            });
        }
        check_finite("inside sample", inside)?;
        check_finite("outside sample", outside)?;
        let allowed = OFF_PLANE * extent(inside).max(extent(outside));
        check_near(frame, "an inside sample", inside, allowed)?;
        check_near(frame, "an outside sample", outside, allowed)?;
        let flat = |points: &[Vector3<f64>]| points.iter().map(|point| frame.to_plane(point)).collect();
        Ok(Self { inside: flat(inside), outside: flat(outside), enclosed: Vec::new() })
    }

    /// The same with places outside that the region encloses, on the plane of its frame.
    ///
    /// # Errors
    /// As of [`Samples::new`].
    pub fn with_enclosed(self, frame: &PlaneFrame, enclosed: &[Vector3<f64>]) -> Result<Self> {
        check_finite("outside sample", enclosed)?;
        let inside: Vec<_> = self.inside.iter().map(|p| frame.to_world(p)).collect();
        check_near(frame, "an outside sample", enclosed, OFF_PLANE * extent(&inside))?;
        Ok(Self { enclosed: enclosed.iter().map(|point| frame.to_plane(point)).collect(), ..self })
    }

    /// Places inside the region, plane coordinates.
    pub fn inside(&self) -> &[Vector2<f64>] {
        &self.inside
    }

    /// Places outside of it, plane coordinates.
    pub fn outside(&self) -> &[Vector2<f64>] {
        &self.outside
    }

    /// Places outside of it that it encloses, plane coordinates: in its holes, or in windows and the like, which an image may not
    /// distinguish from the region.
    pub fn enclosed(&self) -> &[Vector2<f64>] {
        &self.enclosed
    }
}

/// Refuses samples that do not lie on one line, that of those inside.
pub(super) fn check_line(inside: &[Vector3<f64>], outside: &[Vector3<f64>]) -> Result<()> {
    let middle = inside.iter().sum::<Vector3<f64>>() / inside.len().max(1) as f64;
    let far = |points: &[Vector3<f64>]| points.iter().map(|x| x - middle).max_by(|a, b| a.norm().total_cmp(&b.norm()));
    // Of points on a line the one farthest from their middle shows it.
    let way = far(inside).and_then(|way| way.try_normalize(0.0)).unwrap_or_else(Vector3::zeros);
    let allowed = OFF_PLANE * extent(inside).max(extent(outside));
    let off = |(index, x): (usize, &Vector3<f64>)| (index, (x - middle).cross(&way).norm());
    for (item, points) in [("an inside sample", inside), ("an outside sample", outside)] {
        if let Some((index, distance)) = points.iter().enumerate().map(off).find(|(_, distance)| *distance > allowed) {
            return Err(Error::InvalidGeometry {
                item,
                found: format!("number {index} at {distance:.3e} off the line"),
                needed: format!("at most {allowed:.3e}, a tenth of the samples' extent"),
            });
        }
    }
    Ok(())
}

fn check_near(frame: &PlaneFrame, item: &'static str, points: &[Vector3<f64>], allowed: f64) -> Result<()> {
    let heights = points.iter().map(|point| frame.height(point).abs());
    match heights.enumerate().find(|(_, height)| *height > allowed) {
        None => Ok(()),
        Some((index, height)) => Err(Error::InvalidGeometry {
            item,
            found: format!("number {index} at {height:.3e} off the region's plane"),
            needed: format!("at most {allowed:.3e}, a tenth of the samples' extent"),
        }),
    }
}
