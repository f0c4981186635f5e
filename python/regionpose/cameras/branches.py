"""Where a distortion of the image plane is one-to-one: the radii of its branches (docs/math.md, eq. 9.5)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from regionpose.cameras.inversion import Rows, bracketed_roots, derivative, polynomial, positive_roots
from regionpose.validation.arrays import Array

ROOT_TOLERANCE = 1e-12
"""Value of a polynomial, over the sum of its terms' sizes, that counts as zero: its rounding at a root, with room."""

POLE_MARGIN = 1e-9
"""Fraction of a pole's radius inside it at which a factor is read whose numerator vanishes there, too."""

WIDEST_GAP = 0.1
"""Largest part of its radius that a fold may take for the model to be used beyond it; a convention. Numerators and
denominators that nearly cancel fold within a few hundredths, and are right on both sides; a polynomial that was fitted
further inside folds for good, and describes no lens beyond."""


@dataclass(frozen=True)
class Branch:
    """Radii `inner` to `outer` of the undistorted plane in which a distortion is one-to-one.

    `nearest` and `farthest` bound the distorted radii that belong to this branch.
    """

    inner: float
    outer: float
    nearest: float
    farthest: float


@dataclass(frozen=True, eq=False)
class RadialFactor:
    """The factor `f(s) = N(s) / D(s)` of the squared radius s, by ascending coefficients that begin with 1."""

    numerator: Array
    denominator: Array

    def at(self, s: Array) -> tuple[Array, Array]:
        """The factor and its derivative by the squared radius."""
        under = polynomial(self.denominator, s)
        factor = polynomial(self.numerator, s) / under
        rising, falling = self._derivatives
        slope = polynomial(rising, s) - factor * polynomial(falling, s)
        return factor, slope / under

    @cached_property
    def _derivatives(self) -> tuple[Array, Array]:
        """Coefficients of the derivatives of numerator and denominator."""
        return derivative(self.numerator), derivative(self.denominator)

    def radius(self, radius: Array) -> tuple[Array, Array]:
        """The distorted radius `r f` and its derivative by r."""
        s = radius * radius
        factor, slope = self.at(s)
        return radius * factor, factor + 2.0 * s * slope

    @cached_property
    def pole(self) -> float:
        """The first radius at which the denominator vanishes; infinity when there is none."""
        return math.sqrt(min(positive_roots(self.denominator), default=math.inf))

    @cached_property
    def growth(self) -> Array:
        """The derivative of `r f` by r, times D^2, by powers of s."""
        rising, falling = self._derivatives
        rising, falling = np.convolve(rising, self.denominator), np.convolve(self.numerator, falling)
        product = np.convolve(self.numerator, self.denominator)
        return _sum(product, np.concatenate([[0.0], 2.0 * _sum(rising, -falling)]))

    def limit(self, radius: float) -> float:
        """The distorted radius that is reached at the end of a branch.

        At a pole there is none, unless the numerator has the same root and the radii stay finite.
        """
        if math.isinf(radius):
            return math.inf
        s = radius * radius
        if _is_root(self.denominator, s):
            if not _is_root(self.numerator, s):
                return math.inf
            radius *= 1.0 - POLE_MARGIN
        return radius * float(self.at(np.array(radius * radius))[0])


@dataclass(frozen=True, eq=False)
class Disturbance:
    """What turns and bends beyond the radial factor: tangential terms of size `tangential`, prisms of r^2 and r^4."""

    tangential: float
    prism: tuple[float, float]

    @property
    def is_zero(self) -> bool:
        """Whether the distortion is radial."""
        return not (self.tangential or any(self.prism))

    def shift(self, radius: Array) -> tuple[Array, Array]:
        """How far a point is moved at most, beyond the radial factor, and the derivative by the radius."""
        first, second = 3.0 * self.tangential + self.prism[0], self.prism[1]
        square = radius * radius
        return (first + second * square) * square, (2.0 * first + 4.0 * second * square) * radius


def branches_of(
    factor: RadialFactor, disturbance: Disturbance, reach: float, horizon: float = math.inf
) -> tuple[Branch, ...]:
    """The branches of a distortion, ascending: the disc about 0, and rings beyond narrow folds up to `reach`.

    Parameters
    ----------
    factor : RadialFactor
        The radial part.
    disturbance : Disturbance
        The rest.
    reach : float
        Distorted radius that the image shows: rings are looked for only where a branch ends before.
    horizon : float
        Distorted radius at which a tilted sensor sees nothing any more.

    """
    ends = sorted({0.0, *_condition_roots(factor, disturbance), math.inf})
    ends = [end for end in ends if end < factor.pole] + [factor.pole]
    outer, farthest = ends[1], _farthest(factor, disturbance, ends[1])
    if farthest > horizon:
        return (Branch(0.0, _radius_at(horizon, factor, disturbance, 1.0, (0.0, outer)), -math.inf, horizon),)
    branches = [Branch(0.0, outer, -math.inf, farthest)]
    for low, high in pairwise(ends[1:]):
        last = branches[-1]
        if last.farthest >= reach or low > (1.0 + WIDEST_GAP) * last.outer:
            break
        inner = _entry(factor, disturbance, (low, high), last.farthest)
        if inner is not None and inner <= (1.0 + WIDEST_GAP) * last.outer:
            branches.append(Branch(inner, high, last.farthest, _farthest(factor, disturbance, high)))
    return tuple(branches)


def _farthest(factor: RadialFactor, disturbance: Disturbance, radius: float) -> float:
    """A bound of the distorted radii up to `radius`."""
    return math.inf if math.isinf(radius) else factor.limit(radius) + float(disturbance.shift(np.array(radius))[0])


def _condition_roots(factor: RadialFactor, disturbance: Disturbance) -> list[float]:
    """Radii at which one of the conditions of a one-to-one map begins or ceases to hold."""
    if disturbance.is_zero:
        return [math.sqrt(root) for root in positive_roots(factor.growth)]
    return [root for condition in _conditions(factor, disturbance) for root in positive_roots(condition)]


def _conditions(factor: RadialFactor, disturbance: Disturbance) -> tuple[Array, Array, Array]:
    """Polynomials in the radius that are positive where the Jacobian's symmetric part is positive definite.

    With `g` the derivative of the distorted radius, `f` and `g` are the Jacobian's eigenvalues without other terms. In
    direction c = cos(angle to q) and with Q = r |q|, its determinant with tangential terms is
    `f g - 4 Q^2 + c Q (2 g + 6 f) + 16 Q^2 c^2`: least at c = -1 as long as `g + 3 f > 16 Q`, and positive there as
    long as `g > 6 Q` and `f > 2 Q`. Prisms lower every eigenvalue, and so f and g, by `2 r |a| + 4 r^3 |b|` at most.
    """
    q, (a, b) = disturbance.tangential, disturbance.prism
    square = np.convolve(factor.denominator, factor.denominator)
    product = np.convolve(factor.numerator, factor.denominator)
    prism = np.array([2.0 * a, 4.0 * b])

    def less(even: Array, fraction: float, weight: float, under: Array) -> Array:
        lowered = fraction * prism
        lowered[0] += weight * q
        return _minus_odd(even, np.convolve(lowered, under))

    return (
        less(factor.growth, 1.0, 6.0, square),
        less(factor.numerator, 1.0, 2.0, factor.denominator),
        less(_sum(factor.growth, 3.0 * product), 4.0, 16.0, square),
    )


def _entry(factor: RadialFactor, disturbance: Disturbance, ends: tuple[float, float], beyond: float) -> float | None:
    """The radius in an interval without roots from which distorted ones lie `beyond`; None where it is no branch."""
    low, high = ends
    inside = 0.5 * (low + high) if math.isfinite(high) else 2.0 * low
    if disturbance.is_zero:
        regular = float(polynomial(factor.growth, np.array(inside * inside))) > 0.0
    else:
        at = np.array(inside)
        regular = all(float(polynomial(condition, at)) > 0.0 for condition in _conditions(factor, disturbance))
    nearest = factor.limit(high) - float(disturbance.shift(np.array(high))[0]) if math.isfinite(high) else math.inf
    if not regular or nearest <= beyond:
        return None
    return _radius_at(beyond, factor, disturbance, -1.0, ends)


def _radius_at(
    distorted: float, factor: RadialFactor, disturbance: Disturbance, side: float, ends: tuple[float, float]
) -> float:
    """The radius between two whose distorted one, with the most (1) or less the most (-1) that is added, is given."""
    low, high = ends

    def residual(radius: Array, _: Rows) -> tuple[Array, Array]:
        (value, slope), (shift, rise) = factor.radius(radius), disturbance.shift(radius)
        return value + side * shift - distorted, slope + side * rise

    start = 0.5 * (low + high) if math.isfinite(high) else max(2.0 * low, distorted)
    return float(bracketed_roots(residual, np.array([start]), high, low)[0])


def _is_root(coefficients: Array, s: float) -> bool:
    """Whether the polynomial with ascending `coefficients` is zero at `s` above 0, to its rounding."""
    at = np.array(s)
    return abs(float(polynomial(coefficients, at))) <= ROOT_TOLERANCE * float(polynomial(np.abs(coefficients), at))


def _sum(first: Array, second: Array) -> Array:
    """Ascending coefficients of the sum of two polynomials."""
    total = np.zeros(max(len(first), len(second)))
    total[: len(first)] += first
    total[: len(second)] += second
    return total


def _minus_odd(even: Array, odd: Array) -> Array:
    """Ascending coefficients in r of `even(r^2) - r odd(r^2)`."""
    length = max(len(even), len(odd))
    interleaved = np.zeros(2 * length)
    interleaved[0 : 2 * len(even) : 2] = even
    interleaved[1 : 2 * len(odd) : 2] = -odd
    return interleaved
