//! Whitening of the residuals: the moments' covariance under independent boundary noise, factored.

use nalgebra::{Vector2, Vector3};

use crate::equations::boundary_sums::{BoundaryNode, MonomialSums, Sums, boundary_nodes, monomial};
use crate::equations::system::{HIGHEST_ORDER, MOST_EQUATIONS, PLANE_EXPONENTS, SPHERE_EXPONENTS, System};
use crate::geometry::rings::PlaneRings;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};
use crate::moments::plane::planar_moments;
use crate::noise::boundary::QUANTIZATION;
use crate::view::chart::Chart;

/// Pivots of the covariance below this share of the largest are taken for round-off and their functions left out.
const PIVOT_CUT: f64 = 1e-13;

/// Which moments are compared on the whitened scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orders {
    /// All of the system: they hold more of a clean outline.
    All,
    /// On the plane those up to order 4: outlines of real segmentations and scans are bent and cut rather than rough, which
    /// disturbs high orders most.
    Low,
}

/// Covariance of a region's moments under boundary noise of any size (`docs/math.md`, eq. 6.4).
///
/// In units of the noise's variance, with independent pixels of the boundary and `w_n` the functions' normal derivatives:
/// `pixel^3 (w w^T) + sigma^2 pixel^5 / 2 (w_n w_n^T) + sigma^2 pixel^4 / 4 b b^T`, the products and `b = w_n` integrated along the
/// boundary. Functions that vanish on the whole boundary (the product of a quadrilateral's sides) have no first-order noise; the
/// terms of second order keep them from being trusted without end.
#[derive(Debug, Clone)]
pub struct BoundaryCovariance {
    /// Both matrices by [`packed`].
    first: Vec<f64>,
    second: Vec<f64>,
    bias: Vec<f64>,
    /// Number of the leading functions, those of low order.
    low: usize,
}

impl BoundaryCovariance {
    /// The covariance of a region whose outline in the chart is `rings` and whose area is `pixel_area` pixels.
    pub fn new(system: System, chart: &Chart, rings: &PlaneRings, pixel_area: f64) -> Self {
        let products = match system {
            System::Plane => plane_products(rings),
            System::Sphere => sphere_products(chart, rings),
        };
        let pixel = pixel_area.sqrt().recip();
        let scaled = |mut values: Vec<f64>, factor: f64| {
            values.iter_mut().for_each(|value| *value *= factor);
            values
        };
        Self {
            first: scaled(products.values, pixel.powi(3)),
            second: scaled(products.slopes, 0.5 * pixel.powi(5)),
            bias: scaled(products.bias, 0.5 * pixel * pixel),
            low: system.low_count(),
        }
    }

    /// The covariance for a noise of standard deviation `sigma` pixels, over its variance.
    fn at(&self, sigma: f64, orders: Orders) -> Covariance {
        let variance = sigma.max(QUANTIZATION).powi(2);
        let count = match orders {
            Orders::All => self.bias.len(),
            Orders::Low => self.low,
        };
        let mut entries = [[0.0; MOST_EQUATIONS]; MOST_EQUATIONS];
        let mut packed = self.first.iter().zip(&self.second);
        for (a, bias) in self.bias[..count].iter().enumerate() {
            for (b, (first, second)) in packed.by_ref().take(a + 1).enumerate() {
                let value = first + variance * (second + bias * self.bias[b]);
                entries[a][b] = value;
                entries[b][a] = value;
            }
        }
        Covariance { entries, count }
    }
}

/// Place of the entry in row `a` and column `b <= a` of a symmetric matrix that is held by the rows of its lower triangle.
const fn packed(a: usize, b: usize) -> usize {
    a * (a + 1) / 2 + b
}

/// Integrals along a boundary: `w w^T` and `w_n w_n^T` by [`packed`], and `w_n`.
struct Products {
    values: Vec<f64>,
    slopes: Vec<f64>,
    bias: Vec<f64>,
}

/// A symmetric matrix in its leading `count` rows and columns.
struct Covariance {
    entries: [[f64; MOST_EQUATIONS]; MOST_EQUATIONS],
    count: usize,
}

/// The inverse square root of the moments' covariance: scales residuals to pixels of boundary noise.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// Functions in the order of their pivots; those that depend on the others are left out.
    pivots: Vec<usize>,
    /// Lower triangular Cholesky factor of the pivots' covariance by [`packed`], with the inverse of its diagonal.
    factor: Vec<f64>,
}

impl Whitening {
    /// The whitening for a boundary noise of `sigma` pixels.
    pub fn new(covariance: &BoundaryCovariance, sigma: f64, orders: Orders) -> Self {
        let (pivots, columns) = vectorized(PivotedCholesky(&covariance.at(sigma, orders)));
        let mut factor = Vec::with_capacity(packed(pivots.len(), 0));
        for (k, &pivot) in pivots.iter().enumerate() {
            let entry = |column: &Column| column[pivot / LANES].0[pivot % LANES];
            factor.extend(columns[..k].iter().map(entry));
            factor.push(entry(&columns[k]).recip());
        }
        Self { pivots, factor }
    }

    /// Number of independent equations.
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// Adds the whitened rows, as many as the rank, to others, by forward substitution; each row of `rows` holds one equation's
    /// residual and derivatives (`docs/math.md`, eq. 6.5).
    pub fn apply<const N: usize>(&self, rows: &[[f64; N]], whitened: &mut Vec<[f64; N]>) {
        vectorized(ForwardSubstitution(self, rows, whitened));
    }
}

/// Adds the rows that a whitening makes of others.
struct ForwardSubstitution<'a, const N: usize>(&'a Whitening, &'a [[f64; N]], &'a mut Vec<[f64; N]>);

impl<const N: usize> NullaryFnOnce for ForwardSubstitution<'_, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(Whitening { pivots, factor }, rows, whitened) = self;
        let first = whitened.len();
        for (k, &pivot) in pivots.iter().enumerate() {
            let weights = &factor[packed(k, 0)..=packed(k, k)];
            let mut row = rows[pivot];
            for (weight, before) in weights.iter().zip(&whitened[first..]) {
                row.iter_mut().zip(before).for_each(|(entry, value)| *entry -= weight * value);
            }
            whitened.push(row.map(|entry| entry * weights[k]));
        }
    }
}

/// Cholesky's factor of a positive semidefinite matrix, largest pivot first, up to round-off: the pivots and the columns.
struct PivotedCholesky<'a>(&'a Covariance);

impl NullaryFnOnce for PivotedCholesky<'_> {
    type Output = (Vec<usize>, Vec<Column>);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let matrix = self.0;
        let (mut pivots, mut columns) = (Vec::with_capacity(matrix.count), Vec::with_capacity(matrix.count));
        let mut rest = column_of(&std::array::from_fn(|k| matrix.entries[k][k]));
        let cut = PIVOT_CUT * largest(&rest).map_or(0.0, |(_, value)| value);
        while let Some((pivot, value)) = largest(&rest).filter(|(_, value)| *value > cut) {
            let mut column = column_of(&matrix.entries[pivot]);
            for other in &columns {
                subtract(&mut column, other, other[pivot / LANES].0[pivot % LANES]);
            }
            let inverse = value.sqrt().recip();
            for (entries, rest) in column.iter_mut().zip(&mut rest) {
                *entries = *entries * Lanes::splat(inverse);
                *rest = *rest - *entries * *entries;
            }
            column[pivot / LANES].0[pivot % LANES] = value.sqrt();
            // What is left of an eliminated pivot is round-off.
            rest[pivot / LANES].0[pivot % LANES] = 0.0;
            pivots.push(pivot);
            columns.push(column);
        }
        (pivots, columns)
    }
}

/// A column of the covariance.
type Column = [Lanes; MOST_EQUATIONS / LANES];

const _: () = assert!(MOST_EQUATIONS.is_multiple_of(LANES));

#[inline(always)]
fn column_of(numbers: &[f64; MOST_EQUATIONS]) -> Column {
    let mut column = [Lanes::ZERO; MOST_EQUATIONS / LANES];
    for (lanes, numbers) in column.iter_mut().zip(numbers.as_chunks().0) {
        *lanes = Lanes(*numbers);
    }
    column
}

/// Takes a share of another column off one.
#[inline(always)]
fn subtract(column: &mut Column, other: &Column, share: f64) {
    for (entries, other_entries) in column.iter_mut().zip(other) {
        *entries = *entries - Lanes::splat(share) * *other_entries;
    }
}

/// The first of the largest numbers, and where it is; `None` where all are none.
#[inline(always)]
fn largest(column: &Column) -> Option<(usize, f64)> {
    let mut most = Lanes::splat(f64::NEG_INFINITY);
    for lanes in column {
        most = lanes.upper(most);
    }
    let most = most.max();
    let numbers = column.iter().flat_map(|lanes| lanes.0);
    numbers.enumerate().find(|(_, number)| *number == most)
}

/// Functions of the sphere system.
const SPHERE_COUNT: usize = SPHERE_EXPONENTS.len();

/// Entries of the plane system's covariance by [`packed`].
const ENTRIES: usize = packed(PLANE_EXPONENTS.len(), 0);

/// Terms of an entry of the plane system's covariance: the place of the values' monomial, and of the slopes'
/// the places and their factors.
#[derive(Clone, Copy)]
struct Entry {
    value: usize,
    /// Derivatives along x, and across.
    along_x: (usize, f64),
    across: (usize, f64),
    /// Derivatives along y: the normal's squares have the sum 1.
    along_y: (usize, f64),
}

/// All entries by [`packed`] (`docs/math.md`, eq. 6.8).
static PLANE_ENTRIES: [Entry; ENTRIES] = plane_entries();

const fn plane_entries() -> [Entry; ENTRIES] {
    let mut entries = [Entry { value: 0, along_x: (0, 0.0), across: (0, 0.0), along_y: (0, 0.0) }; ENTRIES];
    let mut a = 0;
    while a < PLANE_EXPONENTS.len() {
        let mut b = 0;
        while b <= a {
            entries[packed(a, b)] = plane_entry(PLANE_EXPONENTS[a], PLANE_EXPONENTS[b]);
            b += 1;
        }
        a += 1;
    }
    entries
}

const fn plane_entry([i, j]: [usize; 2], [k, l]: [usize; 2]) -> Entry {
    let (x, y) = (i + k, j + l);
    // A monomial with an exponent below zero has the factor zero: any other does in its place.
    let along_x = if i * k == 0 { [0; 2] } else { [x - 2, y] };
    let across = if i * l + j * k == 0 { [0; 2] } else { [x - 1, y - 1] };
    let along_y = if j * l == 0 { [0; 2] } else { [x, y - 2] };
    Entry {
        value: monomial([x, y]),
        along_x: (monomial(along_x), (i * k) as f64),
        across: (monomial(across), (i * l + j * k) as f64),
        along_y: (monomial(along_y), (j * l) as f64),
    }
}

/// The plane system's: the entries are a few integrals of monomials each.
fn plane_products(rings: &PlaneRings) -> Products {
    let Sums { plain, squared, mixed } = vectorized(MonomialSums(&boundary_nodes(rings)));
    let slope = |&Entry { along_x, across, along_y, .. }: &Entry| {
        along_x.1 * squared[along_x.0]
            + across.1 * mixed[across.0]
            + along_y.1 * (plain[along_y.0] - squared[along_y.0])
    };
    let values = PLANE_ENTRIES.iter().map(|entry| plain[entry.value]).collect();
    Products { values, slopes: PLANE_ENTRIES.iter().map(slope).collect(), bias: plane_bias(rings) }
}

/// The integrals of the normal derivatives along the boundary: of the Laplacians over the region.
fn plane_bias(rings: &PlaneRings) -> Vec<f64> {
    let moments = planar_moments(rings.rings().iter().map(Vec::as_slice), HIGHEST_ORDER - 2);
    let twice = |k: usize, moment: &dyn Fn() -> f64| if k < 2 { 0.0 } else { (k * (k - 1)) as f64 * moment() };
    let bias = |&[i, j]: &[usize; 2]| twice(i, &|| moments.get(i - 2, j)) + twice(j, &|| moments.get(i, j - 2));
    PLANE_EXPONENTS.iter().map(bias).collect()
}

/// The sphere system's, node after node.
fn sphere_products(chart: &Chart, rings: &PlaneRings) -> Products {
    let count = SPHERE_EXPONENTS.len();
    let entries = packed(count, 0);
    let mut sums = Products { values: vec![0.0; entries], slopes: vec![0.0; entries], bias: vec![0.0; count] };
    for BoundaryNode { at, weight, normal } in &boundary_nodes(rings) {
        let (values, slopes) = sphere_functions(chart, at, normal);
        for a in 0..count {
            let (value, slope) = (weight * values[a], weight * slopes[a]);
            sums.bias[a] += slope;
            for b in 0..=a {
                sums.values[packed(a, b)] += value * values[b];
                sums.slopes[packed(a, b)] += slope * slopes[b];
            }
        }
    }
    sums
}

/// The functions on the sphere, on the scale of [`crate::equations::system::add_sphere_values`], with the sphere's area element.
fn sphere_functions(
    chart: &Chart,
    at: &Vector2<f64>,
    along: &Vector2<f64>,
) -> ([f64; SPHERE_COUNT], [f64; SPHERE_COUNT]) {
    let point = Vector3::new(at.x / chart.scale, at.y / chart.scale, 1.0);
    let step = Vector3::new(along.x, along.y, 0.0) / chart.scale;
    let depth = point.norm();
    let r = point / depth;
    let dr = (step - r * r.dot(&step)) / depth;
    let element = depth.powi(-3);
    // The element falls with the distance from the axis: its relative slope.
    let fall = -3.0 * r.dot(&step) / depth;
    let (x, y, z) = (powers(r.x * chart.scale), powers(r.y * chart.scale), powers(r.z));
    let value = SPHERE_EXPONENTS.map(|[l, m, n]| element * x[l] * y[m] * z[n]);
    let slope = SPHERE_EXPONENTS.map(|[l, m, n]| {
        let (dx, dy) = (dr.x * chart.scale * lowered(l, &x), dr.y * chart.scale * lowered(m, &y));
        let of_element = fall * x[l] * y[m] * z[n];
        element * (of_element + dx * y[m] * z[n] + x[l] * dy * z[n] + x[l] * y[m] * dr.z * lowered(n, &z))
    });
    (value, slope)
}

/// Powers of x from 0 to the highest of the sphere system's exponents.
fn powers(x: f64) -> [f64; 3] {
    [1.0, x, x * x]
}

/// Derivative of `x^k` from the powers of x.
fn lowered(k: usize, powers: &[f64; 3]) -> f64 {
    if k == 0 { 0.0 } else { k as f64 * powers[k - 1] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of sums of numbers of size 1.
    const ROUNDING: f64 = 1e-13;

    /// A slender hexagon, its long edges with seven nodes and its short ones with one.
    fn outline() -> PlaneRings {
        let corners = [[-0.9, -0.4], [0.6, -0.5], [0.65, -0.4], [0.5, 0.5], [-0.6, 0.4], [-0.65, 0.35]];
        PlaneRings::polygon(vec![corners.map(Vector2::from).to_vec()]).unwrap()
    }

    #[test]
    fn the_integrals_shared_by_entries_are_those_of_each_entry() {
        let (rings, products) = (outline(), plane_products(&outline()));
        for (a, [i, j]) in PLANE_EXPONENTS.map(|e| e.map(|k| k as i32)).into_iter().enumerate() {
            for (b, [k, l]) in PLANE_EXPONENTS.map(|e| e.map(|k| k as i32)).into_iter().enumerate().take(a + 1) {
                let value = |p: &Vector2<f64>, i: i32, j: i32| p.x.powi(i) * p.y.powi(j);
                let slope = |node: &BoundaryNode, i: i32, j: i32| {
                    let along = |k: i32, x: f64| if k == 0 { 0.0 } else { k as f64 * x.powi(k - 1) };
                    let BoundaryNode { at, normal, .. } = node;
                    normal.x * along(i, at.x) * at.y.powi(j) + normal.y * at.x.powi(i) * along(j, at.y)
                };
                let values = |node: BoundaryNode| node.weight * value(&node.at, i, j) * value(&node.at, k, l);
                let slopes = |node: BoundaryNode| node.weight * slope(&node, i, j) * slope(&node, k, l);
                let expected = [
                    boundary_nodes(&rings).into_iter().map(values).sum(),
                    boundary_nodes(&rings).into_iter().map(slopes).sum(),
                ];
                let found = [products.values[packed(a, b)], products.slopes[packed(a, b)]];
                for (found, expected) in found.into_iter().zip::<[f64; 2]>(expected) {
                    assert!(
                        (found - expected).abs() < ROUNDING * expected.abs().max(1.0),
                        "{a}, {b}: {found} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn whitened_rows_have_the_norm_that_the_covariance_gives() {
        let chart = Chart { rotation: nalgebra::Rotation3::identity(), scale: 3.0 };
        for (system, orders) in
            [(System::Plane, Orders::All), (System::Plane, Orders::Low), (System::Sphere, Orders::All)]
        {
            let covariance = BoundaryCovariance::new(system, &chart, &outline(), 1e4);
            let whitening = Whitening::new(&covariance, 0.5, orders);
            // The length of a row that the covariance maps to another is that of their product: x = S y, |F^-1 x|^2 = y^T S y.
            let Covariance { entries, count } = covariance.at(0.5, orders);
            let y: [f64; MOST_EQUATIONS] =
                std::array::from_fn(|k| if k < count { (k as f64 + 0.3).sin() } else { 0.0 });
            let x = entries.map(|row| [row.iter().zip(&y).map(|(s, y)| s * y).sum::<f64>()]);
            let expected: f64 = x.iter().zip(&y).map(|(x, y)| x[0] * y).sum();
            let mut whitened = Vec::new();
            whitening.apply(&x, &mut whitened);
            let found: f64 = whitened.iter().map(|row| row[0] * row[0]).sum();
            assert!((found - expected).abs() < 1e-6 * expected, "{system:?}: {found} {expected}");
        }
    }
}
