//! Posterior probabilities of the modes that were found (`docs/math.md`, section 15).

use super::nearness::RIGHT;
use crate::contour::region_preference::RegionPreference;
use crate::geometry::pose::Pose;

/// The posterior probability of each mode, if one of them is right, from their penalties in variances.
///
/// Modes within 5 degrees of one another share the weight of the likeliest of them, and so do those that the same regions prefer:
/// the number of modes near a pose, or of a region's fits, makes none of them likelier.
pub fn mode_probabilities(penalties: &[f64], poses: &[Pose], preferences: &[Vec<RegionPreference>]) -> Vec<f64> {
    let first = |index: usize| (0..=index).find(|&other| is_near(&poses[other], &poses[index]));
    let modes: Vec<Option<usize>> = (0..poses.len()).map(first).collect();
    let by_mode = shared(penalties, penalties, |a, b| modes[a] == modes[b]);
    let by_preference = shared(penalties, &by_mode, |a, b| preferences[a] == preferences[b]);
    let least = penalties.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = by_preference.iter().map(|penalty| (0.5 * (least - penalty)).exp()).collect();
    let all: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / all).collect()
}

/// Penalties of modes such that groups given by `given` have together the weight of their likeliest.
fn shared(given: &[f64], penalties: &[f64], are_alike: impl Fn(usize, usize) -> bool) -> Vec<f64> {
    let of = |answer: usize| {
        let alike = || (0..given.len()).filter(|&other| are_alike(answer, other));
        let least = alike().map(|other| given[other]).fold(f64::INFINITY, f64::min);
        let all: f64 = alike().map(|other| (0.5 * (least - penalties[other])).exp()).sum();
        penalties[answer] + 2.0 * all.ln()
    };
    (0..given.len()).map(of).collect()
}

/// The probability that the true pose is within 5 degrees of each mode, from their posterior probabilities: the sum over all modes so
/// near to it.
pub fn probability_near(poses: &[Pose], shares: &[f64]) -> Vec<f64> {
    let all = || poses.iter().zip(shares);
    poses.iter().map(|pose| all().filter(|(other, _)| is_near(pose, other)).map(|(_, share)| share).sum()).collect()
}

fn is_near(pose: &Pose, other: &Pose) -> bool {
    pose.angle_to(other).to_degrees() < RIGHT
}
