//! A plane's own coordinates, and the least squares plane of points.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::points::{check_finite, extent};
use crate::error::{Error, Result};
use crate::geometry::pose::check_rotation;

/// Largest distance of a vertex from the region's plane, as a share of the region's extent: surveyed or picked corners are
/// good to a few millimeters in a meter, while a ring bent more than this is not one plane.
const PLANARITY_TOLERANCE: f64 = 0.01;

/// Smallest share of the extent that a region must have across, below which its plane is undetermined.
const MIN_WIDTH: f64 = 1e-6;

/// A plane's own coordinates: `X = origin + u axes[0] + v axes[1]`, normal `axes[2]`, right-handed.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneFrame {
    /// A point of the plane, world.
    pub(crate) origin: Vector3<f64>,
    /// Unit axes u, v and the normal, world.
    pub(crate) axes: [Vector3<f64>; 3],
}

impl PlaneFrame {
    /// The frame of a point of the plane and its axes, world: unit axes u, v and the normal.
    ///
    /// # Errors
    /// An origin that is not finite, or axes that are no right-handed orthonormal ones to 1e-6.
    pub fn new(origin: Vector3<f64>, axes: [Vector3<f64>; 3]) -> Result<Self> {
        check_finite("the plane's origin", &[origin])?;
        check_rotation("the matrix of the plane's axes", &Matrix3::from_columns(&axes))?;
        Ok(Self { origin, axes })
    }

    /// A point of the plane, world.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Unit axes u, v and the normal, world.
    pub fn axes(&self) -> &[Vector3<f64>; 3] {
        &self.axes
    }

    /// Least squares plane of points, with its origin at their mean.
    ///
    /// # Errors
    /// When the points are identical or on one line.
    pub fn fit(points: &[Vector3<f64>]) -> Result<Self> {
        let degenerate = || Error::InvalidGeometry {
            item: "the region",
            found: format!("{} points that are identical or on one line", points.len()),
            needed: "at least 3 points that span a plane".into(),
        };
        let PrincipalAxes { mean, deviations: [length, width, _], axes: [u, v, _] } =
            PrincipalAxes::of(points).ok_or_else(degenerate)?;
        if points.len() < 3 || width < MIN_WIDTH * length {
            return Err(degenerate());
        }
        Ok(Self { origin: mean, axes: [u, v, u.cross(&v)] })
    }

    /// The plane through a point along two vectors, with any axes; `None` where they are along one another.
    pub(super) fn through(origin: Vector3<f64>, first: &Vector3<f64>, second: &Vector3<f64>) -> Option<Self> {
        let normal = first.cross(second).try_normalize(f64::MIN_POSITIVE)?;
        let u = first.try_normalize(0.0)?;
        Some(Self { origin, axes: [u, normal.cross(&u), normal] })
    }

    /// Plane coordinates of a world point, its height above the plane left out.
    pub fn to_plane(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let offset = point - self.origin;
        Vector2::new(self.axes[0].dot(&offset), self.axes[1].dot(&offset))
    }

    /// The world point at plane coordinates.
    pub fn to_world(&self, point: &Vector2<f64>) -> Vector3<f64> {
        self.origin + self.axes[0] * point.x + self.axes[1] * point.y
    }

    /// Signed distance of a world point from the plane.
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.axes[2].dot(&(point - self.origin))
    }
}

/// Principal axes of points.
pub(super) struct PrincipalAxes {
    mean: Vector3<f64>,
    /// Standard deviations along the axes, the largest first.
    pub(super) deviations: [f64; 3],
    axes: [Vector3<f64>; 3],
}

impl PrincipalAxes {
    /// Those of points; `None` where these are identical.
    pub(super) fn of(points: &[Vector3<f64>]) -> Option<Self> {
        let count = points.len().max(1) as f64;
        let mean = points.iter().sum::<Vector3<f64>>() / count;
        let spread: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
        let largest = spread.diagonal().max();
        if largest <= f64::MIN_POSITIVE {
            return None;
        }
        // Scaling keeps the iteration's tolerance meaningful for any unit of length.
        let eigen = (spread / largest).try_symmetric_eigen(f64::EPSILON, 1000)?;
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        Some(Self {
            mean,
            deviations: order.map(|index| (eigen.eigenvalues[index].max(0.0) * largest / count).sqrt()),
            axes: order.map(|index| eigen.eigenvectors.column(index).normalize()),
        })
    }
}

pub(super) fn check_planar(rings: &[Vec<Vector3<f64>>], frame: &PlaneFrame) -> Result<()> {
    let allowed = PLANARITY_TOLERANCE * extent(&rings.concat());
    let farthest = |vertices: &Vec<Vector3<f64>>| vertices.iter().map(|x| frame.height(x).abs()).fold(0.0, f64::max);
    // One bent ring tilts the plane of all: the ring farthest off is the one to name.
    let worst = rings.iter().map(farthest).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    match worst {
        Some((ring, distance)) if distance > allowed => Err(Error::NotPlanar { ring, distance, allowed }),
        _ => Ok(()),
    }
}
