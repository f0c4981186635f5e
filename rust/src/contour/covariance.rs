//! The covariance of a pose by the noise that the contours show there (`docs/math.md`, eq. 11.9 to 11.12).

use std::ops::Range;

use nalgebra::{Matrix6, Vector6};

use super::coherence::{Coherence, share, sides};
use super::fit::ContourFit;
use super::readings::{Contour, NOISE_FLOOR, Reading};
use crate::geometry::pose::PARAMETERS;

/// The mean slope over the mean weight at least: below it, the contour does not hold the pose at this scale.
const LEAST_SLOPE: f64 = 0.1;

/// The pieces of all contours as the covariance needs them.
#[derive(Default)]
struct Rows {
    distances: Vec<f64>,
    derivatives: Vec<Vector6<f64>>,
    /// Weights of the distances.
    weights: Vec<f64>,
    /// Sum of the distances' derivatives times their weights.
    slopes: f64,
    sides: Vec<Range<usize>>,
    /// Number of the pieces of each region.
    counts: Vec<usize>,
}

/// Covariance of the left increment `[omega (rad), tau (metres)]` of a pose on the contours; infinite where a direction is
/// left free.
pub fn covariance(contours: &[Contour], fit: &ContourFit) -> Matrix6<f64> {
    let free = Matrix6::from_element(f64::INFINITY);
    let Some(rows) = Rows::at(contours, fit) else { return free };
    let held: f64 = rows.weights.iter().sum();
    let information = rows.products(|weight, _| weight) * (rows.slopes / held).max(LEAST_SLOPE);
    let Some(inverse) = information.cholesky().map(|cholesky| cholesky.inverse()) else { return free };
    let coherence = Coherence::new(&rows.sides, &rows.distances, &rows.weights);
    let of_side = |side: &Range<usize>| coherence.independent(&rows.weights[side.clone()], 1);
    let independent: f64 = rows.sides.iter().map(of_side).sum();
    let correlation = coherence.correlation(&rows.weights, &rows.counts);
    // Six parameters leave so much less of the distances that vary independently.
    let freedom = (held / correlation.max(1.0)).max(PARAMETERS as f64 + 1.0);
    let rest = rows.products(|weight, index| weight * weight * (coherence.left[index].powi(2) + NOISE_FLOOR.powi(2)));
    let rest = rest * (correlation * coherence.taken * freedom / (freedom - PARAMETERS as f64));
    let scatter = rest + rows.of_ends() * coherence.of_end(independent);
    inverse * scatter * inverse
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
        let ratio = (fit.mixture.sigma / fit.mixture.wide).powi(2);
        for (reading, derivative) in read {
            let (clean, weight) = (odds.clean_probability(reading), odds.weight(reading));
            // The weight falls as the piece's chance to be clean does.
            let fall = clean * (1.0 - clean) * (1.0 - ratio).powi(2) * (reading.misfit / fit.mixture.sigma).powi(2);
            self.distances.push(reading.distance);
            self.derivatives.push(*derivative);
            self.weights.push(weight);
            self.slopes += weight - fall;
        }
        let readings: Vec<Reading> = read.iter().map(|(reading, _)| *reading).collect();
        self.sides.extend(sides(&readings).into_iter().map(|side| first + side.start..first + side.end));
        self.counts.push(read.len());
    }

    /// Sum of the products of the derivatives, each times a factor of its weight and number.
    fn products(&self, factor: impl Fn(f64, usize) -> f64) -> Matrix6<f64> {
        let mut sum = Matrix6::zeros();
        for (index, (derivative, &weight)) in self.derivatives.iter().zip(&self.weights).enumerate() {
            sum.ger(factor(weight, index), derivative, derivative, 1.0);
        }
        sum
    }

    /// What the ends of all sides add to the scatter of the gradient for each unit of their variance: the pieces between two
    /// ends are off by these in turn.
    fn of_ends(&self) -> Matrix6<f64> {
        let mut sum = Matrix6::zeros();
        for side in &self.sides {
            let (mut first, mut last) = (Vector6::zeros(), Vector6::zeros());
            for (number, index) in side.clone().enumerate() {
                let pull = self.derivatives[index] * self.weights[index];
                last += pull * share(number, side.len());
                first += pull * (1.0 - share(number, side.len()));
            }
            sum.ger(1.0, &first, &first, 1.0);
            sum.ger(1.0, &last, &last, 1.0);
        }
        sum
    }
}
