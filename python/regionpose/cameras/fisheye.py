"""The fisheye camera of Kannala and Brandt, as OpenCV's fisheye module has it."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from regionpose.cameras.base import LIMIT_SLACK, Components, finite_numbers
from regionpose.cameras.inversion import Rows, bracketed_roots, derivative, first_positive_root, polynomial
from regionpose.cameras.matrix import MatrixCamera, intrinsics_of
from regionpose.validation.arrays import Array


@dataclass(frozen=True)
class FisheyeCamera(MatrixCamera):
    """The fisheye camera of Kannala and Brandt, as OpenCV's fisheye module has it.

    A ray at the angle `t` off the axis is seen at the distance `t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`,
    on the plane that focal lengths and center map to the image (Kannala and Brandt 2006, radially
    symmetric part; docs/math.md, eq. 9.6). Angles reach beyond 90 degrees, to the fold
    of the polynomial or to 180 degrees.

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels, above 0.
    cx, cy : float
        Where the optical axis meets the image, pixels.
    distortion : tuple of 4 float
        `(k1, k2, k3, k4)`, zeros by default.
    width, height : int, optional
        Of the image, pixels; None where unknown.

    Raises
    ------
    ValueError
        For a focal length that is not positive, a number that is not finite, other than four coefficients.

    Examples
    --------
    >>> import numpy as np, regionpose as rp
    >>> camera = rp.FisheyeCamera(300.0, 300.0, 500.0, 500.0)
    >>> np.round(camera.project([[1.0, 0.0, 0.0]]), 3).tolist()
    [[971.239, 500.0]]
    """

    fx: float
    fy: float
    cx: float
    cy: float
    _: KW_ONLY
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        """Check the parameters and store them as plain numbers."""
        super().__post_init__()
        object.__setattr__(self, "distortion", finite_numbers("distortion", self.distortion))
        if len(self.distortion) != 4:
            raise ValueError(f"distortion: found {len(self.distortion)} coefficients; needed 4 (k1 k2 k3 k4)")

    @classmethod
    def from_matrix(
        cls,
        matrix: ArrayLike,
        *,
        distortion: ArrayLike = (0.0, 0.0, 0.0, 0.0),
        width: int | None = None,
        height: int | None = None,
    ) -> FisheyeCamera:
        """The camera with the matrix K (3, 3), without skew, and OpenCV's four coefficients in any shape."""
        return cls(
            *intrinsics_of(matrix), distortion=tuple(np.ravel(np.asarray(distortion))), width=width, height=height
        )

    @cached_property
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians: pi, or the fold of the polynomial."""
        slope = np.asarray([1.0, *self.distortion]) * np.array([1.0, 3.0, 5.0, 7.0, 9.0])
        return min(math.pi, math.sqrt(first_positive_root(slope)))

    @property
    def straight_lines(self) -> bool:
        """False: a fisheye camera bends straight lines."""
        return False

    def _radius(self, angle: Array) -> tuple[Array, Array]:
        """Distance from the center before the focal lengths, and its derivative by the angle."""
        factor = np.asarray([1.0, *self.distortion])
        square = angle * angle
        value = polynomial(factor, square)
        return angle * value, value + 2.0 * square * polynomial(derivative(factor), square)

    def _angles(self, radius: Array) -> Array:
        """Angles off the axis seen at `radius`; NaN beyond the largest."""

        def residual(angle: Array, rows: Rows) -> tuple[Array, Array]:
            value, slope = self._radius(angle)
            return value - reached[rows], slope

        is_within = radius <= self._radius(np.array(self.max_angle))[0]
        reached = radius[is_within]
        angles = np.full_like(radius, np.nan)
        angles[is_within] = bracketed_roots(residual, reached, self.max_angle)
        return angles

    def _bearings(self, u: Array, v: Array) -> Components:
        x, y = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        radius = np.hypot(x, y)
        angle = self._angles(radius)
        scale = np.where(radius > 0.0, np.sin(angle) / radius, 1.0)
        return x * scale, y * scale, np.cos(angle)

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        off_axis = np.hypot(x, y)
        angle = np.arctan2(off_axis, z)
        angle[(angle > self.max_angle * (1.0 + LIMIT_SLACK)) | ((off_axis == 0.0) & (z <= 0.0))] = np.nan
        radius, _ = self._radius(angle)
        scale = np.where(off_axis > 0.0, radius / off_axis, radius)
        return self.fx * x * scale + self.cx, self.fy * y * scale + self.cy
