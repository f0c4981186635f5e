//! Label noise model: the probability of a sample's label given its margin, a probit mixture with mislabeling (`docs/math.md`,
//! eq. 17.3), its moments under a normal margin (eq. 17.6), and the sufficient statistics of its parameters.

use super::margin::{EdgeKind, Margin, ProjectedSample, SampledRegion};
use crate::budget::Budget;
use crate::geometry::pose::Pose;
use crate::math::normal::{cumulative, density};
use crate::noise::boundary::{CALIBRATION, COARSE, LARGEST};
use crate::noise::contamination::{LEAST_RATIO, PRIOR_SHARE};

/// Samples of all regions together by which poses are compared and refined at coarse noise.
const SUBSAMPLE_SIZE: usize = 200;

/// Prior mean of the mislabeling rate, and the number of samples that it and the contamination count as.
const PRIOR_MISLABELING: f64 = 0.01;
const PRIOR_COUNT: f64 = 30.0;

/// Probability of a label that carries no information.
pub const UNINFORMATIVE: f64 = 0.5;

/// Probability that the label of a sample is wrong, of a region that belongs to the pose: by far too many.
const MISLABELED: f64 = 0.1;

/// Whether a share of wrong labels is likelier of a region elsewhere than of one that belongs to the pose.
pub fn contradicts(wrong: f64) -> bool {
    let (label, right) = (UNINFORMATIVE / MISLABELED, UNINFORMATIVE / (1.0 - MISLABELED));
    wrong * label.ln() + (1.0 - wrong) * right.ln() > 0.0
}

/// Noise of the labels of a region's samples.
///
/// A label is right with the probability `mislabeling + (1 - 2 mislabeling) ((1 - contamination) Phi(margin / sigma) +
/// contamination Phi(margin / outlier_sigma))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabelModel {
    /// Standard deviation of the contour where it is clean, pixels.
    pub sigma: f64,
    /// Standard deviation where it is disturbed, pixels.
    pub outlier_sigma: f64,
    /// Fraction of the contour that is disturbed.
    pub contamination: f64,
    /// Fraction of labels that are wrong, however far from the contour.
    pub mislabeling: f64,
}

impl LabelModel {
    /// The model before any label is used.
    pub(super) fn prior() -> Self {
        Self {
            sigma: LARGEST,
            outlier_sigma: LEAST_RATIO * LARGEST,
            contamination: PRIOR_SHARE,
            mislabeling: PRIOR_MISLABELING,
        }
    }

    /// The model with the rates that maximize their expected log posterior (M step of expectation-maximization).
    pub(super) fn maximized(&self, stats: &LabelStats) -> Self {
        let rate =
            |sum: f64, count: f64, prior: f64| ((sum + PRIOR_COUNT * prior) / (count + PRIOR_COUNT)).min(UNINFORMATIVE);
        Self {
            mislabeling: rate(stats.mislabeled, stats.count, PRIOR_MISLABELING),
            contamination: rate(stats.disturbed, stats.near_count, PRIOR_SHARE),
            ..*self
        }
    }

    /// Probability of a label far on its wrong side, and how much larger it is far on its right side.
    pub(super) fn floor_and_range(&self, edge: EdgeKind) -> (f64, f64) {
        match edge {
            EdgeKind::Own => (self.mislabeling, 1.0 - 2.0 * self.mislabeling),
            EdgeKind::OccludedInside => (UNINFORMATIVE, UNINFORMATIVE - self.mislabeling),
            EdgeKind::OccludedOutside => (self.mislabeling, UNINFORMATIVE - self.mislabeling),
        }
    }

    /// Weights and sigmas of the clean and of the disturbed component.
    fn components(&self, edge: EdgeKind) -> [(f64, f64); 2] {
        let (_, range) = self.floor_and_range(edge);
        [(range * (1.0 - self.contamination), self.sigma), (range * self.contamination, self.outlier_sigma)]
    }

    /// Log probability of a label whose margin is normal with this mean and variance, and the posterior probabilities that it is
    /// mislabeled or beside a disturbed contour.
    pub fn posterior(&self, edge: EdgeKind, mean: f64, variance: f64) -> LabelPosterior {
        let correct = |sigma: f64| cumulative(mean / (sigma * sigma + variance).sqrt());
        let [(clean, sigma), (disturbed, outlier_sigma)] = self.components(edge);
        let on_side = correct(sigma);
        // Beside contour segments the states carry the contamination, and it is zero here.
        let outlier = if disturbed > 0.0 { disturbed * correct(outlier_sigma) } else { 0.0 };
        let probability = self.floor_and_range(edge).0 + clean * on_side + outlier;
        // A label drawn at random agrees by half with a margin that is certainly right.
        let mislabeled = match edge {
            EdgeKind::OccludedInside => 0.0,
            _ => self.mislabeling * (1.0 - on_side),
        };
        LabelPosterior {
            log_probability: probability.ln(),
            mislabeled: mislabeled / probability,
            disturbed: outlier / probability,
        }
    }

    /// The posterior of a projected sample's label.
    pub(super) fn posterior_at(&self, sample: &ProjectedSample) -> LabelPosterior {
        match sample {
            ProjectedSample::Visible(margin) => self.posterior(margin.edge, margin.value, 0.0),
            ProjectedSample::Behind { is_correct } => self.posterior_behind(*is_correct),
        }
    }

    /// The posterior of the label of a sample behind the camera: its margin is infinite.
    pub(super) fn posterior_behind(&self, is_correct: bool) -> LabelPosterior {
        self.posterior(EdgeKind::Own, if is_correct { f64::INFINITY } else { f64::NEG_INFINITY }, 0.0)
    }

    /// Zeroth moment of the tilted distribution of a normal margin, as a logarithm, with its derivatives by the mean (`docs/math.md`,
    /// eq. 17.6).
    pub(super) fn log_moment(&self, edge: EdgeKind, mean: f64, variance: f64) -> LogMoment {
        let (mut probability, mut slope, mut bend) = (self.floor_and_range(edge).0, 0.0, 0.0);
        for (weight, sigma) in self.components(edge).into_iter().filter(|(weight, _)| *weight > 0.0) {
            let width = (sigma * sigma + variance).sqrt();
            let u = mean / width;
            let height = weight * density(u) / width;
            probability += weight * cumulative(u);
            slope += height;
            bend += height * u / width;
        }
        let first = slope / probability;
        LogMoment { value: probability.ln(), first, second: first * first + bend / probability }
    }
}

/// Logarithm of a label's probability under a normal margin, and its derivatives.
pub(super) struct LogMoment {
    /// The logarithm.
    pub(super) value: f64,
    /// Its first derivative by the margin's mean, and minus its second.
    pub(super) first: f64,
    pub(super) second: f64,
}

/// Posterior of a label's noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LabelPosterior {
    /// Logarithm of the label's probability.
    pub log_probability: f64,
    /// Probability that it is mislabeled.
    pub mislabeled: f64,
    /// Probability that the contour beside it is disturbed.
    pub disturbed: f64,
}

impl std::ops::Mul<f64> for LabelPosterior {
    type Output = Self;

    /// The posterior weighed by the probability of what it is conditional on.
    fn mul(self, weight: f64) -> Self {
        Self {
            log_probability: weight * self.log_probability,
            mislabeled: weight * self.mislabeled,
            disturbed: weight * self.disturbed,
        }
    }
}

impl std::ops::Add for LabelPosterior {
    type Output = Self;

    /// The sum of two weighed posteriors.
    fn add(self, other: Self) -> Self {
        Self {
            log_probability: self.log_probability + other.log_probability,
            mislabeled: self.mislabeled + other.mislabeled,
            disturbed: self.disturbed + other.disturbed,
        }
    }
}

/// Sufficient statistics of the labels of a region (E step of expectation-maximization).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LabelStats {
    pub(super) log_probability: f64,
    mislabeled: f64,
    disturbed: f64,
    /// Numbers of labels: all, and those near enough to show a disturbed contour.
    count: f64,
    near_count: f64,
}

impl LabelStats {
    pub(super) fn add(&mut self, label: &LabelPosterior, is_near: bool) {
        let near = f64::from(u8::from(is_near));
        self.log_probability += label.log_probability;
        self.mislabeled += label.mislabeled;
        self.disturbed += near * label.disturbed;
        self.count += 1.0;
        self.near_count += near;
    }
}

/// Standard deviations of noise, pixels: of each label, of the dilation of a whole contour, and of its corners at least.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct NoiseLevels {
    /// Of labels, independent.
    pub label: f64,
    /// Of a contour's dilation, common to all of it.
    pub dilation: f64,
    /// Of its corners, at least.
    pub corner: f64,
}

impl NoiseLevels {
    /// Sigma of corners: label noise beyond the finest does not average out along a segment.
    pub fn corner_sigma(&self) -> f64 {
        (self.label.powi(2) - CALIBRATION.powi(2)).sqrt().max(self.corner)
    }

    /// Whether other levels mean the same model.
    pub(super) fn is_equivalent(&self, other: &Self) -> bool {
        self.label == other.label && self.dilation == other.dilation && self.corner_sigma() == other.corner_sigma()
    }

    /// Sigma of a margin by all noise together.
    pub(super) fn total(&self) -> f64 {
        self.label.hypot(self.corner_sigma()).hypot(self.dilation)
    }

    /// Log prior density up to a constant: uniform in the sigma of corners (Gelman 2006), of which each level of a geometric grid
    /// stands for an interval as long as it is large.
    pub(super) fn log_prior(&self) -> f64 {
        self.corner_sigma().ln()
    }

    /// The levels with the sigma of corners multiplied by a factor.
    pub(super) fn with_scaled_corner(&self, factor: f64) -> Self {
        Self { corner: self.corner * factor, ..*self }
    }
}

/// The stride that leaves a subsample of all regions.
pub fn subsample_stride(regions: &[SampledRegion]) -> usize {
    (regions.iter().map(SampledRegion::count).sum::<usize>() / SUBSAMPLE_SIZE).max(1)
}

/// Sigma of labels by the residuals of a pose: root mean square margin of the samples on their wrong side, pixels.
pub(super) fn residual_sigma(regions: &[SampledRegion], pose: &Pose, stride: usize, budget: &Budget) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for sample in projected(regions, pose, stride, budget) {
        if let ProjectedSample::Visible(Margin { value, edge: EdgeKind::Own, .. }) = sample
            && value < 0.0
        {
            squares += value * value;
            count += 1.0;
        }
    }
    (squares / f64::max(count, 1.0)).sqrt().clamp(COARSE, LARGEST)
}

/// Log likelihood of the labels of every `stride`-th sample at a pose, independent, with this sigma.
pub fn log_likelihood(regions: &[SampledRegion], pose: &Pose, sigma: f64, stride: usize, budget: &Budget) -> f64 {
    let model = LabelModel { sigma, outlier_sigma: LEAST_RATIO * sigma, ..LabelModel::prior() };
    projected(regions, pose, stride, budget).map(|sample| model.posterior_at(&sample).log_probability).sum()
}

fn projected<'a>(
    regions: &'a [SampledRegion],
    pose: &'a Pose,
    stride: usize,
    budget: &'a Budget,
) -> impl Iterator<Item = ProjectedSample> + 'a {
    regions
        .iter()
        .flat_map(move |region| (0..region.count()).step_by(stride).map(|number| region.project(pose, number, budget)))
}
