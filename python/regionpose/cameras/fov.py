"""The field-of-view camera of Devernay and Faugeras, whose distortion is an arc tangent."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass

import numpy as np

from regionpose.cameras.base import Components, positive_number
from regionpose.cameras.matrix import MatrixCamera
from regionpose.validation.arrays import Array


@dataclass(frozen=True)
class FovCamera(MatrixCamera):
    """The field-of-view camera of Devernay and Faugeras, called ATAN by PTAM and direct_visual_lidar_calibration.

    A point at the radius `r` of the normalized plane is seen at `atan(2 r tan(omega / 2)) / omega` (Devernay and
    Faugeras 2001; docs/math.md, eq. 9.13).

    Parameters
    ----------
    fx, fy : float
        Focal lengths, pixels, above 0.
    cx, cy : float
        Where the optical axis meets the image, pixels.
    omega : float
        Field of view of the ideal fisheye, radians, above 0 and below pi.
    width, height : int, optional
        Of the image, pixels; None where unknown.

    Raises
    ------
    ValueError
        For a focal length or omega that is not positive, an omega of pi or more, a number that is not finite.

    Examples
    --------
    >>> import numpy as np, regionpose as rp
    >>> camera = rp.cameras.FovCamera(300.0, 300.0, 320.0, 240.0, omega=np.pi / 2)
    >>> np.round(camera.project([[0.5, 0.0, 1.0]]), 6).tolist()
    [[470.0, 240.0]]
    """

    fx: float
    fy: float
    cx: float
    cy: float
    _: KW_ONLY
    omega: float
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        """Check the parameters and store them as plain numbers."""
        super().__post_init__()
        object.__setattr__(self, "omega", positive_number("omega", self.omega))
        if self.omega >= math.pi:
            raise ValueError(f"omega: found {self.omega}; needed an angle below pi, radians")

    @property
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians: pi / 2."""
        return math.pi / 2.0

    @property
    def straight_lines(self) -> bool:
        """False: the arc tangent bends straight lines."""
        return False

    @property
    def _slope(self) -> float:
        return 2.0 * math.tan(0.5 * self.omega)

    def _bearings(self, u: Array, v: Array) -> Components:
        x, y = (u - self.cx) / self.fx, (v - self.cy) / self.fy
        distorted = np.hypot(x, y)
        turn = self.omega * distorted
        # Sine and cosine rather than the tangent, which is infinite at the rim.
        along, across = self._slope * np.cos(turn), np.where(distorted > 0.0, np.sin(turn) / distorted, self.omega)
        across[turn >= 0.5 * math.pi] = np.nan
        norm = np.hypot(distorted * across, along)
        return x * across / norm, y * across / norm, along / norm

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        depth = np.where(z > 0.0, z, np.nan)
        off_axis = np.hypot(x, y)
        turn = np.arctan2(self._slope * off_axis, depth)
        scale = np.where(off_axis > 0.0, turn / (self.omega * off_axis), self._slope / (self.omega * depth))
        return self.fx * x * scale + self.cx, self.fy * y * scale + self.cy
