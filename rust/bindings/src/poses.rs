//! Poses, and what a covariance says of one.

use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::geometry::pose::Pose;
use regionpose::verdict::{self, shares};

use crate::arrays::{covariance, finite_points, numbers, pose, rotation, tangent, translation};

/// Rotation (3, 3) and translation (3,).
pub type RotationTranslation<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Probability that a pose at the right place, of this covariance (6, 6) of its left increment, is within 5 degrees of the true
/// one.
#[pyfunction]
pub fn nearness(covariance: &Bound<'_, PyAny>) -> PyResult<f64> {
    Ok(verdict::nearness::nearness(&self::covariance(covariance)?))
}

/// Probabilities (n,) that the true pose is within 5 degrees of each answer, of rotations (n, 4) as x, y, z, w and the probabilities
/// (n,) that each is the place.
#[pyfunction]
pub fn together<'py>(
    py: Python<'py>,
    quaternions: &Bound<'py, PyAny>,
    shares: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (quaternions, given) = (finite_points::<4>("quaternions", quaternions)?, numbers("shares", shares)?);
    if quaternions.len() != given.len() {
        let found = format!("{} quaternions and {} shares; one is needed for each", quaternions.len(), given.len());
        return Err(PyValueError::new_err(found));
    }
    let turned = |xyzw: Vector4<f64>| UnitQuaternion::from_quaternion(Quaternion::from(xyzw)).to_rotation_matrix();
    let poses: Vec<Pose> = quaternions.into_iter().map(|xyzw| Pose::new(turned(xyzw), Vector3::zeros())).collect();
    Ok(PyArray1::from_vec(py, shares::together(&poses, &given)))
}

/// Rotation (3, 3) and translation (3,) of a pose moved by a left increment (6,).
#[pyfunction]
pub fn moved_pose<'py>(
    py: Python<'py>,
    rotation: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    increment: &Bound<'py, PyAny>,
) -> PyResult<RotationTranslation<'py>> {
    let moved = pose(rotation, translation)?.moved(&tangent(increment)?);
    Ok((self::rotation(py, &moved)?, self::translation(py, &moved)))
}
