//! The robust loss of Geman and McClure 1987 (`docs/math.md`, section 11).

/// Weights fall to a quarter at this many scales (Geman-McClure).
const HALF_WIDTH: f64 = 2.0;

/// The weight of a distance against a scale.
pub fn weight(distance: f64, scale: f64) -> f64 {
    let ratio = distance / (HALF_WIDTH * scale);
    (1.0 + ratio * ratio).powi(-2)
}

/// Derivative of a distance times its weight: negative beyond the turning point of the loss.
pub fn slope(distance: f64, scale: f64) -> f64 {
    let square = (distance / (HALF_WIDTH * scale)).powi(2);
    (1.0 - 3.0 * square) * (1.0 + square).powi(-3)
}
