//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.9 to 11.13).

use std::collections::BTreeMap;
use std::ops::Range;

use nalgebra::{Matrix2, Matrix6, Matrix6x3, Vector2, Vector3, Vector6};

use super::correlation::correlation;
use super::fit::ContourFit;
use super::readings::{Contour, Reading};
use crate::equations::information::{Information, free, honest};
use crate::equations::normal_equations::{NormalEquations, WeightedRow};
use crate::geometry::pose::PARAMETERS;

/// The mean slope over the mean weight at least: below it, the contour does not hold the pose at this scale.
const LEAST_SLOPE: f64 = 0.1;

/// Deviation of a piece, pixels, below which the distances are not taken at their word: the quality of calibrations.
const NOISE_FLOOR: f64 = 0.06;

/// Numbers that a line has: where the two ends of a side are.
const ENDS: f64 = 2.0;

/// Mean square of the distances along a side, of its ends' variance: the mean of `t^2 + (1 - t)^2`.
const OF_ENDS: f64 = 2.0 / 3.0;

/// Degrees of freedom that an estimated variance costs: Student's distribution of `n` has the variance `n / (n - 2)`.
const STUDENT: f64 = 2.0;

/// A piece of a contour as the covariance needs it.
struct Row {
    reading: Reading,
    derivative: Vector6<f64>,
    /// Weight of its distance.
    weight: f64,
    /// Derivative of the distance times its weight.
    slope: f64,
    region: usize,
    /// The corners between which the straight run of the contour lies that it is on.
    run: Option<[usize; 2]>,
}

/// Neighboring pieces on one straight run of the contour: what moves its ends moves all.
struct Side {
    pieces: Range<usize>,
    region: usize,
    corners: [usize; 2],
    /// Share that it makes up of the edge of the boundary that it lies on.
    share: f64,
}

/// Covariance of the left increment `[omega (rad), tau (meters)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit) -> Matrix6<f64> {
    let Some((rows, counts)) = rows_of(contours, fit) else { return free() };
    let steepness = (sum(&rows, |row| row.slope) / sum(&rows, |row| row.weight)).max(LEAST_SLOPE);
    let information = products(&rows, |_, row| row.weight * steepness);
    let Some(information) = Information::holding(&information) else { return free() };
    honest(&information.covariance_with(&scatter(&rows, &counts, &information.covariance())))
}

/// Scatter of the gradient: of pieces that vary by themselves, and of sides whose ends are off; `inverse` that of the information.
fn scatter(rows: &[Row], counts: &[usize], inverse: &Matrix6<f64>) -> Matrix6<f64> {
    let (sides, held) = (sides(rows), sum(rows, |row| row.weight));
    let (rests, lines) = without_lines(rows, &sides);
    let pulls: Vec<f64> = rows.iter().zip(&rests).map(|(row, rest)| row.weight * rest).collect();
    let correlation = correlation(&pulls, counts);
    let squares = pulls.iter().zip(&rests).map(|(pull, rest)| pull * rest).sum::<f64>() / held;
    let floor = (NOISE_FLOOR * NOISE_FLOOR - squares).max(0.0);
    let factor = correlation * held / (held - lines).max(1.0);
    let single = products(rows, |index, row| factor * pulls[index] * pulls[index] + floor * row.weight * row.weight);
    let scatter = single + corners_scatter(rows, &sides) * straightness(rows, &rests, &sides);
    // A side that is off as a whole is two measurements, whatever the number of its pieces.
    let independent = products(rows, |_, row| row.weight * row.weight * (row.reading.distance.powi(2) + floor));
    let alike = (inverse * scatter).trace() / (inverse * independent).trace().max(f64::MIN_POSITIVE);
    // Six parameters leave so much less of the distances that vary independently.
    let parameters = PARAMETERS as f64;
    let measurements = (held / alike.max(1.0)).max(parameters + STUDENT + 1.0);
    scatter * (measurements / (measurements - parameters - STUDENT))
}

fn rows_of(contours: &[Contour], fit: &ContourFit) -> Option<(Vec<Row>, Vec<usize>)> {
    let (mut rows, mut counts) = (Vec::new(), Vec::new());
    let mixture = &fit.mixture;
    let ratio = (mixture.sigma / mixture.wide).powi(2);
    for (region, contour) in contours.iter().enumerate() {
        let mut read = Vec::new();
        contour.read_rows(&fit.pose, &mut read)?;
        counts.push(read.len());
        let odds = mixture.odds(region);
        rows.extend(read.into_iter().zip(contour.runs()).map(|((reading, derivative), run)| {
            let (clean, weight) = (odds.clean_probability(&reading), odds.weight(&reading));
            // The weight falls as the piece's chance to be clean does.
            let fall = clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.distance / mixture.sigma).powi(2);
            Row { reading, derivative, weight, slope: weight - fall, region, run }
        }));
    }
    Some((rows, counts))
}

fn sum(rows: &[Row], value: impl Fn(&Row) -> f64) -> f64 {
    rows.iter().map(value).sum()
}

/// Sum of the products of the derivatives, each times a factor.
fn products(rows: &[Row], factor: impl Fn(usize, &Row) -> f64) -> Matrix6<f64> {
    let weighted = |(index, row): (usize, &Row)| WeightedRow::new(&row.derivative, 0.0, factor(index, row));
    NormalEquations::weighted(&rows.iter().enumerate().map(weighted).collect::<Vec<_>>()).information
}

/// The sides that hold more than one piece.
fn sides(rows: &[Row]) -> Vec<Side> {
    let (mut sides, mut first) = (Vec::new(), 0);
    for pieces in rows.chunk_by(|a, b| a.region == b.region) {
        let mut edges = vec![0_usize; pieces.iter().map(|row| row.reading.edge as usize + 1).max().unwrap_or(0)];
        pieces.iter().for_each(|row| edges[row.reading.edge as usize] += 1);
        for run in pieces.chunk_by(|a, b| a.run.is_some() && a.run == b.run) {
            let (count, middle) = (run.len(), &run[run.len() / 2]);
            if let (Some(corners), true) = (middle.run, count > 1) {
                let share = (count as f64 / edges[middle.reading.edge as usize] as f64).min(1.0);
                sides.push(Side { pieces: first..first + count, region: middle.region, corners, share });
            }
            first += count;
        }
    }
    sides
}

impl Side {
    /// How much of each end's error the pieces have.
    fn ends(&self) -> impl Iterator<Item = Vector2<f64>> {
        let count = self.pieces.len();
        (0..count).map(move |index| (index as f64 + 0.5) / count as f64).map(|along| Vector2::new(1.0 - along, along))
    }
}

/// The pieces' distances without the line that fits each side best, and how many numbers these lines are.
fn without_lines(rows: &[Row], sides: &[Side]) -> (Vec<f64>, f64) {
    let mut rests: Vec<f64> = rows.iter().map(|row| row.reading.distance).collect();
    let mut numbers = 0.0;
    for side in sides {
        let (mut products, mut moments) = (Matrix2::zeros(), Vector2::zeros());
        for (row, ends) in rows[side.pieces.clone()].iter().zip(side.ends()) {
            products += ends * ends.transpose() * row.weight;
            moments += ends * (row.reading.distance * row.weight);
        }
        // Of a side that is disturbed hardly a line is left.
        let Some(inverse) = products.try_inverse().filter(|_| products.sum() > ENDS) else { continue };
        let line = inverse * moments;
        rests[side.pieces.clone()].iter_mut().zip(side.ends()).for_each(|(rest, ends)| *rest -= ends.dot(&line));
        numbers += ENDS;
    }
    (rests, numbers)
}

/// Share of the squared distances of all sides that the lines through them make up: all of it where nothing but corners is off.
fn straightness(rows: &[Row], rests: &[f64], sides: &[Side]) -> f64 {
    let (mut lines, mut others) = (0.0, 0.0);
    for index in sides.iter().flat_map(|side| side.pieces.clone()) {
        lines += rows[index].weight * (rows[index].reading.distance - rests[index]).powi(2);
        others += rows[index].weight * rests[index].powi(2);
    }
    lines / f64::max(lines + others, f64::MIN_POSITIVE)
}

/// What corners add to the scatter of the gradient, each of which is off by an error of its own that the sides follow.
///
/// A mask's edge along the pixels' grid lies anywhere within a pixel, as the corners of a polygon do within a click's
/// error: the deviation of the contour's points, not that of the pieces, over which a staircase averages out. The
/// steps of a stair take turns, so that a side counts as much as it makes up of the edge that it lies on.
fn corners_scatter(rows: &[Row], sides: &[Side]) -> Matrix6<f64> {
    let squares = sum(rows, |row| (row.reading.distance.powi(2) + row.reading.spread) * row.weight.powi(2));
    let variance = squares / sum(rows, |row| row.weight.powi(2)) / OF_ENDS;
    let mut pulls: BTreeMap<(usize, usize), Matrix6x3<f64>> = BTreeMap::new();
    for side in sides {
        let mut ends = [Matrix6x3::zeros(); 2];
        for (row, shares) in rows[side.pieces.clone()].iter().zip(side.ends()) {
            // A distance's derivative by the place stands across the side, as seen.
            let across: Vector3<f64> = row.derivative.fixed_rows::<3>(3).normalize();
            ends.iter_mut().zip(shares.iter()).for_each(|(end, share)| {
                end.ger(row.weight * share * side.share.sqrt(), &row.derivative, &across, 1.0);
            });
        }
        for (corner, end) in side.corners.into_iter().zip(ends) {
            *pulls.entry((side.region, corner)).or_default() += end;
        }
    }
    pulls.values().map(|pull| pull * pull.transpose() * variance).sum()
}
