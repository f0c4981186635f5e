//! What a contour's noise says of its pose: pieces, runs, correlations and the covariance.

mod support;

use nalgebra::{Rotation3, Vector2, Vector3, Vector6};
use regionpose::contour::correlation::{correlation, long_run};
use regionpose::contour::covariance::covariance;
use regionpose::contour::distance::{Contour, ContourFit, refined};
use regionpose::contour::loss::{slope, weight};
use regionpose::contour::pieces::{Piece, pieces};
use regionpose::equations::facet::Integration;
use regionpose::equations::system::System;
use regionpose::geometry::pose::Pose;
use regionpose::geometry::rings::PlaneRings;
use regionpose::region::ObservedRegion;
use regionpose::search::candidates::Problem;
use support::random::Random;
use support::scene::{FOCAL, Layout, Scene, SpaceRing, angle_piece, regular};

/// 90 % of chi-squared with 6 degrees of freedom lie below.
const CHI_SQUARED_90: f64 = 10.645;

fn cut(ring: &[(f64, f64)], pixels: f64, on_border: &[Vec<bool>]) -> Vec<Piece> {
    let ring = ring.iter().map(|&(x, y)| Vector2::new(x, y)).collect();
    pieces(&PlaneRings::polygon(vec![ring]).unwrap(), on_border, pixels)
}

const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];

#[test]
fn pieces_of_a_square_lie_on_its_sides_and_each_side_is_one_run() {
    let pieces = cut(&SQUARE, 30.0, &[]);
    assert_eq!(pieces.len(), 40);
    for (index, piece) in pieces.iter().enumerate() {
        let beside = piece.mean.x.min(piece.mean.y).min(1.0 - piece.mean.x).min(1.0 - piece.mean.y);
        assert!(beside.abs() < 1e-12);
        // A tenth of a side spreads along it by its length squared over twelve, and not across.
        assert!((piece.spread.trace() - 0.01 / 12.0).abs() < 1e-12);
        assert!(piece.spread.symmetric_eigenvalues().min().abs() < 1e-12);
        assert_eq!(piece.run, pieces[index / 10 * 10].run);
    }
    let runs: std::collections::HashSet<_> = pieces.iter().map(|piece| piece.run.unwrap()).collect();
    assert_eq!(runs.len(), 4);
}

#[test]
fn pieces_over_a_stair_lie_on_no_run() {
    let mut stair: Vec<(f64, f64)> = (0..40).flat_map(|k| [(k as f64, k as f64), (k as f64 + 1.0, k as f64)]).collect();
    stair.push((40.0, 40.0));
    stair.push((0.0, 40.0));
    let pieces = cut(&stair, 1.0, &[]);
    let on_the_stair = |piece: &&Piece| piece.mean.x > 2.0 && piece.mean.x < 38.0 && piece.mean.y < piece.mean.x + 1.0;
    let over: Vec<&Piece> = pieces.iter().filter(on_the_stair).collect();
    assert!(over.len() > 20);
    assert!(over.iter().all(|piece| piece.run.is_none() && piece.spread.symmetric_eigenvalues().min() > 0.01));
}

#[test]
fn pieces_that_touch_the_border_are_left_out() {
    let whole = cut(&SQUARE, 30.0, &[]);
    let without = cut(&SQUARE, 30.0, &[vec![false, true, false, false]]);
    assert_eq!((whole.len(), without.len()), (40, 30));
    assert!(without.iter().all(|piece| piece.mean.x < 1.0));
}

#[test]
fn the_slope_is_the_derivative_of_a_weighted_distance() {
    for (distance, scale) in [(0.0, 0.3), (0.2, 0.25), (1.0, 0.4), (-3.0, 2.0)] {
        let pull = |d: f64| d * weight(d, scale);
        let step = 1e-6;
        let difference = (pull(distance + step) - pull(distance - step)) / (2.0 * step);
        assert!((slope(distance, scale) - difference).abs() < 1e-8, "{distance} at {scale}");
    }
}

#[test]
fn neighbours_that_take_turns_sum_to_less_and_alike_ones_to_more() {
    let turns: Vec<f64> = (0..400).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let alike: Vec<f64> = (0..400).map(|k| if (k / 40) % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let mut random = Random::new(3);
    let noise: Vec<f64> = (0..4000).map(|_| random.normal()).collect();
    assert!(long_run(&turns) < 0.25 && correlation(&turns) == 1.0);
    assert!(long_run(&alike) > 7.0 && correlation(&alike) > 7.0);
    assert!((long_run(&noise) - 1.0).abs() < 0.3);
    assert_eq!(correlation(&[0.0; 8]), 1.0);
}

/// The region that is seen where each edge was marked off by an error of its own, pixels.
fn clicked(ring: &SpaceRing, errors: &[f64]) -> SpaceRing {
    let seen: Vec<Vector2<f64>> = ring.iter().map(|r| r.xy() / r.z).collect();
    let count = seen.len();
    let line = |k: usize| {
        let step = seen[(k + 1) % count] - seen[k];
        let normal = Vector2::new(step.y, -step.x).normalize();
        (normal, normal.dot(&seen[k]) + errors[k] / FOCAL)
    };
    let corner = |k: usize| {
        let ((a, c), (b, d)) = (line((k + count - 1) % count), line(k));
        let point = Vector2::new(c * b.y - d * a.y, a.x * d - b.x * c) / a.perp(&b);
        point.push(1.0).normalize()
    };
    (0..count).map(corner).collect()
}

/// The rest of the way to the truth, squared, in the covariance of a pose on contours whose edges are `sigma` pixels off.
fn mahalanobis(random: &mut Random, sigma: f64) -> f64 {
    let shapes = vec![vec![angle_piece(1.0)], vec![regular(5, 0.6)]];
    let layout = Layout { offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let scene = Scene::of_shapes(random, shapes, layout);
    let disturbed = |region: &ObservedRegion, random: &mut Random| {
        let errors: Vec<f64> = region.rings[0].iter().map(|_| sigma * random.normal()).collect();
        ObservedRegion::new(vec![clicked(&region.rings[0], &errors)], region.pixel_area)
    };
    let observed: Vec<_> = scene.observed.iter().map(|region| disturbed(region, random)).collect();
    let problem = Problem::new(&observed, scene.worlds.clone(), System::Plane, Integration::Boundary).unwrap();
    let pairs = problem.regions().iter().zip(problem.worlds());
    let contours: Vec<_> = pairs.map(|(region, world)| Contour::new(region, world, &Vector3::zeros())).collect();
    let fit = refined(&contours, &scene.pose).unwrap();
    let turn: Rotation3<f64> = scene.pose.rotation * fit.pose.rotation.inverse();
    let (omega, tau) = (turn.scaled_axis(), scene.pose.translation - turn * fit.pose.translation);
    let rest = Vector6::new(omega.x, omega.y, omega.z, tau.x, tau.y, tau.z);
    rest.dot(&(covariance(&contours, &fit).try_inverse().unwrap() * rest))
}

#[test]
fn edges_that_are_off_as_a_whole_are_not_taken_for_many_measurements() {
    let mut random = Random::new(11);
    let inside = (0..60).filter(|_| mahalanobis(&mut random, 0.4) < CHI_SQUARED_90).count();
    assert!(inside > 45, "{inside} of 60 true poses inside");
}

#[test]
fn a_pose_in_no_view_has_no_covariance() {
    let scene = Scene::random(&mut Random::new(2), Layout { regions: 1, ..Layout::default() });
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let contours = [Contour::new(&problem.regions()[0], &problem.worlds()[0], &Vector3::zeros())];
    let fit = refined(&contours, &scene.pose).unwrap();
    let away = Rotation3::from_euler_angles(0.0, 3.0, 0.0) * fit.pose.rotation;
    let turned = ContourFit { pose: Pose::new(away, -fit.pose.translation), ..fit };
    assert!(covariance(&contours, &turned).iter().all(|value| value.is_infinite()));
}
