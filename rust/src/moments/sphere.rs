//! Moments of a region of the unit sphere from its boundary.
//!
//! For a homogeneous polynomial `p` of degree `k` the Laplacian of the sphere gives `lap_S p = lap p - k (k + 1) p`
//! on `|r| = 1`. Integrated over a region with arcs of unit normal `N` (the region on their left, `-N` points out):
//!
//! `k (k + 1) * integral of p dS = integral of lap p dS + U(p)`, `U(p) = sum over arcs of N . integral of grad p ds`.
//!
//! So the moments climb two degrees at a time from the solid angle and from zero, fed by the boundary sums `U` of all
//! monomials (`docs/math.md`, eq. 3.3 and 3.4). `r . r = 1` and `N . r = 0` on an arc give
//! `U(z^2 p) = U(p) - U(x^2 p) - U(y^2 p)`: only the monomials `x^i y^j` and `x^i y^j z` are summed over arcs
//! (`docs/math.md`, eq. 3.6).

use nalgebra::Vector3;

use super::quadrature::{Node, gauss_legendre};
use super::{MAX_ORDER, SphereMoments, plane_index, sphere_index};
use crate::math::lanes::{LANES, Lanes};

/// A unit vector from the camera's center.
pub type Bearing = Vector3<f64>;

/// Signed solid angle of a spherical triangle, in steradians (Van Oosterom and Strackee 1983; `docs/math.md`, eq. 3.8).
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
        0 => fill::<0, 0, 0, 0>(rings, &mut moments),
        1 => fill::<1, 3, 1, 0>(rings, &mut moments),
        2 => fill::<2, 6, 3, 1>(rings, &mut moments),
        3 => fill::<3, 10, 6, 3>(rings, &mut moments),
        4 => fill::<4, 15, 10, 6>(rings, &mut moments),
        5 => fill::<5, 21, 15, 10>(rings, &mut moments),
        6 => fill::<6, 28, 21, 15>(rings, &mut moments),
        7 => fill::<7, 36, 28, 21>(rings, &mut moments),
        _ => fill::<8, 45, 36, 28>(rings, &mut moments),
    }
    moments
}

/// Sums over the rings' arcs, then climbs. `FLAT`, `LESS` and `LEAST` count the monomials `x^i y^j` up to degree
/// `ORDER`, `ORDER - 1` and `ORDER - 2`.
fn fill<'a, const ORDER: usize, const FLAT: usize, const LESS: usize, const LEAST: usize>(
    rings: impl IntoIterator<Item = &'a [Bearing]>,
    moments: &mut SphereMoments,
) {
    let mut sums: Option<ArcSums<ORDER, FLAT, LESS, LEAST>> = None;
    for ring in rings.into_iter().filter(|ring| !ring.is_empty()) {
        sums.get_or_insert_with(|| ArcSums::new(interior_direction(ring))).add_ring(ring);
    }
    if let Some(sums) = sums {
        sums.boundary_sums(moments);
        moments.values_mut()[0] = sums.solid_angle();
        climb(moments);
    }
}

/// Length of the mean bearing below which it does not determine the ring's inside; 1 is all bearings equal.
const WEAK_MEAN: f64 = 0.05;

/// A direction for the fan of solid angles: the mean bearing, or for a ring around a great circle its area vector.
fn interior_direction(ring: &[Bearing]) -> Bearing {
    let sum: Bearing = ring.iter().sum();
    if sum.norm() > WEAK_MEAN * ring.len() as f64 {
        return sum.normalize();
    }
    let ends = ring.iter().skip(1).chain(ring.first());
    let area: Bearing = ring.iter().zip(ends).map(|(a, b)| a.cross(b)).sum();
    area.try_normalize(0.0).unwrap_or(ring[0])
}

/// Sums over arcs: the fan of solid angles from `apex`, and `U / (i! j!)` of `x^i y^j` and of `x^i y^j z`.
struct ArcSums<const ORDER: usize, const FLAT: usize, const LESS: usize, const LEAST: usize> {
    apex: Bearing,
    fan: [Lanes; 2],
    flat: [Lanes; FLAT],
    with_z: [Lanes; LESS],
}

/// Starts and chords (end - start) of a group of arcs.
struct ArcGroup {
    start: [Lanes; 3],
    chord: [Lanes; 3],
}

/// Squared chord up to which an arc is integrated whole: 60 deg, chord 1, and rounding.
const WHOLE_ARC: f64 = 1.0 + 1e-9;

/// Times an arc under 180 deg is halved until it is whole.
const HALVINGS: usize = 2;

impl<const ORDER: usize, const FLAT: usize, const LESS: usize, const LEAST: usize> ArcSums<ORDER, FLAT, LESS, LEAST> {
    fn new(apex: Bearing) -> Self {
        let fan = [Lanes::splat(1.0), Lanes::ZERO];
        Self { apex, fan, flat: [Lanes::ZERO; FLAT], with_z: [Lanes::ZERO; LESS] }
    }

    fn add_ring(&mut self, ring: &[Bearing]) {
        let mut first = 0;
        while first < ring.len() {
            let arcs = self.arc_group(ring, first);
            let chord2 = dot(&arcs.chord, &arcs.chord);
            if chord2.max() <= WHOLE_ARC {
                self.add_group(&arcs, chord2);
            } else {
                let ends = ring[first..].iter().skip(1).chain(ring.first());
                ring[first..].iter().zip(ends).take(LANES).for_each(|(a, b)| self.add_arc(a, b, HALVINGS));
            }
            first += LANES;
        }
    }

    /// The arcs from bearing `first` on; past the ring's last one come arcs of no length at the apex.
    #[inline(always)]
    fn arc_group(&self, ring: &[Bearing], first: usize) -> ArcGroup {
        let mut start = [0, 1, 2].map(|c| Lanes::splat(self.apex[c]));
        let mut end = start;
        if let Some(bearings) = ring.get(first..first + LANES + 1) {
            for i in 0..LANES {
                for c in 0..3 {
                    start[c].0[i] = bearings[i][c];
                    end[c].0[i] = bearings[i + 1][c];
                }
            }
        } else {
            let ends = ring[first..].iter().skip(1).chain(ring.first());
            for (i, (a, b)) in ring[first..].iter().zip(ends).enumerate() {
                for c in 0..3 {
                    start[c].0[i] = a[c];
                    end[c].0[i] = b[c];
                }
            }
        }
        ArcGroup { start, chord: [0, 1, 2].map(|c| end[c] - start[c]) }
    }

    /// Adds the arc from `a` to `b`, in halves while it is long.
    fn add_arc(&mut self, a: &Bearing, b: &Bearing, halvings: usize) {
        if halvings > 0 && (b - a).norm_squared() > WHOLE_ARC {
            if let Some(middle) = (a + b).try_normalize(0.0) {
                self.add_arc(a, &middle, halvings - 1);
                self.add_arc(&middle, b, halvings - 1);
            }
            return;
        }
        let mut arcs = self.arc_group(&[], 0);
        for c in 0..3 {
            arcs.start[c].0[0] = a[c];
            arcs.chord[c].0[0] = b[c] - a[c];
        }
        let chord2 = dot(&arcs.chord, &arcs.chord);
        self.add_group(&arcs, chord2);
    }

    #[inline(always)]
    fn add_group(&mut self, arcs: &ArcGroup, chord2: Lanes) {
        let normal = cross(&arcs.start, &arcs.chord);
        self.turn_fan(arcs, &normal, chord2);
        if ORDER == 0 {
            return;
        }
        let mut monomials = ArcMonomials { flat: [Lanes::ZERO; LESS], with_z: [Lanes::ZERO; LEAST] };
        let longest = chord2.max();
        if longest <= THREE_NODES {
            monomials.add_nodes::<ORDER, 3>(arcs, &const { gauss_legendre::<3>() });
        } else if longest <= BLOCK_LIMITS[0] {
            monomials.add_nodes::<ORDER, BLOCK>(arcs, &const { gauss_legendre::<BLOCK>() });
        } else {
            for block in block_rule(longest) {
                monomials.add_nodes::<ORDER, BLOCK>(arcs, block);
            }
        }
        self.add_normal_derivatives(&monomials, &normal);
    }

    /// Multiplies the fan, a complex number, by each triangle's: half the solid angle is the argument
    /// (`docs/math.md`, eq. 3.9).
    ///
    /// One arc tangent then serves all rings; the product is kept near size 1 so that it can't overflow.
    #[inline(always)]
    fn turn_fan(&mut self, arcs: &ArcGroup, normal: &[Lanes; 3], chord2: Lanes) {
        let apex = [0, 1, 2].map(|c| Lanes::splat(self.apex[c]));
        let triple = dot(&apex, normal);
        let toward = dot(&apex, &arcs.start);
        let mut real = Lanes::splat(2.0) + toward + toward + dot(&apex, &arcs.chord) - Lanes::splat(0.5) * chord2;
        // An arc through the point opposite the apex has no triangle: it must not wipe out the fan.
        for i in 0..LANES {
            real.0[i] = if real.0[i] == 0.0 && triple.0[i] == 0.0 { 1.0 } else { real.0[i] };
        }
        let [re, im] = self.fan;
        let (re, im) = (re * real - im * triple, re * triple + im * real);
        let inverse = (re.map(f64::abs) + im.map(f64::abs)).map(|size| 1.0 / size);
        self.fan = [re * inverse, im * inverse];
    }

    /// Adds `normal . grad` of every monomial: `d/dx` of `x^i / i!` is `x^(i-1) / (i-1)!`.
    #[inline(always)]
    fn add_normal_derivatives(&mut self, monomials: &ArcMonomials<LESS, LEAST>, normal: &[Lanes; 3]) {
        for k in 0..ORDER {
            for j in 0..=k {
                let (at, right) = (plane_index(k - j, j), plane_index(k - j + 1, j));
                let flat = monomials.flat[at];
                self.flat[right] += normal[0] * flat;
                self.flat[right + 1] += normal[1] * flat;
                self.with_z[at] += normal[2] * flat;
                if k + 1 < ORDER {
                    let with_z = monomials.with_z[at];
                    self.with_z[right] += normal[0] * with_z;
                    self.with_z[right + 1] += normal[1] * with_z;
                }
            }
        }
    }

    /// The solid angle of the fan, in (-2 pi, 2 pi].
    fn solid_angle(&self) -> f64 {
        let [re, im] = self.fan;
        let product = (0..LANES).fold((1.0, 0.0), |product: (f64, f64), i| {
            (product.0 * re.0[i] - product.1 * im.0[i], product.0 * im.0[i] + product.1 * re.0[i])
        });
        2.0 * product.1.atan2(product.0)
    }

    /// Writes `U` of every monomial into `moments`.
    fn boundary_sums(&self, moments: &mut SphereMoments) {
        let values = moments.values_mut();
        for k in 1..=ORDER {
            for j in 0..=k {
                let i = k - j;
                values[sphere_index(i, j, 0)] = self.flat[plane_index(i, j)].sum() / INVERSE_FACTORIAL[i][j];
                if j < k {
                    let at = plane_index(i - 1, j);
                    values[sphere_index(i - 1, j, 1)] = self.with_z[at].sum() / INVERSE_FACTORIAL[i - 1][j];
                }
            }
        }
        for n in 2..=ORDER {
            for k in 0..=ORDER - n {
                for m in 0..=k {
                    let l = k - m;
                    values[sphere_index(l, m, n)] = values[sphere_index(l, m, n - 2)]
                        - values[sphere_index(l + 2, m, n - 2)]
                        - values[sphere_index(l, m + 2, n - 2)];
                }
            }
        }
    }
}

/// Turns the boundary sums in `moments`, and the solid angle in their first place, into moments, degree by degree
/// (`docs/math.md`, eq. 3.4).
fn climb(moments: &mut SphereMoments) {
    let order = moments.order();
    let values = moments.values_mut();
    for k in 1..=order {
        for p in 0..=k {
            for n in 0..=p {
                let exponents = [k - p, p - n, n];
                let mut sum = values[sphere_index(k - p, p - n, n)];
                for c in 0..3 {
                    if exponents[c] > 1 {
                        let mut lower = exponents;
                        lower[c] -= 2;
                        let factor = (exponents[c] * (exponents[c] - 1)) as f64;
                        sum += factor * values[sphere_index(lower[0], lower[1], lower[2])];
                    }
                }
                values[sphere_index(k - p, p - n, n)] = sum / (k * (k + 1)) as f64;
            }
        }
    }
}

/// `1 / (i! j!)`, exact but for its last rounding.
const INVERSE_FACTORIAL: [[f64; MAX_ORDER + 1]; MAX_ORDER + 1] = inverse_factorials();

const fn inverse_factorials() -> [[f64; MAX_ORDER + 1]; MAX_ORDER + 1] {
    let mut factorial = [1.0; MAX_ORDER + 1];
    let mut i = 1;
    while i <= MAX_ORDER {
        factorial[i] = factorial[i - 1] * i as f64;
        i += 1;
    }
    let mut table = [[0.0; MAX_ORDER + 1]; MAX_ORDER + 1];
    let mut index = 0;
    while index < (MAX_ORDER + 1) * (MAX_ORDER + 1) {
        let (i, j) = (index / (MAX_ORDER + 1), index % (MAX_ORDER + 1));
        table[i][j] = 1.0 / (factorial[i] * factorial[j]);
        index += 1;
    }
    table
}

/// Nodes worked on together on arcs too long for 3.
const BLOCK: usize = 4;

/// Largest squared chord that 3 nodes serve: 1e-13 of the arc's length in every monomial to order 8, as measured.
const THREE_NODES: f64 = 2.2e-4;

/// The same for 4, 8 and 12 nodes; 16 serve up to [`WHOLE_ARC`].
const BLOCK_LIMITS: [f64; 3] = [3.0e-3, 0.17, 0.67];

static NODES_4: [[Node; BLOCK]; 1] = in_blocks(gauss_legendre::<4>());
static NODES_8: [[Node; BLOCK]; 2] = in_blocks(gauss_legendre::<8>());
static NODES_12: [[Node; BLOCK]; 3] = in_blocks(gauss_legendre::<12>());
static NODES_16: [[Node; BLOCK]; 4] = in_blocks(gauss_legendre::<16>());

const fn in_blocks<const N: usize, const BLOCKS: usize>(rule: [Node; N]) -> [[Node; BLOCK]; BLOCKS] {
    let mut blocks = [[(0.0, 0.0); BLOCK]; BLOCKS];
    let mut i = 0;
    while i < N {
        blocks[i / BLOCK][i % BLOCK] = rule[i];
        i += 1;
    }
    blocks
}

/// The rule for arcs up to a squared chord.
fn block_rule(longest: f64) -> &'static [[Node; BLOCK]] {
    match BLOCK_LIMITS.iter().position(|&limit| longest <= limit) {
        Some(0) => &NODES_4,
        Some(1) => &NODES_8,
        Some(2) => &NODES_12,
        _ => &NODES_16,
    }
}

/// Integrals over arcs of `x^i y^j / (i! j!)` and of `x^i y^j z / (i! j!)`, `ds` in units of |start x end|.
struct ArcMonomials<const LESS: usize, const LEAST: usize> {
    flat: [Lanes; LESS],
    with_z: [Lanes; LEAST],
}

impl<const LESS: usize, const LEAST: usize> ArcMonomials<LESS, LEAST> {
    /// Adds some nodes of the rule: on the chord `P(s)`, `r = P / |P|` and `ds = |start x end| / |P|^2` of `s`
    /// (`docs/math.md`, eq. 3.7).
    #[inline(always)]
    fn add_nodes<const ORDER: usize, const NODES: usize>(&mut self, arcs: &ArcGroup, nodes: &[Node; NODES]) {
        let mut r = [[Lanes::ZERO; NODES]; 3];
        let mut weights = [Lanes::ZERO; NODES];
        for (g, &(s, weight)) in nodes.iter().enumerate() {
            let point = [0, 1, 2].map(|c| arcs.start[c] + Lanes::splat(s) * arcs.chord[c]);
            let inverse2 = dot(&point, &point).map(|norm2| 1.0 / norm2);
            let inverse = inverse2.map(f64::sqrt);
            for c in 0..3 {
                r[c][g] = point[c] * inverse;
            }
            weights[g] = Lanes::splat(weight) * inverse2;
        }
        let [x, y, z] = r;
        add_powers(ORDER, weights, &x, &y, &mut self.flat);
        if ORDER > 1 {
            for g in 0..NODES {
                weights[g] = weights[g] * z[g];
            }
            add_powers(ORDER - 1, weights, &x, &y, &mut self.with_z);
        }
    }
}

/// Adds the sum over nodes of `row x^i y^j / (i! j!)`, `i + j < order`.
#[inline(always)]
fn add_powers<const NODES: usize>(
    order: usize,
    mut row: [Lanes; NODES],
    x: &[Lanes; NODES],
    y: &[Lanes; NODES],
    into: &mut [Lanes],
) {
    for j in 0..order {
        let mut term = row;
        for i in 0..order - j {
            let mut sum = term[0];
            for other in &term[1..] {
                sum += *other;
            }
            into[plane_index(i, j)] += Lanes::splat(INVERSE_FACTORIAL[i][j]) * sum;
            for g in 0..NODES {
                term[g] = term[g] * x[g];
            }
        }
        for g in 0..NODES {
            row[g] = row[g] * y[g];
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
