//! What pieces of a contour show against the edges of a projected boundary that they are nearest to, a few at a time.

use nalgebra::Vector6;

use super::boundary::Edge;
use super::pieces::Piece;
use super::readings::Reading;
use crate::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Squared tangent of the angle to the boundary (30 degrees) beyond which a piece runs across it, as the side of a bite
/// does where that crosses the outline; and what its spread across counts beside its squared distance.
const ALIGNED: f64 = 3.0;
const CROSSING: f64 = 4.0;

/// A piece, the edge that it is nearest to, and the edge's number.
pub(super) type Pair<'a> = (&'a Piece, Edge, u32);

/// A reading, and the derivatives of its distance along the chart's axes.
pub(super) type Row = (Reading, Vector6<f64>);

/// The readings of pairs, `pixels` to the unit of the chart's plane z = 1.
pub(super) fn readings(pairs: &[Pair<'_>], pixels: f64) -> Vec<Reading> {
    vectorized(Readings { pairs, pixels })
}

/// The same with their derivatives (`docs/math.md`, eq. 11.3).
pub(super) fn rows(pairs: &[Pair<'_>], pixels: f64) -> Vec<Row> {
    vectorized(Rows { pairs, pixels })
}

struct Readings<'a> {
    pairs: &'a [Pair<'a>],
    pixels: f64,
}

impl NullaryFnOnce for Readings<'_> {
    type Output = Vec<Reading>;

    #[inline(always)]
    fn call(self) -> Vec<Reading> {
        let none = Reading { distance: 0.0, spread: 0.0, misfit: 0.0, edge: 0 };
        let mut readings = vec![none; self.pairs.len()];
        for (readings, pairs) in readings.chunks_mut(LANES).zip(self.pairs.chunks(LANES)) {
            let feet = Feet::of(pairs, self.pixels);
            for (lane, reading) in readings.iter_mut().enumerate() {
                *reading = feet.reading(lane, pairs[lane].2);
            }
        }
        readings
    }
}

struct Rows<'a> {
    pairs: &'a [Pair<'a>],
    pixels: f64,
}

impl NullaryFnOnce for Rows<'_> {
    type Output = Vec<Row>;

    #[inline(always)]
    fn call(self) -> Vec<Row> {
        let none = Reading { distance: 0.0, spread: 0.0, misfit: 0.0, edge: 0 };
        let mut rows = vec![(none, Vector6::zeros()); self.pairs.len()];
        for (rows, pairs) in rows.chunks_mut(LANES).zip(self.pairs.chunks(LANES)) {
            let feet = Feet::of(pairs, self.pixels);
            let derivative = feet.derivative(pairs, self.pixels);
            for (lane, row) in rows.iter_mut().enumerate() {
                let [a, b, c, d, e, f] = &derivative;
                let entries = Vector6::new(a.0[lane], b.0[lane], c.0[lane], d.0[lane], e.0[lane], f.0[lane]);
                *row = (feet.reading(lane, pairs[lane].2), entries);
            }
        }
        rows
    }
}

/// A number of each pair of a group, that of the last where there are too few.
#[inline(always)]
fn each(pairs: &[Pair<'_>], number: impl Fn(&Pair<'_>) -> f64) -> Lanes {
    let at = |lane: usize| number(&pairs[lane.min(pairs.len() - 1)]);
    Lanes([at(0), at(1), at(2), at(3)])
}

/// The places on edges that are nearest to pieces.
struct Feet {
    distance: Lanes,
    spread: Lanes,
    misfit: Lanes,
    /// Where on the edge, 0 to 1.
    share: Lanes,
    /// Unit directions in which the distances grow.
    normal: [Lanes; 2],
}

impl Feet {
    #[inline(always)]
    fn of(pairs: &[Pair<'_>], pixels: f64) -> Self {
        let (dx, dy) = (each(pairs, |pair| pair.1.step.x), each(pairs, |pair| pair.1.step.y));
        let inverse = each(pairs, |pair| pair.1.inverse);
        let x = each(pairs, |pair| pair.0.mean.x) - each(pairs, |pair| pair.1.start.x);
        let y = each(pairs, |pair| pair.0.mean.y) - each(pairs, |pair| pair.1.start.y);
        let share = ((x * dx + y * dy) * inverse).upper(Lanes::ZERO).lower(Lanes::splat(1.0));
        let (x, y) = (x - dx * share, y - dy * share);
        // Beyond an end the distance is that from the vertex, and its direction the offset's own.
        let length = (x * x + y * y).map(f64::sqrt);
        let (root, minus) = (inverse.map(f64::sqrt), Lanes::ZERO - dx);
        let (mut nx, mut ny) = (dy * root, minus * root);
        let mut value = x * nx + y * ny;
        let (ex, ey) = (x / length, y / length);
        for lane in 0..LANES {
            let beyond = !(share.0[lane] > 0.0 && share.0[lane] < 1.0) && length.0[lane] > 0.0;
            nx.0[lane] = if beyond { ex.0[lane] } else { nx.0[lane] };
            ny.0[lane] = if beyond { ey.0[lane] } else { ny.0[lane] };
            value.0[lane] = if beyond { length.0[lane] } else { value.0[lane] };
        }
        Self::measured(pairs, Lanes::splat(pixels), share, [nx, ny], value)
    }

    #[inline(always)]
    fn measured(pairs: &[Pair<'_>], pixels: Lanes, share: Lanes, normal: [Lanes; 2], value: Lanes) -> Self {
        let [nx, ny] = normal;
        let (xx, xy) = (each(pairs, |pair| pair.0.spread.m11), each(pairs, |pair| pair.0.spread.m12));
        let (yx, yy) = (each(pairs, |pair| pair.0.spread.m21), each(pairs, |pair| pair.0.spread.m22));
        let distance = pixels * value;
        let spread = nx * (xx * nx + xy * ny) + ny * (yx * nx + yy * ny);
        let along = (xx + yy - spread) / Lanes::splat(ALIGNED);
        let crossing = Lanes::splat(CROSSING) * (spread - along).upper(Lanes::ZERO);
        let squared = pixels * pixels;
        let misfit = (distance * distance + squared * crossing).map(f64::sqrt);
        Self { distance, spread: squared * spread, misfit, share, normal }
    }

    #[inline(always)]
    fn reading(&self, lane: usize, edge: u32) -> Reading {
        Reading { distance: self.distance.0[lane], spread: self.spread.0[lane], misfit: self.misfit.0[lane], edge }
    }

    /// Derivatives of the distances along the chart's axes.
    #[inline(always)]
    fn derivative(&self, pairs: &[Pair<'_>], pixels: f64) -> [Lanes; 6] {
        let one = Lanes::splat(1.0);
        let (near, far) = (each(pairs, |pair| pair.1.from.z), each(pairs, |pair| pair.1.to.z));
        // The point of the edge in space that is seen at the foot.
        let weight = self.share * near / (self.share * near + (one - self.share) * far);
        let rest = one - weight;
        let x = weight * each(pairs, |pair| pair.1.to.x) + rest * each(pairs, |pair| pair.1.from.x);
        let y = weight * each(pairs, |pair| pair.1.to.y) + rest * each(pairs, |pair| pair.1.from.y);
        let z = weight * far + rest * near;
        let size = Lanes::splat(pixels) / z;
        let (nx, ny) = (self.normal[0] * size, self.normal[1] * size);
        let (mx, my, mz) = (Lanes::ZERO - nx, Lanes::ZERO - ny, (nx * x + ny * y) / z);
        [y * mz - z * my, z * mx - x * mz, x * my - y * mx, mx, my, mz]
    }
}
