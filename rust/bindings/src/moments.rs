//! Moments of regions.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::moments::{self, MAX_ORDER, PlaneMoments, SphereMoments};
use regionpose::bearing_rings::BearingRings;
use regionpose::rings::PlaneRings;

use crate::arrays::{numbers, points, value_error};

fn checked_order(order: i64) -> PyResult<usize> {
    usize::try_from(order).ok().filter(|&order| order <= MAX_ORDER).ok_or_else(|| {
        PyValueError::new_err(format!("order is {order}; it needs to be 0 to {MAX_ORDER}"))
    })
}

fn checked_indices(triangles: &[[usize; 3]], vertices: usize) -> PyResult<()> {
    match triangles.iter().flatten().max() {
        Some(&index) if index >= vertices => Err(PyValueError::new_err(format!(
            "triangles hold vertex {index}; indices need to be below the number of vertices, {vertices}"
        ))),
        _ => Ok(()),
    }
}

fn plane_array<'py>(py: Python<'py>, moments: &PlaneMoments) -> Bound<'py, PyArray2<f64>> {
    let order = moments.order();
    let rows: Vec<Vec<f64>> = (0..=order)
        .map(|i| (0..=order).map(|j| if i + j <= order { moments.get(i, j) } else { f64::NAN }).collect())
        .collect();
    PyArray2::from_vec2(py, &rows).expect("rows of one length")
}

fn sphere_array<'py>(py: Python<'py>, moments: &SphereMoments) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let n = moments.order() + 1;
    let mut values = vec![f64::NAN; n * n * n];
    for l in 0..n {
        for m in 0..n - l {
            for k in 0..n - l - m {
                values[(l * n + m) * n + k] = moments.get(l, m, k);
            }
        }
    }
    PyArray1::from_vec(py, values).reshape([n, n, n])
}

/// Moments of a planar region from its boundary.
#[pyfunction]
pub fn planar_moments<'py>(py: Python<'py>, rings: &Bound<'py, PyAny>, order: i64) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (given, order) = (crate::arrays::rings::<2>(rings)?, checked_order(order)?);
    let moments = py.detach(|| {
        PlaneRings::new(given).map(|valid| moments::plane::planar_moments(valid.rings().iter().map(Vec::as_slice), order))
    });
    Ok(plane_array(py, &moments.map_err(value_error)?))
}

/// Moments of a region of the unit sphere from its boundary.
#[pyfunction]
#[pyo3(name = "spherical_moments")]
pub fn spherical_moments<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    order: i64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (given, order) = (crate::arrays::rings::<3>(rings)?, checked_order(order)?);
    let moments = py.detach(|| {
        BearingRings::new(&given).map(|valid| moments::sphere::spherical_moments(valid.rings().iter().map(Vec::as_slice), order))
    });
    sphere_array(py, &moments.map_err(value_error)?)
}

/// Moments of a triangulated planar region by the paper's recursion.
#[pyfunction]
pub fn mesh_planar_moments<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    order: i64,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (vertices, triangles) = (points::<2>("vertices", vertices)?, crate::arrays::triangles(triangles)?);
    let order = checked_order(order)?;
    checked_indices(&triangles, vertices.len())?;
    let moments = py.detach(|| moments::mesh::mesh_plane_moments(&vertices, &triangles, order));
    Ok(plane_array(py, &moments))
}

/// Moments on the unit sphere of triangles seen from the origin, by quadrature.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, order, *, subdivision = 4))]
pub fn mesh_spherical_moments<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    order: i64,
    subdivision: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (vertices, triangles) = (points::<3>("vertices", vertices)?, crate::arrays::triangles(triangles)?);
    let order = checked_order(order)?;
    checked_indices(&triangles, vertices.len())?;
    if !(1..=256).contains(&subdivision) {
        return Err(PyValueError::new_err(format!("subdivision is {subdivision}; it needs to be 1 to 256")));
    }
    let moments = py.detach(|| moments::mesh::mesh_sphere_moments(&vertices, &triangles, order, subdivision));
    sphere_array(py, &moments)
}

/// Sum over pixels of the monomials of their bearings times their solid angles.
#[pyfunction]
pub fn pixel_moments<'py>(
    py: Python<'py>,
    bearings: &Bound<'py, PyAny>,
    solid_angles: &Bound<'py, PyAny>,
    order: i64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (bearings, solid_angles) = (points::<3>("bearings", bearings)?, numbers("solid_angles", solid_angles)?);
    let order = checked_order(order)?;
    if bearings.len() != solid_angles.len() {
        let (n, m) = (bearings.len(), solid_angles.len());
        return Err(PyValueError::new_err(format!("bearings has {n} rows and solid_angles {m}; they need to be as many")));
    }
    let moments = py.detach(|| moments::pixels::pixel_moments(&bearings, &solid_angles, order));
    sphere_array(py, &moments)
}
