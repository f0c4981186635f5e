//! Confidence of a pose: logistic regression on features of its fit (`docs/math.md`, section 15).

use nalgebra::Matrix6;

use super::nearness::{bounded, rotation_sigmas, within_limit};
use super::outliers::contradicts;
use crate::contour::fit::ContourFit;
use crate::contour::members::{contradicted, log_odds};
use crate::samples::margin::SampledRegion;
use crate::samples::posterior::Posterior;

/// Weights of [`Evidence::features`] of a pose from outlines, of a logistic regression on the synthetic problems of
/// `benchmarks/confidence.py --scenes 160`.
const OUTLINES: [f64; 8] = [2.316, -0.668, 2.650, -3.037, 0.476, -2.012, 1.158, -10.479];

/// The same of a pose from samples.
const SAMPLES: [f64; 6] = [2.440, -0.770, 3.565, -3.808, -16.903, -1.019];

/// Features of a pose's fit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Evidence {
    /// Standard deviations of the rotation about its principal axes, degrees.
    pub rotation_sigmas: [f64; 3],
    /// Number of regions that belong to the pose.
    pub regions: usize,
    /// The features that differ between outlines and samples.
    pub source: EvidenceSource,
}

/// Features of outlines or of samples, beside the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum EvidenceSource {
    /// By the pieces of contours.
    Outlines {
        /// Whether other poses fit as well: where several do, one that was not found may, too.
        ambiguous: bool,
        /// Whether the pose is that of the moments of whole regions: no part of them is so disturbed that the contours had to decide.
        whole: bool,
        /// Scatter of the clean pieces of the contours, pixels.
        scatter: f64,
        /// Number of regions whose contours contradict the pose: the disturbance is theirs, and the others are the less disturbed.
        contradicted: usize,
        /// Largest overlap error of the regions that belong to the pose, 1 at most: pieces of a contour may lie on that of another
        /// shape, areas do not.
        overlap_error: f64,
    },
    /// By the labels of samples.
    Samples {
        /// Share of an observed region that the outline of its samples leaves open, the mean of the regions that have any: what the
        /// scanner did not see contradicts no pose.
        unseen: f64,
        /// Share of the samples near a region's contour that lie on its wrong side, the mean of the same.
        wrong: f64,
        /// Sigma of the contours' dilation, pixels.
        growth: f64,
    },
}

impl Evidence {
    /// The evidence of contours at a pose, of the pose's covariance and of each region's overlap error; `whole` where the pose is
    /// that of the moments.
    #[doc(hidden)]
    pub fn from_outlines(
        fit: &ContourFit,
        covariance: &Matrix6<f64>,
        overlap_errors: &[f64],
        whole: bool,
        ambiguous: bool,
    ) -> Self {
        let belong = belonging(fit);
        let own = belong.iter().zip(overlap_errors).filter(|&(&belongs, _)| belongs).map(|(_, &error)| error);
        let source = EvidenceSource::Outlines {
            ambiguous,
            whole,
            scatter: fit.mixture.sigma,
            contradicted: count(&contradicted(fit)),
            overlap_error: own.reduce(f64::max).map_or(1.0, |largest| largest.min(1.0)),
        };
        Self { rotation_sigmas: rotation_sigmas(covariance), regions: count(&belong), source }
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
        let mean = |shares: &[f64]| shares.iter().sum::<f64>() / sampled.len() as f64;
        let source = EvidenceSource::Samples {
            unseen: mean(unseen),
            wrong: mean(&posterior.wrong_fractions),
            growth: posterior.noise.dilation,
        };
        Self { rotation_sigmas: rotation_sigmas(covariance), regions: count(&belong), source }
    }

    /// Features whose weighted sum is the log odds that the pose is the right mode (`docs/math.md`, eq. 15.3).
    #[doc(hidden)]
    pub fn features(&self) -> Vec<f64> {
        let weakest = self.rotation_sigmas.map(bounded).into_iter().fold(0.0, f64::max);
        let common = [1.0, weakest.ln(), indicator(self.regions > 1)];
        let own = match self.source {
            EvidenceSource::Outlines { ambiguous, whole, scatter, contradicted, overlap_error } => {
                vec![indicator(ambiguous), indicator(whole), scatter.ln(), contradicted as f64, overlap_error]
            }
            EvidenceSource::Samples { unseen, wrong, growth } => vec![unseen, wrong, growth.ln()],
        };
        [common.as_slice(), &own].concat()
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one: that of the right mode, times that of so
    /// small an error by noise.
    pub fn probability(&self) -> f64 {
        let weights: &[f64] = match self.source {
            EvidenceSource::Outlines { .. } => &OUTLINES,
            EvidenceSource::Samples { .. } => &SAMPLES,
        };
        let odds: f64 = self.features().iter().zip(weights).map(|(feature, weight)| feature * weight).sum();
        within_limit(self.rotation_sigmas) / (1.0 + (-odds).exp())
    }
}

/// Which regions belong to a pose by their contours.
fn belonging(fit: &ContourFit) -> Vec<bool> {
    log_odds(fit).iter().map(|&odds| odds >= 0.0).collect()
}

fn indicator(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

fn count(indicators: &[bool]) -> usize {
    indicators.iter().filter(|&&holds| holds).count()
}
