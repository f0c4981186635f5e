//! Poses from samples: every start led to what its samples leave possible, ranked by the evidence (`docs/math.md`, section 16).

use super::candidates::further_poses;
use super::poses::distinct;
use crate::contour::fit::ContourFit;
use crate::contour::readings::Contour;
use crate::geometry::pose::Pose;
use crate::prior::{Gaussian, Prior};
use crate::problem::Problem;
use crate::samples::posterior::{Led, Posterior, leading_step, led, log_likelihood, posterior};
use crate::search::candidates::{AMBIGUITY, sketch_step};

/// Starts that are led on.
const MOST_STARTS: usize = 12;

/// Poses nearer than this, rad and share of the distance, are one start, and one answer.
const SAME_START: f64 = 0.02;
const SAME_ANSWER: f64 = 3e-3;

/// Blur, pixels, with which starts are compared: as far as rough ones are off.
const ROUGH: f64 = 32.0;

/// Share of wrong labels of every region up to which a pose counts as found.
const FOUND: f64 = 0.03;

/// Logarithm of odds on some of the samples by which a start is behind the best that all of them do not make up.
const HOPELESS: f64 = 40.0;

impl Problem {
    /// What the samples leave possible about some starts and, where they contradict all of these, about further ones; the
    /// likeliest first. Poses are about the problem's origin.
    pub(crate) fn posteriors(&self, starts: Vec<Pose>, prior: &Prior) -> Vec<Posterior> {
        let outlined = self.outlined();
        let others = |pose: &Pose| prior.gaussian(&self.uncentred(pose)) + outlines(&outlined, pose);
        let mut found = self.posteriors_near(starts, &others);
        if !found.iter().any(is_found) {
            found.extend(self.posteriors_near(further_poses(self, sketch_step(self.contours())), &others));
        }
        let least = AMBIGUITY + self.most_penalty(prior);
        likeliest(found, SAME_ANSWER, least / 2.0, |posterior| (posterior.log_evidence, &posterior.pose))
    }

    /// The posteriors of the likeliest starts.
    fn posteriors_near(&self, starts: Vec<Pose>, others: &impl Fn(&Pose) -> Gaussian) -> Vec<Posterior> {
        let (regions, step) = (self.sampled(), leading_step(self.sampled()));
        let misfit = |pose: &Pose| -log_likelihood(regions, pose, ROUGH, step);
        let scored = starts.into_iter().map(|pose| (misfit(&pose), pose)).collect();
        let starts = distinct(scored, MOST_STARTS, SAME_START, |pose| pose);
        let all: Vec<Led> = starts.iter().filter_map(|(_, start)| led(regions, others, start)).collect();
        let likely = likeliest(all, SAME_START, HOPELESS, |led: &Led| (led.log_evidence, &led.pose));
        likely.iter().filter_map(|led| posterior(regions, others, led)).collect()
    }

    /// The contours of the regions without samples.
    fn outlined(&self) -> Vec<Contour> {
        let has_samples = |index: usize| self.sampled().iter().any(|region| region.index() == index);
        let contours = self.contours().iter().enumerate();
        contours.filter(|(index, _)| !has_samples(*index)).map(|(_, contour)| contour.clone()).collect()
    }
}

/// The items of the greatest logarithms of evidence, each pose once, and no more behind the best than `behind`.
fn likeliest<T>(items: Vec<T>, same: f64, behind: f64, of: impl Fn(&T) -> (f64, &Pose)) -> Vec<T> {
    let scored = items.into_iter().map(|item| (-of(&item).0, item)).collect();
    let kept = distinct(scored, usize::MAX, same, |item| of(item).1);
    let least = kept.first().map_or(0.0, |(least, _)| *least);
    kept.into_iter().take_while(|(cost, _)| cost - least <= behind).map(|(_, item)| item).collect()
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
