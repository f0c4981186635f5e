//! Non-maximum suppression and sorting of lists of poses.

use crate::geometry::pose::Pose;

/// Poses nearer than this, rad and share of the distance, are one before their covariance is known: a hundred times the tolerance of
/// candidates, far below the radius of convergence.
pub const SAME: f64 = 0.01;

/// Whether two poses of the centered world differ by more than `limit`: radians, or that share of the distance.
pub fn apart(a: &Pose, b: &Pose, limit: f64) -> bool {
    a.angle_to(b) > limit || (a.translation - b.translation).norm() > limit * a.translation.norm()
}

/// The items of the least cost, at most so many, each pose once; those whose cost is not finite are left out.
pub fn distinct<T>(items: Vec<(f64, T)>, most: usize, limit: f64, pose: impl Fn(&T) -> &Pose) -> Vec<(f64, T)> {
    let mut kept: Vec<(f64, T)> = Vec::new();
    for item in sorted(items) {
        if kept.len() == most {
            break;
        }
        if kept.iter().all(|other| apart(pose(&other.1), pose(&item.1), limit)) {
            kept.push(item);
        }
    }
    kept
}

/// The items by their cost, the least first; those whose cost is not finite are left out.
pub fn sorted<T>(mut items: Vec<(f64, T)>) -> Vec<(f64, T)> {
    // The sign of a NaN is arbitrary: total_cmp would put a negative one first.
    items.retain(|(cost, _)| cost.is_finite());
    items.sort_by(|a, b| a.0.total_cmp(&b.0));
    items
}
