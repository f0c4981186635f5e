//! The covariance of a pose by contours with correlated noise.

use crate::support::contours::{all_bitten, clicked};
use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, angle_piece, regular};
use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::covariance::covariance;
use regionpose::internals::contour::degrees_of_freedom::residual_dof;
use regionpose::internals::contour::fit::refined;
use regionpose::{Integration, Pose, Problem, System};

/// 90 % of chi-squared with 6 degrees of freedom lie below.
const CHI_SQUARED_90: f64 = 10.645;

/// The rest of the way to the truth, squared, in the covariance of a pose on contours of shapes whose corners are `sigma` pixels
/// off.
fn mahalanobis(random: &mut Random, shapes: Vec<Vec<Ring>>, sigma: f64) -> f64 {
    let layout = Layout { offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let scene = Scene::of_shapes(random, shapes, layout);
    let observed: Vec<_> = scene.observed.iter().map(|region| clicked(region, sigma, random)).collect();
    let problem = Problem::new(&observed, &scene.worlds).unwrap();
    let truth = problem.centered(&scene.pose);
    let fit = refined(problem.contours(), &truth, 1, &Budget::unlimited()).unwrap();
    let turn: Rotation3<f64> = truth.rotation * fit.pose.rotation.inverse();
    let (omega, tau) = (turn.scaled_axis(), truth.translation - turn * fit.pose.translation);
    let rest = Vector6::new(omega.x, omega.y, omega.z, tau.x, tau.y, tau.z);
    rest.dot(&(covariance(problem.contours(), &fit, &Budget::unlimited()).try_inverse().unwrap() * rest))
}

#[test]
fn sides_whose_corners_are_off_are_not_taken_for_many_measurements() {
    let mut random = Random::new(11);
    for sigma in [0.2, 0.4, 1.0] {
        let shapes = || vec![vec![angle_piece(1.0)], vec![regular(5, 0.6)]];
        let inside = (0..200).filter(|_| mahalanobis(&mut random, shapes(), sigma) < CHI_SQUARED_90).count();
        // Of twenty-two ends six parameters leave sixteen: the tail is longer than that of chi-squared. Corners nearer than their
        // prior noise are taken for a little farther off.
        assert!(
            inside > 130 && inside < if sigma < 0.29 { 198 } else { 195 },
            "{inside} of 200 true poses inside, corners {sigma} pixels off"
        );
    }
}

#[test]
fn what_little_is_left_of_four_corners_is_not_taken_for_their_error() {
    let mut random = Random::new(12);
    for sigma in [0.3, 0.5] {
        let shape = || vec![vec![regular(4, 0.6)]];
        let inside = (0..200).filter(|_| mahalanobis(&mut random, shape(), sigma) < CHI_SQUARED_90).count();
        assert!(inside > 170, "{inside} of 200 true poses inside, corners {sigma} pixels off");
    }
}

#[test]
fn degrees_of_freedom_are_those_of_corners_and_of_pieces_beside_sides() {
    let numbers = |shapes: Vec<Vec<Ring>>| {
        let scene = Scene::of_shapes(&mut Random::new(13), shapes, Layout::default());
        residual_dof(scene.problem(System::Plane, Integration::Boundary).contours(), 1)
    };
    // Two a corner, without six and with one for the prior.
    for (shapes, needed) in [(vec![vec![regular(3, 0.6)]], 1.0), (vec![vec![regular(4, 0.6)]], 3.0)] {
        assert_eq!(numbers(shapes), needed);
    }
    assert_eq!(numbers(vec![vec![angle_piece(1.0)], vec![regular(5, 0.6)]]), 17.0);
    assert_eq!(numbers(vec![vec![regular(5, 0.8), regular(3, 0.4)]]), 11.0);
}

#[test]
fn it_is_symmetric_and_positive() {
    let layout = Layout { regions: 2, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let scene = Scene::random(&mut Random::new(12), layout);
    let problem = Problem::new(&all_bitten(&scene, 1.0), &scene.worlds).unwrap();
    let fit = refined(problem.contours(), &problem.centered(&scene.pose), 1, &Budget::unlimited()).unwrap();
    let bitten = covariance(problem.contours(), &fit, &Budget::unlimited());
    let scale = Matrix6::from_diagonal(&bitten.diagonal().map(|variance| variance.sqrt().recip()));
    let correlation = scale * bitten * scale;
    assert!((correlation - correlation.transpose()).amax() < 1e-9);
    assert!(correlation.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn a_pose_in_no_view_has_no_covariance() {
    let scene = Scene::random(&mut Random::new(2), Layout { regions: 1, ..Layout::default() });
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let mut fit = refined(problem.contours(), &problem.centered(&scene.pose), 1, &Budget::unlimited()).unwrap();
    let away = Rotation3::from_euler_angles(0.0, 3.0, 0.0) * fit.pose.rotation;
    fit.pose = Pose::new(away, -fit.pose.translation);
    assert!(covariance(problem.contours(), &fit, &Budget::unlimited()).iter().all(|value| value.is_infinite()));
}
