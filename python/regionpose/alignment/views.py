"""What a photo shows of a cloud: the angles of its pixels, and which of them regions cover."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from regionpose.alignment.photo import Photo
from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion
from regionpose.validation.arrays import check_coordinates, real_array, row_array

Array = NDArray[np.float64]

EDGE_FRACTION = 0.1
"""An edge goes beyond the near surface's plane by this fraction of the inverse distance: several times range noise."""

CELL_PX = 2.0
"""Pixels within which the nearest point hides others: less than the narrowest spread of edges."""

WIDEST_GAP_DEG = 0.7
"""Neighbors farther apart leave open where between them a surface ends: two lines of 64 beams are 0.4 apart."""

GAP_SPACINGS = 4.0
"""Gap over the mean spacing of points: neighbors on all sides, where lines are five times as far apart as samples."""

BESIDE_PX = 10.0
"""Edges within so many pixels of a region are those that the region's own evidence holds: convention."""


def checked_points(points: ArrayLike) -> Array:
    """Points (n, 3); ValueError for another shape, or one that is too far away to be calculated with."""
    places = row_array(points, "points", 3)
    check_coordinates(places)
    return places


def checked_intensity(intensity: ArrayLike | None, points: Array) -> Array | None:
    """One value (n,) a point, if there are any; ValueError for another shape."""
    if intensity is None:
        return None
    values = real_array(intensity, "intensity", "(n,)").astype(np.float64)
    if values.shape != points.shape[:1]:
        raise ValueError(f"intensity has shape {values.shape}; needed ({len(points)},), one value a point")
    return values


def cell_and_gap(camera: Camera, photo: Photo, count: int, solid_angle: float) -> tuple[float, float]:
    """Angles within which the nearest point hides others, and beyond which neighbors are none, rad, of so many points
    in a solid angle.
    """
    spacing = float(np.sqrt(solid_angle / max(count, 1)))
    cell = CELL_PX * pixel_angle(camera, photo)
    return cell, max(2.0 * cell, min(float(np.radians(WIDEST_GAP_DEG)), GAP_SPACINGS * spacing))


def region_mask(photo: Photo, camera: Camera, regions: Sequence[ImageRegion]) -> NDArray[np.bool_] | None:
    """Which pixels (h, w) of the reduced photo lie in or beside regions; None without any."""
    if not regions:
        return None
    outlines = [shapely.Polygon(ring).buffer(BESIDE_PX) for region in regions for ring in region.rings]
    union = shapely.union_all(outlines)
    shapely.prepare(union)
    height, width = photo.luminance.shape
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    pixels = photo.pixels(np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float64))
    covered = shapely.contains_xy(union, pixels[:, 0], pixels[:, 1])
    if camera.period is not None:
        covered |= shapely.contains_xy(union, pixels[:, 0] + camera.period, pixels[:, 1])
    return np.asarray(covered).reshape(height, width)


def pixel_angle(camera: Camera, photo: Photo) -> float:
    """The angle of a pixel of the photo in its middle, rad; ValueError where the camera sees no ray there."""
    x, y = photo.pixels(0.5 * np.array(photo.luminance.shape[::-1]))
    ends = camera.bearings([[x, y], [x + photo.reduction, y]])
    if not np.isfinite(ends).all():
        height, width = photo.shape
        found = f"no ray at the middle of {width} x {height} pixels, ({x:g}, {y:g})"
        raise ValueError(f"camera: found {found}; needed the camera that took the photo")
    return float(np.linalg.norm(ends[1] - ends[0]))


def half_field(camera: Camera, photo: Photo) -> float:
    """The largest angle between the optical axis and what the photo shows, rad."""
    height, width = (photo.reduction * size for size in photo.luminance.shape)
    x, y = np.linspace(-0.5, width - 0.5, 17), np.linspace(-0.5, height - 0.5, 17)
    sides = [np.column_stack([x, np.full(17, end)]) for end in (-0.5, height - 0.5)]
    sides += [np.column_stack([np.full(17, end), y]) for end in (-0.5, width - 0.5)]
    cosines = camera.bearings(np.concatenate(sides))[:, 2]
    # A fisheye's photo may show more than the lens does: there are no bearings at its corners.
    return camera.max_angle if np.isnan(cosines).any() else float(np.arccos(np.clip(cosines.min(), -1.0, 1.0)))
