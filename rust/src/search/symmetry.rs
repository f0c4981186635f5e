//! Rotations of a region in its own plane that nearly map it to itself (`docs/math.md`, section 11).
//!
//! A symmetric region fits its contour as well from several places. A search that finds one of them closely and another
//! hardly would take the first for the only one.

use nalgebra::{Rotation3, Unit, Vector2, Vector3};

use super::moments::MOST_CANDIDATES;
use super::poses::sorted;
use super::ranking::MAX_DEFICIT;
use super::turns::{TURN, least_turns};
use crate::budget::Budget;
use crate::contour::fit::FixedMixture;
use crate::equations::residual::RegionEquations;
use crate::geometry::pose::Pose;
use crate::moments::plane::planar_moments;
use crate::problem::Problem;
use crate::region::{PlaneFrame, WorldRegion};

/// Parts of a step to which the least ones are found, each half the last: a quarter of a degree, a convention.
const HALVINGS: usize = 4;

/// Distance of vertices from one plane, as a share of the farthest vertex from the middle, up to which regions are one
/// plane: a convention.
const FLAT: f64 = 0.02;

/// A plane in which regions are drawn, and the point about which they may be symmetric, about the problem's origin.
struct Drawing {
    plane: PlaneFrame,
    middle: Vector3<f64>,
}

/// The poses at which the plane of all regions is where it was and they, turned in it, lie nearest to their contours, the
/// nearest first; `pose` itself is none of them. Every `step`-th piece is read. Poses are about the problem's origin; none for
/// regions in several planes.
pub fn turned_poses(problem: &Problem, pose: &Pose, step: usize, budget: &Budget) -> Vec<Pose> {
    let fixed = FixedMixture::new(problem.contours(), step, budget);
    turned_about(problem, pose, |pose| fixed.negative_log_density(pose), MAX_DEFICIT)
}

/// The same poses by any misfit that is no more than `worse` above that of the pose.
pub(super) fn turned_about(
    problem: &Problem,
    pose: &Pose,
    cost: impl Fn(&Pose) -> f64 + Copy,
    worse: f64,
) -> Vec<Pose> {
    let drawings = drawings(problem, pose);
    let found = drawings
        .iter()
        .flat_map(|drawing| [false, true].into_iter().flat_map(|behind| least_poses(cost, drawing, behind, pose)));
    let most = cost(pose) + worse;
    let found = sorted(found.filter(|(cost, _)| *cost < most).collect());
    found.into_iter().take(MOST_CANDIDATES).map(|(_, pose)| pose).collect()
}

/// The plane about the middle of the world regions and about that of the observed ones: disturbed parts move only the latter.
fn drawings(problem: &Problem, pose: &Pose) -> Vec<Drawing> {
    let Some(plane) = common_plane(problem) else { return Vec::new() };
    let plane = PlaneFrame { origin: plane.origin - problem.origin(), ..plane };
    let predicted = |world: &WorldRegion| {
        let flat = |ring: Vec<Vector3<f64>>| ring.iter().map(|x| plane.to_plane(&(x - problem.origin()))).collect();
        Some(world.rings().into_iter().map(flat).collect::<Vec<Vec<_>>>())
    };
    let observed = |region: &RegionEquations| {
        let flat = |ring: &Vec<Vector2<f64>>| ring.iter().map(|point| on_plane(&plane, region, point, pose)).collect();
        region.outline().rings().iter().map(flat).collect::<Option<Vec<Vec<_>>>>()
    };
    let middles = [middle(problem.worlds().iter().map(predicted)), middle(problem.regions().iter().map(observed))];
    let drawing = |middle: Vector2<f64>| Drawing { plane: plane.clone(), middle: plane.to_world(&middle) };
    middles.into_iter().flatten().map(drawing).collect()
}

/// The plane that all regions lie in, if they lie in one; none of lines, whose plane may be any.
pub(crate) fn common_plane(problem: &Problem) -> Option<PlaneFrame> {
    if problem.worlds().iter().any(WorldRegion::is_line) {
        return None;
    }
    let vertices = problem.worlds().iter().flat_map(|world| world.rings()).collect::<Vec<_>>().concat();
    let plane = PlaneFrame::fit(&vertices).ok()?;
    let farthest = vertices.iter().map(|x| (x - plane.origin).norm()).fold(0.0, f64::max);
    vertices.iter().all(|x| plane.height(x).abs() <= FLAT * farthest).then_some(plane)
}

/// The point of a plane of the world that is seen at a point of a region's chart; `None` where its ray doesn't meet that.
fn on_plane(plane: &PlaneFrame, region: &RegionEquations, point: &Vector2<f64>, pose: &Pose) -> Option<Vector2<f64>> {
    let chart = region.chart();
    let ray = chart.rotation.inverse() * (point / chart.scale).push(1.0);
    let normal = pose.rotation * plane.axes[2];
    let depth = normal.dot(&pose.transform(&plane.origin)) / normal.dot(&ray);
    (depth > 0.0 && depth.is_finite()).then(|| plane.to_plane(&pose.inverse().transform(&(ray * depth))))
}

impl Drawing {
    /// The pose at which the plane is where it was, and what is drawn on it turned about its middle, or turned over first.
    fn turned(&self, pose: &Pose, angle: f64, behind: bool) -> Pose {
        let [u, _, normal] = self.plane.axes.map(Unit::new_normalize);
        let over = Rotation3::from_axis_angle(&u, if behind { std::f64::consts::PI } else { 0.0 });
        let rotation = pose.rotation * Rotation3::from_axis_angle(&normal, angle) * over;
        Pose::new(rotation, pose.transform(&self.middle) - rotation * self.middle)
    }
}

/// Turned poses at which a drawing lies nearer to its contours than at the turns beside, and their misfits.
fn least_poses(cost: impl Fn(&Pose) -> f64, drawing: &Drawing, behind: bool, pose: &Pose) -> Vec<(f64, Pose)> {
    let cost_at = |angle: f64| cost(&drawing.turned(pose, angle, behind));
    let minima = least_turns(cost_at).into_iter().filter(|(_, angle)| behind || *angle != 0.0);
    let near = minima.map(|least| least_near(cost_at, least, TURN));
    near.map(|(least, angle)| (least, drawing.turned(pose, angle, behind))).collect()
}

/// The least value near an angle and where it is, by steps of half the size each.
fn least_near(value: impl Fn(f64) -> f64, mut best: (f64, f64), mut step: f64) -> (f64, f64) {
    for _ in 0..HALVINGS {
        step *= 0.5;
        for angle in [best.1 - step, best.1 + step] {
            let other = value(angle);
            if other < best.0 {
                best = (other, angle);
            }
        }
    }
    best
}

/// The centroid of regions drawn in one plane; `None` where one is unknown or they have no area.
fn middle(regions: impl Iterator<Item = Option<Vec<Vec<Vector2<f64>>>>>) -> Option<Vector2<f64>> {
    let (mut area, mut first) = (0.0, Vector2::zeros());
    for rings in regions {
        let moments = planar_moments(rings?.iter().map(Vec::as_slice), 1);
        // A drawing that is seen from behind turns the other way.
        let sign = moments.get(0, 0).signum();
        area += sign * moments.get(0, 0);
        first += Vector2::new(moments.get(1, 0), moments.get(0, 1)) * sign;
    }
    (area > 0.0).then(|| first / area)
}
