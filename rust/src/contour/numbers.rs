//! How many numbers contours are, and how many of these tell how far off they are (`docs/math.md`, eq. 11.12).

use super::readings::Contour;
use crate::geometry::pose::PARAMETERS;

/// How many numbers what is known of a corner before any is seen counts as: a convention.
pub(super) const BEFORE: f64 = 1.0;

/// How many numbers the contours are at most, from every `step`-th piece.
pub(super) fn told(contours: &[Contour], step: usize) -> f64 {
    contours.iter().map(|contour| contour.numbers(step)).sum()
}

/// How many of them tell how far off the contours are, with what is known before: six a pose fits whatever they are.
pub fn telling(contours: &[Contour], step: usize) -> f64 {
    (told(contours, step) - PARAMETERS as f64).max(0.0) + BEFORE
}
