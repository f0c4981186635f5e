//! Multi-start inference from samples, its modes ranked by their evidence (`docs/math.md`, section 17).

use nalgebra::{Matrix6, Rotation3, Vector2, Vector3};

use super::further::further_poses;
use super::moments::{SingleRegionCache, single_region_poses};
use super::outlined::{outlines, outlines_beside_samples};
use super::poses::{SAME, apart, distinct};
use super::symmetry::turned_about;
use crate::budget::Budget;
use crate::contour::readings::Contour;
use crate::equations::step_bounds::CONVERGENCE_RADIUS;
use crate::geometry::pose::{PARAMETERS, Pose};
use crate::math::gaussian::Gaussian;
use crate::math::normal::OUTLIER_SIGMAS;
use crate::math::odds::{DECISIVE, DECISIVE_DEVIANCE, ONE_VARIANCE, UNREFINED};
use crate::noise::boundary::{COARSE, DRAWN, ROUGH};
use crate::noise::contamination::SIZE_RATIO;
use crate::prior::Prior;
use crate::problem::Problem;
use crate::region::WorldRegion;
use crate::samples::anneal::{CoarseFit, VisitedStates, anneal, fit_coarse};
use crate::samples::label_model::{contradicts, log_likelihood, subsample_stride};
use crate::samples::margin::SampledRegion;
use crate::samples::posterior::{Posterior, likeliest};
use crate::samples::signed_distance::SignedDistanceField;

/// Starts that are refined.
const MOST_STARTS: usize = 24;

/// Log odds, by the subsample, by which a refined start is behind the best that all samples do not make up. A start that is not refined
/// yet, or not to the end with all samples, makes up as much again: without that, half turns that fit about as well in
/// the end were lost on the way (`python -m benchmarks trust --seed 182 --scenes 1 --only model=combined`, and `--seed 109`, `lidar`).
const MAX_DEFICIT: f64 = UNREFINED * DECISIVE;

/// Squared Mahalanobis distance below which two modes are one answer: they are no outliers of one another.
const ONE_ANSWER: f64 = OUTLIER_SIGMAS * OUTLIER_SIGMAS;

/// Points along an outline at which samples beside it are searched: a convention.
const OUTLINE_POINTS: usize = 128;

impl Problem {
    /// Modes of the samples' posterior about some starts and, where samples contradict all of these, about further ones; the
    /// likeliest first. Poses are about the problem's origin.
    pub(crate) fn posteriors(&self, starts: &[Pose], prior: &Prior, budget: &Budget) -> Vec<Posterior> {
        let mut found = self.posteriors_with(starts, prior, budget);
        let agrees = |posterior: &Posterior| is_found(posterior) && self.penalty(posterior, prior) < DECISIVE_DEVIANCE;
        if prior.max_penalty() > 0.0 && !found.first().is_some_and(agrees) {
            // A prior that samples contradict may be wrong: poses without it bear its bounded penalty.
            let without = self.posteriors_with(starts, &Prior::default(), budget);
            found.extend(without.into_iter().map(|posterior| {
                let penalty = self.penalty(&posterior, prior);
                posterior.with_log_prior(-0.5 * penalty)
            }));
        }
        self.answers(&modes(found))
    }

    /// The penalty of a prior for a posterior, in variances.
    fn penalty(&self, posterior: &Posterior, prior: &Prior) -> f64 {
        prior.penalty(&self.uncentered(&posterior.pose), &posterior.covariance)
    }

    /// The modes with a prior, the likeliest first.
    fn posteriors_with(&self, starts: &[Pose], prior: &Prior, budget: &Budget) -> Vec<Posterior> {
        let (outlined, guessed) = (self.outlined(), self.guessed());
        let creases = self.creases(budget);
        let factor_at = |pose: &Pose| {
            let factor = prior.gaussian(&self.uncentered(pose)) + outlines(&outlined, pose, budget);
            let factor = factor + outlines_beside_samples(&guessed, pose, self.coarse_stride(), budget);
            creases.iter().fold(factor, |sum, crease| sum + crease.gaussian(pose))
        };
        let mut visited = VisitedStates::default();
        let mut found = self.posteriors_near(starts, &[], &factor_at, &mut visited, budget);
        if !found.iter().any(is_found) {
            let single = single_region_poses(self, &mut SingleRegionCache::default(), budget);
            let further = further_poses(self, &single, budget);
            let near = self.posteriors_near(&further, &found, &factor_at, &mut visited, budget);
            found.extend(near);
        }
        let mut last_refined: Option<Posterior> = None;
        // A symmetric shape fits from several places, of which the starts may have missed one, and sparse samples hold some on
        // the way to theirs.
        while let Some(likeliest) = likeliest_of(&found).filter(|best| {
            let is_another =
                |last: &Posterior| best.log_evidence() > last.log_evidence() && !is_same_answer(last, best);
            last_refined.as_ref().is_none_or(is_another)
        }) {
            let best = likeliest.pose;
            let (regions, step) = (self.sampled(), subsample_stride(self.sampled()));
            let cost = |pose: &Pose| -log_likelihood(regions, pose, COARSE, step, budget);
            let turned = turned_about(self, &best, cost, MAX_DEFICIT);
            let starts: Vec<Pose> = turned.into_iter().chain(beside(&best)).collect();
            let near = self.posteriors_near(&starts, &found, &factor_at, &mut visited, budget);
            found.extend(near);
            last_refined = Some(likeliest);
        }
        modes(found)
    }

    /// The posteriors of the likeliest starts, without those that the subsample refines to an answer that is found already.
    fn posteriors_near(
        &self,
        starts: &[Pose],
        found: &[Posterior],
        factor_at: &impl Fn(&Pose) -> Gaussian,
        visited: &mut VisitedStates,
        budget: &Budget,
    ) -> Vec<Posterior> {
        let (regions, step) = (self.sampled(), subsample_stride(self.sampled()));
        let cost = |pose: &Pose| -log_likelihood(regions, pose, ROUGH, step, budget) - factor_at(pose).offset;
        let scored = starts.iter().map(|pose| (cost(pose), *pose)).collect();
        let starts = distinct(scored, MOST_STARTS, CONVERGENCE_RADIUS, |pose| pose);
        let least = starts.first().map_or(0.0, |(cost, _)| *cost);
        let starts = starts.into_iter().take_while(|(cost, _)| *cost - least <= UNREFINED * MAX_DEFICIT);
        let leading = starts.take_while(|_| !budget.is_exhausted());
        let is_new = |fit: &CoarseFit| {
            found.iter().all(|mode| {
                fit.squared_sigmas_of(&mode.pose) >= ONE_ANSWER || apart(&fit.pose, &mode.pose, CONVERGENCE_RADIUS)
            })
        };
        let all: Vec<CoarseFit> =
            leading.filter_map(|(_, start)| fit_coarse(regions, factor_at, &start, budget)).filter(is_new).collect();
        let is_same = |a: &CoarseFit, b: &CoarseFit| !apart(&a.pose, &b.pose, SAME);
        let is_behind = |best: &CoarseFit, other: &CoarseFit| best.log_evidence - other.log_evidence > MAX_DEFICIT;
        let likely = likeliest(all, is_behind, |fit| fit.log_evidence, is_same);
        anneal(regions, factor_at, &likely, UNREFINED * MAX_DEFICIT, visited, budget)
    }

    /// Each answer once, the likeliest first, as the mixture of its modes: where samples contradict a pose, it depends on the start which
    /// of them count as wrong and which segments as disturbed.
    fn answers(&self, modes: &[Posterior]) -> Vec<Posterior> {
        let over_modes = |answer: Posterior| {
            // Poses beyond each other's basins have no mean.
            let is_own = |mode: &&Posterior| {
                is_same_answer(&answer, mode) && !apart(&answer.pose, &mode.pose, CONVERGENCE_RADIUS)
            };
            let own: Vec<Posterior> = modes.iter().filter(is_own).cloned().collect();
            answer.mixed_over(&own, self.sampled())
        };
        let answers = likeliest(modes.to_vec(), |_, _| false, Posterior::log_evidence, is_same_answer);
        answers.into_iter().map(over_modes).collect()
    }

    /// Whether every region has samples beside its outline, as many as a pose has numbers: fewer determine no pose, and outlines are more
    /// than starts.
    pub(super) fn has_samples_on_all_edges(&self) -> bool {
        let is_edged = |world: &WorldRegion| {
            let Some(samples) = world.samples() else { return false };
            let (outline, near) = (world.outline(), SIZE_RATIO * world.outline().area().sqrt());
            let edges = SignedDistanceField::new(outline.rings(), &[], near.recip());
            let places = samples.inside().iter().chain(samples.outside()).chain(samples.enclosed());
            places.filter(|place| edges.at(place).distance.abs() < near).take(PARAMETERS).count() == PARAMETERS
        };
        self.sampled().len() == self.regions().len() && self.worlds().iter().all(is_edged)
    }

    /// The same without the samples of regions that are uninformative at all of these answers, poses about the problem's origin with their
    /// covariance and the scatter of contours, pixels; `None` where those of all regions are informative.
    pub(crate) fn with_informative_samples_at(
        &self,
        answers: &[(Pose, Matrix6<f64>, f64)],
        budget: &Budget,
    ) -> Option<Self> {
        let is_informative = |region: &SampledRegion| {
            // The outline of a line alone carries no information.
            let is_line = self.worlds()[region.index()].is_line();
            let is_informative_at = |(pose, covariance, scatter): &(Pose, Matrix6<f64>, f64)| {
                region.is_informative(pose, covariance, *scatter, budget)
            };
            is_line || answers.iter().any(is_informative_at)
        };
        let informative: Vec<bool> = self.sampled().iter().map(is_informative).collect();
        (!answers.is_empty() && informative.contains(&false)).then(|| self.with_sampled(&informative))
    }

    /// The contours of the regions without samples.
    fn outlined(&self) -> Vec<Contour> {
        let has_samples = |index: usize| self.sampled().iter().any(|region| region.index() == index);
        let contours = self.contours().iter().enumerate();
        contours.filter(|(index, _)| !has_samples(*index)).map(|(_, contour)| contour.clone()).collect()
    }

    /// The contours of the regions with an outline whose samples leave one side of it open.
    fn guessed(&self) -> Vec<Contour> {
        let indices = self.sampled().iter().map(SampledRegion::index);
        indices
            .filter(|&index| is_one_sided(&self.worlds()[index]))
            .map(|index| self.contours()[index].clone())
            .collect()
    }
}

/// Whether samples on one side of a region's outline lie beside half as much of it at most as those on both sides do: such as where
/// nothing stands behind a region, so that beams that passed it have no returns. A line has no outline.
fn is_one_sided(world: &WorldRegion) -> bool {
    let Some(samples) = world.samples().filter(|_| !world.is_line()) else { return false };
    let (outline, near) = (world.outline(), SIZE_RATIO * world.outline().area().sqrt());
    let places = points_along(outline.rings(), OUTLINE_POINTS);
    let beside = |side: &[Vector2<f64>]| -> Vec<bool> {
        places.iter().map(|place| side.iter().any(|sample| (sample - place).norm_squared() < near * near)).collect()
    };
    let (inside, outside) = (beside(samples.inside()), beside(samples.outside()));
    let either = inside.iter().zip(&outside).filter(|(inside, outside)| **inside || **outside).count();
    let fewer = [inside, outside].map(|side| side.into_iter().filter(|beside| *beside).count()).into_iter().min();
    fewer.is_some_and(|fewer| 2 * fewer <= either)
}

/// So many points along all rings together, equally far apart.
fn points_along(rings: &[Vec<Vector2<f64>>], count: usize) -> Vec<Vector2<f64>> {
    let edges = || rings.iter().flat_map(|ring| ring.iter().zip(ring.iter().cycle().skip(1)));
    let step = edges().map(|(a, b)| (b - a).norm()).sum::<f64>() / count as f64;
    let (mut points, mut left) = (Vec::with_capacity(count), 0.5 * step);
    for (a, b) in edges() {
        let length = (b - a).norm();
        while left < length {
            points.push(a + (b - a) * (left / length));
            left += step;
        }
        left -= length;
    }
    points
}

/// A pose turned by as much as a start may be off, about each of the camera's axes, where the problem's origin stays in place.
fn beside(pose: &Pose) -> impl Iterator<Item = Pose> {
    let turned = |turn: Vector3<f64>| Pose::new(Rotation3::new(turn) * pose.rotation, pose.translation);
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    axes.into_iter().flat_map(move |axis| [axis * CONVERGENCE_RADIUS, axis * -CONVERGENCE_RADIUS].map(turned))
}

/// The one of the greatest evidence.
fn likeliest_of(found: &[Posterior]) -> Option<Posterior> {
    found.iter().max_by(|a, b| a.log_evidence().total_cmp(&b.log_evidence())).cloned()
}

/// Whether two modes are one answer.
fn is_same_answer(a: &Posterior, b: &Posterior) -> bool {
    a.squared_sigmas_to(b) < ONE_ANSWER
}

/// Each mode once, the likeliest first.
fn modes(found: Vec<Posterior>) -> Vec<Posterior> {
    likeliest(found, |_, _| false, Posterior::log_evidence, |a, b| a.squared_sigmas_to(b) < ONE_VARIANCE)
}

/// Whether the samples of every region agree with a pose.
fn is_found(posterior: &Posterior) -> bool {
    posterior.noise.label < DRAWN && posterior.wrong_fractions.iter().all(|&wrong| !contradicts(wrong))
}
