//! Steps of a pose within bounds: no longer than a limit, halved until they are accepted.

use crate::geometry::pose::{Pose, Tangent};

/// Length of a left increment of a pose: radians, or a fraction of the world origin's distance, whichever is more.
fn relative_length(increment: &Tangent, pose: &Pose) -> f64 {
    let distance = pose.translation.norm().max(f64::MIN_POSITIVE);
    increment.fixed_rows::<3>(0).norm().max(increment.fixed_rows::<3>(3).norm() / distance)
}

/// The increment, or one in its direction of the longest relative length.
pub fn clamped(increment: &Tangent, pose: &Pose, longest: f64) -> Tangent {
    increment * (longest / relative_length(increment, pose)).min(1.0)
}

/// The pose moved by the longest of the increment and its halves, so many halvings at most, that is accepted.
pub fn backtracked(pose: &Pose, increment: &Tangent, halvings: usize, accepts: impl Fn(&Pose) -> bool) -> Option<Pose> {
    (0..=halvings).map(|times| pose.retract(&(increment * 0.5_f64.powi(times as i32)))).find(accepts)
}
