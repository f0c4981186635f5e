//! Masks whose whole boundary is disturbed: squares painted in and out of them, one over another, until hardly a piece of it is left.

use crate::support::random::Random;
use crate::support::scene::{FOCAL, Layout, Scene};
use nalgebra::{Vector2, Vector3};
use regionpose::internals::view::mask::{Mask, MaskContours};
use regionpose::{ObservedRegion, Options, Problem, Refinement};

/// Scenes, and how much worse than the moments' a pose may be: what is left of its last iterations.
const SCENES: usize = 12;
const WORSE: f64 = 1.05;

/// How often each part of the boundary is painted over.
const COATS: f64 = 6.0;

/// The image of a region on the camera's plane, painted over by squares of a share of its size, as its mask's contour.
fn painted(region: &ObservedRegion, side: f64, random: &mut Random) -> ObservedRegion {
    let pixel = |bearing: &Vector3<f64>| Vector2::new(bearing.x, bearing.y) * (FOCAL / bearing.z);
    let ring: Vec<Vector2<f64>> = region.rings[0].iter().map(pixel).collect();
    let size = side * region.pixel_area.sqrt();
    let low = ring.iter().fold(ring[0], |low, p| low.inf(p)).map(|v| (v - size).floor() - 2.0);
    let high = ring.iter().fold(ring[0], |high, p| high.sup(p)).map(|v| (v + size).ceil() + 2.0);
    let [columns, rows] = [high.x - low.x, high.y - low.y].map(|length| length as usize);
    let edges = || (0..ring.len()).map(|k| (ring[k] - low, ring[(k + 1) % ring.len()] - low));
    let is_inside = |x: f64, y: f64| {
        let crosses = |(a, b): (Vector2<f64>, Vector2<f64>)| {
            (a.y > y) != (b.y > y) && x < a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y)
        };
        edges().filter(|&edge| crosses(edge)).count() % 2 == 1
    };
    let mut mask: Vec<u8> =
        (0..rows * columns).map(|k| u8::from(is_inside((k % columns) as f64, (k / columns) as f64))).collect();
    let perimeter: f64 = edges().map(|(a, b)| (b - a).norm()).sum();
    for _ in 0..(COATS * perimeter / size).ceil() as usize {
        let mut along = random.uniform(0.0, perimeter);
        let mut center = ring[0] - low;
        for (a, b) in edges() {
            let length = (b - a).norm();
            if along < length {
                center = a + (b - a) * (along / length);
                break;
            }
            along -= length;
        }
        let fill = random.uniform(0.0, 1.0) < 0.5;
        let span = |middle: f64| (middle - 0.5 * size).ceil() as usize..(middle + 0.5 * size).ceil() as usize;
        for row in span(center.y) {
            span(center.x).for_each(|column| mask[row * columns + column] = u8::from(fill));
        }
    }
    let contours = MaskContours::of(Mask::new(&mask, columns).unwrap()).unwrap();
    let bearing = |p: &Vector2<f64>| Vector3::new(p.x + low.x, p.y + low.y, FOCAL).normalize();
    let rings = contours.rings.rings().iter().map(|ring| ring.iter().map(bearing).collect()).collect();
    ObservedRegion::new(rings, contours.rings.area())
}

/// Rotation errors, rad, of poses by default and by the moments alone, sorted by scene.
fn errors(side: f64) -> Vec<[f64; 2]> {
    let mut random = Random::new(17);
    let layout = Layout { regions: 3, axis: Some(Vector3::z()), field: 0.3, ..Layout::default() };
    let scene_errors = |_| {
        let scene = Scene::random(&mut random, layout);
        let observed: Vec<_> = scene.observed.iter().map(|region| painted(region, side, &mut random)).collect();
        let problem = Problem::new(&observed, &scene.worlds).unwrap();
        [Refinement::Contour, Refinement::Off].map(|refinement| {
            let estimate = problem.estimate_with(&Options::default().with_refinement(refinement)).unwrap();
            scene.errors(&estimate.best.pose).0
        })
    };
    (0..SCENES).map(scene_errors).collect()
}

#[test]
fn where_all_of_a_contour_is_disturbed_no_pose_is_worse_than_the_moments() {
    for side in [1.0 / 30.0, 1.0 / 16.0] {
        let errors = errors(side);
        assert!(errors.iter().all(|[own, moments]| *own < WORSE * moments), "{side}: {errors:.4?}");
    }
}
