//! From a mask to the rings that bound its region; and the flood that a mask grows by (`flood`), with the outlines of its levels (`outlines`).
//!
//! One pass over the mask (`scan`) finds its values, the window that holds them and each row's runs; what follows costs
//! as much as the contour is long: marching squares between the rows' runs (`trace`), then redundant vertices go
//! (`thinning`).

mod flood;
mod outlines;
mod pixels;
mod scan;
mod thinning;
mod trace;

use std::ops::Range;

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;
use scan::Scan;

pub use flood::{color_levels, flood_levels};
pub use outlines::outline_sums;
pub use pixels::{CONTOUR_LEVEL, Mask, MaskValue};

/// Area and contours of a mask's region.
#[derive(Debug, Clone, PartialEq)]
pub struct MaskContours {
    /// Rings in pixels (integer = pixel center, x right, y down), as of [`PlaneRings::new`].
    pub rings: PlaneRings,
    /// Rows from the first to the last that hold any coverage.
    pub rows: Range<usize>,
    /// Columns of the same.
    pub columns: Range<usize>,
    /// Whether every pixel is covered as a whole or not at all.
    pub binary: bool,
}

impl MaskContours {
    /// The contours at which the linearly interpolated coverage is [`CONTOUR_LEVEL`], without vertices that lie within
    /// 0.01 px of a line.
    ///
    /// Covered pixels that touch at a corner alone are apart. Beside the border of the image the mask goes on for a
    /// pixel, and the contour is cut half a pixel outside the outermost centers.
    ///
    /// # Errors
    /// Integers of more than two values, or of two other than 0; coverage outside [0, 1]; no pixel that is covered by
    /// more than half.
    pub fn of<T: MaskValue>(mask: Mask<'_, T>) -> Result<Self> {
        let Scan { rows, columns, binary, runs } = Scan::of(mask)?;
        let traced = trace::contours(mask, rows.start, &runs);
        if traced.is_empty() {
            return Err(Error::EmptyMask);
        }
        let budget = Budget::unlimited();
        let thinned = traced.iter().map(|ring| thinning::thinned(ring, &budget)).collect();
        // Rings that nearly touch may cross once vertices between them are gone.
        let rings = PlaneRings::new(thinned).or_else(|_| PlaneRings::new(open(traced)))?;
        Ok(Self { rings, rows, columns, binary })
    }
}

/// The rings without their repeated ends.
fn open(mut closed: Vec<Vec<Vector2<f64>>>) -> Vec<Vec<Vector2<f64>>> {
    closed.iter_mut().for_each(|ring| ring.truncate(ring.len() - 1));
    closed
}
