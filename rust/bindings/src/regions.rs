//! The two sides of a region.

use nalgebra::Vector2;
use numpy::ndarray::ArrayView1;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::region::robust_plane::robust_plane as plane_of_most;
use regionpose::internals::region::samples::Samples;
use regionpose::internals::region::{self, Pixels, PlaneFrame};

use crate::arrays::{array, finite_points, numbers, points, rings, triangles, value_error, vector};
use crate::interrupts::detached;
use crate::mesh::{MeshArrays, mesh_arrays, ring_arrays};

/// Origin (3,), rows u, v and normal (3, 3), and indices.
type PlaneArrays<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>);

type SampleArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// A region as the camera sees it: rings of bearings, and its area in pixels.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct ObservedRegion(pub region::ObservedRegion);

#[pymethods]
impl ObservedRegion {
    #[new]
    #[pyo3(signature = (
        rings, pixel_area, *, borders = None, hidden = None, pixel_bearings = None, pixel_solid_angles = None
    ))]
    fn new(
        rings: &Bound<'_, PyAny>,
        pixel_area: f64,
        borders: Option<&Bound<'_, PyAny>>,
        hidden: Option<&Bound<'_, PyAny>>,
        pixel_bearings: Option<&Bound<'_, PyAny>>,
        pixel_solid_angles: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let mut observed = region::ObservedRegion::new(self::rings::<3>(rings)?, pixel_area);
        observed.borders = borders.map_or(Ok(Vec::new()), self::rings::<3>)?;
        observed.hidden = hidden.map_or(Ok(Vec::new()), self::rings::<3>)?;
        if let (Some(bearings), Some(solid_angles)) = (pixel_bearings, pixel_solid_angles) {
            let bearings = points::<3>("pixel_bearings", bearings)?;
            let solid_angles = numbers("pixel_solid_angles", solid_angles)?;
            if bearings.len() != solid_angles.len() {
                return Err(PyValueError::new_err("pixel_bearings and pixel_solid_angles need to be as many"));
            }
            observed.pixels = Some(Pixels { bearings, solid_angles });
        }
        Ok(Self(observed))
    }
}

/// A region of the 3D data: planar with holes, or a triangulated open surface.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct WorldRegion(pub region::WorldRegion);

#[pymethods]
impl WorldRegion {
    /// The planar region inside the first ring and outside the others.
    #[staticmethod]
    fn from_rings(py: Python<'_>, rings: &Bound<'_, PyAny>) -> PyResult<Self> {
        let given = self::rings::<3>(rings)?;
        py.detach(|| region::WorldRegion::from_rings(&given)).map(Self).map_err(value_error)
    }

    /// The planar region of rings in a plane's coordinates `origin + u axes[0] + v axes[1]`.
    #[staticmethod]
    fn from_outline(
        py: Python<'_>,
        origin: &Bound<'_, PyAny>,
        axes: &Bound<'_, PyAny>,
        rings: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (origin, axes) = (crate::arrays::vector("origin", origin)?, points::<3>("axes", axes)?);
        let [u, v] = axes[..] else {
            return Err(PyValueError::new_err(format!("axes has {} rows; it needs to be (2, 3)", axes.len())));
        };
        let given = self::rings::<2>(rings)?;
        let made = || {
            let outline = PlaneRings::new(given)?;
            Ok(region::WorldRegion::from_outline(PlaneFrame::new(origin, [u, v, u.cross(&v)])?, outline))
        };
        py.detach(made).map(Self).map_err(value_error)
    }

    /// The region covered by a triangulated open surface.
    #[staticmethod]
    fn from_mesh(py: Python<'_>, vertices: &Bound<'_, PyAny>, triangles: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (vertices, triangles) = (points::<3>("vertices", vertices)?, self::triangles(triangles)?);
        py.detach(|| region::WorldRegion::from_mesh(&vertices, &triangles)).map(Self).map_err(value_error)
    }

    /// The same region of which a viewpoint lies on the side that the camera sees.
    fn with_viewpoint(&self, viewpoint: &Bound<'_, PyAny>) -> PyResult<Self> {
        let viewpoint = crate::arrays::vector("viewpoint", viewpoint)?;
        self.0.clone().seen_from(viewpoint).map(Self).map_err(value_error)
    }

    /// The same region with places (n, 3) inside, (m, 3) outside, and (k, 3) outside that it encloses; `is_line` where they lie on one
    /// line, so that its plane may be any through that line.
    #[pyo3(signature = (inside, outside, enclosed, *, is_line=false))]
    fn with_samples(
        &self,
        py: Python<'_>,
        inside: &Bound<'_, PyAny>,
        outside: &Bound<'_, PyAny>,
        enclosed: &Bound<'_, PyAny>,
        is_line: bool,
    ) -> PyResult<Self> {
        let (inside, outside) = (points::<3>("inside", inside)?, points::<3>("outside", outside)?);
        let enclosed = points::<3>("enclosed", enclosed)?;
        let region = self.0.clone();
        let sampled = || match is_line {
            true => region.with_line_samples(&inside, &outside),
            false => region.with_samples(&inside, &outside),
        };
        py.detach(|| sampled()?.with_enclosed(&enclosed)).map(Self).map_err(value_error)
    }

    /// Whether its samples lie on one line, so that its plane may be any through that line.
    #[getter]
    fn is_line(&self) -> bool {
        self.0.is_line()
    }

    /// Places (n, 3) inside, (m, 3) outside of the region, and (k, 3) outside that it encloses, or None.
    #[getter]
    fn samples<'py>(&self, py: Python<'py>) -> PyResult<Option<SampleArrays<'py>>> {
        let frame = self.0.frame();
        let lifted = |flat: &[Vector2<f64>]| array(py, &flat.iter().map(|p| frame.to_world(p)).collect::<Vec<_>>());
        let arrays = |samples: &Samples| {
            Ok((lifted(samples.inside())?, lifted(samples.outside())?, lifted(samples.enclosed())?))
        };
        self.0.samples().map(arrays).transpose()
    }

    /// The viewpoint, (3,), or None.
    #[getter]
    fn viewpoint<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.viewpoint().map(|viewpoint| PyArray1::from_slice(py, viewpoint.as_slice()))
    }

    /// Boundary rings, each (n, 3).
    #[getter]
    fn rings<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        ring_arrays(py, &self.0.rings())
    }

    /// A point of the plane, (3,).
    #[getter]
    fn origin<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.frame().origin().as_slice())
    }

    /// Rows: the plane's axes u and v and its normal, (3, 3).
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, self.0.frame().axes())
    }

    /// Rings in plane coordinates, each (n, 2), outer ones counter-clockwise.
    #[getter]
    fn outline<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        ring_arrays(py, self.0.outline().rings())
    }

    /// Area in plane coordinates.
    #[getter]
    fn area(&self) -> f64 {
        self.0.outline().area()
    }

    /// Vertices (v, 3) and triangles (k, 3) of a region that is not planar, else None.
    #[getter]
    fn surface<'py>(&self, py: Python<'py>) -> PyResult<Option<MeshArrays<'py>>> {
        let arrays = |surface: &region::Surface| mesh_arrays(py, &surface.vertices, &surface.triangles);
        self.0.surface().map(arrays).transpose()
    }

    /// Whether the region lies in one plane.
    #[getter]
    fn is_planar(&self) -> bool {
        self.0.surface().is_none()
    }
}

/// A plane through most of the points (n, 3): its origin (3,), axes u, v, normal as rows (3, 3), and the inliers' indices.
///
/// Least squares over the points within three standard deviations, from all points or from the plane with the least median distance
/// (Rousseeuw 1984), under whichever the points are likelier. Of points that a sensor at (3,) saw, distances along their beams count.
/// ValueError for points that are not finite, identical, or on one line.
#[pyfunction]
#[pyo3(signature = (points, sensor = None))]
pub fn robust_plane<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    sensor: Option<&Bound<'py, PyAny>>,
) -> PyResult<PlaneArrays<'py>> {
    let given = finite_points::<3>("points", points)?;
    let sensor = sensor.map(|sensor| vector("sensor", sensor)).transpose()?;
    let found = detached(py, |budget| plane_of_most(&given, sensor.as_ref(), budget))?.map_err(value_error)?;
    let inliers = found.inliers.iter().map(|&index| index as i64).collect();
    let origin = PyArray1::from_slice(py, found.frame.origin().as_slice());
    Ok((origin, array(py, found.frame.axes())?, PyArray1::from_vec(py, inliers)))
}

/// Cells of a grid of this shape with points whose normal, with those of the cells around, is within an angle of the third axis, or
/// unknown.
///
/// `points` (n, 3), `cells` (n, 2) int64: the row and column of each. ValueError for cells outside the grid.
#[pyfunction]
pub fn cells_along<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    cells: PyReadonlyArray2<'py, i64>,
    shape: [usize; 2],
    angle_deg: f64,
) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let places = self::points::<3>("points", points)?;
    let rows = cells.as_array();
    let own: Option<Vec<[usize; 2]>> = (0..rows.nrows()).map(|row| cell_within(rows.row(row), shape)).collect();
    let own = own.filter(|own| own.len() == places.len() && rows.ncols() == 2).ok_or_else(|| {
        let found = format!("cells have shape {:?} for {} points", cells.shape(), places.len());
        PyValueError::new_err(format!("{found}; needed (n, 2) rows and columns within {shape:?}"))
    })?;
    let found = py.detach(|| region::cell_normals::cells_along(&places, &own, shape, angle_deg.to_radians()));
    PyArray1::from_vec(py, found).reshape(shape)
}

fn cell_within(row: ArrayView1<'_, i64>, shape: [usize; 2]) -> Option<[usize; 2]> {
    let at = |axis: usize| usize::try_from(*row.get(axis)?).ok().filter(|place| *place < shape[axis]);
    Some([at(0)?, at(1)?])
}
