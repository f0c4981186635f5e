//! Moments of a region of the unit sphere from its boundary.
//!
//! For a homogeneous polynomial `p` of degree `k` the Laplacian of the sphere gives `lap_S p = lap p - k (k + 1) p`
//! on `|r| = 1`. Integrated over a region with arcs of unit normal `N` (the region on their left, `-N` points out):
//!
//! `k (k + 1) * integral of p dS = integral of lap p dS + sum over arcs of N . integral of grad p ds`.
//!
//! So the moments climb two degrees at a time from the solid angle and from zero, fed by the boundary sums
//! `U_e = sum over arcs of N . integral of grad r^e ds`. As `N . r = 0` on an arc, `U` of a degree follows from `U`
//! two degrees above: `U_e = sum over c of U_(e + 2 1_c)`, and only the two highest degrees are summed over arcs.

use nalgebra::Vector3;

use super::lanes::{LANES, Lanes};
use super::quadrature::{Node, gauss_legendre};
use super::{SphereMoments, sphere_count, sphere_index};

/// A unit vector from the camera's center.
pub type Bearing = Vector3<f64>;

/// Signed solid angle of a spherical triangle, in steradians (Van Oosterom and Strackee 1983).
///
/// Positive when `a, b, c` turn counter-clockwise seen from outside the sphere; in (-2 pi, 2 pi).
pub fn solid_angle([a, b, c]: &[Bearing; 3]) -> f64 {
    let triple = a.dot(&(b - a).cross(&(c - a)));
    2.0 * triple.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// Moments `integral of x^l y^m z^n dS`, `l + m + n <= order`, of the region bounded by closed `rings` of bearings.
///
/// Consecutive bearings are joined by great-circle arcs under 180 deg. Outer rings turn counter-clockwise seen from
/// outside the sphere, holes clockwise; a region turned the other way has negative moments. A region inside an open
/// half space has its solid angle in (0, 2 pi). Arcs of no length add nothing.
///
/// # Panics
/// When `order` is above [`super::MAX_ORDER`].
pub fn spherical_moments<'a>(rings: impl IntoIterator<Item = &'a [Bearing]>, order: usize) -> SphereMoments {
    let mut moments = SphereMoments::zero(order);
    match order {
        0 => fill::<0, 0, 0, 1>(rings, &mut moments),
        1 => fill::<1, 0, 1, 3>(rings, &mut moments),
        2 => fill::<2, 1, 3, 6>(rings, &mut moments),
        3 => fill::<3, 3, 6, 10>(rings, &mut moments),
        4 => fill::<4, 6, 10, 15>(rings, &mut moments),
        5 => fill::<5, 10, 15, 21>(rings, &mut moments),
        6 => fill::<6, 15, 21, 28>(rings, &mut moments),
        7 => fill::<7, 21, 28, 36>(rings, &mut moments),
        _ => fill::<8, 28, 36, 45>(rings, &mut moments),
    }
    moments
}

/// Sums over the rings' arcs, then climbs. `LOW`, `MIDDLE` and `TOP` count the monomials of degree `ORDER - 2`,
/// `ORDER - 1` and `ORDER`.
fn fill<'a, const ORDER: usize, const LOW: usize, const MIDDLE: usize, const TOP: usize>(
    rings: impl IntoIterator<Item = &'a [Bearing]>,
    moments: &mut SphereMoments,
) {
    let mut sums: Option<ArcSums<ORDER, LOW, MIDDLE, TOP>> = None;
    for ring in rings.into_iter().filter(|ring| !ring.is_empty()) {
        sums.get_or_insert_with(|| ArcSums::new(interior_direction(ring))).add_ring(ring);
    }
    if let Some(sums) = sums {
        sums.boundary_sums(moments);
        climb(moments);
    }
}

/// Length of the mean bearing under which it says too little of where the ring's inside is; 1 is all bearings equal.
const WEAK_MEAN: f64 = 0.05;

/// A direction for the fan of solid angles: the mean bearing, or for a ring around a great circle its area vector.
fn interior_direction(ring: &[Bearing]) -> Bearing {
    let sum: Bearing = ring.iter().sum();
    if sum.norm() > WEAK_MEAN * ring.len() as f64 {
        return sum.normalize();
    }
    let ends = ring.iter().skip(1).chain(&ring[..1]);
    let area: Bearing = ring.iter().zip(ends).map(|(a, b)| a.cross(b)).sum();
    area.try_normalize(0.0).unwrap_or(ring[0])
}

/// Sums over arcs: the solid angle's fan from `apex` and `U` for the two highest degrees.
struct ArcSums<const ORDER: usize, const LOW: usize, const MIDDLE: usize, const TOP: usize> {
    apex: Bearing,
    fan: [Lanes; 2],
    middle: [Lanes; MIDDLE],
    top: [Lanes; TOP],
    pending: ArcGroup,
    pending_count: usize,
}

/// A group of arcs: start, chord, and start x end, which is the arc's normal times the sine of its angle.
#[derive(Clone, Copy)]
struct ArcGroup {
    start: [Lanes; 3],
    chord: [Lanes; 3],
}

/// Squared chord up to which an arc is integrated whole: 60 deg, chord 1.
const WHOLE_ARC: f64 = 1.0 + 1e-9;

impl<const ORDER: usize, const LOW: usize, const MIDDLE: usize, const TOP: usize> ArcSums<ORDER, LOW, MIDDLE, TOP> {
    fn new(apex: Bearing) -> Self {
        let pending = ArcGroup { start: [0, 1, 2].map(|c| Lanes::splat(apex[c])), chord: [Lanes::ZERO; 3] };
        Self {
            apex,
            fan: [Lanes::splat(1.0), Lanes::ZERO],
            middle: [Lanes::ZERO; MIDDLE],
            top: [Lanes::ZERO; TOP],
            pending,
            pending_count: 0,
        }
    }

    fn add_ring(&mut self, ring: &[Bearing]) {
        let ends = ring.iter().skip(1).chain(&ring[..1]);
        for (a, b) in ring.iter().zip(ends) {
            self.add_arc(a, b);
        }
        self.add_pending();
    }

    /// Adds the arc from `a` to `b`, in halves when it is long.
    #[inline(always)]
    fn add_arc(&mut self, a: &Bearing, b: &Bearing) {
        let chord = b - a;
        if chord.norm_squared() > WHOLE_ARC {
            return self.add_halves(a, b);
        }
        for c in 0..3 {
            self.pending.start[c].0[self.pending_count] = a[c];
            self.pending.chord[c].0[self.pending_count] = chord[c];
        }
        self.pending_count += 1;
        if self.pending_count == LANES {
            self.add_pending();
        }
    }

    #[inline(never)]
    fn add_halves(&mut self, a: &Bearing, b: &Bearing) {
        if let Some(middle) = (a + b).try_normalize(0.0) {
            self.add_arc(a, &middle);
            self.add_arc(&middle, b);
        }
    }

    /// Adds the pending arcs, the group filled up with arcs of no length at the apex.
    fn add_pending(&mut self) {
        for c in 0..3 {
            for i in self.pending_count..LANES {
                self.pending.start[c].0[i] = self.apex[c];
                self.pending.chord[c].0[i] = 0.0;
            }
        }
        self.pending_count = 0;
        let arcs = self.pending;
        let normal = cross(&arcs.start, &arcs.chord);
        let chord2 = dot(&arcs.chord, &arcs.chord);
        self.turn_fan(&arcs, &normal, chord2);
        if ORDER > 0 {
            let (low, high) = arc_monomials::<ORDER, LOW, MIDDLE>(&arcs, chord2);
            if ORDER > 1 {
                add_normal_derivatives(ORDER - 1, &low, &normal, &mut self.middle);
            }
            add_normal_derivatives(ORDER, &high, &normal, &mut self.top);
        }
    }

    /// Multiplies the fan, a complex number, by each triangle's: half the solid angle is the argument.
    ///
    /// One arc tangent serves the whole ring; the factors are brought near size 1 so that no product overflows.
    #[inline(always)]
    fn turn_fan(&mut self, arcs: &ArcGroup, normal: &[Lanes; 3], chord2: Lanes) {
        let apex = [0, 1, 2].map(|c| Lanes::splat(self.apex[c]));
        let triple = dot(&apex, normal);
        let toward = dot(&apex, &arcs.start);
        let real = Lanes::splat(2.0) + toward + toward + dot(&apex, &arcs.chord) - Lanes::splat(0.5) * chord2;
        let [re, im] = self.fan;
        let (re, im) = (re * real - im * triple, re * triple + im * real);
        for i in 0..LANES {
            let size = re.0[i].abs() + im.0[i].abs();
            // An arc through the point opposite the apex has no triangle: it leaves the fan as it was.
            if size > 0.0 {
                self.fan[0].0[i] = re.0[i] / size;
                self.fan[1].0[i] = im.0[i] / size;
            }
        }
    }

    /// Writes the solid angle and the boundary sums of every degree into `moments`.
    fn boundary_sums(&self, moments: &mut SphereMoments) {
        let (re, im) = (0..LANES).fold((1.0, 0.0), |(re, im), i| {
            let (lane_re, lane_im) = (self.fan[0].0[i], self.fan[1].0[i]);
            (re * lane_re - im * lane_im, re * lane_im + im * lane_re)
        });
        let values = moments.values_mut();
        values[0] = 2.0 * im.atan2(re);
        if ORDER > 0 {
            for (value, sum) in values[sphere_count(ORDER - 1)..].iter_mut().zip(&self.top) {
                *value = sum.sum();
            }
        }
        if ORDER > 1 {
            for (value, sum) in values[sphere_count(ORDER - 2)..].iter_mut().zip(&self.middle) {
                *value = sum.sum();
            }
        }
        for k in (1..(ORDER.max(1) - 1)).rev() {
            for_each_exponent(k, |[l, m, n]| {
                values[sphere_index(l, m, n)] = values[sphere_index(l + 2, m, n)]
                    + values[sphere_index(l, m + 2, n)]
                    + values[sphere_index(l, m, n + 2)];
            });
        }
    }
}

/// Turns the boundary sums in `moments` into moments, degree by degree.
fn climb(moments: &mut SphereMoments) {
    for k in 1..=moments.order() {
        let values = moments.values_mut();
        for_each_exponent(k, |[l, m, n]| {
            let mut sum = values[sphere_index(l, m, n)];
            if l > 1 {
                sum += (l * (l - 1)) as f64 * values[sphere_index(l - 2, m, n)];
            }
            if m > 1 {
                sum += (m * (m - 1)) as f64 * values[sphere_index(l, m - 2, n)];
            }
            if n > 1 {
                sum += (n * (n - 1)) as f64 * values[sphere_index(l, m, n - 2)];
            }
            values[sphere_index(l, m, n)] = sum / (k * (k + 1)) as f64;
        });
    }
}

/// Calls `f` with the exponents of degree `k`, in the order of [`sphere_index`].
fn for_each_exponent(k: usize, mut f: impl FnMut([usize; 3])) {
    for p in 0..=k {
        for n in 0..=p {
            f([k - p, p - n, n]);
        }
    }
}

/// Largest squared chord for which 3, 4, ... nodes integrate an arc's monomials to 1e-13 of its length.
const NODE_CHORDS: [f64; 10] = [1e-3, 0.01, 0.03, 0.08, 0.15, 0.25, 0.4, 0.6, 0.8, 1.0];

static NODES_3: [Node; 3] = gauss_legendre();
static NODES_4: [Node; 4] = gauss_legendre();
static NODES_5: [Node; 5] = gauss_legendre();
static NODES_6: [Node; 6] = gauss_legendre();
static NODES_7: [Node; 7] = gauss_legendre();
static NODES_8: [Node; 8] = gauss_legendre();
static NODES_9: [Node; 9] = gauss_legendre();
static NODES_10: [Node; 10] = gauss_legendre();
static NODES_11: [Node; 11] = gauss_legendre();
static NODES_12: [Node; 12] = gauss_legendre();

/// The rule for arcs of a squared chord.
fn arc_rule(chord2: f64) -> &'static [Node] {
    let rules: [&'static [Node]; 10] = [
        &NODES_3, &NODES_4, &NODES_5, &NODES_6, &NODES_7, &NODES_8, &NODES_9, &NODES_10, &NODES_11, &NODES_12,
    ];
    rules[NODE_CHORDS.partition_point(|&limit| limit < chord2).min(rules.len() - 1)]
}

/// Arc monomials `integral of r^e ds / |A x B|` of degree `ORDER - 2` and `ORDER - 1`.
///
/// On the chord `P(s) = A + s (B - A)`: `r = P / |P|` and `ds = |A x B| / |P|^2` of the parameter's.
#[inline(always)]
fn arc_monomials<const ORDER: usize, const LOW: usize, const MIDDLE: usize>(
    arcs: &ArcGroup,
    chord2: Lanes,
) -> ([Lanes; LOW], [Lanes; MIDDLE]) {
    let mut low = [Lanes::ZERO; LOW];
    let mut middle = [Lanes::ZERO; MIDDLE];
    let longest = chord2.0.iter().copied().fold(0.0, f64::max);
    for &(s, weight) in arc_rule(longest) {
        let point = [0, 1, 2].map(|c| arcs.start[c] + Lanes::splat(s) * arcs.chord[c]);
        let norm2 = dot(&point, &point);
        let scale = norm2.map(|value| 1.0 / value.sqrt());
        let [x, y, z] = point.map(|coordinate| coordinate * scale);
        let mut terms = [Lanes::ZERO; MIDDLE];
        terms[0] = Lanes::splat(weight) * scale * scale;
        for k in 1..=ORDER {
            let count = k * (k + 1) / 2;
            if k + 1 == ORDER {
                for i in 0..count {
                    low[i] += terms[i];
                }
            }
            if k == ORDER {
                for i in 0..count {
                    middle[i] += terms[i];
                }
                break;
            }
            let last_row = k * (k - 1) / 2;
            for n in 0..k {
                terms[count + n] = terms[last_row + n] * y;
            }
            terms[count + k] = terms[count - 1] * z;
            for term in &mut terms[..count] {
                *term = *term * x;
            }
        }
    }
    (low, middle)
}

/// Adds `normal . grad r^e`, `|e| = degree`, given the monomials of one degree less.
#[inline(always)]
fn add_normal_derivatives(degree: usize, monomials: &[Lanes], normal: &[Lanes; 3], into: &mut [Lanes]) {
    for p in 0..=degree {
        for n in 0..=p {
            let (l, m) = (degree - p, p - n);
            let index = p * (p + 1) / 2 + n;
            let mut sum = into[index];
            if l > 0 {
                sum += Lanes::splat(l as f64) * normal[0] * monomials[index];
            }
            if m > 0 {
                sum += Lanes::splat(m as f64) * normal[1] * monomials[index - p];
            }
            if n > 0 {
                sum += Lanes::splat(n as f64) * normal[2] * monomials[index - p - 1];
            }
            into[index] = sum;
        }
    }
}

#[inline(always)]
fn dot(a: &[Lanes; 3], b: &[Lanes; 3]) -> Lanes {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
