"""What cameras share whose focal lengths and center map a plane to pixels: the matrix K."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from regionpose.cameras.base import Camera, finite_number, image_length, positive_number
from regionpose.validation.arrays import Array, finite_array


class MatrixCamera(Camera):
    """A camera with the matrix K: pixels are `(fx x + cx, fy y + cy)` of points (x, y) of a plane."""

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        """Check focal lengths, center and size, and store them as plain numbers."""
        store = object.__setattr__
        store(self, "fx", positive_number("fx", self.fx))
        store(self, "fy", positive_number("fy", self.fy))
        store(self, "cx", finite_number("cx", self.cx))
        store(self, "cy", finite_number("cy", self.cy))
        store(self, "width", image_length("width", self.width))
        store(self, "height", image_length("height", self.height))

    @property
    def matrix(self) -> Array:
        """The matrix K (3, 3), which takes a point (x, y, 1) of the plane to a pixel (u, v, 1)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def zoomed(self, factor: float) -> Self:
        """The same with its focal lengths multiplied by a factor; ValueError for one that is not above 0."""
        factor = positive_number("factor", factor)
        return replace(self, fx=factor * self.fx, fy=factor * self.fy)  # type: ignore[type-var]

    def _scaled(self, horizontal: float, vertical: float, size: tuple[int | None, int | None]) -> Self:
        # Corners stay corners: they lie half a pixel outside the outermost centers.
        cx, cy = horizontal * (self.cx + 0.5) - 0.5, vertical * (self.cy + 0.5) - 0.5
        fx, fy = horizontal * self.fx, vertical * self.fy
        return replace(self, fx=fx, fy=fy, cx=cx, cy=cy, width=size[0], height=size[1])  # type: ignore[type-var]


def intrinsics_of(matrix: ArrayLike) -> tuple[float, float, float, float]:
    """`(fx, fy, cx, cy)` of a matrix K (3, 3) without skew; ValueError otherwise."""
    k = finite_array(matrix, "matrix", (3, 3))
    if k[0, 1] != 0.0 or k[1, 0] != 0.0:
        raise ValueError(f"matrix: found a skew of {k[0, 1]} and {k[1, 0]}; needed 0 off the diagonal")
    if tuple(k[2]) != (0.0, 0.0, 1.0):
        raise ValueError(f"matrix: found the last row {k[2].tolist()}; needed [0, 0, 1]")
    return float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])
