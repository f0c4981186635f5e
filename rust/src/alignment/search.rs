//! Multi-start search of a pose by the edges of photos and clouds: draws from the prior, refined to maxima of the posterior from coarse
//! to fine spreads (`docs/math.md`, section 19).

use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::Matrix6;

use super::density::{PoseDensity, Sampler};
use super::frame::{FINEST, Frame};
use super::null_poses::{RANKING_NULLS, weights_about, weights_among};
use super::parallel::mapped;
use super::posterior::{Mode, Posterior, Weight};
use crate::budget::Budget;
use crate::equations::step_bounds::CONVERGENCE_RADIUS;
use crate::error::Result;
use crate::geometry::pose::Pose;

/// Options of a search.
#[derive(Debug, Clone, Copy)]
pub struct SearchOptions {
    /// Poses that are drawn.
    pub draws: usize,
    /// How many of the best at each spread but the finest are refined at the next one.
    pub kept: [usize; FINEST],
    /// Threads; all cores for `None`.
    pub threads: Option<usize>,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self { draws: 60_000, kept: [2_000, 400, 64], threads: None }
    }
}

/// Progress of a search, for other threads to read.
#[derive(Debug, Default)]
pub struct SearchProgress {
    done: AtomicU64,
    all: AtomicU64,
}

impl SearchProgress {
    /// The fraction that is done, from 0 to 1.
    pub fn fraction(&self) -> f64 {
        let all = self.all.load(Ordering::Relaxed);
        if all == 0 { 0.0 } else { (self.done.load(Ordering::Relaxed) as f64 / all as f64).min(1.0) }
    }

    /// Takes in the work of the steps that begin, of so many poses each.
    fn begin(&self, poses: [usize; STEPS]) {
        let all = poses.iter().zip(WORK).map(|(count, work)| *count as u64 * work).sum();
        self.all.store(all, Ordering::Relaxed);
    }

    /// Counts a pose of a step.
    fn count(&self, step: usize) {
        self.done.fetch_add(WORK[step], Ordering::Relaxed);
    }

    /// Counts poses of a step that there are fewer of than expected.
    fn pass(&self, step: usize, poses: usize) {
        self.done.fetch_add(WORK[step] * poses as u64, Ordering::Relaxed);
    }
}

/// Steps of a search: draws, and maxima by each spread but the widest.
const STEPS: usize = FINEST + 1;

/// The work of a pose in each step, that of a draw being 1: measured on one and on three frames of 64 rings.
const WORK: [u64; STEPS] = [1, 90, 190, 1400];

/// Root mean square distance of the edges of two poses, in spreads, from which on they count as different maxima.
const APART: f64 = 0.5;

/// Number of null poses of all directions: they estimate a variance to a tenth.
const NULLS: usize = 256;

/// Poses of a density whose volumes are computed: a convention.
const VOLUMES: usize = 128;

/// How many poses of a density the widest spread distinguishes: the volume of its deviations over that of moves of the edges by a spread,
/// `sqrt(det(L + A / spread^2) / det L)` with the density's information `L` and the mean squares of moves `A`, the median over its draws.
///
/// # Errors
/// When threads cannot be started.
pub fn distinct_poses(frames: &[Frame], density: &PoseDensity, threads: Option<usize>, budget: &Budget) -> Result<f64> {
    let sampler = Sampler::new(density.clone());
    let posterior = Posterior { frames, weights: vec![Weight::Tempered(0.0); frames.len()], spread: 0, density };
    let numbers: Vec<usize> = (0..VOLUMES).collect();
    let volume = |number: &usize, budget: &Budget| posterior.distinct_poses(&sampler.draw(*number), budget);
    let mut volumes = mapped(&numbers, threads, volume, budget)?;
    volumes.sort_by(f64::total_cmp);
    Ok(volumes[VOLUMES / 2])
}

/// The maxima of the posterior of the pose that frames share, that of the largest mass first, from nothing but a density of poses and some
/// `starts`.
///
/// # Errors
/// When threads cannot be started.
pub fn search(frames: &[Frame], density: &PoseDensity, starts: &[Pose], options: &SearchOptions) -> Result<Vec<Mode>> {
    search_with_progress(frames, density, starts, options, &SearchProgress::default(), &Budget::unlimited())
}

/// [`search`], which reports to `progress`, within a budget.
///
/// # Errors
/// When threads cannot be started.
pub fn search_with_progress(
    frames: &[Frame],
    density: &PoseDensity,
    starts: &[Pose],
    options: &SearchOptions,
    progress: &SearchProgress,
    budget: &Budget,
) -> Result<Vec<Mode>> {
    let expected = [options.draws, options.kept[0] + starts.len(), options.kept[1], options.kept[2]];
    progress.begin(expected);
    let pass_missing = |step: usize, poses: usize| progress.pass(step, expected[step].saturating_sub(poses));
    let sampler = Sampler::new(density.clone());
    let bases = null_bases(&sampler, starts, options.draws);
    let threads = options.threads;
    let best = best_draws(frames, density, &sampler, &bases, options, progress, budget)?;
    let mut held: Vec<Pose> = starts.iter().copied().chain(best).collect();
    for spread in 1..FINEST {
        pass_missing(spread, held.len());
        let weights = weights_among(frames, &bases, spread, threads, budget)?;
        let posterior = Posterior { frames, weights, spread, density };
        // The null distribution of a sum depends on the pose, so poses are ranked by null poses about each.
        let refine = |pose: &Pose, budget: &Budget| {
            let (pose, _) = posterior.maximum(pose, budget);
            progress.count(spread);
            let weights = weights_about(frames, &pose, spread, budget);
            (pose, Posterior { weights, ..posterior.clone() }.log_density(&pose, budget))
        };
        let refined = mapped(&held, threads, refine, budget)?;
        held = distinct(&posterior, refined, options.kept[spread], threads, budget)?;
    }
    pass_missing(FINEST, held.len());
    let mode = |pose: &Pose, budget: &Budget| {
        let weights = weights_about(frames, pose, FINEST, budget);
        let posterior = Posterior { frames, weights, spread: FINEST, density };
        let mode = posterior.mode(&posterior.maximum(pose, budget).0, budget);
        progress.count(FINEST);
        mode
    };
    let found = mapped(&held, threads, mode, budget)?;
    let modes: Vec<Mode> = found.into_iter().flatten().collect();
    let scored = modes.iter().map(|mode| (mode.pose, mode.log_mass)).collect();
    let whole = Posterior { frames, weights: vec![Weight::Tempered(0.0); frames.len()], spread: FINEST, density };
    let apart = distinct(&whole, scored, modes.len(), threads, budget)?;
    let at = |pose: &Pose| modes.iter().find(|mode| mode.pose == *pose).copied();
    Ok(apart.iter().filter_map(at).collect())
}

/// Non-maximum suppression: the likeliest poses, at most `most`, that differ by more than [`APART`].
fn distinct(
    posterior: &Posterior<'_>,
    mut held: Vec<(Pose, f64)>,
    most: usize,
    threads: Option<usize>,
    budget: &Budget,
) -> Result<Vec<Pose>> {
    held.retain(|(_, value)| *value > f64::NEG_INFINITY);
    held.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<Pose> = Vec::new();
    let mut metrics: Vec<Matrix6<f64>> = Vec::new();
    // Metrics are made for as many as may be kept, in parallel.
    let candidates = &held[..held.len().min(4 * most)];
    let made = mapped(candidates, threads, |(pose, _), budget| posterior.metric(pose, budget), budget)?;
    for ((pose, _), metric) in candidates.iter().zip(made) {
        let is_new = kept.iter().zip(&metrics).all(|(other, metric)| {
            // This alone distinguishes most pairs.
            pose.angle_to(other) > CONVERGENCE_RADIUS || {
                let way = other.local_coordinates(pose);
                way.dot(&(metric * way)) > APART * APART
            }
        });
        if is_new {
            kept.push(*pose);
            metrics.push(metric);
            if kept.len() == most {
                break;
            }
        }
    }
    Ok(kept)
}

/// Poses from which null poses of all directions are turned: drawn ones, or the starts where none are drawn.
fn null_bases(sampler: &Sampler, starts: &[Pose], draws: usize) -> Vec<Pose> {
    if draws > 0 || starts.is_empty() {
        return (0..NULLS).map(|number| sampler.draw(number)).collect();
    }
    let count = NULLS.min(RANKING_NULLS * starts.len());
    (0..count).map(|number| starts[number % starts.len()]).collect()
}

/// The best of the drawn poses by the widest spread, as many as are kept; ranked as they are: maxima by that spread may be a degree off.
fn best_draws(
    frames: &[Frame],
    density: &PoseDensity,
    sampler: &Sampler,
    bases: &[Pose],
    options: &SearchOptions,
    progress: &SearchProgress,
    budget: &Budget,
) -> Result<Vec<Pose>> {
    if options.draws == 0 {
        return Ok(Vec::new());
    }
    let weights = weights_among(frames, bases, 0, options.threads, budget)?;
    let posterior = Posterior { frames, weights, spread: 0, density };
    let numbers: Vec<usize> = (0..options.draws).collect();
    let draw = |number: &usize, budget: &Budget| {
        let pose = sampler.draw(*number);
        progress.count(0);
        (pose, posterior.log_density(&pose, budget))
    };
    let mut drawn = mapped(&numbers, options.threads, draw, budget)?;
    drawn.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(drawn.into_iter().map(|(pose, _)| pose).take(options.kept[0]).collect())
}
