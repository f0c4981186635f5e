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
use std::ops::Add;

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
        (self.only_observed + self.only_predicted) / (self.intersection + self.only_observed)
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
    let (first, second) = (Chains::of(observed), Chains::of(predicted));
    let (first_area, second_area) = (first.area(), second.area());
    let intersection = common_area(&first, &second).clamp(0.0, first_area.min(second_area).max(0.0));
    OverlapAreas {
        intersection,
        only_observed: (first_area - intersection).max(0.0),
        only_predicted: (second_area - intersection).max(0.0),
    }
}

/// A point of the chart and the root of `1 + x^2`.
#[derive(Debug, Clone, Copy)]
struct Point {
    x: f64,
    y: f64,
    root: f64,
}

impl Point {
    fn new(at: Vector2<f64>) -> Self {
        Self { x: at.x, y: at.y, root: (1.0 + at.x * at.x).sqrt() }
    }
}

/// Where the line through two points, the first on the left, is at an x from that of the first to that of the second.
fn y_between(left: &Point, right: &Point, x: f64) -> f64 {
    left.y + (x - left.x) / (right.x - left.x) * (right.y - left.y)
}

/// Consecutive edges that go on to the same side, by their points from left to right.
#[derive(Debug, Clone, Copy)]
struct Chain<'a> {
    points: &'a [Point],
    /// +1 where the region lies below the edges, -1 where it lies above.
    sign: f64,
}

impl Chain<'_> {
    fn left(&self) -> f64 {
        self.points[0].x
    }

    fn right(&self) -> f64 {
        self.points[self.points.len() - 1].x
    }
}

/// The edges of a region but for vertical ones, which bound no area below them.
#[derive(Debug, Default)]
struct Chains {
    points: Vec<Point>,
    /// First and last point of each chain but one, and its sign.
    ranges: Vec<(usize, usize, f64)>,
}

impl Chains {
    fn of(region: &PlaneRings) -> Self {
        let count: usize = region.rings().iter().map(Vec::len).sum();
        // An end is a point of two chains.
        let mut chains = Self { points: Vec::with_capacity(2 * count), ranges: Vec::new() };
        region.rings().iter().for_each(|ring| chains.add(ring));
        chains
    }

    fn add(&mut self, ring: &[Vector2<f64>]) {
        let Some(last) = ring.last() else { return };
        let (mut before, mut sign, mut first) = (Point::new(*last), 0.0, self.points.len());
        for vertex in ring {
            let point = Point::new(*vertex);
            let way = if point.x > before.x {
                -1.0
            } else if point.x < before.x {
                1.0
            } else {
                0.0
            };
            if way != sign {
                self.close(first, sign);
                (first, sign) = (self.points.len(), way);
                self.points.extend((way != 0.0).then_some(before));
            }
            self.points.extend((way != 0.0).then_some(point));
            before = point;
        }
        self.close(first, sign);
    }

    /// Ends the chain that began with a point.
    fn close(&mut self, first: usize, sign: f64) {
        if sign > 0.0 {
            self.points[first..].reverse();
        }
        self.ranges.extend((sign != 0.0).then_some((first, self.points.len(), sign)));
    }

    /// The chains by their left ends.
    fn rising(&self) -> Vec<Chain<'_>> {
        let chain = |&(first, end, sign): &(usize, usize, f64)| Chain { points: &self.points[first..end], sign };
        let mut chains: Vec<_> = self.ranges.iter().map(chain).collect();
        chains.sort_by(|a, b| a.left().total_cmp(&b.left()));
        chains
    }

    /// Solid angle of the region.
    fn area(&self) -> f64 {
        let mut segments = Segments::with_capacity(self.points.len());
        for &(first, end, sign) in &self.ranges {
            self.points[first..end].windows(2).for_each(|ends| segments.add(sign, &ends[0], &ends[1]));
        }
        segments.area()
    }
}

/// Sum over all pairs of edges that share some x: a sweep over chains from left to right.
fn common_area(first: &Chains, second: &Chains) -> f64 {
    let (mut open_first, mut open_second): (Vec<Chain>, Vec<Chain>) = (Vec::new(), Vec::new());
    let (mut rest_first, mut rest_second) =
        (first.rising().into_iter().peekable(), second.rising().into_iter().peekable());
    let mut segments = Segments::with_capacity(PAIRS * (first.points.len() + second.points.len()));
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
        let Some(chain) = rest.next() else { break };
        other.retain(|open| open.right() > chain.left());
        other.iter().for_each(|open| segments.add_below_both(&chain, open));
        same.push(chain);
    }
    segments.area()
}

/// Segments for each edge that room is made for: four pairs of upper and lower edges about every vertex, and crossings.
const PAIRS: usize = 5;

/// Segments from left to right.
struct Segments(Vec<Segment>);

/// Sign of the area below a segment, and `x, y, root` of its left and of its right end.
type Segment = [f64; 7];

/// A segment without any length, at the chart's middle.
const EMPTY: Segment = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0];

impl Segments {
    fn with_capacity(count: usize) -> Self {
        Self(Vec::with_capacity(count))
    }

    /// Adds the part below a chain and one that begins no later and ends beyond its left end, over the x that they
    /// share.
    fn add_below_both(&mut self, late: &Chain, early: &Chain) {
        let (a, b, sign) = (late.points, early.points, late.sign * early.sign);
        let (mut i, mut j) = (1, b.partition_point(|point| point.x <= a[0].x));
        let mut left = (a[0], y_between(&b[j - 1], &b[j], a[0].x));
        while i < a.len() && j < b.len() {
            let (on_a, on_b) = (a[i], b[j]);
            let right = if on_a.x <= on_b.x {
                (on_a, y_between(&b[j - 1], &on_b, on_a.x))
            } else {
                (Point { y: y_between(&a[i - 1], &on_a, on_b.x), ..on_b }, on_b.y)
            };
            self.add_below(sign, &left, &right);
            (i, j) = (i + usize::from(on_a.x <= on_b.x), j + usize::from(on_b.x <= on_a.x));
            left = right;
        }
    }

    /// Adds the part below two edges between their places on the left and on the right, each a point and the y of the
    /// other at its x; the lower edge changes where they cross.
    fn add_below(&mut self, sign: f64, left: &(Point, f64), right: &(Point, f64)) {
        let lower =
            |&(point, other): &(Point, f64)| Point { y: if point.y < other { point.y } else { other }, ..point };
        let (gap, next) = (left.0.y - left.1, right.0.y - right.1);
        if gap * next < 0.0 {
            let share = gap / (gap - next);
            let crossing = Vector2::new(left.0.x, left.0.y).lerp(&Vector2::new(right.0.x, right.0.y), share);
            let crossing = Point::new(crossing);
            self.add(sign, &lower(left), &crossing);
            self.add(sign, &crossing, &lower(right));
        } else {
            self.add(sign, &lower(left), &lower(right));
        }
    }

    /// Adds `sign` times the part between the segment from `a` to `b` and the line y = 0.
    fn add(&mut self, sign: f64, a: &Point, b: &Point) {
        self.0.push([sign, a.x, a.y, a.root, b.x, b.y, b.root]);
    }

    /// The solid angle of all, known to lie from 0 to 2 pi, but for rounding.
    fn area(&self) -> f64 {
        let (re, im) = vectorized(HalfAngles(&self.0));
        let half = im.atan2(re);
        2.0 * if half < -FRAC_PI_2 { half + TAU } else { half }
    }
}

/// The product of complex numbers whose arguments are half the solid angles below segments (`docs/math.md`, eq. 8.6).
struct HalfAngles<'a>(&'a [Segment]);

impl NullaryFnOnce for HalfAngles<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn call(self) -> (f64, f64) {
        let (mut re, mut im) = (Lanes::splat(1.0), Lanes::ZERO);
        let (whole, rest) = self.0.as_chunks::<LANES>();
        let mut last = [EMPTY; LANES];
        last[..rest.len()].copy_from_slice(rest);
        for group in whole.iter().chain([&last]) {
            let (real, imaginary) = half_angle(group);
            (re, im) = (re * real - im * imaginary, re * imaginary + im * real);
            // Kept near size 1, so that it neither overflows nor vanishes.
            let inverse = (re.map(f64::abs) + im.map(f64::abs)).map(|size| 1.0 / size);
            (re, im) = (re * inverse, im * inverse);
        }
        (0..LANES).fold((1.0, 0.0), |(a, b), i| (a * re.0[i] - b * im.0[i], a * im.0[i] + b * re.0[i]))
    }
}

/// The complex number of each segment: the solid angle between it and the line y = 0, times its sign.
///
/// With longitude `atan x` and latitude `phi` about the y axis, `tan(phi / 2) = y / (q + sqrt(q^2 + y^2))`,
/// `q^2 = 1 + x^2`, this is the area between a great-circle arc and the equator (`docs/math.md`, eq. 8.4 and 8.5).
#[inline(always)]
fn half_angle([a, b, c, d]: &[Segment; LANES]) -> (Lanes, Lanes) {
    let number = |k: usize| Lanes([a[k], b[k], c[k], d[k]]);
    let (sign, ax, ay, a_root) = (number(0), number(1), number(2), number(3));
    let (bx, by, b_root) = (number(4), number(5), number(6));
    let whole = |root: Lanes, y: Lanes| root + (root * root + y * y).map(f64::sqrt);
    let (w_a, w_b) = (whole(a_root, ay), whole(b_root, by));
    let (product, cosine, run) = (a_root * b_root, Lanes::splat(1.0) + ax * bx, bx - ax);
    // Numerator and denominator of the tangent of half the difference of longitudes, without cancellation.
    let (mut up, mut down) = (run, product + cosine);
    for i in 0..LANES {
        let ahead = cosine.0[i] >= 0.0;
        up.0[i] = if ahead { up.0[i] } else { product.0[i] - cosine.0[i] };
        down.0[i] = if ahead { down.0[i] } else { run.0[i] };
    }
    let (mut re, im) = (down * (w_a * w_b + ay * by), sign * up * (ay * w_b + by * w_a));
    // Points beyond all digits from each other bound an area that is anyone's guess: it must not wipe out the others.
    for i in 0..LANES {
        re.0[i] = if re.0[i] == 0.0 && im.0[i] == 0.0 { 1.0 } else { re.0[i] };
    }
    (re, im)
}
