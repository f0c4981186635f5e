//! Gaussian factors of outlines beside those of samples (`docs/math.md`, section 17).

use std::f64::consts::TAU;

use crate::budget::Budget;
use crate::contour::fit::ContourFit;
use crate::contour::readings::Contour;
use crate::geometry::pose::Pose;
use crate::math::gaussian::Gaussian;
use crate::noise::boundary::FINE;

/// The Gaussian factor of contours without samples at a pose, by their independent pieces (`docs/math.md`, eq. 11.5).
pub(super) fn outlines(contours: &[Contour], pose: &Pose, budget: &Budget) -> Gaussian {
    if contours.is_empty() {
        return Gaussian::default();
    }
    // Out of view nothing can be likely.
    let hopeless = Gaussian { offset: -f64::MAX.sqrt(), ..Gaussian::default() };
    let fit = ContourFit::at(contours, pose, 1, budget);
    fit.and_then(|fit| fit.gaussian(contours, budget)).unwrap_or(hopeless)
}

/// The Gaussian factor of outlines whose regions have samples, at a pose: they may be off alike all around, by as much as their clean
/// pieces are, so each region counts as one piece (`docs/math.md`, eq. 17.12); every `step`-th piece is evaluated.
pub(super) fn outlines_beside_samples(contours: &[Contour], pose: &Pose, step: usize, budget: &Budget) -> Gaussian {
    if contours.is_empty() {
        return Gaussian::default();
    }
    // Out of view an outline is as far off as a region is large.
    let size = contours.iter().map(Contour::size).fold(FINE, f64::max);
    let count = contours.len() as f64;
    let unseen = Gaussian { offset: -0.5 * count * (1.0 + (TAU * size * size).ln()), ..Gaussian::default() };
    let one_piece = |fit: ContourFit| Some(fit.gaussian(contours, budget)? * (count / fit.independent().max(1.0)));
    ContourFit::at(contours, pose, step, budget).and_then(one_piece).unwrap_or(unseen)
}
