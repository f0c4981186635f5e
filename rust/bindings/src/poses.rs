//! Arrays of poses and of their covariance.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use regionpose::internals::verdict;

use crate::arrays::{covariance, pose, rotation, tangent, translation};

/// Rotation (3, 3) and translation (3,).
pub type RotationTranslation<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Probability that a pose at the right place, of this covariance (6, 6) of its left increment, is within 5 degrees of the true
/// one.
#[pyfunction]
pub fn rotation_confidence(covariance: &Bound<'_, PyAny>) -> PyResult<f64> {
    Ok(verdict::nearness::nearness(&self::covariance(covariance)?))
}

/// Rotation (3, 3) and translation (3,) of a pose moved by a left increment (6,).
#[pyfunction]
pub fn retract_pose<'py>(
    py: Python<'py>,
    rotation: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    increment: &Bound<'py, PyAny>,
) -> PyResult<RotationTranslation<'py>> {
    let moved = pose(rotation, translation)?.retract(&tangent(increment)?);
    Ok((self::rotation(py, &moved)?, self::translation(py, &moved)))
}
