//! Multi-start search of a pose by the edges of photos and clouds: draws from the prior, refined to maxima of the posterior from coarse
//! to fine spreads (`docs/math.md`, section 19).

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::{Matrix6, Rotation3, Vector3};

use super::density::{PoseDensity, Sampler};
use super::frame::{FINEST, Frame};
use super::parallel::mapped;
use super::posterior::{Mode, Posterior, Weight};
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

/// Turn, rad, that moves the edges of any photo by more than that.
const FAR_TURN: f64 = 0.2;

/// Turns of null poses from drawn ones, rad: beyond what a pose may be off, to like parts of the photo.
const TURNED: [f64; 2] = [3.0 / 180.0 * PI, 8.0 / 180.0 * PI];

/// Number of null poses, of all directions and about one pose: they estimate a variance to a tenth, and to an eighth; for a ranking to a
/// quarter.
const NULLS: usize = 256;
const LOCAL_NULLS: usize = 128;
const RANKING_NULLS: usize = 32;

/// By how many deviations the sums of true poses exceed those of wrong ones: by 2 to 6 on frames of cars, at spreads of 16 and 8 pixels.
const SEPARATION: f64 = 3.0;

/// Poses of a density whose volumes are looked at: a median to a tenth.
const VOLUMES: usize = 128;

/// How many poses of a density the widest spread distinguishes: the volume of its deviations over that of moves of the edges by a spread,
/// `sqrt(det(L + A / spread^2) / det L)` with the density's information `L` and the mean squares of moves `A`, the median over its draws.
///
/// # Errors
/// When threads cannot be started.
pub fn distinct_poses(frames: &[Frame], density: &PoseDensity, threads: Option<usize>) -> Result<f64> {
    let sampler = Sampler::new(density.clone());
    let posterior = Posterior { frames, weights: vec![Weight::Tempered(0.0); frames.len()], spread: 0, density };
    let numbers: Vec<usize> = (0..VOLUMES).collect();
    let mut volumes = mapped(&numbers, threads, |number| posterior.distinct_poses(&drawn(&sampler, *number)))?;
    volumes.sort_by(f64::total_cmp);
    Ok(volumes[VOLUMES / 2])
}

/// The maxima of the posterior of the pose that frames share, that of the largest mass first, from nothing but a density of poses and some
/// `starts`.
///
/// # Errors
/// When threads cannot be started.
pub fn search(frames: &[Frame], density: &PoseDensity, starts: &[Pose], options: &SearchOptions) -> Result<Vec<Mode>> {
    search_with_progress(frames, density, starts, options, &SearchProgress::default())
}

/// [`search`], which reports to `progress`.
///
/// # Errors
/// When threads cannot be started.
pub fn search_with_progress(
    frames: &[Frame],
    density: &PoseDensity,
    starts: &[Pose],
    options: &SearchOptions,
    progress: &SearchProgress,
) -> Result<Vec<Mode>> {
    let expected = [options.draws, options.kept[0] + starts.len(), options.kept[1], options.kept[2]];
    progress.begin(expected);
    let pass_missing = |step: usize, poses: usize| progress.pass(step, expected[step].saturating_sub(poses));
    let sampler = Sampler::new(density.clone());
    // Maxima of few starts are not compared with drawn poses.
    let nulls = if options.draws == 0 { NULLS.min(RANKING_NULLS * starts.len().max(1)) } else { NULLS };
    let nulls: Vec<Pose> = (0..nulls).map(|number| base(&sampler, starts, options.draws, number)).collect();
    let numbers: Vec<usize> = (0..options.draws).collect();
    let threads = options.threads;
    // Draws are evenly spread, and ranked alone: maxima by the widest spread may be a degree off.
    let posterior = Posterior {
        frames,
        weights: log_odds_weights(&Sums::at(frames, &turned(&nulls), 0, threads)?),
        spread: 0,
        density,
    };
    let mut drawn = mapped(&numbers, threads, |number| {
        let pose = drawn(&sampler, *number);
        progress.count(0);
        (pose, posterior.log_density(&pose))
    })?;
    drawn.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut held: Vec<Pose> =
        starts.iter().copied().chain(drawn.into_iter().map(|(pose, _)| pose).take(options.kept[0])).collect();
    for spread in 1..FINEST {
        pass_missing(spread, held.len());
        let weights = log_odds_weights(&Sums::at(frames, &turned(&nulls), spread, threads)?);
        let posterior = Posterior { frames, weights, spread, density };
        // The null distribution of a sum depends on the pose, so poses are ranked by null poses about each.
        let refined = mapped(&held, threads, |pose| {
            let (pose, _) = posterior.maximum(pose);
            progress.count(spread);
            let weights = log_odds_weights(&Sums::here(frames, &turned(&[pose; RANKING_NULLS]), spread));
            (pose, Posterior { weights, ..posterior.clone() }.log_density(&pose))
        })?;
        held = distinct(&posterior, refined, options.kept[spread], threads)?;
    }
    pass_missing(FINEST, held.len());
    let found = mapped(&held, threads, |pose| {
        let weights = tempering_weights(&Sums::here(frames, &turned(&[*pose; LOCAL_NULLS]), FINEST));
        let posterior = Posterior { frames, weights, spread: FINEST, density };
        let mode = posterior.mode(&posterior.maximum(pose).0);
        progress.count(FINEST);
        mode
    })?;
    let modes: Vec<Mode> = found.into_iter().flatten().collect();
    let scored = modes.iter().map(|mode| (mode.pose, mode.log_mass)).collect();
    let whole = Posterior { frames, weights: vec![Weight::Tempered(0.0); frames.len()], spread: FINEST, density };
    let apart = distinct(&whole, scored, modes.len(), threads)?;
    let at = |pose: &Pose| modes.iter().find(|mode| mode.pose == *pose).copied();
    Ok(apart.iter().filter_map(at).collect())
}

/// Weights of frames by spread, by null poses about one pose: maxima that are compared by the same weights are not compared by the
/// errors of these.
#[derive(Debug, Clone)]
pub struct LocalWeights([Vec<Weight>; FINEST]);

impl LocalWeights {
    /// Those about a pose, of all spreads but the widest.
    pub fn about(frames: &[Frame], pose: &Pose) -> Self {
        let sums = |count, spread| Sums::here(frames, &turned(&vec![*pose; count]), spread);
        Self(std::array::from_fn(|number| match number + 1 {
            FINEST => tempering_weights(&sums(LOCAL_NULLS, FINEST)),
            spread => log_odds_weights(&sums(RANKING_NULLS, spread)),
        }))
    }

    /// The maximum of the posterior reached from a start, from coarse to fine spreads.
    pub fn maximum(&self, frames: &[Frame], density: &PoseDensity, start: &Pose) -> Option<Mode> {
        let at = |spread: usize| Posterior { frames, weights: self.0[spread - 1].clone(), spread, density };
        let pose = (1..=FINEST).fold(*start, |pose, spread| at(spread).maximum(&pose).0);
        at(FINEST).mode(&pose)
    }
}

/// Non-maximum suppression: the likeliest poses, at most `most`, that differ by more than [`APART`].
fn distinct(
    posterior: &Posterior<'_>,
    mut held: Vec<(Pose, f64)>,
    most: usize,
    threads: Option<usize>,
) -> Result<Vec<Pose>> {
    held.retain(|(_, value)| *value > f64::NEG_INFINITY);
    held.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<Pose> = Vec::new();
    let mut metrics: Vec<Matrix6<f64>> = Vec::new();
    // Metrics are made for as many as may be kept, in parallel.
    let candidates = &held[..held.len().min(4 * most)];
    let made = mapped(candidates, threads, |(pose, _)| posterior.metric(pose))?;
    for ((pose, _), metric) in candidates.iter().zip(made) {
        let is_new = kept.iter().zip(&metrics).all(|(other, metric)| {
            // This alone distinguishes most pairs.
            pose.angle_to(other) > FAR_TURN || {
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

/// Sums of log likelihood ratios, and how many edges the photo shows: for each pose those of each frame.
struct Sums(Vec<Vec<(f64, usize)>>);

impl Sums {
    fn at(frames: &[Frame], poses: &[Pose], spread: usize, threads: Option<usize>) -> Result<Self> {
        let of_pose = |pose: &Pose| frames.iter().map(|frame| frame.log_ratio(pose, spread)).collect();
        Ok(Self(mapped(poses, threads, of_pose)?))
    }

    /// The same on this thread.
    fn here(frames: &[Frame], poses: &[Pose], spread: usize) -> Self {
        let of_pose = |pose: &Pose| frames.iter().map(|frame| frame.log_ratio(pose, spread)).collect();
        Self(poses.iter().map(of_pose).collect())
    }

    fn of_frame(&self, frame: usize) -> impl Iterator<Item = (f64, usize)> + Clone + '_ {
        self.0.iter().map(move |frames| frames[frame])
    }

    fn frames(&self) -> usize {
        self.0.first().map_or(0, Vec::len)
    }
}

/// Weights of frames that make sums the log odds that they exceed those of wrong poses by [`SEPARATION`] deviations rather than by
/// none, by the sums at null poses of all directions. Variances grow with the number of edges.
fn log_odds_weights(sums: &Sums) -> Vec<Weight> {
    let weight = |frame: usize| {
        let of_frame = || sums.of_frame(frame).filter(|(_, count)| *count > 0);
        let edges: usize = of_frame().map(|(_, count)| count).sum();
        let offset = of_frame().map(|(sum, _)| sum).sum::<f64>() / edges.max(1) as f64;
        let squares = of_frame().map(|(sum, count)| (sum - offset * count as f64).powi(2) / count as f64);
        let variance = squares.sum::<f64>() / of_frame().count().max(1) as f64;
        Weight::Standardized { offset, scale: if variance > 0.0 { SEPARATION / variance.sqrt() } else { 0.0 } }
    };
    (0..sums.frames()).map(weight).collect()
}

/// Weights by which the likelihood ratio of each frame is 1 on the mean over null poses, and so is that of all frames (eq. 18.3): those
/// that are redundant, as of a rig that stands still, are weighted down together.
fn tempering_weights(sums: &Sums) -> Vec<Weight> {
    let exponents: Vec<f64> =
        (0..sums.frames()).map(|frame| tempering_exponent(sums.of_frame(frame).map(|(sum, _)| sum))).collect();
    let together =
        sums.0.iter().map(|sums| sums.iter().zip(&exponents).map(|((sum, _), exponent)| sum * exponent).sum());
    let joint = tempering_exponent(together.collect::<Vec<f64>>().into_iter());
    exponents.into_iter().map(|exponent| Weight::Tempered(exponent * joint)).collect()
}

/// The exponent at which sums that are about normal have likelihood ratios of 1 on the mean.
fn tempering_exponent(sums: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = sums.clone().count().max(2) as f64;
    let mean = sums.clone().sum::<f64>() / count;
    let variance = sums.map(|sum| (sum - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (-2.0 * mean / variance.max(1e-12)).clamp(0.0, 1.0)
}

/// A pose that is drawn, or one of the starts where none are.
fn base(sampler: &Sampler, starts: &[Pose], draws: usize, number: usize) -> Pose {
    if draws == 0 && !starts.is_empty() { starts[number % starts.len()] } else { drawn(sampler, number) }
}

/// Null poses: given ones, turned beyond any plausible error.
fn turned(poses: &[Pose]) -> Vec<Pose> {
    poses.iter().enumerate().map(|(number, pose)| turned_by(pose, number)).collect()
}

fn turned_by(pose: &Pose, number: usize) -> Pose {
    let [a, b, c] = sequence::<3>(number);
    let (height, around) = (2.0 * a - 1.0, TAU * b);
    let side = (1.0 - height * height).max(0.0).sqrt();
    let axis = Vector3::new(side * around.cos(), side * around.sin(), height);
    let turn = Rotation3::new(axis * (TURNED[0] + c * (TURNED[1] - TURNED[0])));
    Pose::new(turn * pose.rotation, turn * pose.translation)
}

/// The pose of a number, evenly spread over a density.
fn drawn(sampler: &Sampler, number: usize) -> Pose {
    let even = sequence::<9>(number);
    let pair = |first: usize| {
        // Box and Muller's: two normal numbers of two even ones.
        let length = (-2.0 * (1.0 - even[first]).ln()).sqrt();
        let (sin, cos) = (TAU * even[first + 1]).sin_cos();
        [length * cos, length * sin]
    };
    let ([a, b], [c, d], [e, f]) = (pair(3), pair(5), pair(7));
    sampler.pose(&[even[0], even[1], even[2]], &[a, b, c, d, e, f])
}

/// The numbers of an evenly spread sequence in so many dimensions, from 0 to 1: multiples of powers of the root of x^(d+1) = x + 1
/// (Roberts, The unreasonable effectiveness of quasirandom sequences, 2018).
fn sequence<const D: usize>(number: usize) -> [f64; D] {
    let mut root = 2.0_f64;
    for _ in 0..40 {
        root = (1.0 + root).powf(1.0 / (D as f64 + 1.0));
    }
    std::array::from_fn(|axis| (0.5 + (number + 1) as f64 * root.powi(-(axis as i32 + 1))).fract())
}
