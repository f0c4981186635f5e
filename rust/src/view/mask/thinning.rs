//! Contours without their redundant vertices (Douglas and Peucker 1973).

use nalgebra::Vector2;

/// Vertices of a contour within this distance (pixels) of the line through their neighbors are redundant.
const TOLERANCE_PX: f64 = 0.01;

/// A closed contour, its first vertex repeated at its end, as a ring without that and without redundant vertices.
///
/// The first vertex stays; a contour no larger than the tolerance stays as it is.
pub(super) fn thinned(closed: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let turns = turns_of(closed);
    let kept = kept_of(&turns);
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

/// The vertices of a closed line that have to stay, but for its last one.
fn kept_of(line: &[Vector2<f64>]) -> Vec<Vector2<f64>> {
    let mut kept = Vec::with_capacity(line.len());
    // A stack rather than a recursion: a contour may be as long as the mask has pixels.
    let mut sections = vec![(0, line.len() - 1)];
    while let Some((first, last)) = sections.pop() {
        match farthest(line, first, last) {
            Some(between) => sections.extend([(between, last), (first, between)]),
            None => kept.push(line[first]),
        }
    }
    kept
}

/// The first of the vertices farthest from the segment between two of a line, if that is beyond the tolerance.
fn farthest(line: &[Vector2<f64>], first: usize, last: usize) -> Option<usize> {
    let (mut index, mut largest) = (None, TOLERANCE_PX * TOLERANCE_PX);
    let from_segment = squared_distance_from(line[first], line[last]);
    for (between, &vertex) in line.iter().enumerate().take(last).skip(first + 1) {
        let distance = from_segment(vertex);
        if distance > largest {
            (index, largest) = (Some(between), distance);
        }
    }
    index
}

/// The squared distance of a point from the segment between two others.
fn squared_distance_from(start: Vector2<f64>, end: Vector2<f64>) -> impl Fn(Vector2<f64>) -> f64 {
    let along = end - start;
    let length = along.norm_squared();
    let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
    move |point| {
        let offset = point - start;
        let share = offset.dot(&along);
        if share <= 0.0 {
            offset.norm_squared()
        } else if share >= length {
            (point - end).norm_squared()
        } else {
            along.perp(&offset).powi(2) * scale
        }
    }
}
