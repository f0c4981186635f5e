//! Rings, meshes and outlines in the plane.

use nalgebra::SVector;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::mesh as spacing;
use regionpose::mesh::PlaneMesh;
use regionpose::mesh::alpha_shape as outline;
use regionpose::mesh::even_mesh as even;
use regionpose::mesh::triangulation::{self, MeshOptions};

use crate::arrays::{array, matrix, optional, points, scalar, value_error};
use crate::interrupts::detached;

/// Vertices and triangles.
pub type MeshArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

/// Arrays of vertices (v, D) and triangles (k, 3).
pub fn mesh_arrays<'py, const D: usize>(
    py: Python<'py>,
    vertices: &[SVector<f64, D>],
    triangles: &[[usize; 3]],
) -> PyResult<MeshArrays<'py>> {
    let indices: Vec<i64> = triangles.iter().flatten().map(|&index| index as i64).collect();
    Ok((array(py, vertices)?, PyArray1::from_vec(py, indices).reshape([triangles.len(), 3])?))
}

fn plane_mesh_arrays<'py>(py: Python<'py>, mesh: &PlaneMesh) -> PyResult<MeshArrays<'py>> {
    mesh_arrays(py, &mesh.vertices, &mesh.triangles)
}

/// Arrays of rings.
pub fn ring_arrays<'py, const D: usize>(
    py: Python<'py>,
    rings: &[Vec<SVector<f64, D>>],
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    rings.iter().map(|ring| array(py, ring)).collect()
}

/// Rings (n, 2) checked and oriented: outer ones counter-clockwise, holes clockwise, repeated vertices left out.
///
/// With `polygon` the first ring is the outline and every other one has to be a hole in it; without, nesting decides.
/// ValueError as of `planar_moments`, and for a hole outside the outline or inside another hole.
#[pyfunction]
#[pyo3(signature = (rings, *, polygon = true))]
pub fn plane_rings<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    polygon: bool,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let valid = detached(py, |_| if polygon { PlaneRings::polygon(given) } else { PlaneRings::new(given) })?;
    ring_arrays(py, valid.map_err(value_error)?.rings())
}

/// Vertices (v, 2) and triangles (k, 3) of a mesh that covers a planar region: vertex indices, counter-clockwise.
///
/// The constrained Delaunay triangulation of the rings, whose vertices come first and in order; Delaunay refinement
/// (Ruppert 1995) adds vertices until no triangle has more than `max_area`, in the rings' unit squared, or an angle
/// under `min_angle`, in degrees up to 30. Corners of the rings that are sharper stay.
///
/// `rings`: list of (n, 2) arrays, in any order and turning either way, as of `planar_moments`.
///
/// ValueError for rings as of `planar_moments`, an option out of range, or a refinement that needs too many vertices.
#[pyfunction]
#[pyo3(signature = (rings, *, max_area = None, min_angle = None))]
pub fn triangulate<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    max_area: Option<&Bound<'py, PyAny>>,
    min_angle: Option<&Bound<'py, PyAny>>,
) -> PyResult<MeshArrays<'py>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let options = MeshOptions::default()
        .with_max_area(optional::<f64>("max_area", max_area, "a number or None")?)
        .with_min_angle(optional::<f64>("min_angle", min_angle, "a number or None")?);
    let mesh = detached(py, |budget| triangulation::triangulate_within(&PlaneRings::new(given)?, options, budget))?;
    plane_mesh_arrays(py, &mesh.map_err(value_error)?)
}

/// Vertices (v, 2) and triangles (k, 3) of a mesh of a planar region, of nearly one size and shape.
///
/// `edge_length`: the length aimed at, in the rings' unit. ValueError for rings as of `planar_moments` or a length that
/// is out of range.
#[pyfunction]
pub fn even_mesh<'py>(py: Python<'py>, rings: &Bound<'py, PyAny>, edge_length: f64) -> PyResult<MeshArrays<'py>> {
    let given = crate::arrays::rings::<2>(rings)?;
    let mesh = detached(py, |budget| even::even_mesh_within(&PlaneRings::new(given)?, edge_length, budget))?;
    plane_mesh_arrays(py, &mesh.map_err(value_error)?)
}

/// Rings of the outline of points (n, 2): a list of (m, 2) arrays, outer rings counter-clockwise, holes clockwise.
///
/// The boundary of the union of all Delaunay triangles whose circumradius is at most `radius`, in the points' unit: the
/// alpha shape (Edelsbrunner, Kirkpatrick and Seidel 1983). Rings come by decreasing size, each from its leftmost
/// vertex; where parts meet at one point they touch there. An infinite radius gives the convex hull; repeated points
/// count once.
///
/// ValueError for points that are not finite, fewer than 3 distinct or on one line, a radius that is not positive, or
/// one so small that no triangle is left; the message then has the smallest that leaves one.
#[pyfunction]
pub fn alpha_shape<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    radius: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let given = self::points::<2>("points", points)?;
    let radius = scalar("radius", radius, "a positive number")?;
    let rings = detached(py, |budget| outline::alpha_shape_within(&given, radius, budget))?;
    ring_arrays(py, rings.map_err(value_error)?.rings())
}

/// The least length of steps by which 98 % of the points (n, 2), each place once, are reached from one another.
///
/// ValueError for points that are not finite, and for fewer than 2 distinct ones.
#[pyfunction]
pub fn bridging_gap(py: Python<'_>, points: &Bound<'_, PyAny>) -> PyResult<f64> {
    let given = self::points::<2>("points", points)?;
    detached(py, |budget| spacing::bridging_gap(&given, budget))?.map_err(value_error)
}

/// A matrix (2, 2) of determinant 1 such that samples (n, 2) are equally far apart in all directions in `points @ matrix`.
///
/// ValueError for points that are not finite, or on one line.
#[pyfunction]
pub fn even_spacing<'py>(py: Python<'py>, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let given = self::points::<2>("points", points)?;
    let found = detached(py, |budget| spacing::even_spacing(&given, budget))?.map_err(value_error)?;
    matrix(py, found.transpose().iter().copied().collect(), [2, 2])
}
