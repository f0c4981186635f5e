//! Null poses: given ones, turned in place beyond any plausible error, at which photo and cloud agree by chance; and the weights of
//! frames by the sums there (`docs/math.md`, section 19).

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, Vector3};

use super::density::{PoseDensity, sequence};
use super::frame::{FINEST, Frame};
use super::parallel::mapped;
use super::posterior::{Mode, Posterior, Weight};
use crate::budget::Budget;
use crate::error::Result;
use crate::geometry::pose::Pose;

/// Turns of null poses from drawn ones, rad: beyond what a pose may be off, to like parts of the photo.
const TURNED: [f64; 2] = [3.0 / 180.0 * PI, 8.0 / 180.0 * PI];

/// Number of null poses about one pose: they estimate a variance to an eighth, and for a ranking to a quarter.
const LOCAL_NULLS: usize = 128;
pub(super) const RANKING_NULLS: usize = 32;

/// By how many deviations the sums of true poses exceed those of wrong ones: by 2 to 6 on frames of cars, at spreads of 16 and 8 pixels.
const SEPARATION: f64 = 3.0;

/// Weights that make sums log odds, by a null pose of each given one.
///
/// # Errors
/// When threads cannot be started.
pub(super) fn weights_among(
    frames: &[Frame],
    poses: &[Pose],
    spread: usize,
    threads: Option<usize>,
    budget: &Budget,
) -> Result<Vec<Weight>> {
    let sums = mapped(&turned(poses), threads, |pose, budget| sums_at(frames, pose, spread, budget), budget)?;
    Ok(log_odds_weights(&Sums(sums)))
}

/// Weights by null poses about one pose: those of a posterior by the finest spread, those that make sums log odds by others.
pub(super) fn weights_about(frames: &[Frame], pose: &Pose, spread: usize, budget: &Budget) -> Vec<Weight> {
    let sums =
        |count| Sums(turned(&vec![*pose; count]).iter().map(|null| sums_at(frames, null, spread, budget)).collect());
    if spread == FINEST { tempering_weights(&sums(LOCAL_NULLS)) } else { log_odds_weights(&sums(RANKING_NULLS)) }
}

/// Weights of frames by spread, by null poses about one pose: maxima that are compared by the same weights are not compared by the
/// errors of these.
#[derive(Debug, Clone)]
pub struct LocalWeights([Vec<Weight>; FINEST]);

impl LocalWeights {
    /// Those about a pose, of all spreads but the widest.
    pub fn about(frames: &[Frame], pose: &Pose, budget: &Budget) -> Self {
        Self(std::array::from_fn(|number| weights_about(frames, pose, number + 1, budget)))
    }

    /// The maximum of the posterior reached from a start, from coarse to fine spreads.
    pub fn maximum(&self, frames: &[Frame], density: &PoseDensity, start: &Pose, budget: &Budget) -> Option<Mode> {
        let at = |spread: usize| Posterior { frames, weights: self.0[spread - 1].clone(), spread, density };
        let pose = (1..=FINEST).fold(*start, |pose, spread| at(spread).maximum(&pose, budget).0);
        at(FINEST).mode(&pose, budget)
    }
}

/// Sums of log likelihood ratios, and how many edges the photo shows: for each pose those of each frame.
struct Sums(Vec<Vec<(f64, usize)>>);

impl Sums {
    fn of_frame(&self, frame: usize) -> impl Iterator<Item = (f64, usize)> + Clone + '_ {
        self.0.iter().map(move |frames| frames[frame])
    }

    fn frames(&self) -> usize {
        self.0.first().map_or(0, Vec::len)
    }
}

fn sums_at(frames: &[Frame], pose: &Pose, spread: usize, budget: &Budget) -> Vec<(f64, usize)> {
    frames.iter().map(|frame| frame.log_ratio(pose, spread, budget)).collect()
}

/// Weights of frames that make sums the log odds that they exceed those of wrong poses by [`SEPARATION`] deviations rather than by
/// none, by the sums at null poses. Variances grow with the number of edges.
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

/// A null pose of each given one, about axes spread evenly over the sphere.
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
