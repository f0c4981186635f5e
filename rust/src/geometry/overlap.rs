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
//!
//! Below an edge lies what the sum over all edges of the other region above it counts there, of which those of a part of a ring
//! that is above it as a whole leave the ends of that part. So no list of pairs is kept, and few pairs are evaluated.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Add;

use crate::budget;
use crate::geometry::ring_parts::{Edge, Part, Parts, Point, Visitor, greater, lesser, sign};
use crate::geometry::rings::PlaneRings;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Room around a part of a ring, as a share of the largest coordinate: more than heights are rounded by.
const ROUNDING: f64 = 1e-9;

/// Cost of a segment, in edge evaluations: the half angle below it.
const EDGES_OF_SEGMENT: usize = 2;

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
/// and parts of rings that it evaluates (`budget`).
///
/// Each is right to about 1e-15 of the region's extent as an angle, times its greatest coordinate where that is above one, and
/// never negative.
pub fn overlap_areas(observed: &PlaneRings, predicted: &PlaneRings) -> OverlapAreas {
    let (first, second) = (Parts::of(observed.rings()), Parts::of(predicted.rings()));
    let (first_area, second_area) = (Segments::of(&first).area(), Segments::of(&second).area());
    let intersection = common_area(&first, &second).clamp(0.0, first_area.min(second_area).max(0.0));
    OverlapAreas {
        intersection,
        only_observed: (first_area - intersection).max(0.0),
        only_predicted: (second_area - intersection).max(0.0),
    }
}

/// Sum over all pairs of edges that share some x, of one region each.
fn common_area(first: &Parts, second: &Parts) -> f64 {
    let mut lower = Segments::default();
    lower.add_below(first, second, true);
    lower.add_below(second, first, false);
    lower.area()
}

/// Parts of edges from left to right, each with the sign of the area below it.
#[derive(Default)]
struct Segments(Vec<([Point; 2], f64)>);

impl Segments {
    /// All of a region's edges; vertical ones bound no area below them.
    fn of(region: &Parts) -> Self {
        let edges = region.edges().iter().map(|edge| (edge.ends, f64::from(edge.sign)));
        let mut segments = Vec::with_capacity(edges.len());
        segments.extend(edges.filter(|(_, sign)| *sign != 0.0));
        Self(segments)
    }

    /// Adds what of the edges of a region is the lower one with the edges of another region, as often as it is; with `ties` also
    /// where both are the same.
    fn add_below(&mut self, region: &Parts, other: &Parts, ties: bool) {
        let room = ROUNDING * region.largest().max(other.largest());
        let (mut steps, mut evaluated) = (Vec::new(), 0);
        self.0.reserve(region.edges().len());
        for edge in region.edges().iter().filter(|edge| edge.sign != 0) {
            let mut below = Below::new(edge, ties, room, steps);
            evaluated += other.visit(&mut below);
            steps = below.steps;
            self.add_steps(edge, &mut steps);
        }
        budget::charge(evaluated + EDGES_OF_SEGMENT * self.0.len());
    }

    /// Adds an edge as often as the sum of steps along it requires, and empties the steps.
    fn add_steps(&mut self, edge: &Edge, steps: &mut Vec<(f64, i32)>) {
        let ends = edge.ends;
        steps.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let (mut count, mut begun) = (0_i32, 0.0);
        for at_place in steps.chunk_by(|a, b| a.0 == b.0) {
            let (x, step) = (at_place[0].0, at_place.iter().map(|(_, step)| step).sum::<i32>());
            if step == 0 {
                continue;
            }
            let segment = ([begun, x].map(|x| [x, y_at(&ends, x)]), f64::from(count.signum() * edge.sign));
            self.0.extend((0..count.abs()).map(|_| segment));
            (count, begun) = (count + step, x);
        }
        steps.clear();
    }

    /// The signed solid angle below all segments, clamped from 0 to 2 pi against rounding.
    fn area(&self) -> f64 {
        let (re, im) = vectorized(HalfAngles(&self.0));
        let half = im.atan2(re);
        2.0 * if half < -FRAC_PI_2 { half + TAU } else { half }
    }
}

/// The y of an edge at an x from its left end to its right one.
fn y_at([left, right]: &[Point; 2], x: f64) -> f64 {
    if x == right[0] { right[1] } else { left[1] + (x - left[0]) / (right[0] - left[0]) * (right[1] - left[1]) }
}

/// An edge, and where others lie above it.
struct Below {
    edge: [Point; 2],
    /// Whether edges that lie where it does count as above it.
    ties: bool,
    /// The y below and above which a part of a ring lies on one side of it for certain.
    low: f64,
    high: f64,
    /// From the left end of the edge to its right one.
    step: Point,
    /// How far from its line a part lies on one side for certain, times at least its length.
    far: f64,
    /// Where the sum of the signs of the edges above changes, and by how much.
    steps: Vec<(f64, i32)>,
}

impl Below {
    fn new(edge: &Edge, ties: bool, room: f64, steps: Vec<(f64, i32)>) -> Self {
        let [left, right] = edge.ends;
        let step = [right[0] - left[0], right[1] - left[1]];
        let (low, high) = (lesser(left[1], right[1]) - room, greater(left[1], right[1]) + room);
        Self { edge: [left, right], ties, low, high, step, far: room * (step[0] + step[1].abs()), steps }
    }

    /// Adds a path from one x to another that lies above, as far as the edge goes.
    fn add(&mut self, path: [f64; 2]) {
        let [left, right] = [self.edge[0][0], self.edge[1][0]];
        let (from, to) = (greater(lesser(path[0], path[1]), left), lesser(greater(path[0], path[1]), right));
        if from < to {
            self.steps.extend([(from, sign(path)), (to, -sign(path))]);
        }
    }

    /// Whether a part may lie on either side of the edge; adds it where it is above.
    fn lies_beside(&mut self, part: &Part) -> bool {
        let mut is_above = part.low[1] > self.high;
        if !is_above {
            let [least, most] = self.sides(part);
            if most < -self.far {
                return false;
            }
            is_above = least > self.far;
        }
        if is_above {
            part.paths.into_iter().for_each(|path| self.add(path));
        }
        !is_above
    }

    /// Adds what of another edge lies above between two x.
    fn compare(&mut self, other: &Edge, from: f64, to: f64) {
        let gap = |x: f64| y_at(&other.ends, x) - y_at(&self.edge, x);
        let (begin, end) = (gap(from), gap(to));
        // The other edge finds the same gaps, negative ones, and the same place between.
        let cross = || from + (to - from) * (begin / (begin - end));
        let path = match (begin > 0.0, end > 0.0) {
            _ if begin >= 0.0 && end >= 0.0 && (self.ties || begin > 0.0 || end > 0.0) => [from, to],
            (true, _) => [from, cross()],
            (_, true) => [cross(), to],
            _ => return,
        };
        self.add(if other.sign > 0 { [path[1], path[0]] } else { path });
    }

    /// How far the corners of a part lie from the edge's line at least and at most, above it being positive, times its length.
    fn sides(&self, part: &Part) -> [f64; 2] {
        let [left, _] = self.edge;
        let side = |point: Point| self.step[0] * (point[1] - left[1]) - self.step[1] * (point[0] - left[0]);
        let [a, b, c, d] = part.corners.map(side);
        [lesser(lesser(a, b), lesser(c, d)), greater(greater(a, b), greater(c, d))]
    }
}

impl Visitor for Below {
    #[inline(always)]
    fn enters(&mut self, part: &Part) -> bool {
        let [left, right] = self.edge;
        part.low[0] < right[0] && part.high[0] > left[0] && part.high[1] >= self.low && self.lies_beside(part)
    }

    #[inline(always)]
    fn meets(&mut self, other: &Edge) {
        let [left, right] = other.ends;
        let (from, to) = (greater(left[0], self.edge[0][0]), lesser(right[0], self.edge[1][0]));
        // The comparison fails for vertical edges, too.
        if from < to {
            self.compare(other, from, to);
        }
    }
}

/// The product of complex numbers whose arguments are half the solid angles below segments (`docs/math.md`, eq. 8.6).
struct HalfAngles<'a>(&'a [([Point; 2], f64)]);

impl NullaryFnOnce for HalfAngles<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn call(self) -> (f64, f64) {
        let (mut re, mut im) = (Lanes::splat(1.0), Lanes::ZERO);
        for segments in self.0.chunks(LANES) {
            // A lane without a segment has one without any length.
            let (mut signs, mut left, mut right) = (Lanes::ZERO, [Lanes::ZERO; 2], [Lanes::ZERO; 2]);
            for (lane, ([from, to], sign)) in segments.iter().enumerate() {
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
