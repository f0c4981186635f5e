//! Model choice between the fit on the contours and the minimum of the moments, the better one of contours that are disturbed all over
//! (`docs/math.md`, eq. 11.15).

use super::acceptance::is_mostly_clean;
use crate::budget::Budget;
use crate::contour::covariance::covariance;
use crate::contour::fit::ContourFit;
use crate::contour::readings::Contour;
use crate::geometry::pose::{PARAMETERS, Pose};
use crate::math::odds::DECISIVE;
use crate::prior::{MAX_PENALTY, mahalanobis};

/// Whether every `step`-th piece prefers a fit on the contours decisively to a minimum of the moments; `own` is the minimum reached from
/// the fit, which must not contradict it.
pub(super) fn decides(
    contours: &[Contour],
    place: &Pose,
    minimum: &Pose,
    own: &Pose,
    step: usize,
    budget: &Budget,
) -> bool {
    let at = |pose: &Pose| ContourFit::at(contours, pose, step, budget);
    let [Some(place), Some(minimum)] = [place, minimum].map(at) else { return true };
    let gain = place.gain_over(&minimum);
    holds_a_pose(&place)
        && gain >= DECISIVE
        && gain - at(own).map_or(0.0, |own| moment_log_odds(contours, &place, &own, budget)) >= DECISIVE
}

/// Whether as many independent parts of the contours are clean as a pose has parameters: fewer may lie on the projection by chance.
fn holds_a_pose(place: &ContourFit) -> bool {
    let shares = place.clean_shares();
    place.independent() * shares.iter().sum::<f64>() >= (PARAMETERS * shares.len()) as f64
}

/// Log odds of the moments against a fit on the contours.
///
/// Disturbances add and remove area alike, so that the moments are off by chance alone. Pieces that lie
/// on a wrong boundary side by side, as those of squares of one size do, are half of a contour at the most: where more than that is
/// clean, the rest may be off to one side.
fn moment_log_odds(contours: &[Contour], place: &ContourFit, minimum: &ContourFit, budget: &Budget) -> f64 {
    if is_mostly_clean(place) {
        return 0.0;
    }
    let increment = minimum.pose.local_coordinates(&place.pose);
    let deviations = mahalanobis(&increment, &covariance(contours, minimum, budget));
    contradiction(deviations * deviations)
}

/// Log odds that a pose `square` variances away has larger deviations than estimated: by the likeliest multiple of these, bounded like
/// the penalty of any prior.
fn contradiction(square: f64) -> f64 {
    let parameters = PARAMETERS as f64;
    let multiple = (square.min(MAX_PENALTY) / parameters).max(1.0);
    0.5 * parameters * (multiple - 1.0 - multiple.ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contradiction_counts_from_chance_to_the_largest_penalty() {
        assert!(contradiction(0.0) == 0.0 && contradiction(6.0) == 0.0);
        // The densities of six parameters with their own deviations and with those twice as large, at twice the distance.
        let density = |scale: f64, square: f64| -0.5 * square / (scale * scale) - 6.0 * scale.ln();
        assert!((contradiction(24.0) - (density(2.0, 24.0) - density(1.0, 24.0))).abs() < 1e-12);
        assert!(contradiction(1e6) == contradiction(MAX_PENALTY) && contradiction(MAX_PENALTY) > 38.0);
    }
}
