//! The sandwich covariance of a pose under the contours' correlated noise (`docs/math.md`, eq. 11.9 to 11.14).

use std::ops::Range;

use nalgebra::{Matrix2, Matrix6, Vector2, Vector6};

use super::degrees_of_freedom::{PRIOR_OBSERVATIONS, observation_count, residual_dof};
use super::fit::ContourFit;
use super::readings::{Contour, Reading};
use crate::budget::Budget;
use crate::equations::information::{Information, free, validated_covariance};
use crate::equations::normal_equations::{in_lanes, outer_products, turned};
use crate::geometry::pose::PARAMETERS;
use crate::math::autocorrelation::correlation;
use crate::math::lanes::{Lanes, NullaryFnOnce, vectorized};
use crate::noise::boundary::{CALIBRATION, QUANTIZATION};

/// Least ratio of the mean slope to the mean weight: below it, the contour does not constrain the pose at this scale.
const LEAST_SLOPE: f64 = 0.1;

/// Numbers that a line has: where the two ends of a side are.
const ENDS: f64 = 2.0;

/// Mean square of the distances along a side, of its ends' variance: the mean of `t^2 + (1 - t)^2`.
const OF_ENDS: f64 = 2.0 / 3.0;

/// Degrees of freedom that an estimated variance costs: Student's distribution of `n` has the variance `n / (n - 2)`.
const STUDENT: f64 = 2.0;

/// A piece of a contour as the covariance needs it.
struct Row {
    reading: Reading,
    /// Weight of its distance.
    weight: f64,
    /// Derivative of the distance times its weight.
    slope: f64,
    region: usize,
    /// The corners between which the straight run of the contour lies that it is on.
    run: Option<[usize; 2]>,
}

/// Pieces of all contours.
struct Rows<'a> {
    contours: &'a [Contour],
    /// One in so many.
    step: usize,
    all: Vec<Row>,
    /// Derivatives of the distances by the left increment along the axes of each one's chart.
    derivatives: Vec<[Lanes; 2]>,
    /// Number of each contour's.
    counts: Vec<usize>,
}

/// Neighboring pieces on one straight run of the contour: what moves its ends moves all.
struct Side {
    pieces: Range<usize>,
    region: usize,
    corners: [usize; 2],
    /// Share of the weight that it makes up of the edge of the boundary that it lies on.
    share: f64,
}

/// Covariance of the left increment `[omega (rad), tau (meters)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit, budget: &Budget) -> Matrix6<f64> {
    let Some(rows) = Rows::at(contours, fit, budget) else { return free() };
    let steepness = (rows.sum(|row| row.slope) / rows.sum(|row| row.weight)).max(LEAST_SLOPE);
    let [information] = rows.products(|_, row| [row.weight * steepness]);
    let Some(information) = Information::holding(&information) else { return free() };
    validated_covariance(&information.covariance_with(&scatter(&rows, &information.covariance())))
}

/// Scatter of the gradient: of pieces that vary by themselves, and of sides whose ends are off; `inverse` that of the information.
fn scatter(rows: &Rows<'_>, inverse: &Matrix6<f64>) -> Matrix6<f64> {
    let (sides, held) = (sides(&rows.all), rows.sum(|row| row.weight));
    let (rests, lines) = without_lines(&rows.all, &sides);
    let pulls: Vec<f64> = rows.all.iter().zip(&rests).map(|(row, rest)| row.weight * rest).collect();
    let correlation = correlation(&pulls, &rows.counts);
    let squares = rows.times() * pulls.iter().zip(&rests).map(|(pull, rest)| pull * rest).sum::<f64>() / held;
    let floor = (CALIBRATION * CALIBRATION - squares).max(0.0);
    let factor = correlation * held / (held - lines).max(1.0);
    let [single, independent] = rows.products(|index, row| {
        let square = row.weight * row.weight;
        let single = factor * pulls[index] * pulls[index] + floor * square;
        [single, square * (row.reading.distance * row.reading.distance + floor)]
    });
    let degrees_of_freedom = residual_dof(rows.contours, rows.step);
    let variance = corners_variance(rows) * straightness(&rows.all, &rests, &sides);
    // Four corners fit many a pose closely: the residuals of so few hardly constrain their noise.
    let variance = ((degrees_of_freedom - PRIOR_OBSERVATIONS) * variance
        + PRIOR_OBSERVATIONS * QUANTIZATION * QUANTIZATION)
        / degrees_of_freedom;
    let scatter = single + corners_scatter(rows, &sides, variance);
    // A side that is off as a whole is two measurements, whatever the number of its pieces.
    let alike = (inverse * scatter).trace() / (inverse * independent).trace().max(f64::MIN_POSITIVE);
    // Six parameters leave so much less of the distances that vary independently.
    let parameters = PARAMETERS as f64;
    let measurements =
        (held / alike.max(1.0)).min(observation_count(rows.contours, rows.step)).max(parameters + STUDENT + 1.0);
    scatter * (measurements / (measurements - parameters - STUDENT))
}

impl<'a> Rows<'a> {
    fn at(contours: &'a [Contour], fit: &ContourFit, budget: &Budget) -> Option<Self> {
        // Where a few pieces lie within the floor, that is the noise, and all of them add no information.
        let step = if fit.root_mean_square() < CALIBRATION { fit.step() } else { 1 };
        let counts: Vec<usize> = contours.iter().map(|contour| contour.count(step)).collect();
        let count = counts.iter().sum();
        let (mut all, mut derivatives) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mixture = &fit.mixture;
        let ratio = (mixture.sigma / mixture.outlier_sigma).powi(2);
        for ((region, readings), contour) in fit.regions().zip(contours) {
            let odds = mixture.odds(region);
            let readings = (fit.step() == step).then_some(readings);
            let add = |reading: Reading, derivative: Vector6<f64>, run: Option<[usize; 2]>| {
                let (clean, weight) = odds.clean_and_weight(&reading);
                // The weight falls as the piece's chance to be clean does.
                let fall = clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.distance / mixture.sigma).powi(2);
                all.push(Row { reading, weight, slope: weight - fall, region, run });
                derivatives.push(in_lanes(&derivative));
            };
            contour.for_each_row(&fit.pose, step, readings, fit.outlier_threshold(), add, budget)?;
        }
        Some(Self { contours, step, all, derivatives, counts })
    }

    fn sum(&self, value: impl Fn(&Row) -> f64) -> f64 {
        self.times() * self.all.iter().map(value).sum::<f64>()
    }

    /// Number of pieces that each of them represents.
    fn times(&self) -> f64 {
        self.step as f64
    }

    /// Sums of the products of the derivatives by the camera's axes, for each of the weights that a piece is given.
    fn products<const N: usize>(&self, weights: impl Fn(usize, &Row) -> [f64; N]) -> [Matrix6<f64>; N] {
        let weights: Vec<[f64; N]> = self.all.iter().enumerate().map(|(index, row)| weights(index, row)).collect();
        let (mut sums, mut first) = ([Matrix6::zeros(); N], 0);
        for (contour, &count) in self.contours.iter().zip(&self.counts) {
            let pieces = first..first + count;
            let products = outer_products(&self.derivatives[pieces.clone()], &weights[pieces]);
            sums.iter_mut()
                .zip(products)
                .for_each(|(sum, product)| *sum += turned(&product, contour.axes()) * self.times());
            first += count;
        }
        sums
    }
}

/// The sides that hold more than one piece.
fn sides(rows: &[Row]) -> Vec<Side> {
    let (mut sides, mut first) = (Vec::new(), 0);
    for pieces in rows.chunk_by(|a, b| a.region == b.region) {
        let mut edges = vec![0.0; pieces.iter().map(|row| row.reading.edge as usize + 1).max().unwrap_or(0)];
        pieces.iter().for_each(|row| edges[row.reading.edge as usize] += row.weight);
        for run in pieces.chunk_by(|a, b| a.run.is_some() && a.run == b.run) {
            let (count, middle) = (run.len(), &run[run.len() / 2]);
            if let (Some(corners), true) = (middle.run, count > 1) {
                let (own, edge) = (run.iter().map(|row| row.weight).sum::<f64>(), edges[middle.reading.edge as usize]);
                let share = (own / f64::max(edge, f64::MIN_POSITIVE)).min(1.0);
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

/// Share of the squared pulls of all sides that the lines through them make up: all of it where nothing but corners is off.
fn straightness(rows: &[Row], rests: &[f64], sides: &[Side]) -> f64 {
    let (mut lines, mut others) = (0.0, 0.0);
    for index in sides.iter().flat_map(|side| side.pieces.clone()) {
        lines += (rows[index].weight * (rows[index].reading.distance - rests[index])).powi(2);
        others += (rows[index].weight * rests[index]).powi(2);
    }
    lines / f64::max(lines + others, f64::MIN_POSITIVE)
}

/// Variance of where a corner is along either axis, were all distances those of sides that follow their corners.
fn corners_variance(rows: &Rows<'_>) -> f64 {
    let squares = rows.sum(|row| (row.reading.distance.powi(2) + row.reading.spread) * row.weight.powi(2));
    squares / rows.sum(|row| row.weight.powi(2)) / OF_ENDS
}

/// Scatter of the gradient by independent errors of corners, which their sides share.
///
/// A mask's edge along the pixels' grid lies anywhere within a pixel, as the corners of a polygon do within a click's
/// error: the deviation of the contour's points, not that of the pieces, over which a staircase averages out. The
/// steps of a stair take turns, so that a side counts as much as it makes up of the edge that it lies on.
fn corners_scatter(rows: &Rows<'_>, sides: &[Side], variance: f64) -> Matrix6<f64> {
    let mut scatter = Matrix6::zeros();
    for sides in sides.chunk_by(|a, b| a.region == b.region) {
        let pulls = vectorized(Pulls(rows, sides));
        let columns = pulls.as_flattened();
        let [products] = outer_products(columns, &vec![[variance]; columns.len()]);
        scatter += turned(&products, rows.contours[sides[0].region].axes());
    }
    scatter
}

/// The gradient by where a corner is, along each axis of its region's chart.
type Pull = [[Lanes; 2]; 3];

/// Derivatives of the gradient by the errors of a region's corners, by the corners' numbers.
struct Pulls<'a>(&'a Rows<'a>, &'a [Side]);

impl NullaryFnOnce for Pulls<'_> {
    type Output = Vec<Pull>;

    #[inline(always)]
    fn call(self) -> Vec<Pull> {
        let last = self.1.iter().flat_map(|side| side.corners).max().unwrap_or(0);
        let mut pulls = vec![Pull::default(); last + 1];
        for side in self.1 {
            let (share, each) = (self.0.times() * side.share.sqrt(), 1.0 / side.pieces.len() as f64);
            // Of both ends together, and of the second.
            let mut ends = [Pull::default(); 2];
            for (number, index) in side.pieces.clone().enumerate() {
                let [first, second] = self.0.derivatives[index];
                // A distance's derivative by the place stands across the side, as seen.
                let across = [first.0[3], second.0[0], second.0[1]];
                let [x, y, z] = across;
                let factor = self.0.all[index].weight * share / (x * x + y * y + z * z).sqrt();
                let along = Lanes::splat((number as f64 + 0.5) * each);
                for column in 0..across.len() {
                    let entry = Lanes::splat(factor * across[column]);
                    let pull = [first * entry, second * entry];
                    for half in 0..pull.len() {
                        ends[0][column][half] += pull[half];
                        ends[1][column][half] += pull[half] * along;
                    }
                }
            }
            for (column, (both, end)) in ends[0].into_iter().zip(ends[1]).enumerate() {
                for half in 0..both.len() {
                    pulls[side.corners[0]][column][half] += both[half] - end[half];
                    pulls[side.corners[1]][column][half] += end[half];
                }
            }
        }
        pulls
    }
}
