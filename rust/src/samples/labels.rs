//! How likely labels are at a pose that is not refined, and how far they are trusted beforehand (`docs/math.md`, eq.
//! 17.3).

use super::normal::cumulative;
use super::propagation::{Edge, Label, Trust};
use super::readings::{Reading, SampledRegion, Sight};
use crate::contour::correlation::sigmas;
use crate::geometry::pose::Pose;

/// The coarsest blur, pixels.
pub(super) const COARSEST: f64 = 64.0;

/// Blur from which on all samples count, pixels; on the way to it about so many of all regions lead as well.
pub(crate) const SHARP: f64 = 4.0;
pub(super) const LEADING: usize = 200;

/// Shares of wrong labels and of disturbed contour before anything is known, and the number of samples that they stand
/// for.
pub(super) const MISLABELED: f64 = 0.01;
pub(super) const DISTURBED: f64 = 0.03;
pub(super) const WEIGHT: f64 = 30.0;

/// Another pose fits as well by its samples where the odds against it are less than 9 to 1, as twice their logarithm: a convention.
/// Of others the shares alone count.
pub(crate) const ALIKE: f64 = 4.394_449_154_672_439;

/// How far disturbed parts of a contour are off, as a share of the region's size, and in blurs at least.
pub(super) const FAR_OFF: f64 = 0.1;
pub(super) const FAR_BLURS: f64 = 4.0;

/// The step that leaves about as many samples of all regions as lead.
pub fn leading_step(regions: &[SampledRegion]) -> usize {
    (regions.iter().map(SampledRegion::count).sum::<usize>() / LEADING).max(1)
}

/// The blur by which a start is as far off as it looks: root mean square of how far samples lie on the wrong side, pixels.
pub(super) fn first_blur(regions: &[SampledRegion], pose: &Pose, step: usize) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for reading in readings(regions, pose, step) {
        if let Reading::Seen(Sight { margin, edge: Edge::Own, .. }) = reading
            && margin < 0.0
        {
            squares += margin * margin;
            count += 1.0;
        }
    }
    (squares / f64::max(count, 1.0)).sqrt().clamp(SHARP, COARSEST)
}

/// Logarithm of the probability of the labels of every `step`-th sample at a pose that is not refined, with this blur.
pub fn log_likelihood(regions: &[SampledRegion], pose: &Pose, blur: f64, step: usize) -> f64 {
    let trust = Trust { blur, wide: FAR_BLURS * blur, ..Trust::unknown() };
    readings(regions, pose, step).map(|reading| trust.reading(&reading).log_probability).sum()
}

/// What is compared of poses that all samples led to.
#[derive(Debug, Clone)]
pub(super) struct Compared {
    /// Logarithm of the probability of each label, around each region.
    pub(super) log_probabilities: Vec<f64>,
    /// Logarithms of the evidence, and of what else than samples is known.
    pub(super) log_evidence: f64,
    pub(super) log_known: f64,
}

impl Compared {
    /// Twice the logarithm of the odds against another pose: by the evidence, or by how likely the labels of other places would
    /// say the same where that leaves more to chance (`docs/math.md`, eq. 17.11).
    pub(super) fn against(&self, other: &Self, regions: &[SampledRegion]) -> f64 {
        let known = self.log_known - other.log_known;
        let differences: Vec<f64> =
            self.log_probabilities.iter().zip(&other.log_probabilities).map(|(a, b)| a - b).collect();
        let counts: Vec<usize> = regions.iter().map(SampledRegion::count).collect();
        let sigmas = sigmas(&differences, &counts);
        let by_samples = 2.0 * (self.log_evidence - other.log_evidence - known);
        by_samples.min(2.0 * (cumulative(sigmas).ln() - cumulative(-sigmas).ln())) + 2.0 * known
    }
}

/// What labels show together.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shown {
    pub(super) log_probability: f64,
    pub(super) mislabeled: f64,
    pub(super) disturbed: f64,
    /// Numbers of labels: all, and those that could show a disturbed contour.
    pub(super) all: f64,
    pub(super) near: f64,
}

impl Shown {
    pub(super) fn add(&mut self, label: &Label, is_near: bool) {
        let near = f64::from(u8::from(is_near));
        self.log_probability += label.log_probability;
        self.mislabeled += label.mislabeled;
        self.disturbed += near * label.disturbed;
        self.all += 1.0;
        self.near += near;
    }
}

impl Trust {
    /// What is expected before anything is known.
    pub(super) fn unknown() -> Self {
        Self { blur: COARSEST, wide: FAR_BLURS * COARSEST, disturbed: DISTURBED, mislabeled: MISLABELED }
    }

    /// The label of a sample that is seen there.
    pub(super) fn reading(&self, reading: &Reading) -> Label {
        match reading {
            Reading::Seen(sight) => self.label(sight.edge, sight.margin, 0.0),
            Reading::Behind(right) => self.label_behind(*right),
        }
    }

    /// The label of a sample behind the camera, infinitely far on its right side or its wrong one.
    pub(super) fn label_behind(&self, right: bool) -> Label {
        self.label(Edge::Own, if right { f64::INFINITY } else { f64::NEG_INFINITY }, 0.0)
    }
}

fn readings<'a>(regions: &'a [SampledRegion], pose: &'a Pose, step: usize) -> impl Iterator<Item = Reading> + 'a {
    regions.iter().flat_map(move |region| (0..region.count()).step_by(step).map(|number| region.read(pose, number)))
}
