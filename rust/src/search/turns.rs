//! Local minima of a periodic function, sampled around a full turn.

use std::f64::consts::TAU;

/// Angles over a full turn at which shapes are compared: 5 degrees apart, a ninth of the shortest period that moments of order 8 can
/// have, and of that of an eightfold symmetry.
pub(super) const ANGLES: usize = 72;

/// From angle to angle.
pub(super) const TURN: f64 = TAU / ANGLES as f64;

/// The numbers of the angles whose values are less than those beside.
pub(super) fn least(values: &[f64]) -> Vec<usize> {
    let count = values.len();
    let is_least = |&k: &usize| values[k] <= values[(k + count - 1) % count] && values[k] < values[(k + 1) % count];
    (0..count).filter(is_least).collect()
}

/// The least values of a function of the angle, and their angles.
pub(super) fn least_turns(value: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    let values: Vec<f64> = (0..ANGLES).map(|k| value(k as f64 * TURN)).collect();
    least(&values).into_iter().map(|k| (values[k], k as f64 * TURN)).collect()
}
