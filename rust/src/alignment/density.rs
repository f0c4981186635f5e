//! Prior densities of poses: of the camera's place and directions alone, or Student's about a pose by other evidence (`docs/math.md`,
//! section 19).

use std::f64::consts::PI;

use nalgebra::{Matrix6, Quaternion, Rotation3, SMatrix, SymmetricEigen, UnitQuaternion, Vector3, Vector6};

use crate::geometry::pose::Pose;
use crate::math::normal::STUDENT_FREEDOM;
use crate::prior::Prior;

/// Nodes of the rule over scales: the logarithm of the mass is exact to 0.1 within three deviations, and to 0.3 at six.
const SCALES: usize = 12;

/// Information below this fraction of the largest is none: rounding.
const OPEN: f64 = 1e-12;

/// Least scale of Student's deviates: fewer than one in a million are below.
const LEAST_SCALE: f64 = 0.02;

/// Variance of an angle that may be any, rad^2: a uniform one's.
const FREE_ANGLE: f64 = PI * PI / 3.0;

/// A density of poses by their left increments, rad and meters.
#[derive(Debug, Clone)]
pub enum PoseDensity {
    /// The density of a prior; uniform over rotations that it leaves free.
    Prior {
        /// Of the camera's place and directions.
        prior: Prior,
        /// Logarithm of the integral of the unnormalized density.
        log_volume: f64,
    },
    /// Student's distribution of 4 degrees of freedom about a pose.
    Student {
        /// In the middle.
        pose: Pose,
        /// Inverse covariance of the left increment.
        information: Matrix6<f64>,
        /// Logarithm of the density in the middle.
        log_height: f64,
    },
}

/// Logarithm of a density at a pose, its derivative by a left increment and the information that it adds there.
#[derive(Debug, Clone, Copy)]
pub struct DensityAt {
    /// The logarithm.
    pub value: f64,
    /// Its derivative by the left increment.
    pub slope: Vector6<f64>,
    /// The information that it adds.
    pub information: Matrix6<f64>,
}

impl PoseDensity {
    /// The density of a prior that bounds the camera's place; `None` for others.
    pub fn of_prior(prior: &Prior) -> Option<Self> {
        let at = Self::Prior { prior: *prior, log_volume: 0.0 }.at(&base_pose(prior, &[0.0; 3]));
        let eigen = SymmetricEigen::new(with_free_angles(prior, &at.information));
        if !eigen.eigenvalues.iter().all(|value| *value > 0.0) {
            return None;
        }
        // Of an angle that may be any, its range in place of a Gaussian's.
        let uniform = |is_free: bool, range: f64, angles: f64| {
            if is_free { range.ln() - 0.5 * angles * (2.0 * PI * FREE_ANGLE).ln() } else { 0.0 }
        };
        let free = Free::of(prior);
        let ranges =
            uniform(free == Free::Heading, 2.0 * PI, 1.0) + uniform(free == Free::Rotation, 8.0 * PI * PI, 3.0);
        let log_volume = ranges + 3.0 * (2.0 * PI).ln() - 0.5 * eigen.eigenvalues.map(f64::ln).sum();
        // Relative to the density where it is greatest: at the drawn pose a prior with contradicting parts has less.
        let most = at.value + 0.5 * at.slope.dot(&(eigen_inverse(&eigen) * at.slope));
        Some(Self::Prior { prior: *prior, log_volume: log_volume + most })
    }

    /// Student's density about a pose with a covariance of its left increment; `None` for a matrix that is no covariance.
    pub fn student(pose: Pose, covariance: &Matrix6<f64>) -> Option<Self> {
        let root = covariance.cholesky()?;
        let log_height = log_gamma_ratio() - 3.0 * (STUDENT_FREEDOM * PI).ln() - root.l().diagonal().map(f64::ln).sum();
        Some(Self::Student { pose, information: root.inverse(), log_height })
    }

    /// Logarithm of the integral of Student's density times a likelihood about their maximum at a pose, the likelihood being 1 there and
    /// normal, and the sum of both having a negative Hessian `curvature` by left increments; `None` of a prior.
    ///
    /// Student's distribution is a mixture of normal ones over their scale, of which each has a closed form.
    pub fn log_integral(&self, pose: &Pose, curvature: &Matrix6<f64>) -> Option<f64> {
        let Self::Student { pose: middle, information, .. } = self else { return None };
        let root = information.cholesky()?.l();
        let increment = middle.local_coordinates(pose);
        let squares = increment.dot(&(information * increment));
        let pull = (STUDENT_FREEDOM + 6.0) / (STUDENT_FREEDOM + squares);
        let way = root.tr_mul(&increment);
        // In units of the deviations, without the density's own curvature.
        let whitened = root.try_inverse()?;
        let whole = whitened * curvature * whitened.transpose();
        let own = (Matrix6::identity() - way * way.transpose() * (2.0 / (STUDENT_FREEDOM + squares))) * pull;
        let eigen = SymmetricEigen::new(whole - own);
        let along = eigen.eigenvectors.tr_mul(&way);
        let of_scale = |[scale, weight]: [f64; 2]| {
            let factors = eigen.eigenvalues.iter().zip(along.iter()).map(|(curved, off)| {
                // The likelihood's own maximum lies beyond the joint one and is not evaluated: taken to be at most e times as high.
                let together = curved.max(0.5 * (pull * off).powi(2)) + scale;
                0.5 * ((scale / together).ln() + (off * (pull - scale)).powi(2) / together)
            });
            weight.ln() - 0.5 * scale * squares + factors.sum::<f64>()
        };
        let logs = scales().map(of_scale);
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Some(most + logs.iter().map(|log| (log - most).exp()).sum::<f64>().ln())
    }

    /// Its logarithm, slope and information at a pose.
    pub fn at(&self, pose: &Pose) -> DensityAt {
        match self {
            Self::Prior { prior, log_volume } => {
                let factor = prior.gaussian(pose);
                DensityAt {
                    value: factor.offset - log_volume,
                    slope: factor.information_vector,
                    information: factor.information,
                }
            }
            Self::Student { pose: middle, information, log_height } => {
                let increment = middle.local_coordinates(pose);
                let pull = information * increment;
                let squares = increment.dot(&pull);
                let weight = STUDENT_FREEDOM + 6.0;
                let by_middle = -pull * (weight / (STUDENT_FREEDOM + squares));
                let derivative = crate::geometry::pose::increment_derivative(&increment);
                let slope = derivative.try_inverse().map_or(by_middle, |inverse| inverse.tr_mul(&by_middle));
                DensityAt {
                    value: log_height - 0.5 * weight * (squares / STUDENT_FREEDOM).ln_1p(),
                    slope,
                    information: information * (weight / (STUDENT_FREEDOM + squares)).min(1.0),
                }
            }
        }
    }
}

/// Draws poses from a density.
#[derive(Debug, Clone)]
pub struct Sampler {
    density: PoseDensity,
    /// Increment from a base pose to the mean of the density's normal part.
    mean: Vector6<f64>,
    /// Increments of one deviation each, as columns; none along what is open, which the base pose has.
    root: Matrix6<f64>,
}

impl Sampler {
    /// The sampler of a density.
    pub fn new(density: PoseDensity) -> Self {
        let (factor, least) = match &density {
            PoseDensity::Prior { prior, .. } => (prior.gaussian(&base_pose(prior, &[0.0; 3])), OPEN),
            PoseDensity::Student { information, .. } => {
                (crate::math::gaussian::Gaussian { information: *information, ..Default::default() }, 0.0)
            }
        };
        // The same in the camera's axes whatever its heading, or its rotation if that is open.
        let eigen = SymmetricEigen::new(factor.information);
        let most = eigen.eigenvalues.amax();
        let scale = eigen.eigenvalues.map(|value| if value > least * most { value.sqrt().recip() } else { 0.0 });
        let root = eigen.eigenvectors * Matrix6::from_diagonal(&scale);
        Self { density, mean: root * (root.transpose() * factor.information_vector), root }
    }

    /// The draw of a number: draws are evenly spread over the density.
    pub fn draw(&self, number: usize) -> Pose {
        let even = sequence::<9>(number);
        let pair = |first: usize| {
            // Box and Muller's: two normal numbers of two even ones.
            let length = (-2.0 * (1.0 - even[first]).ln()).sqrt();
            let (sin, cos) = (2.0 * PI * even[first + 1]).sin_cos();
            [length * cos, length * sin]
        };
        let ([a, b], [c, d], [e, f]) = (pair(3), pair(5), pair(7));
        self.pose(&[even[0], even[1], even[2]], &[a, b, c, d, e, f])
    }

    /// The pose of a draw: `uniform` deviates from 0 to 1 for free angles, `normal` ones for the rest.
    pub fn pose(&self, uniform: &[f64; 3], normal: &[f64; 6]) -> Pose {
        let base = match &self.density {
            PoseDensity::Prior { prior, .. } => base_pose(prior, uniform),
            PoseDensity::Student { pose, .. } => *pose,
        };
        // Student's deviates are normal ones over the root of a mean square of four others: an exponential of two uniform numbers.
        let scale = match &self.density {
            PoseDensity::Prior { .. } => 1.0,
            PoseDensity::Student { .. } => {
                (-2.0 * ((1.0 - uniform[0]) * (1.0 - uniform[1])).ln() / STUDENT_FREEDOM).sqrt()
            }
        };
        base.retract(&(self.mean + self.root * Vector6::from(*normal) / scale.max(LEAST_SCALE)))
    }
}

/// The rotation that a prior leaves free.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Free {
    Nothing,
    Heading,
    Rotation,
}

impl Free {
    fn of(prior: &Prior) -> Self {
        if prior.initial.is_some() && prior.initial_sigma.is_some() {
            Self::Nothing
        } else if prior.up.is_some() {
            Self::Heading
        } else {
            Self::Rotation
        }
    }
}

/// The center of a prior, with free angles drawn uniformly; normal deviations come on top.
fn base_pose(prior: &Prior, uniform: &[f64; 3]) -> Pose {
    let rotation = match (Free::of(prior), prior.initial, prior.up) {
        (Free::Nothing, Some(initial), _) => initial.rotation,
        (Free::Heading, _, Some(up)) => {
            let level = Rotation3::rotation_between(&up, &-Vector3::y())
                .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), PI));
            Rotation3::from_axis_angle(&Vector3::y_axis(), 2.0 * PI * uniform[0]) * level
        }
        _ => uniform_rotation(uniform),
    };
    let place = prior.initial.filter(|_| prior.initial_sigma.is_some()).map(|initial| initial.inverse().translation);
    let center = place.or(prior.near).unwrap_or_else(Vector3::zeros);
    Pose::new(rotation, -(rotation * center))
}

/// A uniformly distributed rotation, of three uniform deviates from 0 to 1 (Shoemake, Uniform random rotations, 1992).
fn uniform_rotation(&[a, b, c]: &[f64; 3]) -> Rotation3<f64> {
    let (low, high) = ((1.0 - a).sqrt(), a.sqrt());
    let ((i, j), (k, w)) = ((2.0 * PI * b).sin_cos(), (2.0 * PI * c).sin_cos());
    UnitQuaternion::new_normalize(Quaternion::new(high * w, low * i, low * j, high * k)).to_rotation_matrix()
}

/// The information of a prior, completed by that of a uniform angle where an angle is free.
fn with_free_angles(prior: &Prior, information: &Matrix6<f64>) -> Matrix6<f64> {
    let free = Free::of(prior);
    let mut whole = *information;
    if free == Free::Nothing {
        return whole;
    }
    let rotation = information.fixed_view::<3, 3>(0, 0).into_owned();
    let eigen = SymmetricEigen::new(rotation);
    let most = eigen.eigenvalues.amax();
    for (value, axis) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value <= 1e-9 * most || most == 0.0 {
            let mut block = whole.fixed_view_mut::<3, 3>(0, 0);
            block += axis * axis.transpose() / FREE_ANGLE;
        }
    }
    whole
}

/// The pseudoinverse of a symmetric matrix.
fn eigen_inverse(eigen: &SymmetricEigen<f64, nalgebra::Const<6>>) -> Matrix6<f64> {
    let open = OPEN * eigen.eigenvalues.amax();
    let inverse = eigen.eigenvalues.map(|value| if value > open { value.recip() } else { 0.0 });
    eigen.eigenvectors * Matrix6::from_diagonal(&inverse) * eigen.eigenvectors.transpose()
}

/// Scales of the information of the normal distributions that Student's is a mixture of, and what each counts: of the distribution of a
/// mean square of four deviates, by Gauss's and Laguerre's rule (Golub and Welsch 1969).
fn scales() -> [[f64; 2]; SCALES] {
    let jacobi = SMatrix::<f64, SCALES, SCALES>::from_fn(|row, column| {
        let (low, high) = (row.min(column) as f64, row.max(column) as f64);
        if row == column {
            2.0 * low + 2.0
        } else if high - low == 1.0 {
            (high * (high + 1.0)).sqrt()
        } else {
            0.0
        }
    });
    let eigen = SymmetricEigen::new(jacobi);
    std::array::from_fn(|place| {
        [2.0 * eigen.eigenvalues[place] / STUDENT_FREEDOM, eigen.eigenvectors[(0, place)].powi(2)]
    })
}

/// Logarithm of `Gamma((4 + 6) / 2) / Gamma(4 / 2)` = 4!.
fn log_gamma_ratio() -> f64 {
    24.0_f64.ln()
}

/// The numbers of an evenly spread sequence in so many dimensions, from 0 to 1: multiples of powers of the root of x^(d+1) = x + 1
/// (Roberts, The unreasonable effectiveness of quasirandom sequences, 2018).
pub(super) fn sequence<const D: usize>(number: usize) -> [f64; D] {
    let mut root = 2.0_f64;
    for _ in 0..40 {
        root = (1.0 + root).powf(1.0 / (D as f64 + 1.0));
    }
    std::array::from_fn(|axis| (0.5 + (number + 1) as f64 * root.powi(-(axis as i32 + 1))).fract())
}
