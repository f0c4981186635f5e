//! Probability that a normal rotation error is within a radius (`docs/math.md`, eq. 15.2).

use nalgebra::Matrix6;

use super::weakness::principal;
use crate::math::normal::{cumulative, density};
use crate::moments::quadrature::{Node, gauss_legendre};

/// Rotation, degrees, within which a pose is right: a convention.
pub(super) const RIGHT: f64 = 5.0;

/// Bounds of a rotation's deviation, degrees, beyond which no problem was.
const ROTATION: (f64, f64) = (1e-3, 1e2);

/// Standard deviations that an integral goes to: beyond lie 2e-9 of a normal distribution.
const FAR: f64 = 6.0;

/// Over each axis but the last; with [`FAR`] the probability is exact to 4e-9 (`cargo test nearness::`).
const RULE: [Node; 16] = gauss_legendre();

/// Probability that a pose at the right place, of this covariance, is within 5 degrees of the true one.
pub fn nearness(covariance: &Matrix6<f64>) -> f64 {
    within_limit(rotation_sigmas(covariance))
}

/// Probability that a rotation of these deviations about its principal axes, degrees, is within 5 degrees.
pub(super) fn within_limit(sigmas: [f64; 3]) -> f64 {
    let mut sigmas = sigmas.map(bounded);
    sigmas.sort_by(f64::total_cmp);
    within(RIGHT, &sigmas).min(1.0)
}

/// Standard deviations of the rotation about its principal axes, degrees; infinite where they are not finite.
pub(super) fn rotation_sigmas(covariance: &Matrix6<f64>) -> [f64; 3] {
    let eigen = principal(&covariance.fixed_view::<3, 3>(0, 0).into_owned());
    eigen.map_or([f64::INFINITY; 3], |eigen| eigen.eigenvalues.map(|v| v.max(0.0).sqrt().to_degrees()).into())
}

/// The deviation within the bounds.
fn bounded(sigma: f64) -> f64 {
    let (least, most) = ROTATION;
    // The comparison's order makes a NaN the largest deviation.
    sigma.min(most).max(least)
}

/// Probability that a normal vector of these deviations, the smallest first, is no longer than a radius.
fn within(radius: f64, sigmas: &[f64]) -> f64 {
    let [sigma, other_sigmas @ ..] = sigmas else { return 1.0 };
    if other_sigmas.is_empty() {
        return 2.0 * cumulative(radius / sigma) - 1.0;
    }
    // By the angle whose sine is the share of the radius: what is left of it is smooth up to its end.
    let most = (FAR * sigma / radius).min(1.0).asin();
    let at = |&(node, weight): &Node| {
        let (sine, cosine) = (most * node).sin_cos();
        weight * cosine * density(radius * sine / sigma) * within(radius * cosine, other_sigmas)
    };
    2.0 * most * radius / sigma * RULE.iter().map(at).sum::<f64>()
}
