//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use crate::contour::fit::ContourFit;
use crate::verdict::outliers::log_odds;
use crate::verdict::weakness::weakest;

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py`.
const WEIGHTS: [f64; 6] = [-0.3362, -0.5018, -0.5995, 0.1591, 0.1458, 2.4619];

/// Bounds of the features, beyond which no problem was: rotation, degrees; share of clean pieces; clean pieces.
const ROTATION: (f64, f64) = (1e-3, 1e2);
const SHARE: (f64, f64) = (1e-3, 1.0 - 1e-3);
const PARTS: (f64, f64) = (0.1, 1e4);

/// What a fit shows of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest standard deviation of the rotation about any axis, degrees.
    pub rotation_sigma: f64,
    /// Scatter of the clean pieces of the contours, pixels.
    pub scatter: f64,
    /// Share of the clean pieces, mean over the regions.
    pub clean_share: f64,
    /// Clean pieces of the contours that vary independently.
    pub clean_parts: f64,
    /// Number of regions that belong to the pose.
    pub regions: usize,
}

impl Evidence {
    /// The evidence of contours at a pose, and of the pose's covariance.
    pub fn new(fit: &ContourFit, covariance: &Matrix6<f64>) -> Self {
        let shares = fit.clean_shares();
        let clean_share = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        Self {
            rotation_sigma: weakest(&covariance.fixed_view::<3, 3>(0, 0).into_owned()).0.to_degrees(),
            scatter: fit.mixture.sigma,
            clean_share,
            clean_parts: clean_share * fit.independent(),
            regions: log_odds(fit).iter().filter(|&&odds| odds >= 0.0).count(),
        }
    }

    /// What the probability's logarithm of odds is a weighted sum of: 1, the logarithms of rotation, scatter and parts, the
    /// logarithm of odds of the clean share, and whether there are several regions.
    pub fn features(&self) -> [f64; 6] {
        let within = |value: f64, (least, most): (f64, f64)| value.max(least).min(most);
        let share = within(self.clean_share, SHARE);
        [
            1.0,
            within(self.rotation_sigma, ROTATION).ln(),
            self.scatter.ln(),
            (share / (1.0 - share)).ln(),
            within(self.clean_parts, PARTS).ln(),
            if self.regions > 1 { 1.0 } else { 0.0 },
        ]
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one.
    pub fn probability(&self) -> f64 {
        let odds: f64 = self.features().iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
        1.0 / (1.0 + (-odds).exp())
    }
}
