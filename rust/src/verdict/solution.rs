//! A pose and the quality of its fit.

use nalgebra::Matrix6;

use crate::contour::fit::ContourFit;
use crate::equations::least_squares::{Minimum, Termination};
use crate::geometry::pose::{Pose, Tangent};
use crate::samples::posterior::Posterior;

/// Overlap error above which a solution does not count as solved (paper section 3).
pub(super) const POOR_OVERLAP: f64 = 0.05;

/// Probability of a pose above which a region that is seen elsewhere has no warning; every pose of less has one. Above 0.95,
/// 3 of 10,008 poses are wrong without a warning, above 0.97 none is, and 9 right ones more have one
/// (`python -m benchmarks trust --scenes 556`).
pub const TRUSTED: f64 = 0.97;

/// A pose and how well its projected regions cover the observed ones.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use]
#[non_exhaustive]
pub struct Solution {
    /// `camera_from_world`.
    pub pose: Pose,
    /// The minimum of the moments' equations; `None` where the pose was refined on the contours.
    pub minimum: Option<Minimum>,
    /// The fit of the contours at the pose.
    pub fit: ContourFit,
    /// The posterior of the samples; `None` where no region has any.
    pub posterior: Option<Posterior>,
    /// Area of the symmetric difference over the observed area, all regions together (the paper's delta).
    pub overlap_error: f64,
    /// The same, region by region.
    pub region_overlap_errors: Vec<f64>,
    /// Covariance of the left increment `[omega (rad), tau (meters)]`, with what errors of the whole exposure add.
    pub covariance: Matrix6<f64>,
    /// The pose's derivative by the logarithm of the focal lengths; not a number where a direction is left free.
    pub focal_shift: Tangent,
    /// Probability that the true pose is within 5 degrees (`docs/math.md`, section 15).
    pub confidence: f64,
    /// Posterior probability of this mode; nearby modes count separately.
    pub mode_probability: f64,
}

impl Solution {
    /// The reason why its least squares ended before a minimum, if they did.
    pub(super) fn unconverged(&self) -> Option<&Termination> {
        self.minimum.as_ref().filter(|minimum| !minimum.converged).map(|minimum| &minimum.termination)
    }
}
