//! Confidence of a pose: how closely its regions fit it, against chance (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use super::nearness::{rotation_sigmas, within_limit};
use crate::contour::fit::ContourFit;
use crate::contour::members::log_odds;
use crate::noise::boundary::DRAWN;
use crate::noise::contamination::PRIOR_SHARE;
use crate::samples::label_model::contradicts;
use crate::samples::margin::SampledRegion;
use crate::samples::posterior::Posterior;

/// What a pose's fit shows of it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evidence {
    /// Standard deviations of the rotation about its principal axes, degrees.
    pub rotation_sigmas: [f64; 3],
    /// Number of regions that belong to the pose.
    pub regions: usize,
    /// Share of the observed regions that contradicts the pose: the largest overlap error of the regions that belong to it, 1 at most, since
    /// pieces of a contour may lie on that of another shape and areas do not. Of samples, the share of those near a contour that lie on its
    /// wrong side, and half of what the scanner did not see: there, labels at any pose would be as often wrong as right.
    pub mismatch: f64,
    /// Noise of the contours: the scatter of their clean pieces or, of samples, the sigma of their dilation, pixels.
    pub noise: f64,
}

impl Evidence {
    /// The evidence of contours at a pose, of the pose's covariance and of each region's overlap error.
    #[doc(hidden)]
    pub fn from_outlines(fit: &ContourFit, covariance: &Matrix6<f64>, overlap_errors: &[f64]) -> Self {
        let belong = belonging(fit);
        let own = belong.iter().zip(overlap_errors).filter(|&(&belongs, _)| belongs).map(|(_, &error)| error);
        Self {
            rotation_sigmas: rotation_sigmas(covariance),
            regions: count(&belong),
            mismatch: own.reduce(f64::max).map_or(1.0, |largest| largest.min(1.0)),
            noise: fit.mixture.sigma,
        }
    }

    /// The evidence of samples, and of the contours of regions that have none, as `fit` at the pose; `unseen` of each region with
    /// samples.
    #[doc(hidden)]
    pub fn from_samples(
        posterior: &Posterior,
        sampled: &[SampledRegion],
        fit: &ContourFit,
        covariance: &Matrix6<f64>,
        unseen: &[f64],
    ) -> Self {
        let mut belong = belonging(fit);
        for (region, &wrong) in sampled.iter().zip(&posterior.wrong_fractions) {
            belong[region.index()] = !contradicts(wrong);
        }
        let contradicting = |(&wrong, &unseen): (&f64, &f64)| (1.0 - unseen) * wrong + 0.5 * unseen;
        let sum: f64 = posterior.wrong_fractions.iter().zip(unseen).map(contradicting).sum();
        Self {
            rotation_sigmas: rotation_sigmas(covariance),
            regions: count(&belong),
            mismatch: sum / sampled.len() as f64,
            noise: posterior.noise.dilation,
        }
    }

    /// Log odds that the pose is the right mode, and not one that fits so closely by chance (`docs/math.md`, eq. 15.3).
    pub fn log_odds(&self) -> f64 {
        let mismatch = (self.mismatch + PRIOR_SHARE) / (1.0 - self.mismatch.powi(2)).max(PRIOR_SHARE);
        -(self.regions.max(1) as f64) * (mismatch * self.noise / DRAWN).ln()
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one: that of the right mode, times that of so
    /// small an error by noise.
    pub fn probability(&self) -> f64 {
        within_limit(self.rotation_sigmas) / (1.0 + (-self.log_odds()).exp())
    }
}

/// Which regions belong to a pose by their contours.
fn belonging(fit: &ContourFit) -> Vec<bool> {
    log_odds(fit).iter().map(|&odds| odds >= 0.0).collect()
}

fn count(indicators: &[bool]) -> usize {
    indicators.iter().filter(|&&holds| holds).count()
}
