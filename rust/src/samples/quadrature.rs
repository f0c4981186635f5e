//! Moments of the tilted distribution of a contour segment's two end offsets, by quadrature on an adaptive grid (`docs/math.md`,
//! section 17, "Segments").

use std::f64::consts::PI;

use nalgebra::{Matrix2, Vector2};

use super::label_model::{LabelModel, LabelPosterior};
use super::margin::EdgeKind;
use crate::math::gaussian::Normal;
use crate::math::lanes::{NullaryFnOnce, vectorized};
use crate::math::single_precision;

/// Ends of a segment.
pub const ENDS: usize = 2;

/// Nodes along each axis of a grid, and its half width in standard deviations of the last grid's moments. With 30 nodes ellipsoids hold
/// as many poses (`cargo test sampled::`).
const NODES: usize = 16;
const HALF_WIDTH: f64 = 4.0;
const SPACING: f64 = 2.0 * HALF_WIDTH / NODES as f64;

/// Work of one label on a grid, in edges: eight nodes take the time of an edge.
pub(super) const EDGES_PER_LABEL: usize = NODES * NODES / 8;

/// Grids at most, each about the moments of the last one.
const MAX_GRIDS: usize = 12;

/// Moments by the last grid, in the units of its layout: largest mean, range of the variances, and largest covariance. A convention: there
/// nodes are neither too sparse nor too close to the mean.
const MAX_MEAN: f64 = 0.5;
const VARIANCES: std::ops::Range<f64> = 0.6..1.5;
const MAX_COVARIANCE: f64 = 0.4;

/// A distribution goes on beyond a grid where its mean and so many of its standard deviations reach there: a convention.
const TAIL_SIGMAS: f64 = 2.0;

/// A margin beyond this many of a label's sigmas is certain: less than 1 label in 10^6 is on the other side.
const CERTAIN_SIGMAS: f64 = 5.0;

/// Probabilities that are multiplied before a logarithm is taken, at most: a convention. The logarithm is taken before where the least
/// product would underflow single precision.
const FACTORS_PER_LOG: usize = 8;

/// Logarithms that are added before the greatest sum is subtracted from all, which keeps those that count small: single precision
/// holds the sums of 500 labels to 1e-4.
const LOGS_PER_SHIFT: usize = 64;

/// One number of each node, row by row.
type Nodes<T> = [[T; NODES]; NODES];

/// Offset of each node of a row or column from the grid's center, in standard deviations.
const OFFSETS: [f64; NODES] = {
    let mut offsets = [0.0; NODES];
    let mut node = 0;
    while node < NODES {
        offsets[node] = (node as f64 + 0.5) * SPACING - HALF_WIDTH;
        node += 1;
    }
    offsets
};

/// A label beside a segment whose ends lie `e` pixels outside the region's edge: its margin is `margin + weights . e`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentLabel {
    /// The margin at `e = 0`, pixels.
    pub margin: f64,
    /// Its derivative by the offsets of both ends.
    pub weights: Vector2<f64>,
    /// Variance of the margin that the ends don't explain, squared pixels, which adds to that of the label model.
    pub variance: f64,
    /// Kind of the nearest edge.
    pub edge: EdgeKind,
    /// Noise of the label.
    pub model: LabelModel,
}

impl SegmentLabel {
    /// The label's posterior under a distribution of the ends.
    pub fn posterior(&self, ends: &Normal<ENDS>) -> LabelPosterior {
        let mean = self.margin + self.weights.dot(&ends.mean);
        let variance = self.weights.dot(&(ends.covariance * self.weights));
        self.model.posterior(self.edge, mean, variance + self.variance)
    }

    fn sigma(&self) -> f64 {
        (self.model.sigma.powi(2) + self.variance).sqrt()
    }
}

/// Moments of a tilted distribution: cavity times label likelihoods.
#[derive(Debug, Clone, Copy)]
pub struct TiltedMoments {
    /// Mean and covariance.
    pub ends: Normal<ENDS>,
    /// Logarithm of the zeroth moment: of the labels' probability under the cavity.
    pub log_probability: f64,
    /// Whether the last grid was laid out by about its own moments; the moments are invalid otherwise.
    pub has_converged: bool,
}

/// Moments of the tilted distribution, cavity times label likelihoods, on an adaptive grid started at `seed`; `None` where a
/// covariance is singular.
pub fn tilted_moments(labels: &[SegmentLabel], cavity: &Normal<ENDS>, seed: &Normal<ENDS>) -> Option<TiltedMoments> {
    let information = cavity.covariance.try_inverse()?;
    let mut ends = *seed;
    let mut moments: Option<TiltedMoments> = None;
    for _ in 0..MAX_GRIDS {
        let root = ends.covariance.cholesky()?.unpack();
        let grid = Grid { center: ends.mean, root };
        let (scaled, log_integral) =
            vectorized(GridQuadrature { grid: &grid, labels, mean: &cavity.mean, information: &information });
        let mean = ends.mean + root * scaled.mean;
        let unscaled = |covariance: Matrix2<f64>| Normal { mean, covariance: root * covariance * root.transpose() };
        let log_normalizer = (2.0 * PI).ln() + 0.5 * cavity.covariance.determinant().ln();
        let has_converged = fits_grid(&scaled);
        let log_probability = log_integral - log_normalizer;
        moments = Some(TiltedMoments { ends: unscaled(scaled.covariance), log_probability, has_converged });
        if has_converged {
            break;
        }
        ends = unscaled(next_layout(&scaled));
    }
    moments
}

/// Whether moments in the units of a grid are about those of its layout.
fn fits_grid(scaled: &Normal<ENDS>) -> bool {
    scaled.mean.amax() < MAX_MEAN
        && (0..ENDS).all(|axis| VARIANCES.contains(&scaled.covariance[(axis, axis)]))
        && scaled.covariance[(0, 1)].abs() < MAX_COVARIANCE
}

/// Covariance of the next grid in the units of the last one: that of the moments, but about the last grid's center along an axis where
/// the distribution goes on beyond the grid: the moments of a tail are the same wherever its mode lies, so a grid of their width would
/// move on by as little again.
fn next_layout(scaled: &Normal<ENDS>) -> Matrix2<f64> {
    let goes_on =
        |axis: usize| scaled.mean[axis].abs() + TAIL_SIGMAS * scaled.covariance[(axis, axis)].sqrt() > HALF_WIDTH;
    let offset = Vector2::from_fn(|axis, _| if goes_on(axis) { scaled.mean[axis] } else { 0.0 });
    scaled.covariance + offset * offset.transpose()
}

/// Nodes about a center, in steps along the columns of a covariance's root.
struct Grid {
    center: Vector2<f64>,
    root: Matrix2<f64>,
}

/// Quadrature of a normal density of this mean and information times label likelihoods.
struct GridQuadrature<'a> {
    grid: &'a Grid,
    labels: &'a [SegmentLabel],
    mean: &'a Vector2<f64>,
    information: &'a Matrix2<f64>,
}

impl NullaryFnOnce for GridQuadrature<'_> {
    /// Mean and covariance in the grid's units, and the logarithm of the integral.
    type Output = (Normal<ENDS>, f64);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let (log_likelihoods, constant) = self.grid.log_likelihoods(self.labels);
        let mut logs = self.grid.log_densities(self.mean, self.information);
        let mut most = [f64::NEG_INFINITY; NODES];
        for (logs, log_likelihoods) in logs.iter_mut().zip(&log_likelihoods) {
            for column in 0..NODES {
                logs[column] += f64::from(log_likelihoods[column]);
                most[column] = if logs[column] > most[column] { logs[column] } else { most[column] };
            }
        }
        let most = most.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (normal, integral) = moments(&logs, most);
        let area = SPACING * SPACING * self.grid.root.determinant().abs();
        (normal, most + constant + (integral * area).ln())
    }
}

impl Grid {
    /// Log density of a normal distribution at each node, without its normalizer.
    #[inline(always)]
    fn log_densities(&self, mean: &Vector2<f64>, information: &Matrix2<f64>) -> Nodes<f64> {
        let offset = self.center - mean;
        let (at_center, slope) =
            (offset.dot(&(information * offset)), self.root.transpose() * information * offset * 2.0);
        let bend = self.root.transpose() * information * self.root;
        let mut logs = [[0.0; NODES]; NODES];
        for (row, logs) in logs.iter_mut().enumerate() {
            let start = at_center + OFFSETS[row] * (slope.x + OFFSETS[row] * bend.m11);
            let along = slope.y + 2.0 * OFFSETS[row] * bend.m12;
            for column in 0..NODES {
                logs[column] = -0.5 * (start + OFFSETS[column] * (along + OFFSETS[column] * bend.m22));
            }
        }
        logs
    }

    /// Log likelihood of the labels at each node, and a constant to add to all of them.
    #[inline(always)]
    fn log_likelihoods(&self, labels: &[SegmentLabel]) -> (Nodes<f32>, f64) {
        let (mut logs, mut products) = ([[0.0; NODES]; NODES], [[1.0; NODES]; NODES]);
        let (mut constant, mut factors, mut count, mut least_product) = (0.0, 0, 0, 1.0_f32);
        for label in labels {
            let sigma = label.sigma();
            let slope = self.root.transpose() * label.weights / sigma;
            let at_center = (label.margin + label.weights.dot(&self.center)) / sigma;
            let (floor, range) = label.model.floor_and_range(label.edge);
            let most = floor + range;
            constant += most.ln();
            if at_center - HALF_WIDTH * slope.abs().sum() > CERTAIN_SIGMAS {
                continue;
            }
            let (floor, range) = ((floor / most) as f32, (range / most) as f32);
            if factors == FACTORS_PER_LOG || least_product * floor < f32::MIN_POSITIVE {
                add_logs(&mut logs, &mut products);
                count += 1;
                if count % LOGS_PER_SHIFT == 0 {
                    constant += f64::from(subtract_greatest(&mut logs));
                }
                (factors, least_product) = (0, 1.0);
            }
            let reach = HALF_WIDTH * slope.y.abs();
            let steps = OFFSETS.map(|offset| slope.y as f32 * offset as f32);
            for (row, products) in products.iter_mut().enumerate() {
                let start = at_center + slope.x * OFFSETS[row];
                if start - reach > CERTAIN_SIGMAS {
                    continue;
                }
                // First all margins: in one loop with what follows the compiler takes half as many nodes at once.
                let margins = steps.map(|step| start as f32 + step);
                for column in 0..NODES {
                    products[column] *= floor + range * single_precision::cumulative(margins[column]);
                }
            }
            (factors, least_product) = (factors + 1, least_product * floor);
        }
        add_logs(&mut logs, &mut products);
        (logs, constant)
    }
}

/// Subtracts the greatest logarithm from all, and returns it.
#[inline(always)]
fn subtract_greatest(logs: &mut Nodes<f32>) -> f32 {
    let most = logs.iter().flatten().copied().fold(f32::NEG_INFINITY, f32::max);
    logs.iter_mut().flatten().for_each(|log| *log -= most);
    most
}

/// Adds the logarithm of each product, and sets the products to 1.
#[inline(always)]
fn add_logs(logs: &mut Nodes<f32>, products: &mut Nodes<f32>) {
    for (logs, products) in logs.iter_mut().zip(products) {
        for column in 0..NODES {
            logs[column] += single_precision::ln(products[column]);
            products[column] = 1.0;
        }
    }
}

/// Mean and covariance, in the grid's units, and the sum over all nodes of the exponentials of logarithms less `most`, the greatest.
#[inline(always)]
fn moments(logs: &Nodes<f64>, most: f64) -> (Normal<ENDS>, f64) {
    // Sums over the rows, for each column.
    let (mut sums, mut firsts, mut seconds) = ([0.0_f32; NODES], [0.0_f32; NODES], [0.0_f32; NODES]);
    for (row, logs) in logs.iter().enumerate() {
        let offset = OFFSETS[row] as f32;
        for column in 0..NODES {
            let weight = single_precision::exp((logs[column] - most) as f32);
            sums[column] += weight;
            firsts[column] += weight * offset;
            seconds[column] += weight * offset * offset;
        }
    }
    let (mut sum, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
    for column in 0..NODES {
        let [weight, by_row, by_both] = [sums[column], firsts[column], seconds[column]].map(f64::from);
        let offset = OFFSETS[column];
        sum += weight;
        first += Vector2::new(by_row, offset * weight);
        second += Matrix2::new(by_both, offset * by_row, offset * by_row, offset * offset * weight);
    }
    let mean = first / sum;
    // The variance of a node's cell.
    let cell = Matrix2::identity() * (SPACING * SPACING / 12.0);
    (Normal { mean, covariance: second / sum - mean * mean.transpose() + cell }, sum)
}
