//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use crate::contour::fit::ContourFit;
use crate::samples::posterior::Posterior;
use crate::samples::readings::SampledRegion;
use crate::verdict::outliers::{contradicts, log_odds};
use crate::verdict::weakness::weakest;

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py`.
const WEIGHTS: [f64; 6] = [-0.1815, -0.5414, -0.3578, 0.1282, 0.1974, 2.1701];

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

    /// The same with the regions' samples in place of their contours: the blur as scatter, right labels as clean, samples that are
    /// near enough to the contour to tell anything as pieces.
    pub fn with_samples(self, posterior: &Posterior, sampled: &[SampledRegion], fit: &ContourFit) -> Self {
        let (mut shares, mut odds) = (fit.clean_shares(), log_odds(fit));
        for (region, &wrong) in sampled.iter().zip(&posterior.wrong) {
            shares[region.index()] = 1.0 - wrong;
            odds[region.index()] = if contradicts(wrong) { f64::NEG_INFINITY } else { f64::INFINITY };
        }
        let clean_share = shares.iter().sum::<f64>() / shares.len() as f64;
        Self {
            scatter: posterior.blur,
            clean_share,
            clean_parts: clean_share * posterior.telling as f64,
            regions: odds.iter().filter(|&&odds| odds >= 0.0).count(),
            ..self
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
