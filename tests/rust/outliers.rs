//! The odds of each region: those that belong to a pose speak for it, one that lies elsewhere does not.

mod support;

use nalgebra::Vector3;
use regionpose::contour::fit::ContourFit;
use regionpose::verdict::outliers::log_odds;
use regionpose::{ObservedRegion, Problem};
use support::contours::{all_bitten, one_turned};
use support::random::Random;
use support::scene::{Layout, Scene};

fn scene(seed: u64, regions: usize) -> Scene {
    let layout = Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    Scene::random(&mut Random::new(seed), layout)
}

/// The odds at the true pose.
fn odds(scene: &Scene, observed: &[ObservedRegion]) -> Vec<f64> {
    let problem = Problem::new(observed, &scene.worlds).unwrap();
    log_odds(&ContourFit::at(problem.contours(), &problem.centered(&scene.pose), 1).unwrap())
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
