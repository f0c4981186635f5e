//! Contours of masks, and the flood that a mask grows by, with its outlines.

use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::internals::view::mask::{self, Mask, MaskContours, MaskValue};

use crate::arrays::value_error;
use crate::mesh::ring_arrays;

type TracedMask<'py> = (Vec<Bound<'py, PyArray2<f64>>>, (usize, usize, usize, usize), bool);

/// Rings (n, 2) of the contour of a mask (h, w), as of `plane_rings`; the window left, top, right, bottom (the last two
/// excluded) that holds its coverage; and whether every pixel is covered as a whole or not at all.
///
/// `mask`: integers, 0 and one other, or coverage in [0, 1], float32 or float64. One whose rows follow one another in
/// memory is read in place. ValueError for another type, other values, or a mask without a pixel that is covered by more
/// than half.
#[pyfunction]
pub fn mask_contours<'py>(mask: &Bound<'py, PyAny>) -> PyResult<TracedMask<'py>> {
    let readers = [
        contours_of::<u8>,
        contours_of::<f32>,
        contours_of::<f64>,
        contours_of::<i8>,
        contours_of::<i16>,
        contours_of::<u16>,
        contours_of::<i32>,
        contours_of::<u32>,
        contours_of::<i64>,
        contours_of::<u64>,
    ];
    let contours = readers.iter().find_map(|read| read(mask));
    let refused = || PyValueError::new_err("mask is no array (h, w) of integers, float32 or float64");
    let MaskContours { rings, rows, columns, binary } = contours.ok_or_else(refused)??;
    let window = (columns.start, rows.start, columns.end, rows.end);
    Ok((ring_arrays(mask.py(), rings.rings())?, window, binary))
}

/// The least level (h, w) at which each pixel is connected with a start through pixels of that level at the most, over sides and corners.
///
/// `levels` (h, w) uint16; `start`: row and column. ValueError for a start outside.
#[pyfunction]
pub fn flood_levels<'py>(
    levels: PyReadonlyArray2<'py, u16>,
    start: (usize, usize),
) -> PyResult<Bound<'py, PyArray2<u16>>> {
    let (py, [rows, columns]) = (levels.py(), [levels.shape()[0], levels.shape()[1]]);
    let values: Vec<u16> = levels.as_array().iter().copied().collect();
    let index = if start.1 < columns { start.0.saturating_mul(columns).saturating_add(start.1) } else { usize::MAX };
    let arrivals = py.detach(|| mask::flood_levels(&values, columns, index)).map_err(value_error)?;
    PyArray1::from_vec(py, arrivals).reshape([rows, columns])
}

/// How many steps (h, w) the colors (h, w, 3) lie from one, rounded up, no more than `most`.
#[pyfunction]
pub fn color_levels<'py>(
    colors: PyReadonlyArray3<'py, f32>,
    color: [f32; 3],
    step: f32,
    most: u16,
) -> PyResult<Bound<'py, PyArray2<u16>>> {
    let &[rows, columns, channels] = colors.shape() else { unreachable!("three axes by its type") };
    if channels != 3 {
        return Err(PyValueError::new_err(format!("colors has {channels} channels; needed three")));
    }
    let levels = mask::color_levels(contiguous("colors", &colors)?, color, step, most);
    PyArray1::from_vec(colors.py(), levels).reshape([rows, columns])
}

/// Sums of the contrast across, and the numbers of pixel edges, (count,) each, on the outlines of the regions {arrivals <= k}, k from zero.
///
/// `arrivals` (h, w) as of `flood_levels`; `colors` (h, w, 3). ValueError for colors of another size.
#[pyfunction]
pub fn outline_sums<'py>(
    arrivals: PyReadonlyArray2<'py, u16>,
    colors: PyReadonlyArray3<'py, f32>,
    count: usize,
) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
    if colors.shape()[..2] != *arrivals.shape() {
        return Err(PyValueError::new_err(format!(
            "colors has the shape {:?}; needed that of arrivals, {:?}, and three",
            colors.shape(),
            arrivals.shape()
        )));
    }
    let (steps, values) = (contiguous("arrivals", &arrivals)?, contiguous("colors", &colors)?);
    let (contrasts, lengths) = mask::outline_sums(steps, values, arrivals.shape()[1], count).map_err(value_error)?;
    Ok([contrasts, lengths].map(|sums| PyArray1::from_vec(colors.py(), sums)))
}

/// An array's values in its memory.
///
/// The interpreter's lock is kept while they are used: nothing else may write into what is not copied.
fn contiguous<'a, T: Element, D: Dimension>(name: &str, array: &'a PyReadonlyArray<'_, T, D>) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| PyValueError::new_err(format!("{name} is not contiguous")))
}

/// The contours of a mask of this type; `None` for one of another.
///
/// The interpreter's lock is kept: nothing else may write into the mask, which is not copied.
fn contours_of<T: MaskValue + Element>(mask: &Bound<'_, PyAny>) -> Option<PyResult<MaskContours>> {
    let array: PyReadonlyArray2<'_, T> = mask.extract().ok()?;
    let columns = array.shape()[1];
    let view = array.as_array();
    let contours = match view.as_slice() {
        Some(values) => traced(values, columns),
        None => traced(&view.iter().copied().collect::<Vec<T>>(), columns),
    };
    Some(contours)
}

fn traced<T: MaskValue>(values: &[T], columns: usize) -> PyResult<MaskContours> {
    let mask = Mask::new(values, columns).ok_or_else(|| PyValueError::new_err("mask has no pixels; needed (h, w)"))?;
    MaskContours::of(mask).map_err(value_error)
}
