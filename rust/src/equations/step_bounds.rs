//! Steps of a pose within bounds: no longer than a limit, halved until they are accepted.

use crate::geometry::pose::{Pose, Tangent};

/// Error of a start, rad and share of the distance, from which it mostly still converges: starts nearer to one another than this are one,
/// and no step of a refinement is longer. Starts off by 0.07 to 0.3 rad converge about as often (`python -m benchmarks lidar --only
/// lidar_beams=16 --only scan=samples`).
pub const CONVERGENCE_RADIUS: f64 = 0.2;

/// Halvings of a step that is not accepted, at most: a convention.
const HALVINGS: i32 = 6;

/// Length of a left increment of a pose: radians, or a fraction of the world origin's distance, whichever is more.
fn relative_length(increment: &Tangent, pose: &Pose) -> f64 {
    let distance = pose.translation.norm().max(f64::MIN_POSITIVE);
    increment.fixed_rows::<3>(0).norm().max(increment.fixed_rows::<3>(3).norm() / distance)
}

/// The increment, or one in its direction that is as long as the radius of convergence.
pub fn clamped(increment: &Tangent, pose: &Pose) -> Tangent {
    increment * (CONVERGENCE_RADIUS / relative_length(increment, pose)).min(1.0)
}

/// The pose moved by the longest of the increment and its halves that is accepted.
pub fn backtracked(pose: &Pose, increment: &Tangent, accepts: impl Fn(&Pose) -> bool) -> Option<Pose> {
    (0..=HALVINGS).map(|times| pose.retract(&(increment * 0.5_f64.powi(times)))).find(accepts)
}
