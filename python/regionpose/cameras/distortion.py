"""Radial and tangential distortion of a normalized image plane, as OpenCV defines it, and its exact inverse."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import SupportsFloat

import numpy as np

from regionpose.cameras.base import LIMIT_SLACK, Array, finite_numbers
from regionpose.cameras.inversion import (
    PlaneMapping,
    Rows,
    bracketed_roots,
    derivative,
    first_positive_root,
    inverses_in_disc,
    polynomial,
)

COEFFICIENT_COUNTS = (0, 4, 5, 8)
"""Numbers of coefficients that OpenCV defines without thin prism and tilt."""

ROOT_TOLERANCE = 1e-12
"""Value of a polynomial, over the sum of its terms' sizes, that counts as zero: its rounding at a root, with room."""

POLE_MARGIN = 1e-9
"""Share of a pole's radius inside it at which a factor is read whose numerator vanishes there, too."""


@dataclass(frozen=True)
class RadialTangential:
    """Distortion by 0, 4, 5 or 8 coefficients `(k1, k2, p1, p2, k3, k4, k5, k6)`.

    With `s = x^2 + y^2`, `f = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)` and `q = (p2, p1)`, a point
    `m` goes to `f m + s q + 2 (q . m) m`, the gradient of a scalar field. `limit` is the radius of the disc in which
    the map is used. Without tangential terms it ends exactly at the fold, the first radius at which the distorted
    radius stops growing, or at a pole. With them it is a disc in which the symmetric Jacobian
    `(f + 2 q . m) 1 + 2 f' m m^T + 2 (q m^T + m q^T)` is positive definite in every direction: the field is convex
    there, so the map is one-to-one (docs/math.md, eq. 9.2 to 9.5). `distorted_limit` bounds the distorted radii of the
    disc.
    """

    coefficients: tuple[float, ...]
    limit: float = field(init=False, repr=False, compare=False)
    distorted_limit: float = field(init=False, repr=False, compare=False)
    numerator: Array = field(init=False, repr=False, compare=False)
    denominator: Array = field(init=False, repr=False, compare=False)
    tangential: tuple[float, float] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Split the coefficients and find the limit."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.coefficients + (0.0,) * (8 - len(self.coefficients))
        set_field = object.__setattr__
        set_field(self, "numerator", _trimmed((1.0, k1, k2, k3)))
        set_field(self, "denominator", _trimmed((1.0, k4, k5, k6)))
        set_field(self, "tangential", (p2, p1))
        set_field(self, "limit", self._first_singular_radius())
        set_field(self, "distorted_limit", self._largest_distorted_radius())

    @property
    def is_identity(self) -> bool:
        """Whether no coefficient differs from zero."""
        return not any(self.coefficients)

    @property
    def _is_radial(self) -> bool:
        return not any(self.tangential)

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distorted points (n,), (n,) of undistorted ones; NaN beyond `limit`."""
        if self.is_identity:
            return x, y
        qx, qy = self.tangential
        s = x * x + y * y
        factor = polynomial(self.numerator, s) / polynomial(self.denominator, s)
        factor[np.sqrt(s) > self.limit * (1.0 + LIMIT_SLACK)] = np.nan
        factor += 2.0 * (qx * x + qy * y)
        return factor * x + s * qx, factor * y + s * qy

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Undistorted points (n,), (n,) inside `limit`; NaN where no point of the disc is distorted to (x, y)."""
        if self.is_identity:
            return x, y
        distorted = np.hypot(x, y)
        reached = distorted <= self.distorted_limit
        radius = np.full_like(distorted, np.nan)
        radius[reached] = self._undistorted_radii(distorted[reached])
        scale = np.where(distorted > 0.0, radius / distorted, 1.0)
        if self._is_radial:
            return x * scale, y * scale
        point = inverses_in_disc(self._mapping, np.stack([x, y]), np.stack([x * scale, y * scale]), self.limit)
        return point[0], point[1]

    def _mapping(self, point: Array) -> PlaneMapping:
        """Distorted points (2, n) and the entries xx, xy, yy of the symmetric Jacobian."""
        x, y = point
        qx, qy = self.tangential
        s = x * x + y * y
        factor, factor_slope = self._factor(s)
        along = 2.0 * (qx * x + qy * y)
        scale = factor + along
        distorted = np.stack([scale * x + s * qx, scale * y + s * qy])
        jacobian_xx = scale + 2.0 * factor_slope * x * x + 4.0 * qx * x
        jacobian_yy = scale + 2.0 * factor_slope * y * y + 4.0 * qy * y
        return distorted, (jacobian_xx, 2.0 * (factor_slope * x * y + qx * y + qy * x), jacobian_yy)

    def _factor(self, s: Array) -> tuple[Array, Array]:
        """The radial factor f and its derivative by the squared radius."""
        under = polynomial(self.denominator, s)
        factor = polynomial(self.numerator, s) / under
        slope = polynomial(derivative(self.numerator), s) - factor * polynomial(derivative(self.denominator), s)
        return factor, slope / under

    def _radial(self, radius: Array) -> tuple[Array, Array]:
        """Distorted radius and its derivative, without tangential terms."""
        s = radius * radius
        factor, slope = self._factor(s)
        return radius * factor, factor + 2.0 * s * slope

    def _undistorted_radii(self, distorted: Array) -> Array:
        """Radii that the radial terms alone take to `distorted`, or the limit where none does."""

        def residual(radius: Array, rows: Rows) -> tuple[Array, Array]:
            value, slope = self._radial(radius)
            return value - distorted[rows], slope

        return bracketed_roots(residual, distorted, self.limit)

    def _first_singular_radius(self) -> float:
        """Radius of the disc; see the class.

        With `g` the derivative of the distorted radius, `f` and `g` are the Jacobian's eigenvalues without tangential
        terms. In direction c = cos(angle to q) and with Q = r |q|, its determinant is
        `f g - 4 Q^2 + c Q (2 g + 6 f) + 16 Q^2 c^2`: least at c = -1 as long as `g + 3 f > 16 Q`, and positive there
        as long as `g > 6 Q` and `f > 2 Q`.
        """
        pole = math.sqrt(first_positive_root(self.denominator))
        product = np.convolve(self.numerator, self.denominator)
        growth = _sum(product, np.concatenate([[0.0], 2.0 * self._factor_slope_numerator()]))
        if self._is_radial:
            return min(pole, math.sqrt(first_positive_root(growth)))
        q = math.hypot(*self.tangential)
        square = np.convolve(self.denominator, self.denominator)
        conditions = (
            _minus_odd(growth, 6.0 * q, square),
            _minus_odd(self.numerator, 2.0 * q, self.denominator),
            _minus_odd(_sum(growth, 3.0 * product), 16.0 * q, square),
        )
        return min(pole, *(first_positive_root(condition) for condition in conditions))

    def _factor_slope_numerator(self) -> Array:
        """Numerator `N' D - N D'` of the derivative of the radial factor N / D, over D^2."""
        rising = np.convolve(derivative(self.numerator), self.denominator)
        return _sum(rising, -np.convolve(self.numerator, derivative(self.denominator)))

    def _largest_distorted_radius(self) -> float:
        """Bound of the distorted radii in the disc, reached when there are no tangential terms.

        At a pole there is none, unless the numerator has the same root and the radii stay finite.
        """
        at_pole = math.isfinite(self.limit) and _is_root(self.denominator, self.limit**2)
        if math.isinf(self.limit) or (at_pole and not _is_root(self.numerator, self.limit**2)):
            return math.inf
        radius = self.limit * (1.0 - POLE_MARGIN) if at_pole else self.limit
        distorted = radius * float(self._factor(np.array(radius * radius))[0])
        return distorted + 3.0 * math.hypot(*self.tangential) * radius * radius


def _trimmed(coefficients: tuple[float, ...]) -> Array:
    """Ascending coefficients without trailing zeros."""
    return np.trim_zeros(np.array(coefficients), "b")


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


def _minus_odd(even: Array, weight: float, odd: Array) -> Array:
    """Ascending coefficients in r of `even(r^2) - weight r odd(r^2)`."""
    length = max(len(even), len(odd))
    interleaved = np.zeros(2 * length)
    interleaved[0 : 2 * len(even) : 2] = even
    interleaved[1 : 2 * len(odd) : 2] = -weight * odd
    return interleaved


def distortion_of(coefficients: Iterable[SupportsFloat]) -> RadialTangential:
    """The distortion with 0, 4, 5 or 8 `coefficients`; ValueError on another count or a number that is not finite."""
    numbers = finite_numbers("distortion", coefficients)
    if len(numbers) not in COEFFICIENT_COUNTS:
        raise ValueError(
            f"distortion: found {len(numbers)} coefficients; needed 0, 4, 5 or 8 (k1 k2 p1 p2 k3 k4 k5 k6)"
        )
    return RadialTangential(numbers)
