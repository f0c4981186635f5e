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

use std::ops::Add;

use nalgebra::Vector2;

use crate::geometry::rings::PlaneRings;

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
    let area = |edges: &[SlopingEdge]| edges.iter().map(SlopingEdge::signed_area_below).sum::<f64>();
    let (first_area, second_area) = (area(&first), area(&second));
    let intersection = common_area(&first, &second).clamp(0.0, first_area.min(second_area).max(0.0));
    OverlapAreas {
        intersection,
        only_observed: (first_area - intersection).max(0.0),
        only_predicted: (second_area - intersection).max(0.0),
    }
}

/// An edge that is not vertical, from left to right.
#[derive(Debug, Clone, Copy)]
struct SlopingEdge {
    left: Vector2<f64>,
    right: Vector2<f64>,
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

    fn signed_area_below(&self) -> f64 {
        self.sign * area_below(self.left, self.right)
    }
}

/// The edges of a region by their left ends; vertical ones bound no area below them.
fn sloping_edges(region: &PlaneRings) -> Vec<SlopingEdge> {
    let mut edges: Vec<_> = region
        .edges()
        .filter(|(a, b)| a.x != b.x)
        .map(|(a, b)| {
            if a.x < b.x {
                SlopingEdge { left: a, right: b, sign: -1.0 }
            } else {
                SlopingEdge { left: b, right: a, sign: 1.0 }
            }
        })
        .collect();
    edges.sort_by(|a, b| a.left.x.total_cmp(&b.left.x));
    edges
}

/// Sum over all pairs of edges that share some x: a sweep from left to right.
fn common_area(first: &[SlopingEdge], second: &[SlopingEdge]) -> f64 {
    let (mut open_first, mut open_second): (Vec<SlopingEdge>, Vec<SlopingEdge>) = (Vec::new(), Vec::new());
    let (mut rest_first, mut rest_second) = (first.iter().peekable(), second.iter().peekable());
    let mut area = 0.0;
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
        area += other.iter().map(|open| area_below_both(edge, open)).sum::<f64>();
        same.push(*edge);
    }
    area
}

/// Signed area below both edges over the x that they share; the lower one changes where they cross.
fn area_below_both(e: &SlopingEdge, f: &SlopingEdge) -> f64 {
    let (left, right) = (e.left.x.max(f.left.x), e.right.x.min(f.right.x));
    let ends = [left, right].map(|x| [e.y_at(x), f.y_at(x)]);
    let gaps = ends.map(|[y_e, y_f]| y_e - y_f);
    let low_left = Vector2::new(left, ends[0][0].min(ends[0][1]));
    let low_right = Vector2::new(right, ends[1][0].min(ends[1][1]));
    let changes = (gaps[0] < 0.0 && gaps[1] > 0.0) || (gaps[0] > 0.0 && gaps[1] < 0.0);
    let below = if changes {
        let share = gaps[0] / (gaps[0] - gaps[1]);
        let crossing = Vector2::new(left, ends[0][0]).lerp(&Vector2::new(right, ends[1][0]), share);
        area_below(low_left, crossing) + area_below(crossing, low_right)
    } else {
        area_below(low_left, low_right)
    };
    e.sign * f.sign * below
}

/// Solid angle between the segment from `a` to `b` and the line y = 0, positive above it for `a.x < b.x`.
///
/// With longitude `atan x` and latitude `phi` about the y axis, `tan(phi / 2) = y / (r + s)`, `s^2 = 1 + x^2`,
/// `r^2 = s^2 + y^2`, this is the area between a great-circle arc and the equator:
/// `tan(area / 2) = tan(d / 2) (u_a + u_b) / (1 + u_a u_b)`, `u = tan(phi / 2)`, `d` the difference of longitudes
/// (`docs/math.md`, eq. 8.4 and 8.5).
fn area_below(a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let half = |p: Vector2<f64>| {
        let s = (1.0 + p.x * p.x).sqrt();
        (s, p.y / (s + (s * s + p.y * p.y).sqrt()))
    };
    let ((s_a, u_a), (s_b, u_b)) = (half(a), half(b));
    let (product, cosine) = (s_a * s_b, 1.0 + a.x * b.x);
    let tangent = if cosine >= 0.0 { (b.x - a.x) / (product + cosine) } else { (product - cosine) / (b.x - a.x) };
    2.0 * (tangent * (u_a + u_b)).atan2(1.0 + u_a * u_b)
}
