"""The places of a photo where two dark and two bright corners meet, as the squares of a chessboard do."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from regionpose.validation.arrays import Array

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

BLUR_PX = 1.5
"""Standard deviation of the smoothing before derivatives are taken, pixels: squares of 8 px stay apart, and noise of 5
levels leaves a corner's contrast a spread of 2.6."""

LEAST_CONTRAST = 10.0
"""Levels of 255 between dark and bright below which noise of 5 levels (four times its spread) makes corners."""

LEAST_FRACTION, AROUND_PX = 0.35, 9
"""Contrast of a corner over that of all pixels around it, in a square of so many pixels, at the least. Corners of real
boards have 0.55 to 0.8 (less by the sine of the crossing angle), steps of a jagged edge up to 0.3."""

APART_PX = 5
"""Side in pixels of the square in which only the clearest corner counts, below the least square of a board."""

FIT_STEPS = 3
"""Newton steps from the clearest pixel to the saddle point; each squares what is left, at first half a pixel."""

FIT_REACH = 1.5
"""Pixels that a saddle point may lie from its clearest pixel, half a diagonal and blur's asymmetry."""


class Corners(NamedTuple):
    """X corners of a smoothed picture (h, w).

    `places` (n, 2): pixels (x, y). `bright` (n,): directions in radians along which the bright squares lie, modulo pi.
    `contrasts` (n,): levels between dark and bright, times the sine of the angle at which the edges cross.
    """

    picture: Floats
    places: Array
    bright: Array
    contrasts: Array


def x_corners(gray: NDArray[np.uint8]) -> Corners:
    """The X corners of a picture (h, w) uint8: saddle points of its brightness, found to a part of a pixel.

    Where edges of contrast c cross at an angle a, smoothing by s leaves a Hessian of determinant
    -(c sin a / (pi s^2))^2: the product of two error functions, each of slope sqrt(2 / pi) / s.
    """
    picture = np.asarray(ndimage.gaussian_filter(gray.astype(np.float32), BLUR_PX))
    down, across = _slope(picture, 0), _slope(picture, 1)
    yy, xy, xx = _slope(down, 0), _slope(down, 1), _slope(across, 1)
    contrast = np.pi * BLUR_PX**2 * np.sqrt(np.maximum(xy**2 - xx * yy, 0.0))
    around = ndimage.maximum_filter(picture, AROUND_PX) - ndimage.minimum_filter(picture, AROUND_PX)
    clear = contrast >= np.maximum(LEAST_CONTRAST, LEAST_FRACTION * around)
    peaks = clear & (contrast == ndimage.maximum_filter(contrast, APART_PX))
    rows, columns = np.nonzero(peaks)
    start = np.stack([columns, rows], axis=1).astype(np.float64)
    places = _saddles(start, (across, down), (xx, xy, yy))
    kept = np.hypot(*(places - start).T) <= FIT_REACH
    rows, columns = rows[kept], columns[kept]
    bright = 0.5 * np.arctan2(2.0 * xy[rows, columns], xx[rows, columns] - yy[rows, columns])
    return Corners(picture, places[kept], bright.astype(np.float64), contrast[rows, columns].astype(np.float64))


def _slope(values: Floats, axis: int) -> Floats:
    """Central differences along an axis."""
    return np.asarray(ndimage.correlate1d(values, [-0.5, 0.0, 0.5], axis=axis, mode="nearest"))


def _saddles(start: Array, slopes: tuple[Floats, Floats], curvatures: tuple[Floats, Floats, Floats]) -> Array:
    """Where the slope vanishes near each place (n, 2), by Newton's method; inf where curvature does, too."""
    places = start.copy()
    for _ in range(FIT_STEPS):
        at = np.clip(places, start - FIT_REACH, start + FIT_REACH)[:, ::-1].T
        x, y, xx, xy, yy = (ndimage.map_coordinates(f, at, order=1, mode="nearest") for f in (*slopes, *curvatures))
        determinant = xx * yy - xy**2
        flat = determinant >= 0.0
        step = np.stack([yy * x - xy * y, xx * y - xy * x], axis=1) / np.where(flat, 1.0, determinant)[:, None]
        places = np.where(flat[:, None], np.inf, at.T[:, ::-1] - step)
    return places
