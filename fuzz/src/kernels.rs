//! The kernels of the plane and the sphere, each against its laws.

use nalgebra::{Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::clipping::intersection;
use regionpose::internals::geometry::overlap::overlap_areas;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::view::chart::Chart;
use regionpose::mesh::alpha_shape::alpha_shape_within;
use regionpose::mesh::even_mesh::even_mesh_within;
use regionpose::mesh::triangulation::{MeshOptions, triangulate_within};
use regionpose::moments::plane::planar_moments;
use regionpose::moments::sphere::spherical_moments;

use crate::Outcome;
use crate::random::Random;
use crate::shapes::{Ring, magnitude, once_in, placed, ring, rings};

/// Share of an area by which two sums over the same region may differ where rings are far from the origin, times the squared
/// distance over the area.
const ROUNDING: f64 = 1e-12;

/// `Err` with a sentence unless it holds.
pub fn needed(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}

fn all_finite(item: &str, values: &[f64]) -> Result<(), String> {
    needed(values.iter().all(|value| value.is_finite()), || format!("{item} not finite: {values:?}"))
}

fn region(random: &mut Random) -> Option<PlaneRings> {
    let given = rings(random);
    PlaneRings::new(placed(random, given, -13.0, 6.0)).ok()
}

/// Rings that were taken have an area, hold their vertices, and are taken again as they are.
pub fn whole_rings(random: &mut Random, _: &Budget) -> Outcome {
    let Some(region) = region(random) else { return Ok(false) };
    needed(region.area() > 0.0 && region.area().is_finite(), || format!("area {}", region.area()))?;
    let corner = region.rings()[0][0];
    needed(region.contains(corner), || format!("a vertex outside: {corner:?}"))?;
    let again =
        PlaneRings::new(region.rings().to_vec()).map_err(|error| format!("taken once, then refused: {error}"))?;
    needed(again == region, || "taken again, the rings are others".into())?;
    Ok(true)
}

/// Moments are finite, the first is the area, and rings that turn round change all signs.
pub fn moments(random: &mut Random, _: &Budget) -> Outcome {
    let Some(region) = region(random) else { return Ok(false) };
    let order = random.index(9);
    let slices = |rings: &[Ring]| planar_moments(rings.iter().map(Vec::as_slice), order);
    let moments = slices(region.rings());
    all_finite("planar moments", moments.values())?;
    let turned: Vec<Ring> = region.rings().iter().map(|ring| ring.iter().rev().copied().collect()).collect();
    let (area, size) = (region.area(), region.bounds().0.amax().max(region.bounds().1.amax()));
    let allowed = ROUNDING * (size * size).max(area) * region.edges().count() as f64;
    for sum in [moments.get(0, 0) - area, slices(&turned).get(0, 0) + area] {
        needed(sum.abs() <= allowed, || format!("area {area} and moment differ by {sum}"))?;
    }
    let lifted: Vec<Vec<_>> = region.rings().iter().map(|ring| lifted(ring, 1.0)).collect();
    all_finite("spherical moments", spherical_moments(lifted.iter().map(Vec::as_slice), order).values())?;
    Ok(true)
}

/// Unit bearings of points of the plane at a depth.
fn lifted(ring: &Ring, depth: f64) -> Vec<Vector3<f64>> {
    ring.iter().map(|p| p.push(depth).normalize()).collect()
}

/// A mesh covers its region, or is refused.
pub fn mesh(random: &mut Random, budget: &Budget) -> Outcome {
    let Some(region) = region(random) else { return Ok(false) };
    let area = region.area();
    let mesh = match random.index(3) {
        0 => even_mesh_within(&region, area.sqrt() * magnitude(random, -2.0, 1.0), budget),
        1 => triangulate_within(&region, MeshOptions::default(), budget),
        _ => {
            let max_area = (!once_in(random, 3)).then(|| area * magnitude(random, -4.0, 1.0));
            let min_angle = once_in(random, 2).then(|| random.uniform(0.0, 30.0));
            let options = MeshOptions::default().with_max_area(max_area).with_min_angle(min_angle);
            triangulate_within(&region, options, budget)
        }
    };
    let Ok(mesh) = mesh else { return Ok(false) };
    needed(mesh.vertices.iter().flatten().all(|x| x.is_finite()), || "a vertex that is not finite".into())?;
    needed(mesh.triangles.iter().flatten().all(|&k| k < mesh.vertices.len()), || "an index out of range".into())?;
    Ok(true)
}

/// The outline of points is one, or refused.
pub fn outline(random: &mut Random, budget: &Budget) -> Outcome {
    let mut points = ring(random);
    for _ in 0..random.index(200) {
        points.push(Vector2::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)));
    }
    let points = placed(random, vec![points], -13.0, 6.0).remove(0);
    let size = points.iter().map(|p| p.amax()).fold(0.0, f64::max);
    let radius = if once_in(random, 5) { f64::INFINITY } else { size * magnitude(random, -3.0, 1.0) };
    let Ok(shape) = alpha_shape_within(&points, radius, budget) else { return Ok(false) };
    needed(shape.area() > 0.0 && shape.area().is_finite(), || format!("area {}", shape.area()))?;
    Ok(true)
}

/// Two regions in one unit.
fn pair(random: &mut Random, low: f64, high: f64) -> Option<[PlaneRings; 2]> {
    let (first, mut second) = (rings(random), rings(random));
    if once_in(random, 6) {
        second = first.clone();
    }
    let count = first.len();
    let both = placed(random, first.into_iter().chain(second).collect(), low, high);
    let [first, second] = [&both[..count], &both[count..]].map(|rings| PlaneRings::new(rings.to_vec()).ok());
    Some([first?, second?])
}

fn area_of(rings: &[Ring]) -> f64 {
    planar_moments(rings.iter().map(Vec::as_slice), 0).get(0, 0)
}

/// What two regions share is in both, whichever comes first.
pub fn clipping(random: &mut Random, budget: &Budget) -> Outcome {
    let Some([first, second]) = pair(random, -13.0, 6.0) else { return Ok(false) };
    let [shared, other] =
        [(&first, &second), (&second, &first)].map(|(a, b)| area_of(&intersection(a.rings(), b.rings(), budget).rings));
    let bounds = [&first, &second].map(PlaneRings::bounds);
    let size = bounds.iter().map(|(lower, upper)| lower.amax().max(upper.amax())).fold(0.0, f64::max);
    let allowed = ROUNDING * size * size * (first.edges().count() + second.edges().count()) as f64;
    needed((shared - other).abs() <= allowed, || format!("{shared} one way, {other} the other"))?;
    let least = first.area().min(second.area());
    needed(shared >= -allowed && shared <= least + allowed, || format!("{shared} is shared of {least}"))?;
    Ok(true)
}

/// Solid angles are finite, none negative, and a region lies on itself.
pub fn overlap(random: &mut Random, budget: &Budget) -> Outcome {
    let Some([first, second]) = pair(random, -13.0, 3.0) else { return Ok(false) };
    let areas = overlap_areas(&first, &second, budget);
    let parts = [areas.intersection, areas.only_observed, areas.only_predicted];
    needed(parts.iter().all(|part| *part >= 0.0 && part.is_finite()), || format!("overlap {parts:?}"))?;
    let own = overlap_areas(&first, &first, budget);
    let left = own.only_observed + own.only_predicted;
    // Latitudes near a pole lose as many digits as their tangents have; charts end at 87 degrees, a tangent of 19.
    let extent = first.bounds().0.amax().max(first.bounds().1.amax()).max(1.0);
    let allowed = 1e-13 * extent * first.edges().count() as f64;
    needed(left <= allowed, || format!("a region misses itself by {left}, allowed {allowed}"))?;
    Ok(true)
}

/// The area of a region in its own chart is one.
pub fn chart(random: &mut Random, _: &Budget) -> Outcome {
    let depth = magnitude(random, -1.0, 3.0);
    let given = rings(random);
    let given: Vec<_> = placed(random, given, -7.0, 0.0).iter().map(|ring| lifted(ring, depth)).collect();
    let turn = random.rotation();
    let turned: Vec<Vec<_>> = given.iter().map(|ring| ring.iter().map(|bearing| turn * bearing).collect()).collect();
    let Ok((chart, rings)) = Chart::of(&turned) else { return Ok(false) };
    let (area, (lower, upper)) = (rings.area(), rings.bounds());
    let allowed = ROUNDING * (upper - lower).norm_squared().max(1.0);
    needed((area - 1.0).abs() <= allowed, || format!("area {area} of a chart, allowed {allowed}"))?;
    needed(chart.scale.is_finite() && chart.scale > 0.0, || format!("scale {}", chart.scale))?;
    Ok(true)
}
