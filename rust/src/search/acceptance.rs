//! Acceptance tests of a fit: its scatter, its inlier fraction and its evidence.

use crate::contour::fit::{ContourFit, MOSTLY};
use crate::contour::members::least_evidence;

/// Scatter of the clean pieces, pixels, above which no pose is accepted: several times that of any mask or drawing.
pub const LOOSE_SIGMA: f64 = 2.0;

/// Gain of log likelihood below which a pose refined on the contours isn't preferred to the moments': six parameters gain 3 by
/// chance, and 7 more are odds of a thousand to one.
pub(super) const DECISIVE: f64 = 10.0;

/// Whether the contours of several regions confirm a pose. A single contour does not: a pose exists that maps three of its sides onto
/// any three lines.
pub(super) fn is_found(fit: &ContourFit) -> bool {
    fit.regions().count() > 1 && fit.mixture.sigma < LOOSE_SIGMA && least_evidence(fit) >= DECISIVE
}

/// Whether most of every region's contour is clean.
pub(super) fn is_mostly_clean(fit: &ContourFit) -> bool {
    fit.mixture.sigma < LOOSE_SIGMA && fit.clean_shares().iter().all(|&share| share >= MOSTLY)
}
