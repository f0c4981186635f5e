//! The plane through most of some points.

use nalgebra::Vector3;

use super::plane::{PlaneFrame, PrincipalAxes};
use super::points::extent;
use crate::budget::Budget;
use crate::error::Result;
use crate::math::normal::{MAD_TO_SIGMA, OUTLIER_SIGMAS};

/// Points below which all of them count: a majority of fewer than five for each of a plane's numbers lies on some plane by chance
/// (Rousseeuw, Leroy 1987, section 1.4).
const MIN_POINTS: usize = 15;

/// Planes through three random points that are tried: 40 % of outliers leave a wrong best with odds of 1e-21.
const TRIALS: usize = 200;

/// Points from which a trial plane's median distance is taken; more change it by under 3 %.
const JUDGES: usize = 2000;

/// Distance from its plane that rounding alone gives a point, in epsilons of the extent.
const ROUNDINGS: f64 = 64.0;

/// Least squares fits to the inliers at most; they converge in two or three.
const REFITS: usize = 10;

/// Width over length below which the points on a plane may be one scan line, which its beams' plane holds without any error; range
/// noise widens a short one to this much.
const LINE_WIDTH: f64 = 0.15;

/// Width over length of all points, in that of such a line, from which they show another plane.
const WIDER: f64 = 1.3;

/// Least width over length of a line that is compared with the noise, for range noise that leaves it in its plane.
const MIN_LINE_NOISE: f64 = 0.02;

/// A plane and the points that are no outliers of it.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustPlane {
    /// Least squares plane of the inliers.
    pub frame: PlaneFrame,
    /// Indices of the inliers, in order.
    pub inliers: Vec<usize>,
}

/// A plane through most of some points.
///
/// Least squares over the points within three standard deviations until they stay the same, from two starts: all points, and the
/// plane through three of them with the least median distance (Rousseeuw 1984). That one is right with outliers, but may lie askew
/// along a single scan line; the better fit is the one under which the points are likelier, outliers being anywhere. Of points that a
/// sensor saw, distances along their beams count: the plane of the beams themselves holds a scan line without any error, and no beam
/// meets it. Of fewer than 15 points only the first start is taken: a plane through half of them says nothing.
///
/// # Errors
/// When the points are identical or on one line.
pub fn robust_plane(points: &[Vector3<f64>], sensor: Option<&Vector3<f64>>, budget: &Budget) -> Result<RobustPlane> {
    let all = PlaneFrame::fit(points)?;
    let everything = refitted(points, all.clone())?;
    if points.len() < MIN_POINTS {
        return Ok(everything);
    }
    let majority = refitted(points, least_median_plane(points, all, budget))?;
    if is_line_of(points, &majority, &everything) {
        return Ok(everything);
    }
    let lengths = [&everything, &majority].map(|plane| code_length(points, sensor, plane));
    Ok(if lengths[0] <= lengths[1] { everything } else { majority })
}

/// The least squares plane of the points within three standard deviations of a plane, until these stay the same.
fn refitted(points: &[Vector3<f64>], start: PlaneFrame) -> Result<RobustPlane> {
    let least = ROUNDINGS * f64::EPSILON * extent(points);
    let mut plane = RobustPlane { frame: start, inliers: (0..points.len()).collect() };
    for _ in 0..REFITS {
        let distances: Vec<f64> = points.iter().map(|point| plane.frame.height(point).abs()).collect();
        let most = (OUTLIER_SIGMAS * MAD_TO_SIGMA * median(&mut distances.clone())).max(least);
        let kept: Vec<usize> = (0..points.len()).filter(|&index| distances[index] <= most).collect();
        if kept.len() < 3 {
            break;
        }
        let frame = PlaneFrame::fit(&chosen(points, &kept))?;
        let is_same = kept == plane.inliers;
        plane = RobustPlane { frame, inliers: kept };
        if is_same {
            break;
        }
    }
    Ok(plane)
}

/// The plane with the least median distance among those through three random points and least squares over all.
fn least_median_plane(points: &[Vector3<f64>], all: PlaneFrame, budget: &Budget) -> PlaneFrame {
    let mut draws = random_indices(points.len());
    let mut draw = || points[draws.next().unwrap_or_default()];
    let triples: Vec<[Vector3<f64>; 3]> = (0..TRIALS).map(|_| std::array::from_fn(|_| draw())).collect();
    let judges = if points.len() <= JUDGES { points.to_vec() } else { (0..JUDGES).map(|_| draw()).collect() };
    budget.charge(TRIALS * judges.len());
    let distances_to =
        |plane: &PlaneFrame| -> Vec<f64> { judges.iter().map(|point| plane.height(point).abs()).collect() };
    let mut least = median(&mut distances_to(&all));
    let mut best = all;
    for [origin, second, third] in triples {
        let Some(frame) = PlaneFrame::through(origin, &(second - origin), &(third - origin)) else { continue };
        let mut distances = distances_to(&frame);
        // Most trials are refused by a count, which takes less time than their median does.
        let below = distances.iter().filter(|distance| **distance < least).count();
        if 2 * below >= judges.len() {
            let found = median(&mut distances);
            if found < least {
                (best, least) = (frame, found);
            }
        }
    }
    best
}

/// Whether the inliers of one plane are a scan line of another one that more points show: narrow, no wider than its noise makes them.
fn is_line_of(points: &[Vector3<f64>], line: &RobustPlane, plane: &RobustPlane) -> bool {
    let [own, whole] = [line, plane].map(|plane| chosen(points, &plane.inliers));
    let deviations = |points: &[Vector3<f64>]| PrincipalAxes::of(points).map_or([0.0; 3], |axes| axes.deviations);
    let ([length, width, _], [whole_length, whole_width, _]) = (deviations(&own), deviations(&whole));
    let noise = deviation(&whole.iter().map(|point| plane.frame.height(point)).collect::<Vec<_>>());
    let is_narrow = width < LINE_WIDTH * length && noise < OUTLIER_SIGMAS * width.max(MIN_LINE_NOISE * length);
    is_narrow && whole.len() > own.len() && whole_width * length > WIDER * width * whole_length
}

/// Negative log likelihood of the points per extent: inliers normal about the plane, outliers even over the extent, at no cost.
fn code_length(points: &[Vector3<f64>], sensor: Option<&Vector3<f64>>, plane: &RobustPlane) -> f64 {
    let normal = plane.frame.axes[2];
    let distance = |point: &Vector3<f64>| {
        let height = plane.frame.height(point);
        sensor.map_or(height, |sensor| {
            let beam = point - sensor;
            height * beam.norm() / beam.dot(&normal).abs().max(f64::MIN_POSITIVE)
        })
    };
    let distances: Vec<f64> = plane.inliers.iter().map(|&index| distance(&points[index])).collect();
    let sigma = (deviation(&distances) / extent(points)).max(f64::EPSILON);
    distances.len() as f64 * (0.5 + (sigma * std::f64::consts::TAU.sqrt()).ln())
}

fn chosen(points: &[Vector3<f64>], indices: &[usize]) -> Vec<Vector3<f64>> {
    indices.iter().map(|&index| points[index]).collect()
}

/// The mean of the middle two of an even number of values; not a number for none.
fn median(values: &mut [f64]) -> f64 {
    let half = values.len() / 2;
    if values.is_empty() {
        return f64::NAN;
    }
    let is_odd = values.len() % 2 == 1;
    let (below, &mut upper, _) = values.select_nth_unstable_by(half, f64::total_cmp);
    if is_odd { upper } else { 0.5 * (below.iter().copied().fold(f64::NEG_INFINITY, f64::max) + upper) }
}

/// Standard deviation about the mean.
fn deviation(values: &[f64]) -> f64 {
    let count = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / count;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()
}

/// Random indices below `count`, always the same: Knuth's linear congruential generator (MMIX), by its high bits.
fn random_indices(count: usize) -> impl Iterator<Item = usize> {
    let next =
        |state: &u64| Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407));
    std::iter::successors(Some(1), next).skip(1).map(move |state| (((state >> 32) * count as u64) >> 32) as usize)
}
