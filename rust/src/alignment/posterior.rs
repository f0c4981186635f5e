//! The posterior density of a pose by the edges of photos and clouds, its maxima, and the mass about each (`docs/math.md`, section 19).

use nalgebra::{Matrix6, SymmetricEigen, Vector6};

use super::density::PoseDensity;
use super::descent::{Ends, minimum};
use super::frame::{FINEST, Frame, SPREADS_PX, VisibleEdges};
use crate::budget::Budget;
use crate::geometry::pose::{Pose, increment_derivative};

/// Least curvature of the log posterior, relative to that of the prior and [`WIDEST_PX`] together: no direction is much less certain
/// than in the prior, and no maximum is wider than the spread of the edges that poses are refined with.
const LEAST_CURVATURE: f64 = 0.2;

/// Move of the edges within which poses are refined to a maximum, pixels: the widest spread of a refinement.
const WIDEST_PX: f64 = SPREADS_PX[1];

/// Longest steps of the finite differences of the curvature, in the prior's deviations and in the finest spread: a step of half a
/// Gaussian's deviation makes its curvature an eighth too small, and one of several deviations makes it zero.
const STEP_UNITS: f64 = 0.1;
const STEP_SPREADS: f64 = 0.5;

/// Ends of a descent, whose unit is one that moves the edges by about a spread: where a maximum is missed by a hundredth of its height.
/// Values between pixels have kinks, at which slopes do not vanish.
const ENDS: Ends = Ends { flat: 0.02, gain: 1e-3, tries: 10, steps: 100 };

/// Ends of a descent that only starts the next one, at a finer spread.
const COARSE_ENDS: Ends = Ends { flat: 0.1, gain: 0.05, tries: 10, steps: 20 };

/// The log posterior density of a pose that frames share.
#[derive(Debug, Clone)]
pub struct Posterior<'a> {
    /// Photos and clouds.
    pub frames: &'a [Frame],
    /// Weight of the edges of each.
    pub weights: Vec<Weight>,
    /// Index of the spread of their edges.
    pub spread: usize,
    /// The prior density.
    pub density: &'a PoseDensity,
}

/// Weight of a frame's edges.
#[derive(Debug, Clone, Copy)]
pub enum Weight {
    /// The sum of their log likelihood ratios times an exponent of at most 1 (a tempered likelihood), since neighbors are correlated.
    Tempered(f64),
    /// The standardized sum: up to a constant, the log odds that it exceeds those of wrong poses by some deviations rather than by none.
    Standardized {
        /// Mean log likelihood ratio of an edge at wrong poses.
        offset: f64,
        /// Deviations times the root of the number of edges, over the deviation of sums at wrong poses.
        scale: f64,
    },
}

impl Weight {
    /// The log likelihood ratio of an uninformative edge, and the weight of an edge where so many are visible.
    fn of(&self, count: usize) -> [f64; 2] {
        match *self {
            Self::Tempered(exponent) => [0.0, exponent],
            Self::Standardized { offset, scale } => [offset, scale / (count.max(1) as f64).sqrt()],
        }
    }
}

/// A maximum of the posterior.
#[derive(Debug, Clone, Copy)]
pub struct Mode {
    /// `camera_from_world`.
    pub pose: Pose,
    /// Of its left increment, rad and meters.
    pub covariance: Matrix6<f64>,
    /// Logarithm of the integral of the posterior about it, where that of the prior alone is 1.
    pub log_mass: f64,
    /// Sum of the log likelihood ratios at it.
    pub log_ratio: f64,
    /// How many edges are visible there.
    pub edges: usize,
}

impl Posterior<'_> {
    /// The log density at a pose.
    pub fn log_density(&self, pose: &Pose, budget: &Budget) -> f64 {
        let frames = self.frames.iter().zip(&self.weights);
        let ratios = frames.map(|(frame, weight)| {
            let (sum, count) = frame.log_ratio(pose, self.spread, budget);
            let [offset, scale] = weight.of(count);
            scale * (sum - offset * count as f64)
        });
        self.density.at(pose).value + ratios.sum::<f64>()
    }

    /// The local maximum reached from a pose, and the log density there.
    pub fn maximum(&self, pose: &Pose, budget: &Budget) -> (Pose, f64) {
        let local = Local::new(self, *pose, budget);
        let Some(root) = local.root() else { return (*pose, f64::NEG_INFINITY) };
        let cost = |x: &Vector6<f64>| {
            let increment = root * x;
            let (value, slope) = local.at(&increment);
            (-value, -root.tr_mul(&increment_derivative(&increment).tr_mul(&slope)))
        };
        let ends = if self.spread == FINEST { ENDS } else { COARSE_ENDS };
        let (x, value) = minimum(cost, Vector6::zeros(), &ends);
        (pose.retract(&(root * x)), -value)
    }

    /// A maximum with its covariance and mass.
    pub fn mode(&self, pose: &Pose, budget: &Budget) -> Option<Mode> {
        let local = Local::new(self, *pose, budget);
        let (prior, squares) = (self.density.at(pose).information, local.squares);
        let longest = prior / (STEP_UNITS * STEP_UNITS) + squares / (STEP_SPREADS * SPREADS_PX[self.spread]).powi(2);
        let steps = SymmetricEigen::new(regular(&longest));
        let mut curvature = Matrix6::zeros();
        let ways = steps.eigenvectors * Matrix6::from_diagonal(&steps.eigenvalues.map(|value| value.sqrt().recip()));
        let back = steps.eigenvectors * Matrix6::from_diagonal(&steps.eigenvalues.map(f64::sqrt));
        for way in 0..6 {
            let increment: Vector6<f64> = ways.column(way).into_owned();
            let slope = |sign: f64| {
                let increment = increment * sign;
                increment_derivative(&increment).tr_mul(&local.at(&increment).1)
            };
            curvature.set_column(way, &(ways.tr_mul(&(slope(-1.0) - slope(1.0))) * 0.5));
        }
        let curvature = back * (curvature + curvature.transpose()) * 0.5 * back.transpose();
        let widest = regular(&(prior + squares / (WIDEST_PX * WIDEST_PX))).cholesky()?;
        let root = widest.l().try_inverse()?.transpose();
        let eigen = SymmetricEigen::new(root.tr_mul(&(curvature * root)));
        let values = eigen.eigenvalues.map(|value| value.max(LEAST_CURVATURE));
        let half = root * eigen.eigenvectors * Matrix6::from_diagonal(&values.map(|value| value.sqrt().recip()));
        let (value, _) = local.at(&Vector6::zeros());
        let log_root = root.determinant().abs().ln();
        let log_ratio = value - self.density.at(pose).value;
        let laplace = value + 3.0 * (2.0 * std::f64::consts::PI).ln() + log_root - 0.5 * values.map(f64::ln).sum();
        let log_mass = self.density.log_integral(pose, &curvature).map_or(laplace, |about| log_ratio + about);
        let covariance = half * half.transpose();
        Some(Mode { pose: *pose, covariance, log_mass, log_ratio, edges: local.edges })
    }

    /// The matrix of the mean squares, in spreads, by which left increments of a pose move the edges that it sees.
    pub fn metric(&self, pose: &Pose, budget: &Budget) -> Matrix6<f64> {
        Local::new(self, *pose, budget).squares / SPREADS_PX[self.spread].powi(2)
    }

    /// The volume of the prior's deviations about a pose over that of those in which the edges of a frame move by less than a spread.
    pub(super) fn distinct_poses(&self, pose: &Pose, budget: &Budget) -> f64 {
        let prior = regular(&self.density.at(pose).information);
        let moved = self.metric(pose, budget) / self.frames.len().max(1) as f64;
        ((prior + moved).determinant() / prior.determinant()).sqrt()
    }
}

/// Information added along every direction, rad^-2 and m^-2: that of a uniform angle, and of a kilometer.
const OPEN: [f64; 2] = [3.0 / (std::f64::consts::PI * std::f64::consts::PI), 1e-6];

/// A posterior by the edges that are visible from one pose.
struct Local<'a> {
    posterior: &'a Posterior<'a>,
    pose: Pose,
    visible: Vec<VisibleEdges<'a>>,
    /// Of each frame: the log likelihood ratio of an uninformative edge, and the weight of an edge.
    weights: Vec<[f64; 2]>,
    /// Mean squares of moves in the photo, pixels, summed over the frames.
    squares: Matrix6<f64>,
    edges: usize,
}

impl<'a> Local<'a> {
    fn new(posterior: &'a Posterior<'a>, pose: Pose, budget: &'a Budget) -> Self {
        let visible: Vec<_> =
            posterior.frames.iter().map(|frame| frame.visible_edges(&pose, posterior.spread, budget)).collect();
        let (mut squares, mut edges, mut weights) = (Matrix6::zeros(), 0, Vec::new());
        for (frame, weight) in visible.iter().zip(&posterior.weights) {
            let (moves, count) = frame.square_moves(&pose);
            squares += moves;
            edges += count;
            weights.push(weight.of(count));
        }
        Self { posterior, pose, visible, weights, squares, edges }
    }

    /// The log density at a left increment of the pose, and its slope by increments there.
    fn at(&self, increment: &Vector6<f64>) -> (f64, Vector6<f64>) {
        let pose = self.pose.retract(increment);
        let prior = self.posterior.density.at(&pose);
        let (mut value, mut slope) = (prior.value, prior.slope);
        for (visible, [offset, scale]) in self.visible.iter().zip(&self.weights) {
            let (ratio, by_increment) = visible.log_ratio(&pose, *offset);
            value += scale * ratio;
            slope += by_increment * *scale;
        }
        (value, slope)
    }

    /// Increments, as columns, of about a spread of the edges or a deviation of the prior; `None` where a direction has no information.
    fn root(&self) -> Option<Matrix6<f64>> {
        let prior = self.posterior.density.at(&self.pose).information;
        let unit = prior + self.squares / SPREADS_PX[self.posterior.spread].powi(2);
        let root = regular(&unit).cholesky()?.l();
        root.try_inverse().map(|inverse| inverse.transpose())
    }
}

/// The matrix plus the information [`OPEN`], so that it is regular.
fn regular(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    let [turn, place] = OPEN;
    matrix + Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, place, place, place))
}
