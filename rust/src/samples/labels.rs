//! How likely labels are at a pose that is not refined (`docs/math.md`, eq. 17.3), and how poses compare by theirs (eq. 17.11).

use super::readings::{Edge, Reading, SampledRegion, Sight};
use super::trust::{COARSEST, FAR_BLURS, Trust};
use crate::contour::correlation::sigmas;
use crate::geometry::pose::Pose;
use crate::math::normal::cumulative;

/// Blur from which on all samples count, pixels; on the way to it about so many of all regions lead as well.
pub(crate) const SHARP: f64 = 4.0;
pub(super) const LEADING: usize = 200;

/// Another pose fits as well by its samples where the odds against it are less than 9 to 1, as twice their logarithm: a convention.
/// Of others the shares alone count.
pub(crate) const ALIKE: f64 = 4.394_449_154_672_439;

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

fn readings<'a>(regions: &'a [SampledRegion], pose: &'a Pose, step: usize) -> impl Iterator<Item = Reading> + 'a {
    regions.iter().flat_map(move |region| (0..region.count()).step_by(step).map(|number| region.read(pose, number)))
}
