//! Samples whose labels follow from those of others beside a straight stretch of a contour (`docs/math.md`, section 17).

use std::collections::BTreeSet;

use super::telling::FINEST;

/// Probability that those are mislabeled that others follow from: of 100 that are not asked, one may say something else. With 1 in
/// 10, where a tenth of a region's members is mislabeled, poses are off by 0.21 deg in place of 0.18 (median of `regionpose evaluate
/// lidar --only scan=samples --only mislabeled=0.1`).
const DOUBT: f64 = 0.01;

/// Margins that differ by less are one, pixels.
pub const TOLERANCE: f64 = FINEST;

/// Where a sample lies beside its stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// On the stretch, 0 at its start and 1 at its end.
    pub along: f64,
    /// On the right side, pixels.
    pub margin: f64,
}

/// A sample that may follow from others.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) number: usize,
    pub(super) inside: bool,
    pub(super) place: Place,
}

/// The numbers of the samples beside one stretch that follow from others of their label.
pub(super) fn followers(candidates: impl Iterator<Item = Candidate>, mislabeled: f64) -> BTreeSet<usize> {
    let (inside, outside): (Vec<_>, Vec<_>) = candidates.partition(|candidate| candidate.inside);
    let of_label = |all: Vec<Candidate>| {
        let places: Vec<Place> = all.iter().map(|candidate| candidate.place).collect();
        let mut followers: BTreeSet<usize> = all.iter().map(|candidate| candidate.number).collect();
        needed(&places, mislabeled).into_iter().for_each(|one| _ = followers.remove(&all[one].number));
        followers
    };
    &of_label(inside) | &of_label(outside)
}

/// The samples, by number, of one label beside one stretch from which all the others follow, if each is mislabeled with this
/// probability: a straight stretch that has two of them on their sides has what lies beyond the line through both on its side.
/// Where all of these are mislabeled with more than one in a hundred, those that come next are needed as well.
pub fn needed(places: &[Place], mislabeled: f64) -> Vec<usize> {
    let mut left: Vec<usize> = (0..places.len()).collect();
    let by_place = |&a: &usize, &b: &usize| {
        let (a, b) = (places[a], places[b]);
        a.along.total_cmp(&b.along).then(a.margin.total_cmp(&b.margin))
    };
    left.sort_by(by_place);
    let (mut needed, mut doubt) = (Vec::new(), 1.0);
    while doubt > DOUBT && !left.is_empty() {
        let hull = hull(places, &left);
        doubt *= (hull.len() as f64 * mislabeled).min(1.0);
        left.retain(|&sample| above(places, &hull, sample) > TOLERANCE);
        needed.extend(hull);
    }
    needed
}

/// The lowest of samples in their order along the stretch: between two neighbors none lies lower than their line by more than the
/// tolerance.
fn hull(places: &[Place], order: &[usize]) -> Vec<usize> {
    // Of those that lie farthest along, the lowest.
    let farthest = places[order[order.len() - 1]].along;
    let last = order.partition_point(|&sample| places[sample].along < farthest);
    let mut hull: Vec<usize> = vec![order[0], order[last]];
    hull.dedup();
    let mut spans = vec![[0, last]];
    while let Some([from, to]) = spans.pop() {
        let ends = [from, to].map(|end| places[order[end]]);
        let height = |&at: &usize| places[order[at]].above(&ends);
        let Some(lowest) = (from + 1..to).min_by(|a, b| height(a).total_cmp(&height(b))) else { continue };
        if height(&lowest) < -TOLERANCE {
            hull.push(order[lowest]);
            spans.extend([[from, lowest], [lowest, to]]);
        }
    }
    hull.sort_by(|&a, &b| places[a].along.total_cmp(&places[b].along));
    hull
}

/// How far a sample lies above the lowest ones, pixels.
fn above(places: &[Place], hull: &[usize], sample: usize) -> f64 {
    let place = places[sample];
    let before = hull.partition_point(|&other| places[other].along < place.along);
    let end = before.max(1).min(hull.len() - 1);
    place.above(&[end.saturating_sub(1), end].map(|index| places[hull[index]]))
}

impl Place {
    /// How far it lies above the line from one place to another, pixels.
    fn above(&self, [start, end]: &[Self; 2]) -> f64 {
        let share = (self.along - start.along) / (end.along - start.along).max(f64::MIN_POSITIVE);
        self.margin - start.margin - (end.margin - start.margin) * share
    }
}
