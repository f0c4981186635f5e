//! Gaussian priors of a pose.

use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::Error;
use regionpose::internals::prior::{self, PoseSigma};

use crate::arrays::{covariance, matrix, pose, scalar, value_error, vector};

const UP_SIGMA: &str = "up_sigma_deg";
const NEAR_SIGMA: &str = "camera_near_sigma_m";
const ROTATION_SIGMA: &str = "initial_rotation_sigma_deg";
const CENTER_SIGMA: &str = "initial_center_sigma_m";
const DEGREES: &str = "a positive number of degrees";
const METERS: &str = "a positive number of meters";

/// A Gaussian prior of a pose.
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
        check_given(UP_SIGMA, up_sigma_deg, "up", up.is_some())?;
        check_given(ROTATION_SIGMA, initial_rotation_sigma_deg, "initial", initial.is_some())?;
        check_given(CENTER_SIGMA, initial_center_sigma_m, "initial", initial.is_some())?;
        check_given(NEAR_SIGMA, camera_near_sigma_m, "camera_near", camera_near.is_some())?;
        check_both(initial_rotation_sigma_deg, initial_center_sigma_m)?;
        let number =
            |item, given: Option<&Bound<'_, PyAny>>, needed| given.map(|given| scalar(item, given, needed)).transpose();
        let rotation_sigma = number(ROTATION_SIGMA, initial_rotation_sigma_deg, DEGREES)?;
        let center_sigma = number(CENTER_SIGMA, initial_center_sigma_m, METERS)?;
        let up_sigma = number(UP_SIGMA, up_sigma_deg, DEGREES)?;
        let near_sigma = number(NEAR_SIGMA, camera_near_sigma_m, METERS)?;
        let rough = |(rotation, place): (f64, f64)| PoseSigma { rotation: rotation.to_radians(), place };
        let sigmas = [
            ("initial_sigma.rotation", ROTATION_SIGMA, rotation_sigma),
            ("initial_sigma.place", CENTER_SIGMA, center_sigma),
            ("up_sigma", UP_SIGMA, up_sigma),
            ("near_sigma", NEAR_SIGMA, near_sigma),
        ];
        let mut given = prior::Prior::default();
        let named = |error| as_given(error, &sigmas);
        if let Some((rotation, translation)) = initial {
            let sigma = rotation_sigma.zip(center_sigma).map(rough);
            given = given.with_initial(pose(&rotation, &translation)?, sigma).map_err(named)?;
        }
        if let Some(up) = up {
            given = given.with_up(vector("up", up)?, up_sigma.map(f64::to_radians)).map_err(named)?;
        }
        if let Some(place) = camera_near {
            given = given.with_near(vector("camera_near", place)?, near_sigma).map_err(named)?;
        }
        Ok(Self(given))
    }

    /// Standard deviation of the camera's place, meters, the conventional one where none was given; None without a
    /// place.
    #[getter]
    fn camera_near_sigma_m(&self) -> Option<f64> {
        self.0.place().map(|(_, sigma)| sigma)
    }

    /// Penalty of a pose with this covariance (6, 6) of its left increment, in variances.
    fn penalty(
        &self,
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
    ) -> PyResult<f64> {
        Ok(self.0.penalty(&pose(rotation, translation)?, &self::covariance(covariance)?))
    }

    /// Its Gaussian factor on the left increment x from a pose, exp(vector . x - x . information x / 2): information (6, 6) and
    /// vector (6,).
    fn gaussian<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<GaussianArrays<'py>> {
        let factor = self.0.gaussian(&pose(rotation, translation)?);
        Ok((
            matrix(py, factor.information.iter().copied().collect(), [6, 6])?,
            PyArray1::from_slice(py, factor.information_vector.as_slice()),
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

/// Refuses one of both deviations of the initial pose.
fn check_both(rotation: Option<&Bound<'_, PyAny>>, center: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
    let [here, missing] = match (rotation, center) {
        (Some(_), None) => [ROTATION_SIGMA, CENTER_SIGMA],
        (None, Some(_)) => [CENTER_SIGMA, ROTATION_SIGMA],
        _ => return Ok(()),
    };
    Err(PyValueError::new_err(format!("{here} is given without {missing}; it needs both or neither")))
}

/// Errors of the crate, with the names and in the units of the arguments.
fn as_given(error: Error, sigmas: &[(&str, &str, Option<f64>)]) -> PyErr {
    let Error::InvalidPrior { item, .. } = &error else { return value_error(error) };
    match sigmas.iter().find(|(field, ..)| field == item) {
        Some((_, name, Some(value))) => {
            PyValueError::new_err(format!("{name} holds {value}; it needs positive numbers"))
        }
        _ => value_error(error),
    }
}
