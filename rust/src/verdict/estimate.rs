//! The result: the best pose, the others that fit, its covariance and overlap, and the warnings.

use std::borrow::Cow;

use nalgebra::Vector3;

use super::checks::warnings;
use super::confidence::Evidence;
use super::hypothesis::{Hypothesis, solution};
use super::ranking::{likely, stated};
use super::solution::Solution;
use super::warning::Warning;
use crate::budget::Budget;
use crate::contour::fit::ContourFit;
use crate::equations::information::validated_covariance;
use crate::equations::least_squares::{Minimum, Termination};
use crate::error::{Error, Result};
use crate::geometry::pose::Pose;
use crate::options::Options;
use crate::problem::Problem;
use crate::samples::posterior::Posterior;
use crate::search::Search;
use crate::search::candidates::Candidates;
use crate::search::poses::{SAME, distinct};

/// The pose of a camera, with its covariance, alternatives, confidence and warnings.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use]
#[non_exhaustive]
pub struct Estimate {
    /// The best pose.
    pub best: Solution,
    /// Estimated noise of the boundary, in pixels along the normal.
    pub boundary_noise: f64,
    /// Other poses that fit as well and agree with the prior, best first.
    pub alternatives: Vec<Solution>,
    /// Edges that two regions share, used as evidence beside samples: the regions, and the ends in the world.
    pub creases: Vec<([usize; 2], [Vector3<f64>; 2])>,
    /// Warnings of the best pose.
    pub warnings: Vec<Warning>,
    /// Features of the fit that the confidence is computed from.
    pub evidence: Evidence,
    /// Evaluations of the equations in the final least squares.
    pub evaluations: usize,
    /// Median distance of the regions from the camera at the best pose.
    pub distance: f64,
    /// Angle of a pixel where the regions are seen, rad: the root of its mean square over them.
    pub pixel_angle: f64,
}

/// Candidate poses, and the problem without the samples that do not constrain any of them.
struct Hypotheses<'a> {
    problem: Cow<'a, Problem>,
    hypotheses: Vec<Hypothesis>,
    /// Whether samples constrain the pose, and none of their modes was found.
    samples_unused: bool,
}

impl Problem {
    /// The pose of the regions without a prior, by the native solver.
    ///
    /// # Errors
    /// [`Error::NoPose`] where no pose shows every region in its chart.
    pub fn estimate(&self) -> Result<Estimate> {
        self.estimate_with(&Options::default())
    }

    /// The pose by the native solver, with options.
    ///
    /// # Errors
    /// [`Error::NoPose`] where no pose shows every region in its chart.
    pub fn estimate_with(&self, options: &Options) -> Result<Estimate> {
        self.estimate_within(options, &Budget::unlimited())
    }

    /// The same within a budget.
    #[doc(hidden)]
    pub fn estimate_within(&self, options: &Options, budget: &Budget) -> Result<Estimate> {
        let search = self.search_within(options, budget);
        let solved = |budget: &Budget| {
            search.candidates().iter().map(|candidate| search.solve_within(candidate, budget)).collect()
        };
        let (minima, _) = budget.limited(self.most_work(), solved);
        search.assess_within(minima, budget)
    }
}

impl Search {
    /// The estimate, of the minima that any least-squares solver found from the candidates.
    ///
    /// # Errors
    /// [`Error::NoPose`] where no pose shows every region in its chart.
    pub fn assess(self, minima: Vec<Minimum>) -> Result<Estimate> {
        self.assess_within(minima, &Budget::unlimited())
    }

    /// The same within a budget.
    #[doc(hidden)]
    pub fn assess_within(self, minima: Vec<Minimum>, budget: &Budget) -> Result<Estimate> {
        let evaluations = minima.iter().map(|minimum| minimum.evaluations).sum();
        let (Hypotheses { problem, hypotheses, samples_unused }, exhausted) =
            budget.limited(self.problem.most_work(), |budget| self.all_hypotheses(minima, budget));
        let problem = &*problem;
        let hypotheses = stated(likely(problem, hypotheses, &self.options.prior, budget), &self.options.prior);
        let (best, _) = hypotheses.first().ok_or(Error::NoPose)?;
        let evidence = best.evidence(problem, budget);
        let noise = match (&best.posterior, &best.minimum) {
            (Some(posterior), _) => posterior.noise.label,
            (None, Some(minimum)) => problem.noise_variance(minimum.cost).sqrt(),
            (None, None) => best.fit.mixture.sigma,
        };
        let probability = evidence.probability();
        let mut solutions = hypotheses.into_iter().map(|(hypothesis, stated)| {
            let stated = stated.map(|share| probability * share);
            solution(problem, hypothesis, stated, &self.options.frame_sigma, budget)
        });
        let best = solutions.next().ok_or(Error::NoPose)?;
        let alternatives: Vec<Solution> = solutions.collect();
        let ended = if self.exhausted || exhausted { Some(&Termination::WorkLimit) } else { best.unconverged() };
        let unused = samples_unused.then_some(Warning::SamplesUnused);
        let warnings = warnings(problem, &best, &alternatives, &evidence, &self.options, ended);
        let warnings = unused.into_iter().chain(warnings).collect();
        let creases = if best.posterior.is_some() { self.creases(&best.pose, budget) } else { Vec::new() };
        let (distance, pixel_angle) = (self.problem.distance(&best.pose), self.problem.pixel_angle());
        Ok(Estimate {
            best,
            boundary_noise: noise,
            alternatives,
            creases,
            warnings,
            evidence,
            evaluations,
            distance,
            pixel_angle,
        })
    }

    /// The visible part of each crease at a pose.
    fn creases(&self, pose: &Pose, budget: &Budget) -> Vec<([usize; 2], [Vector3<f64>; 2])> {
        let creases = self.problem.creases(budget);
        creases.iter().map(|crease| (crease.regions, self.problem.crease_segment(crease, pose))).collect()
    }

    /// The hypotheses: where regions have samples, modes of their posterior about the hypotheses of the outlines.
    fn all_hypotheses(&self, minima: Vec<Minimum>, budget: &Budget) -> Hypotheses<'_> {
        let hypotheses = self.hypotheses(minima, budget);
        let starts: Vec<Pose> =
            hypotheses.iter().map(|hypothesis| hypothesis.fit.pose).chain(self.starts.iter().copied()).collect();
        let mut problem = Cow::Borrowed(&self.problem);
        while !problem.sampled().is_empty() {
            let sampled = self.sample_hypotheses(&problem, &starts, budget);
            let answers: Vec<_> = sampled.iter().filter_map(Hypothesis::answer).collect();
            let Some(informative) = problem.with_informative_samples_at(&answers, budget) else {
                // Without a mode, the hypotheses are those of the outlines, and regions are compared by these.
                return match sampled.is_empty() {
                    true => {
                        Hypotheses { problem: Cow::Owned(problem.with_sampled(&[])), hypotheses, samples_unused: true }
                    }
                    false => Hypotheses { problem, hypotheses: sampled, samples_unused: false },
                };
            };
            problem = Cow::Owned(informative);
        }
        Hypotheses { problem, hypotheses, samples_unused: false }
    }

    /// The modes of the samples' posterior about starts.
    fn sample_hypotheses(&self, problem: &Problem, starts: &[Pose], budget: &Budget) -> Vec<Hypothesis> {
        let hypothesis = |posterior: Posterior| {
            let fit = ContourFit::at(problem.contours(), &posterior.pose, problem.coarse_stride(), budget)?;
            let (pose, covariance) = (problem.uncentered(&posterior.pose), validated_covariance(&posterior.covariance));
            Some(Hypothesis {
                posterior: Some(posterior),
                covariance: covariance.into(),
                ..Hypothesis::new(pose, None, fit)
            })
        };
        problem.posteriors(starts, &self.options.prior, budget).into_iter().filter_map(hypothesis).collect()
    }

    /// The hypotheses of the outlines, those that fit best first.
    fn hypotheses(&self, minima: Vec<Minimum>, budget: &Budget) -> Vec<Hypothesis> {
        let (problem, contours) = (&self.problem, self.problem.contours());
        // A few pieces show whether a single pose fits cleanly.
        let few = if minima.len() > 1 { 1 } else { problem.coarse_stride() };
        let minima = minima.into_iter().filter_map(|minimum| {
            let pose = problem.centered(&minimum.pose);
            let fit = ContourFit::at(contours, &pose, few, budget)?;
            let fit = if few > 1 && !fit.is_clean() { ContourFit::at(contours, &pose, 1, budget)? } else { fit };
            Some(Hypothesis::new(minimum.pose, Some(minimum), fit))
        });
        let refined = match &self.found {
            Candidates::OnContours(fits) => fits.as_slice(),
            Candidates::NearMinima(_) => &[],
        };
        let refined = refined.iter().map(|fit| Hypothesis::new(problem.uncentered(&fit.pose), None, fit.clone()));
        let scored = minima.chain(refined).map(|hypothesis| (hypothesis.cost(), hypothesis)).collect();
        distinct(scored, usize::MAX, SAME, |hypothesis| &hypothesis.fit.pose)
            .into_iter()
            .map(|(_, hypothesis)| hypothesis)
            .collect()
    }
}
