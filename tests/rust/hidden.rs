//! Regions of which something hides a part: its edges are no evidence, and the rest gives the pose.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::support::random::Random;
use crate::support::scene::{FOCAL, Layout, Ring, Scene, angle_piece, placed, rectangle, seen_plane};
use nalgebra::{Rotation2, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::clipping::intersection;
use regionpose::{Error, Estimate, Integration, ObservedRegion, Pose, Problem, System, Warning, WorldRegion};

/// Rotation error (rad) of a pose from exact contours, whose pieces round the corners.
const ROUNDED: f64 = 1e-3;

/// What is left of a ring on the plane z = 1 before a straight occluder that covers the share `depth` of its extent on
/// one side.
fn cut(ring: &Ring, side: f64, depth: f64) -> (Ring, Vec<bool>) {
    let normal = Rotation2::new(side) * Vector2::x();
    let along = Rotation2::new(side) * Vector2::y();
    let reach = |p: &Vector2<f64>| normal.dot(p);
    let (low, high) = (ring.iter().map(reach).fold(9.0, f64::min), ring.iter().map(reach).fold(-9.0, f64::max));
    let edge = high - depth * (high - low);
    let corner = |x: f64, y: f64| normal * x + along * y;
    let seen = vec![vec![corner(edge - 9.0, -9.0), corner(edge, -9.0), corner(edge, 9.0), corner(edge - 9.0, 9.0)]];
    let left = intersection(std::slice::from_ref(ring), &seen, &Budget::unlimited()).rings;
    let left = left.into_iter().max_by(|a, b| area(a).total_cmp(&area(b))).unwrap();
    let on_edge = |p: &Vector2<f64>| (reach(p) - edge).abs() < 1e-9;
    let marks = (0..left.len()).map(|k| on_edge(&left[k]) && on_edge(&left[(k + 1) % left.len()])).collect();
    (left, marks)
}

fn area(ring: &Ring) -> f64 {
    (0..ring.len()).map(|k| ring[k].perp(&ring[(k + 1) % ring.len()])).sum::<f64>().abs() / 2.0
}

fn lifted(ring: &[Vector2<f64>]) -> Vec<Vector3<f64>> {
    ring.iter().map(|p| p.push(1.0).normalize()).collect()
}

/// What a camera sees of a world region behind an occluder; the occluder's edges are marked as hidden or not.
fn behind(world: &WorldRegion, pose: &Pose, side: f64, depth: f64, marked: bool) -> ObservedRegion {
    let project = |x: &Vector3<f64>| pose.transform(x).xy() / pose.transform(x).z;
    let mut ring: Ring = world.rings()[0].iter().map(project).collect();
    if (0..ring.len()).map(|k| ring[k].perp(&ring[(k + 1) % ring.len()])).sum::<f64>() < 0.0 {
        ring.reverse();
    }
    let (left, marks) = cut(&ring, side, depth);
    assert!(area(&left) < 0.99 * area(&ring) && marks.iter().any(|&mark| mark));
    let mut observed = ObservedRegion::new(vec![lifted(&left)], area(&left) * FOCAL * FOCAL);
    let edges = (0..left.len()).filter(|&k| marked && marks[k]);
    observed.hidden = edges.map(|k| lifted(&[left[k], left[(k + 1) % left.len()]])).collect();
    observed
}

fn estimate(observed: &[ObservedRegion], scene: &Scene) -> Estimate {
    Problem::with(observed, &scene.worlds, System::Plane, Integration::Boundary).unwrap().estimate().unwrap()
}

fn looking_at(random: &mut Random, shapes: Vec<Vec<Ring>>) -> Scene {
    Scene::of_shapes(random, shapes, Layout { axis: Some(Vector3::z()), ..Layout::default() })
}

/// An L of which an occluder leaves six or more sides in part: alone it gives the pose, without a warning.
#[test]
fn a_region_with_a_hidden_edge_gives_the_pose_by_the_others() {
    let mut random = Random::new(91);
    for case in 0..16 {
        let scene = looking_at(&mut random, vec![vec![angle_piece(1.0)]]);
        let (side, depth) = (random.uniform(0.0, TAU), random.uniform(0.15, 0.3));
        let found = estimate(&[behind(&scene.worlds[0], &scene.pose, side, depth, true)], &scene);
        let answers = std::iter::once(&found.best).chain(&found.alternatives);
        let angle = answers.map(|answer| scene.errors(&answer.pose).0).fold(9.0, f64::min);
        let codes: Vec<_> = found.warnings.iter().map(Warning::code).collect();
        assert!(angle < ROUNDED, "case {case}: {angle:.1e} rad {codes:?}");
        assert!(!codes.contains(&"poor-overlap") && !codes.contains(&"outlier-region"), "case {case}: {codes:?}");
    }
}

/// Three walls, each with its foot behind something: no outline is whole, no corner at the foot is true.
#[test]
fn three_walls_with_hidden_feet_give_the_pose() {
    let mut random = Random::new(92);
    for case in 0..10 {
        let pose = random.pose(5.0);
        let mut scene = Scene { pose, observed: Vec::new(), worlds: Vec::new() };
        for x in [-0.6, 0.0, 0.6] {
            let direction = Vector3::new(x, random.uniform(-0.1, 0.1), 1.0).normalize();
            let tilt = random.uniform(0.3, 0.9);
            let plane = pose.inverse().after(&seen_plane(&mut random, &direction, 5.0, tilt, true));
            let wall = rectangle(random.uniform(1.4, 2.0), random.uniform(1.0, 1.3));
            scene.worlds.push(WorldRegion::from_rings(&placed(&[wall], &plane)).unwrap());
        }
        let depth = random.uniform(0.2, 0.5);
        let seen = |marked: bool| -> Vec<_> {
            scene.worlds.iter().map(|world| behind(world, &pose, FRAC_PI_2, depth, marked)).collect()
        };
        let found = estimate(&seen(true), &scene);
        let (angle, place) = scene.errors(&found.best.pose);
        let codes: Vec<_> = found.warnings.iter().map(Warning::code).collect();
        assert!(angle.max(place) < ROUNDED, "case {case}: {angle:.1e} rad, {place:.1e} {codes:?}");
        assert!(codes.is_empty(), "case {case}: {codes:?}");
        // What is projected beyond a hidden edge may be there.
        assert!(found.best.overlap_error < ROUNDED && estimate(&seen(false), &scene).best.overlap_error > 0.1);
    }
}

/// One small bite off one of three regions: the moments fit almost, and would be off by what is hidden.
#[test]
fn a_small_hidden_part_does_not_pull_the_pose() {
    let mut random = Random::new(93);
    for case in 0..10 {
        let scene = looking_at(&mut random, vec![vec![angle_piece(1.0)]; 3]);
        let mut seen = scene.observed.clone();
        seen[0] = behind(&scene.worlds[0], &scene.pose, random.uniform(0.0, TAU), 0.13, true);
        let (angle, place) = scene.errors(&estimate(&seen, &scene).best.pose);
        assert!(angle.max(place) < ROUNDED, "case {case}: {angle:.1e} rad, {place:.1e}");
    }
}

#[test]
fn an_outline_of_which_hardly_anything_is_its_own_is_refused() {
    let scene = looking_at(&mut Random::new(94), vec![vec![angle_piece(1.0)]]);
    let mut observed = scene.observed[0].clone();
    let ring = observed.rings[0].clone();
    observed.hidden = vec![[ring.clone(), vec![ring[0]]].concat()];
    let refused = |observed: &ObservedRegion| {
        Problem::new(std::slice::from_ref(observed), &scene.worlds).unwrap_err().to_string()
    };
    let message = refused(&observed);
    assert!(message.contains("share of the observed outline that is the region's own is 0.0 %"), "{message}");
    observed.hidden = vec![vec![ring[0]]];
    assert_eq!(refused(&observed), "region 0: hidden line 0 has 1 bearings; a line needs at least 2");
    let far = Error::ShortLine { item: "hidden", line: 0, found: 0 };
    assert!(far.to_string().starts_with("hidden line 0 has 0"));
}
