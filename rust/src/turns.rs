//! Other turns of a region in its own plane at which it looks much the same (`docs/math.md`, section 11).
//!
//! A symmetric region fits its contour as well from several places. A search that finds one of them closely and another
//! hardly would take the first for the only one.

use nalgebra::{Rotation3, Unit};

use crate::contour::{Contour, misfit};
use crate::pose::Pose;
use crate::region::PlaneFrame;

/// Turns that are compared: 3 degrees apart, a fifteenth of the period of an eightfold symmetry.
const STEPS: usize = 120;

/// Turns that come back at most, seen from before and from behind: those of an eightfold symmetry but the first.
const MOST_TURNS: usize = 15;

/// The turns of a plane at which what is drawn on it lies nearest to its contours, from before and from behind, the nearest
/// first; `pose` itself is none of them.
pub fn turns_of(contours: &[Contour], plane: &PlaneFrame, pose: &Pose, scale: f64) -> Vec<Pose> {
    let mut found: Vec<(f64, Pose)> = Vec::new();
    for behind in [false, true] {
        let turned: Vec<Pose> = (0..STEPS).map(|step| turned(plane, pose, step, behind)).collect();
        let misfits: Vec<f64> =
            turned.iter().map(|pose| misfit(contours, pose, scale).unwrap_or(f64::INFINITY)).collect();
        let is_least = |step: usize| {
            let (before, after) = (misfits[(step + STEPS - 1) % STEPS], misfits[(step + 1) % STEPS]);
            misfits[step].is_finite() && misfits[step] <= before && misfits[step] < after
        };
        let others = (0..STEPS).filter(|&step| (behind || step > 0) && is_least(step));
        found.extend(others.map(|step| (misfits[step], turned[step])));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().take(MOST_TURNS).map(|(_, pose)| pose).collect()
}

/// The pose at which the plane is where it was, and what is drawn on it turned about its origin, or turned over first.
fn turned(plane: &PlaneFrame, pose: &Pose, step: usize, behind: bool) -> Pose {
    let [u, _, normal] = plane.axes;
    let angle = 2.0 * std::f64::consts::PI * step as f64 / STEPS as f64;
    let over = Rotation3::from_axis_angle(&Unit::new_normalize(u), if behind { std::f64::consts::PI } else { 0.0 });
    let turn = Rotation3::from_axis_angle(&Unit::new_normalize(normal), angle) * over;
    let rotation = pose.rotation * turn;
    Pose::new(rotation, pose.transform(&plane.origin) - rotation * plane.origin)
}
