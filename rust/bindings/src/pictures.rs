//! Pictures as bytes of files.

use std::io::Write;

use numpy::ndarray::{Axis, Slice};
use numpy::{PyReadonlyArray3, PyUntypedArrayMethods};
use png::{ColorType, Compression, Encoder, EncodingError, Filter};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Rows that are compressed at a time, without the interpreter's lock.
const ROWS: usize = 256;

/// The bytes of a PNG file of a picture (h, w, 3) uint8; ValueError for one without a pixel, or with more than the format allows.
#[pyfunction]
pub fn png_bytes<'py>(py: Python<'py>, picture: PyReadonlyArray3<'py, u8>) -> PyResult<Bound<'py, PyBytes>> {
    let &[height, width, channels] = picture.shape() else { unreachable!("three axes by its type") };
    let sizes = [height, width].map(u32::try_from);
    let (&[Ok(rows), Ok(columns)], 3) = (&sizes, channels) else {
        return Err(PyValueError::new_err(format!(
            "picture has shape {:?}; it needs to be (h, w, 3)",
            picture.shape()
        )));
    };
    let refused = |error: EncodingError| PyValueError::new_err(format!("picture: {error}"));
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, columns, rows);
    encoder.set_color(ColorType::Rgb);
    // Measured on the demo's `overlay.png` and `depth.png`, on a noisy photo and a depth picture of 24 megapixels: 0.2 to 0.3 of the time
    // of zlib with runs alone (`Z_RLE`), and 1.06 to 1.18 times its bytes.
    encoder.set_compression(Compression::Fastest);
    encoder.set_filter(Filter::Adaptive);
    let mut header = encoder.write_header().map_err(refused)?;
    let mut stream = header.stream_writer().map_err(refused)?;
    for first in (0..height).step_by(ROWS) {
        // A copy: while the lock is free, the picture may change.
        let rows = picture.as_array().slice_axis_move(Axis(0), Slice::from(first..height.min(first + ROWS)));
        let strip = rows.as_slice().map_or_else(|| rows.iter().copied().collect(), <[u8]>::to_vec);
        py.detach(|| stream.write_all(&strip)).map_err(|error| refused(error.into()))?;
    }
    stream.finish().map_err(refused)?;
    header.finish().map_err(refused)?;
    Ok(PyBytes::new(py, &bytes))
}
