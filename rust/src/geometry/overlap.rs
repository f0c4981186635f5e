//! The paper's overlap error between two regions of a chart, exact for straight edges.
//!
//! Both regions lie in one gnomonic chart: a point `(x, y)` is the bearing along `(x, y, 1)`, a straight edge an arc of
//! a great circle. Areas are solid angles, so the error is the same in every chart and for every central camera.
//!
//! No polygon is clipped. With `s_e = +1` for an edge that has its region below and `-1` for one that has it above, a
//! region's indicator is the sum over its edges of `s_e [y < y_e(x)]`, so the area common to two regions is
//! `sum over e, f of s_e s_f * area below min(y_e, y_f)`, over the x that both edges span (`docs/math.md`, eq. 8.3).
//! Every term depends continuously on the vertices: edges that touch or coincide need no care, and nothing is snapped
//! to a grid.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::{Add, Range};

use nalgebra::Vector2;

use crate::geometry::rings::PlaneRings;
use crate::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Solid angles of what two regions share and of what only one of them covers, in steradians.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OverlapAreas {
    /// Covered by both.
    pub intersection: f64,
    /// Covered by the observed region only.
    pub only_observed: f64,
    /// Covered by the predicted region only.
    pub only_predicted: f64,
}

impl OverlapAreas {
    /// Overlap error: solid angle of the symmetric difference over that of the observed region (paper section 4, delta;
    /// `docs/math.md`, eq. 8.1).
    ///
    /// 0 for equal regions; 1 plus the ratio of the areas for regions apart; NaN without an observed region.
    pub fn error(&self) -> f64 {
        (self.only_observed + self.only_predicted) / self.observed()
    }

    /// Share of the observed region that the predicted one leaves open.
    pub fn uncovered(&self) -> f64 {
        self.only_observed / self.observed()
    }

    fn observed(&self) -> f64 {
        self.intersection + self.only_observed
    }
}

impl Add for OverlapAreas {
    type Output = Self;

    /// The areas of both pairs of regions together.
    fn add(self, other: Self) -> Self {
        Self {
            intersection: self.intersection + other.intersection,
            only_observed: self.only_observed + other.only_observed,
            only_predicted: self.only_predicted + other.only_predicted,
        }
    }
}

/// Solid angles of the intersection and the two differences of regions in the same chart `z = 1`, in steradians.
///
/// Each is right to about 1e-15 of the region's extent as an angle, times its greatest coordinate where that is above one, and
/// never negative.
pub fn overlap_areas(observed: &PlaneRings, predicted: &PlaneRings) -> OverlapAreas {
    let (first, second) = (Lines::of(observed), Lines::of(predicted));
    let (first_area, second_area) = (first.area(), second.area());
    let intersection = common_area(&first, &second).clamp(0.0, first_area.min(second_area).max(0.0));
    OverlapAreas {
        intersection,
        only_observed: (first_area - intersection).max(0.0),
        only_predicted: (second_area - intersection).max(0.0),
    }
}

/// A point of the chart.
type Point = [f64; 2];

/// Lines from left to right, of edges that go on to the same side; vertical edges bound no area below them.
struct Lines {
    /// The points of all lines, the last one of each repeated until they fill lane groups.
    points: Vec<Point>,
    /// The points of each line, and the sign of the area below it.
    parts: Vec<(Range<usize>, f64)>,
}

/// One of the lines.
#[derive(Clone, Copy)]
struct Line<'a> {
    points: &'a [Point],
    /// +1 where the region lies below the line, -1 where it lies above.
    sign: f64,
}

impl Line<'_> {
    fn left(&self) -> f64 {
        self.points[0][0]
    }

    fn right(&self) -> f64 {
        self.points[self.points.len() - 1][0]
    }
}

/// Where an edge is at an x from its left end to its right one.
fn y_at([left, right]: &[Point; 2], x: f64) -> f64 {
    left[1] + (x - left[0]) / (right[0] - left[0]) * (right[1] - left[1])
}

impl Lines {
    fn with_capacity(count: usize) -> Self {
        Self { points: Vec::with_capacity(count), parts: Vec::new() }
    }

    /// Those of a region's edges.
    fn of(region: &PlaneRings) -> Self {
        let count: usize = region.rings().iter().map(Vec::len).sum();
        // An end is a point of two lines.
        let mut lines = Self::with_capacity(2 * count);
        region.rings().iter().for_each(|ring| lines.add_ring(ring));
        lines
    }

    fn add_ring(&mut self, ring: &[Vector2<f64>]) {
        let Some(last) = ring.last() else { return };
        let (mut before, mut sign, mut first) = ([last.x, last.y], 0.0, self.points.len());
        for vertex in ring {
            let point = [vertex.x, vertex.y];
            let way = if point[0] > before[0] {
                -1.0
            } else if point[0] < before[0] {
                1.0
            } else {
                0.0
            };
            if way != sign {
                self.turn(first, sign);
                (first, sign) = (self.points.len(), way);
                self.points.extend((way != 0.0).then_some(before));
            }
            self.points.extend((way != 0.0).then_some(point));
            before = point;
        }
        self.turn(first, sign);
    }

    /// Ends the line of a ring that began with a point and went on to the left where its sign is positive.
    fn turn(&mut self, first: usize, sign: f64) {
        if sign > 0.0 {
            self.points[first..].reverse();
        }
        self.close(first, sign);
    }

    /// Ends the line that began with a point, if it is one.
    fn close(&mut self, first: usize, sign: f64) {
        let end = self.points.len();
        if sign != 0.0 {
            self.points.resize(first + (end - first).next_multiple_of(LANES), self.points[end - 1]);
            self.parts.push((first..end, sign));
        }
    }

    /// The lines by their left ends.
    fn rising(&self) -> Vec<Line<'_>> {
        let line = |(part, sign): &(Range<usize>, f64)| Line { points: &self.points[part.clone()], sign: *sign };
        let mut lines: Vec<_> = self.parts.iter().map(line).collect();
        lines.sort_by(|a, b| a.left().total_cmp(&b.left()));
        lines
    }

    /// Adds the lower one of a line and of one that begins no later and ends beyond its left end, over the x that they share:
    /// its vertices, and where the two cross.
    fn add_lower(&mut self, late: &Line, early: &Line) {
        let (first, mut x) = (self.points.len(), late.left());
        let (mut i, mut j) = (1, early.points.partition_point(|point| point[0] <= x));
        // Which line's vertex comes next is a matter of chance where the two lie close: everything is computed and only kept
        // where it counts, without a branch.
        self.points.resize(first + 2 * (late.points.len() + early.points.len() - j) + 2, [0.0; 2]);
        let (kept, mut count) = (&mut self.points[first..], 1);
        let (mut y, mut other) = (late.points[0][1], y_at(&[early.points[j - 1], early.points[j]], x));
        kept[0] = [x, lesser(y, other)];
        while i < late.points.len() && j < early.points.len() {
            let edges = [[late.points[i - 1], late.points[i]], [early.points[j - 1], early.points[j]]];
            let ending = usize::from(edges[0][1][0] > edges[1][1][0]);
            let [next, vertex] = edges[ending][1];
            let crossed = y_at(&edges[1 - ending], next);
            let [next_y, next_other] = if ending == 0 { [vertex, crossed] } else { [crossed, vertex] };
            let (gap, next_gap) = (y - other, next_y - next_other);
            let share = gap / (gap - next_gap);
            kept[count] = [x + (next - x) * share, y + (next_y - y) * share];
            count += usize::from(gap * next_gap < 0.0);
            // A vertex of the higher one bends nothing.
            kept[count] = [next, vertex];
            count += usize::from(vertex <= crossed);
            (x, y, other) = (next, next_y, next_other);
            (i, j) = (i + 1 - ending, j + ending);
        }
        kept[count] = [x, lesser(y, other)];
        self.points.truncate(first + count + 1);
        self.close(first, late.sign * early.sign);
    }

    /// The solid angle below all lines by their signs, known to lie from 0 to 2 pi, but for rounding.
    fn area(&self) -> f64 {
        let (re, im) = vectorized(HalfAngles(self));
        let half = im.atan2(re);
        2.0 * if half < -FRAC_PI_2 { half + TAU } else { half }
    }
}

fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// Sum over all pairs of edges that share some x: a sweep over lines from left to right.
fn common_area(first: &Lines, second: &Lines) -> f64 {
    let (mut open_first, mut open_second): (Vec<Line>, Vec<Line>) = (Vec::new(), Vec::new());
    let (mut rest_first, mut rest_second) =
        (first.rising().into_iter().peekable(), second.rising().into_iter().peekable());
    // Twice as many vertices as either region has, and as many crossings.
    let mut lower = Lines::with_capacity(2 * (first.points.len() + second.points.len()));
    while rest_first.peek().is_some() || rest_second.peek().is_some() {
        let from_first = match (rest_first.peek(), rest_second.peek()) {
            (Some(a), Some(b)) => a.left() <= b.left(),
            (next, _) => next.is_some(),
        };
        let (rest, same, other) = if from_first {
            (&mut rest_first, &mut open_first, &mut open_second)
        } else {
            (&mut rest_second, &mut open_second, &mut open_first)
        };
        let Some(line) = rest.next() else { break };
        other.retain(|open| open.right() > line.left());
        other.iter().for_each(|open| lower.add_lower(&line, open));
        same.push(line);
    }
    lower.area()
}

/// The product of complex numbers whose arguments are half the solid angles below edges (`docs/math.md`, eq. 8.6).
struct HalfAngles<'a>(&'a Lines);

impl NullaryFnOnce for HalfAngles<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn call(self) -> (f64, f64) {
        let (mut re, mut im) = (Lanes::splat(1.0), Lanes::ZERO);
        for (part, sign) in &self.0.parts {
            let padded = part.start..part.start + part.len().next_multiple_of(LANES);
            let mut next = None;
            for &[a, b, c, d] in self.0.points[padded].as_chunks().0.iter().rev() {
                let left = Ends::at(Lanes([a[0], b[0], c[0], d[0]]), Lanes([a[1], b[1], c[1], d[1]]));
                // The last point has no edge: one without any length, to itself.
                let right = left.shifted(next.unwrap_or(left.numbers(LANES - 1)));
                next = Some(left.numbers(0));
                let (real, imaginary) = half_angle(Lanes::splat(*sign), &left, &right);
                (re, im) = (re * real - im * imaginary, re * imaginary + im * real);
                // Kept near size 1, so that it neither overflows nor vanishes.
                let inverse = (re.map(f64::abs) + im.map(f64::abs)).map(|size| 1.0 / size);
                (re, im) = (re * inverse, im * inverse);
            }
        }
        (0..LANES).fold((1.0, 0.0), |(a, b), i| (a * re.0[i] - b * im.0[i], a * im.0[i] + b * re.0[i]))
    }
}

/// An end of each edge of a lane group: where it is, `q = sqrt(1 + x^2)` and `q + sqrt(q^2 + y^2)`.
#[derive(Clone, Copy)]
struct Ends {
    x: Lanes,
    y: Lanes,
    root: Lanes,
    whole: Lanes,
}

impl Ends {
    #[inline(always)]
    fn at(x: Lanes, y: Lanes) -> Self {
        let square = Lanes::splat(1.0) + x * x;
        let root = square.map(f64::sqrt);
        Self { x, y, root, whole: root + (square + y * y).map(f64::sqrt) }
    }

    /// The numbers of one end.
    #[inline(always)]
    fn numbers(&self, lane: usize) -> [f64; 4] {
        [self.x.0[lane], self.y.0[lane], self.root.0[lane], self.whole.0[lane]]
    }

    /// The ends one edge on, `last` being the numbers of that after the last.
    #[inline(always)]
    fn shifted(&self, [x, y, root, whole]: [f64; 4]) -> Self {
        let Self { x: xs, y: ys, root: roots, whole: wholes } = self;
        Self { x: xs.shifted(x), y: ys.shifted(y), root: roots.shifted(root), whole: wholes.shifted(whole) }
    }
}

/// The complex number of each edge: the solid angle between it and the line y = 0, times a sign.
///
/// With longitude `atan x` and latitude `phi` about the y axis, `tan(phi / 2) = y / (q + sqrt(q^2 + y^2))`,
/// `q^2 = 1 + x^2`, this is the area between a great-circle arc and the equator (`docs/math.md`, eq. 8.4 and 8.5).
#[inline(always)]
fn half_angle(sign: Lanes, a: &Ends, b: &Ends) -> (Lanes, Lanes) {
    let (product, cosine, run) = (a.root * b.root, Lanes::splat(1.0) + a.x * b.x, b.x - a.x);
    // Numerator and denominator of the tangent of half the difference of longitudes, without cancellation.
    let (mut up, mut down) = (run, product + cosine);
    for i in 0..LANES {
        let ahead = cosine.0[i] >= 0.0;
        up.0[i] = if ahead { up.0[i] } else { product.0[i] - cosine.0[i] };
        down.0[i] = if ahead { down.0[i] } else { run.0[i] };
    }
    let (mut re, im) = (down * (a.whole * b.whole + a.y * b.y), sign * up * (a.y * b.whole + b.y * a.whole));
    // Points beyond all digits from each other bound an area that is anyone's guess: it must not wipe out the others.
    for i in 0..LANES {
        re.0[i] = if re.0[i] == 0.0 && im.0[i] == 0.0 { 1.0 } else { re.0[i] };
    }
    (re, im)
}
