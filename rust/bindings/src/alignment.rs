//! Checks and preparation of clouds and photos for edge alignment.

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::internals::alignment::blur;

use crate::arrays::numbers;

/// One shade of each of so many points, if there are any.
pub fn shades_of(shades: Option<PyReadonlyArray1<'_, f64>>, points: usize) -> PyResult<Option<Vec<f64>>> {
    let shades: Option<Vec<f64>> = shades.map(|shades| shades.as_array().iter().copied().collect());
    match shades.as_ref().map(Vec::len).filter(|count| *count != points) {
        Some(count) => {
            let refused = format!("shades has {count} values for {points} points; it needs one a point");
            Err(PyValueError::new_err(refused))
        }
        None => Ok(shades),
    }
}

/// Refuses angles that cells cannot be counted by.
pub fn check_angles(cell: f64, gap: f64) -> PyResult<()> {
    for (name, value) in [("cell", cell), ("gap", gap)] {
        // Cells are counted in 32 bits.
        if !(value.is_finite() && value > 1e-8) {
            return Err(PyValueError::new_err(format!("{name} is {value}; it needs to be above 1e-8 rad")));
        }
    }
    Ok(())
}

/// A picture (h, w) float32 spread down its columns and then along its rows; mirrored beyond its sides.
///
/// `weights` (r + 1,): of the pixel itself, and of those that are 1 to r pixels away to either side. ValueError for a picture that is not
/// contiguous.
#[pyfunction]
pub fn blurred<'py>(
    py: Python<'py>,
    picture: PyReadonlyArray2<'py, f32>,
    weights: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let values = picture.as_slice().map_err(|_| PyValueError::new_err("picture is not contiguous"))?;
    let &[rows, columns] = picture.shape() else { unreachable!("two axes by its type") };
    // The interpreter's lock is kept: nothing else may write into the picture, which is not copied.
    PyArray1::from_vec(py, blur::blurred(values, columns, &numbers("weights", weights)?)).reshape([rows, columns])
}
