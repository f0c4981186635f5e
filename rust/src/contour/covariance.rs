//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.9 to 11.12).

use std::ops::Range;

use nalgebra::{Matrix2, Matrix6, Matrix6x2, RowVector2, Vector6};

use super::coherence::{Coherence, share, sides};
use super::fit::ContourFit;
use super::readings::{Contour, NOISE_FLOOR, Reading};
use crate::geometry::pose::PARAMETERS;

/// Variance of an end that lies anywhere within a pixel, squared pixels, and of how many ends this is known before any is measured:
/// those of one side.
const WITHIN_PIXEL: f64 = 1.0 / 12.0;
const KNOWN_ENDS: f64 = 2.0;

/// Share of the squares below which a pose leaves nothing of them but rounding.
const NOTHING_LEFT: f64 = 1e-9;

/// The pieces of all contours as the covariance needs them.
#[derive(Default)]
struct Rows {
    distances: Vec<f64>,
    derivatives: Vec<Vector6<f64>>,
    /// Weights by which the distances pull.
    weights: Vec<f64>,
    /// Weights by which they hold: less by the mean slope of their region's pulls.
    held: Vec<f64>,
    sides: Vec<Range<usize>>,
    /// Number of the pieces of each region.
    counts: Vec<usize>,
}

/// Covariance of the left increment `[omega (rad), tau (metres)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit) -> Matrix6<f64> {
    let free = Matrix6::from_element(f64::INFINITY);
    let Some(rows) = Rows::at(contours, fit) else { return free };
    let Some(inverse) = rows.products(|index| rows.held[index]).cholesky().map(|cholesky| cholesky.inverse()) else {
        return free;
    };
    let coherence = Coherence::new(&rows.sides, &rows.distances, &rows.held);
    let scatter = rows.of_rest(&coherence) + rows.ends(&rows.weights).scatter * rows.of_end(&coherence, &inverse);
    inverse * scatter * inverse
}

/// What the ends of all sides, each off by its own, do to the pulls and to their squares.
#[derive(Default)]
struct Ends {
    /// What they add to the scatter of the gradient for each unit of their variance: the sum of `G G^T` over the sides.
    scatter: Matrix6<f64>,
    /// The same of `G B G^T`, with a side's `B`, the weighted squares and products of what its ends move its pieces by.
    squared: Matrix6<f64>,
    /// Traces of the sums of `B` and `B B`.
    own: f64,
    own_squared: f64,
}

impl Ends {
    /// Expectation, for each unit of the ends' variance, of what a pose leaves of the weighted squares, and the number of free
    /// measurements that this is worth, by its variance (Satterthwaite).
    fn left(&self, inverse: &Matrix6<f64>) -> (f64, f64) {
        let taken = inverse * self.scatter;
        let left = self.own - taken.trace();
        let squared = self.own_squared - 2.0 * (inverse * self.squared).trace() + (taken * taken).trace();
        let known = left > NOTHING_LEFT * self.own && squared > 0.0;
        if known { (left, left * left / squared) } else { (f64::INFINITY, 0.0) }
    }
}

impl Rows {
    fn at(contours: &[Contour], fit: &ContourFit) -> Option<Self> {
        let mut rows = Self::default();
        for (region, contour) in contours.iter().enumerate() {
            let mut read = Vec::new();
            contour.read_rows(&fit.pose, &mut read)?;
            rows.add(fit, region, &read);
        }
        Some(rows)
    }

    fn add(&mut self, fit: &ContourFit, region: usize, read: &[(Reading, Vector6<f64>)]) {
        let (odds, first) = (fit.mixture.odds(region), self.distances.len());
        let mut slopes = 0.0;
        let ratio = (fit.mixture.sigma / fit.mixture.wide).powi(2);
        for (reading, derivative) in read {
            let (clean, weight) = (odds.clean_probability(reading), odds.weight(reading));
            // The weight falls as the piece's chance to be clean does.
            let fall = clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.misfit / fit.mixture.sigma).powi(2);
            self.distances.push(reading.distance);
            self.derivatives.push(*derivative);
            self.weights.push(weight);
            slopes += weight - fall;
        }
        // Of a region elsewhere as many pieces come into reach as leave it: it holds nothing.
        let own = &self.weights[first..];
        let steepness = (slopes / own.iter().sum::<f64>()).clamp(0.0, 1.0);
        self.held.extend(own.iter().map(|weight| steepness * weight));
        let readings: Vec<Reading> = read.iter().map(|(reading, _)| *reading).collect();
        self.sides.extend(sides(&readings).into_iter().map(|side| first + side.start..first + side.end));
        self.counts.push(read.len());
    }

    /// Sum of the products of the derivatives, each times the factor of its number.
    fn products(&self, factor: impl Fn(usize) -> f64) -> Matrix6<f64> {
        let mut sum = Matrix6::zeros();
        for (index, derivative) in self.derivatives.iter().enumerate() {
            sum.ger(factor(index), derivative, derivative, 1.0);
        }
        sum
    }

    /// Scatter of the gradient by what the lines through the sides leave of the distances.
    fn of_rest(&self, coherence: &Coherence) -> Matrix6<f64> {
        let correlation = coherence.correlation(&self.weights, &self.counts);
        let held: f64 = self.weights.iter().sum();
        // Six parameters leave so much less of the distances that vary independently.
        let parameters = PARAMETERS as f64;
        let freedom = (held / correlation.max(1.0)).max(parameters + 1.0);
        let square = |index: usize| coherence.left[index].powi(2) + NOISE_FLOOR.powi(2);
        self.products(|index| self.weights[index].powi(2) * square(index))
            * (correlation * coherence.taken * freedom / (freedom - parameters))
    }

    /// The ends of all sides with these weights of the pieces.
    fn ends(&self, weights: &[f64]) -> Ends {
        let mut ends = Ends::default();
        for side in &self.sides {
            let (mut pulls, mut own) = (Matrix6x2::zeros(), Matrix2::zeros());
            for (number, index) in side.clone().enumerate() {
                let along = share(number, side.len());
                let moved = RowVector2::new(1.0 - along, along);
                pulls += self.derivatives[index] * (moved * weights[index]);
                own += moved.transpose() * (moved * weights[index]);
            }
            ends.scatter += pulls * pulls.transpose();
            ends.squared += pulls * own * pulls.transpose();
            ends.own += own.trace();
            ends.own_squared += (own * own).trace();
        }
        ends
    }

    /// Variance of a side's end, squared pixels: the mean of what a pose leaves of the squares and of what is known beforehand.
    fn of_end(&self, coherence: &Coherence, inverse: &Matrix6<f64>) -> f64 {
        let squares: f64 = self.held.iter().zip(&self.distances).map(|(held, distance)| held * distance * distance).sum();
        let taken = (inverse * self.products(|index| self.held[index].powi(2))).trace();
        let chance = coherence.rest * (self.held.iter().sum::<f64>() - taken);
        let (left, free) = self.ends(&self.held).left(inverse);
        let measured = free * (squares - chance).max(0.0) / left;
        (measured + KNOWN_ENDS * coherence.common() * WITHIN_PIXEL) / free.max(1.0)
    }
}
