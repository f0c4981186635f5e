"""Distortion of a normalized image plane, as OpenCV defines it, and its exact inverse."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import SupportsFloat

import numpy as np

from regionpose.cameras.base import LIMIT_SLACK, finite_numbers
from regionpose.cameras.branches import Branch, Disturbance, RadialFactor, branches_of
from regionpose.cameras.inversion import PlaneMapping, Rows, bracketed_roots, inverses_in_ring
from regionpose.cameras.tilt import mapped, tilt_matrix
from regionpose.validation.arrays import Array

COEFFICIENT_COUNTS = (0, 4, 5, 8, 12, 14)
"""Numbers of coefficients that OpenCV defines."""

NEEDED = "0, 4, 5, 8, 12 or 14 (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y)"


@dataclass(frozen=True)
class RadialTangential:
    """Distortion by `(k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y)`, cut where the rest is 0.

    With `s = x^2 + y^2`, `f = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)`, `q = (p2, p1)`,
    `a = (s1, s3)` and `b = (s2, s4)`, a point `m` goes to `f m + s q + 2 (q . m) m + s a + s^2 b`, and from there by
    the homography of a sensor that is turned by tau_x and tau_y. `branches` are the radii in which the map is used.
    Without prisms and tangential terms the first ends exactly at the fold, the first radius at which the distorted
    radius stops growing, or at a pole. With them it is a disc in which the symmetric part of the Jacobian is positive
    definite, so that the map is one-to-one (docs/math.md, eq. 9.2 to 9.5). `reach` is the largest radius that the
    image shows, after the distortion: where the model folds before, but only over a narrow ring, branches follow
    beyond.
    """

    coefficients: tuple[float, ...]
    reach: float = field(default=0.0, repr=False)
    branches: tuple[Branch, ...] = field(init=False, repr=False, compare=False)
    factor: RadialFactor = field(init=False, repr=False, compare=False)
    tangential: tuple[float, float] = field(init=False, repr=False, compare=False)
    prism: tuple[float, float, float, float] = field(init=False, repr=False, compare=False)
    tilt: Array | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Split the coefficients and find the branches."""
        k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = (
            *self.coefficients,
            *(0.0,) * (14 - len(self.coefficients)),
        )
        set_field = object.__setattr__
        set_field(self, "factor", RadialFactor(_trimmed((1.0, k1, k2, k3)), _trimmed((1.0, k4, k5, k6))))
        set_field(self, "tangential", (p2, p1))
        set_field(self, "prism", (s1, s3, s2, s4))
        tilt = tilt_matrix(tau_x, tau_y) if tau_x or tau_y else None
        set_field(self, "tilt", tilt)
        disturbance = Disturbance(math.hypot(p1, p2), (math.hypot(s1, s3), math.hypot(s2, s4)))
        horizon = math.inf if tilt is None else float(tilt[2, 2] / np.hypot(*tilt[2, :2]))
        set_field(self, "branches", branches_of(self.factor, disturbance, self.reach, horizon))

    @property
    def limit(self) -> float:
        """The radius before distortion up to which the map is one-to-one without a gap."""
        return self.branches[0].outer

    @property
    def is_identity(self) -> bool:
        """Whether no coefficient differs from zero."""
        return not any(self.coefficients)

    @property
    def keeps_lines(self) -> bool:
        """Whether straight lines stay straight: a tilted sensor alone bends none."""
        return not any(self.coefficients[:12])

    @property
    def _is_radial(self) -> bool:
        return not (any(self.tangential) or any(self.prism))

    def distort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distorted points (n,), (n,) of undistorted ones; NaN outside of the branches."""
        if self.is_identity:
            return x, y
        s = x * x + y * y
        scale, radius = self.factor.at(s)[0], np.sqrt(s)
        used = radius <= self.limit * (1.0 + LIMIT_SLACK)
        for branch in self.branches[1:]:
            used |= (radius >= branch.inner * (1.0 - LIMIT_SLACK)) & (radius <= branch.outer * (1.0 + LIMIT_SLACK))
        scale[~used] = np.nan
        bent_x, bent_y = self._bent(x, y, s)
        x, y = scale * x + bent_x, scale * y + bent_y
        return (x, y) if self.tilt is None else mapped(self.tilt, x, y)

    def undistort(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Undistorted points (n,), (n,) of the branches; NaN where none of them is distorted to (x, y)."""
        if self.is_identity:
            return x, y
        if self.tilt is not None:
            x, y = mapped(np.asarray(np.linalg.inv(self.tilt), dtype=np.float64), x, y)
        distorted = np.hypot(x, y)
        point = np.full((2, len(distorted)), np.nan)
        for branch in self.branches:
            rows = np.flatnonzero((distorted > branch.nearest) & (distorted <= branch.farthest))
            point[:, rows] = self._undistorted(np.stack([x[rows], y[rows]]), distorted[rows], branch)
        return point[0], point[1]

    def _undistorted(self, target: Array, distorted: Array, branch: Branch) -> Array:
        """Points (2, n) of a branch that are distorted to `target` (2, n) before any tilt; NaN where there is none."""

        def residual(radius: Array, rows: Rows) -> tuple[Array, Array]:
            value, slope = self.factor.radius(radius)
            return value - distorted[rows], slope

        radius = bracketed_roots(residual, distorted, branch.outer, branch.inner)
        start = target * np.where(distorted > 0.0, radius / distorted, 1.0)
        if self._is_radial:
            return np.asarray(start)
        return inverses_in_ring(self._mapping, target, start, (branch.inner, branch.outer))

    def _bent(self, x: Array, y: Array, s: Array) -> tuple[Array, Array]:
        """What tangential and prism terms add."""
        (qx, qy), (ax, ay, bx, by) = self.tangential, self.prism
        along = 2.0 * (qx * x + qy * y)
        return along * x + s * (qx + ax + s * bx), along * y + s * (qy + ay + s * by)

    def _mapping(self, point: Array) -> PlaneMapping:
        """Distorted points (2, n), before any tilt, and the entries xx, xy, yx, yy of the Jacobian."""
        x, y = point
        (qx, qy), (ax, ay, bx, by) = self.tangential, self.prism
        s = x * x + y * y
        factor, slope = self.factor.at(s)
        bent_x, bent_y = self._bent(x, y, s)
        distorted = np.stack([factor * x + bent_x, factor * y + bent_y])
        diagonal = factor + 2.0 * (qx * x + qy * y)
        mixed = 2.0 * (slope * x * y + qx * y + qy * x)
        rise_x, rise_y = 2.0 * (ax + 2.0 * s * bx), 2.0 * (ay + 2.0 * s * by)
        jacobian_xx = diagonal + 2.0 * slope * x * x + (4.0 * qx + rise_x) * x
        jacobian_yy = diagonal + 2.0 * slope * y * y + (4.0 * qy + rise_y) * y
        return distorted, (jacobian_xx, mixed + rise_x * y, mixed + rise_y * x, jacobian_yy)


def _trimmed(coefficients: tuple[float, ...]) -> Array:
    """Ascending coefficients without trailing zeros."""
    return np.trim_zeros(np.array(coefficients), "b")


def distortion_of(coefficients: Iterable[SupportsFloat], reach: float = 0.0) -> RadialTangential:
    """The distortion with 0, 4, 5, 8, 12 or 14 `coefficients` and the radius that the image shows.

    ValueError on another count, a number that is not finite, or a sensor tilted by a quarter turn.
    """
    numbers = finite_numbers("distortion", coefficients)
    if len(numbers) not in COEFFICIENT_COUNTS:
        raise ValueError(f"distortion: found {len(numbers)} coefficients; needed {NEEDED}")
    return _made(numbers, reach)


@lru_cache(maxsize=64)
def _made(coefficients: tuple[float, ...], reach: float) -> RadialTangential:
    """The distortion, which cameras share: its branches take longer to find than a hundred pixels to map."""
    return RadialTangential(coefficients, reach)
