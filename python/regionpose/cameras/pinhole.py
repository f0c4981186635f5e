"""The pinhole camera with OpenCV's distortion."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from regionpose.cameras.base import Components
from regionpose.cameras.distortion import RadialTangential, distortion_of
from regionpose.cameras.matrix import MatrixCamera, intrinsics_of
from regionpose.validation.arrays import Array


@dataclass(frozen=True)
class PinholeCamera(MatrixCamera):
    """The perspective camera with OpenCV's distortion.

    `(u, v) = (fx x_d + cx, fy y_d + cy)` with `(x_d, y_d)` the distorted `(x / z, y / z)`.

    See docs/math.md, eq. 9.1. Pixels are OpenCV's: an integer is a pixel's center.

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels, above 0.
    cx, cy : float
        Where the optical axis meets the image, pixels.
    distortion : tuple of float
        0 (default), 4, 5, 8, 12 or 14 coefficients in OpenCV's order
        `(k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y)`.
    width, height : int, optional
        Of the image, pixels; None where unknown.

    Raises
    ------
    ValueError
        For a focal length that is not positive, a number that is not finite, another count of coefficients.

    Examples
    --------
    >>> import regionpose as rp
    >>> camera = rp.PinholeCamera(800.0, 800.0, 319.5, 239.5, width=640, height=480)
    >>> camera.project([[0.0, 0.0, 2.0]]).tolist()
    [[319.5, 239.5]]
    """

    fx: float
    fy: float
    cx: float
    cy: float
    _: KW_ONLY
    distortion: tuple[float, ...] = ()
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        """Check the parameters and store them as plain numbers."""
        super().__post_init__()
        object.__setattr__(self, "distortion", distortion_of(self.distortion).coefficients)

    @classmethod
    def from_matrix(
        cls, matrix: ArrayLike, *, distortion: ArrayLike = (), width: int | None = None, height: int | None = None
    ) -> PinholeCamera:
        """The camera with the matrix K (3, 3), without skew, and OpenCV's distortion coefficients in any shape."""
        coefficients = tuple(np.ravel(np.asarray(distortion)))
        return cls(*intrinsics_of(matrix), width=width, height=height, distortion=coefficients)

    @property
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians: pi / 2, or the first fold of the distortion.

        Where the fold lies inside an image of known size and is narrow, directions beyond it are projected as well.
        """
        return math.atan(self._distortion.limit)

    @property
    def straight_lines(self) -> bool:
        """Whether there is no distortion but that of a tilted sensor."""
        return self._distortion.keeps_lines

    @cached_property
    def _distortion(self) -> RadialTangential:
        return distortion_of(self.distortion, self._reach())

    def _reach(self) -> float:
        """Largest distance of the image's corners from the center, on the normalized plane; 0 for an unknown size."""
        if self.width is None or self.height is None:
            return 0.0
        x = max(abs(-0.5 - self.cx), abs(self.width - 0.5 - self.cx)) / self.fx
        y = max(abs(-0.5 - self.cy), abs(self.height - 0.5 - self.cy)) / self.fy
        return math.hypot(x, y)

    def _bearings(self, u: Array, v: Array) -> Components:
        x, y = self._distortion.undistort((u - self.cx) / self.fx, (v - self.cy) / self.fy)
        # numpy's hypot takes twenty times as long as the root; where the square is too large, none is a number.
        square = x * x + y * y + 1.0
        inverse = np.sqrt(square) / square
        return x * inverse, y * inverse, inverse

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        depth = np.where(z > 0.0, z, np.nan)
        x_distorted, y_distorted = self._distortion.distort(x / depth, y / depth)
        return self.fx * x_distorted + self.cx, self.fy * y_distorted + self.cy
