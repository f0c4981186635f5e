//! Overlap of projected and observed regions, as solid angles.

use nalgebra::{Vector2, Vector3};

use crate::budget::Budget;
use crate::equations::residual::RegionEquations;
use crate::geometry::overlap::{OverlapAreas, overlap_areas};
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::problem::Problem;
use crate::region::WorldRegion;
use crate::view::border::{Border, projected_before};
use crate::view::chart::Chart;

/// Solid angles shared and not shared by an observed region and the projected one.
///
/// Of a region that reaches behind the camera, what lies before it is projected. What is projected beyond a region that has
/// hidden edges may be what they hide, and does not count.
pub fn region_overlap(observed: &RegionEquations, world: &WorldRegion, pose: &Pose, budget: &Budget) -> OverlapAreas {
    let areas = match observed.border() {
        Some(border) => cut_overlap(observed, border, world, pose, budget),
        None => overlap_areas(&unscaled(observed), &predicted(observed, world, pose), budget),
    };
    if observed.hides_edges() { OverlapAreas { only_predicted: 0.0, ..areas } } else { areas }
}

/// The observed outline on the plane `z = 1` of its chart.
fn unscaled(observed: &RegionEquations) -> PlaneRings {
    let scale = observed.chart().scale;
    let ring = |ring: &Vec<Vector2<f64>>| ring.iter().map(|p| p / scale).collect();
    PlaneRings::of_simple(observed.outline().rings().iter().map(ring).collect())
}

/// The projected world region there; none of a surface that occludes a part of itself.
fn predicted(observed: &RegionEquations, world: &WorldRegion, pose: &Pose) -> PlaneRings {
    let chart = Chart { scale: 1.0, ..*observed.chart() };
    let rings = projected_rings(&chart, world, pose);
    match world.surface() {
        // A projective map keeps a plane's rings simple, and turns them all round where it shows them from behind.
        None => PlaneRings::of_simple(rings).facing(),
        Some(_) => PlaneRings::new(rings).unwrap_or_else(|_| PlaneRings::of_simple(Vec::new())),
    }
}

/// The rings of a world region in a chart, as far as they lie before the camera.
fn projected_rings(chart: &Chart, world: &WorldRegion, pose: &Pose) -> Vec<Vec<Vector2<f64>>> {
    let chart_from_world = Pose::new(chart.rotation * pose.rotation, chart.rotation * pose.translation);
    let project = |ring: &Vec<Vector3<f64>>| {
        let turned: Vec<_> = ring.iter().map(|x| chart_from_world.transform(x)).collect();
        projected_before(&turned, chart)
    };
    world.rings().iter().map(project).collect()
}

/// The same of a region that the image's border cuts: the prediction is cut there too (`docs/math.md`, section 14).
fn cut_overlap(
    observed: &RegionEquations,
    border: &Border,
    world: &WorldRegion,
    pose: &Pose,
    budget: &Budget,
) -> OverlapAreas {
    let chart = observed.chart();
    let (predicted, _) = border.clipped(projected_rings(chart, world, pose), budget);
    let predicted = predicted.rings.iter().map(|ring| ring.iter().map(|p| p / chart.scale).collect());
    overlap_areas(&unscaled(observed), &PlaneRings::of_simple(predicted.collect()), budget)
}

/// Area of the symmetric difference over the observed area, of all regions together and of each.
pub fn overlap_errors(problem: &Problem, pose: &Pose, budget: &Budget) -> (f64, Vec<f64>) {
    overlap_errors_of(&region_overlaps(problem, pose, budget))
}

pub(super) fn overlap_errors_of(areas: &[OverlapAreas]) -> (f64, Vec<f64>) {
    let total = areas.iter().fold(OverlapAreas::default(), |sum, areas| sum + *areas);
    (total.error(), areas.iter().map(OverlapAreas::error).collect())
}

/// Overlap of each projected region with the observed one.
pub(super) fn region_overlaps(problem: &Problem, pose: &Pose, budget: &Budget) -> Vec<OverlapAreas> {
    let pairs = problem.regions().iter().zip(problem.worlds());
    pairs.map(|(region, world)| region_overlap(region, world, pose, budget)).collect()
}
