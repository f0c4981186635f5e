//! The standard normal distribution.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Standard deviation over the median of absolute deviations: `1 / norm.ppf(3/4)`.
pub const MAD_TO_SIGMA: f64 = 1.482_602_218_505_602;

/// Standard deviations beyond which a number is an outlier of a normal distribution, and two are different: one in 370 is by chance. A
/// convention.
pub const OUTLIER_SIGMAS: f64 = 3.0;

/// Degrees of freedom of Student's distribution where a deviation is known roughly: the fewest whose variance, twice the squared scale,
/// is estimated from few errors.
pub const STUDENT_FREEDOM: f64 = 4.0;

/// Density.
pub fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * PI).sqrt()
}

/// Probability of at most `x`.
pub fn cumulative(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}
