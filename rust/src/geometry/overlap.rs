//! The paper's overlap error between two regions of a chart, exact for straight edges.
//!
//! Both regions lie in one gnomonic chart: a point `(x, y)` is the bearing along `(x, y, 1)`, a straight edge an arc of
//! a great circle. Areas are solid angles, so the error is the same in every chart and for every central camera.

use std::cmp::Ordering;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Add;

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::geometry::clipping::intersection;
use crate::geometry::rings::{PlaneRings, ring_edges};
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Cost of the half angle below an edge, in edge evaluations.
const EDGES_OF_HALF_ANGLE: usize = 2;

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

/// Solid angles of the intersection and the two differences of regions in the same chart `z = 1`, in steradians; charges the edges
/// that it evaluates.
///
/// Each is right to about 1e-15 of the region's extent as an angle, times its greatest coordinate where that is above one, and
/// never negative.
pub fn overlap_areas(observed: &PlaneRings, predicted: &PlaneRings, budget: &Budget) -> OverlapAreas {
    let shared = intersection(observed.rings(), predicted.rings(), budget).rings;
    let [first_area, second_area] = [observed, predicted].map(|region| solid_angle(region.rings(), budget));
    let intersection = solid_angle(&shared, budget).clamp(0.0, first_area.min(second_area).max(0.0));
    OverlapAreas {
        intersection,
        only_observed: (first_area - intersection).max(0.0),
        only_predicted: (second_area - intersection).max(0.0),
    }
}

/// Solid angle of a region of the chart, up to a hemisphere, clamped from 0 to 2 pi against rounding: with `s_e = +1` for an edge
/// that has its region below and `-1` for one that has it above, the sum over edges of `s_e` times the area below them.
fn solid_angle(rings: &[Vec<Vector2<f64>>], budget: &Budget) -> f64 {
    // From left to right; vertical edges bound no area below them.
    let below = |(a, b): (Vector2<f64>, Vector2<f64>)| match a.x.total_cmp(&b.x) {
        Ordering::Less => Some(([a, b], -1.0)),
        Ordering::Equal => None,
        Ordering::Greater => Some(([b, a], 1.0)),
    };
    let edges: Vec<_> = rings.iter().flat_map(|ring| ring_edges(ring)).filter_map(below).collect();
    budget.charge(EDGES_OF_HALF_ANGLE * edges.len());
    let (re, im) = vectorized(HalfAngles(&edges));
    let half = im.atan2(re);
    2.0 * if half < -FRAC_PI_2 { half + TAU } else { half }
}

/// The product of complex numbers whose arguments are half the solid angles below edges, given from left to right and with the sign
/// of each (`docs/math.md`, eq. 8.6).
struct HalfAngles<'a>(&'a [([Vector2<f64>; 2], f64)]);

impl NullaryFnOnce for HalfAngles<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn call(self) -> (f64, f64) {
        let (mut re, mut im) = (Lanes::splat(1.0), Lanes::ZERO);
        for edges in self.0.chunks(LANES) {
            // A lane without an edge has one without any length.
            let (mut signs, mut left, mut right) = (Lanes::ZERO, [Lanes::ZERO; 2], [Lanes::ZERO; 2]);
            for (lane, ([from, to], sign)) in edges.iter().enumerate() {
                signs.0[lane] = *sign;
                for axis in 0..2 {
                    (left[axis].0[lane], right[axis].0[lane]) = (from[axis], to[axis]);
                }
            }
            let (left, right) = (Ends::at(left[0], left[1]), Ends::at(right[0], right[1]));
            let (real, imaginary) = half_angle(signs, &left, &right);
            (re, im) = (re * real - im * imaginary, re * imaginary + im * real);
            // Kept near size 1, so that it neither overflows nor vanishes.
            let inverse = (re.map(f64::abs) + im.map(f64::abs)).map(|size| 1.0 / size);
            (re, im) = (re * inverse, im * inverse);
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
