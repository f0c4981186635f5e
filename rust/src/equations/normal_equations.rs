//! The normal equations of least squares.

use std::ops::AddAssign;

use nalgebra::{Matrix6, Rotation3, Vector6};

use crate::geometry::pose::{PARAMETERS, Tangent};
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Entries of an equation with derivatives: its residual, its derivatives by the left increment, and a zero that makes
/// them two lane groups.
pub(crate) const DERIVED: usize = 2 * LANES;

/// Normal equations of least squares: with residuals `r` and derivatives `J` by the left increment, the sums over
/// all.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NormalEquations {
    /// `J^T J`.
    pub information: Matrix6<f64>,
    /// `J^T r`.
    pub gradient: Tangent,
    /// `r^T r`.
    pub cost: f64,
}

/// A row of a weighted least squares: its derivatives by the left increment, its residual and its weight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WeightedRow {
    derivative: [Lanes; 2],
    residual: f64,
    weight: f64,
}

impl WeightedRow {
    pub(crate) fn new(derivative: &Vector6<f64>, residual: f64, weight: f64) -> Self {
        Self { derivative: in_lanes(derivative), residual, weight }
    }
}

/// The entries of a row or column by the left increment, as two lane groups.
pub(crate) fn in_lanes(entries: &Vector6<f64>) -> [Lanes; 2] {
    let &[[a, b, c, d, e, f]] = &entries.data.0;
    [Lanes([a, b, c, d]), Lanes([e, f, 0.0, 0.0])]
}

/// Sums of the products `J J^T` of columns, each times `N` weights.
struct Outer<'a, const N: usize>(&'a [[Lanes; 2]], &'a [[f64; N]]);

impl<const N: usize> NullaryFnOnce for Outer<'_, N> {
    type Output = [[[Lanes; 2]; PARAMETERS]; N];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut sums = [[[Lanes::ZERO; 2]; PARAMETERS]; N];
        for (&entries, weights) in self.0.iter().zip(self.1) {
            for (sums, &weight) in sums.iter_mut().zip(weights) {
                let weighted = entries.map(|entries| entries * Lanes::splat(weight));
                for (column, sums) in sums.iter_mut().enumerate() {
                    let entry = Lanes::splat(entries[column / LANES].0[column % LANES]);
                    sums[0] += weighted[0] * entry;
                    sums[1] += weighted[1] * entry;
                }
            }
        }
        sums
    }
}

/// Sums of the products `J J^T` of columns, for each of the `N` weights that a column has.
pub(crate) fn outer_products<const N: usize>(columns: &[[Lanes; 2]], weights: &[[f64; N]]) -> [Matrix6<f64>; N] {
    vectorized(Outer(columns, weights)).map(matrix)
}

/// The matrix of these columns.
fn matrix(columns: [[Lanes; 2]; PARAMETERS]) -> Matrix6<f64> {
    let columns = columns.map(numbers);
    Matrix6::from_fn(|entry, column| columns[column][entry])
}

/// Sums over rows of the products of their entries.
struct WeightedSums<'a>(&'a [WeightedRow]);

impl NullaryFnOnce for WeightedSums<'_> {
    type Output = ([[Lanes; 2]; 6], [Lanes; 2], f64);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let (mut information, mut gradient, mut cost) = ([[Lanes::ZERO; 2]; 6], [Lanes::ZERO; 2], 0.0);
        for &WeightedRow { derivative, residual, weight } in self.0 {
            let weighted = derivative.map(|entries| entries * Lanes::splat(weight));
            for (column, sums) in information.iter_mut().enumerate() {
                let entry = Lanes::splat(derivative[column / LANES].0[column % LANES]);
                sums[0] += weighted[0] * entry;
                sums[1] += weighted[1] * entry;
            }
            gradient[0] += weighted[0] * Lanes::splat(residual);
            gradient[1] += weighted[1] * Lanes::splat(residual);
            cost += weight * residual * residual;
        }
        (information, gradient, cost)
    }
}

/// Sums over equations of the products of their entries, entry by entry.
struct Products<'a>(&'a [[f64; DERIVED]]);

impl NullaryFnOnce for Products<'_> {
    type Output = [[Lanes; 2]; DERIVED - 1];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut sums = [[Lanes::ZERO; 2]; DERIVED - 1];
        for &[a, b, c, d, e, f, g, h] in self.0 {
            let entries = [Lanes([a, b, c, d]), Lanes([e, f, g, h])];
            for (sums, factor) in sums.iter_mut().zip([a, b, c, d, e, f, g].map(Lanes::splat)) {
                sums[0] += factor * entries[0];
                sums[1] += factor * entries[1];
            }
        }
        sums
    }
}

impl NormalEquations {
    /// The sums of equations.
    pub(crate) fn of(rows: &[[f64; DERIVED]]) -> Self {
        let sums = vectorized(Products(rows)).map(numbers);
        Self {
            information: Matrix6::from_fn(|a, b| sums[1 + a.max(b)][1 + a.min(b)]),
            gradient: Tangent::from_fn(|a, _| sums[1 + a][0]),
            cost: sums[0][0],
        }
    }

    /// The sums of weighted rows.
    pub(crate) fn weighted(rows: &[WeightedRow]) -> Self {
        let (information, gradient, cost) = vectorized(WeightedSums(rows));
        let gradient = numbers(gradient);
        Self { information: matrix(information), gradient: Tangent::from_fn(|entry, _| gradient[entry]), cost }
    }

    /// The equations by an increment along a chart's axes turned to the camera's, `rotation` being `chart_from_camera`
    /// (`docs/math.md`, eq. 6.7).
    pub fn turned(self, rotation: &Rotation3<f64>) -> Self {
        let mut gradient = Tangent::zeros();
        for a in [0, 3] {
            let part = rotation.matrix().tr_mul(&self.gradient.fixed_rows::<3>(a));
            gradient.fixed_rows_mut::<3>(a).copy_from(&part);
        }
        Self { information: turned(&self.information, rotation), gradient, cost: self.cost }
    }
}

/// A sum of products by an increment along a chart's axes, turned to the camera's.
pub(crate) fn turned(products: &Matrix6<f64>, rotation: &Rotation3<f64>) -> Matrix6<f64> {
    let (turn, mut result) = (rotation.matrix(), Matrix6::zeros());
    for (a, b) in [(0, 0), (0, 3), (3, 0), (3, 3)] {
        let block = turn.tr_mul(&(products.fixed_view::<3, 3>(a, b) * turn));
        result.fixed_view_mut::<3, 3>(a, b).copy_from(&block);
    }
    result
}

impl AddAssign for NormalEquations {
    /// Adds those of other equations by the same increment.
    fn add_assign(&mut self, other: Self) {
        self.information += other.information;
        self.gradient += other.gradient;
        self.cost += other.cost;
    }
}

/// The numbers of two lane groups, one after another.
fn numbers([first, second]: [Lanes; 2]) -> [f64; DERIVED] {
    let ([a, b, c, d], [e, f, g, h]) = (first.0, second.0);
    [a, b, c, d, e, f, g, h]
}
