//! Moments of regions.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::view::bearing_rings::BearingRings;
use regionpose::moments::{self, MAX_ORDER, PlaneMoments, SphereMoments};

use crate::arrays::{finite_points, numbers, scalar, value_error};

fn checked_order(order: &Bound<'_, PyAny>) -> PyResult<usize> {
    let order: i64 = scalar("order", order, &format!("a whole number from 0 to {MAX_ORDER}"))?;
    usize::try_from(order)
        .ok()
        .filter(|&order| order <= MAX_ORDER)
        .ok_or_else(|| PyValueError::new_err(format!("order is {order}; it needs to be 0 to {MAX_ORDER}")))
}

fn plane_array<'py>(py: Python<'py>, moments: &PlaneMoments) -> Bound<'py, PyArray2<f64>> {
    let order = moments.order();
    let rows: Vec<Vec<f64>> = (0..=order)
        .map(|i| (0..=order).map(|j| if i + j <= order { moments.get(i, j) } else { 0.0 }).collect())
        .collect();
    PyArray2::from_vec2(py, &rows).expect("rows of one length")
}

fn sphere_array<'py>(py: Python<'py>, moments: &SphereMoments) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let n = moments.order() + 1;
    let mut values = vec![0.0; n * n * n];
    for l in 0..n {
        for m in 0..n - l {
            for k in 0..n - l - m {
                values[(l * n + m) * n + k] = moments.get(l, m, k);
            }
        }
    }
    PyArray1::from_vec(py, values).reshape([n, n, n])
}

/// Moments of a planar region, (order + 1, order + 1): entry `[i, j]` is the integral of `x^i y^j` over the region.
///
/// A sum over the boundary's edges (`docs/math.md`, section 2), exact up to rounding. Entries with `i + j > order` are
/// 0.
///
/// `rings`: list of (n, 2) arrays of vertices, in any order and turning either way: a ring inside an odd number of
/// others is a hole, and the region's area `[0, 0]` is positive. `order`: 0 to 8. The unit of `[i, j]` is the vertices'
/// to the power `i + j + 2`.
///
/// ValueError for an order out of range, and for rings with coordinates that are not finite, fewer than 3 distinct
/// vertices, no area, or edges that cross, overlap or touch within one ring; the message names ring and edge.
#[pyfunction]
pub fn planar_moments<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    order: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (given, order) = (crate::arrays::rings::<2>(rings)?, checked_order(order)?);
    let moments = py.detach(|| {
        PlaneRings::new(given)
            .map(|valid| moments::plane::planar_moments(valid.rings().iter().map(Vec::as_slice), order))
    });
    Ok(plane_array(py, &moments.map_err(value_error)?))
}

/// Moments of a region of the unit sphere, (order + 1,) * 3: entry `[l, m, n]` is the integral of `x^l y^m z^n` over
/// it.
///
/// A sum over the boundary's great-circle arcs by Gauss-Legendre rules, and the solid angle by triangles (Van Oosterom
/// and Strackee 1983); `docs/math.md`, section 3. Entries with `l + m + n > order` are 0. No unit; `[0, 0, 0]` in
/// steradians.
///
/// `rings`: list of (n, 3) arrays of directions of any length, joined by great-circle arcs under 180 deg, in any order
/// and turning either way: a ring inside an odd number of others is a hole, and the solid angle is positive. The region
/// is the side that fits an open half space. `order`: 0 to 8.
///
/// ValueError for an order out of range, and for rings with directions that are zero or not finite, that do not fit a
/// half space, with fewer than 3 distinct vertices, no area, or arcs that cross, overlap or touch within one ring.
#[pyfunction]
pub fn spherical_moments<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    order: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (given, order) = (crate::arrays::rings::<3>(rings)?, checked_order(order)?);
    let moments = py.detach(|| {
        BearingRings::new(&given)
            .map(|valid| moments::sphere::spherical_moments(valid.rings().iter().map(Vec::as_slice), order))
    });
    sphere_array(py, &moments.map_err(value_error)?)
}

/// Moments of a triangulated planar region, (order + 1, order + 1), as of `planar_moments`: the sum of its triangles'.
///
/// By the recursion of the paper's section 2.2 (eq. 16 to 24), exact up to rounding; a triangle that turns clockwise
/// counts negative. `vertices`: (v, 2), `triangles`: (k, 3) indices. ValueError for vertices that are not finite,
/// indices out of range, or an order that is not 0 to 8.
#[pyfunction]
pub fn mesh_planar_moments<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    order: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (vertices, triangles) = (finite_points::<2>("vertices", vertices)?, crate::arrays::triangles(triangles)?);
    let order = checked_order(order)?;
    let moments = py.detach(|| moments::mesh::mesh_plane_moments(&vertices, &triangles, order));
    Ok(plane_array(py, &moments.map_err(value_error)?))
}

/// Moments on the unit sphere of triangles seen from the origin, (order + 1,) * 3, as of `spherical_moments`.
///
/// The sum over triangles of a 7-point rule of degree 5 on `subdivision^2` equal pieces of each (paper section 2.1, eq.
/// 10); the error falls with the sixth power of the pieces' size. A triangle that turns clockwise seen from the far
/// side counts negative. `vertices`: (v, 3), `triangles`: (k, 3) indices, `subdivision`: 1 to 256. ValueError for
/// vertices that are not finite, indices out of range, or an order that is not 0 to 8.
#[pyfunction]
#[pyo3(signature = (vertices, triangles, order, *, subdivision = 4))]
pub fn mesh_spherical_moments<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    order: &Bound<'py, PyAny>,
    subdivision: usize,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (vertices, triangles) = (finite_points::<3>("vertices", vertices)?, crate::arrays::triangles(triangles)?);
    let order = checked_order(order)?;
    if !(1..=256).contains(&subdivision) {
        return Err(PyValueError::new_err(format!("subdivision is {subdivision}; it needs to be 1 to 256")));
    }
    let moments = py.detach(|| moments::mesh::mesh_sphere_moments(&vertices, &triangles, order, subdivision));
    sphere_array(py, &moments.map_err(value_error)?)
}

/// Moments of a mask on the unit sphere, (order + 1,) * 3: the sum over its pixels of `x^l y^m z^n` times solid angle.
///
/// The pixel-wise scheme of the paper's section 2 (eq. 6, 7); the error falls with the square of a pixel's angular
/// size. `bearings`: (n, 3) unit vectors, `solid_angles`: (n,) steradians. ValueError for values that are not finite,
/// lists of unequal length, or an order that is not 0 to 8.
#[pyfunction]
pub fn pixel_moments<'py>(
    py: Python<'py>,
    bearings: &Bound<'py, PyAny>,
    solid_angles: &Bound<'py, PyAny>,
    order: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (bearings, solid_angles) = (finite_points::<3>("bearings", bearings)?, numbers("solid_angles", solid_angles)?);
    let order = checked_order(order)?;
    if bearings.len() != solid_angles.len() {
        let (n, m) = (bearings.len(), solid_angles.len());
        return Err(PyValueError::new_err(format!(
            "bearings has {n} rows and solid_angles {m}; they need to be as many"
        )));
    }
    if let Some(index) = solid_angles.iter().position(|value| !value.is_finite()) {
        return Err(PyValueError::new_err(format!(
            "solid_angles {index} is not finite; it needs to be a finite number"
        )));
    }
    let moments = py.detach(|| moments::pixels::pixel_moments(&bearings, &solid_angles, order));
    sphere_array(py, &moments.map_err(value_error)?)
}

/// Solid angles (n,) of quadrilaterals, steradians, from the bearings of their corners in turn, rows four by four (4 n,
/// 3).
///
/// Two spherical triangles each (Van Oosterom and Strackee 1983), positive when the corners turn from x towards y.
/// ValueError for rows that are not finite or no multiple of four.
#[pyfunction]
pub fn quad_solid_angles<'py>(py: Python<'py>, corners: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let corners = finite_points::<3>("corners", corners)?;
    let quads: Vec<_> = corners.as_chunks::<4>().0.to_vec();
    if quads.len() * 4 != corners.len() {
        return Err(PyValueError::new_err(format!(
            "corners has {} rows; it needs four a quadrilateral",
            corners.len()
        )));
    }
    Ok(PyArray1::from_vec(py, py.detach(|| moments::pixels::quad_solid_angles(&quads))))
}
