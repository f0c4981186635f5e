"""Inverse of increasing functions: where they stop increasing, and their safeguarded Newton inversion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from regionpose.validation.arrays import Array

Rows = NDArray[np.intp]
Residual = Callable[[Array, Rows], tuple[Array, Array]]
PlaneMapping = tuple[Array, tuple[Array, Array, Array, Array]]

REAL_ROOT_TOLERANCE = 1e-7
"""Imaginary part, relative to the modulus, up to which a computed root is real: a double root splits by sqrt(eps)."""

POLISH_STEPS = 3
"""Newton steps on a polynomial's root; an eigenvalue is right to half the digits or more and each step doubles them."""

STEP_TOLERANCE = 4.0 * np.finfo(np.float64).eps
"""Relative Newton step at which the root is as exact as its rounding."""

NOISE_STEP = 1e-7
"""Relative Newton step below which steps that no longer shrink are rounding noise (sqrt(eps) next to a fold)."""

MAX_ITERATIONS = 200
"""Newton and bisection steps together; bisection alone takes under 70 from a bracket of ordinary size."""

CONVERGED = 4.0 * np.finfo(np.float64).eps
"""Distance to the target in the plane, over the sizes that round, at which a point is inverted to its rounding."""

ACCEPTED = 1e-13
"""The same distance for a point that stopped moving: 1e-10 px at a focal length of 1000 px."""

SMALLEST_FRACTION = 2.0**-20
"""Fraction of a Newton step below which the point is stuck, at the edge of the disc or at its rounding."""

START_INSIDE = 0.999
"""Largest start, in radii of the disc or ends of the bracket: inside the fold, where the slope is regular."""

MAX_DOUBLINGS = 1024
"""Doublings of a bracket, the number of binary exponents above 1."""


def polynomial(coefficients: Sequence[float] | Array, x: Array) -> Array:
    """Value at `x` of the polynomial with ascending `coefficients`, by Horner's rule."""
    value = np.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value *= x
        value += coefficient
    return value


def derivative(coefficients: Sequence[float] | Array) -> Array:
    """Ascending coefficients of the derivative of a polynomial; at least one."""
    ascending = np.asarray(coefficients, dtype=np.float64)
    return np.arange(1, len(ascending)) * ascending[1:] if len(ascending) > 1 else np.zeros(1)


def first_positive_root(coefficients: Sequence[float] | Array) -> float:
    """Smallest root above zero of the polynomial with ascending `coefficients`; infinity when there is none."""
    roots = positive_roots(coefficients)
    return roots[0] if roots else math.inf


def positive_roots(coefficients: Sequence[float] | Array) -> list[float]:
    """Roots above zero of the polynomial with ascending `coefficients`, ascending.

    The constant coefficient must not be zero. The roots are found as reciprocals, so that vanishing leading
    coefficients send roots to infinity and disturb nothing.
    """
    ascending = np.asarray(coefficients, dtype=np.float64)
    reciprocal = np.roots(ascending / ascending[0])
    real = np.abs(reciprocal.imag) <= REAL_ROOT_TOLERANCE * np.abs(reciprocal)
    positive = reciprocal.real[real & (reciprocal.real > np.finfo(np.float64).tiny)]
    return [_polished_root(ascending, 1.0 / value) for value in sorted(positive.tolist(), reverse=True)]


def _polished_root(coefficients: Array, root: float) -> float:
    """`root` after Newton steps, or as it is where they diverge (a double root)."""
    slope = derivative(coefficients)
    polished = np.array(root)
    with np.errstate(all="ignore"):
        for _ in range(POLISH_STEPS):
            polished = polished - polynomial(coefficients, polished) / polynomial(slope, polished)
    moved = abs(float(polished) - root)
    return float(polished) if moved <= REAL_ROOT_TOLERANCE * root else root


def bracketed_roots(residual: Residual, start: Array, upper: float, lower: float = 0.0) -> Array:
    """Roots (n,) in [lower, upper] of n functions, each negative below its root and positive above it.

    `residual(x, rows)` gives value and slope of the functions numbered `rows` at `x`; `start` (n,) are first guesses.
    Newton steps (docs/math.md, eq. 9.10) that leave the bracket or do not halve are replaced by bisection, so a slope
    of zero at the end of the bracket (a fold) does no harm. `upper` may be infinite: the bracket is then doubled until
    it holds the root.
    """
    # Next to a pole at the end Newton steps are as small as rounding noise, and would be taken for it.
    middle = 0.5 * (lower + upper) if math.isfinite(upper) else 2.0 * lower
    root = np.where((start >= lower) & (start < START_INSIDE * upper), start, middle)
    low = np.full_like(root, lower)
    high = np.full_like(root, upper) if math.isfinite(upper) else _upper_ends(residual, root)
    step_before = np.full_like(root, np.inf)
    rows = np.arange(root.size)
    for _ in range(MAX_ITERATIONS):
        if rows.size == 0:
            break
        x = root[rows]
        value, slope = residual(x, rows)
        low[rows] = np.where(value < 0.0, x, low[rows])
        high[rows] = np.where(value > 0.0, x, high[rows])
        following, finished = _next(x, value, slope, low[rows], high[rows], step_before[rows])
        root[rows] = following
        step_before[rows] = np.abs(following - x)
        rows = rows[~finished]
    return root


def _next(
    x: Array, value: Array, slope: Array, low: Array, high: Array, step_before: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """The next iterates and which of them are final."""
    newton = x - value / slope
    step = np.abs(newton - x)
    inside = (newton >= low) & (newton <= high)
    shrinking = step <= 0.5 * step_before
    noise = ~shrinking & (step <= NOISE_STEP * x)
    following = np.where(inside & shrinking, newton, 0.5 * (low + high))
    following = np.where((value == 0.0) | noise, x, following)
    exact = np.abs(following - x) <= STEP_TOLERANCE * x
    return following, exact | noise


def _upper_ends(residual: Residual, start: Array) -> Array:
    """Arguments above the roots, by doubling from `start`."""
    ends = np.maximum(2.0 * start, np.finfo(np.float64).tiny)
    rows = np.arange(start.size)
    for _ in range(MAX_DOUBLINGS):
        value, _ = residual(ends[rows], rows)
        rows = rows[value < 0.0]
        if rows.size == 0:
            break
        ends[rows] *= 2.0
    return ends


def inverses_in_ring(
    mapping: Callable[[Array], PlaneMapping], target: Array, start: Array, radii: tuple[float, float]
) -> Array:
    """Points (2, n) between two radii about 0 that `mapping` takes to `target` (2, n); NaN where there is none.

    `mapping` gives the images of points and the entries xx, xy, yx, yy of its Jacobian, whose symmetric part is
    positive definite between the radii. Each Newton step is halved until it stays there and the distance to the target
    falls, so the iteration cannot leave. Points are NaN where `start` is.
    """
    inner, outer = radii
    start_radius = np.maximum(np.hypot(*start), np.finfo(np.float64).tiny)
    point = start * np.minimum(1.0, max(inner, START_INSIDE * outer) / start_radius)
    distance, step, size = _towards(mapping, point, target)
    fraction = np.ones_like(distance)
    rows = np.flatnonzero(np.isfinite(distance))
    for _ in range(MAX_ITERATIONS):
        rows = rows[(distance[rows] > CONVERGED * size[rows]) & (fraction[rows] > SMALLEST_FRACTION)]
        if rows.size == 0:
            break
        trial = point[:, rows] + fraction[rows] * step[:, rows]
        trial_distance, trial_step, trial_size = _towards(mapping, trial, target[:, rows])
        radius = np.hypot(*trial)
        better = (trial_distance < distance[rows]) & (radius >= inner) & (radius <= outer)
        moved = rows[better]
        point[:, moved], step[:, moved] = trial[:, better], trial_step[:, better]
        distance[moved], size[moved] = trial_distance[better], trial_size[better]
        fraction[rows] = np.where(better, np.minimum(1.0, 2.0 * fraction[rows]), 0.5 * fraction[rows])
    point[:, ~(distance <= ACCEPTED * size)] = np.nan
    return np.asarray(point)


def _towards(mapping: Callable[[Array], PlaneMapping], point: Array, target: Array) -> tuple[Array, Array, Array]:
    """Distance of the images of points to their targets, the Newton step towards them, and the sizes that round.

    A point's own rounding moves its image by the Jacobian's norm times its radius, which is far more than the image's
    rounding next to a pole.
    """
    image, (xx, xy, yx, yy) = mapping(point)
    dx, dy = target - image
    determinant = xx * yy - xy * yx
    step: Array = np.stack([yy * dx - xy * dy, xx * dy - yx * dx]) / determinant
    size: Array = 1.0 + np.hypot(*target) + np.hypot(np.hypot(xx, yy), np.hypot(xy, yx)) * np.hypot(*point)
    return np.hypot(dx, dy), step, size
