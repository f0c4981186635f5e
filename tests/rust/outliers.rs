//! Odds that each region is an inlier of a pose: high for inliers, low for a displaced region; and which of regions that contradict
//! one another are right.

use crate::support::contours::{all_bitten, one_turned};
use crate::support::random::Random;
use crate::support::scene::{Layout, Scene};
use nalgebra::{Rotation3, Vector3, Vector6};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::fit::ContourFit;
use regionpose::internals::contour::members::{least_evidence, log_odds};
use regionpose::internals::verdict::solution::TRUSTED;
use regionpose::{Estimate, ObservedRegion, Problem, Warning, WorldRegion};

fn scene(seed: u64, regions: usize) -> Scene {
    let layout = Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    Scene::random(&mut Random::new(seed), layout)
}

/// The odds at the true pose.
fn odds(scene: &Scene, observed: &[ObservedRegion]) -> Vec<f64> {
    let problem = Problem::new(observed, &scene.worlds).unwrap();
    log_odds(&ContourFit::at(problem.contours(), &problem.centered(&scene.pose), 1, &Budget::unlimited()).unwrap())
}

#[test]
fn regions_that_belong_have_odds_for_them_even_bitten() {
    for seed in 0..6 {
        let scene = scene(seed, 3);
        for observed in [scene.observed.clone(), all_bitten(&scene, 1.0)] {
            let odds = odds(&scene, &observed);
            assert!(odds.len() == 3 && odds.iter().all(|&odds| odds > 1.0), "seed {seed}: {odds:?}");
        }
    }
}

#[test]
fn a_region_elsewhere_has_odds_against_it_and_leaves_the_others_theirs() {
    for seed in 0..6 {
        let scene = scene(seed, 3);
        let odds = odds(&scene, &one_turned(&scene, 1));
        assert!(odds[1] < -1.0 && odds[0] > 1.0 && odds[2] > 1.0, "seed {seed}: {odds:?}");
    }
}

#[test]
fn a_region_alone_belongs_to_its_pose() {
    let scene = scene(7, 1);
    assert_eq!(odds(&scene, &scene.observed), [f64::INFINITY]);
    assert_eq!(odds(&scene, &all_bitten(&scene, 1.0)), [f64::INFINITY]);
}

#[test]
fn contours_confirm_a_pose_and_not_one_beside_it() {
    let increment = Vector6::new(0.0, 0.02, 0.0, 0.1, 0.0, 0.0);
    for seed in 0..6 {
        let scene = scene(seed, 3);
        for observed in [scene.observed.clone(), all_bitten(&scene, 1.0)] {
            let problem = Problem::new(&observed, &scene.worlds).unwrap();
            let pose = problem.centered(&scene.pose);
            let evidence =
                |pose| least_evidence(&ContourFit::at(problem.contours(), &pose, 1, &Budget::unlimited()).unwrap());
            let (there, beside) = (evidence(pose), evidence(pose.retract(&increment)));
            assert!(there > 50.0 && beside < 5.0, "seed {seed}: {there}, {beside}");
        }
    }
}

/// The estimate with one of the regions moved in the world, as a thing that was moved between photo and scan.
fn with_one_moved(scene: &Scene, moved: usize) -> Estimate {
    let mut worlds = scene.worlds.clone();
    let turn = Rotation3::new(Vector3::new(0.3, -0.4, 0.2));
    let rings = worlds[moved].rings();
    let middle = rings[0].iter().sum::<Vector3<f64>>() / rings[0].len() as f64;
    let shifted = |x: &Vector3<f64>| turn * (x - middle) + middle + Vector3::new(0.4, -0.3, 0.2);
    let rings: Vec<Vec<_>> = rings.iter().map(|ring| ring.iter().map(shifted).collect()).collect();
    worlds[moved] = WorldRegion::from_rings(&rings).unwrap();
    Problem::new(&scene.observed, &worlds).unwrap().estimate().unwrap()
}

#[test]
fn of_two_regions_that_disagree_either_may_be_the_right_one() {
    for seed in 0..6 {
        let scene = scene(seed, 2);
        let estimate = with_one_moved(&scene, 1);
        let solutions = || std::iter::once(&estimate.best).chain(&estimate.alternatives);
        let right = solutions().map(|solution| scene.errors(&solution.pose).0).fold(f64::INFINITY, f64::min);
        assert!(right < 1e-3, "seed {seed}: {right} rad");
        let confidences: Vec<f64> = solutions().map(|solution| solution.confidence).collect();
        assert!(confidences.iter().all(|&confidence| confidence < TRUSTED), "seed {seed}: {confidences:?}");
        let named = |region: usize| estimate.warnings.iter().any(|warning| warning.region() == Some(region));
        assert!(named(0) && named(1), "seed {seed}: {:?}", estimate.warnings);
        assert!(estimate.warnings.iter().any(|warning| matches!(warning, Warning::Ambiguous { .. })), "seed {seed}");
    }
}

#[test]
fn of_two_regions_the_one_that_leaves_the_other_near_is_right() {
    for seed in 0..6 {
        let scene = scene(seed, 2);
        for replaced in 0..2 {
            let mut worlds = scene.worlds.clone();
            let rings = worlds[replaced].rings();
            let middle: Vector3<f64> = rings.concat().iter().sum::<Vector3<f64>>() / rings.concat().len() as f64;
            let across = (rings[0][1] - rings[0][0]).normalize();
            let mirrored = |x: &Vector3<f64>| x - across * 2.0 * across.dot(&(x - middle));
            let rings: Vec<Vec<_>> = rings.iter().map(|ring| ring.iter().rev().map(mirrored).collect()).collect();
            worlds[replaced] = WorldRegion::from_rings(&rings).unwrap();
            let estimate = Problem::new(&scene.observed, &worlds).unwrap().estimate().unwrap();
            let (error, confidence) = (scene.errors(&estimate.best.pose).0, estimate.best.confidence);
            assert!(error < 1e-3 && confidence > 0.9, "seed {seed}, region {replaced}: {error} rad, {confidence}");
        }
    }
}

#[test]
fn two_regions_that_agree_are_right_against_one() {
    for seed in 0..6 {
        let scene = scene(seed, 3);
        for moved in 0..3 {
            let estimate = with_one_moved(&scene, moved);
            assert!(scene.errors(&estimate.best.pose).0 < 1e-3, "seed {seed}, region {moved}");
            assert!(estimate.alternatives.is_empty() && estimate.best.confidence > 0.9, "seed {seed}, region {moved}");
        }
    }
}
