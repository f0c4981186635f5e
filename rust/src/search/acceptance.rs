//! Acceptance tests of a fit: its scatter, its inlier fraction and its evidence.

use crate::contour::fit::ContourFit;
use crate::contour::members::least_evidence;
use crate::math::odds::DECISIVE;
use crate::noise::boundary::DRAWN;
use crate::noise::contamination::MAJORITY;

/// Whether the contours of several regions confirm a pose. A single contour does not: a pose exists that maps three of its sides onto
/// any three lines.
pub(super) fn is_found(fit: &ContourFit) -> bool {
    fit.regions().count() > 1 && fit.mixture.sigma < DRAWN && least_evidence(fit) >= DECISIVE
}

/// Whether most of every region's contour is clean.
pub(super) fn is_mostly_clean(fit: &ContourFit) -> bool {
    fit.mixture.sigma < DRAWN && fit.clean_shares().iter().all(|&share| share >= MAJORITY)
}
