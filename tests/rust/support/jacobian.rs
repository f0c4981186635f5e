//! The one checker of derivatives by a pose's increment.

use nalgebra::{DMatrix, DVector, Dyn, OMatrix, U6};
use regionpose::internals::geometry::pose::Tangent;

/// Step of the differences, in radians and in units of the scene's length: truncation is of its fourth power, rounding of
/// its inverse.
const STEP: f64 = 1e-3;

/// Derivatives of `values` at `at`, by central differences and one step of Richardson's extrapolation.
pub fn differences(values: &impl Fn(&Tangent) -> DVector<f64>, at: &Tangent, length: f64) -> DMatrix<f64> {
    let column = |axis: usize| {
        let unit = if axis < 3 { 1.0 } else { length };
        let slope = |step: f64| {
            let mut moved = Tangent::zeros();
            moved[axis] = step * unit;
            (values(&(at + moved)) - values(&(at - moved))) / (2.0 * step * unit)
        };
        (slope(STEP / 2.0) * 4.0 - slope(STEP)) / 3.0
    };
    DMatrix::from_columns(&(0..6).map(column).collect::<Vec<_>>())
}

/// Largest error of a Jacobian, each row relative to its largest entry with translations in units of `length`.
pub fn jacobian_error(
    jacobian: &OMatrix<f64, Dyn, U6>,
    values: impl Fn(&Tangent) -> DVector<f64>,
    at: &Tangent,
    length: f64,
) -> f64 {
    let expected = differences(&values, at, length);
    assert_eq!(jacobian.nrows(), expected.nrows(), "a row for each value");
    let unit = |column: usize| if column < 3 { 1.0 } else { length };
    let row_error = |row: usize| {
        let largest = (0..6).map(|c| (expected[(row, c)] * unit(c)).abs()).fold(0.0, f64::max);
        let errors = (0..6).map(|c| (jacobian[(row, c)] - expected[(row, c)]).abs() * unit(c));
        let worst = errors.inspect(|error| assert!(error.is_finite(), "row {row} is not finite")).fold(0.0, f64::max);
        if worst == 0.0 { 0.0 } else { worst / largest }
    };
    (0..jacobian.nrows()).map(row_error).fold(0.0, f64::max)
}

/// Panics where a Jacobian is farther from central differences than `allowed`, relative (see [`jacobian_error`]).
#[track_caller]
pub fn assert_jacobian(
    jacobian: &OMatrix<f64, Dyn, U6>,
    values: impl Fn(&Tangent) -> DVector<f64>,
    at: &Tangent,
    length: f64,
    allowed: f64,
) {
    let error = jacobian_error(jacobian, values, at, length);
    assert!(error < allowed, "the Jacobian is off by {error:.1e}, allowed {allowed:.0e}");
}
