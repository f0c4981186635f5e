//! Arrays in and out: shapes checked with the item's name.

use nalgebra::{Matrix3, Matrix6, SVector, Vector3};
use numpy::ndarray::Dimension;
use numpy::{PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::Error;
use regionpose::internals::geometry::pose::{Pose, Tangent};

/// A core error as Python's `ValueError`.
pub fn value_error(error: Error) -> PyErr {
    PyValueError::new_err(error.to_string())
}

fn real_array<'py>(item: &str, object: &Bound<'py, PyAny>, needed: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    if let Ok(array) = object.extract() {
        return Ok(array);
    }
    let refused = |found: &str| PyValueError::new_err(format!("{item} is {found}; it needs to be {needed}"));
    let other = || refused(&format!("a {} that is not an array of real numbers", kind_of(object)));
    let array = object.py().import("numpy")?.call_method1("asarray", (object,)).map_err(|_| other())?;
    let dtype = array.getattr("dtype")?;
    // Text, dates, complex numbers and objects would be converted, more or less, in silence.
    if !matches!(dtype.getattr("kind")?.extract()?, 'i' | 'u' | 'f') {
        return Err(refused(&format!("an array of type {dtype}")));
    }
    array.call_method1("astype", ("float64",))?.extract()
}

fn kind_of(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "object".into(), |name| name.to_string())
}

/// One of Python's values as this type, refused with the item's name.
pub fn scalar<'a, 'py, T: FromPyObject<'a, 'py>>(
    item: &str,
    object: &'a Bound<'py, PyAny>,
    needed: &str,
) -> PyResult<T> {
    object
        .extract()
        .map_err(|_| PyValueError::new_err(format!("{item} is a {}; it needs to be {needed}", kind_of(object))))
}

/// The same of a value that may be `None`.
pub fn optional<'a, 'py, T: FromPyObject<'a, 'py>>(
    item: &str,
    object: Option<&'a Bound<'py, PyAny>>,
    needed: &str,
) -> PyResult<Option<T>> {
    object.map(|object| scalar(item, object, needed)).transpose()
}

/// Rows of an (n, D) array.
pub fn points<const D: usize>(item: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<SVector<f64, D>>> {
    with_points(item, object, |rows| Ok(rows.iter().map(|row| SVector::from(*row)).collect()))
}

/// What is made of the rows of an (n, D) array, which are read in place where they follow one another in memory.
pub fn with_points<const D: usize, Made>(
    item: &str,
    object: &Bound<'_, PyAny>,
    make: impl FnOnce(&[[f64; D]]) -> PyResult<Made>,
) -> PyResult<Made> {
    let needed = format!("an (n, {D}) array");
    let array = real_array(item, object, &needed)?;
    if array.ndim() != 2 || array.shape()[1] != D {
        let found = array.shape();
        return Err(PyValueError::new_err(format!("{item} has shape {found:?}; it needs to be {needed}")));
    }
    let view = array.as_array();
    match view.as_slice() {
        Some(values) => make(values.as_chunks().0),
        None => make(view.iter().copied().collect::<Vec<f64>>().as_chunks().0),
    }
}

/// Rows of an (n, D) array, refused where one is not finite.
pub fn finite_points<const D: usize>(item: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<SVector<f64, D>>> {
    let rows = points::<D>(item, object)?;
    match rows.iter().position(|row| row.iter().any(|value| !value.is_finite())) {
        Some(index) => Err(PyValueError::new_err(format!("{item} row {index} is not finite; it needs finite numbers"))),
        None => Ok(rows),
    }
}

/// Each ring's rows.
pub fn rings<const D: usize>(object: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<SVector<f64, D>>>> {
    let list = object.try_iter().map_err(|_| PyValueError::new_err("rings need to be a list of arrays"))?;
    list.enumerate().map(|(k, ring)| points(&format!("ring {k}"), &ring?)).collect()
}

/// Rows of a (k, 3) array of indices.
pub fn triangles(object: &Bound<'_, PyAny>) -> PyResult<Vec<[usize; 3]>> {
    let rows = points::<3>("triangles", object)?;
    let index = |value: f64| {
        let whole = value >= 0.0 && value.fract() == 0.0 && value <= u32::MAX as f64;
        whole.then_some(value as usize).ok_or_else(|| {
            PyValueError::new_err(format!("triangles hold {value}; vertex indices need to be whole numbers from 0"))
        })
    };
    rows.iter().map(|row| Ok([index(row[0])?, index(row[1])?, index(row[2])?])).collect()
}

/// A list of numbers.
pub fn numbers(item: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = real_array(item, object, "an (n,) array")?;
    if array.ndim() != 1 {
        return Err(PyValueError::new_err(format!("{item} has shape {:?}; it needs to be (n,)", array.shape())));
    }
    Ok(array.as_array().iter().copied().collect())
}

/// A vector of three finite numbers.
pub fn vector(item: &str, object: &Bound<'_, PyAny>) -> PyResult<Vector3<f64>> {
    let values = numbers(item, object)?;
    if values.len() != 3 || values.iter().any(|value| !value.is_finite()) {
        return Err(PyValueError::new_err(format!("{item} is {values:?}; it needs to be 3 finite numbers")));
    }
    Ok(Vector3::from_column_slice(&values))
}

/// A pose from a (3, 3) rotation and a (3,) translation.
pub fn pose(rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let rows = points::<3>("rotation", rotation)?;
    if rows.len() != 3 {
        return Err(PyValueError::new_err(format!("rotation has {} rows; it needs to be a (3, 3) array", rows.len())));
    }
    let matrix = Matrix3::from_columns(&rows).transpose();
    Pose::from_matrix(&matrix, vector("translation", translation)?).map_err(value_error)
}

/// A left increment (6,) of a pose.
pub fn tangent(increment: &Bound<'_, PyAny>) -> PyResult<Tangent> {
    let values = numbers("increment", increment)?;
    if values.len() != 6 {
        return Err(PyValueError::new_err(format!("increment has {} entries; it needs to have 6", values.len())));
    }
    Ok(Tangent::from_column_slice(&values))
}

/// The covariance (6, 6) of a pose's left increment.
pub fn covariance(object: &Bound<'_, PyAny>) -> PyResult<Matrix6<f64>> {
    let rows = points::<6>("covariance", object)?;
    if rows.len() != 6 {
        return Err(PyValueError::new_err(format!("covariance has {} rows; it needs to be (6, 6)", rows.len())));
    }
    Ok(Matrix6::from_columns(&rows))
}

/// An (n, D) array.
pub fn array<'py, const D: usize>(py: Python<'py>, rows: &[SVector<f64, D>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let mut values = Vec::with_capacity(D * rows.len());
    rows.iter().for_each(|row| values.extend_from_slice(row.as_slice()));
    PyArray1::from_vec(py, values).reshape([rows.len(), D])
}

/// An array of the given rows and columns from values row by row.
pub fn matrix<'py>(py: Python<'py>, values: Vec<f64>, shape: [usize; 2]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// A read-only (n,) array, so that an answer can keep it without a copy.
pub fn read_only<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    kept(PyArray1::from_slice(py, values))
}

/// The array, made read-only.
pub fn kept<'py, D: Dimension>(array: Bound<'py, PyArray<f64, D>>) -> Bound<'py, PyArray<f64, D>> {
    array.readwrite().make_nonwriteable();
    array
}

/// A (3, 3) array of a rotation.
pub fn rotation<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    matrix(py, pose.rotation.matrix().transpose().iter().copied().collect(), [3, 3])
}

/// A (3,) array.
pub fn translation<'py>(py: Python<'py>, pose: &Pose) -> Bound<'py, PyArray1<f64>> {
    PyArray1::from_slice(py, pose.translation.as_slice())
}
