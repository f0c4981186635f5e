//! Refinement of candidates, by the moments' equations or on the contours, and the choice between both.

use std::iter;

use super::acceptance::is_found;
use super::decision::decides;
use super::further::further_poses;
use super::moments::{CANDIDATE, MOST_CANDIDATES, SingleRegionCache, single_region_poses};
use super::poses::{SAME, apart};
use super::ranking::{MOST_REFINED, deduplicated, likeliest, likely, nearest, within_ambiguity};
use super::screen::CandidateScreen;
use super::symmetry::turned_poses;
use crate::budget::Budget;
use crate::contour::fit::{ContourFit, refined, refined_again};
use crate::contour::readings::Contour;
use crate::equations::least_squares::{Minimum, minimize};
use crate::equations::residual::RegionEquations;
use crate::equations::system::Weighting;
use crate::geometry::pose::Pose;
use crate::math::odds::{DECISIVE_DEVIANCE, UNREFINED};
use crate::prior::Prior;
use crate::problem::Problem;

/// Ratio of the numbers of pieces of successive refinements: a convention.
const MORE_PIECES: usize = 5;

/// Poses about the problem's origin.
#[derive(Debug, Clone)]
pub(crate) enum Candidates {
    /// Near minima of the moments' equations, which average the noise of the whole outlines.
    NearMinima(Vec<Pose>),
    /// Refined on the clean pieces of the contours.
    OnContours(Vec<ContourFit>),
}

impl Problem {
    /// Whether any region has hidden edges.
    pub(super) fn hides_edges(&self) -> bool {
        self.regions().iter().any(RegionEquations::hides_edges)
    }
}

/// Minima of the whitened equations near the likeliest poses, those that could fit as well as the best: by the equations, which
/// include what a pose shows beyond the observed contours, and by these.
pub(super) fn whitened_minima(problem: &Problem, poses: Vec<Pose>, prior: &Prior, budget: &Budget) -> Vec<Pose> {
    if poses.len() <= 1 {
        return poses;
    }
    let few = problem.coarse_stride();
    let poses = likeliest(problem.contours(), poses, few, MOST_CANDIDATES, budget);
    let solved = |pose: Pose| minimize(problem.regions(), &pose, Weighting::Whitened, CANDIDATE, budget);
    let minima: Vec<Minimum> = poses.into_iter().map(solved).collect();
    let least = minima.iter().map(|minimum| minimum.cost).fold(f64::INFINITY, f64::min);
    let limit = UNREFINED
        * UNREFINED
        * (least + (DECISIVE_DEVIANCE + problem.max_penalty(prior)) * problem.noise_variance(least));
    let fitting = minima.into_iter().filter(|minimum| minimum.cost <= limit);
    let fits = fitting.filter_map(|minimum| ContourFit::at(problem.contours(), &minimum.pose, few, budget));
    let fits = within_ambiguity(problem, deduplicated(fits.collect(), usize::MAX, SAME), prior);
    fits.into_iter().map(|fit| fit.pose).collect()
}

/// The candidates refined on the contours, or the minima of the moments where these do not decide.
pub(super) fn refined_on_contours(
    problem: &Problem,
    poses: Vec<Pose>,
    prior: &Prior,
    screen: &CandidateScreen,
    cache: &mut SingleRegionCache,
    budget: &Budget,
) -> Candidates {
    let (contours, few) = (problem.contours(), problem.coarse_stride());
    let places = places(problem, poses, prior, screen, cache, budget);
    if problem.hides_edges() {
        return Candidates::OnContours(places);
    }
    let Some(place) = places.first() else { return Candidates::NearMinima(Vec::new()) };
    let solved =
        |place: &ContourFit| minimize(problem.regions(), &place.pose, Weighting::Whitened, CANDIDATE, budget).pose;
    let own = solved(place);
    let minima = iter::once(own).chain(places[1..].iter().map(solved)).collect();
    let minima = whitened_minima(problem, minima, prior, budget);
    let Some(minimum) = minima.first() else { return Candidates::OnContours(places) };
    // A few pieces decide if they suffice; otherwise all of them.
    let decided = [few, 1].into_iter().any(|step| decides(contours, &place.pose, minimum, &own, step, budget));
    if decided { Candidates::OnContours(places) } else { Candidates::NearMinima(minima) }
}

/// The likeliest poses on the contours: the candidates, further ones where none of these is found, and other turns of a
/// plane, each refined on few pieces, then on all.
fn places(
    problem: &Problem,
    poses: Vec<Pose>,
    prior: &Prior,
    screen: &CandidateScreen,
    cache: &mut SingleRegionCache,
    budget: &Budget,
) -> Vec<ContourFit> {
    let contours = problem.contours();
    let few = problem.coarse_stride();
    let refined_all = |poses: Vec<Pose>| poses.iter().filter_map(|pose| screen.refined_from(pose)).collect::<Vec<_>>();
    let prior_poses = screen.prior_poses.iter().copied();
    let starts = likeliest(contours, poses, few, MOST_REFINED, budget).into_iter().chain(prior_poses).collect();
    let mut found = refined_all(starts);
    if problem.hides_edges() || !found.iter().any(is_found) {
        let single = single_region_poses(problem, cache, budget);
        found.extend(refined_all(further_poses(problem, &single, budget)));
        found.extend(single_region_fits(problem, &single, budget));
    }
    let mut all = refined_finely(problem, found, few, prior, budget);
    if let Some(best) = all.first() {
        let turned = refined_all(turned_poses(problem, &best.pose, few, budget));
        all.extend(refined_finely(problem, turned, few, prior, budget));
    }
    within_ambiguity(problem, deduplicated(all, usize::MAX, SAME), prior)
}

/// The fits refined from every `step`-th piece to all, those that could be as likely as the best.
fn refined_finely(
    problem: &Problem,
    mut fits: Vec<ContourFit>,
    mut step: usize,
    prior: &Prior,
    budget: &Budget,
) -> Vec<ContourFit> {
    while step > 1 {
        let likely = likely(problem, fits, prior);
        step = (step / MORE_PIECES).max(1);
        fits = likely.iter().flat_map(|fit| refined_on(problem.contours(), fit, step, budget)).collect();
    }
    deduplicated(fits, usize::MAX, SAME)
}

/// A fit refined on more pieces from a wide scale and, where that moves away and some of several regions may be outliers, once more
/// from its own scatter.
fn refined_on(contours: &[Contour], fit: &ContourFit, step: usize, budget: &Budget) -> Vec<ContourFit> {
    let from_wide = refined(contours, &fit.pose, step, budget);
    let has_moved = from_wide.as_ref().is_none_or(|next| apart(&next.pose, &fit.pose, SAME));
    let from_own = if has_moved && contours.len() > 1 { refined_again(contours, fit, step, budget) } else { None };
    from_wide.into_iter().chain(from_own).collect()
}

/// The fits of single regions' poses, each refined on its own contour alone, since the other regions may be outliers.
fn single_region_fits(problem: &Problem, single: &[Vec<Pose>], budget: &Budget) -> Vec<ContourFit> {
    let (contours, few) = (problem.contours(), problem.coarse_stride());
    let own = single.iter().zip(contours).flat_map(|(poses, contour)| {
        let contour = std::slice::from_ref(contour);
        let poses = nearest(contour, poses.clone(), few, (MOST_REFINED / contours.len()).max(1), budget);
        poses.into_iter().filter_map(move |pose| refined(contour, &pose, few, budget))
    });
    own.filter_map(|fit| ContourFit::at(contours, &fit.pose, few, budget)).collect()
}
