"""The unified camera of Mei and Rives: a sphere seen by a perspective camera shifted off its center."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from regionpose.cameras.base import LIMIT_SLACK, Components, finite_number
from regionpose.cameras.distortion import RadialTangential, distortion_of
from regionpose.cameras.matrix import MatrixCamera, intrinsics_of
from regionpose.validation.arrays import Array


@dataclass(frozen=True)
class UnifiedCamera(MatrixCamera):
    """The unified camera of Mei and Rives, as Kalibr's omni and OpenCV's omnidir have it.

    The point `(x, y, z)` of the unit sphere is seen at the distorted `(x, y) / (z + xi)` (Mei and Rives 2007;
    docs/math.md, eq. 9.8). Directions are seen up to `z = -xi` when `xi <= 1`, up to `z = -1 / xi` when `xi > 1`, or
    up to the fold of the distortion.

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels, above 0.
    cx, cy : float
        Where the optical axis meets the image, pixels.
    xi : float
        Of the mirror, at least 0; 0 is a pinhole camera.
    distortion : tuple of float
        0 (default), 4, 5, 8, 12 or 14 coefficients, as of `PinholeCamera`.
    width, height : int, optional
        Of the image, pixels; None where unknown.

    Raises
    ------
    ValueError
        For a negative xi, a focal length that is not positive, a number that is not finite, a wrong count of
        coefficients.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.cameras.UnifiedCamera(600.0, 600.0, 320.0, 240.0, xi=1.0).project([[0.0, 0.0, 1.0]]).tolist()
    [[320.0, 240.0]]
    """

    fx: float
    fy: float
    cx: float
    cy: float
    _: KW_ONLY
    xi: float
    distortion: tuple[float, ...] = ()
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        """Check the parameters and store them as plain numbers."""
        super().__post_init__()
        object.__setattr__(self, "xi", finite_number("xi", self.xi))
        if self.xi < 0.0:
            raise ValueError(f"xi: found {self.xi}; needed a number of at least 0")
        object.__setattr__(self, "distortion", distortion_of(self.distortion).coefficients)

    @classmethod
    def from_matrix(
        cls,
        matrix: ArrayLike,
        *,
        xi: float,
        distortion: ArrayLike = (),
        width: int | None = None,
        height: int | None = None,
    ) -> UnifiedCamera:
        """The camera with xi, the matrix K (3, 3), without skew, and distortion coefficients in any shape."""
        coefficients = tuple(np.ravel(np.asarray(distortion)))
        return cls(*intrinsics_of(matrix), xi=xi, distortion=coefficients, width=width, height=height)

    @cached_property
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians: that of the sphere or that of the distortion's fold."""
        limit = self._distortion.limit
        if limit >= self._plane_limit:
            return math.acos(-min(self.xi, 1.0 / self.xi)) if self.xi > 0.0 else math.pi / 2.0
        lift = _lift(self.xi, limit)
        return math.atan2(lift * limit, lift - self.xi)

    @property
    def straight_lines(self) -> bool:
        """Whether the camera is a pinhole camera without distortion."""
        return self.xi == 0.0 and self._distortion.keeps_lines

    @cached_property
    def _distortion(self) -> RadialTangential:
        return distortion_of(self.distortion)

    @property
    def _plane_limit(self) -> float:
        """Largest radius before the distortion: infinite, or the outline of the sphere when xi > 1."""
        return 1.0 / math.sqrt(self.xi * self.xi - 1.0) if self.xi > 1.0 else math.inf

    def _bearings(self, u: Array, v: Array) -> Components:
        x, y = self._distortion.undistort((u - self.cx) / self.fx, (v - self.cy) / self.fy)
        lift = _lift(self.xi, np.hypot(x, y))
        return lift * x, lift * y, lift - self.xi

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        off_axis = np.hypot(x, y)
        is_visible = np.arctan2(off_axis, z) <= self.max_angle * (1.0 + LIMIT_SLACK)
        depth = z + self.xi * np.hypot(off_axis, z)
        depth = np.where(is_visible & (depth > 0.0), depth, np.nan)
        x_distorted, y_distorted = self._distortion.distort(x / depth, y / depth)
        return self.fx * x_distorted + self.cx, self.fy * y_distorted + self.cy


def _lift(xi: float, radius: Array | float) -> Array:
    """`z + xi` of the point of the unit sphere seen at `radius` on the plane; NaN outside its outline.

    Of two points on the ray, the one farther from the shifted center (docs/math.md, eq. 9.9).
    """
    square = np.square(radius)
    return np.asarray((xi + np.sqrt(1.0 + (1.0 - xi * xi) * square)) / (1.0 + square))
