//! Labels beside one stretch of a contour, by how far it is off at its two ends (`docs/math.md`, section 17, "Stretches").

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};

use super::readings::Edge;
use super::trust::{Label, Trust};
use crate::math::gaussian::Normal;
use crate::math::lanes::{NullaryFnOnce, vectorized};
use crate::math::single_precision;

/// Ends of a stretch.
pub const ENDS: usize = 2;

/// Places along each axis at which labels are asked, and how far these reach, in standard deviations of what is found there. With 30
/// places ellipsoids hold as many poses (`cargo test sampled::`).
pub(super) const PLACES: usize = 16;
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

/// Labels whose probabilities are multiplied before a logarithm is taken, at most: a convention. Where so few labels are wrong that
/// the least product of these is no number of single precision any more, the logarithm is taken before.
const OFTEN: usize = 8;

/// Such logarithms after which the greatest of their sums is taken from all, which keeps those that count small: of 500 labels, single
/// precision holds the sums to 1e-4.
const SELDOM: usize = 64;

/// One number of each place, row by row.
type Places<T> = [[T; PLACES]; PLACES];

/// How far each place of a row or column is from the middle, in deviations.
const FAR: [f64; PLACES] = {
    let mut far = [0.0; PLACES];
    let mut place = 0;
    while place < PLACES {
        far[place] = (place as f64 + 0.5) * SPACING - FARTHEST;
        place += 1;
    }
    far
};

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
    pub fn label(&self, belief: &Normal<ENDS>) -> Label {
        let mean = self.margin + self.weights.dot(&belief.mean);
        let variance = self.weights.dot(&(belief.covariance * self.weights));
        self.trust.label(self.edge, mean, variance + self.variance)
    }

    fn deviation(&self) -> f64 {
        (self.trust.blur.powi(2) + self.variance).sqrt()
    }
}

/// What is believed of both ends once all labels are heard.
#[derive(Debug, Clone, Copy)]
pub struct Heard {
    /// Mean and covariance.
    pub belief: Normal<ENDS>,
    /// Logarithm of the labels' probability.
    pub log_probability: f64,
    /// Whether the last grid was about what it found: if not, neither is of any worth.
    pub is_settled: bool,
}

/// What is believed where everything else leaves `before`; looked for about `about` first. `None` where a direction is left free.
pub fn heard(labels: &[Beside], before: &Normal<ENDS>, about: &Normal<ENDS>) -> Option<Heard> {
    let information = before.covariance.try_inverse()?;
    let mut about = *about;
    let mut found: Option<Heard> = None;
    for _ in 0..MOST_GRIDS {
        let root = about.covariance.cholesky()?.unpack();
        let grid = Grid { middle: about.mean, root };
        let (scaled, log_integral) =
            vectorized(Hearing { grid: &grid, labels, mean: &before.mean, information: &information });
        let mean = about.mean + root * scaled.mean;
        let covariance = root * scaled.covariance * root.transpose();
        about = Normal { mean, covariance };
        let normalizer = (2.0 * PI).ln() + 0.5 * before.covariance.determinant().ln();
        let is_near = scaled.mean.amax() < NEAR;
        let is_as_wide = (0..ENDS).all(|axis| AS_WIDE.contains(&scaled.covariance[(axis, axis)]));
        let is_settled = is_near && is_as_wide && scaled.covariance[(0, 1)].abs() < AS_ROUND;
        found = Some(Heard { belief: about, log_probability: log_integral - normalizer, is_settled });
        if is_settled {
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

/// All labels heard at the places of a grid, where everything else leaves this mean and information.
struct Hearing<'a> {
    grid: &'a Grid,
    labels: &'a [Beside],
    mean: &'a Vector2<f64>,
    information: &'a Matrix2<f64>,
}

impl NullaryFnOnce for Hearing<'_> {
    /// Mean and covariance along the columns, and the logarithm of the integral.
    type Output = (Normal<ENDS>, f64);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let (told, always) = self.grid.told(self.labels);
        let mut logs = self.grid.log_densities(self.mean, self.information);
        let mut most = [f64::NEG_INFINITY; PLACES];
        for (logs, told) in logs.iter_mut().zip(&told) {
            for column in 0..PLACES {
                logs[column] += f64::from(told[column]);
                most[column] = if logs[column] > most[column] { logs[column] } else { most[column] };
            }
        }
        let most = most.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (belief, integral) = moments(&logs, most);
        let area = SPACING * SPACING * self.grid.root.determinant().abs();
        (belief, most + always + (integral * area).ln())
    }
}

impl Grid {
    /// Logarithm of a density at each place, but for its normalizer.
    #[inline(always)]
    fn log_densities(&self, mean: &Vector2<f64>, information: &Matrix2<f64>) -> Places<f64> {
        let way = self.middle - mean;
        let (at_middle, slope) = (way.dot(&(information * way)), self.root.transpose() * information * way * 2.0);
        let bend = self.root.transpose() * information * self.root;
        let mut logs = [[0.0; PLACES]; PLACES];
        for (row, logs) in logs.iter_mut().enumerate() {
            let start = at_middle + FAR[row] * (slope.x + FAR[row] * bend.m11);
            let along = slope.y + 2.0 * FAR[row] * bend.m12;
            for column in 0..PLACES {
                logs[column] = -0.5 * (start + FAR[column] * (along + FAR[column] * bend.m22));
            }
        }
        logs
    }

    /// Logarithm of the labels' probability at each place, and what is common to all.
    #[inline(always)]
    fn told(&self, labels: &[Beside]) -> (Places<f32>, f64) {
        let (mut logs, mut product) = ([[0.0; PLACES]; PLACES], [[1.0; PLACES]; PLACES]);
        let (mut always, mut since, mut taken, mut least_product) = (0.0, 0, 0, 1.0_f32);
        for label in labels {
            let deviation = label.deviation();
            let slope = self.root.transpose() * label.weights / deviation;
            let middle = (label.margin + label.weights.dot(&self.middle)) / deviation;
            let (least, more) = label.trust.bounds(label.edge);
            let right = least + more;
            always += right.ln();
            if middle - FARTHEST * slope.abs().sum() > CERTAIN {
                continue;
            }
            let (least, more) = ((least / right) as f32, (more / right) as f32);
            // A product of many small numbers is out of a number's range.
            if since == OFTEN || least_product * least < f32::MIN_POSITIVE {
                take(&mut logs, &mut product);
                taken += 1;
                if taken % SELDOM == 0 {
                    always += f64::from(without_most(&mut logs));
                }
                (since, least_product) = (0, 1.0);
            }
            let reach = FARTHEST * slope.y.abs();
            for (row, products) in product.iter_mut().enumerate() {
                let start = middle + slope.x * FAR[row];
                if start - reach > CERTAIN {
                    continue;
                }
                for column in 0..PLACES {
                    let margin = start as f32 + slope.y as f32 * FAR[column] as f32;
                    products[column] *= least + more * single_precision::cumulative(margin);
                }
            }
            (since, least_product) = (since + 1, least_product * least);
        }
        take(&mut logs, &mut product);
        (logs, always)
    }
}

/// Takes the greatest of logarithms, which it gives, from all of them.
#[inline(always)]
fn without_most(logs: &mut Places<f32>) -> f32 {
    let most = logs.iter().flatten().copied().fold(f32::NEG_INFINITY, f32::max);
    logs.iter_mut().flatten().for_each(|log| *log -= most);
    most
}

/// Adds the logarithm of each product, which begins anew.
#[inline(always)]
fn take(logs: &mut Places<f32>, product: &mut Places<f32>) {
    for (logs, products) in logs.iter_mut().zip(product) {
        for column in 0..PLACES {
            logs[column] += single_precision::ln(products[column]);
            products[column] = 1.0;
        }
    }
}

/// Mean and covariance along the columns, and the sum over all places, of what these are the logarithms of, the greatest of which is
/// `most`.
#[inline(always)]
fn moments(logs: &Places<f64>, most: f64) -> (Normal<ENDS>, f64) {
    // Over the rows, for each column.
    let (mut sums, mut firsts, mut seconds) = ([0.0_f32; PLACES], [0.0_f32; PLACES], [0.0_f32; PLACES]);
    for (row, logs) in logs.iter().enumerate() {
        let far = FAR[row] as f32;
        for column in 0..PLACES {
            let weight = single_precision::exp((logs[column] - most) as f32);
            sums[column] += weight;
            firsts[column] += weight * far;
            seconds[column] += weight * far * far;
        }
    }
    let (mut all, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for column in 0..PLACES {
        let [sum, by_row, by_both] = [sums[column], firsts[column], seconds[column]].map(f64::from);
        let far = FAR[column];
        all += sum;
        first += Vector2::new(by_row, far * sum);
        second += Matrix2::new(by_both, far * by_row, far * by_row, far * far * sum);
    }
    let mean = first / all;
    // A place stands for the area around it.
    let around = Matrix2::identity() * (SPACING * SPACING / 12.0);
    (Normal { mean, covariance: second / all - mean * mean.transpose() + around }, all)
}
