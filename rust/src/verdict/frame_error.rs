//! Covariance added by errors of a whole exposure and of whole regions (`docs/math.md`, section 10).

use nalgebra::{Matrix6, Vector3, Vector6};

use super::nearness::RIGHT;
use crate::equations::information::validated_covariance;
use crate::geometry::pose::{PARAMETERS, Tangent};
use crate::math::gaussian::Gaussian;
use crate::math::normal::STUDENT_FREEDOM;
use crate::options::FrameSigma;

/// Error of each region of a scan beside that of the whole, relative to the latter: 0.73 px, the scatter within frames of the offsets of
/// `FrameSigma::default`.
const OF_REGION: f64 = 0.6;

/// Variance of Student's prior of the factor by which regions are off farther than that, over its squared scale.
const VARIANCE: f64 = STUDENT_FREEDOM / (STUDENT_FREEDOM - 2.0);

/// Logarithms of that factor, over which is summed: from a tenth to a hundred and fifty times, in steps of a third.
const LOG_FACTORS: std::ops::Range<i32> = -7..16;
const LOG_STEP: f64 = 1.0 / 3.0;

/// Rotation, rad, from which on two poses are different hypotheses, as of the confidence: the bound of a region's mean.
const ANOTHER_PLACE: f64 = RIGHT * std::f64::consts::PI / 180.0;

/// Share of the covariance's information that is added for directions that a prior alone constrains: a convention, by which the shift by
/// focal lengths is then too short.
const PRIOR: f64 = 0.01;

/// Information of unconstrained directions, in units of the errors: a deviation a thousandfold of each.
const FREE: f64 = 1e-6;

/// The factor of a region on the left increment, and the region's center in the camera's frame.
pub(super) struct RegionFactor {
    pub(super) factor: Gaussian,
    pub(super) place: Vector3<f64>,
    /// Whether it is that of a scan.
    pub(super) is_scanned: bool,
}

/// The covariance of a pose, of the left increment, plus that of errors which all contours and samples share: of the whole exposure, of
/// its calibration and, of a scan, of each region (`docs/math.md`, eq. 10.8 to 10.12); `pixel` is the angle of one.
///
/// The error of a scan's regions is inferred from how far they contradict one another at the pose, given its prior.
pub(super) fn with_frame_error(
    covariance: &Matrix6<f64>,
    factors: &[RegionFactor],
    focal_shift: &Tangent,
    pixel: f64,
    sigma: &FrameSigma,
) -> Matrix6<f64> {
    if *sigma == FrameSigma::ZERO || !covariance.iter().all(|entry| entry.is_finite()) {
        return *covariance;
    }
    let is_scan = factors.iter().any(|factor| factor.is_scanned);
    let turn = sigma.rotation.hypot(sigma.center * pixel);
    let whole = deviations(turn, if is_scan { sigma.place } else { 0.0 });
    let focal = focal_shift * sigma.focal;
    let whole = Matrix6::from_diagonal(&whole.component_mul(&whole)) + focal * focal.transpose();
    validated_covariance(&(covariance + by_regions(covariance, factors, sigma) + whole))
}

fn deviations(turn: f64, way: f64) -> Vector6<f64> {
    Vector6::new(turn, turn, turn, way, way, way)
}

/// The derivative of a pose, of this covariance, by the logarithm of the focal lengths (`docs/math.md`, eq. 10.9): with longer ones a
/// region is seen nearer to the axis, and as small as one that stands farther.
pub(super) fn focal_shift(covariance: &Matrix6<f64>, factors: &[RegionFactor]) -> Tangent {
    if !covariance.iter().all(|entry| entry.is_finite()) {
        return Tangent::from_element(f64::NAN);
    }
    let mut information: Matrix6<f64> = factors.iter().map(|region| region.factor.information).sum();
    // What neighboring pieces share is left out of the factors: in units of the covariance they have more information than it.
    let unit = ((covariance * information).trace() / PARAMETERS as f64).max(1.0);
    information += covariance.try_inverse().unwrap_or_default() * (PRIOR * unit);
    let pulls = factors.iter().map(|RegionFactor { factor, place, .. }| {
        let across = Vector3::z().cross(place);
        let angle = across.norm().atan2(place.z);
        let turn = across.try_normalize(0.0).unwrap_or_else(Vector3::zeros) * -angle;
        factor.information * Vector6::new(turn.x, turn.y, turn.z, place.x, place.y, place.z)
    });
    information.cholesky().map_or_else(Tangent::zeros, |root| root.solve(&pulls.sum::<Tangent>()))
}

/// The covariance added by errors of single regions of a scan.
fn by_regions(covariance: &Matrix6<f64>, factors: &[RegionFactor], sigma: &FrameSigma) -> Matrix6<f64> {
    let unit = deviations(sigma.rotation, sigma.place) * (OF_REGION / VARIANCE.sqrt());
    let scanned = factors.iter().filter(|region| region.is_scanned);
    let regions: Vec<Region> = scanned.map(|region| Region::new(&region.factor, &unit)).collect();
    if regions.is_empty() || unit.min() <= 0.0 {
        return Matrix6::zeros();
    }
    // A region's error moves the pose by the covariance times the region's information.
    let scatter: Matrix6<f64> = regions.iter().map(|region| region.information * region.information).sum();
    let scatter = scatter.component_div(&(unit * unit.transpose())) * mean_square_factor(&regions);
    covariance * scatter * covariance
}

/// The factor of a region, in units of its expected error: along independent axes, the information and that times the mean.
struct Region {
    information: Matrix6<f64>,
    axes: Matrix6<f64>,
    values: Vector6<f64>,
    along: Vector6<f64>,
}

impl Region {
    fn new(factor: &Gaussian, unit: &Vector6<f64>) -> Self {
        let scaled = factor.information.component_mul(&(unit * unit.transpose()));
        let eigen = ((scaled + scaled.transpose()) * 0.5).symmetric_eigen();
        let along = eigen.eigenvectors.transpose() * factor.information_vector.component_mul(unit);
        // Clamped: samples that contradict one another along an axis have no information there, and none on poses beyond the hypothesis.
        let most = ANOTHER_PLACE / unit[0];
        let along = along.zip_map(&eigen.eigenvalues, |along, value| {
            let most = most * value.max(0.0);
            along.clamp(-most, most)
        });
        let (axes, values) = (eigen.eigenvectors, eigen.eigenvalues.map(|value| value.max(0.0)));
        Self { information: axes * Matrix6::from_diagonal(&values) * axes.transpose(), axes, values, along }
    }

    /// Its factor with an error scaled by `factor` integrated out, and the logarithm of the scale.
    fn blurred(&self, factor: f64) -> (Matrix6<f64>, Vector6<f64>, f64) {
        let square = factor * factor;
        let left = self.values.map(|value| 1.0 / (1.0 + square * value));
        let along = self.along.component_mul(&left);
        let values = Matrix6::from_diagonal(&self.values.component_mul(&left));
        let log = 0.5 * (square * self.along.dot(&along) + left.map(f64::ln).sum());
        (self.axes * values * self.axes.transpose(), self.axes * along, log)
    }
}

/// Posterior mean square of the factor by which regions are off farther than expected.
fn mean_square_factor(regions: &[Region]) -> f64 {
    let logs: Vec<(f64, f64)> = LOG_FACTORS
        .map(|step| {
            let factor = (f64::from(step) * LOG_STEP).exp();
            (factor * factor, log_prior(factor) + log_evidence(regions, factor))
        })
        .collect();
    let most = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let weights = logs.iter().map(|(square, log)| (square, (log - most).exp()));
    let (sum, squares) =
        weights.fold((0.0, 0.0), |(sum, squares), (square, weight)| (sum + weight, squares + weight * square));
    squares / sum
}

/// Logarithm of the density of a factor's logarithm: half of Student's distribution.
fn log_prior(factor: f64) -> f64 {
    factor.ln() - 0.5 * (STUDENT_FREEDOM + 1.0) * (factor * factor / STUDENT_FREEDOM).ln_1p()
}

/// Logarithm of the evidence of regions that are so many times as far off, over all increments.
fn log_evidence(regions: &[Region], factor: f64) -> f64 {
    let (mut information, mut vector, mut log) = (Matrix6::identity() * FREE, Vector6::zeros(), 0.0);
    for region in regions {
        let (own, pull, gain) = region.blurred(factor);
        information += own;
        vector += pull;
        log += gain;
    }
    let Some(root) = information.cholesky() else { return f64::NEG_INFINITY };
    log + 0.5 * vector.dot(&root.solve(&vector)) - root.l_dirty().diagonal().map(f64::ln).sum()
}
