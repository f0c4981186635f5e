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

use crate::geometry::rings::{PlaneRings, rising};

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
/// Each is right to about 1e-15 of the region's extent as an angle, and never negative.
pub fn overlap_areas(observed: &PlaneRings, predicted: &PlaneRings) -> OverlapAreas {
    let (first, second) = (sloping_edges(observed), sloping_edges(predicted));
    let area = |edges: &[SlopingEdge]| {
        let mut sum = AreaSum::default();
        edges.iter().for_each(|edge| sum.add(edge.sign, &edge.left, &edge.right));
        sum.total()
    };
    let (first_area, second_area) = (area(&first), area(&second));
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

/// An edge that is not vertical, from left to right.
#[derive(Debug, Clone, Copy)]
struct SlopingEdge {
    left: Point,
    right: Point,
    /// +1 where the region lies below the edge, -1 where it lies above.
    sign: f64,
}

impl SlopingEdge {
    fn y_at(&self, x: f64) -> f64 {
        if x == self.left.x {
            self.left.y
        } else if x == self.right.x {
            self.right.y
        } else {
            let share = (x - self.left.x) / (self.right.x - self.left.x);
            self.left.y + share * (self.right.y - self.left.y)
        }
    }
}

/// The edges of a region by their left ends; vertical ones bound no area below them.
fn sloping_edges(region: &PlaneRings) -> Vec<SlopingEdge> {
    let mut edges = Vec::with_capacity(region.rings().iter().map(Vec::len).sum());
    for ring in region.rings() {
        let Some(last) = ring.last() else { continue };
        let mut a = Point::new(*last);
        for b in ring {
            let b = Point::new(*b);
            if a.x < b.x {
                edges.push(SlopingEdge { left: a, right: b, sign: -1.0 });
            } else if a.x > b.x {
                edges.push(SlopingEdge { left: b, right: a, sign: 1.0 });
            }
            a = b;
        }
    }
    rising(edges.iter().map(|edge| edge.left.x)).map(|place| edges[place]).collect()
}

/// Sum over all pairs of edges that share some x: a sweep from left to right.
fn common_area(first: &[SlopingEdge], second: &[SlopingEdge]) -> f64 {
    let (mut open_first, mut open_second): (Vec<&SlopingEdge>, Vec<&SlopingEdge>) = (Vec::new(), Vec::new());
    let (mut rest_first, mut rest_second) = (first.iter().peekable(), second.iter().peekable());
    let mut sum = AreaSum::default();
    while rest_first.peek().is_some() || rest_second.peek().is_some() {
        let from_first = match (rest_first.peek(), rest_second.peek()) {
            (Some(a), Some(b)) => a.left.x <= b.left.x,
            (next, _) => next.is_some(),
        };
        let (rest, same, other) = if from_first {
            (&mut rest_first, &mut open_first, &mut open_second)
        } else {
            (&mut rest_second, &mut open_second, &mut open_first)
        };
        let Some(edge) = rest.next() else { break };
        other.retain(|open| open.right.x > edge.left.x);
        other.iter().for_each(|open| sum.add_below_both(edge, open));
        same.push(edge);
    }
    sum.total()
}

/// Sizes that a product is kept between: its square and the largest factors, of coordinates to 1e60, stay finite.
const SIZES: std::ops::Range<f64> = 1e-20..1e20;

/// A sum of areas that is an area itself: the product of complex numbers whose arguments are half of them
/// (`docs/math.md`, eq. 8.6).
struct AreaSum {
    re: f64,
    im: f64,
}

impl Default for AreaSum {
    fn default() -> Self {
        Self { re: 1.0, im: 0.0 }
    }
}

impl AreaSum {
    /// Adds the area below both edges over the x that they share; the lower one changes where they cross.
    fn add_below_both(&mut self, e: &SlopingEdge, f: &SlopingEdge) {
        let sign = e.sign * f.sign;
        let left = if e.left.x > f.left.x { e.left } else { f.left };
        let right = if e.right.x < f.right.x { e.right } else { f.right };
        let [[e_left, e_right], [f_left, f_right]] = [e, f].map(|edge| [edge.y_at(left.x), edge.y_at(right.x)]);
        let gaps = [e_left - f_left, e_right - f_right];
        let (left, right) = (Point { y: e_left.min(f_left), ..left }, Point { y: e_right.min(f_right), ..right });
        if gaps[0] * gaps[1] < 0.0 {
            let share = gaps[0] / (gaps[0] - gaps[1]);
            let crossing = Vector2::new(left.x, e_left).lerp(&Vector2::new(right.x, e_right), share);
            let crossing = Point::new(crossing);
            self.add(sign, &left, &crossing);
            self.add(sign, &crossing, &right);
        } else {
            self.add(sign, &left, &right);
        }
    }

    /// Adds `sign` times the solid angle between the segment from `a` to `b`, from left to right, and the line y = 0.
    ///
    /// With longitude `atan x` and latitude `phi` about the y axis, `tan(phi / 2) = y / (q + sqrt(q^2 + y^2))`,
    /// `q^2 = 1 + x^2`, this is the area between a great-circle arc and the equator (`docs/math.md`, eq. 8.4 and 8.5).
    fn add(&mut self, sign: f64, a: &Point, b: &Point) {
        let whole = |p: &Point| p.root + (p.root * p.root + p.y * p.y).sqrt();
        let (w_a, w_b) = (whole(a), whole(b));
        let (product, cosine) = (a.root * b.root, 1.0 + a.x * b.x);
        // Numerator and denominator of the tangent of half the difference of longitudes, without cancellation.
        let (up, down) = if cosine >= 0.0 { (b.x - a.x, product + cosine) } else { (product - cosine, b.x - a.x) };
        let (re, im) = (down * (w_a * w_b + a.y * b.y), sign * up * (a.y * w_b + b.y * w_a));
        // Points beyond all digits from each other bound an area that is anyone's guess: it must not wipe out the others.
        if re != 0.0 || im != 0.0 {
            (self.re, self.im) = (self.re * re - self.im * im, self.re * im + self.im * re);
        }
        let size = self.re.abs() + self.im.abs();
        if !SIZES.contains(&size) {
            (self.re, self.im) = (self.re / size, self.im / size);
        }
    }

    /// The sum, known to lie from 0 to 2 pi, but for rounding.
    fn total(&self) -> f64 {
        let half = self.im.atan2(self.re);
        2.0 * if half < -FRAC_PI_2 { half + TAU } else { half }
    }
}
