//! Poses on observed contours: readings and their derivatives, bites out of regions, and what stays as it was.

use crate::support::contours::{all_bitten, distances, one_turned, readings, rows};
use crate::support::jacobian::differences;
use crate::support::random::Random;
use crate::support::scene::{FOCAL, Layout, Scene, SpaceRing};
use nalgebra::{DVector, Matrix6, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::fit::{ContourFit, refined};
use regionpose::internals::contour::readings::Reading;
use regionpose::internals::equations::normal_equations::NormalEquations;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::{Estimate, ObservedRegion, Options, Pose, Problem, Refinement, Warning};

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

/// Differences of two lengths agree this well where the distance is smooth.
const SMOOTH: f64 = 1e-7;

/// How much slopes to either side of a pose may differ, as a share of the largest: over a thousandth of the unit, by far less than at an
/// edge.
const BENT: f64 = 0.1;

/// Sums in another order differ by rounding.
const ROUNDING: f64 = 1e-9;

fn layout(regions: usize) -> Layout {
    Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() }
}

fn problem(scene: &Scene, observed: &[ObservedRegion]) -> Problem {
    Problem::new(observed, &scene.worlds).unwrap()
}

fn estimated(scene: &Scene, observed: &[ObservedRegion], refinement: Refinement) -> Estimate {
    problem(scene, observed).estimate_with(&Options::default().with_refinement(refinement)).unwrap()
}

#[test]
fn at_the_true_pose_all_distances_vanish_but_for_corners() {
    let scene = Scene::random(&mut Random::new(1), layout(2));
    let distances = distances(&problem(&scene, &scene.observed), &scene.pose);
    // A piece that holds a corner has its mean inside it.
    let near = distances.iter().filter(|distance| distance.abs() < 1e-6).count();
    assert!(near as f64 > 0.9 * distances.len() as f64, "{near} of {}", distances.len());
    assert!(distances.iter().all(|distance| distance.abs() < 1.5), "{distances:?}");
}

#[test]
fn distances_are_in_pixels() {
    // Seen from twice as far, a region shrinks to half its size: its outline moves by half the radius.
    let square: SpaceRing =
        [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)].map(|(x, y)| Vector3::new(x, y, 4.0)).to_vec();
    let scene = Scene::of_rings(Pose::identity(), &[vec![square.clone()]]);
    let further = Pose::new(Pose::identity().rotation, Vector3::new(0.0, 0.0, 4.0));
    let distances = distances(&problem(&scene, &scene.observed), &further);
    let middle = FOCAL * 0.1 * (1.0 / 4.0 - 1.0 / 8.0);
    let beside = distances.iter().filter(|distance| (distance.abs() / middle - 1.0).abs() < 1e-3).count();
    assert!(beside as f64 > 0.4 * distances.len() as f64, "{beside} of {} are {middle} off", distances.len());
}

#[test]
fn a_piece_across_the_boundary_counts_as_farther_than_its_mean() {
    let scene = Scene::random(&mut Random::new(3), layout(1));
    let bitten = readings(&problem(&scene, &all_bitten(&scene, -1.0)), &scene.pose).unwrap();
    assert!(
        bitten.iter().all(|reading| reading.robust_distance >= reading.distance.abs() * (1.0 - ROUNDING)
            && reading.spread > -ROUNDING)
    );
    // The two sides of the bite cross the outline: a piece of three pixels spreads by up to 9 / 12 across it.
    let crossing = |reading: &&Reading| reading.spread > 0.5;
    assert!(bitten.iter().filter(crossing).all(|reading| reading.robust_distance > reading.distance.abs() + 0.01));
    assert!(bitten.iter().filter(crossing).count() >= 2);
}

#[test]
fn few_pieces_read_as_they_do_among_all() {
    let scene = Scene::random(&mut Random::new(5), layout(2));
    let problem = problem(&scene, &scene.observed);
    let pose = problem.centered(&scene.pose.retract(&Random::new(6).tangent(0.02, 0.05)));
    for contour in problem.contours() {
        let (mut all, mut few) = (Vec::new(), Vec::new());
        contour.read(&pose, 1, &mut all, &Budget::unlimited()).unwrap();
        contour.read(&pose, 7, &mut few, &Budget::unlimited()).unwrap();
        assert_eq!((all.len(), few.len()), (contour.count(1), contour.count(7)));
        assert_eq!(few, all.into_iter().step_by(7).collect::<Vec<_>>());
    }
}

#[test]
fn normal_equations_are_sums_over_the_rows() {
    let scene = Scene::random(&mut Random::new(7), layout(2));
    let problem = problem(&scene, &scene.observed);
    let pose = scene.pose.retract(&Random::new(8).tangent(0.02, 0.05));
    let weight = |reading: &Reading| 1.0 / (1.0 + reading.robust_distance);
    let mut equations = NormalEquations::default();
    for contour in problem.contours() {
        let mut before = Vec::new();
        contour.read(&problem.centered(&pose), 1, &mut before, &Budget::unlimited()).unwrap();
        contour
            .add_normal_equations(&problem.centered(&pose), 1, &before, weight, &mut equations, &Budget::unlimited())
            .unwrap();
    }
    let (mut matrix, mut gradient) = (Matrix6::zeros(), Tangent::zeros());
    for (reading, row) in rows(&problem, &pose) {
        matrix += row * row.transpose() * weight(&reading);
        gradient += row * (weight(&reading) * reading.distance);
    }
    assert!((equations.information - matrix).amax() < ROUNDING * matrix.amax());
    assert!((equations.gradient - gradient).amax() < ROUNDING * gradient.amax());
}

#[test]
fn pieces_that_are_followed_along_the_boundary_find_their_nearest_edges() {
    for seed in 0..20 {
        let scene = Scene::random(&mut Random::new(seed), layout(3));
        let problem = problem(&scene, &scene.observed);
        let pose = problem.centered(&scene.pose.retract(&Random::new(seed).tangent(3e-4, 1e-3)));
        for contour in problem.contours() {
            let (mut nearest, mut followed) = (Vec::new(), Vec::new());
            contour.read(&pose, 1, &mut nearest, &Budget::unlimited()).unwrap();
            contour
                .for_each_row(&pose, 1, None, 2.0, |reading, _, _| followed.push(reading), &Budget::unlimited())
                .unwrap();
            let off = nearest
                .iter()
                .zip(&followed)
                .map(|(nearest, followed)| (nearest.robust_distance - followed.robust_distance).abs());
            // On the plane another edge may be nearest where two are about as near.
            assert!(off.filter(|&off| off > 0.05).count() <= nearest.len() / 100, "seed {seed}");
        }
    }
}

#[test]
fn a_pose_that_shows_nothing_has_no_readings() {
    let scene = Scene::random(&mut Random::new(9), layout(1));
    let behind = Pose::new(scene.pose.rotation, scene.pose.translation - Vector3::z() * 20.0);
    let problem = problem(&scene, &scene.observed);
    assert!(readings(&problem, &behind).is_none());
    assert!(ContourFit::at(problem.contours(), &problem.centered(&behind), 1, &Budget::unlimited()).is_none());
    assert!(refined(problem.contours(), &problem.centered(&behind), 1, &Budget::unlimited()).is_none());
}

#[test]
fn bites_out_of_regions_hardly_move_the_pose() {
    for seed in 0..12 {
        let scene = Scene::random(&mut Random::new(seed), layout(3));
        for side in [-1.0, 1.0] {
            let observed = all_bitten(&scene, side);
            let moments = estimated(&scene, &observed, Refinement::Off);
            let refined = estimated(&scene, &observed, Refinement::Contour);
            let (by_moments, by_contour) = (scene.errors(&moments.best.pose).0, scene.errors(&refined.best.pose).0);
            assert!(by_contour < 5e-4, "seed {seed}: {by_contour} rad, {by_moments} by moments");
            assert!(by_contour < 0.2 * by_moments, "seed {seed}: {by_contour} against {by_moments}");
            assert!(refined.best.minimum.is_none() && moments.best.minimum.is_some());
            assert!(refined.best.fit.mixture.outlier_fractions.iter().all(|&share| share > 0.005));
        }
    }
}

#[test]
fn a_region_that_does_not_belong_is_named_and_leaves_the_pose_alone() {
    for seed in 60..70 {
        let scene = Scene::random(&mut Random::new(seed), layout(4));
        let wrong = seed as usize % 4;
        let estimate = estimated(&scene, &one_turned(&scene, wrong), Refinement::Contour);
        let error = scene.errors(&estimate.best.pose).0;
        assert!(error < 1e-3, "seed {seed}: {error} rad");
        let named: Vec<usize> = estimate
            .warnings
            .iter()
            .filter_map(
                |warning| if let Warning::OutlierRegion { region, .. } = warning { Some(*region) } else { None },
            )
            .collect();
        assert_eq!(named, [wrong], "seed {seed}");
    }
}

#[test]
fn every_region_that_a_sure_pose_contradicts_is_named() {
    for seed in 60..66 {
        let scene = Scene::random(&mut Random::new(seed), layout(4));
        let mut observed = one_turned(&scene, 1);
        observed[2] = one_turned(&scene, 2).swap_remove(2);
        let estimate = estimated(&scene, &observed, Refinement::Contour);
        assert!(scene.errors(&estimate.best.pose).0 < 1e-3, "seed {seed}");
        let mut named: Vec<usize> = estimate
            .warnings
            .iter()
            .filter_map(|warning| match warning {
                Warning::OutlierRegion { region, .. } | Warning::PoorOverlap { region, .. } => Some(*region),
                _ => None,
            })
            .collect();
        named.sort_unstable();
        assert_eq!(named, [1, 2], "seed {seed}");
    }
}

#[test]
fn two_regions_that_disagree_are_warned_of() {
    for seed in 90..94 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let disagreeing = estimated(&scene, &one_turned(&scene, 1), Refinement::Contour);
        assert!(!disagreeing.warnings.is_empty(), "seed {seed}");
    }
}

#[test]
fn bitten_regions_are_not_called_badly_covered() {
    let scene = Scene::random(&mut Random::new(80), layout(3));
    let estimate = estimated(&scene, &all_bitten(&scene, 1.0), Refinement::Contour);
    assert!(estimate.warnings.iter().all(|warning| warning.code() != "poor-overlap"), "{:?}", estimate.warnings);
}

#[test]
fn clean_contours_leave_the_moments_pose_as_it_is() {
    for seed in 20..26 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let moments = estimated(&scene, &scene.observed, Refinement::Off);
        let refined = estimated(&scene, &scene.observed, Refinement::Contour);
        assert_eq!(moments.best.pose, refined.best.pose);
        assert!(refined.best.minimum.is_some() && refined.best.fit.is_clean());
    }
}

#[test]
fn a_refined_pose_is_likelier_than_its_start() {
    for seed in 40..46 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let observed = all_bitten(&scene, 1.0);
        let problem = problem(&scene, &observed);
        let likelihood = |pose: &Pose| {
            let fit = ContourFit::at(problem.contours(), &problem.centered(pose), 1, &Budget::unlimited()).unwrap();
            fit.mixture.likelihood
        };
        // A robust sum: distances count up to two pixels.
        let sum = |pose: &Pose| distances(&problem, pose).iter().map(|distance| distance.abs().min(2.0)).sum::<f64>();
        let moments = estimated(&scene, &observed, Refinement::Off).best.pose;
        let contours = estimated(&scene, &observed, Refinement::Contour).best.pose;
        assert!(likelihood(&contours) > likelihood(&moments) && sum(&contours) < sum(&moments), "seed {seed}");
        let start = problem.centered(&scene.pose.retract(&Random::new(seed).tangent(0.02, 0.05)));
        let at_start = ContourFit::at(problem.contours(), &start, 1, &Budget::unlimited()).unwrap();
        let fit = refined(problem.contours(), &start, 1, &Budget::unlimited()).unwrap();
        assert!(fit.mixture.likelihood > at_start.mixture.likelihood, "seed {seed}");
        assert!(
            fit.gain_over(&at_start) > 0.0
                && fit.deviance_to(&at_start, f64::INFINITY) > 0.0
                && fit.deviance_to(&fit, f64::INFINITY) == 0.0
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn distances_follow_their_derivatives(seed: u64) {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(1));
        let problem = problem(&scene, &scene.observed);
        let pose = scene.pose.retract(&random.tangent(0.01, 0.02));
        let values = |x: &Tangent| DVector::from_vec(distances(&problem, &pose.retract(x)));
        let rows = rows(&problem, &pose);
        // Where a piece's nearest edge changes within the step, differences of two lengths disagree.
        let wide = differences(&values, &Tangent::zeros(), 1.0);
        let narrow = differences(&|x: &Tangent| values(&(x * 0.5)), &Tangent::zeros(), 1.0) * 2.0;
        // Where it changes at the pose itself they agree with each other, but with neither edge.
        let (here, step) = (values(&Tangent::zeros()), 1e-3);
        let bend = |axis: usize| {
            let way = Tangent::ith(axis, step);
            (values(&way) + values(&-way) - &here * 2.0).abs() / step
        };
        let bends = (1..6).fold(bend(0), |most, axis| most.sup(&bend(axis)));
        let smooth: Vec<usize> = (0..wide.nrows())
            .filter(|&row| (wide.row(row) - narrow.row(row)).amax() < SMOOTH * wide.row(row).amax())
            .filter(|&row| bends[row] < BENT * wide.row(row).amax())
            .collect();
        prop_assert!(smooth.len() as f64 > 0.85 * wide.nrows() as f64, "{} of {}", smooth.len(), wide.nrows());
        for row in smooth {
            let error = (rows[row].1.transpose() - narrow.row(row)).amax() / narrow.row(row).amax();
            prop_assert!(error < DIFFERENCES, "row {row}: {error:.1e}");
        }
    }
}
