//! Poses from samples: every start led to what its samples leave possible, ranked by the evidence (`docs/math.md`, section 16).

use super::candidates::further_poses;
use super::poses::{distinct, sorted};
use crate::contour::fit::ContourFit;
use crate::contour::readings::Contour;
use crate::geometry::pose::Pose;
use crate::prior::{Gaussian, Prior};
use crate::problem::Problem;
use crate::samples::posterior::{Posterior, log_likelihood, posterior};
use crate::search::candidates::{AMBIGUITY, sketch_step};

/// Starts that are led on.
const MOST_STARTS: usize = 12;

/// Poses nearer than this, rad and share of the distance, are one start, and one answer.
const SAME_START: f64 = 0.02;
const SAME_ANSWER: f64 = 3e-3;

/// Blur, pixels, with which starts are compared: as far as rough ones are off.
const ROUGH: f64 = 32.0;

/// Samples of all regions on which they are compared.
const COMPARED: usize = 200;

/// Share of wrong labels of every region up to which a pose counts as found.
const FOUND: f64 = 0.2;

impl Problem {
    /// What the samples leave possible about some starts and, where they contradict all of these, about further ones; the
    /// likeliest first. Poses are about the problem's origin.
    pub(crate) fn posteriors(&self, starts: Vec<Pose>, prior: &Prior) -> Vec<Posterior> {
        let mut found = self.led(starts, prior);
        if !found.first().is_some_and(is_found) {
            found.extend(self.led(further_poses(self, sketch_step(self.contours())), prior));
        }
        let scored = found.into_iter().map(|posterior| (-posterior.log_evidence, posterior)).collect();
        let mut answers = distinct(scored, usize::MAX, SAME_ANSWER, |posterior| &posterior.pose);
        let least = answers.first().map_or(0.0, |(least, _)| *least);
        answers.retain(|(value, _)| 2.0 * (value - least) <= AMBIGUITY + self.most_penalty(prior));
        answers.into_iter().map(|(_, posterior)| posterior).collect()
    }

    /// The posteriors of the likeliest starts.
    fn led(&self, starts: Vec<Pose>, prior: &Prior) -> Vec<Posterior> {
        let step = (self.sampled().iter().map(|region| region.count()).sum::<usize>() / COMPARED).max(1);
        let misfit = |pose: &Pose| -log_likelihood(self.sampled(), pose, ROUGH, step);
        let scored = starts.into_iter().map(|pose| (misfit(&pose), pose)).collect();
        let starts = distinct(scored, MOST_STARTS, SAME_START, |pose| pose);
        let outlined = self.outlined();
        let others = |pose: &Pose| prior.gaussian(&self.uncentred(pose)) + outlines(&outlined, pose);
        let found = starts.into_iter().filter_map(|(_, start)| posterior(self.sampled(), &others, &start));
        sorted(found.map(|posterior| (-posterior.log_evidence, posterior)).collect())
            .into_iter()
            .map(|(_, posterior)| posterior)
            .collect()
    }

    /// The contours of the regions without samples.
    fn outlined(&self) -> Vec<Contour> {
        let has_samples = |index: usize| self.sampled().iter().any(|region| region.index() == index);
        let contours = self.contours().iter().enumerate();
        contours.filter(|(index, _)| !has_samples(*index)).map(|(_, contour)| contour.clone()).collect()
    }
}

/// Whether the samples of every region agree with a pose.
fn is_found(posterior: &Posterior) -> bool {
    posterior.wrong.iter().all(|&wrong| wrong < FOUND)
}

/// What contours without samples show at a pose, by the pieces that vary independently (`docs/math.md`, eq. 11.5).
fn outlines(contours: &[Contour], pose: &Pose) -> Gaussian {
    if contours.is_empty() {
        return Gaussian::default();
    }
    // Out of view nothing can be likely.
    let hopeless = Gaussian { offset: -f64::MAX.sqrt(), ..Gaussian::default() };
    ContourFit::at(contours, pose, 1).map_or(hopeless, |fit| fit.gaussian(contours).unwrap_or(hopeless))
}
