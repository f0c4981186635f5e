//! Poses to start from where a part of a region is hidden: three corners of its outline seen at three of its corners
//! (`docs/math.md`, section 13).

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::geometry::simplified::simplified;
use crate::noise::boundary::DRAWN;
use crate::region::WorldRegion;
use crate::region::derived::CORNER_TOLERANCE;
use crate::search::p3p::three_point_poses;
use crate::view::chart::Chart;

/// Corners between the three of a triple are all passed over alike: none, one or two.
const STRIDES: [usize; 3] = [1, 2, 3];

/// Share of a region that is seen at least: more than half may be hidden.
const LEAST_SHOWN: f64 = 0.4;

/// A corner of a ring: where it is, and whether the ring turns left there.
#[derive(Debug, Clone, Copy)]
struct Corner<T> {
    place: T,
    left: bool,
}

/// The corners of rings given by their images in a plane.
fn turning<T: Copy>(places: Vec<T>, flat: impl Fn(&T) -> Vector2<f64>) -> Vec<Corner<T>> {
    let count = places.len();
    let at = |k: usize| flat(&places[k % count]);
    let left = |k: usize| (at(k) - at(k + count - 1)).perp(&(at(k + 1) - at(k))) > 0.0;
    (0..count).map(|k| Corner { place: places[k], left: left(k) }).collect()
}

/// Three corners of a ring, as many apart.
type Triple<T> = [Corner<T>; 3];

/// The triples of a ring with one stride that do not wrap onto themselves, in the ring's own order or backwards.
fn triples<T: Copy>(corners: &[Corner<T>], stride: usize, backwards: bool) -> Vec<Triple<T>> {
    let count = corners.len();
    if count < 2 * stride + 1 {
        return Vec::new();
    }
    let at = |k: usize| if backwards { corners[(2 * count - k - 1) % count] } else { corners[k % count] };
    (0..count).map(|k| [0, 1, 2].map(|m| at((k + m * stride) % count))).collect()
}

/// Poses at which three corners of a world region are seen at three of its observed outline, in the same order along a ring
/// or, of a region seen from behind, in the opposite one, and turning alike; about `origin`.
///
/// `pixel`: chart units per pixel. More pairs of triples than `most` are subsampled evenly. The rest of the outline, which may be
/// hidden, is not compared: most of these poses are wrong.
pub fn corner_poses(
    chart: &Chart,
    outline: &PlaneRings,
    world: &WorldRegion,
    origin: &Vector3<f64>,
    pixel: f64,
    most: usize,
    budget: &Budget,
) -> Vec<Pose> {
    let (image_corners, corners) = (observed_corners(outline, pixel, budget), world_corners(world, budget));
    let groups: Vec<_> = STRIDES.into_iter().flat_map(|stride| [(stride, false), (stride, true)]).collect();
    let triples_of = |&(stride, backwards): &(usize, bool)| {
        let observed: Vec<_> = image_corners.iter().flat_map(|ring| triples(ring, stride, false)).collect();
        let models: Vec<_> = corners.iter().flat_map(|ring| triples(ring, stride, backwards)).collect();
        (observed, models)
    };
    let groups: Vec<_> = groups.iter().map(triples_of).collect();
    let compared: usize = groups.iter().map(|(observed, models)| observed.len() * models.len()).sum();
    let every = compared.div_ceil(most.max(1)).max(1);
    let alike = |one: &Triple<Vector2<f64>>, other: &Triple<Vector3<f64>>| (0..3).all(|k| one[k].left == other[k].left);
    let of_group = |(observed, models): &(Vec<_>, Vec<_>)| {
        let pair = |k: usize| (observed[k / models.len()], models[k % models.len()]);
        (0..observed.len() * models.len()).step_by(every).map(pair).filter(|(a, b)| alike(a, b)).collect::<Vec<_>>()
    };
    let poses = groups.iter().flat_map(of_group).flat_map(|(image, world)| posed(chart, origin, &image, &world));
    let shape: Vec<Vec<_>> =
        corners.iter().map(|ring| ring.iter().map(|corner| corner.place - origin).collect()).collect();
    poses.filter(|pose| projected_area(chart, &shape, pose).is_some_and(is_plausible)).collect()
}

/// Whether a region whose projection has this area, in observed ones, may be the observed one with a part of either hidden.
pub fn is_plausible(area: f64) -> bool {
    area > LEAST_SHOWN && area * LEAST_SHOWN < 1.0
}

/// Area of projected rings in a chart; `None` where they are out of view.
pub fn projected_area(chart: &Chart, rings: &[Vec<Vector3<f64>>], pose: &Pose) -> Option<f64> {
    let mut area = 0.0;
    for ring in rings {
        let projected: Vec<_> = ring.iter().map(|x| chart.project(&pose.transform(x))).collect::<Option<_>>()?;
        let next = projected.iter().cycle().skip(1);
        area += projected.iter().zip(next).map(|(a, b)| a.perp(b)).sum::<f64>() / 2.0;
    }
    Some(area.abs())
}

/// All poses at which a triangle's projection is its observed outline, up to four for each of the six ways to pair the corners;
/// none for other regions.
pub fn triangle_poses(
    chart: &Chart,
    outline: &PlaneRings,
    world: &WorldRegion,
    origin: &Vector3<f64>,
    pixel: f64,
    budget: &Budget,
) -> Vec<Pose> {
    let rings = world_corners(world, budget);
    let [corners] = rings.as_slice() else { return Vec::new() };
    if corners.len() != 3 {
        return Vec::new();
    }
    let image_corners = observed_corners(outline, pixel, budget);
    let [image_corners] = image_corners.as_slice() else { return Vec::new() };
    let [a, b, c] = image_corners.as_slice() else { return Vec::new() };
    let pairings = [false, true].into_iter().flat_map(|backwards| triples(corners, 1, backwards));
    pairings.flat_map(|triple| posed(chart, origin, &[*a, *b, *c], &triple)).collect()
}

/// The poses of one pair of triples.
fn posed(
    chart: &Chart,
    origin: &Vector3<f64>,
    image: &Triple<Vector2<f64>>,
    world: &Triple<Vector3<f64>>,
) -> Vec<Pose> {
    let bearings = image.map(|corner| Vector3::new(corner.place.x, corner.place.y, chart.scale).normalize());
    let poses = three_point_poses(&world.map(|corner| corner.place - origin), &bearings);
    let back = chart.rotation.inverse();
    poses.into_iter().map(|pose| Pose::new(back * pose.rotation, back * pose.translation)).collect()
}

fn observed_corners(outline: &PlaneRings, pixel: f64, budget: &Budget) -> Vec<Vec<Corner<Vector2<f64>>>> {
    let tolerance = (CORNER_TOLERANCE * outline.area().sqrt()).max(DRAWN * pixel);
    outline.rings().iter().map(|ring| turning(simplified(ring, tolerance, budget), |p| *p)).collect()
}

fn world_corners(world: &WorldRegion, budget: &Budget) -> Vec<Vec<Corner<Vector3<f64>>>> {
    let corners = |ring: &Vec<Vector3<f64>>| turning(ring.clone(), |x| world.frame().to_plane(x));
    world.corners(budget).iter().map(corners).collect()
}
