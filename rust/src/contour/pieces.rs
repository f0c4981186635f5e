//! The parts of equal length that an observed contour is cut into (`docs/math.md`, eq. 11.1).

use nalgebra::{Matrix2, Vector2};

use crate::geometry::rings::PlaneRings;

/// Length of a piece in pixels: a few steps of a binary mask's staircase average out, and a corner rounds only one.
const PIECE: f64 = 3.0;

/// Pieces of one region at most; a longer contour has longer ones.
const MOST_PIECES: usize = 800;

/// Pieces of one ring at least.
const FEWEST_PIECES: usize = 8;

/// Share of an edge that counts as all of it: what round-off leaves at its end is no part of the next piece.
const WHOLE: f64 = 1.0 - 1e-12;

/// Turn, as a sine, up to which neighbouring edges go on as one straight run: a camera bends a straight line into edges that
/// turn by less, and a mask's staircase turns by 45 degrees.
const STRAIGHT: f64 = 0.1;

/// A short part of an observed contour.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    /// Mean of its points.
    pub mean: Vector2<f64>,
    /// Mean of the squares and products of its points about their mean.
    pub spread: Matrix2<f64>,
    /// The straight run of the region's contour that it wholly lies on, by number.
    pub run: Option<usize>,
}

impl Piece {
    /// The same on a plane `1 / scale` times as large.
    pub fn scaled(self, scale: f64) -> Self {
        Self { mean: self.mean / scale, spread: self.spread / (scale * scale), ..self }
    }
}

/// The pieces of a region's rings, `pixels` to the unit; those that touch a foreign edge are left out.
pub fn pieces(outline: &PlaneRings, foreign: &[Vec<bool>], pixels: f64) -> Vec<Piece> {
    pieces_by_ring(outline.rings(), foreign, pixels).into_iter().flatten().collect()
}

/// The same ring by ring, of closed rings that need not bound a region.
pub fn pieces_by_ring(rings: &[Vec<Vector2<f64>>], foreign: &[Vec<bool>], pixels: f64) -> Vec<Vec<Piece>> {
    let lengths: Vec<f64> = rings.iter().map(|ring| edges(ring).map(|(a, b)| (b - a).norm()).sum()).collect();
    let piece = (PIECE / pixels).max(lengths.iter().sum::<f64>() / MOST_PIECES as f64);
    let mut pieces = Vec::with_capacity(rings.len());
    let mut runs = 0;
    for (index, (ring, length)) in rings.iter().zip(lengths).enumerate() {
        let numbers = straight_runs(ring, &mut runs);
        let count = ((length / piece).round() as usize).max(FEWEST_PIECES);
        let foreign = foreign.get(index).map_or(&[][..], Vec::as_slice);
        pieces.push(ring_pieces(ring, &numbers, foreign, length, count));
    }
    pieces
}

/// Consecutive pairs of a closed ring.
pub fn edges<T: Copy>(ring: &[T]) -> impl Iterator<Item = (T, T)> + '_ {
    (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()]))
}

/// The number of the straight run that each edge of a ring belongs to, counted on from `last`.
pub(super) fn straight_runs(ring: &[Vector2<f64>], last: &mut usize) -> Vec<usize> {
    let mut before = Vector2::zeros();
    let mut number = |(a, b): (Vector2<f64>, Vector2<f64>)| {
        let step = b - a;
        let goes_on = step.dot(&before) > 0.0 && step.perp(&before).abs() < STRAIGHT * step.norm() * before.norm();
        *last += usize::from(!goes_on);
        before = step;
        *last
    };
    edges(ring).map(&mut number).collect()
}

/// The points of a part of a contour, summed up.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    length: f64,
    first: Vector2<f64>,
    second: Matrix2<f64>,
    runs: Option<(usize, usize)>,
    left_out: bool,
}

impl Sums {
    /// With the straight stretch from `a` to `b` of a run.
    fn with(self, a: &Vector2<f64>, b: &Vector2<f64>, run: usize) -> Self {
        let (length, middle) = ((b - a).norm(), (a + b) / 2.0);
        let about_middle = (b - a) * (b - a).transpose() / 12.0;
        Self {
            length: self.length + length,
            first: self.first + middle * length,
            second: self.second + (middle * middle.transpose() + about_middle) * length,
            runs: Some((self.runs.map_or(run, |runs| runs.0), run)),
            left_out: self.left_out,
        }
    }

    /// `None` where it was marked to be left out.
    fn piece(&self) -> Option<Piece> {
        if self.left_out || self.length == 0.0 {
            return None;
        }
        let mean = self.first / self.length;
        let spread = self.second / self.length - mean * mean.transpose();
        Some(Piece { mean, spread, run: self.runs.filter(|(first, last)| first == last).map(|(run, _)| run) })
    }
}

/// `count` equally long parts of a closed ring, exact; without those that touch an edge marked in `without`.
fn ring_pieces(ring: &[Vector2<f64>], runs: &[usize], without: &[bool], length: f64, count: usize) -> Vec<Piece> {
    let part = length / count as f64;
    let mut pieces = Vec::with_capacity(count);
    let (mut sums, mut parts) = (Sums::default(), 0);
    for (edge, (a, b)) in edges(ring).enumerate() {
        let step = (b - a).norm();
        let mut from = 0.0;
        while from < step * WHOLE {
            let last = parts + 1 == count;
            let to = if last { step } else { step.min(from + part - sums.length) };
            sums = sums.with(&a.lerp(&b, from / step), &a.lerp(&b, to / step), runs[edge]);
            sums.left_out |= without.get(edge) == Some(&true);
            from = to;
            if !last && sums.length >= part * (1.0 - f64::EPSILON * count as f64) {
                pieces.extend(sums.piece());
                (sums, parts) = (Sums::default(), parts + 1);
            }
        }
    }
    pieces.extend(sums.piece());
    pieces
}
