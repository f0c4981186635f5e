//! Steps of clouds and how far they lie on a photo's edges.

use nalgebra::{SMatrix, SVector};
use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::alignment::agreement::{EdgeStrength, SeenStep};
use regionpose::alignment::blur;
use regionpose::alignment::edges::Seen;
use regionpose::alignment::evidence;

use crate::arrays::{array, numbers, points};

type SumArrays<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);
type StepArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Unit bearings (m, 3) of the last samples of near surfaces before far ones, or before their shade changes, and of their
/// neighbors beyond; distances (m,) of the former, meters.
///
/// `points` (n, 3) relative to the camera's center, meters, in any axes; those that are not finite are left out. `cell`, rad: of
/// points whose bearings differ by less the nearest hides the others. `gap`, rad: neighbors farther apart are none.
/// `share`: how far a depth step goes beyond the plane of the near side, as a share of the inverse distance. `shades` (n,) on any
/// scale; without them there are depth steps alone. ValueError for another shape, and a cell or gap that is not
/// positive.
#[pyfunction]
#[pyo3(signature = (points, cell, gap, share, shades=None))]
pub fn scene_steps<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    cell: f64,
    gap: f64,
    share: f64,
    shades: Option<PyReadonlyArray1<'py, f64>>,
) -> PyResult<StepArrays<'py>> {
    check_angles(cell, gap)?;
    let points = self::points::<3>("points", points)?;
    let shades = shades_of(shades, points.len())?;
    let found = py.detach(|| {
        let seen = Seen::new(&points, cell, gap);
        let by_shade = shades.map_or(Vec::new(), |shades| seen.shade_steps(&shades, share));
        [seen.depth_steps(share), by_shade].concat()
    });
    let distances = found.iter().map(|step| step.distance).collect();
    let (near, far): (Vec<_>, Vec<_>) = found.into_iter().map(|step| (step.near, step.far)).unzip();
    Ok((array(py, &near)?, array(py, &far)?, PyArray1::from_vec(py, distances)))
}

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
    let pictures = pictures("strength", &strength)?;
    let turns = points::<3>("turns", turns)?;
    let steps = steps_of(pixels, points::<6>("moved", moved)?, &directions)?;
    // The interpreter's lock is kept: nothing else may write into the pictures, which are not copied.
    Ok(PyArray1::from_vec(py, pictures.means(&steps, &turns)))
}

/// Depth steps as they are seen, put together for many sums over them.
///
/// `pixels` (n, 2), and `moved` (n, 2 d): how a left increment of the pose, rotation vector and translation, moves x, then y; and, where
/// d is 7, the logarithm of the focal lengths. `directions` (n,): the picture of each step. ValueError for other shapes.
#[pyclass(frozen, module = "regionpose._core")]
pub struct SeenSteps(Steps);

enum Steps {
    OfPose(evidence::SeenSteps<6>),
    OfPoseAndFocal(evidence::SeenSteps<7>),
}

#[pymethods]
impl SeenSteps {
    #[new]
    fn new(
        pixels: &Bound<'_, PyAny>,
        moved: PyReadonlyArray2<'_, f64>,
        directions: PyReadonlyArray1<'_, i64>,
    ) -> PyResult<Self> {
        let (columns, moved) = (moved.shape()[1], moved.as_any());
        Ok(Self(if columns == 14 {
            let steps = steps_of::<7, 14>(pixels, points("moved", moved)?, &directions)?;
            Steps::OfPoseAndFocal(evidence::SeenSteps::new(&steps))
        } else {
            let steps = steps_of::<6, 12>(pixels, points("moved", moved)?, &directions)?;
            Steps::OfPose(evidence::SeenSteps::new(&steps))
        }))
    }

    /// Sums (t,) of what pictures hold under the steps, at increments of the pose, and their derivatives (t, d).
    ///
    /// `values` (k, h, w) float32, one picture a direction. `increments` (t, d), rad and meters, d 6 or 7 as for the steps.
    /// ValueError for other shapes, and no pixels.
    fn evidence<'py>(
        &self,
        py: Python<'py>,
        values: PyReadonlyArray3<'py, f32>,
        increments: &Bound<'py, PyAny>,
    ) -> PyResult<SumArrays<'py>> {
        let pictures = pictures("values", &values)?;
        // The interpreter's lock is kept: nothing else may write into the pictures, which are not copied.
        match &self.0 {
            Steps::OfPose(steps) => sums(py, pictures, steps, increments),
            Steps::OfPoseAndFocal(steps) => sums(py, pictures, steps, increments),
        }
    }
}

fn sums<'py, const D: usize>(
    py: Python<'py>,
    pictures: EdgeStrength<'_>,
    steps: &evidence::SeenSteps<D>,
    increments: &Bound<'py, PyAny>,
) -> PyResult<SumArrays<'py>> {
    let increments = points::<D>("increments", increments)?;
    let (sums, slopes): (Vec<_>, Vec<_>) = pictures.sums(steps, &increments).into_iter().unzip();
    Ok((PyArray1::from_vec(py, sums), array(py, &slopes)?))
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
    // The interpreter's lock is kept, as above.
    PyArray1::from_vec(py, blur::blurred(values, columns, &numbers("weights", weights)?)).reshape([rows, columns])
}

fn pictures<'a>(item: &str, values: &'a PyReadonlyArray3<'_, f32>) -> PyResult<EdgeStrength<'a>> {
    let &[_, rows, columns] = values.shape() else { unreachable!("three axes by its type") };
    let held = values.as_slice().map_err(|_| PyValueError::new_err(format!("{item} is not contiguous")))?;
    let refused = || PyValueError::new_err(format!("{item} has no pixels; it needs to be (k, h, w)"));
    EdgeStrength::new(held, rows, columns).ok_or_else(refused)
}

/// The steps of pixels, derivatives of x and then of y, and directions, as many of each.
fn steps_of<const D: usize, const TWICE: usize>(
    pixels: &Bound<'_, PyAny>,
    moved: Vec<SVector<f64, TWICE>>,
    directions: &PyReadonlyArray1<'_, i64>,
) -> PyResult<Vec<SeenStep<D>>> {
    let pixels = points::<2>("pixels", pixels)?;
    let directions: Vec<i64> = directions.as_array().iter().copied().collect();
    let found = [pixels.len(), moved.len(), directions.len()];
    if found.iter().any(|count| *count != pixels.len()) {
        let refused = format!("pixels, moved and directions have {found:?} rows; they need the same");
        return Err(PyValueError::new_err(refused));
    }
    let items = pixels.into_iter().zip(moved).zip(directions);
    let step = |((pixel, moved), direction): ((_, SVector<f64, TWICE>), i64)| SeenStep {
        pixel,
        moved: SMatrix::from_row_slice(moved.as_slice()),
        direction: usize::try_from(direction).unwrap_or(usize::MAX),
    };
    Ok(items.map(step).collect())
}
