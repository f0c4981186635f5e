//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use crate::contour::fit::ContourFit;
use crate::samples::normal::cumulative;
use crate::samples::posterior::Posterior;
use crate::samples::readings::SampledRegion;
use crate::verdict::outliers::{contradicted, contradicts, log_odds};
use crate::verdict::weakness::weakest;

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py`.
const WEIGHTS: [f64; 8] = [-3.244, -0.643, 3.176, -0.775, 0.967, 1.105, -0.386, 0.720];

/// Bounds of the features, beyond which no problem was: rotation, degrees; share of clean pieces; clean pieces.
const ROTATION: (f64, f64) = (1e-3, 1e2);
const SHARE: (f64, f64) = (1e-3, 1.0 - 1e-3);
const PARTS: (f64, f64) = (0.1, 1e4);

/// Rotation, degrees, within which a pose is right: a convention.
const RIGHT: f64 = 5.0;

/// What a fit shows of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest standard deviation of the rotation about any axis, degrees.
    pub rotation_sigma: f64,
    /// Whether nothing had to be given up: the moments of the whole regions decided, no part of them being disturbed so much that
    /// the contours had to; or no region's samples contradict the pose.
    pub whole: bool,
    /// Scatter of the clean pieces of the contours, or the blur of samples, pixels.
    pub scatter: f64,
    /// Number of regions that the pose contradicts: the disturbance is theirs, and the others are the less disturbed.
    pub contradicted: usize,
    /// Number of regions that belong to the pose.
    pub regions: usize,
    /// Share of the clean pieces, mean over the regions.
    pub clean_share: f64,
    /// Clean pieces of the contours that vary independently.
    pub clean_parts: f64,
}

impl Evidence {
    /// The evidence of contours at a pose, and of the pose's covariance; `whole` where the pose is that of the moments.
    pub fn new(fit: &ContourFit, covariance: &Matrix6<f64>, whole: bool) -> Self {
        let clean_share = mean(&fit.clean_shares());
        Self {
            rotation_sigma: weakest(&covariance.fixed_view::<3, 3>(0, 0).into_owned()).0.to_degrees(),
            whole,
            scatter: fit.mixture.sigma,
            contradicted: count(&contradicted(fit)),
            regions: count(&log_odds(fit).iter().map(|&odds| odds >= 0.0).collect::<Vec<_>>()),
            clean_share,
            clean_parts: clean_share * fit.independent(),
        }
    }

    /// The same with the regions' samples in place of their contours: the blur as scatter, right labels as clean, wrong ones as
    /// contradictions, samples that are near enough to the contour to tell anything as pieces.
    pub fn with_samples(self, posterior: &Posterior, sampled: &[SampledRegion], fit: &ContourFit) -> Self {
        let (mut shares, mut contradicted) = (fit.clean_shares(), contradicted(fit));
        let mut belong: Vec<bool> = log_odds(fit).iter().map(|&odds| odds >= 0.0).collect();
        for (region, &wrong) in sampled.iter().zip(&posterior.wrong) {
            shares[region.index()] = 1.0 - wrong;
            contradicted[region.index()] = contradicts(wrong);
            belong[region.index()] = !contradicts(wrong);
        }
        let (contradicted, regions, clean_share) = (count(&contradicted), count(&belong), mean(&shares));
        let clean_parts = clean_share * posterior.telling as f64;
        let (whole, scatter) = (contradicted == 0, posterior.blur);
        Self { whole, scatter, contradicted, regions, clean_share, clean_parts, ..self }
    }

    /// What the logarithm of the odds that the pose is no other place is a weighted sum of: 1, the logarithm of the rotation's
    /// deviation, whether it is whole, the logarithm of the scatter, the number of contradicted regions, whether several belong,
    /// the logarithm of odds of the clean share, and the logarithm of the clean parts.
    pub fn features(&self) -> [f64; 8] {
        let indicator = |holds: bool| f64::from(u8::from(holds));
        let share = within(self.clean_share, SHARE);
        [
            1.0,
            within(self.rotation_sigma, ROTATION).ln(),
            indicator(self.whole),
            self.scatter.ln(),
            self.contradicted as f64,
            indicator(self.regions > 1),
            (share / (1.0 - share)).ln(),
            within(self.clean_parts, PARTS).ln(),
        ]
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one: that it is the place, and that the
    /// noise leaves it so near.
    pub fn probability(&self) -> f64 {
        let odds: f64 = self.features().iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
        let near = 2.0 * cumulative(RIGHT / within(self.rotation_sigma, ROTATION)) - 1.0;
        near / (1.0 + (-odds).exp())
    }
}

fn within(value: f64, (least, most): (f64, f64)) -> f64 {
    // The comparison's order makes a value that is not known the largest.
    value.min(most).max(least)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn count(indicators: &[bool]) -> usize {
    indicators.iter().filter(|&&holds| holds).count()
}
