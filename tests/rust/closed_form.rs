//! Starts without iteration: the closed form on views that are affine exactly, and the paper's start.

use crate::support::random::Random;
use crate::support::scene::{
    Layout, Ring, Scene, SpaceRing, angle_piece, errors, placed, rectangle, regular, seen_plane, star,
};
use nalgebra::{Rotation3, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::least_squares::{TerminationCriteria, minimize};
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::search::closed_form::{closed_form, conjugate, facing};
use regionpose::internals::view::chart::Chart;
use regionpose::{Integration, Options, Pose, Prior, Start, System, WorldRegion};

/// Error of the closed form on an affine view, rad and share of the distance: the turn comes from a parabola through
/// samples 5 degrees apart (measured: median 3e-4, worst 8e-4).
const AFFINE_ERROR: f64 = 0.004;

/// Views at each angle of the paper's start.
const VIEWS: u64 = 40;

/// Rotation error below which exact data count as solved, rad.
const SOLVED: f64 = 1e-6;

/// Iterations to the end, also from far away.
const PATIENT: TerminationCriteria = TerminationCriteria { tolerance: 1e-12, evaluations: 1400 };

/// A region under weak perspective: its centroid is the center of the projection.
struct AffineView {
    chart: Chart,
    outline: PlaneRings,
    world: WorldRegion,
    /// `camera_from_world`.
    truth: Pose,
    /// The symmetric shape's plane in the world, its centroid at the origin.
    world_from_plane: Pose,
}

fn centroid(ring: &Ring) -> Vector2<f64> {
    let (mut sum, mut area) = (Vector2::zeros(), 0.0);
    for (k, a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % ring.len()];
        sum += (a + b) * a.perp(&b);
        area += 3.0 * a.perp(&b);
    }
    sum / area
}

impl AffineView {
    fn new(random: &mut Random, ring: &Ring, front: bool) -> Self {
        let mean = centroid(ring);
        let centered: Ring = ring.iter().map(|p| p - mean).collect();
        let (depth, tilt, turn) = (random.uniform(3.0, 5.0), random.uniform(0.35, 1.1), random.rotation());
        let axis_from_plane = seen_plane(random, &Vector3::z(), depth, tilt, front);
        let project = |p: &Vector2<f64>| {
            let x = axis_from_plane.rotation * Vector3::new(p.x, p.y, 0.0) / depth;
            turn * Vector3::new(x.x, x.y, 1.0)
        };
        let bearings: SpaceRing = centered.iter().map(project).collect();
        let world_from_plane = random.pose(5.0);
        let (chart, outline) = Chart::of(&[bearings]).unwrap();
        let world = WorldRegion::from_rings(&placed(&[centered], &world_from_plane)).unwrap();
        let camera_from_plane = Pose::new(turn, Vector3::zeros()).after(&axis_from_plane);
        Self { chart, outline, world, truth: camera_from_plane.after(&world_from_plane.inverse()), world_from_plane }
    }

    /// The candidates, as `camera_from_world`, found relative to some other origin.
    fn candidates(&self) -> Vec<Pose> {
        let origin = Vector3::new(1.0, -2.0, 3.0);
        let shift = Pose::new(Rotation3::identity(), -origin);
        closed_form(&self.chart, &self.outline, &self.world, &origin).iter().map(|pose| pose.after(&shift)).collect()
    }

    /// Least error among the candidates of a pose after a motion of the plane onto itself.
    fn error(&self, candidates: &[Pose], symmetry: &Rotation3<f64>) -> f64 {
        let symmetry = Pose::new(*symmetry, Vector3::zeros());
        let expected =
            self.truth.after(&self.world_from_plane).after(&symmetry).after(&self.world_from_plane.inverse());
        let middle = self.world_from_plane.translation;
        let error = |pose: &Pose| {
            let (angle, place) = errors(pose, &expected, &middle);
            angle.max(place)
        };
        candidates.iter().map(error).fold(f64::INFINITY, f64::min)
    }
}

#[test]
fn exact_affine_views_give_the_truth_among_the_candidates() {
    let mut random = Random::new(21);
    let mut found = Vec::new();
    for trial in 0..200 {
        let ring = star(&mut random, 5 + trial % 8, 1.0);
        let view = AffineView::new(&mut random, &ring, trial % 2 == 0);
        let candidates = view.candidates();
        assert!(candidates.len() >= 2, "both poses of a turn");
        found.push(view.error(&candidates, &Rotation3::identity()));
    }
    found.sort_by(f64::total_cmp);
    assert!(found[199] < AFFINE_ERROR, "worst {:.1e}", found[199]);
    assert!(found[100] < 0.1 * AFFINE_ERROR, "median {:.1e}", found[100]);
}

/// Rotations of space that bring a shape of this symmetry onto itself: `turns` about z, each with a flip about an axis of it.
fn symmetries(turns: usize) -> Vec<Rotation3<f64>> {
    let turn =
        |k: usize| Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::TAU * k as f64 / turns as f64);
    let flip = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    (0..turns).flat_map(|k| [turn(k), turn(k) * flip]).collect()
}

#[test]
fn symmetric_shapes_give_two_candidates_for_each_symmetry_of_their_affine_class() {
    let mut random = Random::new(22);
    // An affine view does not distinguish a rectangle from a square: eight symmetries, four of them the rectangle's own.
    for (ring, own, affine) in [(rectangle(1.6, 1.0), 2, 8), (regular(6, 0.8), 6, 12), (regular(4, 0.8), 4, 8)] {
        for front in [true, false] {
            let view = AffineView::new(&mut random, &ring, front);
            let candidates = view.candidates();
            assert_eq!(candidates.len(), 2 * affine, "{} corners", ring.len());
            for symmetry in symmetries(own) {
                let error = view.error(&candidates, &symmetry);
                assert!(error < AFFINE_ERROR, "{} corners: {error:.1e}", ring.len());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_facing_start_faces_the_camera_with_the_observed_area(seed: u64) {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, Layout::default());
        let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
        let world = &scene.worlds[0];
        let up = random.direction();
        let poses = facing(&chart, &outline, world, &Vector3::zeros(), Some(&up));
        prop_assert_eq!(poses.len(), 2);
        let ray = chart.rotation.inverse() * Vector3::z();
        for (pose, side) in poses.iter().zip([-1.0, 1.0]) {
            let normal = pose.rotation * world.frame().axes()[2];
            prop_assert!((normal - ray * side).norm() < 1e-12);
            let center = world.frame().to_world(&centroid(&world.outline().rings()[0]));
            let place = pose.transform(&center);
            prop_assert!((place.normalize() - ray).norm() < 1e-12);
            let area = world.outline().area() / place.norm_squared() * chart.scale * chart.scale;
            prop_assert!((area - 1.0).abs() < 1e-12);
            // The directions across the ray agree: those of the world's up and of the image's.
            let across = |v: Vector3<f64>| (v - ray * ray.dot(&v)).normalize();
            prop_assert!((across(pose.rotation * up) - across(-Vector3::y())).norm() < 1e-9);
        }
    }

    #[test]
    fn conjugate_poses_share_their_first_order_view(seed: u64) {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, Layout::default());
        let (world, origin) = (&scene.worlds[0], random.direction());
        let pose = Pose::new(scene.pose.rotation, scene.pose.transform(&origin));
        let other = conjugate(&pose, world, &origin);
        let center = world.frame().to_world(&centroid(&world.outline().rings()[0])) - origin;
        let ray = pose.transform(&center).normalize();
        prop_assert!((other.transform(&center) - pose.transform(&center)).norm() < 1e-12);
        // Across the ray both show the plane's axes alike; along it one recedes where the other approaches.
        for axis in &world.frame().axes()[..2] {
            let (one, two) = (pose.rotation * axis, other.rotation * axis);
            prop_assert!((one + two - (one - ray * ray.dot(&one)) * 2.0).norm() < 1e-12);
        }
        let back = conjugate(&other, world, &origin);
        prop_assert!(back.angle_to(&pose) < 1e-7 && (back.translation - pose.translation).norm() < 1e-12);
    }

    #[test]
    fn without_up_the_facing_start_takes_the_planes_axes(seed: u64) {
        let scene = Scene::random(&mut Random::new(seed), Layout::default());
        let (chart, outline) = Chart::of(&scene.observed[0].rings).unwrap();
        for pose in facing(&chart, &outline, &scene.worlds[0], &Vector3::zeros(), None) {
            let axes = scene.worlds[0].frame().axes().map(|axis| chart.rotation * pose.rotation * axis);
            prop_assert!((axes[1] + Vector3::y()).norm() < 1e-12);
            prop_assert!((axes[2].z.abs() - 1.0).abs() < 1e-12);
        }
    }
}

/// Views of an L tilted by up to 30 degrees, and the world's up turned by `angle` in the region's plane, either way.
fn turned_views(angle: f64) -> impl Iterator<Item = (Scene, Vector3<f64>)> {
    (0..VIEWS).map(move |view| {
        let mut random = Random::new(view);
        let layout = Layout { axis: Some(Vector3::z()), field: 0.3, tilt: [0.1, 0.52], ..Layout::default() };
        let scene = Scene::of_shapes(&mut random, vec![vec![angle_piece(1.0)]], layout);
        let ray = scene.pose.transform(&scene.middle()).normalize();
        let off = Rotation3::from_scaled_axis(ray * if view % 2 == 0 { angle } else { -angle });
        let up = scene.pose.rotation.inverse() * (off * -Vector3::y());
        (scene, up)
    })
}

/// Whether the least squares from one of the facing poses end at the truth.
fn facing_solves(scene: &Scene, up: &Vector3<f64>, system: System) -> bool {
    let problem = scene.problem(system, Integration::Boundary);
    let (region, world) = (&problem.regions()[0], &scene.worlds[0]);
    let starts = facing(region.chart(), region.outline(), world, world.frame().origin(), Some(up));
    let mut ends = starts
        .iter()
        .map(|start| minimize(problem.regions(), start, Weighting::Uniform, PATIENT, &Budget::unlimited()).pose);
    ends.any(|pose| pose.angle_to(&scene.pose) < SOLVED)
}

/// Whether the native solver finds the truth from the paper's start.
fn paper_solves(scene: &Scene, up: &Vector3<f64>, system: System) -> bool {
    let prior = Prior::default().with_up(*up, None).unwrap();
    let estimate = scene
        .problem(system, Integration::Boundary)
        .estimate_with(&Options::default().with_start(Start::Paper).with_prior(prior));
    estimate.is_ok_and(|estimate| scene.errors(&estimate.best.pose).0 < SOLVED)
}

/// Facing lies midway between two poses with like views, so that least squares from there may end at the wrong one.
#[test]
fn the_papers_start_is_solved_from_both_sides_of_facing() {
    for system in [System::Plane, System::Sphere] {
        for degrees in [0.0_f64, 20.0] {
            let views: Vec<_> = turned_views(degrees.to_radians()).collect();
            let solved = views.iter().filter(|(scene, up)| paper_solves(scene, up, system)).count();
            assert!(solved as u64 >= VIEWS - 1, "{system:?} at {degrees} deg: {solved} of {VIEWS}");
        }
    }
}

#[test]
fn the_papers_start_is_solved_within_60_degrees() {
    for system in [System::Plane, System::Sphere] {
        for degrees in [0.0_f64, 20.0, 40.0, 60.0] {
            let views: Vec<_> = turned_views(degrees.to_radians()).collect();
            for solves in [facing_solves, paper_solves] {
                let solved = views.iter().filter(|(scene, up)| solves(scene, up, system)).count();
                assert!(solved as u64 * 5 >= VIEWS * 4, "{system:?} at {degrees} deg: {solved} of {VIEWS}");
            }
        }
    }
}
