//! The hypotheses ranked by what counts against them, with the probability of each.

use super::hypothesis::Place;
use super::shares::{shares, together};
use crate::contour::fit::AMBIGUITY;
use crate::contour::numbers::telling;
use crate::contour::votes::Vote;
use crate::geometry::pose::Pose;
use crate::prior::{BELIEVED, Prior};
use crate::problem::Problem;
use crate::samples::labels::ALIKE;
use crate::search::candidates::SAME_PLACE;
use crate::search::poses::sorted;

/// Poses within this many variances of the best are equally good, as turns of symmetric shapes are: what differs is where the contours'
/// pieces lie (`cargo test symmetry::`).
const TIE: f64 = 0.6;

/// The places that fit about as well as the best once the prior is weighed in, best first, and what counts against each
/// (`docs/math.md`, eq. 10.6).
///
/// An initial pose without an uncertainty chooses the first among them.
pub(super) fn likely(problem: &Problem, places: Vec<Place>, prior: &Prior) -> Vec<Place> {
    let [first, _, ..] = places.as_slice() else { return places };
    let first = first.clone();
    let numbers = telling(problem.contours(), 1);
    let against = |place: &Place| {
        let worse = first.outdoes(place, problem, numbers);
        let behind = BELIEVED * problem.seen_from_behind(&place.pose).len() as f64;
        // The evidence of samples holds the prior already.
        let weighed = place.posterior.is_none() && prior.most() > 0.0;
        let unlikely = if weighed { prior.penalty(&place.pose, place.covariance(problem)) } else { 0.0 };
        (if worse.abs() <= TIE { 0.0 } else { worse }) + unlikely + behind
    };
    let mut places = by_against(places.into_iter().map(|place| Place { against: against(&place), ..place }).collect());
    let least = places.first().map_or(0.0, |best| best.against);
    places.retain(|place| place.against <= least + AMBIGUITY);
    // Sorting is stable: what the prior does not decide, the fit does, and the rotation where that does not either.
    if let Some(best) = places.first().cloned() {
        let ties =
            |place: &Place| place.against == least && best.votes(place).iter().all(|&vote| vote == Vote::Neither);
        places.sort_by_key(|place| if ties(place) { order(&place.pose) } else { [i64::MAX; 3] });
    }
    if let (Some(initial), true) = (prior.initial, chooses(prior)) {
        places.sort_by(|a, b| a.pose.angle_to(&initial).total_cmp(&b.pose.angle_to(&initial)));
    }
    places.into_iter().map(|place| Place { against: place.against - least, ..place }).collect()
}

/// The places, the likeliest first.
fn by_against(places: Vec<Place>) -> Vec<Place> {
    sorted(places.into_iter().map(|place| (place.against, place)).collect())
        .into_iter()
        .map(|(_, place)| place)
        .collect()
}

/// The places that fit about as well as the best, with the share and the confidence of each, if any place found is the place, the
/// largest confidence first, but where the prior has chosen.
pub(super) fn stated(places: Vec<Place>, prior: &Prior) -> Vec<(Place, [f64; 2])> {
    let Some(best) = places.first() else { return Vec::new() };
    let against: Vec<f64> = places.iter().map(|place| place.against).collect();
    let poses: Vec<Pose> = places.iter().map(|place| place.pose).collect();
    let votes: Vec<Vec<Vote>> = places.iter().map(|place| best.votes(place)).collect();
    let shares = shares(&against, &poses, &votes);
    let confidences = together(&poses, &shares);
    let stated = shares.into_iter().zip(confidences).map(|(share, confidence)| [share, confidence]);
    let mut places: Vec<(Place, [f64; 2])> = places.into_iter().zip(stated).collect();
    // Those by samples that are less likely have their shares, too.
    places.retain(|(place, _)| place.posterior.is_none() || place.against <= ALIKE);
    if !chooses(prior) {
        places.sort_by(|(_, [_, a]), (_, [_, b])| b.total_cmp(a));
    }
    places
}

/// Whether an initial pose without an uncertainty chooses among what fits alike.
fn chooses(prior: &Prior) -> bool {
    prior.initial.is_some() && prior.initial_sigma.is_none()
}

/// Where a pose comes among those that fit equally: by its rotation vector, in steps that round-off does not cross but by
/// chance.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / SAME_PLACE).round() as i64)
}
