//! Effective numbers of observations on contours, and the degrees of freedom that a pose leaves (`docs/math.md`, eq. 11.12).

use super::readings::Contour;
use crate::geometry::pose::PARAMETERS;

/// Number of observations that the prior of the corners' noise counts as: a convention.
pub(super) const PRIOR_OBSERVATIONS: f64 = 1.0;

/// Effective number of observations of the contours at most, from every `step`-th piece.
pub(super) fn observation_count(contours: &[Contour], step: usize) -> f64 {
    contours.iter().map(|contour| contour.numbers(step)).sum()
}

/// Residual degrees of freedom of the contours' noise, with those of its prior: the pose takes six.
pub fn residual_dof(contours: &[Contour], step: usize) -> f64 {
    (observation_count(contours, step) - PARAMETERS as f64).max(0.0) + PRIOR_OBSERVATIONS
}
