//! The scale on which moments are compared: their covariance under independent noise of the observed boundary.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use crate::chart::Chart;
use crate::equations::{PLANE_EXPONENTS, SPHERE_EXPONENTS, System};
use crate::error::{Error, Result};
use crate::rings::PlaneRings;

/// Noise of the boundary along its normal, in pixels, for which the second-order part of the covariance is taken.
///
/// Polynomials that vanish on the whole boundary (the product of a quadrilateral's sides) have no first-order noise; this
/// term keeps them from being trusted without end. One pixel is what segmenters reach.
const BOUNDARY_NOISE: f64 = 1.0;

/// Eigenvalues of the covariance below this share of the largest are taken for round-off and their directions left out.
const EIGENVALUE_CUT: f64 = 1e-13;

/// Edges shorter than this, in chart units (the region's area is one), are integrated with one node.
const SHORT_EDGE: f64 = 0.15;

/// Gauss-Legendre nodes on [0, 1] and weights; five are exact for the products of two moments of order 4.
const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_45),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// The matrix W for which `W (predicted - observed)` has unit covariance where every pixel of the boundary has independent
/// noise of one pixel (`docs/math.md`, eq. 6.4).
///
/// `rings` is the observed outline in the chart, `pixel_area` its area in pixels. Directions that the system cannot
/// tell apart (the sphere's monomials are dependent) have zero rows.
///
/// # Errors
/// When the eigenvalues of the covariance do not converge.
pub fn whitening(system: System, chart: &Chart, rings: &PlaneRings, pixel_area: f64) -> Result<DMatrix<f64>> {
    let pixel = 1.0 / pixel_area.sqrt();
    let covariance = boundary_covariance(system, chart, rings, pixel);
    let eigen = covariance.try_symmetric_eigen(f64::EPSILON, 10_000).ok_or(Error::NoConvergence)?;
    let largest = eigen.eigenvalues.max();
    let mut whitening = eigen.eigenvectors.transpose();
    for (mut row, &value) in whitening.row_iter_mut().zip(eigen.eigenvalues.iter()) {
        row *= if value > EIGENVALUE_CUT * largest { value.sqrt().recip() } else { 0.0 };
    }
    Ok(whitening)
}

/// `pixel^3 times the integral over the boundary of (w w^T + (pixel sigma)^2 / 2 w_n w_n^T) ds`, `w_n` the normal derivative.
fn boundary_covariance(system: System, chart: &Chart, rings: &PlaneRings, pixel: f64) -> DMatrix<f64> {
    let count = system.count();
    let mut covariance = DMatrix::zeros(count, count);
    let second_order = 0.5 * (pixel * BOUNDARY_NOISE).powi(2);
    for (a, b) in rings.edges() {
        let length = (b - a).norm();
        let normal = Vector2::new(b.y - a.y, a.x - b.x) / length;
        let nodes = if length < SHORT_EDGE { &[(0.5, 1.0)] } else { &NODES[..] };
        for &(at, weight) in nodes {
            let (value, slope) = functions(system, chart, &(a + (b - a) * at), &normal);
            let ds = weight * length * pixel.powi(3);
            covariance.ger(ds, &value, &value, 1.0);
            covariance.ger(ds * second_order, &slope, &slope, 1.0);
        }
    }
    covariance
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
    let slope = PLANE_EXPONENTS.iter().map(|&[i, j]| {
        along.x * lowered(i, &x) * y[j] + along.y * x[i] * lowered(j, &y)
    });
    (DVector::from_iterator(PLANE_EXPONENTS.len(), value), DVector::from_iterator(PLANE_EXPONENTS.len(), slope))
}

/// The functions on the sphere, on the scale of [`crate::equations::add_sphere_values`], with the sphere's area element.
fn sphere_functions(chart: &Chart, at: &Vector2<f64>, along: &Vector2<f64>) -> (DVector<f64>, DVector<f64>) {
    let point = Vector3::new(at.x / chart.scale, at.y / chart.scale, 1.0);
    let step = Vector3::new(along.x, along.y, 0.0) / chart.scale;
    let depth = point.norm();
    let r = point / depth;
    let dr = (step - r * r.dot(&step)) / depth;
    let element = depth.powi(-3);
    let (x, y, z) = (powers(r.x * chart.scale), powers(r.y * chart.scale), powers(r.z));
    let value = SPHERE_EXPONENTS.iter().map(|&[l, m, n]| element * x[l] * y[m] * z[n]);
    let slope = SPHERE_EXPONENTS.iter().map(|&[l, m, n]| {
        let (dx, dy) = (dr.x * chart.scale * lowered(l, &x), dr.y * chart.scale * lowered(m, &y));
        element * (dx * y[m] * z[n] + x[l] * dy * z[n] + x[l] * y[m] * dr.z * lowered(n, &z))
    });
    (DVector::from_iterator(SPHERE_EXPONENTS.len(), value), DVector::from_iterator(SPHERE_EXPONENTS.len(), slope))
}

/// 1, x, x^2, x^3.
fn powers(x: f64) -> [f64; 4] {
    [1.0, x, x * x, x * x * x]
}

/// Derivative of `x^k` from the powers of x.
fn lowered(k: usize, powers: &[f64; 4]) -> f64 {
    if k == 0 { 0.0 } else { k as f64 * powers[k - 1] }
}
