//! Weakly constrained directions of a pose, and their causes.

use nalgebra::{Matrix3, Matrix6, SymmetricEigen, U3, Vector3};

use crate::geometry::pose::Pose;
use crate::options::Limits;
use crate::problem::Problem;
use crate::search::symmetry::common_plane;
use crate::verdict::warning::{Cause, Warning};

/// Angle between a plane's normal and the ray to it, rad, below which it is seen frontally (15 degrees): the change of its
/// image with a tilt goes with the sine.
const FRONTAL: f64 = std::f64::consts::PI / 12.0;

/// Side, in pixels, of a square of a region's area below which it is tiny: a contour good to 0.3 px then gives the rotation
/// of a plane that is tilted by 50 degrees to half a degree.
const TINY: f64 = 20.0;

/// The warning of a pose whose covariance, of the left increment, is beyond some limits.
pub fn weak_geometry(problem: &Problem, pose: &Pose, covariance: &Matrix6<f64>, limits: &Limits) -> Option<Warning> {
    let (rotation, axis) = weakest(&covariance.fixed_view::<3, 3>(0, 0).into_owned());
    let (shift, along) = weakest(&covariance.fixed_view::<3, 3>(3, 3).into_owned());
    let most = limits.translation * problem.distance(pose);
    let weak = !(rotation < limits.rotation && shift < most);
    let causes = if weak { causes(problem, pose) } else { Vec::new() };
    let (degrees, most_degrees) = (rotation.to_degrees(), limits.rotation.to_degrees());
    weak.then_some(Warning::WeakGeometry { degrees, axis, shift, along, most_degrees, most_shift: most, causes })
}

fn causes(problem: &Problem, pose: &Pose) -> Vec<Cause> {
    let mut causes = Vec::new();
    let plane = common_plane(problem);
    if plane.is_some() && problem.regions().len() > 1 {
        causes.push(Cause::Coplanar);
    }
    let tilt = plane.map(|plane| {
        let angle = (pose.rotation * plane.axes[2]).angle(&pose.transform(&plane.origin));
        angle.min(std::f64::consts::PI - angle)
    });
    causes.extend(tilt.filter(|&tilt| tilt < FRONTAL).map(|tilt| Cause::Frontal { degrees: tilt.to_degrees() }));
    let count = problem.worlds().iter().filter(|world| world.is_line()).count();
    if count > 0 {
        causes.push(Cause::Lines { count, regions: problem.worlds().len() });
    }
    let pixels = problem.regions().iter().map(|region| region.pixel_area().sqrt()).fold(0.0, f64::max);
    if pixels < TINY {
        causes.push(Cause::Tiny { pixels });
    }
    causes
}

/// Largest standard deviation and its direction; infinite, and no direction, where the covariance is not finite.
pub(crate) fn weakest(covariance: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let Some(eigen) = principal(covariance) else { return (f64::INFINITY, Vector3::zeros()) };
    let largest = eigen.eigenvalues.imax();
    (eigen.eigenvalues[largest].max(0.0).sqrt(), eigen.eigenvectors.column(largest).into_owned())
}

/// Variances along the principal axes, and these; `None` where the covariance is not finite.
pub(crate) fn principal(covariance: &Matrix3<f64>) -> Option<SymmetricEigen<f64, U3>> {
    let finite = covariance.iter().all(|value| value.is_finite());
    finite.then(|| covariance.try_symmetric_eigen(f64::EPSILON, 1000)).flatten()
}
