//! Contours in pixels: pieces of observed ones, edges of projected ones.

use nalgebra::Vector2;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::Error;
use regionpose::internals::contour::pieces::{Piece, pieces_by_ring};
use regionpose::internals::geometry::edge_field::EdgeField;

use crate::arrays::{array, finite_points, value_error};

/// Means (m, 2) of equally long parts of closed rings (n, 2) in pixels, ring by ring (`docs/math.md`, eq. 11.1).
///
/// `on_border`: for each ring which of the edges that start at its vertices lie on the image's border, (n,) bool; parts that
/// touch one are left out. ValueError for no rings, one with fewer than 3 vertices or a value that is not finite, and for
/// `on_border` that does not belong to them.
#[pyfunction]
pub fn contour_pieces<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    on_border: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
    let given = closed_rings(rings)?;
    let marks = edge_marks(on_border, &given)?;
    let pieces = py.detach(|| pieces_by_ring(&given, &marks, 1.0));
    let means = |ring: &Vec<Piece>| ring.iter().map(|piece| piece.mean).collect::<Vec<_>>();
    pieces.iter().map(|ring| array(py, &means(ring))).collect()
}

/// Index (m,) of the edge of closed rings (n, 2) that is nearest to each of the points (m, 2), edges counted ring after ring
/// from the one that starts at the first vertex.
///
/// ValueError for rings as of `contour_pieces`, and for points that are not finite.
#[pyfunction]
pub fn nearest_edges<'py>(
    py: Python<'py>,
    rings: &Bound<'py, PyAny>,
    points: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let (given, points) = (closed_rings(rings)?, finite_points::<2>("points", points)?);
    let nearest = || {
        let field = EdgeField::new(&given);
        points.iter().map(|point| field.nearest_edge(point) as i64).collect()
    };
    Ok(PyArray1::from_vec(py, py.detach(nearest)))
}

/// Rings that have edges; whether these cross does not matter.
fn closed_rings(object: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<Vector2<f64>>>> {
    let list = object.try_iter().map_err(|_| PyValueError::new_err("rings need to be a list of arrays"))?;
    let rings: Vec<_> =
        list.enumerate().map(|(k, ring)| finite_points(&format!("ring {k}"), &ring?)).collect::<PyResult<_>>()?;
    match rings.iter().position(|ring| ring.len() < 3) {
        Some(ring) => Err(value_error(Error::TooFewVertices { ring, found: rings[ring].len() })),
        None if rings.is_empty() => Err(value_error(Error::NoRings)),
        None => Ok(rings),
    }
}

/// A mark for each edge of each ring.
fn edge_marks(object: &Bound<'_, PyAny>, rings: &[Vec<Vector2<f64>>]) -> PyResult<Vec<Vec<bool>>> {
    let list = object.try_iter().map_err(|_| PyValueError::new_err("on_border needs to be a list of arrays"))?;
    let given: Vec<_> = list.collect::<PyResult<_>>()?;
    if given.len() != rings.len() {
        let (found, needed) = (given.len(), rings.len());
        return Err(PyValueError::new_err(format!(
            "on_border has {found} arrays; it needs one for each ring, {needed}"
        )));
    }
    given.iter().zip(rings).enumerate().map(|(k, (marks, ring))| ring_marks(k, marks, ring.len())).collect()
}

fn ring_marks(index: usize, object: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<bool>> {
    match object.extract::<PyReadonlyArray1<'_, bool>>() {
        Ok(marks) if marks.len() == count => Ok(marks.as_array().iter().copied().collect()),
        _ => Err(PyValueError::new_err(format!("on_border {index} needs to be a ({count},) array of bool"))),
    }
}
