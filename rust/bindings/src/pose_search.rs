//! The search of a pose by the edges of photos and clouds.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Vector2, Vector3};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::Error;
use regionpose::internals::alignment::cloud_edges::{self, EdgeField, EdgeOptions, SeenPoints};
use regionpose::internals::alignment::density::PoseDensity;
use regionpose::internals::alignment::frame::{FINEST, Frame, PhotoView, SPREADS, SPREADS_PX};
use regionpose::internals::alignment::null_poses;
use regionpose::internals::alignment::pictures::LogRatios;
use regionpose::internals::alignment::posterior::Mode;
use regionpose::internals::alignment::projection;
use regionpose::internals::alignment::search::{self, SearchOptions, SearchProgress};
use regionpose::internals::budget::Budget;

use crate::arrays::{array, covariance, matrix, points, pose, rotation, translation, value_error, vector, with_points};
use crate::interrupts::{detached, watched_threads};
use crate::prior::Prior;

/// The projection of a camera as a table over a cube of bearings.
///
/// `size`: width and height of the image, pixels. `project`: takes bearings (n, 3) to pixels (n, 2), NaN where the camera sees none.
/// ValueError for a camera that sees nothing within its image.
#[pyclass(frozen, module = "regionpose._core")]
pub struct Projection(projection::Projection);

#[pymethods]
impl Projection {
    #[new]
    fn new(py: Python<'_>, size: [f64; 2], project: &Bound<'_, PyAny>) -> PyResult<Self> {
        let pixels = |bearings: &[Vector3<f64>]| -> Result<Vec<Vector2<f64>>, Failure> {
            let found = project.call1((array(py, bearings).map_err(Failure)?,)).map_err(Failure)?;
            let pixels = points::<2>("pixels", &found).map_err(Failure)?;
            if pixels.len() != bearings.len() {
                let found = format!("project gave {} pixels for {} bearings", pixels.len(), bearings.len());
                return Err(Failure(PyValueError::new_err(found)));
            }
            Ok(pixels)
        };
        projection::Projection::new(size, pixels).map(Self).map_err(|Failure(error)| error)
    }

    /// The projection of the same camera with focal lengths multiplied by a factor and its principal point at a pixel (2,).
    fn zoomed(&self, factor: f64, principal: [f64; 2]) -> Self {
        Self(self.0.zoomed(factor, &principal.into()))
    }

    /// Pixels (n, 2) of bearings (n, 3), NaN where the camera sees none.
    fn project<'py>(&self, py: Python<'py>, bearings: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let project = |bearing: &Vector3<f64>| self.0.pixel_of(bearing).unwrap_or(Vector2::repeat(f64::NAN));
        let pixels: Vec<_> = points::<3>("bearings", bearings)?.iter().map(project).collect();
        array(py, &pixels)
    }
}

/// An error of Python's, or the core's as one.
struct Failure(PyErr);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(value_error(error))
    }
}

/// Edges of a cloud in the world, as seen from a place: where surfaces end, and where their shade changes.
///
/// `points` (n, 3), world coordinates, meters; those that are not finite are left out. `place` (3,). `cell`, rad: of points whose
/// bearings differ by less the nearest hides the others. `gap`, rad: neighbors farther apart are none. `step_fraction`: how far an
/// edge goes beyond the plane of the near side, as a fraction of the inverse distance. `shades` (n,) on any scale. `axes` (m, 3) of any
/// length: edges are detected within an `angle`, rad, of one of them; all around for None. ValueError for other shapes, and for axes
/// and angles that are none.
#[pyclass(frozen, module = "regionpose._core")]
pub struct CloudEdges(cloud_edges::CloudEdges);

#[pymethods]
impl CloudEdges {
    #[new]
    #[pyo3(signature = (points, place, cell, gap, step_fraction, shades=None, axes=None, angle=PI))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        place: &Bound<'_, PyAny>,
        cell: f64,
        gap: f64,
        step_fraction: f64,
        shades: Option<PyReadonlyArray1<'_, f64>>,
        axes: Option<&Bound<'_, PyAny>>,
        angle: f64,
    ) -> PyResult<Self> {
        crate::alignment::check_angles(cell, gap)?;
        let field = match axes {
            Some(axes) => EdgeField::cones(&self::points::<3>("axes", axes)?, angle).map_err(value_error)?,
            None => EdgeField::whole(),
        };
        let place = vector("place", place)?;
        // Under the interpreter's lock, so that nothing writes into the points, and only those within the field are copied.
        let seen = with_points::<3, _>("points", points, |points| {
            let shades = crate::alignment::shades_of(shades, points.len())?;
            let places = points.iter().map(|point| Vector3::from(*point));
            Ok(SeenPoints::new(places, shades.as_deref(), &place, &field))
        })?;
        let options = EdgeOptions { cell, gap, step_fraction };
        Ok(Self(py.detach(|| cloud_edges::CloudEdges::of_points(&seen, &options))))
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

/// A photo and the edges of a cloud.
///
/// `half_field`: the largest angle from the camera's axis that the photo shows, rad. `ratios`: for each spread of 16, 8, 4 and 2 pixels a
/// picture (4, h, w) float32 of log likelihood ratios by direction, and over how many pixels it is averaged. `origin` (3,): a place
/// of the world near the scanner. ValueError for other shapes.
#[pyclass(frozen, module = "regionpose._core")]
pub struct AlignmentFrame(Frame);

#[pymethods]
impl AlignmentFrame {
    #[new]
    fn new(
        projection: &Projection,
        half_field: f64,
        ratios: Vec<(PyReadonlyArray3<'_, f32>, usize)>,
        edges: &CloudEdges,
        origin: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let refused =
            || PyValueError::new_err(format!("ratios needs {SPREADS} pictures (4, h, w) with a pixel or more"));
        let pictures: Option<Vec<Arc<LogRatios>>> =
            ratios.iter().map(|(values, reduction)| picture(values, *reduction).map(Arc::new)).collect();
        let pictures: [Arc<LogRatios>; SPREADS] = pictures.and_then(|made| made.try_into().ok()).ok_or_else(refused)?;
        let view = PhotoView { projection: projection.0.clone(), pictures, half_field };
        Ok(Self(Frame::new(view, &edges.0, vector("origin", origin)?)))
    }

    /// The same photo with other edges.
    fn with_edges(&self, edges: &CloudEdges) -> Self {
        Self(self.0.with_edges(&edges.0))
    }

    /// The same photo and edges as another camera has them.
    fn with_projection(&self, projection: &Projection, half_field: f64) -> Self {
        Self(self.0.with_projection(&projection.0, half_field))
    }

    /// The same, which spreads finer than one, by its number, do not make finer; ValueError for another number.
    fn at_spread(&self, spread: usize) -> PyResult<Self> {
        check_spread(spread)?;
        Ok(Self(self.0.at_spread(spread)))
    }

    /// The sum of log likelihood ratios at a pose, by the number of a spread.
    fn log_ratio(
        &self,
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
        spread: usize,
    ) -> PyResult<(f64, usize)> {
        check_spread(spread)?;
        Ok(self.0.log_ratio(&pose(rotation, translation)?, spread, &Budget::unlimited()))
    }

    /// Pixels (n, 2) of the photo at which edges are seen at a pose, and the numbers (n,) of the directions across them.
    fn project_edges<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<EdgeArrays<'py>> {
        let pose = pose(rotation, translation)?;
        let (pixels, directions) = self.0.visible_edges(&pose, SPREADS - 1, &Budget::unlimited()).pixels(&pose);
        let directions = directions.into_iter().map(|direction| direction as i64).collect();
        Ok((array(py, &pixels)?, PyArray1::from_vec(py, directions)))
    }
}

fn check_spread(spread: usize) -> PyResult<()> {
    let refused = || PyValueError::new_err(format!("spread is {spread}; it needs to be below {SPREADS}"));
    if spread < SPREADS { Ok(()) } else { Err(refused()) }
}

type EdgeArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>);

fn picture(values: &PyReadonlyArray3<'_, f32>, reduction: usize) -> Option<LogRatios> {
    let shape = values.shape();
    LogRatios::new(&values.as_array().iter().copied().collect::<Vec<f32>>(), shape[1], shape[2], reduction)
}

/// A density of poses.
#[pyclass(frozen, module = "regionpose._core")]
pub struct Density(PoseDensity);

#[pymethods]
impl Density {
    /// The density of a prior that bounds the camera's place; ValueError for others.
    #[staticmethod]
    fn of_prior(prior: &Prior) -> PyResult<Self> {
        let refused = || PyValueError::new_err("prior has no place of the camera; needed camera_near");
        PoseDensity::of_prior(&prior.0).map(Self).ok_or_else(refused)
    }

    /// Student's about a pose, of a covariance (6, 6) of its left increment; ValueError for what is none.
    #[staticmethod]
    fn student(
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let refused = || PyValueError::new_err("covariance has negative eigenvalues; needed a covariance");
        PoseDensity::student(pose(rotation, translation)?, &self::covariance(covariance)?).map(Self).ok_or_else(refused)
    }

    /// How many of its poses the widest spread of the edges of frames distinguishes.
    fn distinct_poses(&self, py: Python<'_>, frames: Vec<PyRef<'_, AlignmentFrame>>) -> PyResult<f64> {
        let frames = frames_of(&frames);
        detached(py, |budget| search::distinct_poses(&frames, &self.0, None, budget))?.map_err(value_error)
    }

    /// The logarithm of the density at a pose.
    fn log_at(&self, rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<f64> {
        Ok(self.0.at(&pose(rotation, translation)?).value)
    }
}

/// A maximum of the posterior: rotation (3, 3), translation (3,), covariance (6, 6) of the left increment, logarithm of the mass about
/// it, of the likelihood ratio at it, and how many edges are visible.
type ModeArrays<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, f64, f64, usize);

/// The maxima of the posterior of the pose that frames share, of the largest mass first.
///
/// `starts`: poses to refine beside `draws` drawn ones. `kept`: how many of the best at each spread but the finest are refined at
/// the next one. `threads`: all cores for None. `progress`: called with the fraction of the work that is done; an exception that it raises
/// ends the search.
#[pyfunction]
#[pyo3(signature = (frames, density, starts, draws, kept, threads=None, progress=None))]
#[allow(clippy::too_many_arguments)]
pub fn search_poses<'py>(
    py: Python<'py>,
    frames: Vec<PyRef<'py, AlignmentFrame>>,
    density: &Density,
    starts: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>)>,
    draws: usize,
    kept: [usize; FINEST],
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<ModeArrays<'py>>> {
    let frames = frames_of(&frames);
    let starts =
        starts.iter().map(|(rotation, translation)| pose(rotation, translation)).collect::<PyResult<Vec<_>>>()?;
    let options = SearchOptions { draws, kept, threads };
    let done = SearchProgress::default();
    let watch = |py: Python<'_>| progress.as_ref().map_or(Ok(()), |call| call.call1(py, (done.fraction(),)).map(drop));
    let found = watched_threads(py, watch, |budget| {
        search::search_with_progress(&frames, &density.0, &starts, &options, &done, budget)
    })?;
    let found = found.map_err(value_error)?;
    found.iter().map(|mode| arrays_of(py, mode)).collect()
}

fn arrays_of<'py>(py: Python<'py>, mode: &Mode) -> PyResult<ModeArrays<'py>> {
    Ok((
        rotation(py, &mode.pose)?,
        translation(py, &mode.pose),
        matrix(py, mode.covariance.iter().copied().collect(), [6, 6])?,
        mode.log_mass,
        mode.log_ratio,
        mode.edges,
    ))
}

/// Weights of frames by spread, by null poses about a pose.
#[pyclass(frozen, module = "regionpose._core")]
pub struct LocalWeights(null_poses::LocalWeights);

#[pymethods]
impl LocalWeights {
    #[new]
    fn new(
        py: Python<'_>,
        frames: Vec<PyRef<'_, AlignmentFrame>>,
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let (frames, pose) = (frames_of(&frames), pose(rotation, translation)?);
        detached(py, |budget| null_poses::LocalWeights::about(&frames, &pose, budget)).map(Self)
    }

    /// The maximum of the posterior reached from a start by these weights; None where no direction is certain.
    fn maximum<'py>(
        &self,
        py: Python<'py>,
        frames: Vec<PyRef<'py, AlignmentFrame>>,
        density: &Density,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<Option<ModeArrays<'py>>> {
        let (frames, start) = (frames_of(&frames), pose(rotation, translation)?);
        let found = detached(py, |budget| self.0.maximum(&frames, &density.0, &start, budget))?;
        found.map(|mode| arrays_of(py, &mode)).transpose()
    }
}

fn frames_of(frames: &[PyRef<'_, AlignmentFrame>]) -> Vec<Frame> {
    frames.iter().map(|frame| frame.0.clone()).collect()
}

/// The spreads of edges, pixels, from wide to narrow.
#[pyfunction]
pub fn edge_spreads() -> [f64; SPREADS] {
    SPREADS_PX
}
