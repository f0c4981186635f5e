//! Rigid transforms SE(3), their left increments and Jacobians.

use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, UnitQuaternion, Vector3, Vector6};

use crate::error::{Error, Result};

/// Increment of a pose, `[omega (rad), tau (meters)]`, applied on the left.
pub type Tangent = Vector6<f64>;

/// Parameters of a pose.
pub const PARAMETERS: usize = 6;

/// Below this angle (rad) the series of the exponential map replace its quotients; their error is of order angle^4 / 100.
const SMALL_ANGLE: f64 = 1e-4;

/// Largest deviation of a given rotation matrix from orthonormal, as the largest entry of `R^T R - I`.
const ORTHONORMAL_TOLERANCE: f64 = 1e-6;

/// Refuses a matrix that is no rotation, nearly; also one with entries that are not finite.
pub(crate) fn check_rotation(item: &'static str, matrix: &Matrix3<f64>) -> Result<()> {
    let defect = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    let determinant = matrix.determinant();
    // The comparisons fail for NaN, too; the largest of several entries may leave it out.
    if matrix.iter().all(|entry| entry.is_finite()) && defect <= ORTHONORMAL_TOLERANCE && determinant > 0.0 {
        return Ok(());
    }
    Err(Error::InvalidRotation {
        item,
        found: format!("a matrix with |R^T R - I| = {defect:.1e} and determinant {determinant:.3}"),
        needed: format!("orthonormal to {ORTHONORMAL_TOLERANCE:.0e} with determinant +1"),
    })
}

/// Refuses a rotation matrix or translation that is not finite, and a matrix that is no rotation, nearly.
pub(crate) fn check_pose(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> Result<()> {
    for (index, &value) in rotation.iter().chain(translation.iter()).enumerate() {
        if !value.is_finite() {
            return Err(Error::NotFinite { item: "pose entry".into(), index, value });
        }
    }
    check_rotation("rotation", rotation)
}

/// A rigid motion `x_camera = rotation * x_world + translation`, named `camera_from_world` where it is the camera's pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(into = "serialized::Rows", try_from = "serialized::Rows"))]
#[must_use]
pub struct Pose {
    /// Rotation from world to camera axes.
    pub rotation: Rotation3<f64>,
    /// The world origin in camera coordinates.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// The pose with this rotation and translation.
    pub fn new(rotation: Rotation3<f64>, translation: Vector3<f64>) -> Self {
        Self { rotation, translation }
    }

    /// The pose with this rotation matrix, which is made exactly orthonormal.
    ///
    /// # Errors
    /// When an entry is not finite, or the matrix is not a rotation to 1e-6.
    pub fn from_matrix(rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Result<Self> {
        check_pose(rotation, &translation)?;
        Ok(Self { rotation: orthonormalized(rotation), translation })
    }

    /// No motion.
    pub fn identity() -> Self {
        Self { rotation: Rotation3::identity(), translation: Vector3::zeros() }
    }

    /// `rotation * point + translation`.
    pub fn transform(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// The motion that undoes this one.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// This motion after `other`.
    pub fn after(&self, other: &Self) -> Self {
        Self { rotation: self.rotation * other.rotation, translation: self.transform(&other.translation) }
    }

    /// `exp(omega) P + tau` after this pose: the pose moved by a left increment (`docs/math.md`, eq. 1.2).
    pub fn retract(&self, increment: &Tangent) -> Self {
        let turn = Rotation3::new(increment.fixed_rows::<3>(0).into_owned());
        let rotation = orthonormalized((turn * self.rotation).matrix());
        Self { rotation, translation: turn * self.translation + increment.fixed_rows::<3>(3) }
    }

    /// The left increment that takes this pose to another, its turn up to half a turn (`docs/math.md`, eq. 1.2).
    pub fn local_coordinates(&self, other: &Self) -> Tangent {
        let turn = other.rotation * self.rotation.inverse();
        // A matrix's skew part vanishes at half a turn, where the quaternion still has the axis.
        let omega = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
        let tau = other.translation - turn * self.translation;
        Tangent::new(omega.x, omega.y, omega.z, tau.x, tau.y, tau.z)
    }

    /// Angle of the rotation between two poses, in radians.
    ///
    /// Taken from the chord `|R1 - R2| = 2 sqrt(2) sin(angle / 2)`, which keeps small angles exact
    /// (`docs/math.md`, eq. 1.6).
    pub fn angle_to(&self, other: &Self) -> f64 {
        let chord = (self.rotation.matrix() - other.rotation.matrix()).norm() / (2.0 * 2.0_f64.sqrt());
        2.0 * chord.min(1.0).asin()
    }
}

impl From<Pose> for Isometry3<f64> {
    fn from(pose: Pose) -> Self {
        Self::from_parts(pose.translation.into(), UnitQuaternion::from_rotation_matrix(&pose.rotation))
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(isometry: Isometry3<f64>) -> Self {
        Self::new(isometry.rotation.to_rotation_matrix(), isometry.translation.vector)
    }
}

/// The rotation nearest to a matrix that is nearly one, by two steps of Newton's iteration for the polar factor
/// (`docs/math.md`, eq. 1.6).
fn orthonormalized(matrix: &Matrix3<f64>) -> Rotation3<f64> {
    let step = |m: Matrix3<f64>| m * (Matrix3::identity() * 1.5 - m.transpose() * m * 0.5);
    Rotation3::from_matrix_unchecked(step(step(*matrix)))
}

/// `[v]x`, the matrix of the cross product with `v` from the left.
pub fn cross_matrix(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// Derivative of the left increment at `pose.retract(x)` with respect to `x`: the chain from [`Pose::retract`]'s parameter
/// to the derivatives of [`crate::equations::derivatives`] (`docs/math.md`, eq. 1.5).
///
/// With the left Jacobian `L` of SO(3): `d omega = L(omega) dx_omega` and `d tau = dx_tau + tau x d omega`.
pub fn increment_derivative(x: &Tangent) -> Matrix6<f64> {
    let (omega, tau) = (x.fixed_rows::<3>(0).into_owned(), x.fixed_rows::<3>(3).into_owned());
    let left = left_jacobian(&omega);
    let mut derivative = Matrix6::identity();
    derivative.fixed_view_mut::<3, 3>(0, 0).copy_from(&left);
    derivative.fixed_view_mut::<3, 3>(3, 0).copy_from(&(cross_matrix(&tau) * left));
    derivative
}

/// Left Jacobian of SO(3): `I + (1 - cos a) / a^2 [w]x + (a - sin a) / a^3 [w]x^2` with `a = |w|`
/// (`docs/math.md`, eq. 1.4).
fn left_jacobian(omega: &Vector3<f64>) -> Matrix3<f64> {
    let angle = omega.norm();
    let (first, second) = if angle < SMALL_ANGLE {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        ((1.0 - angle.cos()) / angle.powi(2), (angle - angle.sin()) / angle.powi(3))
    };
    let cross = cross_matrix(omega);
    Matrix3::identity() + cross * first + cross * cross * second
}

/// A pose as it is serialized: the rows of its rotation matrix, which any library reads alike.
#[cfg(feature = "serde")]
mod serialized {
    use super::{Error, Matrix3, Pose, Result, Rotation3, check_pose};

    #[derive(serde::Serialize, serde::Deserialize)]
    pub(super) struct Rows {
        rotation: [[f64; 3]; 3],
        translation: [f64; 3],
    }

    impl From<Pose> for Rows {
        fn from(pose: Pose) -> Self {
            Self { rotation: pose.rotation.matrix().transpose().into(), translation: pose.translation.into() }
        }
    }

    impl TryFrom<Rows> for Pose {
        type Error = Error;

        /// The pose itself, as given: what is made orthonormal differs in the last digits.
        fn try_from(rows: Rows) -> Result<Self> {
            let (matrix, translation) = (Matrix3::from(rows.rotation).transpose(), rows.translation.into());
            check_pose(&matrix, &translation)?;
            Ok(Self::new(Rotation3::from_matrix_unchecked(matrix), translation))
        }
    }
}
