"""The tilted sensor of OpenCV's distortion: a homography of the normalized image plane (docs/math.md, eq. 9.5b)."""

from __future__ import annotations

import math

import numpy as np

from regionpose.validation.arrays import Array


def tilt_matrix(tau_x: float, tau_y: float) -> Array:
    """The homography (3, 3) of a sensor turned by `tau_x` and then `tau_y`, radians; it keeps the point 0.

    Raises
    ------
    ValueError
        For a sensor turned by a quarter or more, which the axis does not meet from the front.
    """
    if not max(abs(tau_x), abs(tau_y)) < math.pi / 2.0:
        raise ValueError(f"distortion: found a tilt of {tau_x} and {tau_y} rad; needed less than a quarter turn")
    cosine, sine = math.cos(tau_x), math.sin(tau_x)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cosine, sine], [0.0, -sine, cosine]])
    cosine, sine = math.cos(tau_y), math.sin(tau_y)
    about_y = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    turn = about_y @ about_x
    onto_sensor = np.array([[turn[2, 2], 0.0, -turn[0, 2]], [0.0, turn[2, 2], -turn[1, 2]], [0.0, 0.0, 1.0]])
    return np.asarray(onto_sensor @ turn)


def mapped(homography: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Points (n,), (n,) by a homography; NaN on and beyond its horizon."""
    (xx, xy, x1), (yx, yy, y1), (wx, wy, w1) = homography
    depth = wx * x + wy * y + w1
    depth = np.where(depth > 0.0, depth, np.nan)
    return (xx * x + xy * y + x1) / depth, (yx * x + yy * y + y1) / depth
