//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

use crate::geometry::pose::Pose;
use crate::problem::Problem;
use crate::verdict::weakness::weakest;
use nalgebra::Matrix6;

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py`.
const WEIGHTS: [f64; 3] = [-6.99, -1.638, 1.581];

/// Bounds of the spread, beyond which no problem was.
const SPREAD: (f64, f64) = (1e-5, 10.0);

/// What a fit shows of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest standard deviation of the translation along any direction, as a share of the distance to the regions.
    pub spread: f64,
    /// Whether nothing had to be given up: the moments of the whole regions decided, no part of them being disturbed so much that
    /// the contours had to; or no region's samples contradict the pose.
    pub whole: bool,
}

impl Evidence {
    /// The evidence of a pose with this covariance.
    pub fn new(problem: &Problem, pose: &Pose, covariance: &Matrix6<f64>, whole: bool) -> Self {
        let shift = weakest(&covariance.fixed_view::<3, 3>(3, 3).into_owned()).0;
        Self { spread: shift / problem.distance(pose), whole }
    }

    /// What the probability's logarithm of odds is a weighted sum of: 1, the logarithm of the spread, and whether it is
    /// whole.
    pub fn features(&self) -> [f64; 3] {
        let (least, most) = SPREAD;
        // The comparison's order makes a spread that is not known the largest.
        [1.0, self.spread.min(most).max(least).ln(), f64::from(u8::from(self.whole))]
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one.
    pub fn probability(&self) -> f64 {
        let odds: f64 = self.features().iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
        1.0 / (1.0 + (-odds).exp())
    }
}
