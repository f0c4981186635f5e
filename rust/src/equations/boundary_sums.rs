//! Integrals along a region's boundary: its quadrature, and all monomials up to a degree at once.

use nalgebra::Vector2;

use crate::equations::system::HIGHEST_ORDER;
use crate::geometry::rings::PlaneRings;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce};
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

/// Lane groups that hold the powers of y.
const GROUPS: usize = VALUE_SIZE.div_ceil(LANES);

/// Place of `x^i y^j` in a [`Table`].
pub(crate) const fn monomial([i, j]: [usize; 2]) -> usize {
    i * (GROUPS * LANES) + j
}

/// Sums over a boundary's nodes of their weight times each monomial below a degree, by [`monomial`].
pub(crate) struct Sums {
    pub(crate) plain: [f64; MONOMIALS],
    /// Times the square of the normal's x, and times the product of its x and y.
    pub(crate) squared: [f64; MONOMIALS],
    pub(crate) mixed: [f64; MONOMIALS],
}

/// Places of monomials, those of the degree and beyond among them, whose sums are not complete.
const MONOMIALS: usize = monomial([VALUE_SIZE, 0]);

/// Sums of `x^i y^j` by i, and by j in lane groups.
type Table = [[Lanes; GROUPS]; VALUE_SIZE];

/// Powers of a number from 0 on times a factor, in lane groups.
type Powers = [Lanes; GROUPS];

/// Takes the sums over nodes.
pub(crate) struct MonomialSums<'a>(pub(crate) &'a [BoundaryNode]);

impl NullaryFnOnce for MonomialSums<'_> {
    type Output = Sums;

    #[inline(always)]
    fn call(self) -> Sums {
        let mut tables = [[[Lanes::ZERO; GROUPS]; VALUE_SIZE]; 3];
        // As many nodes at a time as lanes: sums are read and written once for all of them.
        for nodes in self.0.chunks(LANES) {
            // Past the last node nothing has any weight.
            let number = |of: fn(&BoundaryNode) -> f64| Lanes(std::array::from_fn(|k| nodes.get(k).map_or(0.0, of)));
            let (x, y, weight) = (number(|node| node.at.x), number(|node| node.at.y), number(|node| node.weight));
            let (along, across) = (number(|node| node.normal.x), number(|node| node.normal.y));
            let y = std::array::from_fn(|k| powers(weight.0[k], y.0[k]));
            let [plain, squared, mixed] = &mut tables;
            add_monomials::<VALUE_SIZE>(Lanes::splat(1.0), x, &y, plain);
            add_monomials::<SLOPE_SIZE>(along * along, x, &y, squared);
            add_monomials::<SLOPE_SIZE>(along * across, x, &y, mixed);
        }
        let [plain, squared, mixed] = tables.map(|table| numbers(&table));
        Sums { plain, squared, mixed }
    }
}

/// A factor times the powers of a number: without it, the compiler takes the first for a constant and the lanes apart.
#[inline(always)]
fn powers(factor: f64, number: f64) -> Powers {
    let (first, square) = (factor * number, number * number);
    let (step, mut powers) = (Lanes::splat(square * square), [Lanes::ZERO; GROUPS]);
    powers[0] = Lanes([factor, first, factor * square, first * square]);
    for group in 1..GROUPS {
        powers[group] = powers[group - 1] * step;
    }
    powers
}

/// Adds `row x^i y^j` of each node to the sums of the monomials below a degree.
#[inline(always)]
fn add_monomials<const DEGREE: usize>(mut row: Lanes, x: Lanes, y: &[Powers; LANES], sums: &mut Table) {
    // The powers of y that belong to those of x fill fewer groups the higher these are; how many, the compiler is to know.
    const { assert!(GROUPS == 4) };
    let first = |groups: usize| DEGREE.saturating_sub(groups * LANES);
    add_rows::<4>(&mut sums[first(4)..first(3)], &mut row, x, y);
    add_rows::<3>(&mut sums[first(3)..first(2)], &mut row, x, y);
    add_rows::<2>(&mut sums[first(2)..first(1)], &mut row, x, y);
    add_rows::<1>(&mut sums[first(1)..DEGREE], &mut row, x, y);
}

#[inline(always)]
fn add_rows<const COUNT: usize>(sums: &mut [[Lanes; GROUPS]], row: &mut Lanes, x: Lanes, y: &[Powers; LANES]) {
    for sums in sums {
        let factors = row.0.map(Lanes::splat);
        for group in 0..COUNT {
            for k in 0..LANES {
                sums[group] += factors[k] * y[k][group];
            }
        }
        *row = *row * x;
    }
}

#[inline(always)]
fn numbers(table: &Table) -> [f64; MONOMIALS] {
    let mut numbers = [0.0; MONOMIALS];
    for (numbers, lanes) in numbers.as_chunks_mut().0.iter_mut().zip(table.as_flattened()) {
        *numbers = lanes.0;
    }
    numbers
}
