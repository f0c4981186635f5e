"""The omnidirectional camera of Scaramuzza, the polynomial model of the paper's section 2."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property

import numpy as np

from regionpose.cameras.base import (
    LIMIT_SLACK,
    Camera,
    Components,
    finite_numbers,
    image_length,
)
from regionpose.cameras.inversion import Rows, bracketed_roots, derivative, first_positive_root, polynomial
from regionpose.validation.arrays import Array, finite_array

Stretch = tuple[tuple[float, float], tuple[float, float]]

SMALLEST_DETERMINANT = 1e-6
"""Determinant of the stretch below which it flattens the image; calibrated ones lie within some percent of 1."""


@dataclass(frozen=True)
class OcamCamera(Camera):
    """The omnidirectional camera of Scaramuzza: bearings are a polynomial over the image plane, as in OCamCalib.

    It is the camera of the paper, section 2, eq. 1 to 4.

    A pixel is `center + stretch (x, y)`, x right and y down in pixels; it sees along `(x, y, g(rho))`, `rho = |(x,
    y)|`, `g = a0 + a1 rho + a2 rho^2 + ...`: z is forward (docs/math.md, eq. 9.7). Rays may leave by more than 90
    degrees off the axis, where `g < 0`. `project` inverts this polynomial itself; the pixel is as exact as its rounding
    except within a pixel or so of the fold (`max_angle`), where the angle no longer grows with rho and so hardly
    determines rho.

    OCamCalib writes the same model with x along the rows, y along the columns and the axis backward: `(row, column) =
    center + [[c, d], [e, 1]] (x', y')`, bearing `(x', y', ss(rho))` with `ss0 < 0`. So `x = y'`, `y = x'`, `a = -ss`,
    center (column, row), stretch `((1, e), (d, c))`: `from_ocamcalib`.

    Parameters
    ----------
    polynomial : tuple of float
        `(a0, a1, ...)` of any length, `a0 > 0`.
    center : tuple of 2 float
        Column and row, pixels.
    stretch : (2, 2) tuples
        Of the plane onto the image, the identity by default.
    width, height : int, optional
        Of the image, pixels; None where unknown.

    Raises
    ------
    ValueError
        For an empty polynomial, `a0` not positive, a number that is not finite, a stretch that is not (2, 2) or not
        invertible.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.cameras.OcamCamera((300.0, 0.0, -1e-3), (640.0, 480.0)).bearings([[640.0, 480.0]]).tolist()
    [[0.0, 0.0, 1.0]]
    """

    polynomial: tuple[float, ...]
    center: tuple[float, ...]
    _: KW_ONLY
    stretch: Stretch = ((1.0, 0.0), (0.0, 1.0))
    width: int | None = None
    height: int | None = None

    def __post_init__(self) -> None:
        """Check the parameters and store them as plain numbers."""
        store = object.__setattr__
        store(self, "polynomial", finite_numbers("polynomial", self.polynomial))
        store(self, "center", finite_numbers("center", self.center))
        store(self, "width", image_length("width", self.width))
        store(self, "height", image_length("height", self.height))
        store(self, "stretch", _stretch(self.stretch))
        if not self.polynomial or self.polynomial[0] <= 0.0:
            found = self.polynomial[0] if self.polynomial else "no coefficients"
            raise ValueError(f"polynomial: found {found}; needed a first coefficient a0 above 0 (z forward)")
        if len(self.center) != 2:
            raise ValueError(f"center: found {len(self.center)} numbers; needed 2 (column, row)")

    @classmethod
    def from_ocamcalib(
        cls,
        ss: tuple[float, ...],
        center: tuple[float, float],
        cde: tuple[float, float, float] = (1.0, 0.0, 0.0),
        *,
        width: int | None = None,
        height: int | None = None,
    ) -> OcamCamera:
        """The camera of OCamCalib's `ss` (ascending, ss0 < 0), center as (row, column) from 0, and `c, d, e`."""
        c, d, e = cde
        row, column = center
        forward = tuple(0.0 - coefficient for coefficient in ss)
        return cls(forward, (column, row), stretch=((1.0, e), (d, c)), width=width, height=height)

    @cached_property
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians: where it stops growing with rho, or its limit."""
        if math.isfinite(self._rho_limit):
            return math.atan2(self._rho_limit, float(polynomial(self.polynomial, np.array(self._rho_limit))))
        leading = np.trim_zeros(self.polynomial, "b")
        if len(leading) == 1:
            return math.pi / 2.0
        return math.atan2(1.0, leading[1]) if len(leading) == 2 else math.pi

    @property
    def straight_lines(self) -> bool:
        """Whether g is constant: a perspective camera."""
        return not any(self.polynomial[1:])

    @cached_property
    def _rho_limit(self) -> float:
        """First rho at which the angle off the axis stops growing: `g - rho g' = sum of (1 - i) a_i rho^i` is zero."""
        return first_positive_root(np.asarray(self.polynomial) * (1.0 - np.arange(len(self.polynomial))))

    @cached_property
    def _inverse_stretch(self) -> Array:
        return np.linalg.inv(np.asarray(self.stretch))

    def _scaled(self, horizontal: float, vertical: float, size: tuple[int | None, int | None]) -> OcamCamera:
        # With rho in pixels of the new size, g(rho) grows by the mean factor; the stretch takes what differs from it.
        mean = math.sqrt(horizontal * vertical)
        (xx, xy), (yx, yy) = self.stretch
        across, down = horizontal / mean, vertical / mean
        return replace(
            self,
            polynomial=tuple(a * mean ** (1 - power) for power, a in enumerate(self.polynomial)),
            center=(horizontal * (self.center[0] + 0.5) - 0.5, vertical * (self.center[1] + 0.5) - 0.5),
            stretch=((across * xx, across * xy), (down * yx, down * yy)),
            width=size[0],
            height=size[1],
        )

    def _bearings(self, u: Array, v: Array) -> Components:
        (xx, xy), (yx, yy) = self._inverse_stretch
        du, dv = u - self.center[0], v - self.center[1]
        x, y = xx * du + xy * dv, yx * du + yy * dv
        rho = np.hypot(x, y)
        rho[rho > self._rho_limit] = np.nan
        z = polynomial(self.polynomial, rho)
        norm = np.hypot(rho, z)
        return x / norm, y / norm, z / norm

    def _project(self, x: Array, y: Array, z: Array) -> Components:
        off_axis = np.hypot(x, y)
        norm = np.hypot(off_axis, z)
        angle = np.arctan2(off_axis, z)
        visible = (angle <= self.max_angle * (1.0 + LIMIT_SLACK)) & ((off_axis > 0.0) | (z > 0.0))
        rho = np.full_like(x, np.nan)
        rho[visible] = self._rho(off_axis[visible] / norm[visible], z[visible] / norm[visible])
        scale = np.where(off_axis > 0.0, rho / off_axis, rho)
        (xx, xy), (yx, yy) = self.stretch
        dx, dy = x * scale, y * scale
        return xx * dx + xy * dy + self.center[0], yx * dx + yy * dy + self.center[1]

    def _rho(self, sine: Array, cosine: Array) -> Array:
        """Roots of `rho cos - g(rho) sin`, negative below and positive above the rho that sees at that angle."""
        slope = derivative(self.polynomial)

        def residual(rho: Array, rows: Rows) -> tuple[Array, Array]:
            s, c = sine[rows], cosine[rows]
            return rho * c - polynomial(self.polynomial, rho) * s, c - polynomial(slope, rho) * s

        start = self.polynomial[0] * np.arctan2(sine, cosine)
        return bracketed_roots(residual, start, self._rho_limit)


def _stretch(values: object) -> Stretch:
    """`values` as an invertible 2 by 2 matrix of plain numbers."""
    matrix = finite_array(values, "stretch", (2, 2))
    (xx, xy), (yx, yy) = matrix.tolist()
    if not abs(xx * yy - xy * yx) > SMALLEST_DETERMINANT:
        raise ValueError(f"stretch: found {matrix.tolist()}; needed an invertible matrix")
    return (xx, xy), (yx, yy)
