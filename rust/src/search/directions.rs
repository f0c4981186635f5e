//! Poses at a place that the camera stands near: directions of the regions in the image against those from there
//! (`docs/math.md`, section 7).
//!
//! No outline has to be whole for it, nor the same on both sides: a part that is missing turns a region's direction by
//! a share of its size only.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::moments::STARTS_PER_REGION;
use super::poses::sorted;
use super::turns::least_turns;
use crate::budget::Budget;
use crate::contour::fit::FixedMixture;
use crate::equations::residual::RegionEquations;
use crate::geometry::pose::Pose;
use crate::moments::sphere::{Bearing, spherical_moments};
use crate::prior::{Prior, UP_SIGMA};
use crate::problem::Problem;
use crate::region::WorldRegion;

/// Standard deviation of a turn, rad (10 degrees), above which directions leave it free: those of a single region, or
/// of regions close to one another. A refinement reaches the pose from nearer (`cargo test directions::`).
const FREE: f64 = std::f64::consts::PI / 18.0;

/// The same direction along the camera's axes and in the world, and its weight, per squared radian.
struct Direction {
    in_camera: Vector3<f64>,
    in_world: Vector3<f64>,
    weight: f64,
}

/// Poses about the problem's origin with the camera at the prior's place, turned so that every
/// region is seen where it is; where that leaves a turn free, also those turns at which the contours fit. None without
/// such a place.
pub fn direction_poses(problem: &Problem, prior: &Prior, step: usize, budget: &Budget) -> Vec<Pose> {
    let Some((near, sigma)) = prior.place() else { return Vec::new() };
    let place = near - problem.origin();
    let pairs = problem.regions().iter().zip(problem.worlds());
    let mut directions: Vec<Direction> =
        pairs.filter_map(|(region, world)| direction(region, world, &near, sigma)).collect();
    if directions.is_empty() {
        return Vec::new();
    }
    directions.extend(upright(prior));
    let Some(rotation) = best_rotation(&directions) else { return Vec::new() };
    let fixed = FixedMixture::new(problem.contours(), step, budget);
    let turned = free_axis(&directions).map(|axis| least_poses(&fixed, &rotation, &axis, &place));
    std::iter::once(standing(rotation, &place)).chain(turned.into_iter().flatten()).collect()
}

/// The pose of a camera that stands at a place.
fn standing(rotation: Rotation3<f64>, place: &Vector3<f64>) -> Pose {
    Pose::new(rotation, -(rotation * place))
}

/// A region's direction: a place that errs by so many meters, or a centroid, turns it by those over the distance.
/// `None` where the direction is undetermined, as from a place in the region's plane.
fn direction(region: &RegionEquations, world: &WorldRegion, near: &Vector3<f64>, sigma: f64) -> Option<Direction> {
    let in_camera = seen_direction(region)?;
    let offset = world.frame().origin - near;
    let from_there = world.rings().into_iter().map(|ring| ring.into_iter().map(|x| x - near).collect());
    let in_world = centroid(from_there)?;
    let weight = offset.norm_squared() / (sigma * sigma);
    // From behind the rings turn the other way.
    Some(Direction { in_camera, in_world: in_world * in_world.dot(&offset).signum(), weight })
}

/// The direction in which a region's centroid is seen, along the camera's axes.
pub(super) fn seen_direction(region: &RegionEquations) -> Option<Vector3<f64>> {
    let chart = region.chart();
    let lifted = region.outline().rings().iter().map(|ring| ring.iter().map(|p| (p / chart.scale).push(1.0)).collect());
    Some(chart.rotation.inverse() * centroid(lifted)?)
}

/// The direction of the first moments of what rings of rays bound on the sphere, which its boundary alone decides.
fn centroid(rings: impl Iterator<Item = Vec<Vector3<f64>>>) -> Option<Bearing> {
    let unit = |ring: Vec<Vector3<f64>>| ring.iter().map(|ray| ray.try_normalize(0.0)).collect::<Option<Vec<_>>>();
    let rings = rings.map(unit).collect::<Option<Vec<_>>>()?;
    let moments = spherical_moments(rings.iter().map(Vec::as_slice), 1);
    Vector3::new(moments.get(1, 0, 0), moments.get(0, 1, 0), moments.get(0, 0, 1)).try_normalize(f64::EPSILON)
}

/// The prior's up direction, as one more direction.
fn upright(prior: &Prior) -> Option<Direction> {
    let in_world = prior.up?.try_normalize(0.0)?;
    Some(Direction { in_camera: -Vector3::y(), in_world, weight: prior.up_sigma.unwrap_or(UP_SIGMA).powi(-2) })
}

/// The rotation with the least weighted sum of squared chords between directions turned by it and seen (Wahba's
/// problem; Markley 1988).
fn best_rotation(directions: &[Direction]) -> Option<Rotation3<f64>> {
    let sum: Matrix3<f64> = directions.iter().map(|d| d.in_camera * d.in_world.transpose() * d.weight).sum();
    let svd = sum.try_svd(true, true, f64::EPSILON, 1000)?;
    let (u, v) = (svd.u?, svd.v_t?);
    let side = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (u.determinant() * v.determinant()).signum()));
    Some(Rotation3::from_matrix_unchecked(u * side * v))
}

/// The axis of the camera's about which the directions hardly hold a turn, if there is one.
fn free_axis(directions: &[Direction]) -> Option<Unit<Vector3<f64>>> {
    let across = |d: &Direction| (Matrix3::identity() - d.in_camera * d.in_camera.transpose()) * d.weight;
    let information = directions.iter().map(across).sum::<Matrix3<f64>>();
    let eigen = information.try_symmetric_eigen(f64::EPSILON, 1000)?;
    let least = eigen.eigenvalues.imin();
    (eigen.eigenvalues[least] < FREE.powi(-2))
        .then(|| Unit::new_normalize(eigen.eigenvectors.column(least).into_owned()))
}

/// Poses turned about an axis of the camera's at which the regions lie nearer to their contours than at the turns
/// beside, the nearest first.
fn least_poses(
    fixed: &FixedMixture<'_>,
    rotation: &Rotation3<f64>,
    axis: &Unit<Vector3<f64>>,
    place: &Vector3<f64>,
) -> Vec<Pose> {
    let turned = |angle: f64| standing(Rotation3::from_axis_angle(axis, angle) * rotation, place);
    let least = sorted(least_turns(|angle| fixed.negative_log_density(&turned(angle))));
    least.into_iter().take(STARTS_PER_REGION).map(|(_, angle)| turned(angle)).collect()
}
