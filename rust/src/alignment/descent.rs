//! Minima of a few variables by the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno, with line searches that do
//! without second derivatives and bear kinks (Lewis and Overton, Nonsmooth optimization via quasi-Newton methods, 2013).

use nalgebra::{SMatrix, SVector};

/// The weak Wolfe conditions: the fraction of the decrease that the slope predicts, and the fraction of the slope that may be left. The
/// usual ones of quasi-Newton methods (Nocedal and Wright, Numerical Optimization, 3.1).
const DECREASE: f64 = 1e-3;
const CURVATURE: f64 = 0.9;

/// When a descent ends.
#[derive(Debug, Clone, Copy)]
pub struct Ends {
    /// At gradients of components no larger than this.
    pub flat: f64,
    /// Where a step gains no more than this.
    pub gain: f64,
    /// After so many places tried along a line.
    pub tries: usize,
    /// After so many steps.
    pub steps: usize,
}

#[derive(Clone, Copy)]
struct Place<const D: usize> {
    at: SVector<f64, D>,
    value: f64,
    gradient: SVector<f64, D>,
}

/// The place that a descent from `start` reaches, and the value there; `cost` gives value and gradient. The first step goes a unit at most.
pub fn minimum<const D: usize>(
    mut cost: impl FnMut(&SVector<f64, D>) -> (f64, SVector<f64, D>),
    start: SVector<f64, D>,
    ends: &Ends,
) -> (SVector<f64, D>, f64) {
    let mut place = |at: SVector<f64, D>| {
        let (value, gradient) = cost(&at);
        Place { at, value, gradient }
    };
    let mut here = place(start);
    let mut inverse = SMatrix::<f64, D, D>::identity();
    for number in 0..ends.steps {
        if here.gradient.amax() <= ends.flat || !here.value.is_finite() {
            break;
        }
        let mut way = -inverse * here.gradient;
        if number == 0 {
            way /= way.norm().max(1.0);
        }
        let last = here;
        here = along(&mut place, last, way, ends.tries);
        if last.value - here.value <= ends.gain {
            break;
        }
        inverse = updated(&inverse, &(here.at - last.at), &(here.gradient - last.gradient), number == 0);
    }
    (here.at, here.value)
}

/// The place on a line at which the weak Wolfe conditions hold, by bisection; after so many tries the farthest one that is low enough.
fn along<const D: usize>(
    place: &mut impl FnMut(SVector<f64, D>) -> Place<D>,
    here: Place<D>,
    way: SVector<f64, D>,
    tries: usize,
) -> Place<D> {
    let slope = here.gradient.dot(&way);
    let (mut least, mut most, mut step, mut found) = (0.0, f64::INFINITY, 1.0, here);
    for _ in 0..tries {
        let trial = place(here.at + way * step);
        // Not so, for NaN, either.
        let is_low = trial.value <= here.value + DECREASE * step * slope;
        if is_low {
            found = trial;
            if trial.gradient.dot(&way) >= CURVATURE * slope {
                break;
            }
            least = step;
        } else {
            most = step;
        }
        step = if most.is_finite() { 0.5 * (least + most) } else { 2.0 * least };
    }
    found
}

/// The inverse of the Hessian after a step that changed the gradient.
fn updated<const D: usize>(
    inverse: &SMatrix<f64, D, D>,
    step: &SVector<f64, D>,
    change: &SVector<f64, D>,
    is_first: bool,
) -> SMatrix<f64, D, D> {
    let curvature = step.dot(change);
    if curvature <= 0.0 {
        return *inverse;
    }
    // Of the size that the first step has shown.
    let inverse = if is_first { inverse * (curvature / change.norm_squared()) } else { *inverse };
    let turned = SMatrix::<f64, D, D>::identity() - step * change.transpose() / curvature;
    turned * inverse * turned.transpose() + step * step.transpose() / curvature
}
