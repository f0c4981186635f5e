//! Simplification of lines and closed rings (Douglas and Peucker 1973).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::SVector;

use crate::budget::Budget;
use crate::geometry::point_tree::PointTree;

/// Vertices of a ring without which it would be farther off than `tolerance`, in order; charges the points it evaluates.
pub fn simplified<const D: usize>(ring: &[SVector<f64, D>], tolerance: f64, budget: &Budget) -> Vec<SVector<f64, D>> {
    let farthest = |from: &SVector<f64, D>| {
        let squares = ring.iter().map(|point| (point - from).norm_squared()).enumerate();
        squares.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    let middle = ring.iter().sum::<SVector<f64, D>>() / ring.len().max(1) as f64;
    let Some(first) = farthest(&middle) else { return Vec::new() };
    let Some(second) = farthest(&ring[first]) else { return Vec::new() };
    budget.charge(2 * ring.len());
    // Each side of a long chord is a line of its own.
    let side = |from: usize, to: usize| {
        let count = (to + ring.len() - from) % ring.len();
        (0..=count).map(|k| ring[(from + k) % ring.len()]).collect::<Vec<_>>()
    };
    let lines = [side(first, second), side(second, first)];
    let kept = lines.iter().flat_map(|line| simplified_line(line, tolerance, budget)).collect();
    without_needless(kept, tolerance * tolerance, budget)
}

/// The first vertex of a line, and those between its ends without which it would be farther off than `tolerance`, in order (Douglas
/// and Peucker 1973); none of an empty line.
///
/// Charges the points it evaluates: a tree of balls finds the vertex farthest from a chord without evaluating all of them, and
/// chords are on an explicit stack, so that a spiral, which is cut off vertex by vertex, takes neither the square of its vertices nor
/// the thread's stack.
pub(crate) fn simplified_line<const D: usize>(
    line: &[SVector<f64, D>],
    tolerance: f64,
    budget: &Budget,
) -> Vec<SVector<f64, D>> {
    let Some(end) = line.len().checked_sub(1) else { return Vec::new() };
    let tree = PointTree::new(line, budget);
    let mut is_kept = vec![false; line.len()];
    is_kept[0] = true;
    let mut chords = vec![(0, end)];
    while let Some((first, last)) = chords.pop() {
        if let Some(farthest) = tree.farthest_from_chord(first, last, tolerance * tolerance) {
            is_kept[farthest] = true;
            chords.extend([(first, farthest), (farthest, last)]);
        }
    }
    line.iter().zip(is_kept).filter_map(|(point, is_kept)| is_kept.then_some(*point)).collect()
}

/// The corners but those between which others, found later, have drawn the ring straight, the straightest first.
fn without_needless<const D: usize>(ring: Vec<SVector<f64, D>>, limit: f64, budget: &Budget) -> Vec<SVector<f64, D>> {
    let count = ring.len();
    let mut next: Vec<usize> = (0..count).map(|k| (k + 1) % count).collect();
    let mut previous: Vec<usize> = (0..count).map(|k| (k + count - 1) % count).collect();
    let square = |k: usize, before: usize, after: usize| square_off(&ring[k], &ring[before], &ring[after]);
    let mut squares: Vec<f64> = (0..count).map(|k| square(k, previous[k], next[k])).collect();
    // Squares are not negative: as bits they have the same order.
    let entry = |square: f64, k: usize| Reverse((square.to_bits(), k));
    let mut straightest: BinaryHeap<_> = squares.iter().enumerate().map(|(k, &square)| entry(square, k)).collect();
    let (mut is_left, mut left) = (vec![true; count], count);
    budget.charge(count);
    while left > 3 {
        let Some(Reverse((bits, k))) = straightest.pop() else { break };
        // Its neighbors may have moved since.
        if !is_left[k] || bits != squares[k].to_bits() {
            continue;
        }
        if squares[k] > limit {
            break;
        }
        let (before, after) = (previous[k], next[k]);
        (next[before], previous[after]) = (after, before);
        (is_left[k], left) = (false, left - 1);
        for beside in [before, after] {
            squares[beside] = square(beside, previous[beside], next[beside]);
            straightest.push(entry(squares[beside], beside));
        }
    }
    ring.into_iter().zip(is_left).filter_map(|(point, is_left)| is_left.then_some(point)).collect()
}

/// Squared distance of a point from the line between two others.
fn square_off<const D: usize>(point: &SVector<f64, D>, from: &SVector<f64, D>, to: &SVector<f64, D>) -> f64 {
    let (step, offset) = (to - from, point - from);
    let share = (offset.dot(&step) / step.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (offset - step * share).norm_squared()
}
