//! The confidence: a probability, higher for better evidence, defined for the worst there can be.

use std::iter;

use crate::support::contours::clicked;
use crate::support::random::Random;
use crate::support::scene::{Layout, Scene, star};
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use regionpose::internals::contour::region_preference::RegionPreference;
use regionpose::internals::verdict::confidence::Evidence;
use regionpose::internals::verdict::mode_probability::{mode_probabilities, probability_near};
use regionpose::{Pose, Problem, Solution};

/// Regions that are marked and solved.
const SCENES: usize = 450;

const GOOD: Evidence = Evidence { rotation_sigmas: [0.004, 0.006, 0.01], regions: 3, mismatch: 0.01, noise: 0.25 };

const BAD: Evidence = Evidence { rotation_sigmas: [1.0, 8.0, 2.0], regions: 1, mismatch: 0.4, noise: 10.0 };

/// A few clean pieces of another shape.
const UNLIKE: Evidence = Evidence { rotation_sigmas: [0.3, 0.1, 0.1], regions: 1, mismatch: 0.9, noise: 0.25 };

/// Three fifths of a region are not seen.
const HALF_SEEN: Evidence = Evidence { rotation_sigmas: [3.0, 1.0, 0.5], regions: 1, mismatch: 0.31, noise: 0.8 };

#[test]
fn good_evidence_is_trusted_and_bad_is_not() {
    assert!(GOOD.probability() > 0.99, "{}", GOOD.probability());
    assert!(BAD.probability() < 0.5, "{}", BAD.probability());
    assert!(UNLIKE.probability() < 0.7, "{}", UNLIKE.probability());
    assert!(HALF_SEEN.probability() < 0.8, "{}", HALF_SEEN.probability());
}

#[test]
fn a_direction_that_is_free_has_a_finite_confidence() {
    for sigma in [f64::INFINITY, f64::NAN] {
        let evidence = Evidence { rotation_sigmas: [sigma; 3], ..GOOD };
        assert!((0.0..0.1).contains(&evidence.probability()), "{}", evidence.probability());
    }
}

/// Whatever the odds of the hypothesis, a deviation of ten degrees leaves two poses in five within five.
#[test]
fn the_noise_alone_bounds_it() {
    let probability = Evidence { rotation_sigmas: [0.1, 0.1, 10.0], ..GOOD }.probability();
    assert!((0.2..0.383).contains(&probability), "{probability}");
}

#[test]
fn answers_within_five_degrees_of_each_other_speak_for_one_another() {
    let turned = |degrees: f64| Pose::new(Rotation3::new(Vector3::x() * degrees.to_radians()), Vector3::zeros());
    let found = probability_near(&[0.0, 3.0, 6.0, 90.0].map(turned), &[0.4, 0.2, 0.1, 0.25]);
    for (found, sum) in found.into_iter().zip([0.6, 0.7, 0.3, 0.25]) {
        assert!((found - sum).abs() < 1e-12, "{found} for {sum}");
    }
}

#[test]
fn answers_near_one_another_or_of_the_same_votes_have_what_one_would_have() {
    let turned = |degrees: f64| Pose::new(Rotation3::new(Vector3::x() * degrees.to_radians()), Vector3::zeros());
    let (first, second) = (vec![RegionPreference::Neither; 2], vec![RegionPreference::Second, RegionPreference::First]);
    let poses = [0.0, 1.0, 2.0, 90.0, 130.0, 170.0].map(turned);
    let preferences = [&first, &first, &first, &second, &second, &second].map(Vec::clone);
    let found = mode_probabilities(&[0.0; 6], &poses, &preferences);
    for share in found {
        assert!((share - 1.0 / 6.0).abs() < 1e-12, "{share}");
    }
    // Two places in one group, one of them reached three times.
    let found = mode_probabilities(&[0.0, 0.0, 0.0, 0.0], &poses[..4], &vec![first; 4]);
    for (share, needed) in found.into_iter().zip([1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 0.5]) {
        assert!((share - needed).abs() < 1e-12, "{share} for {needed}");
    }
}

#[test]
fn the_odds_of_regions_multiply() {
    let odds = |regions: usize| Evidence { regions, ..GOOD }.log_odds();
    let one = -((GOOD.mismatch + 0.03) / (1.0 - GOOD.mismatch.powi(2)) * GOOD.noise / 2.0).ln();
    for (regions, needed) in [(0, one), (1, one), (2, 2.0 * one), (3, 3.0 * one)] {
        assert!((odds(regions) - needed).abs() < 1e-12, "{regions}: {}", odds(regions));
    }
}

proptest! {
    #[test]
    fn it_is_a_probability_that_falls_with_the_uncertainty(evidence in evidence(), factor in 1.0..20.0_f64) {
        let wider = Evidence { rotation_sigmas: evidence.rotation_sigmas.map(|sigma| sigma * factor), ..evidence };
        prop_assert!((0.0..=1.0).contains(&evidence.probability()));
        prop_assert!(wider.probability() <= evidence.probability());
    }

    #[test]
    fn it_falls_with_what_speaks_against_the_pose(evidence in evidence(), more in 0.0..0.5_f64) {
        let Evidence { mismatch, noise, .. } = evidence;
        let worse = [Evidence { mismatch: mismatch + more, ..evidence }, Evidence { noise: noise + more, ..evidence }];
        prop_assert!(worse.iter().all(|worse| worse.probability() <= evidence.probability()));
    }
}

/// What a fit may show.
fn evidence() -> impl Strategy<Value = Evidence> {
    let sigma = || 1e-4..50.0_f64;
    let all = ([sigma(), sigma(), sigma()], 0..9_usize, 0.0..1.0_f64, 0.25..20.0_f64);
    all.prop_map(|(rotation_sigmas, regions, mismatch, noise)| Evidence { rotation_sigmas, regions, mismatch, noise })
}

/// Four marked corners leave a pose two degrees of freedom, so that residuals hardly choose between two poses.
#[test]
fn of_few_marked_corners_the_first_answer_is_right_as_often_as_its_probability() {
    let mut random = Random::new(17);
    let layout = || Layout { offset: 0.0, axis: Some(Vector3::z()), tilt: [0.02, 0.14], ..Layout::default() };
    let (mut several, mut right, mut stated) = (0, 0, 0.0);
    for _ in 0..SCENES {
        let shape = vec![vec![star(&mut random, 4, 0.6)]];
        let scene = Scene::of_shapes(&mut random, shape, layout());
        let observed = clicked(&scene.observed[0], 0.5, &mut random);
        let Ok(estimate) = Problem::new(&[observed], &scene.worlds).unwrap().estimate() else { continue };
        let answers = || iter::once(&estimate.best).chain(&estimate.alternatives);
        let is_right = |answer: &&Solution| scene.pose.angle_to(&answer.pose).to_degrees() < 5.0;
        if answers().count() > 1 && answers().any(|answer| is_right(&answer)) {
            several += 1;
            right += usize::from(is_right(&&estimate.best));
            stated += estimate.best.mode_probability / answers().map(|answer| answer.mode_probability).sum::<f64>();
        }
    }
    let (right, stated) = (right as f64 / several as f64, stated / several as f64);
    assert!((right - stated).abs() < 0.1, "{right} of {several} right, {stated} stated");
}
