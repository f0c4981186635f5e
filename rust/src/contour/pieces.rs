//! Observed contours resampled to segments of equal length (`docs/math.md`, eq. 11.1).

use std::mem;

use nalgebra::{Matrix2, Vector2, Vector3};

use crate::geometry::rings::PlaneRings;

/// Length of a piece in pixels: a few steps of a binary mask's staircase average out, and a corner rounds only one.
const PIECE: f64 = 3.0;

/// Pieces of one region at most; a longer contour has longer ones. A convention.
const MOST_PIECES: usize = 800;

/// Pieces of one region at least, shorter ones where it is small: a convention.
const FEWEST_PIECES: usize = 8;

/// Share of a ring below which a part of an edge is what round-off leaves of it, and no part of the next piece.
const ROUNDING: f64 = 1e-12;

/// Turn, as a sine, up to which neighboring edges go on as one straight run: a camera bends a straight line into edges that
/// turn by less, and a mask's staircase turns by 45 degrees.
pub(super) const STRAIGHT: f64 = 0.1;

/// A short part of an observed contour.
#[derive(Debug, Clone, Copy)]
pub struct Piece {
    /// Mean of its points.
    pub mean: Vector2<f64>,
    /// Mean of the squares and products of its points about their mean.
    pub spread: Matrix2<f64>,
    /// The corners, by number, between which the straight run of the region's contour lies that it wholly is on.
    pub run: Option<[usize; 2]>,
}

impl Piece {
    /// The same on a plane `1 / scale` times as large.
    pub fn scaled(self, scale: f64) -> Self {
        Self { mean: self.mean / scale, spread: self.spread / (scale * scale), ..self }
    }
}

/// The pieces that a region's rings are cut into, and every `step`-th of them; `pixels` to the unit.
///
/// Those that touch a foreign edge are left out.
pub fn pieces(outline: &PlaneRings, foreign: &[Vec<bool>], pixels: f64, step: usize) -> Vec<Piece> {
    let cuts = cuts(outline.rings(), pixels);
    let mut pieces = Vec::with_capacity(cuts.iter().map(|cut| cut.count).sum::<usize>().div_ceil(step));
    cut_rings(outline.rings(), foreign, &cuts, step, |_, piece| pieces.push(piece));
    pieces
}

/// All pieces ring by ring, of closed rings that need not bound a region.
pub fn pieces_by_ring(rings: &[Vec<Vector2<f64>>], foreign: &[Vec<bool>], pixels: f64) -> Vec<Vec<Piece>> {
    let mut pieces = vec![Vec::new(); rings.len()];
    cut_rings(rings, foreign, &cuts(rings, pixels), 1, |ring, piece| pieces[ring].push(piece));
    pieces
}

/// Number of the pieces of a region's rings.
pub fn count(outline: &PlaneRings, pixels: f64) -> usize {
    cuts(outline.rings(), pixels).iter().map(|cut| cut.count).sum()
}

/// Length of a ring and number of the pieces that it is cut into.
struct Cut {
    length: f64,
    count: usize,
}

fn cuts(rings: &[Vec<Vector2<f64>>], pixels: f64) -> Vec<Cut> {
    let lengths: Vec<f64> = rings.iter().map(|ring| edges(ring).map(|(a, b)| (b - a).norm()).sum()).collect();
    let whole: f64 = lengths.iter().sum();
    let piece = (PIECE / pixels).clamp(whole / MOST_PIECES as f64, whole / FEWEST_PIECES as f64);
    // A speck counts by its length, as it does in the moments: by more, specks in their thousands outweigh the outline.
    let cut = |length: f64| Cut { length, count: (length / piece).round() as usize };
    lengths.into_iter().map(cut).collect()
}

/// Gives every `step`-th piece of all rings with its ring's number to `found`.
fn cut_rings(
    rings: &[Vec<Vector2<f64>>],
    foreign: &[Vec<bool>],
    cuts: &[Cut],
    step: usize,
    mut found: impl FnMut(usize, Piece),
) {
    // Pieces until the next that is wanted.
    let (mut runs, mut until) = (0, 0);
    for (index, (ring, cut)) in rings.iter().zip(cuts).enumerate() {
        let numbers = straight_runs(ring, &mut runs);
        let foreign = foreign.get(index).map_or(&[][..], Vec::as_slice);
        ring_pieces(ring, &numbers, foreign, cut, (until, step), |piece| found(index, piece));
        until += cut.count.saturating_sub(until).div_ceil(step) * step;
        until -= cut.count;
    }
}

/// Effective number of observations of every `step`-th piece of a region at most: two for each corner between straight runs of several
/// pieces, and one for each piece beside such sides.
pub fn numbers(pieces: &[Piece], step: usize) -> f64 {
    // One piece between two sides lies about their corner.
    let but_one = |count: usize| count.saturating_sub(1);
    let (mut corners, mut beside, mut between) = (Vec::new(), 0, 0);
    for run in pieces.chunk_by(|a, b| a.run.is_some() && a.run == b.run) {
        match run[0].run.filter(|_| run.len() > 1) {
            Some(ends) => {
                corners.extend(ends);
                beside += but_one(mem::take(&mut between));
            }
            None => between += run.len(),
        }
    }
    corners.sort_unstable();
    corners.dedup();
    (2 * corners.len() + step * (beside + but_one(between))) as f64
}

/// Consecutive pairs of a closed ring.
pub fn edges<T: Copy>(ring: &[T]) -> impl Iterator<Item = (T, T)> + '_ {
    (0..ring.len()).map(|k| (ring[k], ring[if k + 1 < ring.len() { k + 1 } else { 0 }]))
}

/// Whether an edge goes on straight from the one before it.
pub fn goes_on(before: &Vector2<f64>, step: &Vector2<f64>) -> bool {
    let (along, across) = (step.dot(before), step.perp(before));
    along > 0.0 && across * across < STRAIGHT * STRAIGHT * step.norm_squared() * before.norm_squared()
}

/// The corners between which the straight run lies that each edge of a ring belongs to, counted on from `last`.
pub(super) fn straight_runs(ring: &[Vector2<f64>], last: &mut usize) -> Vec<[usize; 2]> {
    let (mut before, first) = (Vector2::zeros(), *last + 1);
    let mut number = |(a, b): (Vector2<f64>, Vector2<f64>)| {
        let step = b - a;
        *last += usize::from(!goes_on(&before, &step));
        before = step;
        *last
    };
    let numbers: Vec<usize> = edges(ring).map(&mut number).collect();
    let next = |number: usize| if number == *last { first } else { number + 1 };
    numbers.into_iter().map(|number| [number, next(number)]).collect()
}

/// The points of a part of a contour, summed up.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    length: f64,
    first: Vector2<f64>,
    /// Of the squares of x, the products and the squares of y.
    second: Vector3<f64>,
    /// Those of the first stretch and of the last.
    runs: [[usize; 2]; 2],
    left_out: bool,
}

impl Sums {
    /// Adds the part of a straight stretch between two places along the ring.
    fn add(&mut self, stretch: &Stretch, from: f64, to: f64) {
        let &Stretch { start, along, run, left_out, .. } = stretch;
        let (length, middle) = (to - from, start + along * (0.5 * (from + to) - stretch.from));
        if self.length == 0.0 {
            self.runs[0] = run;
        }
        self.length += length;
        self.first += middle * length;
        let about_middle = length * length / 12.0;
        let product = |a: usize, b: usize| length * (middle[a] * middle[b] + about_middle * along[a] * along[b]);
        self.second = self.second.zip_map(&[product(0, 0), product(0, 1), product(1, 1)].into(), |sum, new| sum + new);
        self.runs[1] = run;
        self.left_out |= left_out;
    }

    /// `None` where it was marked to be left out.
    fn piece(&self) -> Option<Piece> {
        if self.left_out || self.length == 0.0 {
            return None;
        }
        let mean = self.first / self.length;
        let [xx, xy, yy] = (self.second / self.length).into();
        let cross = xy - mean.x * mean.y;
        let spread = Matrix2::new(xx - mean.x * mean.x, cross, cross, yy - mean.y * mean.y);
        Some(Piece { mean, spread, run: (self.runs[0] == self.runs[1]).then_some(self.runs[0]) })
    }
}

/// An edge of a ring, by where it begins and ends along the ring.
struct Stretch {
    from: f64,
    to: f64,
    start: Vector2<f64>,
    along: Vector2<f64>,
    run: [usize; 2],
    left_out: bool,
}

/// Gives every `stride`-th of the equally long parts of a closed ring, from part `first` on, to `found`, exact; without those that
/// touch an edge marked in `without`.
fn ring_pieces(
    ring: &[Vector2<f64>],
    runs: &[[usize; 2]],
    without: &[bool],
    &Cut { length, count }: &Cut,
    (first, stride): (usize, usize),
    mut found: impl FnMut(Piece),
) {
    let mut to = 0.0;
    let mut stretches = edges(ring).enumerate().map(|(edge, (start, end))| {
        let (from, step) = (to, (end - start).norm());
        to += step;
        let left_out = without.get(edge) == Some(&true);
        Stretch { from, to, start, along: (end - start) / step, run: runs[edge], left_out }
    });
    let mut here = stretches.next();
    // The last part ends where the ring does.
    let place = |part: usize| if part == count { length } else { length * (part as f64 / count as f64) };
    for part in (first..count).step_by(stride) {
        let (start, end, mut sums) = (place(part), place(part + 1), Sums::default());
        while let Some(stretch) = &here {
            let (from, to) = (stretch.from.max(start), stretch.to.min(end));
            if to - from > ROUNDING * length {
                sums.add(stretch, from, to);
            }
            if stretch.to >= end {
                break;
            }
            here = stretches.next();
        }
        sums.piece().into_iter().for_each(&mut found);
    }
}
