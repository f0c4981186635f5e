//! Poses from three points: random views, the four solutions of a symmetric one, and what never depends on the frames.

use crate::support::random::Random;
use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;
use regionpose::Pose;
use regionpose::internals::search::p3p::three_point_poses;

/// Error of the true pose among the solutions, rad and share of the distance.
const EXACT: f64 = 1e-9;

/// Smallest sine between two sides of a triangle that is not degenerate, and between its plane and a ray.
const FLAT: f64 = 0.05;

/// Three points about the origin, seen from 1 to 5 units away.
struct View {
    points: [Vector3<f64>; 3],
    bearings: [Vector3<f64>; 3],
    pose: Pose,
}

impl View {
    fn random(random: &mut Random) -> Self {
        loop {
            let pose = Pose::new(random.rotation(), random.direction() * random.uniform(1.0, 5.0));
            let points = [(); 3].map(|()| random.direction() * random.uniform(0.2, 1.0));
            let view = Self { points, bearings: points.map(|x| pose.transform(&x).normalize()), pose };
            if view.conditioning() > FLAT {
                return view;
            }
        }
    }

    /// How far the view is from one whose depths are a double root: the determinant of the sides' slopes by the depths.
    fn conditioning(&self) -> f64 {
        let seen = self.points.map(|x| self.pose.transform(&x));
        let [a, b, c] = &seen;
        let cosine = |x: &Vector3<f64>, y: &Vector3<f64>| (x - y).normalize().dot(&x.normalize());
        // Each side turns its slope to its two ends' rays; both ways round the triangle.
        (cosine(a, b) * cosine(b, c) * cosine(c, a) + cosine(b, a) * cosine(c, b) * cosine(a, c)).abs()
    }

    fn error(&self, pose: &Pose) -> f64 {
        pose.angle_to(&self.pose).max((pose.translation - self.pose.translation).norm() / self.pose.translation.norm())
    }
}

#[test]
fn the_true_pose_is_among_the_solutions() {
    let mut random = Random::new(1);
    for trial in 0..20_000 {
        let view = View::random(&mut random);
        let poses = three_point_poses(&view.points, &view.bearings);
        assert!((1..=4).contains(&poses.len()), "trial {trial}: {} poses", poses.len());
        let error = poses.iter().map(|pose| view.error(pose)).fold(f64::INFINITY, f64::min);
        assert!(error < EXACT, "trial {trial}: {error:.1e} at conditioning {:.1e}", view.conditioning());
    }
}

#[test]
fn an_equilateral_triangle_seen_along_its_axis_has_four_poses() {
    // One faces the camera; of each other one corner is nearer or farther than the two others.
    let corner =
        |k: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), k * std::f64::consts::TAU / 3.0) * Vector3::x();
    let points = [corner(0.0), corner(1.0), corner(2.0)];
    let bearings = points.map(|x| (x + Vector3::z() * 2.0).normalize());
    let poses = three_point_poses(&points, &bearings);
    assert_eq!(poses.len(), 4);
    assert!(poses.iter().any(|pose| (pose.translation - Vector3::z() * 2.0).norm() < EXACT));
    for pose in &poses {
        for (x, bearing) in points.iter().zip(&bearings) {
            assert!((pose.transform(x).normalize() - bearing).norm() < EXACT);
        }
    }
}

#[test]
fn corners_of_a_hexagon_are_solved_from_all_around() {
    // Isosceles triangles make the conics alike in two of the depths.
    let mut random = Random::new(3);
    let corner =
        |k: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), k * std::f64::consts::TAU / 6.0) * Vector3::x();
    for trial in 0..2000 {
        let points = [[0.0, 1.0, 2.0], [0.0, 2.0, 4.0], [1.0, 2.0, 4.0]][trial % 3].map(corner);
        let tilt = Rotation3::from_axis_angle(&Vector3::y_axis(), random.uniform(0.2, 1.2));
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), random.uniform(0.0, 6.3));
        let aside = random.direction() * 0.5;
        let truth = Pose::new(turn * tilt, Vector3::z() * 5.0 + aside);
        let poses = three_point_poses(&points, &points.map(|x| truth.transform(&x).normalize()));
        let error = poses.iter().map(|pose| pose.angle_to(&truth)).fold(f64::INFINITY, f64::min);
        assert!(error < 1e-6, "trial {trial}: {error:.1e} of {}", poses.len());
    }
}

#[test]
fn points_on_a_line_have_no_pose() {
    let points = [0.0, 1.0, 3.0].map(|x| Vector3::new(x, 2.0 * x, 5.0 - x));
    let bearings = points.map(|x| x.normalize());
    assert!(three_point_poses(&points, &bearings).is_empty());
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_solution_sees_the_points_along_their_bearings(seed: u64) {
        let mut random = Random::new(seed);
        // Any bearings, whether a true pose lies behind them or none.
        let points = [(); 3].map(|()| random.direction() * random.uniform(0.2, 1.0));
        let bearings = [(); 3].map(|()| (random.direction() + Vector3::z() * 2.0).normalize());
        for pose in three_point_poses(&points, &bearings) {
            for (x, bearing) in points.iter().zip(&bearings) {
                prop_assert!((pose.transform(x).normalize() - bearing).norm() < 1e-7);
            }
        }
    }

    #[test]
    fn the_order_of_the_points_does_not_matter(seed: u64) {
        let view = View::random(&mut Random::new(seed));
        let [a, b, c] = view.points;
        let [p, q, r] = view.bearings;
        let turned = three_point_poses(&[c, a, b], &[r, p, q]);
        let swapped = three_point_poses(&[b, a, c], &[q, p, r]);
        for others in [turned, swapped] {
            let error = others.iter().map(|pose| view.error(pose)).fold(f64::INFINITY, f64::min);
            prop_assert!(error < EXACT, "{error:.1e}");
        }
    }

    #[test]
    fn the_unit_and_the_frames_do_not_matter(seed: u64) {
        let mut random = Random::new(seed);
        let view = View::random(&mut random);
        let (scale, move_world, turn) = (10.0_f64.powf(random.uniform(-3.0, 3.0)), random.pose(2.0), random.rotation());
        let points = view.points.map(|x| move_world.transform(&x) * scale);
        let bearings = view.bearings.map(|bearing| turn * bearing);
        let truth = Pose::new(turn, Vector3::zeros()).after(&view.pose).after(&move_world.inverse());
        let found = three_point_poses(&points, &bearings);
        let error = |pose: &Pose| {
            let apart = (pose.translation / scale - truth.translation).norm();
            pose.angle_to(&truth).max(apart / view.pose.translation.norm())
        };
        prop_assert!(found.iter().map(error).fold(f64::INFINITY, f64::min) < EXACT);
    }
}
