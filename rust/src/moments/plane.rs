//! Moments of a region of the plane from its boundary: exact sums over edges (paper section 2.2; no mesh).

use nalgebra::Vector2;

use super::quadrature::{Node, gauss_legendre};
use super::{MAX_ORDER, PlaneMoments, plane_count, plane_index};
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Moments `integral of x^i y^j dA`, `i + j <= order`, of the region bounded by closed `rings`.
///
/// Outer rings turn counter-clockwise, holes clockwise; a region turned the other way has negative moments. The
/// integration runs about a point of the region and is then shifted, so that a region far from the origin keeps
/// its digits: errors stay near rounding of the largest moment.
///
/// # Panics
/// When `order` is above [`super::MAX_ORDER`].
pub fn planar_moments<'a>(rings: impl IntoIterator<Item = &'a [Vector2<f64>]>, order: usize) -> PlaneMoments {
    let mut about_center = PlaneMoments::zero(order);
    let mut center = None;
    for ring in rings.into_iter().filter(|ring| !ring.is_empty()) {
        let origin = *center.get_or_insert_with(|| ring.iter().sum::<Vector2<f64>>() / ring.len() as f64);
        let centered: Vec<_> = ring.iter().map(|vertex| vertex - origin).collect();
        ring_moments(&centered, order, &mut about_center);
    }
    about_center.shifted(center.unwrap_or_default())
}

/// Adds the signed moments of one closed ring, whose last vertex joins the first, to `into`.
///
/// With `a x b` the cross product of an edge's ends, `k = i + j`:
/// `M_ij = 1 / (k + 2) * sum over edges of (a x b) * integral_0^1 x(s)^i y(s)^j ds`, by the fewest Gauss-Legendre nodes
/// that are exact (`docs/math.md`, eq. 2.3). Meant for rings near the origin; [`planar_moments`] serves the others.
/// `order` is at most that of `into`, whose higher moments stay as they are.
pub fn ring_moments(ring: &[Vector2<f64>], order: usize, into: &mut PlaneMoments) {
    if !ring.is_empty() {
        vectorized(RingMoments { vertices: &mut Flat(ring), order, into });
    }
}

/// The vertices of a closed ring, group by group; past the last one comes the first again, so that the edges there add nothing.
pub(crate) trait VertexGroups {
    /// Number of groups, one at least.
    fn count(&self) -> usize;

    /// Coordinates of the vertices in a group.
    fn group(&mut self, index: usize) -> [Lanes; 2];
}

/// Vertices one after another.
struct Flat<'a>(&'a [Vector2<f64>]);

impl VertexGroups for Flat<'_> {
    #[inline(always)]
    fn count(&self) -> usize {
        self.0.len().div_ceil(LANES)
    }

    #[inline(always)]
    fn group(&mut self, index: usize) -> [Lanes; 2] {
        let mut vertices = [self.0[0]; LANES];
        let rest = &self.0[index * LANES..];
        let count = rest.len().min(LANES);
        vertices[..count].copy_from_slice(&rest[..count]);
        [Lanes(vertices.map(|v| v.x)), Lanes(vertices.map(|v| v.y))]
    }
}

/// Adds the signed moments of one closed ring to `into`, as [`ring_moments`].
pub(crate) struct RingMoments<'a, V> {
    pub(crate) vertices: &'a mut V,
    pub(crate) order: usize,
    pub(crate) into: &'a mut PlaneMoments,
}

impl<V: VertexGroups> NullaryFnOnce for RingMoments<'_, V> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { vertices, order, into } = self;
        let sums = into.values_mut();
        match order {
            0 => add_edges::<0, 1, 1>(vertices, sums),
            1 => add_edges::<1, 1, 3>(vertices, sums),
            2 => add_edges::<2, 2, 6>(vertices, sums),
            3 => add_edges::<3, 2, 10>(vertices, sums),
            4 => add_edges::<4, 3, 15>(vertices, sums),
            5 => add_edges::<5, 3, 21>(vertices, sums),
            6 => add_edges::<6, 4, 28>(vertices, sums),
            7 => add_edges::<7, 4, 36>(vertices, sums),
            _ => add_edges::<8, 5, 45>(vertices, sums),
        }
    }
}

/// Adds the boundary sums of a ring for all `COUNT` monomials up to `ORDER`, exact with `NODES >= (ORDER + 1) / 2`.
#[inline(always)]
fn add_edges<const ORDER: usize, const NODES: usize, const COUNT: usize>(
    vertices: &mut impl VertexGroups,
    into: &mut [f64],
) {
    let rule = const { gauss_legendre::<NODES>() };
    let mut sums = [Lanes::ZERO; COUNT];
    let first = vertices.group(0);
    let mut starts = first;
    for index in 1..=vertices.count() {
        let next = if index < vertices.count() { vertices.group(index) } else { first };
        let ends = [0, 1].map(|c| starts[c].shifted(next[c].0[0]));
        let cross = starts[0] * ends[1] - starts[1] * ends[0];
        add_edge_group::<ORDER, NODES, COUNT>(starts, ends, cross, &rule, &mut sums);
        starts = next;
    }
    add_sums::<ORDER>(&sums, &const { order_factors() }, into);
}

/// Adds sums over edges in the order of [`add_edge_group`], each times the factor of its order, to a list of moments.
#[inline(always)]
fn add_sums<const ORDER: usize>(sums: &[Lanes], factors: &[f64], into: &mut [f64]) {
    let mut sums = sums.iter().map(|sums| sums.sum());
    for j in 0..=ORDER {
        for i in 0..=ORDER - j {
            if let (Some(sum), Some(moment)) = (sums.next(), into.get_mut(plane_index(i, j))) {
                *moment += sum * factors[i + j];
            }
        }
    }
}

/// The integrals `integral_0^1 C x(s)^i y(s)^j ds`, `i + j <= 7`, summed over edges from `A` to `B`, of each component of
/// `C = -(A, 1) x (B, 1)` (`docs/math.md`, eq. 14.2).
pub(crate) fn edge_fluxes(edges: &[[Vector2<f64>; 2]]) -> [PlaneMoments; 3] {
    vectorized(EdgeFluxes(edges))
}

struct EdgeFluxes<'a>(&'a [[Vector2<f64>; 2]]);

impl NullaryFnOnce for EdgeFluxes<'_> {
    type Output = [PlaneMoments; 3];

    #[inline(always)]
    fn call(self) -> [PlaneMoments; 3] {
        const ORDER: usize = 7;
        const COUNT: usize = plane_count(ORDER);
        let rule = const { gauss_legendre::<4>() };
        let mut sums = [[Lanes::ZERO; COUNT]; 3];
        for edges in self.0.chunks(LANES) {
            // Past the last edge come edges of no length at the origin, which add nothing.
            let number = |end: usize, c: usize| Lanes(std::array::from_fn(|k| edges.get(k).map_or(0.0, |e| e[end][c])));
            let [[ax, ay], [bx, by]] = [0, 1].map(|end| [number(end, 0), number(end, 1)]);
            let normal = [by - ay, ax - bx, ay * bx - ax * by];
            for (sums, weight) in sums.iter_mut().zip(normal) {
                add_edge_group::<ORDER, 4, COUNT>([ax, ay], [bx, by], weight, &rule, sums);
            }
        }
        sums.map(|sums| {
            let mut integrals = PlaneMoments::zero(ORDER);
            add_sums::<ORDER>(&sums, &[1.0; ORDER + 1], integrals.values_mut());
            integrals
        })
    }
}

/// `1 / (k + 2)` of every order k (`docs/math.md`, eq. 2.3).
const fn order_factors() -> [f64; MAX_ORDER + 1] {
    let mut factors = [0.0; MAX_ORDER + 1];
    let mut k = 0;
    while k <= MAX_ORDER {
        factors[k] = 1.0 / (k + 2) as f64;
        k += 1;
    }
    factors
}

/// Adds, row by row of the powers of y, the integrals of the monomials along edges times each edge's weight.
#[inline(always)]
fn add_edge_group<const ORDER: usize, const NODES: usize, const COUNT: usize>(
    [ax, ay]: [Lanes; 2],
    [bx, by]: [Lanes; 2],
    weight: Lanes,
    rule: &[Node; NODES],
    sums: &mut [Lanes; COUNT],
) {
    let (dx, dy) = (bx - ax, by - ay);
    let x = rule.map(|(s, _)| ax + Lanes::splat(s) * dx);
    let y = rule.map(|(s, _)| ay + Lanes::splat(s) * dy);
    let mut row = rule.map(|(_, share)| Lanes::splat(share) * weight);
    // Written out, so that each row's length is a constant and its numbers stay in registers.
    let mut rest = &mut sums[..];
    rest = add_row::<ORDER, NODES>(0, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(1, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(2, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(3, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(4, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(5, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(6, &mut row, &x, &y, rest);
    rest = add_row::<ORDER, NODES>(7, &mut row, &x, &y, rest);
    add_row::<ORDER, NODES>(8, &mut row, &x, &y, rest);
}

/// Adds the sums over the nodes of `row x^i` for `i + j <= ORDER`, and multiplies the row by y; the sums of the rows to come.
#[inline(always)]
fn add_row<'a, const ORDER: usize, const NODES: usize>(
    j: usize,
    row: &mut [Lanes; NODES],
    x: &[Lanes; NODES],
    y: &[Lanes; NODES],
    sums: &'a mut [Lanes],
) -> &'a mut [Lanes] {
    if j > ORDER {
        return sums;
    }
    let (here, rest) = sums.split_at_mut(ORDER + 1 - j);
    let mut term = *row;
    for (i, sum) in here.iter_mut().enumerate() {
        let mut total = *sum;
        for g in 0..NODES {
            total += term[g];
            if i + j < ORDER {
                term[g] = term[g] * x[g];
            }
        }
        *sum = total;
    }
    for g in 0..NODES {
        row[g] = row[g] * y[g];
    }
    rest
}

impl PlaneMoments {
    /// The moments of the region moved by `by`: `M'_ij = integral of (x + by_x)^i (y + by_y)^j dA`
    /// (binomial theorem; `docs/math.md`, eq. 2.4).
    pub fn shifted(&self, by: Vector2<f64>) -> Self {
        let mut moved = *self;
        // One coordinate at a time, Horner's scheme of repeated synthetic shifts: x^i becomes (x + b)^i in place.
        for j in 0..=self.order() {
            for first in 1..=self.order() - j {
                for i in (first..=self.order() - j).rev() {
                    moved.values[plane_index(i, j)] += by.x * moved.values[plane_index(i - 1, j)];
                }
            }
        }
        for i in 0..=self.order() {
            for first in 1..=self.order() - i {
                for j in (first..=self.order() - i).rev() {
                    moved.values[plane_index(i, j)] += by.y * moved.values[plane_index(i, j - 1)];
                }
            }
        }
        moved
    }
}
