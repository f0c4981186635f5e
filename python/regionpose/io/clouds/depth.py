"""The cloud of a depth image, for any central camera."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.reading import FileError, read_pixels
from regionpose.validation.arrays import Array

DEPTH_MODES = ("I;16", "I;16B", "I;16L", "I", "F")
"""Pillow's modes of images with one channel of more than 8 bits."""

PER_PIXEL = 25
"""A quarter of the bytes that a pixel takes on its way to a point."""

Distance = Literal["z", "range"]


class DepthCamera(Protocol):
    """Protocol of a depth image's camera; every camera of `regionpose.cameras` satisfies it."""

    @property
    def width(self) -> int | None:
        """Image width in pixels, None when unknown."""

    @property
    def height(self) -> int | None:
        """Image height in pixels, None when unknown."""

    def bearings(self, pixels: ArrayLike) -> Array:
        """Unit vectors (n, 3) of the pixels (n, 2), NaN where there is none."""


def cloud_from_depth(
    camera: DepthCamera,
    depth: ArrayLike | str | Path,
    *,
    unit_m: float | None = None,
    distance: Distance = "z",
    colors: ArrayLike | None = None,
) -> Cloud:
    """The points that a depth image (h, w) shows, in the camera frame and in meters.

    The pixel (u, v) with the bearing `r` and the depth `d` is the point `d r / r_z` for `distance="z"`, and `d r` for
    `"range"`. Pixels without a measurement (zero, negative, NaN or infinite) or without a ray (for z: none ahead of the
    camera) are dropped.

    Parameters
    ----------
    camera : DepthCamera
        Of the depth image; every camera of this package is one.
    depth : (h, w) array, str or Path
        Or an image file of 16-bit integers or floats.
    unit_m : float, optional
        Meters of one unit of the values (1/5000 for TUM, 1/256 for KITTI's depth maps); integers need it, floats take
        1.
    distance : {"z", "range"}
        Whether values are depths along the optical axis, or lengths of rays.
    colors : (h, w, 3) array, optional
        The pixels'.

    Raises
    ------
    CloudError
        A ValueError, for other shapes, an image size other than the camera's, and where nothing is left.
    FileNotFoundError
        Where the file is missing.
    """
    source = Path(depth) if isinstance(depth, str | Path) else None
    values = _image(source) if source is not None else np.asarray(depth)
    meters = _meters(values, unit_m, source)
    height, width = meters.shape
    stated = (camera.height or height, camera.width or width)
    if stated != (height, width):
        raise cloud_error(source, "depth", f"{width} x {height} pixels", f"the camera's {stated[1]} x {stated[0]}")
    shades = None if colors is None else np.asarray(colors)
    if shades is not None and shades.shape != (height, width, 3):
        raise cloud_error(source, "colors", f"shape {shades.shape}", f"({height}, {width}, 3)")
    measured = np.flatnonzero(np.isfinite(meters) & (meters > 0.0))
    rows, columns = np.divmod(measured, width)
    rays = camera.bearings(np.stack([columns, rows], axis=1))
    points = np.full((meters.size, 3), np.nan)
    points[measured] = rays * _ray_lengths(meters.reshape(-1)[measured], rays[:, 2], distance)[:, None]
    colors = None if shades is None else shades.reshape(-1, 3)
    return Cloud.from_points(points, colors=colors, source=source).scanned_from(np.zeros(3))


def _ray_lengths(meters: Array, cosines: Array, distance: str) -> Array:
    """How far along its bearing each pixel's point is, NaN where there is none."""
    if distance not in ("z", "range"):
        raise ValueError(f"distance: found {distance!r}; needed 'z' or 'range'")
    if distance == "range":
        return meters
    lengths = np.full(len(meters), np.nan)
    np.divide(meters, cosines, out=lengths, where=cosines > 0.0)
    return lengths


def _meters(values: Scalars, unit_m: float | None, source: Path | None) -> Array:
    """Depths (h, w) in meters."""
    if values.ndim != 2 or not values.size or values.dtype.kind not in "iuf":
        raise cloud_error(source, "depth", f"{values.dtype} of shape {values.shape}", "numbers of shape (h, w)")
    if unit_m is None and values.dtype.kind != "f":
        raise cloud_error(
            source, "unit_m", "none for depths in whole numbers", "meters a unit, as in 1/1000 for millimeters"
        )
    factor = 1.0 if unit_m is None else float(unit_m)
    if not (np.isfinite(factor) and factor > 0.0):
        raise cloud_error(source, "unit_m", factor, "a finite number above 0")
    return values.astype(np.float64) * factor


def _image(path: Path) -> Scalars:
    """The values of an image file with one channel of more than 8 bits."""
    try:
        values, mode, _ = read_pixels(path, per_pixel=PER_PIXEL)
    except FileError as error:
        raise CloudError(str(error)) from error
    if mode not in DEPTH_MODES:
        raise cloud_error(path, "depth image", f"mode {mode}", "one channel of 16-bit integers or of floats")
    return values
