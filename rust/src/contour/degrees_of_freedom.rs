//! Effective numbers of observations on contours, and the degrees of freedom that a pose leaves (`docs/math.md`, eq. 11.12).

use super::readings::Contour;
use crate::geometry::pose::PARAMETERS;

/// How many numbers what is known of a corner before any is seen counts as: a convention.
pub(super) const PRIOR_OBSERVATIONS: f64 = 1.0;

/// How many numbers the contours are at most, from every `step`-th piece.
pub(super) fn observation_count(contours: &[Contour], step: usize) -> f64 {
    contours.iter().map(|contour| contour.numbers(step)).sum()
}

/// How many of them tell how far off the contours are, with what is known before: six a pose fits whatever they are.
pub fn residual_dof(contours: &[Contour], step: usize) -> f64 {
    (observation_count(contours, step) - PARAMETERS as f64).max(0.0) + PRIOR_OBSERVATIONS
}
