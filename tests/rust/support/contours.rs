//! What the contours of a problem show at a pose, and outlines with mistakes in them.

use nalgebra::{Rotation3, Unit, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::readings::Reading;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::{ObservedRegion, Pose, Problem};

use super::random::Random;
use super::scene::{FOCAL, Scene, SpaceRing};

/// The reading of every piece of all contours; `None` where a region is out of view.
pub fn readings(problem: &Problem, pose: &Pose) -> Option<Vec<Reading>> {
    let mut readings = Vec::new();
    for contour in problem.contours() {
        contour.read(&problem.centered(pose), 1, &mut readings, &Budget::unlimited())?;
    }
    Some(readings)
}

/// The distances of all pieces, pixels.
pub fn distances(problem: &Problem, pose: &Pose) -> Vec<f64> {
    readings(problem, pose).unwrap().iter().map(|reading| reading.distance).collect()
}

/// The same readings with the derivatives of their distances by a left increment.
pub fn rows(problem: &Problem, pose: &Pose) -> Vec<(Reading, Tangent)> {
    let mut rows = Vec::new();
    for contour in problem.contours() {
        let (pose, mut readings) = (problem.centered(pose), Vec::new());
        contour.read(&pose, 1, &mut readings, &Budget::unlimited()).unwrap();
        let back = contour.axes().inverse();
        let turned = |derivative: Tangent| {
            let [turning, moving] = [0, 3].map(|first| back * derivative.fixed_rows::<3>(first));
            Tangent::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z)
        };
        let push = |reading, derivative, _| rows.push((reading, turned(derivative)));
        contour.for_each_row(&pose, 1, Some(&readings), 0.0, push, &Budget::unlimited()).unwrap();
    }
    rows
}

/// The ring with a part of its longest edge pushed by a tenth of that edge, inwards or outwards, as a segmenter's mistake.
pub fn bitten(ring: &SpaceRing, side: f64) -> SpaceRing {
    let lengths: Vec<f64> = (0..ring.len()).map(|k| (ring[(k + 1) % ring.len()] - ring[k]).norm()).collect();
    let longest = (0..ring.len()).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap();
    let (a, b) = (ring[longest], ring[(longest + 1) % ring.len()]);
    let push = a.cross(&b).normalize() * (0.1 * lengths[longest] * side);
    let along = |share: f64| a.lerp(&b, share);
    let bite = [along(0.4), along(0.4) + push, along(0.6) + push, along(0.6)].map(|p| p.normalize());
    let mut result = ring[..=longest].to_vec();
    result.extend(bite);
    result.extend(&ring[longest + 1..]);
    result
}

/// The observed regions with a bite out of the outline of each.
pub fn all_bitten(scene: &Scene, side: f64) -> Vec<ObservedRegion> {
    let disturb = |region: &ObservedRegion| {
        let mut rings = region.rings.clone();
        rings[0] = bitten(&rings[0], side);
        ObservedRegion::new(rings, region.pixel_area)
    };
    scene.observed.iter().map(disturb).collect()
}

/// The observed regions, one of them turned by a radian about its own line of sight: it belongs to no pose of the others.
pub fn one_turned(scene: &Scene, wrong: usize) -> Vec<ObservedRegion> {
    let mut observed = scene.observed.clone();
    let middle = observed[wrong].rings[0].iter().sum::<Vector3<f64>>().normalize();
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(middle), 1.0);
    let rings = observed[wrong].rings.iter().map(|ring| ring.iter().map(|r| turn * r).collect()).collect();
    observed[wrong] = ObservedRegion::new(rings, observed[wrong].pixel_area);
    observed
}

/// The region whose corners were marked, each off by an error of its own, `sigma` pixels along either axis.
pub fn clicked(region: &ObservedRegion, sigma: f64, random: &mut Random) -> ObservedRegion {
    let off = |r: &Vector3<f64>, random: &mut Random| {
        let error = Vector2::new(random.normal(), random.normal()) * (sigma / FOCAL);
        (r.xy() / r.z + error).push(1.0).normalize()
    };
    let rings = region.rings.iter().map(|ring| ring.iter().map(|r| off(r, random)).collect()).collect();
    ObservedRegion::new(rings, region.pixel_area)
}
