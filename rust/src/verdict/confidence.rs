//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use super::outliers::contradicts;
use super::weakness::weakest;
use crate::contour::fit::ContourFit;
use crate::contour::members::{contradicted, log_odds};
use crate::samples::normal::cumulative;
use crate::samples::posterior::Posterior;
use crate::samples::readings::SampledRegion;

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py --scenes 240`.
const WEIGHTS: [f64; 8] = [0.114, -0.849, 1.371, -0.967, 1.124, -8.550, 0.814, -1.156];

/// Bounds of the rotation's deviation, degrees, beyond which no problem was.
const ROTATION: (f64, f64) = (1e-3, 1e2);

/// Rotation, degrees, within which a pose is right: a convention.
pub(super) const RIGHT: f64 = 5.0;

/// What a fit shows of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest standard deviation of the rotation about any axis, degrees.
    pub rotation_sigma: f64,
    /// Whether nothing had to be given up: the moments of the whole regions decided, no part of them being disturbed so much that
    /// the contours had to; or samples did, which need no whole outline.
    pub whole: bool,
    /// Scatter of the clean pieces of the contours, or the blur of samples, pixels.
    pub scatter: f64,
    /// Number of regions whose contours contradict the pose: the disturbance is theirs, and the others are the less disturbed.
    pub contradicted: usize,
    /// Share of the samples near a region's contour that lie on its wrong side, the mean of the regions that have any; or 0.
    pub wrong: f64,
    /// Number of regions that belong to the pose.
    pub regions: usize,
    /// Whether other poses fit as well: where several do, one that was not found may, too.
    pub ambiguous: bool,
}

impl Evidence {
    /// The evidence of contours at a pose, and of the pose's covariance; `whole` where the pose is that of the moments.
    pub fn new(fit: &ContourFit, covariance: &Matrix6<f64>, whole: bool) -> Self {
        Self {
            rotation_sigma: rotation_sigma(covariance),
            whole,
            scatter: fit.mixture.sigma,
            contradicted: count(&contradicted(fit)),
            wrong: 0.0,
            regions: count(&log_odds(fit).iter().map(|&odds| odds >= 0.0).collect::<Vec<_>>()),
            ambiguous: false,
        }
    }

    /// The same with the regions' samples in place of their contours: the blur as scatter, and the wrong labels.
    pub fn with_samples(self, posterior: &Posterior, sampled: &[SampledRegion], fit: &ContourFit) -> Self {
        let mut contradicted = contradicted(fit);
        let mut belong: Vec<bool> = log_odds(fit).iter().map(|&odds| odds >= 0.0).collect();
        for (region, &wrong) in sampled.iter().zip(&posterior.wrong) {
            contradicted[region.index()] = false;
            belong[region.index()] = !contradicts(wrong);
        }
        let (contradicted, regions) = (count(&contradicted), count(&belong));
        let wrong = posterior.wrong.iter().sum::<f64>() / posterior.wrong.len() as f64;
        Self { whole: true, scatter: posterior.blur, contradicted, wrong, regions, ..self }
    }

    /// What the logarithm of the odds that the pose is no other place is a weighted sum of: 1, the logarithm of the rotation's
    /// deviation, whether it is whole, the logarithm of the scatter, the number of contradicted regions, the share of wrong labels,
    /// whether several regions belong, and whether it is ambiguous.
    pub fn features(&self) -> [f64; 8] {
        let indicator = |holds: bool| f64::from(u8::from(holds));
        let (whole, several) = (indicator(self.whole), indicator(self.regions > 1));
        [
            1.0,
            bounded(self.rotation_sigma).ln(),
            whole,
            self.scatter.ln(),
            self.contradicted as f64,
            self.wrong,
            several,
            indicator(self.ambiguous),
        ]
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one: that it is the place, and that the
    /// noise leaves it so near.
    pub fn probability(&self) -> f64 {
        let odds: f64 = self.features().iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
        within(self.rotation_sigma) / (1.0 + (-odds).exp())
    }
}

/// Probability that a pose at the right place, of this covariance, is within 5 degrees of the true one.
pub fn nearness(covariance: &Matrix6<f64>) -> f64 {
    within(rotation_sigma(covariance))
}

fn within(rotation_sigma: f64) -> f64 {
    2.0 * cumulative(RIGHT / bounded(rotation_sigma)) - 1.0
}

/// Largest standard deviation of the rotation about any axis, degrees.
fn rotation_sigma(covariance: &Matrix6<f64>) -> f64 {
    weakest(&covariance.fixed_view::<3, 3>(0, 0).into_owned()).0.to_degrees()
}

fn bounded(rotation_sigma: f64) -> f64 {
    let (least, most) = ROTATION;
    // The comparison's order makes a deviation that is not known the largest.
    rotation_sigma.min(most).max(least)
}

fn count(indicators: &[bool]) -> usize {
    indicators.iter().filter(|&&holds| holds).count()
}
