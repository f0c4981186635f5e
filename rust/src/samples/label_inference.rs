//! Posterior of the pose given labels at one noise level: iterated expectation propagation, relinearized at its mean with damped steps
//! (`docs/math.md`, section 17).

use nalgebra::{Matrix6, Vector6};

use super::active_set::ActiveSet;
use super::ep::{EpPosterior, run_ep, run_ep_independent};
use super::label_model::{LabelModel, NoiseLevels, log_likelihood, subsample_stride};
use super::margin::SampledRegion;
use crate::budget::Budget;
use crate::equations::step_bounds::{backtracked, clamped};
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::{Gaussian, Normal};
use crate::math::odds::DECISIVE;

/// A step by less than this many standard deviations is the last: a convention.
const CONVERGED_SIGMAS: f64 = 0.1;

/// Factor of damping of steps whose direction turns.
const DAMPING: f64 = 0.5;

/// Ratio of standard deviations between the guard of the first sweep and the last posterior.
const GUARD_RATIO: f64 = 3.0;

/// Standard deviation of the increment to the start in its prior, rad and share of the distance.
const START_SIGMA: f64 = 1.0;

/// A pose and the posterior of its left increment.
#[derive(Clone, Copy)]
pub(super) struct PoseState {
    pub(super) pose: Pose,
    pub(super) increment: Normal,
    pub(super) log_evidence: f64,
    /// Whether expectation propagation has converged; the evidence is invalid otherwise.
    pub(super) has_converged: bool,
}

/// Inference of a pose from labels, with a prior: a factor of the left increment at any pose.
pub(super) struct LabelInference<'a, F> {
    prior: &'a F,
    start: Pose,
    pub(super) samples: ActiveSet<'a>,
}

impl<'a, F: Fn(&Pose) -> Gaussian> LabelInference<'a, F> {
    /// From a subsample, independent.
    pub(super) fn subsampled(regions: &'a [SampledRegion], prior: &'a F, start: Pose, budget: &'a Budget) -> Self {
        Self { prior, start, samples: ActiveSet::independent(regions, subsample_stride(regions), budget) }
    }

    /// From all samples jointly, which share the offsets of contour segments.
    pub(super) fn joint(
        regions: &'a [SampledRegion],
        prior: &'a F,
        start: Pose,
        models: Vec<LabelModel>,
        budget: &'a Budget,
    ) -> Self {
        Self { prior, start, samples: ActiveSet::by_segment(regions, models, budget) }
    }

    /// Log prior of a pose.
    pub(super) fn log_prior(&self, pose: &Pose) -> f64 {
        (self.prior)(pose).offset
    }

    /// Iterates expectation propagation and relinearization from a state, at most `rounds` times; `None` where a direction is left free,
    /// no distribution is found, or the search is stopped. Samples are linearized at the mean, or `statistically` over the posterior.
    pub(super) fn run_to_convergence(
        &mut self,
        mut state: PoseState,
        noise: NoiseLevels,
        rounds: usize,
        statistically: bool,
    ) -> Option<PoseState> {
        if self.samples.budget.is_canceled() {
            return None;
        }
        let is_first = self.samples.active.is_empty();
        self.samples.select(&state.pose, &state.increment, noise);
        let (mut last_mean, mut damping) = (Tangent::zeros(), 1.0);
        for round in 0..rounds {
            if self.samples.budget.is_canceled() {
                return None;
            }
            if round > 0 && self.samples.budget.is_exhausted() {
                break;
            }
            if statistically {
                self.samples.linearize_statistically(&state.pose, &state.increment);
            } else if round > 0 {
                self.samples.linearize(&state.pose);
            }
            let is_guarded = is_first && round == 0;
            let guard = if is_guarded { self.guard(&state, noise.label) } else { Gaussian::default() };
            let posterior = self.run_ep(&state.pose, &guard)?;
            self.samples.learn_noise(&posterior);
            let EpPosterior { increment, log_evidence, has_converged, .. } = posterior;
            let information = increment.covariance.cholesky()?;
            // A mean that oscillates lies between.
            if last_mean.dot(&information.solve(&increment.mean)) < 0.0 {
                damping *= DAMPING;
            }
            last_mean = increment.mean;
            let squared_sigmas = increment.mean.dot(&information.solve(&increment.mean));
            let step = clamped(&(increment.mean * damping), &state.pose);
            let pose = self.step(&state.pose, &step, squared_sigmas, noise.label);
            self.samples.retract(&state.pose.local_coordinates(&pose));
            let log_evidence = log_evidence + self.samples.inactive_log_probability();
            state = PoseState { pose, increment, log_evidence, has_converged };
            if squared_sigmas < CONVERGED_SIGMAS * CONVERGED_SIGMAS {
                break;
            }
        }
        Some(state)
    }

    /// Posterior of the increment from a pose.
    fn run_ep(&mut self, pose: &Pose, guard: &Gaussian) -> Option<EpPosterior> {
        let prior = start_prior(&self.start, pose) + (self.prior)(pose);
        let ActiveSet { active, contours, by_segment, budget, .. } = &mut self.samples;
        match by_segment {
            true => run_ep(&prior, guard, active, contours, budget),
            false => run_ep_independent(&prior, guard, active, budget),
        }
    }

    /// A stand-in for factors before the first sweep: the last posterior with a larger covariance, or the information of one sample.
    fn guard(&self, state: &PoseState, label_sigma: f64) -> Gaussian {
        let last = state.increment.covariance.cholesky();
        let last = last.map(|root| root.inverse() / (GUARD_RATIO * GUARD_RATIO));
        let of_one_sample = || {
            let active = &self.samples.active;
            let mut information = Matrix6::zeros();
            for sample in active {
                information.ger(1.0, &sample.site.gradient, &sample.site.gradient, 1.0);
            }
            information / (active.len().max(1) as f64 * label_sigma * label_sigma)
        };
        Gaussian { information: last.unwrap_or_else(of_one_sample), ..Gaussian::default() }
    }

    /// The pose after a step. One beyond a standard deviation, where linearizations fail, is halved until the log posterior of a subsample
    /// drops by little, or not made.
    fn step(&self, from: &Pose, step: &Tangent, squared_sigmas: f64, label_sigma: f64) -> Pose {
        if squared_sigmas < 1.0 {
            return from.retract(step);
        }
        let ActiveSet { regions, budget, .. } = self.samples;
        let stride = subsample_stride(regions);
        let log_posterior =
            |pose: &Pose| log_likelihood(regions, pose, label_sigma, stride, budget) + (self.prior)(pose).offset;
        let least = log_posterior(from) - DECISIVE;
        backtracked(from, step, |pose| log_posterior(pose) >= least).unwrap_or(*from)
    }
}

/// Normal prior about the start: without it, directions that samples leave free would drift.
fn start_prior(start: &Pose, pose: &Pose) -> Gaussian {
    let distance = start.translation.norm();
    let [rotation, translation] = [START_SIGMA, START_SIGMA * distance];
    let sigmas = Vector6::new(rotation, rotation, rotation, translation, translation, translation);
    Gaussian::from_sigmas(&pose.local_coordinates(start), &sigmas)
}
