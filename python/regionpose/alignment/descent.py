"""Minima of a few variables by the quasi-Newton method of Broyden, Fletcher, Goldfarb and Shanno.

scipy's L-BFGS-B hands matrices of 6 x 6 to threads of BLAS, which wait for one another longer than the work takes.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Cost = Callable[[Array], tuple[float, Array]]
"""Value and gradient (d,) at a place (d,)."""

DECREASE, CURVATURE = 1e-3, 0.9
"""The weak Wolfe conditions: the share of the decrease that the slope foretells, and the share of the slope that may be
left. The usual ones of quasi-Newton methods (Nocedal and Wright, Numerical Optimization, 3.1)."""

MOST_STEPS = 200
"""Steps of a descent: a bound alone, more than ten times as many as descents need."""


class Ends(NamedTuple):
    """When a descent ends: at gradients up to `flat`, where a step gains less than the share `level` of the value (of 1
    if that is more), or where so many `tries` along a line find no lower place.
    """

    flat: float
    level: float
    tries: int


class _Place(NamedTuple):
    at: Array
    value: float
    gradient: Array


def descended(cost: Cost, start: Array, ends: Ends) -> Array:
    """The place (d,) that a descent from `start` (d,) reaches; kinks of the cost do no harm.

    Steps end where the weak Wolfe conditions hold, which keeps the Hessian's inverse positive, also beside kinks (Lewis
    and Overton, Nonsmooth optimization via quasi-Newton methods, 2013).
    """
    here, inverse = _Place(start, *cost(start)), np.eye(len(start))
    for number in range(MOST_STEPS):
        if np.abs(here.gradient).max() <= ends.flat:
            break
        way = -inverse @ here.gradient
        # The first step knows no curvature: it goes a unit at most.
        last, here = here, _along(cost, here, way if number else way / max(1.0, float(np.linalg.norm(way))), ends.tries)
        if last.value - here.value <= ends.level * max(abs(last.value), abs(here.value), 1.0):
            break
        inverse = _updated(inverse, here.at - last.at, here.gradient - last.gradient, first=not number)
    return here.at


def _along(cost: Cost, here: _Place, way: Array, tries: int) -> _Place:
    """The place on a line at which the weak Wolfe conditions hold, by bisection; after so many tries the farthest one
    that is low enough.
    """
    slope, least, most, step, found = float(here.gradient @ way), 0.0, np.inf, 1.0, here
    for _ in range(tries):
        at = here.at + step * way
        trial = _Place(at, *cost(at))
        if not trial.value <= here.value + DECREASE * step * slope:
            most = step
        else:
            found = trial
            if trial.gradient @ way >= CURVATURE * slope:
                break
            least = step
        step = 0.5 * (least + most) if np.isfinite(most) else 2.0 * least
    return found


def _updated(inverse: Array, step: Array, change: Array, *, first: bool) -> Array:
    """The inverse of the Hessian (d, d) after a step (d,) that changed the gradient (d,)."""
    curvature = float(step @ change)
    if curvature <= 0.0:
        return inverse
    if first:
        # Of the size that the step has shown.
        inverse = inverse * (curvature / float(change @ change))
    turned = np.eye(len(step)) - np.outer(step, change) / curvature
    return np.asarray(turned @ inverse @ turned.T + np.outer(step, step) / curvature)
