//! Depth steps and how far they lie on a photo's edges.

use nalgebra::{Matrix2x3, Vector2};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::witness::agreement::{EdgeStrength, SeenStep};
use regionpose::witness::steps;

use crate::arrays::{array, points};

type StepArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// Unit bearings (m, 3) of the last samples of near surfaces before far ones, and of their neighbours beyond.
///
/// `points` (n, 3) relative to the camera's centre, metres, in any axes; those that are not finite are left out. `cell`, rad: of
/// points whose bearings differ by less the nearest hides the others. `gap`, rad: neighbours farther apart are none.
/// `share`: how far a step goes beyond the plane of the near side, as a share of the inverse distance. ValueError for
/// another shape, and a cell or gap that is not positive.
#[pyfunction]
pub fn depth_steps<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    cell: f64,
    gap: f64,
    share: f64,
) -> PyResult<StepArrays<'py>> {
    for (name, value) in [("cell", cell), ("gap", gap)] {
        // Cells are counted in 32 bits.
        if !(value.is_finite() && value > 1e-8) {
            return Err(PyValueError::new_err(format!("{name} is {value}; it needs to be above 1e-8 rad")));
        }
    }
    let points = self::points::<3>("points", points)?;
    let found = py.detach(|| steps::depth_steps(&points, cell, gap, share));
    let (near, far): (Vec<_>, Vec<_>) = found.into_iter().map(|step| (step.near, step.far)).unzip();
    Ok((array(py, &near)?, array(py, &far)?))
}

/// Mean strength (t,) of a photo's edges under depth steps, for the camera turned by each of some rotation vectors.
///
/// `strength` (k, h, w) float32: pictures of edges across k directions. `pixels` (n, 2), and `moved` (n, 6): how turning the
/// camera about its x, y and z axis moves x, then y, pixels a radian. `directions` (n,): the picture of each step. `turns` (t, 3),
/// rad. ValueError for other shapes, and no pixels.
#[pyfunction]
pub fn edge_agreement<'py>(
    py: Python<'py>,
    strength: PyReadonlyArray3<'py, f32>,
    pixels: &Bound<'py, PyAny>,
    moved: &Bound<'py, PyAny>,
    directions: PyReadonlyArray1<'py, i64>,
    turns: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let &[_, rows, columns] = strength.shape() else { unreachable!("three axes by its type") };
    let (pixels, turns) = (points::<2>("pixels", pixels)?, points::<3>("turns", turns)?);
    let moved = points::<6>("moved", moved)?;
    let directions: Vec<i64> = directions.as_array().iter().copied().collect();
    if moved.len() != pixels.len() || directions.len() != pixels.len() {
        let found = [pixels.len(), moved.len(), directions.len()];
        return Err(PyValueError::new_err(format!(
            "pixels, moved and directions have {found:?} rows; they need the same"
        )));
    }
    let values = strength.as_slice().map_err(|_| PyValueError::new_err("strength is not contiguous"))?;
    let refused = || PyValueError::new_err("strength has no pixels; it needs to be (k, h, w)");
    let strength = EdgeStrength::new(values, rows, columns).ok_or_else(refused)?;
    let items = pixels.iter().zip(&moved).zip(directions);
    let steps: Vec<SeenStep> = items
        .map(|((pixel, moved), direction)| SeenStep {
            pixel: Vector2::new(pixel[0], pixel[1]),
            moved: Matrix2x3::from_row_slice(moved.as_slice()),
            direction: usize::try_from(direction).unwrap_or(usize::MAX),
        })
        .collect();
    // The interpreter's lock is kept: nothing else may write into the pictures, which are not copied.
    Ok(PyArray1::from_vec(py, strength.means(&steps, &turns)))
}
