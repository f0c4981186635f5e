//! Labels beside one stretch of a contour, by how far it is off at its two ends (`docs/math.md`, section 17, "Stretches").

use std::f64::consts::PI;
use std::sync::OnceLock;

use nalgebra::{Matrix2, Vector2};

use super::belief::Belief;
use super::normal::cumulative;
use super::propagation::{Edge, Label, Trust};

/// Ends of a stretch.
pub const ENDS: usize = 2;

/// Places along each axis at which labels are asked, and how far these reach, in standard deviations of what is found there. With 30
/// places ellipsoids hold as many poses (`cargo test --test sampled`).
pub(super) const PLACES: usize = 14;
const FARTHEST: f64 = 4.0;
const SPACING: f64 = 2.0 * FARTHEST / PLACES as f64;

/// Grids at most, each about what the last one found.
const MOST_GRIDS: usize = 12;

/// What a grid may find and be the last: its mean, in the deviations that it was laid out by, its variances and its covariance. A
/// convention: there places are neither too few nor too near.
const NEAR: f64 = 0.5;
const AS_WIDE: std::ops::Range<f64> = 0.6..1.5;
const AS_ROUND: f64 = 0.4;

/// Margins beyond this many of a label's deviations are certain: less than 1 in 10^6 is on the other side.
const CERTAIN: f64 = 5.0;

/// Labels whose probabilities are multiplied before a logarithm is taken: of 10^-4 each, they are still numbers.
const OFTEN: usize = 64;

/// Entries of the table of the normal distribution for each deviation.
const ENTRIES: usize = 256;

/// A label beside a stretch whose ends lie `e` pixels outside of the region's edge: its margin is `margin + weights . e`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beside {
    /// The margin on the edge, pixels.
    pub margin: f64,
    /// Its derivative by both ends.
    pub weights: Vector2<f64>,
    /// Variance of the margin about that, squared pixels, which adds to the blur's.
    pub variance: f64,
    /// Whether the nearest edge is one of the region's own.
    pub edge: Edge,
    /// How far labels are to be trusted.
    pub trust: Trust,
}

impl Beside {
    /// What the label shows under a belief.
    pub fn label(&self, belief: &Belief<ENDS>) -> Label {
        let mean = self.margin + self.weights.dot(&belief.mean);
        let variance = self.weights.dot(&(belief.covariance * self.weights));
        self.trust.label(self.edge, mean, variance + self.variance)
    }

    fn deviation(&self) -> f64 {
        (self.trust.blur.powi(2) + self.variance).sqrt()
    }
}

/// Mean and covariance of both ends once all labels are heard, and the logarithm of the labels' probability, where everything else
/// leaves `before`; looked for about `about` first. `None` where a direction is left free.
pub fn heard(labels: &[Beside], before: &Belief<ENDS>, about: &Belief<ENDS>) -> Option<(Belief<ENDS>, f64)> {
    let mut about = *about;
    let mut found = None;
    for _ in 0..MOST_GRIDS {
        let root = about.covariance.cholesky()?.unpack();
        let grid = Grid { middle: about.mean, root };
        let mut logs = grid.log_densities(before)?;
        grid.hear(labels, &mut logs);
        let (scaled, log_integral) = grid.moments(&logs);
        let mean = about.mean + root * scaled.mean;
        let covariance = root * scaled.covariance * root.transpose();
        about = Belief { mean, covariance };
        found = Some((about, log_integral));
        let is_near = scaled.mean.amax() < NEAR;
        let is_as_wide = (0..ENDS).all(|axis| AS_WIDE.contains(&scaled.covariance[(axis, axis)]));
        if is_near && is_as_wide && scaled.covariance[(0, 1)].abs() < AS_ROUND {
            break;
        }
    }
    found
}

/// Places about a middle, in steps along the columns of a root of a covariance.
struct Grid {
    middle: Vector2<f64>,
    root: Matrix2<f64>,
}

/// How far a place is from the middle, in deviations.
fn far(place: usize) -> f64 {
    (place as f64 + 0.5) * SPACING - FARTHEST
}

impl Grid {
    /// Logarithm of a density at each place.
    fn log_densities(&self, before: &Belief<ENDS>) -> Option<Vec<f64>> {
        let information = before.covariance.try_inverse()?;
        let normalizer = (2.0 * PI).ln() + 0.5 * before.covariance.determinant().ln();
        let mut logs = Vec::with_capacity(PLACES * PLACES);
        for row in 0..PLACES {
            for column in 0..PLACES {
                let way = self.middle + self.root * Vector2::new(far(row), far(column)) - before.mean;
                logs.push(-0.5 * way.dot(&(information * way)) - normalizer);
            }
        }
        Some(logs)
    }

    /// Adds the logarithm of the labels' probability at each place.
    fn hear(&self, labels: &[Beside], logs: &mut [f64]) {
        let mut product = [1.0; PLACES * PLACES];
        let (mut always, mut since) = (0.0, 0);
        for label in labels {
            let deviation = label.deviation();
            // A zero without its sign: divided by, it tells sides.
            let slope = (self.root.transpose() * label.weights / deviation).add_scalar(0.0);
            let middle = (label.margin + label.weights.dot(&self.middle)) / deviation;
            let (least, more) = label.trust.bounds(label.edge);
            let right = least + more;
            always += right.ln();
            if middle - FARTHEST * slope.abs().sum() > CERTAIN {
                continue;
            }
            let (least, more) = (least / right, more / right);
            for (row, products) in product.chunks_exact_mut(PLACES).enumerate() {
                let start = middle + slope.x * far(row);
                let [certain, doubtful] = [CERTAIN, -CERTAIN].map(|bound| beyond(start, slope.y, bound));
                // Right beyond the one, wrong beyond the other.
                let (between, wrong) = match slope.y >= 0.0 {
                    true => (doubtful..certain, 0..doubtful),
                    false => (certain..doubtful, doubtful..PLACES),
                };
                products[wrong].iter_mut().for_each(|product| *product *= least);
                for (column, product) in between.clone().zip(&mut products[between]) {
                    *product *= least + more * tabled(start + slope.y * far(column));
                }
            }
            since += 1;
            // A product of many small numbers is out of a number's range.
            if since % OFTEN == 0 {
                take(logs, &mut product);
            }
        }
        take(logs, &mut product);
        logs.iter_mut().for_each(|log| *log += always);
    }

    /// Mean and covariance along the columns, and the logarithm of the integral.
    fn moments(&self, logs: &[f64]) -> (Belief<ENDS>, f64) {
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut all, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for (number, log) in logs.iter().enumerate() {
            let weight = (log - most).exp();
            let place = Vector2::new(far(number / PLACES), far(number % PLACES));
            all += weight;
            first += place * weight;
            second += place * place.transpose() * weight;
        }
        let mean = first / all;
        // A place stands for the area around it.
        let around = Matrix2::identity() * (SPACING * SPACING / 12.0);
        let covariance = second / all - mean * mean.transpose() + around;
        let area = SPACING * SPACING * self.root.determinant().abs();
        (Belief { mean, covariance }, most + (all * area).ln())
    }
}

/// The first column from which on `start + slope * far` is beyond a bound, as seen from its other side.
fn beyond(start: f64, slope: f64, bound: f64) -> usize {
    let place = ((bound - start) / slope + FARTHEST) / SPACING - 0.5;
    if place.is_nan() { 0 } else { place.ceil().clamp(0.0, PLACES as f64) as usize }
}

fn take(logs: &mut [f64], product: &mut [f64]) {
    for (log, product) in logs.iter_mut().zip(product) {
        *log += product.ln();
        *product = 1.0;
    }
}

/// The normal distribution, to 1e-6.
fn tabled(x: f64) -> f64 {
    static TABLE: OnceLock<Vec<f64>> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let count = 2 * CERTAIN as usize * ENTRIES + 2;
        (0..count).map(|entry| cumulative(entry as f64 / ENTRIES as f64 - CERTAIN)).collect()
    });
    let place = (x.clamp(-CERTAIN, CERTAIN) + CERTAIN) * ENTRIES as f64;
    let entry = place as usize;
    let share = place - entry as f64;
    table[entry] + share * (table[entry + 1] - table[entry])
}
