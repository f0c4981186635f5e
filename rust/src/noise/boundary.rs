//! Noise of a clean boundary: how far an observed contour lies from the projected one (`docs/math.md`, section 21).

/// Standard deviation of the edge of a binary mask, pixels: that of a uniform place within a pixel, `1 / sqrt(12)`.
pub const QUANTIZATION: f64 = 0.288_675_134_594_812_9;

/// Standard deviation that calibrations and lenses leave of the finest boundary, pixels. With 0.25 px, the ellipsoid of 90 % holds 6 of 20
/// poses from rows of samples along sides (`cargo test sampled::`).
pub const CALIBRATION: f64 = 0.0625;

/// Standard deviation of a corner drawn by hand, pixels: 1.5 to 2 on frames of natural scenes.
pub const DRAWN: f64 = 2.0;

/// Ratio of the scales of contours that are tried in turn, and of the likeliest noise of samples to its neighbors. A convention.
pub const HALF_LEVEL: f64 = 2.0;

/// Ratio of neighboring noise levels from coarse to fine. By halves poses from samples are about the same, and take half as long again
/// (`python -m benchmarks lidar --only scan=samples`, `python -m benchmarks.speed --rows samples`).
pub const LEVEL_RATIO: f64 = HALF_LEVEL * HALF_LEVEL;

/// The noise level above [`CALIBRATION`], pixels: the finest that pieces of contours have, over which the steps of a mask average out.
pub const FINE: f64 = CALIBRATION * LEVEL_RATIO;

/// The level above: a contour that scatters by less has no other noise than that of pixels and calibrations.
pub const MEDIUM: f64 = FINE * LEVEL_RATIO;

/// The level above: as far as a boundary is off at coarse poses by samples.
pub const COARSE: f64 = MEDIUM * LEVEL_RATIO;

/// The level above: as far as it is off at rough starts.
pub const ROUGH: f64 = COARSE * LEVEL_RATIO;

/// The largest level.
pub const LARGEST: f64 = ROUGH * LEVEL_RATIO;
