//! Screening of candidates on a coarse subset of the contours.

use super::acceptance::is_mostly_clean;
use super::directions::direction_poses;
use crate::budget::Budget;
use crate::contour::fit::{ContourFit, refined};
use crate::contour::readings::Contour;
use crate::geometry::pose::Pose;
use crate::options::{Options, Refinement};
use crate::prior::Prior;
use crate::problem::Problem;

/// Fits of candidates on a coarse subset of pieces, cached.
pub(super) struct CandidateScreen<'a> {
    contours: &'a [Contour],
    /// One piece in so many is evaluated.
    step: usize,
    /// Whether poses may be refined on the contours: of several regions, whose contours reject a wrong one.
    refines: bool,
    /// Poses that the prior gives.
    pub(super) prior_poses: Vec<Pose>,
    last: Option<ContourFit>,
    /// Starts, and their refinements on the contours.
    refined: Vec<(Pose, ContourFit)>,
    budget: &'a Budget,
}

impl<'a> CandidateScreen<'a> {
    pub(super) fn new(problem: &'a Problem, options: &Options, budget: &'a Budget) -> Self {
        let contours = problem.contours();
        let refines = contours.len() > 1 && options.refinement == Refinement::Contour;
        let prior_poses = prior_poses(problem, &options.prior, budget);
        let step = problem.coarse_stride();
        Self { contours, step, refines, prior_poses, last: None, refined: Vec::new(), budget }
    }

    /// The fit at a pose that is not moved.
    pub(super) fn at(&mut self, pose: &Pose) -> Option<&ContourFit> {
        if self.last.as_ref().is_none_or(|fit| fit.pose != *pose) {
            self.last = ContourFit::at(self.contours, pose, self.step, self.budget);
        }
        self.last.as_ref()
    }

    /// Whether a pose fits all regions cleanly, or most of each once it is refined on the contours.
    pub(super) fn explains(&mut self, pose: &Pose) -> bool {
        if self.at(pose).is_some_and(ContourFit::is_clean) {
            return true;
        }
        let fit = if self.refines { self.refined_from(pose) } else { None };
        let explains = fit.as_ref().is_some_and(is_mostly_clean);
        self.refined.extend(fit.map(|fit| (*pose, fit)));
        explains
    }

    /// The refinement of a start on the contours, cached.
    pub(super) fn refined_from(&self, start: &Pose) -> Option<ContourFit> {
        match self.refined.iter().find(|(pose, _)| pose == start) {
            Some((_, fit)) => Some(fit.clone()),
            None => refined(self.contours, start, self.step, self.budget),
        }
    }
}

/// Poses that the prior gives, about the problem's origin: the initial one, and those of directions from the camera's
/// place.
fn prior_poses(problem: &Problem, prior: &Prior, budget: &Budget) -> Vec<Pose> {
    let initial = prior.initial.map(|pose| problem.centered(&pose));
    initial.into_iter().chain(direction_poses(problem, prior, problem.coarse_stride(), budget)).collect()
}
