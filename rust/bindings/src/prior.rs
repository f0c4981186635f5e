//! What is known of a pose beforehand.

use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::prior::{self, PoseSigma};

use crate::arrays::{covariance, matrix, pose, scalar, vector};

const ROTATION_SIGMA: &str = "initial_rotation_sigma_deg";
const CENTER_SIGMA: &str = "initial_center_sigma_m";
const DEGREES: &str = "a positive number of degrees";
const METERS: &str = "a positive number of meters";

/// What is known of a pose beforehand.
#[pyclass(frozen, module = "regionpose._core", from_py_object)]
#[derive(Clone, Copy)]
pub struct Prior(pub prior::Prior);

type PoseArrays<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);
type GaussianArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

#[pymethods]
impl Prior {
    #[new]
    #[pyo3(signature = (
        *, up = None, up_sigma_deg = None, initial = None, initial_rotation_sigma_deg = None,
        initial_center_sigma_m = None, camera_near = None, camera_near_sigma_m = None
    ))]
    fn new(
        up: Option<&Bound<'_, PyAny>>,
        up_sigma_deg: Option<&Bound<'_, PyAny>>,
        initial: Option<PoseArrays<'_>>,
        initial_rotation_sigma_deg: Option<&Bound<'_, PyAny>>,
        initial_center_sigma_m: Option<&Bound<'_, PyAny>>,
        camera_near: Option<&Bound<'_, PyAny>>,
        camera_near_sigma_m: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        check_given("up_sigma_deg", up_sigma_deg, "up", up.is_some())?;
        check_given(ROTATION_SIGMA, initial_rotation_sigma_deg, "initial", initial.is_some())?;
        check_given(CENTER_SIGMA, initial_center_sigma_m, "initial", initial.is_some())?;
        check_given("camera_near_sigma_m", camera_near_sigma_m, "camera_near", camera_near.is_some())?;
        let degrees = |sigma| deviation("up_sigma_deg", sigma, DEGREES);
        let meters = |sigma| deviation("camera_near_sigma_m", sigma, METERS);
        Ok(Self(prior::Prior {
            initial: initial.map(|(rotation, translation)| pose(&rotation, &translation)).transpose()?,
            initial_sigma: pose_sigma(initial_rotation_sigma_deg, initial_center_sigma_m)?,
            up: up.map(direction).transpose()?,
            up_sigma: up_sigma_deg.map(degrees).transpose()?.map(f64::to_radians),
            near: camera_near.map(|place| vector("camera_near", place)).transpose()?,
            near_sigma: camera_near_sigma_m.map(meters).transpose()?,
        }))
    }

    /// Standard deviation of the camera's place, meters, the conventional one where none was given; None without a
    /// place.
    #[getter]
    fn camera_near_sigma_m(&self) -> Option<f64> {
        self.0.place().map(|(_, sigma)| sigma)
    }

    /// What counts against a pose with this covariance (6, 6) of its left increment, in variances.
    fn penalty(
        &self,
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
    ) -> PyResult<f64> {
        Ok(self.0.penalty(&pose(rotation, translation)?, &self::covariance(covariance)?))
    }

    /// All that it says of the left increment x from a pose, exp(vector . x - x . information x / 2): information (6, 6) and
    /// vector (6,).
    fn gaussian<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<GaussianArrays<'py>> {
        let said = self.0.gaussian(&pose(rotation, translation)?);
        Ok((
            matrix(py, said.information.iter().copied().collect(), [6, 6])?,
            PyArray1::from_slice(py, said.vector.as_slice()),
        ))
    }
}

/// Refuses a deviation of what is not given.
fn check_given(item: &str, sigma: Option<&Bound<'_, PyAny>>, of: &str, given: bool) -> PyResult<()> {
    match sigma {
        Some(sigma) if !given => Err(PyValueError::new_err(format!("{item} is {sigma} without {of}; it needs {of}"))),
        _ => Ok(()),
    }
}

fn direction(up: &Bound<'_, PyAny>) -> PyResult<Vector3<f64>> {
    let up = vector("up", up)?;
    if up.norm() > 0.0 {
        return Ok(up);
    }
    Err(PyValueError::new_err("up is a zero vector; it needs to be a direction"))
}

/// Both deviations of the initial pose, or none.
fn pose_sigma(rotation: Option<&Bound<'_, PyAny>>, center: Option<&Bound<'_, PyAny>>) -> PyResult<Option<PoseSigma>> {
    match (rotation, center) {
        (Some(rotation), Some(center)) => Ok(Some(PoseSigma {
            rotation: deviation(ROTATION_SIGMA, rotation, DEGREES)?.to_radians(),
            place: deviation(CENTER_SIGMA, center, METERS)?,
        })),
        (None, None) => Ok(None),
        (given, _) => {
            let [here, missing] =
                if given.is_some() { [ROTATION_SIGMA, CENTER_SIGMA] } else { [CENTER_SIGMA, ROTATION_SIGMA] };
            Err(PyValueError::new_err(format!("{here} is given without {missing}; it needs both or neither")))
        }
    }
}

fn deviation(item: &str, given: &Bound<'_, PyAny>, needed: &str) -> PyResult<f64> {
    let value = scalar(item, given, needed)?;
    check_deviation(item, value)?;
    Ok(value)
}

fn check_deviation(item: &str, value: f64) -> PyResult<()> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{item} holds {value}; it needs positive numbers")))
}
