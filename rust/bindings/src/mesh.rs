//! Rings, meshes and outlines in the plane.

use nalgebra::SVector;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::mesh::alpha_shape as outline;
use regionpose::mesh::even_mesh as even;
use regionpose::mesh::triangulation::{self, MeshOptions, PlaneMesh};
use regionpose::rings::PlaneRings;

use crate::arrays::{array, points, value_error};

type MeshArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

fn mesh_arrays<'py>(py: Python<'py>, mesh: &PlaneMesh) -> PyResult<MeshArrays<'py>> {
    let indices: Vec<i64> = mesh.triangles.iter().flatten().map(|&index| index as i64).collect();
    Ok((array(py, &mesh.vertices)?, PyArray1::from_vec(py, indices).reshape([mesh.triangles.len(), 3])?))
}

/// Arrays of rings.
pub fn ring_arrays<'py, const D: usize>(
    py: Python<'py>,
    rings: &[Vec<SVector<f64, D>>],
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    rings.iter().map(|ring| array(py, ring)).collect()
}

/// Rings checked and oriented; with `polygon`, every ring after the first has to be a hole in it.
#[pyfunction]
#[pyo3(signature = (rings, *, polygon = true))]
pub fn plane_rings<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    polygon: bool,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let valid = py.detach(|| if polygon { PlaneRings::polygon(given) } else { PlaneRings::new(given) });
    ring_arrays(py, valid.map_err(value_error)?.rings())
}

/// Constrained Delaunay triangulation of a region.
#[pyfunction]
#[pyo3(signature = (rings, *, max_area = None, min_angle = None))]
pub fn triangulate<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    max_area: Option<f64>,
    min_angle: Option<f64>,
) -> PyResult<MeshArrays<'py>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let options = MeshOptions { max_area, min_angle };
    let mesh = py.detach(|| PlaneRings::new(given).and_then(|rings| triangulation::triangulate(&rings, options)));
    mesh_arrays(py, &mesh.map_err(value_error)?)
}

/// Mesh of triangles of nearly one size and shape.
#[pyfunction]
pub fn even_mesh<'py>(py: Python<'py>, rings: &Bound<'py, PyAny>, edge_length: f64) -> PyResult<MeshArrays<'py>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let mesh = py.detach(|| PlaneRings::new(given).and_then(|rings| even::even_mesh(&rings, edge_length)));
    mesh_arrays(py, &mesh.map_err(value_error)?)
}

/// Outline of a point set.
#[pyfunction]
pub fn alpha_shape<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    radius: f64,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let given = self::points::<2>("points", points)?;
    if radius.is_nan() {
        return Err(PyValueError::new_err("radius is NaN; it needs to be a positive number"));
    }
    let rings = py.detach(|| outline::alpha_shape(&given, radius));
    ring_arrays(py, rings.map_err(value_error)?.rings())
}
