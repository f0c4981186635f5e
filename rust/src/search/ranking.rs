//! Candidates ranked and pruned by the likelihood of the contours.

use std::iter;

use super::poses::{SAME, distinct, sorted};
use crate::budget::Budget;
use crate::contour::fit::{ContourFit, FixedMixture};
use crate::contour::readings::Contour;
use crate::geometry::pose::{PARAMETERS, Pose};
use crate::math::odds::{DECISIVE, DECISIVE_DEVIANCE, UNREFINED};
use crate::prior::{MAX_PENALTY, Prior};
use crate::problem::Problem;

/// Log likelihood of a piece, in the mean, by which a pose of several regions is behind the best that no refinement makes up: what
/// decides, over twice as many independent pieces as a pose has parameters.
pub(super) const MAX_DEFICIT: f64 = DECISIVE / (2 * PARAMETERS) as f64;

/// Poses of one kind that are refined on the contours at most, those that are likeliest: a convention.
pub(super) const MOST_REFINED: usize = 16;

impl Problem {
    /// Largest penalty of a prior and of the regions' visible sides, in variances.
    pub(crate) fn max_penalty(&self, prior: &Prior) -> f64 {
        let sides = self.worlds().iter().filter(|world| world.viewpoint().is_some()).count();
        prior.max_penalty() + MAX_PENALTY * sides as f64
    }
}

/// The likeliest fits, each pose once.
pub(super) fn deduplicated(fits: Vec<ContourFit>, most: usize, limit: f64) -> Vec<ContourFit> {
    let scored = fits.into_iter().map(|fit| (-fit.mixture.likelihood, fit)).collect();
    distinct(scored, most, limit, |fit| &fit.pose).into_iter().map(|(_, fit)| fit).collect()
}

/// The fits, sorted, that could be as likely as the first once they are solved.
pub(super) fn within_ambiguity(problem: &Problem, fits: Vec<ContourFit>, prior: &Prior) -> Vec<ContourFit> {
    let limit = UNREFINED * UNREFINED * (DECISIVE_DEVIANCE + problem.max_penalty(prior));
    let mut fits = fits.into_iter();
    let Some(best) = fits.next() else { return Vec::new() };
    // By all pieces: with the degrees of freedom of the noise alone, more candidates follow, and of 120 problems with two of three
    // regions swapped two end at a wrong pose in place of the right one (`benchmarks/confidence.py`).
    let pruned: Vec<ContourFit> = fits.filter(|fit| best.deviance_to(fit, f64::INFINITY) <= limit).collect();
    iter::once(best).chain(pruned).collect()
}

/// The fits that could be as likely as the best, each once.
pub(super) fn likely(problem: &Problem, fits: Vec<ContourFit>, prior: &Prior) -> Vec<ContourFit> {
    within_ambiguity(problem, deduplicated(fits, MOST_REFINED, SAME), prior)
}

/// The likeliest poses on every `step`-th piece, without any being moved.
pub(super) fn likeliest(
    contours: &[Contour],
    poses: Vec<Pose>,
    step: usize,
    most: usize,
    budget: &Budget,
) -> Vec<Pose> {
    if poses.len() <= 1 {
        return poses;
    }
    let fixed = FixedMixture::new(contours, step, budget);
    let scored = sorted(poses.into_iter().map(|pose| (fixed.negative_log_density(&pose), pose)).collect());
    // A single region may be disturbed so much that its moments have no minimum near the pose; several reject a wrong pose on few pieces.
    let worst = if contours.len() > 1 { MAX_DEFICIT } else { f64::INFINITY };
    let least = scored.first().map_or(0.0, |(cost, _)| *cost);
    scored.into_iter().take(most).take_while(|(cost, _)| *cost <= least + worst).map(|(_, pose)| pose).collect()
}

/// Each pose once, those that lie nearest to the contours.
pub(super) fn nearest(contours: &[Contour], poses: Vec<Pose>, step: usize, most: usize, budget: &Budget) -> Vec<Pose> {
    let fixed = FixedMixture::new(contours, step, budget);
    let scored = poses.into_iter().map(|pose| (fixed.negative_log_density(&pose), pose)).collect();
    distinct(scored, most, SAME, |pose| pose).into_iter().map(|(_, pose)| pose).collect()
}
