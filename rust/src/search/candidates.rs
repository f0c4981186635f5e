//! The candidates, led to minima of the moments' equations or onto the contours, and which of both decide.

use std::iter;

use super::acceptance::is_found;
use super::decision::decides;
use super::further::further_poses;
use super::moments::{Alone, CANDIDATE, MOST_CANDIDATES, SAME_CANDIDATE, single_region_poses};
use super::poses::apart;
use super::ranking::{COARSE_AMBIGUITY, MOST_LED, could_be, likeliest, likely, nearest, once};
use super::screen::Looks;
use super::symmetry::turned_poses;
use crate::contour::fit::{AMBIGUITY, ContourFit, refined, refined_again};
use crate::contour::readings::Contour;
use crate::equations::least_squares::{Minimum, minimize};
use crate::equations::residual::RegionEquations;
use crate::equations::system::Weighting;
use crate::geometry::pose::Pose;
use crate::prior::Prior;
use crate::problem::Problem;

/// How many times as many pieces follow a refinement on few: a convention.
const MORE_PIECES: usize = 5;

/// Poses nearer than this, rad and share of the distance, are one place on the contours: both were led there.
pub const SAME_PLACE: f64 = 1e-3;

/// Poses about the problem's origin.
#[derive(Debug, Clone)]
pub(crate) enum Answers {
    /// Near minima of the moments' equations, which average the noise of the whole outlines.
    Moments(Vec<Pose>),
    /// Led onto the clean pieces of the contours.
    Contours(Vec<ContourFit>),
}

impl Problem {
    /// Whether any region has hidden edges.
    pub(super) fn hides_edges(&self) -> bool {
        self.regions().iter().any(RegionEquations::hides_edges)
    }
}

/// Minima of the whitened equations near the likeliest poses, those that could fit as well as the best: by the equations, which
/// know what a pose shows beyond the observed contours, and by these.
pub(super) fn by_moments(problem: &Problem, poses: Vec<Pose>, prior: &Prior) -> Vec<Pose> {
    if poses.len() <= 1 {
        return poses;
    }
    let few = problem.few();
    let poses = likeliest(problem.contours(), poses, few, MOST_CANDIDATES);
    let solved = |pose: Pose| minimize(problem.regions(), &pose, Weighting::Whitened, CANDIDATE);
    let minima: Vec<Minimum> = poses.into_iter().map(solved).collect();
    let least = minima.iter().map(|minimum| minimum.cost).fold(f64::INFINITY, f64::min);
    let limit = COARSE_AMBIGUITY * (least + (AMBIGUITY + problem.most_penalty(prior)) * problem.noise_variance(least));
    let fitting = minima.into_iter().filter(|minimum| minimum.cost <= limit);
    let fits = fitting.filter_map(|minimum| ContourFit::at(problem.contours(), &minimum.pose, few));
    let fits = could_be(problem, once(fits.collect(), usize::MAX, SAME_CANDIDATE), prior);
    fits.into_iter().map(|fit| fit.pose).collect()
}

/// The candidates led onto the contours, or the minima of the moments where these do not decide.
pub(super) fn on_contours(
    problem: &Problem,
    poses: Vec<Pose>,
    prior: &Prior,
    looks: &Looks,
    alone: &mut Alone,
) -> Answers {
    let (contours, few) = (problem.contours(), problem.few());
    let places = places(problem, poses, prior, looks, alone);
    if problem.hides_edges() {
        return Answers::Contours(places);
    }
    let Some(place) = places.first() else { return Answers::Moments(Vec::new()) };
    let solved = |place: &ContourFit| minimize(problem.regions(), &place.pose, Weighting::Whitened, CANDIDATE).pose;
    let own = solved(place);
    let minima = iter::once(own).chain(places[1..].iter().map(solved)).collect();
    let minima = by_moments(problem, minima, prior);
    let Some(minimum) = minima.first() else { return Answers::Contours(places) };
    // A few pieces decide where they tell enough; all of them tell more.
    let decided = [few, 1].into_iter().any(|step| decides(contours, &place.pose, minimum, &own, step));
    if decided { Answers::Contours(places) } else { Answers::Moments(minima) }
}

/// The likeliest poses on the contours: the candidates, further ones where none of these is found, and other turns of a
/// plane, each refined on few pieces, then on all.
fn places(problem: &Problem, poses: Vec<Pose>, prior: &Prior, looks: &Looks, alone: &mut Alone) -> Vec<ContourFit> {
    let contours = problem.contours();
    let few = problem.few();
    let led = |poses: Vec<Pose>| poses.iter().filter_map(|pose| looks.led_from(pose)).collect::<Vec<_>>();
    let known = looks.known.iter().copied();
    let starts = likeliest(contours, poses, few, MOST_LED).into_iter().chain(known).collect();
    let mut found = led(starts);
    if problem.hides_edges() || !found.iter().any(is_found) {
        let single = single_region_poses(problem, alone);
        found.extend(led(further_poses(problem, &single)));
        found.extend(own_fits(problem, &single));
    }
    let mut all = sharpened(problem, found, few, prior);
    if let Some(best) = all.first() {
        let turned = led(turned_poses(problem, &best.pose, few));
        all.extend(sharpened(problem, turned, few, prior));
    }
    could_be(problem, once(all, usize::MAX, SAME_PLACE), prior)
}

/// The fits led on from every `step`-th piece to all, those that could be as likely as the best.
fn sharpened(problem: &Problem, mut fits: Vec<ContourFit>, mut step: usize, prior: &Prior) -> Vec<ContourFit> {
    while step > 1 {
        let likely = likely(problem, fits, prior);
        step = (step / MORE_PIECES).max(1);
        fits = likely.iter().flat_map(|fit| led_on(problem.contours(), fit, step)).collect();
    }
    once(fits, usize::MAX, SAME_PLACE)
}

/// Where a fit leads on more pieces from a wide scale and, where that is away from it and of several regions some may be elsewhere,
/// from its own scatter.
fn led_on(contours: &[Contour], fit: &ContourFit, step: usize) -> Vec<ContourFit> {
    let led = refined(contours, &fit.pose, step);
    let away = led.as_ref().is_none_or(|led| apart(&led.pose, &fit.pose, SAME_CANDIDATE));
    let beside = if away && contours.len() > 1 { refined_again(contours, fit, step) } else { None };
    led.into_iter().chain(beside).collect()
}

/// The fits of poses that single regions give, led onto their own contours whatever the others show, since these may be elsewhere.
fn own_fits(problem: &Problem, single: &[Vec<Pose>]) -> Vec<ContourFit> {
    let (contours, few) = (problem.contours(), problem.few());
    let own = single.iter().zip(contours).flat_map(|(poses, contour)| {
        let contour = std::slice::from_ref(contour);
        let poses = nearest(contour, poses.clone(), few, (MOST_LED / contours.len()).max(1));
        poses.into_iter().filter_map(move |pose| refined(contour, &pose, few))
    });
    own.filter_map(|fit| ContourFit::at(contours, &fit.pose, few)).collect()
}
