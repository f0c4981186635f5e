//! Hypotheses ranked by their deviance, with the posterior probability of each.

use super::hypothesis::Hypothesis;
use super::mode_probability::{mode_probabilities, probability_near};
use crate::budget::Budget;
use crate::contour::degrees_of_freedom::residual_dof;
use crate::contour::region_preference::RegionPreference;
use crate::geometry::pose::Pose;
use crate::math::odds::{DECISIVE_DEVIANCE, ONE_VARIANCE};
use crate::prior::{MAX_PENALTY, Prior};
use crate::problem::Problem;
use crate::samples::posterior::EQUIVALENT_DEVIANCE;
use crate::search::poses::{SAME, sorted};

/// The hypotheses that fit about as well as the best with the prior's penalty, best first, each with its penalty (`docs/math.md`,
/// eq. 10.6).
///
/// An initial pose without an uncertainty chooses the first among them.
pub(super) fn likely(
    problem: &Problem,
    hypotheses: Vec<Hypothesis>,
    prior: &Prior,
    budget: &Budget,
) -> Vec<Hypothesis> {
    let [first, _, ..] = hypotheses.as_slice() else { return hypotheses };
    let first = first.clone();
    let numbers = residual_dof(problem.contours(), 1);
    let deviance = |hypothesis: &Hypothesis| {
        let worse = first.deviance_to(hypothesis, problem, numbers);
        let behind = MAX_PENALTY * problem.seen_from_behind(&hypothesis.pose).len() as f64;
        // The evidence of samples holds the prior already.
        let weighed = hypothesis.posterior.is_none() && prior.max_penalty() > 0.0;
        let penalty = || prior.penalty(&hypothesis.pose, hypothesis.covariance(problem, budget));
        let unlikely = if weighed { penalty() } else { 0.0 };
        (if worse.abs() <= ONE_VARIANCE { 0.0 } else { worse }) + unlikely + behind
    };
    let mut hypotheses = by_deviance(
        hypotheses.into_iter().map(|hypothesis| Hypothesis { deviance: deviance(&hypothesis), ..hypothesis }).collect(),
    );
    let least = hypotheses.first().map_or(0.0, |best| best.deviance);
    hypotheses.retain(|hypothesis| hypothesis.deviance <= least + DECISIVE_DEVIANCE);
    // Sorting is stable: ties of the prior are in order of the fit, and ties of that in order of the rotation.
    if let Some(best) = hypotheses.first().cloned() {
        let ties = |hypothesis: &Hypothesis| {
            hypothesis.deviance == least
                && best.region_preferences(hypothesis).iter().all(|&preference| preference == RegionPreference::Neither)
        };
        hypotheses.sort_by_key(|hypothesis| if ties(hypothesis) { order(&hypothesis.pose) } else { [i64::MAX; 3] });
    }
    if let (Some(initial), true) = (prior.initial, chooses(prior)) {
        hypotheses.sort_by(|a, b| a.pose.angle_to(&initial).total_cmp(&b.pose.angle_to(&initial)));
    }
    hypotheses
        .into_iter()
        .map(|hypothesis| Hypothesis { deviance: hypothesis.deviance - least, ..hypothesis })
        .collect()
}

/// The hypotheses, the likeliest first.
fn by_deviance(hypotheses: Vec<Hypothesis>) -> Vec<Hypothesis> {
    sorted(hypotheses.into_iter().map(|hypothesis| (hypothesis.deviance, hypothesis)).collect())
        .into_iter()
        .map(|(_, hypothesis)| hypothesis)
        .collect()
}

/// The hypotheses that fit about as well as the best, with the posterior probability and the confidence of each, given that one of
/// them is right; the largest confidence first, unless the prior chooses.
pub(super) fn stated(hypotheses: Vec<Hypothesis>, prior: &Prior) -> Vec<(Hypothesis, [f64; 2])> {
    let Some(best) = hypotheses.first() else { return Vec::new() };
    let deviance: Vec<f64> = hypotheses.iter().map(|hypothesis| hypothesis.deviance).collect();
    let poses: Vec<Pose> = hypotheses.iter().map(|hypothesis| hypothesis.pose).collect();
    let preferences: Vec<Vec<RegionPreference>> =
        hypotheses.iter().map(|hypothesis| best.region_preferences(hypothesis)).collect();
    let shares = mode_probabilities(&deviance, &poses, &preferences);
    let confidences = probability_near(&poses, &shares);
    let stated = shares.into_iter().zip(confidences).map(|(share, confidence)| [share, confidence]);
    let mut hypotheses: Vec<(Hypothesis, [f64; 2])> = hypotheses.into_iter().zip(stated).collect();
    // Those by samples that are less likely have their shares, too.
    hypotheses.retain(|(hypothesis, _)| hypothesis.posterior.is_none() || hypothesis.deviance <= EQUIVALENT_DEVIANCE);
    if !chooses(prior) {
        hypotheses.sort_by(|(_, [_, a]), (_, [_, b])| b.total_cmp(a));
    }
    hypotheses
}

/// Whether an initial pose without an uncertainty chooses among equivalent hypotheses.
fn chooses(prior: &Prior) -> bool {
    prior.initial.is_some() && prior.initial_sigma.is_none()
}

/// Sort key of poses that fit equally: the rotation vector, in steps that round-off rarely crosses.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / SAME).round() as i64)
}
