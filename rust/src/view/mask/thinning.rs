//! Contours without their redundant vertices.

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::geometry::simplified::simplified_line;

/// Vertices of a contour within this distance (pixels) of the line through their neighbors are redundant.
const TOLERANCE_PX: f64 = 0.01;

/// A closed contour, its first vertex repeated at its end, as a ring without that and without redundant vertices.
///
/// The first vertex stays; a contour no larger than the tolerance stays as it is.
pub(super) fn thinned(closed: &[Vector2<f64>], budget: &Budget) -> Vec<Vector2<f64>> {
    let kept = simplified_line(&turns_of(closed), TOLERANCE_PX, budget);
    if kept.len() >= 3 { kept } else { closed[..closed.len() - 1].to_vec() }
}

/// The ends of a line and the vertices between them at which it turns, exactly.
fn turns_of(line: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut turns: Vec<Vector2<f64>> = Vec::with_capacity(line.len());
    for &vertex in line {
        if let [.., before, last] = turns[..] {
            let (step, next) = (last - before, vertex - last);
            if step.perp(&next) == 0.0 && step.dot(&next) > 0.0 {
                turns.pop();
            }
        }
        turns.push(vertex);
    }
    turns
}
