//! The scale on which moments are compared: their covariance under independent noise of the observed boundary.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use crate::equations::system::{PLANE_EXPONENTS, SPHERE_EXPONENTS, System, Weighting};
use crate::geometry::rings::PlaneRings;
use crate::moments::quadrature::{Node, gauss_legendre};
use crate::view::chart::Chart;

/// Least noise of the boundary along its normal, in pixels: that of a binary mask, uniform over a pixel.
const LEAST_NOISE: f64 = 0.29;

/// Pivots of the covariance below this share of the largest are taken for round-off and their functions left out.
const PIVOT_CUT: f64 = 1e-13;

/// Edges shorter than this, in chart units (the region's area is one), are integrated with one node.
const SHORT_EDGE: f64 = 0.15;

/// One node serves a short edge.
const MIDPOINT: [Node; 1] = gauss_legendre();

/// Exact for products of two moments of order 6.
const LONG_EDGE: [Node; 7] = gauss_legendre();

/// Which moments are compared on the whitened scale.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orders {
    /// All of the system: they hold more of a clean outline.
    All,
    /// On the plane those up to order 4: outlines of real segmentations and scans are bent and cut rather than rough, which
    /// high orders feel most.
    Low,
}

/// How a region's moments scatter when its boundary does, for any size of that noise (`docs/math.md`, eq. 6.4).
///
/// In units of the noise's variance, with independent pixels of the boundary and `w_n` the functions' normal derivatives:
/// `pixel^3 (w w^T) + sigma^2 pixel^5 / 2 (w_n w_n^T) + sigma^2 pixel^4 / 4 b b^T`, the products and `b = w_n` integrated along the
/// boundary. Functions that vanish on the whole boundary (the product of a quadrilateral's sides) have no first-order noise; the
/// terms of second order keep them from being trusted without end.
#[derive(Debug, Clone)]
pub struct BoundaryCovariance {
    first: DMatrix<f64>,
    second: DMatrix<f64>,
    bias: DVector<f64>,
    /// Number of the leading functions, those of low order.
    low: usize,
}

impl BoundaryCovariance {
    /// That of a region whose outline in the chart is `rings` and whose area is `pixel_area` pixels.
    pub fn new(system: System, chart: &Chart, rings: &PlaneRings, pixel_area: f64) -> Self {
        let count = system.count(Weighting::Whitened);
        let (mut first, mut second) = (DMatrix::zeros(count, count), DMatrix::zeros(count, count));
        let mut bias = DVector::zeros(count);
        for (a, b) in rings.edges() {
            let length = (b - a).norm();
            let normal = Vector2::new(b.y - a.y, a.x - b.x) / length;
            let nodes: &[Node] = if length < SHORT_EDGE { &MIDPOINT } else { &LONG_EDGE };
            for &(at, weight) in nodes {
                let (value, slope) = functions(system, chart, &(a + (b - a) * at), &normal);
                first.ger(weight * length, &value, &value, 1.0);
                second.ger(weight * length, &slope, &slope, 1.0);
                bias.axpy(weight * length, &slope, 1.0);
            }
        }
        let pixel = pixel_area.sqrt().recip();
        Self {
            first: first * pixel.powi(3),
            second: second * (0.5 * pixel.powi(5)),
            bias: bias * (0.5 * pixel * pixel),
            low: system.low_count(),
        }
    }

    /// The covariance for a noise of standard deviation `sigma` pixels, over its variance.
    fn at(&self, sigma: f64, orders: Orders) -> DMatrix<f64> {
        let variance = sigma.max(LEAST_NOISE).powi(2);
        let mut covariance = &self.first + &self.second * variance;
        covariance.ger(variance, &self.bias, &self.bias, 1.0);
        let count = match orders {
            Orders::All => covariance.nrows(),
            Orders::Low => self.low,
        };
        covariance.view((0, 0), (count, count)).into_owned()
    }
}

/// The inverse square root of the moments' covariance: scales residuals to pixels of boundary noise.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// Functions in the order of their pivots; those that depend on the others are left out.
    pivots: Vec<usize>,
    /// Lower triangular inverse of the Cholesky factor of the pivots' covariance, row after row.
    inverse: Vec<f64>,
}

impl Whitening {
    /// The whitening for a boundary noise of `sigma` pixels.
    pub fn new(covariance: &BoundaryCovariance, sigma: f64, orders: Orders) -> Self {
        let (pivots, factor) = pivoted_cholesky(covariance.at(sigma, orders));
        let identity = DMatrix::identity(pivots.len(), pivots.len());
        let inverse = factor.solve_lower_triangular(&identity).unwrap_or(identity);
        let rows = (0..pivots.len()).flat_map(|row| (0..=row).map(move |column| (row, column)));
        Self { inverse: rows.map(|at| inverse[at]).collect(), pivots }
    }

    /// Number of independent equations.
    pub fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// The whitened rows; each row of `rows` holds one equation's residual and derivatives.
    pub fn apply<const N: usize>(&self, rows: &[[f64; N]]) -> impl Iterator<Item = [f64; N]> {
        let mut start = 0;
        (0..self.pivots.len()).map(move |row| {
            let weights = &self.inverse[start..start + row + 1];
            start += row + 1;
            let mut sum = [0.0; N];
            for (weight, &pivot) in weights.iter().zip(&self.pivots) {
                for (total, value) in sum.iter_mut().zip(&rows[pivot]) {
                    *total += weight * value;
                }
            }
            sum
        })
    }
}

/// Cholesky's factor of a positive semidefinite matrix, largest pivot first, up to round-off: the pivots and the lower
/// triangular factor of their rows and columns.
fn pivoted_cholesky(mut rest: DMatrix<f64>) -> (Vec<usize>, DMatrix<f64>) {
    let count = rest.nrows();
    let (mut pivots, mut columns) = (Vec::new(), Vec::new());
    let largest = rest.diagonal().max();
    for _ in 0..count {
        let (pivot, value) = rest.diagonal().argmax();
        if value <= PIVOT_CUT * largest || value.is_nan() {
            break;
        }
        let column = rest.column(pivot) / value.sqrt();
        rest.ger(-1.0, &column, &column, 1.0);
        // What is left of an eliminated pivot is round-off.
        rest[(pivot, pivot)] = 0.0;
        pivots.push(pivot);
        columns.push(column);
    }
    let rank = pivots.len();
    let factor =
        DMatrix::from_fn(rank, rank, |row, column| if row < column { 0.0 } else { columns[column][pivots[row]] });
    (pivots, factor)
}

/// The system's functions at a chart point, and their derivatives along a direction.
fn functions(system: System, chart: &Chart, at: &Vector2<f64>, along: &Vector2<f64>) -> (DVector<f64>, DVector<f64>) {
    match system {
        System::Plane => plane_functions(at, along),
        System::Sphere => sphere_functions(chart, at, along),
    }
}

fn plane_functions(at: &Vector2<f64>, along: &Vector2<f64>) -> (DVector<f64>, DVector<f64>) {
    let (x, y) = (powers(at.x), powers(at.y));
    let value = PLANE_EXPONENTS.iter().map(|&[i, j]| x[i] * y[j]);
    let slope = PLANE_EXPONENTS.iter().map(|&[i, j]| along.x * lowered(i, &x) * y[j] + along.y * x[i] * lowered(j, &y));
    (DVector::from_iterator(PLANE_EXPONENTS.len(), value), DVector::from_iterator(PLANE_EXPONENTS.len(), slope))
}

/// The functions on the sphere, on the scale of [`crate::equations::system::add_sphere_values`], with the sphere's area element.
fn sphere_functions(chart: &Chart, at: &Vector2<f64>, along: &Vector2<f64>) -> (DVector<f64>, DVector<f64>) {
    let point = Vector3::new(at.x / chart.scale, at.y / chart.scale, 1.0);
    let step = Vector3::new(along.x, along.y, 0.0) / chart.scale;
    let depth = point.norm();
    let r = point / depth;
    let dr = (step - r * r.dot(&step)) / depth;
    let element = depth.powi(-3);
    // The element falls with the distance from the axis: its relative slope.
    let fall = -3.0 * r.dot(&step) / depth;
    let (x, y, z) = (powers(r.x * chart.scale), powers(r.y * chart.scale), powers(r.z));
    let value = SPHERE_EXPONENTS.iter().map(|&[l, m, n]| element * x[l] * y[m] * z[n]);
    let slope = SPHERE_EXPONENTS.iter().map(|&[l, m, n]| {
        let (dx, dy) = (dr.x * chart.scale * lowered(l, &x), dr.y * chart.scale * lowered(m, &y));
        let of_element = fall * x[l] * y[m] * z[n];
        element * (of_element + dx * y[m] * z[n] + x[l] * dy * z[n] + x[l] * y[m] * dr.z * lowered(n, &z))
    });
    (DVector::from_iterator(SPHERE_EXPONENTS.len(), value), DVector::from_iterator(SPHERE_EXPONENTS.len(), slope))
}

/// Powers of x from 0 to 6.
fn powers(x: f64) -> [f64; 7] {
    let mut powers = [1.0; 7];
    for k in 1..powers.len() {
        powers[k] = powers[k - 1] * x;
    }
    powers
}

/// Derivative of `x^k` from the powers of x.
fn lowered(k: usize, powers: &[f64; 7]) -> f64 {
    if k == 0 { 0.0 } else { k as f64 * powers[k - 1] }
}
