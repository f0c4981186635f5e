//! Rings without the vertices that hardly bend them.

use nalgebra::SVector;

/// Vertices of a ring without which it would be farther off than `tolerance`, in order (Douglas and Peucker 1973).
pub fn simplified<const D: usize>(ring: &[SVector<f64, D>], tolerance: f64) -> Vec<SVector<f64, D>> {
    let farthest = |from: &SVector<f64, D>| {
        let squares = ring.iter().map(|point| (point - from).norm_squared()).enumerate();
        squares.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    };
    let middle = ring.iter().sum::<SVector<f64, D>>() / ring.len().max(1) as f64;
    let Some(first) = farthest(&middle) else { return Vec::new() };
    let Some(second) = farthest(&ring[first]) else { return Vec::new() };
    // Each side of a long chord is a line of its own.
    let side = |from: usize, to: usize| {
        let count = (to + ring.len() - from) % ring.len();
        (0..=count).map(|k| ring[(from + k) % ring.len()]).collect::<Vec<_>>()
    };
    let mut kept = Vec::new();
    for line in [side(first, second), side(second, first)] {
        kept.push(line[0]);
        keep_between(&line, tolerance * tolerance, &mut kept);
    }
    without_needless(kept, tolerance * tolerance)
}

/// Adds the vertices that a line needs between its ends.
fn keep_between<const D: usize>(line: &[SVector<f64, D>], limit: f64, kept: &mut Vec<SVector<f64, D>>) {
    let (Some(first), Some(last)) = (line.first(), line.last()) else { return };
    let step = last - first;
    let inverse = step.norm_squared().max(f64::MIN_POSITIVE).recip();
    let mut farthest = (limit, 0);
    for (k, point) in line.iter().enumerate().take(line.len() - 1).skip(1) {
        let offset = point - first;
        let share = (offset.dot(&step) * inverse).clamp(0.0, 1.0);
        let square = (offset - step * share).norm_squared();
        farthest = if square > farthest.0 { (square, k) } else { farthest };
    }
    if let (_, k @ 1..) = farthest {
        keep_between(&line[..=k], limit, kept);
        kept.push(line[k]);
        keep_between(&line[k..], limit, kept);
    }
}

/// The corners but those between which others, found later, have drawn the ring straight, the straightest first.
fn without_needless<const D: usize>(mut ring: Vec<SVector<f64, D>>, limit: f64) -> Vec<SVector<f64, D>> {
    while ring.len() > 3 {
        let count = ring.len();
        let square = |k: usize| square_off(&ring[k], &ring[(k + count - 1) % count], &ring[(k + 1) % count]);
        let straightest = (0..count).map(|k| (square(k), k)).min_by(|a, b| a.0.total_cmp(&b.0));
        match straightest {
            Some((least, k)) if least <= limit => ring.remove(k),
            _ => break,
        };
    }
    ring
}

/// Squared distance of a point from the line between two others.
fn square_off<const D: usize>(point: &SVector<f64, D>, from: &SVector<f64, D>, to: &SVector<f64, D>) -> f64 {
    let (step, offset) = (to - from, point - from);
    let share = (offset.dot(&step) / step.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (offset - step * share).norm_squared()
}
