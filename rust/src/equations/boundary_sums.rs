//! Integrals along a region's boundary: its quadrature, and all monomials up to a degree at once.

use nalgebra::Vector2;

use crate::equations::system::HIGHEST_ORDER;
use crate::geometry::rings::PlaneRings;
use crate::lanes::{LANES, Lanes, NullaryFnOnce};
use crate::moments::quadrature::{Node, gauss_legendre};

/// Edges shorter than this, in chart units (the region's area is one), are integrated with one node.
const SHORT_EDGE: f64 = 0.15;

/// One node serves a short edge.
const MIDPOINT: [Node; 1] = gauss_legendre();

/// Exact for products of two moments of order 6.
const LONG_EDGE: [Node; 7] = gauss_legendre();

/// A point of the boundary with its weight, the length that it stands for, and the outward normal there.
pub(crate) struct BoundaryNode {
    pub(crate) at: Vector2<f64>,
    pub(crate) weight: f64,
    pub(crate) normal: Vector2<f64>,
}

/// The points of a quadrature along a boundary.
pub(crate) fn boundary_nodes(rings: &PlaneRings) -> Vec<BoundaryNode> {
    let mut nodes = Vec::with_capacity(rings.rings().iter().map(Vec::len).sum());
    rings.edges().for_each(|(a, b)| {
        let length = (b - a).norm();
        let normal = Vector2::new(b.y - a.y, a.x - b.x) / length;
        let rule: &[Node] = if length < SHORT_EDGE { &MIDPOINT } else { &LONG_EDGE };
        let node = |&(at, weight): &Node| BoundaryNode { at: a + (b - a) * at, weight: weight * length, normal };
        nodes.extend(rule.iter().map(node));
    });
    nodes
}

/// Degrees up to that of a product of two of the plane system's functions, and of two of their derivatives.
pub(crate) const VALUE_SIZE: usize = 2 * HIGHEST_ORDER + 1;
pub(crate) const SLOPE_SIZE: usize = VALUE_SIZE - 2;

/// Monomials below a degree.
const VALUES: usize = monomials(VALUE_SIZE);
const SLOPES: usize = monomials(SLOPE_SIZE);

/// Groups of nodes worked on together: sums are then read and written once for all of them.
const GROUPS: usize = 2;

/// Number of the monomials below a degree.
const fn monomials(degree: usize) -> usize {
    degree * (degree + 1) / 2
}

/// Place of `x^i y^j` among the monomials below a degree, by i and then by j.
pub(crate) const fn monomial(degree: usize, [i, j]: [usize; 2]) -> usize {
    monomials(degree) - monomials(degree - i) + j
}

/// Sums over a boundary's nodes of their weight times each monomial, by [`monomial`].
pub(crate) struct Sums {
    pub(crate) plain: [f64; VALUES],
    /// Times the square of the normal's x, and times the product of its x and y.
    pub(crate) squared: [f64; SLOPES],
    pub(crate) mixed: [f64; SLOPES],
}

/// Takes the sums over nodes.
pub(crate) struct MonomialSums<'a>(pub(crate) &'a [BoundaryNode]);

impl NullaryFnOnce for MonomialSums<'_> {
    type Output = Sums;

    #[inline(always)]
    fn call(self) -> Sums {
        let (mut plain, mut squared, mut mixed) = ([Lanes::ZERO; VALUES], [Lanes::ZERO; SLOPES], [Lanes::ZERO; SLOPES]);
        for block in self.0.chunks(GROUPS * LANES) {
            let x = lanes(block, |node| node.at.x);
            let y = lanes(block, |node| node.at.y);
            let weight = lanes(block, |node| node.weight);
            let of_x = times(weight, &lanes(block, |node| node.normal.x));
            add_monomials::<VALUE_SIZE>(weight, &x, &y, &mut plain);
            add_monomials::<SLOPE_SIZE>(times(of_x, &lanes(block, |node| node.normal.x)), &x, &y, &mut squared);
            add_monomials::<SLOPE_SIZE>(times(of_x, &lanes(block, |node| node.normal.y)), &x, &y, &mut mixed);
        }
        Sums { plain: totals(&plain), squared: totals(&squared), mixed: totals(&mixed) }
    }
}

#[inline(always)]
fn totals<const COUNT: usize>(sums: &[Lanes; COUNT]) -> [f64; COUNT] {
    let mut totals = [0.0; COUNT];
    for (total, sum) in totals.iter_mut().zip(sums) {
        *total = sum.sum();
    }
    totals
}

#[inline(always)]
fn times(mut a: [Lanes; GROUPS], b: &[Lanes; GROUPS]) -> [Lanes; GROUPS] {
    for g in 0..GROUPS {
        a[g] = a[g] * b[g];
    }
    a
}

/// A number of each node of a block, zero past its last.
#[inline(always)]
fn lanes(block: &[BoundaryNode], number: impl Fn(&BoundaryNode) -> f64) -> [Lanes; GROUPS] {
    let mut lanes = [Lanes::ZERO; GROUPS];
    for (k, node) in block.iter().enumerate() {
        lanes[k / LANES].0[k % LANES] = number(node);
    }
    lanes
}

/// Adds `row x^i y^j` to the sum of each monomial below a degree, 13 at most.
#[inline(always)]
fn add_monomials<const DEGREE: usize>(
    mut row: [Lanes; GROUPS],
    x: &[Lanes; GROUPS],
    y: &[Lanes; GROUPS],
    sums: &mut [Lanes],
) {
    // Written out, so that each row's length is known to the compiler and its numbers stay in registers.
    let mut rest = sums;
    rest = add_row::<DEGREE>(0, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(1, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(2, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(3, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(4, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(5, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(6, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(7, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(8, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(9, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(10, &mut row, x, y, rest);
    rest = add_row::<DEGREE>(11, &mut row, x, y, rest);
    add_row::<DEGREE>(12, &mut row, x, y, rest);
}

/// Adds `row y^j` to each sum of a power of x, and multiplies the row by x; the sums of the powers to come.
#[inline(always)]
fn add_row<'a, const DEGREE: usize>(
    i: usize,
    row: &mut [Lanes; GROUPS],
    x: &[Lanes; GROUPS],
    y: &[Lanes; GROUPS],
    sums: &'a mut [Lanes],
) -> &'a mut [Lanes] {
    if i >= DEGREE {
        return sums;
    }
    let (here, rest) = sums.split_at_mut(DEGREE - i);
    let mut term = *row;
    for sum in here {
        let mut total = *sum;
        for g in 0..GROUPS {
            total += term[g];
            term[g] = term[g] * y[g];
        }
        *sum = total;
    }
    *row = times(*row, x);
    rest
}
