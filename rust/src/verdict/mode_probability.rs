//! Posterior probabilities of the modes that were found (`docs/math.md`, section 15).

use super::nearness::RIGHT;
use crate::contour::region_preference::RegionPreference;
use crate::geometry::pose::Pose;

/// The probabilities that each of some answers is the place, if one of them is, from what counts against them in variances.
///
/// Answers within 5 degrees of one another share what the likeliest of them would have, and so do those that the same regions vote
/// for: from how many poses a place is reached, or a region fits, makes none of them likelier.
pub fn mode_probabilities(against: &[f64], poses: &[Pose], preferences: &[Vec<RegionPreference>]) -> Vec<f64> {
    let first = |index: usize| (0..=index).find(|&other| is_near(&poses[other], &poses[index]));
    let places: Vec<Option<usize>> = (0..poses.len()).map(first).collect();
    let by_place = shared(against, against, |a, b| places[a] == places[b]);
    let by_votes = shared(against, &by_place, |a, b| preferences[a] == preferences[b]);
    let least = against.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = by_votes.iter().map(|against| (0.5 * (least - against)).exp()).collect();
    let all: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / all).collect()
}

/// What counts against answers once those alike have together what the likeliest of them had by `given`.
fn shared(given: &[f64], against: &[f64], are_alike: impl Fn(usize, usize) -> bool) -> Vec<f64> {
    let of = |answer: usize| {
        let alike = || (0..given.len()).filter(|&other| are_alike(answer, other));
        let least = alike().map(|other| given[other]).fold(f64::INFINITY, f64::min);
        let all: f64 = alike().map(|other| (0.5 * (least - against[other])).exp()).sum();
        against[answer] + 2.0 * all.ln()
    };
    (0..given.len()).map(of).collect()
}

/// The probability that the true pose is within 5 degrees of each of some answers, from those that each is the place: the sum of those
/// of all answers so near to it.
pub fn probability_near(poses: &[Pose], shares: &[f64]) -> Vec<f64> {
    let all = || poses.iter().zip(shares);
    poses.iter().map(|pose| all().filter(|(other, _)| is_near(pose, other)).map(|(_, share)| share).sum()).collect()
}

fn is_near(pose: &Pose, other: &Pose) -> bool {
    pose.angle_to(other).to_degrees() < RIGHT
}
