//! Signed distance fields and the segments of their contours, exact, and the derivatives of margins by the pose.

use crate::support::jacobian::differences;
use crate::support::random::Random;
use crate::support::samples::{layout, sampled};
use crate::support::scene::{Scene, rectangle, regular, star};
use nalgebra::{DVector, Dyn, OMatrix, U6, Vector2};
use proptest::prelude::*;
use regionpose::Problem;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::samples::margin::ProjectedSample;
use regionpose::internals::samples::signed_distance::SignedDistanceField;

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

/// A square of side 2: a point beside an edge, one beyond a corner, one at the middle of a notch.
#[test]
fn distances_are_signed_by_the_side() {
    let field = SignedDistanceField::new(&[rectangle(2.0, 2.0)], &[vec![false, false, false, true]], 100.0);
    let at = |x: f64, y: f64| field.at(&Vector2::new(x, y));
    let beside = at(0.2, -0.7);
    assert!((beside.distance - 0.3).abs() < 1e-12 && (beside.gradient - Vector2::y()).norm() < 1e-12);
    let beyond = at(4.0, 5.0);
    assert!((beyond.distance + 5.0).abs() < 1e-12, "3 and 4 from the corner");
    assert!((beyond.gradient + Vector2::new(0.6, 0.8)).norm() < 1e-12);
    assert!(at(-1.5, 0.0).is_marked && !at(1.5, 0.0).is_marked, "the last edge, at x = -1, is marked");
}

/// The corner of an L towards the inside: a point near it is inside, on whichever edge it counts.
#[test]
fn a_notch_has_its_inside_outside() {
    let ell = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]].map(|[x, y]| Vector2::new(x, y));
    let field = SignedDistanceField::new(&[ell.to_vec()], &[], 100.0);
    let near = field.at(&Vector2::new(0.7, 0.6));
    assert!((near.distance - 0.5).abs() < 1e-12, "0.3 and 0.4 from the notch's corner: {near:?}");
    assert!(field.at(&Vector2::new(1.2, 1.1)).distance < 0.0);
}

#[test]
fn a_hole_is_outside() {
    let hole: Vec<_> = rectangle(1.0, 1.0).into_iter().rev().collect();
    let field = SignedDistanceField::new(&[rectangle(4.0, 4.0), hole], &[], 100.0);
    assert!((field.at(&Vector2::zeros()).distance + 0.5).abs() < 1e-12);
    assert!((field.at(&Vector2::new(0.8, 0.0)).distance - 0.3).abs() < 1e-12);
}

/// Along a side from its start to its end; a hole goes the other way around.
#[test]
fn a_point_lies_along_its_segment() {
    let hole: Vec<_> = rectangle(1.0, 1.0).into_iter().rev().collect();
    let field = SignedDistanceField::new(&[rectangle(4.0, 4.0), hole], &[], 100.0);
    let along = |x: f64, y: f64| field.at(&Vector2::new(x, y)).along;
    assert!((along(-1.0, -1.9) - 0.25).abs() < 1e-12 && (along(1.0, -2.5) - 0.75).abs() < 1e-12);
    let (left, right) = (along(-0.25, -0.6), along(0.25, -0.6));
    assert!((left + right - 1.0).abs() < 1e-12 && (left - 0.75).abs() < 1e-12);
}

/// A square has four sides, whatever steps a mask makes of them; a circle has a segment for each twentieth of its size
/// or more; what steps out of a side is none of it.
#[test]
fn segments_are_sides_or_parts_of_the_size() {
    let numbers = |ring: &[Vector2<f64>]| {
        let field = SignedDistanceField::new(&[ring.to_vec()], &[], 100.0);
        let middles = (0..ring.len()).map(|k| ring[k].lerp(&ring[(k + 1) % ring.len()], 0.5));
        middles.map(|middle| field.at(&middle).segment).collect::<Vec<_>>()
    };
    assert_eq!(numbers(&rectangle(2.0, 1.0)), [0, 1, 2, 3]);
    let steps = [[0.0, 0.0], [0.7, 0.0], [0.71, 0.01], [1.4, 0.01], [1.41, 0.02], [2.0, 0.02], [2.0, 1.0], [0.0, 1.0]];
    assert_eq!(numbers(&steps.map(|[x, y]| Vector2::new(x, y))), [0, 0, 0, 0, 0, 1, 2, 3]);
    let bump = [[0.0, 0.0], [0.7, 0.0], [0.7, -0.1], [0.9, -0.1], [0.9, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]];
    assert_eq!(numbers(&bump.map(|[x, y]| Vector2::new(x, y))), [0, 1, 2, 3, 4, 5, 6, 7]);
    let circle = numbers(&regular(400, 1.0));
    assert!(circle.is_sorted() && (17..=70).contains(&circle[399]), "{circle:?}");
}

/// Segments are numbered ring by ring; a side that a mask makes of steps has the normal of the line from its start to its end.
#[test]
fn segments_have_their_ring_and_normal() {
    let steps = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.01], [2.0, 0.01], [2.0, 1.0], [0.0, 1.0]];
    let hole: Vec<_> = rectangle(0.5, 0.5).into_iter().rev().map(|p| p * 0.5 + Vector2::new(1.0, 0.5)).collect();
    let field = SignedDistanceField::new(&[steps.map(|[x, y]| Vector2::new(x, y)).to_vec(), hole], &[], 100.0);
    assert_eq!(field.rings(), [0..4, 4..8]);
    assert!((field.normal(0) - Vector2::new(-0.005, 1.0).normalize()).norm() < 1e-12);
    assert!((field.normal(1) - Vector2::new(-1.0, 0.0)).norm() < 1e-12);
    assert!((0..8).all(|number| (field.normal(number).norm() - 1.0).abs() < 1e-12));
}

proptest! {
    /// Against the exact inside test and the least distance to all edges.
    #[test]
    fn signs_and_distances_are_exact(seed in 0_u64..1000) {
        let mut random = Random::new(seed);
        let ring = star(&mut random, 40, 1.0);
        let region = PlaneRings::new(vec![ring.clone()]).unwrap();
        let field = SignedDistanceField::new(std::slice::from_ref(&ring), &[], 100.0);
        for _ in 0..40 {
            let point = Vector2::new(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0));
            let least = (0..ring.len()).map(|k| from_segment(&point, &ring[k], &ring[(k + 1) % ring.len()])).fold(f64::INFINITY, f64::min);
            let signed = if region.contains(point) { least } else { -least };
            prop_assert!((field.at(&point).distance - signed).abs() < 1e-12);
        }
    }
}

fn from_segment(point: &Vector2<f64>, a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let share = ((point - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
    (point - a.lerp(b, share)).norm()
}

#[test]
fn at_the_true_pose_every_sample_is_on_its_side() {
    let mut random = Random::new(3);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.1, 1.0)).unwrap();
    let pose = problem.centered(&scene.pose);
    for region in problem.sampled() {
        let right =
            |sample: &ProjectedSample| matches!(sample, ProjectedSample::Visible(margin) if margin.value > -1e-6);
        assert!((0..region.count()).all(|number| right(&region.project(&pose, number, &Budget::unlimited()))));
    }
}

#[test]
fn margins_have_exact_derivatives() {
    let mut random = Random::new(4);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.2, 1.0)).unwrap();
    let pose = problem.centered(&scene.pose).retract(&random.tangent(0.02, 0.05));
    for region in problem.sampled() {
        let numbers: Vec<usize> = (0..region.count()).collect();
        let projected = |at: &Tangent| {
            numbers.iter().map(|&n| region.project(&pose.retract(at), n, &Budget::unlimited())).collect::<Vec<_>>()
        };
        let margins = |at: &Tangent| {
            let margin = |sample: &ProjectedSample| match sample {
                ProjectedSample::Visible(margin) => margin.value,
                ProjectedSample::Behind { .. } => f64::NAN,
            };
            DVector::from_iterator(numbers.len(), projected(at).iter().map(margin))
        };
        let expected = differences(&margins, &Tangent::zeros(), 4.0);
        let found = OMatrix::<f64, Dyn, U6>::from_fn(numbers.len(), |row, column| {
            match region.project(&pose, row, &Budget::unlimited()) {
                ProjectedSample::Visible(margin) => margin.gradient[column],
                ProjectedSample::Behind { .. } => f64::NAN,
            }
        });
        // Where the nearest edge changes within the differences' step they mean nothing.
        let error = |row: usize| (found.row(row) - expected.row(row)).norm() / expected.row(row).norm();
        let exact = numbers.iter().filter(|&&row| error(row) < DIFFERENCES).count();
        assert!(exact as f64 > 0.9 * numbers.len() as f64, "{exact} of {}", numbers.len());
    }
}
