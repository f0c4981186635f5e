//! Corners of outlines, poses from three of them, and regions of which a part is hidden.

use crate::support::random::Random;
use crate::support::scene::{FOCAL, Layout, Ring, Scene, SpaceRing, angle_piece};
use nalgebra::{Rotation2, Rotation3, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::simplified::simplified;
use regionpose::internals::search::corners::{corner_poses, is_plausible, projected_area, triangle_poses};
use regionpose::internals::view::chart::Chart;
use regionpose::{Estimate, ObservedRegion, Pose, Problem};

/// Chart units per pixel of the scenes' cameras.
fn pixel(scene: &Scene) -> f64 {
    scene.observed[0].pixel_area.sqrt().recip()
}

/// A ring with `count` points on each edge, each off it by up to `noise`.
fn sampled(random: &mut Random, ring: &Ring, count: usize, noise: f64) -> Ring {
    let mut off = || Vector2::new(random.uniform(-noise, noise), random.uniform(-noise, noise));
    let edges = (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()]));
    edges.flat_map(|(a, b)| (0..count).map(move |k| a.lerp(&b, k as f64 / count as f64))).map(|p| p + off()).collect()
}

#[test]
fn a_sampled_outline_keeps_its_corners_only() {
    // Every turn, so that the first chord falls along an edge, across one, or from corner to corner.
    let mut random = Random::new(1);
    let ring = angle_piece(1.0);
    for turn in 0..60 {
        let turned: Ring = ring.iter().map(|p| Rotation2::new(turn as f64 * 0.1) * p).collect();
        let corners = simplified(&sampled(&mut random, &turned, 40, 0.004), 0.02, &Budget::unlimited());
        assert_eq!(corners.len(), ring.len(), "turn {turn}");
        for corner in &turned {
            let nearest = corners.iter().map(|p| (p - corner).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.04, "turn {turn}: {nearest}");
        }
    }
}

#[test]
fn a_circle_keeps_corners_as_dense_as_the_tolerance_asks() {
    // A chord over the angle a lies 1 - cos(a / 2) off its arc.
    let circle: Ring = (0..720).map(|k| Rotation2::new(f64::from(k) * 0.5_f64.to_radians()) * Vector2::x()).collect();
    let corners = simplified(&circle, 0.015, &Budget::unlimited());
    let widest = 2.0 * (1.0 - 0.015_f64).acos();
    assert!(corners.len() as f64 >= std::f64::consts::TAU / (widest + 0.02), "{}", corners.len());
    assert!((corners.len() as f64) < 2.5 * std::f64::consts::TAU / widest, "{}", corners.len());
}

fn error(scene: &Scene, pose: &Pose, origin: &Vector3<f64>) -> f64 {
    let (angle, place) = scene.errors(&Pose::new(pose.rotation, pose.translation - pose.rotation * origin));
    angle.max(place)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn exact_corners_give_the_true_pose_from_either_side(seed: u64, front: bool) {
        let mut random = Random::new(seed);
        let shapes = vec![vec![angle_piece(1.0)]];
        let scene = Scene::of_shapes(&mut random, shapes, Layout { front, ..Layout::default() });
        let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
        let origin = random.direction() * 3.0;
        let poses = corner_poses(&chart, &outline, &scene.worlds[0], &origin, pixel(&scene), usize::MAX, &Budget::unlimited());
        let least = poses.iter().map(|pose| error(&scene, pose, &origin)).fold(f64::INFINITY, f64::min);
        prop_assert!(least < 1e-6, "{least:.1e} of {}", poses.len());
    }

    #[test]
    fn every_pose_shows_about_the_observed_area_and_few_are_made_when_few_are_asked_for(seed: u64) {
        let scene = Scene::random(&mut Random::new(seed), Layout::default());
        let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
        let (world, origin) = (&scene.worlds[0], Vector3::zeros());
        let poses = corner_poses(&chart, &outline, world, &origin, pixel(&scene), 10, &Budget::unlimited());
        prop_assert!(poses.len() <= 40);
        for pose in &poses {
            prop_assert!(projected_area(&chart, &world.rings(), pose).is_none_or(|area| area > 0.3 && area < 3.4));
        }
        let area = projected_area(&chart, &world.rings(), &scene.pose).unwrap();
        prop_assert!((area - 1.0).abs() < 1e-9 && is_plausible(area));
    }

    #[test]
    fn a_triangle_is_seen_from_its_pose_for_every_pairing(seed: u64) {
        let mut random = Random::new(seed);
        let ring = vec![Vector2::new(-0.6, -0.4), Vector2::new(0.7, -0.3), Vector2::new(0.1, 0.8)];
        let scene = Scene::of_shapes(&mut random, vec![vec![ring]], Layout::default());
        let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
        let poses = triangle_poses(&chart, &outline, &scene.worlds[0], &Vector3::zeros(), pixel(&scene), &Budget::unlimited());
        let least = poses.iter().map(|pose| error(&scene, pose, &Vector3::zeros())).fold(f64::INFINITY, f64::min);
        prop_assert!(least < 1e-6, "{least:.1e}");
        prop_assert!(poses.len() <= 24);
        for pose in &poses {
            // The projection of each is the observed triangle.
            let area = projected_area(&chart, &scene.worlds[0].rings(), pose).unwrap();
            prop_assert!((area - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn other_shapes_are_no_triangles() {
    let scene = Scene::random(&mut Random::new(4), Layout::default());
    let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
    assert!(
        triangle_poses(&chart, &outline, &scene.worlds[0], &Vector3::zeros(), pixel(&scene), &Budget::unlimited())
            .is_empty()
    );
}

#[test]
fn a_true_pose_is_always_among_those_of_a_triangle() {
    let mut random = Random::new(11);
    for view in 0..100 {
        let corner = |k: f64, random: &mut Random| {
            Rotation2::new(k * 2.1 + random.uniform(-0.5, 0.5)) * Vector2::x() * random.uniform(0.5, 1.0)
        };
        let ring = [0.0, 1.0, 2.0].map(|k| corner(k, &mut random)).to_vec();
        let scene = Scene::of_shapes(&mut random, vec![vec![ring]], Layout::default());
        let estimate = estimated(&scene, &scene.observed);
        let answers = std::iter::once(&estimate.best).chain(&estimate.alternatives);
        let least = answers.map(|answer| scene.errors(&answer.pose).0).fold(f64::INFINITY, f64::min);
        // Two solutions within half a degree are one answer.
        assert!(least < 0.01, "view {view}: {least}");
    }
}

fn estimated(scene: &Scene, observed: &[ObservedRegion]) -> Estimate {
    let problem = Problem::new(observed, &scene.worlds).unwrap();
    problem.estimate().unwrap()
}

/// What is left of a ring of bearings on the near side of a plane through the camera.
fn cut(ring: &SpaceRing, normal: &Vector3<f64>) -> SpaceRing {
    let mut kept = Vec::new();
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let (from, to) = (normal.dot(a), normal.dot(b));
        if from <= 0.0 {
            kept.push(*a);
        }
        if (from <= 0.0) != (to <= 0.0) {
            kept.push((a * to - b * from).normalize() * (to - from).signum());
        }
    }
    kept
}

/// Solid angle of a small ring of bearings.
fn area(ring: &SpaceRing) -> f64 {
    let center = ring.iter().sum::<Vector3<f64>>().normalize();
    ring.iter().zip(ring.iter().cycle().skip(1)).map(|(a, b)| 0.5 * a.cross(b).dot(&center)).sum::<f64>().abs()
}

/// The observed region behind an edge that hides about the share of it.
fn hidden(random: &mut Random, region: &ObservedRegion, share: f64) -> ObservedRegion {
    let ring = &region.rings[0];
    let middle = ring.iter().sum::<Vector3<f64>>().normalize();
    let edge = middle.cross(&random.direction()).normalize();
    let normal = |angle: f64| Rotation3::from_scaled_axis(middle.cross(&edge) * angle) * edge;
    let kept = |angle: f64| cut(ring, &normal(angle));
    let (mut low, mut high) = (-0.6, 0.6);
    let falls = area(&kept(low)) > area(&kept(high));
    for _ in 0..40 {
        let angle = 0.5 * (low + high);
        if (area(&kept(angle)) > (1.0 - share) * area(ring)) == falls { low = angle } else { high = angle }
    }
    let kept = kept(low);
    ObservedRegion::new(vec![kept.clone()], area(&kept) * FOCAL * FOCAL)
}

/// Regions with corners by themselves, of which an occluder's edge hides a part: their moments have no minimum near the pose.
#[test]
fn a_region_alone_is_found_behind_an_edge() {
    for (share, least) in [(0.1, 19), (0.3, 18)] {
        let mut found = 0;
        for seed in 0..20 {
            let mut random = Random::new(seed);
            let layout = Layout { vertices: 9, field: 0.2, axis: Some(Vector3::z()), ..Layout::default() };
            let scene = Scene::random(&mut random, layout);
            let observed = hidden(&mut random, &scene.observed[0], share);
            let estimate = estimated(&scene, &[observed]);
            let error = scene.errors(&estimate.best.pose).0;
            let right = error < 0.02;
            assert!(
                right || !estimate.warnings.is_empty(),
                "{share} hidden, seed {seed}: {error} rad without a warning"
            );
            found += usize::from(right);
        }
        assert!(found >= least, "{share} hidden: {found} of 20");
    }
}
