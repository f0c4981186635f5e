//! Outlier regions: those that contradict a pose that others support (`docs/math.md`, sections 11 and 17).

use super::solution::{POOR_OVERLAP, Solution};
use crate::contour::members::log_odds;
use crate::noise::boundary::DRAWN;
use crate::samples::label_model::contradicts;
use crate::samples::posterior::Posterior;

/// A region that does not belong to a pose: the share of it that lies where the pose puts it, and the least of the others', percent.
pub(super) struct Outlier {
    pub(super) region: usize,
    pub(super) percent: f64,
    pub(super) others: f64,
}

/// The regions that do not belong to a pose while others do: of contours first, then of samples.
pub(super) fn outliers(solution: &Solution, sampled: &[usize]) -> Vec<Outlier> {
    let of_contours = contour_outliers(solution, sampled);
    let of_samples = solution.posterior.iter().flat_map(|posterior| sample_outliers(posterior, sampled));
    of_contours.into_iter().chain(of_samples).collect()
}

/// Outliers by their contours.
fn contour_outliers(solution: &Solution, sampled: &[usize]) -> Vec<Outlier> {
    let (odds, shares) = (log_odds(&solution.fit), solution.fit.clean_shares());
    // A pose by the moments is a compromise of all regions.
    if solution.minimum.is_some() || solution.fit.mixture.sigma >= DRAWN {
        return Vec::new();
    }
    // One region alone may lie on its projection by chance, two hardly; of two regions one has to do.
    let needed = (odds.len() - 1).min(2);
    let outlier = |region: usize| {
        let inlier_shares = (0..odds.len()).filter(|&other| other != region && odds[other] >= 0.0);
        let inlier_shares: Vec<f64> = inlier_shares.map(|other| shares[other]).collect();
        let least = inlier_shares.iter().copied().reduce(f64::min).filter(|_| inlier_shares.len() >= needed)?;
        Some(Outlier { region, percent: 100.0 * shares[region], others: 100.0 * least })
    };
    let elsewhere = |&region: &usize| {
        let is_off = solution.region_overlap_errors[region] >= POOR_OVERLAP && !sampled.contains(&region);
        is_off && odds[region] < 0.0
    };
    (0..odds.len()).filter(elsewhere).filter_map(outlier).collect()
}

/// Outliers by the labels of their samples.
fn sample_outliers(posterior: &Posterior, sampled: &[usize]) -> Vec<Outlier> {
    let right: Vec<f64> = posterior.wrong_fractions.iter().map(|wrong| 100.0 * (1.0 - wrong)).collect();
    let others_of = |place: usize| {
        let others = right
            .iter()
            .enumerate()
            .filter(|&(other, _)| other != place && !contradicts(posterior.wrong_fractions[other]));
        others.map(|(_, &right)| right).reduce(f64::min)
    };
    let outlier = |(place, &region): (usize, &usize)| {
        let others = others_of(place).filter(|_| contradicts(posterior.wrong_fractions[place]))?;
        Some(Outlier { region, percent: right[place], others })
    };
    sampled.iter().enumerate().filter_map(outlier).collect()
}
