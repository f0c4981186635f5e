//! Annealing: from a start to the posterior about it, with falling noise levels, which are marginalized at the end (`docs/math.md`, section
//! 17).

use nalgebra::Matrix6;

use super::active_set::ActiveSet;
use super::label_inference::{LabelInference, PoseState};
use super::label_model::{LabelModel, NoiseLevels, residual_sigma, subsample_stride};
use super::margin::SampledRegion;
use super::posterior::{
    EQUIVALENT_DEVIANCE, ModeEvidence, Posterior, likeliest, mixture_moments, squared_sigmas, wrong_fractions,
};
use crate::budget::Budget;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::{Gaussian, Normal};
use crate::math::odds::{DECISIVE, ONE_VARIANCE};
use crate::noise::boundary::{CALIBRATION, COARSE, FINE, HALF_LEVEL, LEVEL_RATIO, MEDIUM};

/// Sigmas of corners and of contours' dilations, pixels: from a hand's error, and half the width of a lidar's beam beside a region of a
/// few meters, to that of pixels.
const SHARED_SIGMAS: [f64; 3] = [COARSE, MEDIUM, FINE];

/// Nodes between two levels of the integral over the sigma of corners: mean squares are exact to 0.2 % (`cargo test sampled::`).
const NODES: u32 = 16;

/// Squared Mahalanobis distance of two states, and difference of their log evidence, up to which they are one: a tenth of each, by
/// convention. With a standard deviation and half a unit searches take a seventh less time, and miss four more of 640 right answers
/// (`python -m benchmarks trust --seed 7000 --scenes 110 --only model=lidar`, `model=combined`).
const SAME_STATE: f64 = 0.01;
const SAME_EVIDENCE: f64 = 0.1;

/// Relinearizations at most: at each level, and at the last one.
const MAX_ROUNDS: usize = 2;
const MAX_LAST_ROUNDS: usize = 8;

/// A pose fitted to a subsample, independent, at the coarse sigma.
#[derive(Debug, Clone)]
pub struct CoarseFit {
    /// About the problem's origin.
    pub pose: Pose,
    /// Log evidence of the subsample.
    pub log_evidence: f64,
    increment: Normal,
    models: Vec<LabelModel>,
}

impl CoarseFit {
    /// Squared Mahalanobis distance of a pose, by this fit's covariance alone: a wider posterior may hold several fits.
    pub fn squared_sigmas_of(&self, pose: &Pose) -> f64 {
        squared_sigmas((&self.pose, &self.increment.covariance), (pose, &Matrix6::zeros()))
    }
}

/// The mode reached from a start by a subsample, while the sigma of labels is halved from the start's residuals on; `prior` is a factor
/// of the left increment at any pose. `None` where a direction is left free.
pub fn fit_coarse(
    regions: &[SampledRegion],
    prior: &impl Fn(&Pose) -> Gaussian,
    start: &Pose,
    budget: &Budget,
) -> Option<CoarseFit> {
    let free = Normal { mean: Tangent::zeros(), covariance: Matrix6::zeros() };
    let mut inference = LabelInference::subsampled(regions, prior, *start, budget);
    let mut state = PoseState { pose: *start, increment: free, log_evidence: f64::NEG_INFINITY, has_converged: false };
    let mut label = residual_sigma(regions, start, subsample_stride(regions), budget);
    loop {
        let noise = NoiseLevels { label, dilation: 0.0, corner: 0.0 };
        state = inference.run_to_convergence(state, noise, MAX_ROUNDS, false)?;
        if label <= COARSE {
            let PoseState { pose, log_evidence, increment, .. } = state;
            return Some(CoarseFit { pose, log_evidence, increment, models: inference.samples.models });
        }
        label = if budget.is_exhausted() { COARSE } else { (label / LEVEL_RATIO).max(COARSE) };
    }
}

/// Posteriors by all samples about coarse fits. Noise falls from wide to fine: first that of labels, with the widest dilations and corners;
/// then, with the likeliest sigma of labels, that of corners, for each of ever finer dilations; last, corners at half and twice the
/// likeliest sigma. A track that is behind the best by more than `max_deficit`, in log evidence, ends; so does one that reaches a state
/// that it or another track has `visited` at the same level.
pub fn anneal(
    regions: &[SampledRegion],
    prior: &impl Fn(&Pose) -> Gaussian,
    starts: &[CoarseFit],
    max_deficit: f64,
    visited: &mut VisitedStates,
    budget: &Budget,
) -> Vec<Posterior> {
    let mut tracks: Vec<_> = starts.iter().map(|start| Track::new(regions, prior, start, budget)).collect();
    for label in label_sigmas() {
        let noise = NoiseLevels { label, dilation: SHARED_SIGMAS[0], corner: SHARED_SIGMAS[0] };
        advance(&mut tracks, max_deficit, visited, |_| Some(noise), budget);
    }
    for dilation in SHARED_SIGMAS {
        tracks.retain_mut(|track| track.restore_best().is_some());
        for corner in SHARED_SIGMAS {
            advance(&mut tracks, max_deficit, visited, |track| track.likeliest_with(dilation, corner), budget);
        }
    }
    for ratio in [HALF_LEVEL, 1.0 / HALF_LEVEL] {
        tracks.retain_mut(|track| track.restore_best().is_some());
        advance(&mut tracks, max_deficit, visited, |track| track.neighbor_of_likeliest(ratio), budget);
    }
    // Tracks of one mode would be finished to one posterior.
    let distinct = likeliest(tracks, |_, _| false, Track::best_log_evidence, Track::has_same_mode);
    distinct.into_iter().filter_map(Track::finish).collect()
}

/// Sigmas of labels with all samples, falling, pixels.
fn label_sigmas() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(COARSE), |sigma| Some(sigma / LEVEL_RATIO)).take_while(|sigma| *sigma >= CALIBRATION)
}

/// The states that tracks have reached at each noise level.
#[derive(Default)]
pub struct VisitedStates(Vec<(PoseState, NoiseLevels)>);

impl VisitedStates {
    /// Adds a state; returns whether it is new.
    fn insert(&mut self, state: &PoseState, noise: NoiseLevels) -> bool {
        let is_new = !self.0.iter().any(|(other, at)| *at == noise && other.is_same(state));
        self.0.extend(is_new.then_some((*state, noise)));
        is_new
    }
}

/// Takes each track to its next noise level, if there is one, and ends those that are too far behind or reach a visited state. Without
/// budget only tracks that have not reached any state go on.
fn advance<F: Fn(&Pose) -> Gaussian>(
    tracks: &mut Vec<Track<F>>,
    max_deficit: f64,
    visited: &mut VisitedStates,
    next: impl Fn(&Track<F>) -> Option<NoiseLevels>,
    budget: &Budget,
) {
    tracks.retain_mut(|track| {
        let is_done = budget.is_exhausted() && track.best.is_some();
        is_done
            || next(track).is_none_or(|noise| match track.run_at(noise) {
                Some(()) => visited.insert(&track.state, noise),
                // Where no distribution is found at a level, the best one stands.
                None => track.restore_best().is_some(),
            })
    });
    let most = |index: usize| tracks[index].best_log_evidence();
    let Some(best) = (0..tracks.len()).max_by(|&a, &b| most(a).total_cmp(&most(b))) else { return };
    let is_behind =
        |track: &Track<F>| most(best) - track.best_log_evidence() > max_deficit && !tracks[best].is_equivalent(track);
    let behind: Vec<bool> = tracks.iter().map(is_behind).collect();
    let mut behind = behind.into_iter();
    tracks.retain(|_| behind.next() == Some(false));
}

/// The way of one start through the noise levels.
struct Track<'a, F> {
    inference: LabelInference<'a, F>,
    state: PoseState,
    /// The state at each level.
    visited: Vec<(PoseState, NoiseLevels)>,
    /// The likeliest of these, with its active set.
    best: Option<(PoseState, NoiseLevels, ActiveSet<'a>)>,
}

impl<'a, F: Fn(&Pose) -> Gaussian> Track<'a, F> {
    fn new(regions: &'a [SampledRegion], prior: &'a F, start: &CoarseFit, budget: &'a Budget) -> Self {
        let CoarseFit { pose, increment, .. } = *start;
        let state = PoseState { pose, increment, log_evidence: f64::NEG_INFINITY, has_converged: false };
        let inference = LabelInference::joint(regions, prior, pose, start.models.clone(), budget);
        Self { inference, state, visited: Vec::new(), best: None }
    }

    /// Greatest log evidence so far.
    fn best_log_evidence(&self) -> f64 {
        self.best.as_ref().map_or(f64::NEG_INFINITY, |(state, ..)| state.log_evidence)
    }

    /// Whether the likeliest states of two tracks differ by no more than chance.
    fn is_equivalent(&self, other: &Self) -> bool {
        let (Some(own), Some(other)) = (self.evidence(), other.evidence()) else { return false };
        own.deviance_to(&other, self.inference.samples.regions) <= EQUIVALENT_DEVIANCE
    }

    /// Whether the likeliest states of two tracks are one answer.
    fn has_same_mode(&self, other: &Self) -> bool {
        match (&self.best, &other.best) {
            (Some((own, ..)), Some((other, ..))) => own.squared_sigmas_to(other) < ONE_VARIANCE,
            _ => false,
        }
    }

    /// Evidence of the likeliest state.
    fn evidence(&self) -> Option<ModeEvidence> {
        let (PoseState { pose, log_evidence, .. }, _, samples) = self.best.as_ref()?;
        let (log_probabilities, log_prior) = (samples.log_probabilities(pose), self.inference.log_prior(pose));
        Some(ModeEvidence { log_probabilities, log_evidence: *log_evidence, log_prior })
    }

    /// The likeliest level with these sigmas of dilation and corners, unless visited, or the nearest level with larger corners was so much
    /// less likely that this one is negligible.
    fn likeliest_with(&self, dilation: f64, corner: f64) -> Option<NoiseLevels> {
        let noise = NoiseLevels { dilation, corner, ..self.best.as_ref()?.1 };
        let larger = self.visited.iter().rev().filter(|(_, at)| at.label == noise.label && at.corner >= corner);
        let (last, _) = larger.min_by(|(_, a), (_, b)| a.corner.total_cmp(&b.corner))?;
        let is_relevant = self.best_log_evidence() - last.log_evidence <= DECISIVE;
        (self.is_new(&noise) && is_relevant).then_some(noise)
    }

    /// The likeliest level with the sigma of corners multiplied, unless visited.
    fn neighbor_of_likeliest(&self, ratio: f64) -> Option<NoiseLevels> {
        let (_, likeliest, _) = self.best.as_ref()?;
        let noise = likeliest.with_scaled_corner(ratio);
        self.is_new(&noise).then_some(noise)
    }

    /// Whether no equivalent level has been visited.
    fn is_new(&self, noise: &NoiseLevels) -> bool {
        self.visited.iter().all(|(_, at)| !at.is_equivalent(noise))
    }

    /// Finds the state at a level; `None` where a direction is left free.
    fn run_at(&mut self, noise: NoiseLevels) -> Option<()> {
        self.state = self.inference.run_to_convergence(self.state, noise, MAX_ROUNDS, false)?;
        self.state.log_evidence += noise.log_prior();
        if self.best.as_ref().is_none_or(|(best, ..)| self.state.is_likelier(best)) {
            self.best = Some((self.state, noise, self.inference.samples.clone()));
        }
        self.visited.push((self.state, noise));
        Some(())
    }

    /// Restores the likeliest state and returns its level; `None` where there is none.
    fn restore_best(&mut self) -> Option<NoiseLevels> {
        let (state, noise, samples) = self.best.as_ref()?;
        (self.state, self.inference.samples) = (*state, samples.clone());
        Some(*noise)
    }

    /// The posterior: the likeliest state, linearized over its distribution, mixed with those at other levels.
    fn finish(mut self) -> Option<Posterior> {
        let noise = self.restore_best()?;
        let likeliest = self.state;
        let last = match self.linearized_statistically(noise) {
            Some(last) => last,
            None => {
                self.restore_best()?;
                likeliest
            }
        };
        let (pose, covariance) = self.marginalized(noise, &likeliest, &last);
        let samples = &self.inference.samples;
        Some(Posterior {
            pose,
            covariance,
            noise,
            wrong_fractions: wrong_fractions(samples.regions, &samples.models, &last, noise, samples.budget),
            messages: samples.messages(),
            evidence: ModeEvidence {
                log_probabilities: samples.log_probabilities(&last.pose),
                log_evidence: last.log_evidence,
                log_prior: self.inference.log_prior(&pose),
            },
        })
    }

    /// Mean and covariance over all levels with the likeliest sigma of labels, by their evidence; `last` takes the place of the likeliest
    /// state.
    fn marginalized(&self, noise: NoiseLevels, likeliest: &PoseState, last: &PoseState) -> (Pose, Matrix6<f64>) {
        let is_other =
            |(state, at): &&(PoseState, NoiseLevels)| state.has_converged && at.label == noise.label && *at != noise;
        let mut levels = vec![(likeliest.log_evidence, noise)];
        let mut states = vec![*last];
        for (state, at) in self.visited.iter().filter(is_other) {
            levels.push((state.log_evidence, *at));
            states.push(*state);
        }
        let components = noise_weights(&levels).into_iter().zip(states);
        let components = components.map(|(weight, state)| (weight, state.pose, state.increment.covariance));
        mixture_moments(&last.pose, &components.collect::<Vec<_>>())
    }

    /// The state with margins linearized over its whole distribution; `None` where no distribution is found, or one so much less likely
    /// that margins bend by more than their linearization variances.
    fn linearized_statistically(&mut self, noise: NoiseLevels) -> Option<PoseState> {
        let last = self.inference.run_to_convergence(self.state, noise, MAX_LAST_ROUNDS, true)?;
        let log_evidence = last.log_evidence + noise.log_prior();
        let is_found = last.has_converged && self.state.log_evidence - log_evidence <= DECISIVE;
        is_found.then_some(PoseState { log_evidence, ..last })
    }
}

impl PoseState {
    /// Whether it is likelier than another one; one that has converged is likelier than one that has not.
    fn is_likelier(&self, other: &Self) -> bool {
        (self.has_converged, self.log_evidence) > (other.has_converged, other.log_evidence)
    }

    /// Whether another one is the same up to chance.
    fn is_same(&self, other: &Self) -> bool {
        (self.log_evidence - other.log_evidence).abs() < SAME_EVIDENCE && self.squared_sigmas_to(other) < SAME_STATE
    }

    /// Squared Mahalanobis distance to another one.
    fn squared_sigmas_to(&self, other: &Self) -> f64 {
        squared_sigmas((&self.pose, &self.increment.covariance), (&other.pose, &other.increment.covariance))
    }
}

/// Posterior weights of noise levels with one sigma of labels, by their log evidence and prior. Each level stands for an interval about it;
/// where the neighbors of the likeliest are among them, these three stand for all that lies between.
pub fn noise_weights(levels: &[(f64, NoiseLevels)]) -> Vec<f64> {
    let Some(best) = (0..levels.len()).max_by(|&a, &b| levels[a].0.total_cmp(&levels[b].0)) else { return Vec::new() };
    let (most, likeliest) = levels[best];
    let mut weights: Vec<f64> = levels.iter().map(|(log_evidence, _)| (log_evidence - most).exp()).collect();
    let neighbor = |ratio: f64| {
        let is_neighbor = |noise: &NoiseLevels| {
            noise.dilation == likeliest.dilation && noise.corner_sigma() == likeliest.corner_sigma() * ratio
        };
        levels.iter().position(|(_, noise)| is_neighbor(noise))
    };
    if let (Some(below), Some(above)) = (neighbor(1.0 / HALF_LEVEL), neighbor(HALF_LEVEL)) {
        [weights[below], weights[best], weights[above]] =
            interpolated_weights(levels[below].0 - most, levels[above].0 - most);
    }
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / sum).collect()
}

/// Weights of the level below the likeliest, of this one and of the one above it, in units of a level's interval, by the log evidence of both
/// neighbors against it. Between them log evidence is the parabola through these over the log sigma of corners; what lies between two
/// levels is shared so that the mean square stays, with which covariances grow. By levels of ratio four alone the likeliest may be off by
/// two, and so would be all ellipsoids.
fn interpolated_weights(below: f64, above: f64) -> [f64; 3] {
    let mut weights = [0.0; 3];
    for node in 0..2 * NODES {
        let at = (f64::from(node) + 0.5) / f64::from(NODES) - 1.0;
        let log_evidence = 0.5 * at * ((above - below) + at * (above + below));
        let weight = log_evidence.exp() * HALF_LEVEL.ln() / (f64::from(NODES) * LEVEL_RATIO.ln());
        let lower = usize::from(node >= NODES);
        let [square, low, high] = [at, lower as f64 - 1.0, lower as f64].map(|at| HALF_LEVEL.powf(2.0 * at));
        let fraction = (square - low) / (high - low);
        weights[lower] += weight * (1.0 - fraction);
        weights[lower + 1] += weight * fraction;
    }
    weights
}
