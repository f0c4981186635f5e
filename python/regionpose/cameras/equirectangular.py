"""The equirectangular panorama: columns are longitudes, rows latitudes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from regionpose.cameras.base import LIMIT_SLACK, Camera, Components, image_length
from regionpose.validation.arrays import Array


@dataclass(frozen=True)
class EquirectangularCamera(Camera):
    """The camera of a 360 degree panorama, known by the size of its image alone.

    Columns are evenly spaced longitudes, one turn over the width; rows are latitudes with the same spacing, the horizon
    in the middle (docs/math.md, eq. 9.12). The axis z points to the image's middle, y down. The left side continues the
    right one: pixels beyond either are those of the other, and a polygon may go on across the seam.

    Parameters
    ----------
    width, height : int
        Of the image, pixels; the height is half the width, or less where the zenith and the nadir are cut alike.

    Raises
    ------
    ValueError
        For a size that is no whole number from 1 on, or a height above half the width.

    Examples
    --------
    >>> import numpy as np, regionpose as rp
    >>> camera = rp.cameras.EquirectangularCamera(3600, 1800)
    >>> np.round(camera.project([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), 3).tolist()
    [[1799.5, 899.5], [2699.5, 899.5]]
    """

    width: int
    height: int

    def __post_init__(self) -> None:
        """Check the size."""
        for name in ("width", "height"):
            length = image_length(name, getattr(self, name))
            if length is None:
                raise ValueError(f"{name}: found None; needed the size of the panorama, which is its calibration")
            object.__setattr__(self, name, length)
        if 2 * self.height > self.width + 1:
            found = f"{self.height} for a width of {self.width}"
            raise ValueError(f"height: found {found}; needed half the width, or less: the image shows one turn")

    @property
    def max_angle(self) -> float:
        """Largest angle off the axis, in radians: pi."""
        return math.pi

    @property
    def straight_lines(self) -> bool:
        """False: a panorama bends straight lines."""
        return False

    @property
    def period(self) -> float:
        """Pixels after which columns repeat: the width."""
        return float(self.width)

    @property
    def _pixels_per_rad(self) -> float:
        return self.width / (2.0 * math.pi)

    def _scaled(self, horizontal: float, vertical: float, size: tuple[int | None, int | None]) -> EquirectangularCamera:
        width, height = size
        assert width is not None and height is not None
        return replace(self, width=width, height=height)

    def _bearings(self, u: Array, v: Array) -> Components:
        longitude = (u - 0.5 * (self.width - 1)) / self._pixels_per_rad
        latitude = (v - 0.5 * (self.height - 1)) / self._pixels_per_rad
        # Half a pixel of rounding beyond the poles, where the image ends, is still the pole.
        limit = 0.5 * math.pi * (1.0 + 1.0 / self.width) * (1.0 + LIMIT_SLACK)
        latitude[np.abs(latitude) > limit] = np.nan
        level = np.cos(latitude)
        return level * np.sin(longitude), np.sin(latitude), level * np.cos(longitude)

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        level = np.hypot(x, z)
        longitude = np.arctan2(x, z)
        latitude = np.arctan2(y, level)
        latitude[(level == 0.0) & (y == 0.0)] = np.nan
        u = self._pixels_per_rad * longitude + 0.5 * (self.width - 1)
        return u, self._pixels_per_rad * latitude + 0.5 * (self.height - 1)
