"""The plane of a region's points and where they lie on it, or that they lie on one line."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from regionpose._core import robust_plane
from regionpose.validation.arrays import LARGEST_COORDINATE, Array, check_coordinates, check_extent, row_array

ROUNDING = 64.0
"""Rounding errors of a coordinate that a distance from a plane may hold."""

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

INLIER_SIGMAS = 3.0
"""Distance from the plane up to which noise puts points of it, standard deviations: a convention."""

REGION_THICKNESS = 0.02
"""Distance from the plane, over the extent of the points, up to which points belong to the region: frames and mouldings
of a face stand out from it, and the image shows them as part of it."""

LEAST_APPROACH = 0.1
"""Sine of the least angle between beam and plane at which samples move along the beam: a flatter one takes them far."""

PARABOLA = 3
"""Terms of a scan line over a patch: it is a conic, and the patch far smaller."""

LINE_STEPS = 0.25
"""Root mean square distance from a parabola, in steps along it, below which samples are one scan line: two lines with a
tenth of the samples on one of them, two steps apart, are 0.6."""

MOST_SAMPLES = 20_000
"""Samples from which a plane and an outline are taken: 140 across the patch determine its area to a thousandth, and
more change the plane by less than a hundredth of the noise."""


class PlaneSamples(NamedTuple):
    """A plane and the samples of a region on it.

    `origin` (3,), `axes` (3, 3): rows u, v, normal. `thickness`: distance from the plane, meters, up to which points of
    the region belong to it; `noise`, up to which noise puts points of the plane. `flat`: the samples (n, 2) in its
    coordinates, moved onto it along the normal or their beams.
    """

    origin: Array
    axes: Array
    thickness: float
    noise: float
    flat: Array

    def lifted(self, places: Iterable[Array]) -> list[Array]:
        """The world points of places in the plane's coordinates, (n, 3) of each (n, 2)."""
        return [self.origin + flat @ self.axes[:2] for flat in places]


def plane_samples(points: ArrayLike, sensor_origin: ArrayLike | None = None) -> PlaneSamples:
    """The robust plane of points (n, 3) and those near it moved onto it; ValueError as of `outline_of_points`."""
    given, sensor = checked_points(points), checked_sensor(sensor_origin)
    origin, axes, _ = robust_plane(given[:: max(1, len(given) // MOST_SAMPLES)], sensor)
    samples = flat_samples(given, origin, axes, sensor)
    if _on_one_line(samples.flat) if sensor is None else is_on_one_scan_line(given, sensor):
        raise ValueError(f"{len(given)} points lie on one scan line; needed points on lines across the patch")
    return samples


def is_on_one_scan_line(points: Array, sensor: Array) -> bool:
    """Whether points (n, 3) lie on one scan line of a sensor at (3,), wherever range noise puts them."""
    # Three may be the corners of a triangle, but for a sensor's steps.
    return _on_one_line(_sights(points, sensor), min(PARABOLA, len(points) - 1))


def _on_one_line(points: Array, terms: int = PARABOLA) -> bool:
    """Whether points (n, 2) lie on one scan line: a conic in the plane, and over a patch a parabola or less."""
    points = thinned(points)
    freedom = len(points) - terms
    centered = points - points.mean(axis=0)
    along, across = (centered @ np.linalg.svd(centered, full_matrices=False)[2].T).T
    length = float(np.abs(along).max())
    if not (freedom > 0 and length > 0.0):
        return False
    parabola = np.vander(along / length, terms)
    off = across - parabola @ np.linalg.lstsq(parabola, across, rcond=None)[0]
    step = float(np.median(np.asarray(cKDTree(points).query(points, 2)[0])[:, 1]))
    return bool(np.sqrt(np.sum(off**2) / freedom) < LINE_STEPS * step)


def thinned(points: Array) -> Array:
    """The samples (n, 2), or where they are many one a cell of a grid, which keeps them even."""
    extent = np.ptp(points, axis=0)
    size = float(np.sqrt(np.prod(np.maximum(extent, extent.max() / MOST_SAMPLES)) / MOST_SAMPLES))
    if len(points) <= MOST_SAMPLES or size == 0.0:
        return points
    cells = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    return points[np.unique(cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1], return_index=True)[1]]


def flat_samples(points: Array, origin: Array, axes: Array, sensor: Array | None) -> PlaneSamples:
    """The samples of the region near the plane, moved onto it along the normal or the beams."""
    heights = (points - origin) @ axes[2]
    sigma = MAD_TO_SIGMA * np.median(np.abs(heights))
    extent = float(np.ptp(points, axis=0).max())
    rounding = ROUNDING * float(np.finfo(float).eps * np.abs(points).max())
    noise = max(INLIER_SIGMAS * float(sigma), rounding)
    thickness = max(noise, REGION_THICKNESS * extent)
    near = np.abs(heights) <= thickness
    moved = points[near] - origin
    if sensor is not None:
        beams = points[near] - sensor
        beams /= np.maximum(np.linalg.norm(beams, axis=1, keepdims=True), np.finfo(float).tiny)
        approach = beams @ axes[2]
        steep = np.abs(approach) >= LEAST_APPROACH
        moved -= np.where(steep, heights[near] / np.where(steep, approach, 1.0), 0.0)[:, None] * beams
    return PlaneSamples(origin, axes, thickness, noise, moved @ axes[:2].T)


def _sights(points: Array, sensor: Array) -> Array:
    """Where the beams of points (n, 3) pass a plane before the sensor, (n, 2): range noise leaves them in place."""
    beams = points - sensor
    beams = beams[np.linalg.norm(beams, axis=1) > 0.0]
    ahead = np.sum(beams / np.linalg.norm(beams, axis=1, keepdims=True), axis=0)
    axes = _axes_of(ahead / np.linalg.norm(ahead))
    depth = np.maximum(beams @ axes[2], LEAST_APPROACH * np.linalg.norm(beams, axis=1))
    sights: Array = beams @ axes[:2].T / depth[:, None]
    return sights


def checked_points(points: ArrayLike) -> Array:
    """The points (n, 3) of a region; ValueError for values that are not finite and fewer than 3 that differ."""
    given = row_array(points, "points", 3)
    wrong = np.flatnonzero(~np.isfinite(given).all(axis=1))
    if len(wrong):
        raise ValueError(f"point {wrong[0]} is {given[wrong[0]].tolist()}; needed finite coordinates")
    check_coordinates(given)
    distinct = given[(given != given[0]).any(axis=1)] if len(given) else given
    if len(distinct) < 2 or (distinct == distinct[0]).all():
        raise ValueError(f"{len(given)} points are given, of which fewer than 3 differ; needed at least 3")
    check_extent(given)
    return given


def checked_sensor(sensor_origin: ArrayLike | None) -> Array | None:
    """The sensor's place (3,), if it is given; ValueError otherwise."""
    if sensor_origin is None:
        return None
    sensor = np.asarray(sensor_origin, dtype=np.float64)
    if sensor.shape != (3,) or not (np.abs(sensor) <= LARGEST_COORDINATE).all():
        needed = f"3 coordinates of at most {LARGEST_COORDINATE:.1e}"
        raise ValueError(f"sensor_origin is {np.asarray(sensor_origin).tolist()}; needed {needed}")
    return sensor


def _axes_of(normal: Array) -> Array:
    """Right-handed axes u, v, normal as rows (3, 3)."""
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(normal, u), normal])
