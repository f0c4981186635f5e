//! The posterior of a pose given samples, how two of them compare, and mixtures of them by moment matching (`docs/math.md`, section 17,
//! eq. 17.11).

use nalgebra::Matrix6;

use super::label_inference::PoseState;
use super::label_model::{LabelModel, NoiseLevels};
use super::margin::{EdgeKind, ProjectedSample, SampledRegion};
use super::probit_site::LabelSite;
use crate::budget::Budget;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::autocorrelation::sigmas;
use crate::math::gaussian::{Gaussian, Normal};
use crate::math::normal::{OUTLIER_SIGMAS, cumulative};

/// Deviance up to which another pose fits as well by its samples: odds of 9 to 1, a convention. Beyond, poses are compared by their
/// probabilities alone.
pub(crate) const EQUIVALENT_DEVIANCE: f64 = 4.394_449_154_672_439;

/// Posterior of a pose given samples: one mode.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Posterior {
    /// The mean, about the problem's origin.
    pub pose: Pose,
    /// Covariance of the left increment.
    pub covariance: Matrix6<f64>,
    /// The likeliest noise.
    pub noise: NoiseLevels,
    /// Fraction of each region's samples near its contour that lie clearly on the wrong side.
    pub wrong_fractions: Vec<f64>,
    /// Message of the samples of each region to the left increment, by the region's index in the problem.
    pub messages: Vec<(usize, Gaussian)>,
    /// Evidence, to compare it with other modes.
    pub(super) evidence: ModeEvidence,
}

impl Posterior {
    /// Log evidence.
    pub fn log_evidence(&self) -> f64 {
        self.evidence.log_evidence
    }

    /// Deviance to another mode: twice the log odds (eq. 17.11).
    #[doc(hidden)]
    pub fn deviance_to(&self, other: &Self, regions: &[SampledRegion]) -> f64 {
        self.evidence.deviance_to(&other.evidence, regions)
    }

    /// The mode with a further log prior.
    #[doc(hidden)]
    pub fn with_log_prior(self, log_prior: f64) -> Self {
        let Self { mut evidence, .. } = self;
        evidence.log_evidence += log_prior;
        evidence.log_prior += log_prior;
        Self { evidence, ..self }
    }

    /// Squared Mahalanobis distance to another mode.
    pub fn squared_sigmas_to(&self, other: &Self) -> f64 {
        squared_sigmas((&self.pose, &self.covariance), (&other.pose, &other.covariance))
    }

    /// The mode with mean and covariance of the mixture of all these modes, the likeliest first, by the odds against each (eq. 17.11). Its
    /// evidence stays its own.
    #[doc(hidden)]
    pub fn mixed_over(self, modes: &[Self], regions: &[SampledRegion]) -> Self {
        let Some((best, rest)) = modes.split_first() else { return self };
        // Odds beyond a number's range are clamped.
        let odds = rest.iter().map(|mode| (-0.5 * best.deviance_to(mode, regions)).exp().min(f64::MAX.sqrt()));
        let odds: Vec<f64> = std::iter::once(1.0).chain(odds).collect();
        let sum: f64 = odds.iter().sum();
        let parts: Vec<_> =
            odds.iter().zip(modes).map(|(odds, mode)| (odds / sum, mode.pose, mode.covariance)).collect();
        let (pose, covariance) = mixture_moments(&best.pose, &parts);
        Self { pose, covariance, ..self }
    }
}

/// Evidence of a mode, in parts.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct ModeEvidence {
    /// Log probability of each label, by angle in each region.
    pub(super) log_probabilities: Vec<f64>,
    /// Log evidence, and the part of it that is the log prior of the pose.
    pub(super) log_evidence: f64,
    pub(super) log_prior: f64,
}

impl ModeEvidence {
    /// Twice the log odds against another mode: of the labels, by the evidence, or by the probability that labels at other places would
    /// decide alike where that is less decisive (eq. 17.11).
    pub(super) fn deviance_to(&self, other: &Self, regions: &[SampledRegion]) -> f64 {
        let log_prior = self.log_prior - other.log_prior;
        let differences: Vec<f64> =
            self.log_probabilities.iter().zip(&other.log_probabilities).map(|(a, b)| a - b).collect();
        let counts: Vec<usize> = regions.iter().map(SampledRegion::count).collect();
        let sigmas = sigmas(&differences, &counts);
        let of_labels = 2.0 * (self.log_evidence - other.log_evidence - log_prior);
        of_labels.min(2.0 * (cumulative(sigmas).ln() - cumulative(-sigmas).ln())) + 2.0 * log_prior
    }
}

/// Fraction of each region's samples that lie clearly on the wrong side at a pose, of those within the outlier sigma of its contour.
pub(super) fn wrong_fractions(
    regions: &[SampledRegion],
    models: &[LabelModel],
    state: &PoseState,
    noise: NoiseLevels,
    budget: &Budget,
) -> Vec<f64> {
    let increment = Normal { mean: Tangent::zeros(), ..state.increment };
    let fraction = |(sampled, model): (&SampledRegion, &LabelModel)| {
        let (mut wrong, mut near) = (0.0, 0.0);
        for sample in (0..sampled.count()).map(|number| sampled.project(&state.pose, number, budget)) {
            let (margin, sigma) = match sample {
                ProjectedSample::Visible(margin) if margin.edge == EdgeKind::Own => {
                    let (mean, variance) = LabelSite::new(&margin, *model).margin_under(&increment);
                    (mean, noise.total().hypot(variance.sqrt()))
                }
                ProjectedSample::Behind { is_correct: false } => (f64::NEG_INFINITY, 1.0),
                _ => continue,
            };
            let is_wrong = margin < -OUTLIER_SIGMAS * sigma;
            wrong += f64::from(u8::from(is_wrong));
            near += f64::from(u8::from(is_wrong || margin < model.outlier_sigma));
        }
        wrong / f64::max(near, 1.0)
    };
    regions.iter().zip(models).map(fraction).collect()
}

/// Mean and covariance of a mixture, each component with its weight, about a pose that is near to all.
pub(super) fn mixture_moments(about: &Pose, components: &[(f64, Pose, Matrix6<f64>)]) -> (Pose, Matrix6<f64>) {
    let increments: Vec<_> =
        components.iter().map(|(weight, pose, _)| (*weight, about.local_coordinates(pose))).collect();
    let mean: Tangent = increments.iter().map(|(weight, increment)| increment * *weight).sum();
    let spread = |(weight, increment): &(f64, Tangent), covariance: &Matrix6<f64>| {
        (covariance + (increment - mean) * (increment - mean).transpose()) * *weight
    };
    let parts = increments.iter().zip(components);
    let covariance = parts.map(|(increment, (.., covariance))| spread(increment, covariance)).sum();
    (about.retract(&mean), covariance)
}

/// Squared Mahalanobis distance of two poses by the sum of both covariances; infinite where that is singular.
pub fn squared_sigmas(one: (&Pose, &Matrix6<f64>), other: (&Pose, &Matrix6<f64>)) -> f64 {
    let increment = one.0.local_coordinates(other.0);
    let root = (one.1 + other.1).cholesky();
    root.map_or(f64::INFINITY, |root| increment.dot(&root.solve(&increment)))
}

/// The items of the greatest logarithms of evidence, each pose once, without those that are too far behind the best.
pub fn likeliest<T>(
    mut items: Vec<T>,
    is_behind: impl Fn(&T, &T) -> bool,
    log_evidence: impl Fn(&T) -> f64,
    is_same: impl Fn(&T, &T) -> bool,
) -> Vec<T> {
    items.retain(|item| log_evidence(item).is_finite());
    items.sort_by(|a, b| log_evidence(b).total_cmp(&log_evidence(a)));
    let mut kept: Vec<T> = Vec::new();
    for item in items {
        if !kept.first().is_some_and(|best| is_behind(best, &item)) && !kept.iter().any(|other| is_same(other, &item)) {
            kept.push(item);
        }
    }
    kept
}
