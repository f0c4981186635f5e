"""What a scan knows of a region that a single scan line crosses: places on that line, whatever the region's plane.

A sparse lidar meets a small region once. Its returns show a line of the region's plane and not the plane, but where the
region begins and ends along that line needs no more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from regionpose._core import robust_plane
from regionpose.regions.plane_samples import (
    MOST_SAMPLES,
    PlaneSamples,
    checked_points,
    checked_sensor,
    flat_samples,
    is_on_one_scan_line,
)
from regionpose.regions.scan_samples import (
    BESIDE,
    EDGE_SAMPLES,
    OTHER_SAMPLES,
    Mask,
    ScanSamples,
    Sight,
    joined,
    other_places,
    subsample,
)
from regionpose.validation.arrays import Array


class LineSamples(NamedTuple):
    """Places on a line, in coordinates of a plane through it whose first axis it is, and the strip about it.

    `plane`: the one that faces the scanner. `strip` (4, 2): a ring around the places inside, as wide as they are apart.
    """

    plane: PlaneSamples
    strip: Array
    samples: ScanSamples


def line_samples(
    points: Array,
    members: NDArray[np.intp],
    sensor_origin: ArrayLike | None,
    extends: bool,
    absent: Array | None = None,
) -> LineSamples | None:
    """The samples of a region whose returns, `members` of the points (n, 3), lie on one scan line.

    Outside are the places where beams of that line passed it, those without a return in directions `absent` (j, 3)
    among them, and its returns that are no members, as of `scan_samples`; enclosed are those between two inside. None
    where the members are not on one scan line, the scanner isn't known, or nothing is known to be outside. ValueError
    as of `plane_samples`.
    """
    own, sensor = checked_points(points[members]), checked_sensor(sensor_origin)
    if sensor is None or not is_on_one_scan_line(own, sensor):
        return None
    plane = _facing_plane(own, sensor)
    inside = plane.flat[:, :1]
    steps = np.diff(np.sort(inside[:, 0]))
    step = float(np.median(steps[steps > 0.0]))
    # Beams of other lines pass the region's plane at places that depend on how it is tilted.
    beside = np.array([BESIDE * (float(np.ptp(inside)) + step), step])
    window = (plane.flat.min(axis=0) - beside, plane.flat.max(axis=0) + beside)
    places_beyond = other_places(points, members, Sight(plane, window, sensor), absent)
    passed, neighbors = (places[:, :1] for places in places_beyond)
    if extends and len(neighbors):
        neighbors = neighbors[~joined(inside, neighbors)]
    outside = np.concatenate([passed, neighbors])
    if len(outside) == 0:
        return None
    low, high = inside.min() - 0.5 * step, inside.max() + 0.5 * step
    strip = np.array([[low, -0.5 * step], [high, -0.5 * step], [high, 0.5 * step], [low, 0.5 * step]])
    return LineSamples(plane, strip, _informative(inside, outside))


def _facing_plane(own: Array, sensor: Array) -> PlaneSamples:
    """The plane through the line of returns (n, 3) that faces the sensor, its first axis along them."""
    beams = own - sensor
    across = np.linalg.eigh(beams.T @ beams)[1][:, 0]
    some_own = own[:: max(1, len(own) // MOST_SAMPLES)]
    # Returns moved to both sides of their beams' plane make of a robust line a robust plane.
    aside = float(np.ptp(own, axis=0).max()) * across
    origin, axes, _ = robust_plane(np.concatenate([some_own - aside, some_own, some_own + aside]))
    up = across - (across @ axes[2]) * axes[2]
    up /= np.linalg.norm(up)
    return flat_samples(own, origin, np.array([np.cross(up, axes[2]), up, axes[2]]), sensor)


def _informative(inside: Array, outside: Array) -> ScanSamples:
    """The places inside (n, 1) and outside (m, 1) that are next to one of the other kind, and a few others."""
    places = np.concatenate([inside, outside])[:, 0]
    is_inside = np.arange(len(places)) < len(inside)
    order = np.argsort(places, kind="stable")
    changes = np.flatnonzero(is_inside[order][1:] != is_inside[order][:-1]) + 0.5
    # How many places lie between each and the nearest change of kind.
    between = cKDTree(changes[:, None]).query(np.arange(len(places), dtype=np.float64)[:, None])[0]
    nearest = order[np.argsort(between, kind="stable")]
    kept = np.concatenate([nearest[:EDGE_SAMPLES], subsample(nearest[EDGE_SAMPLES:], OTHER_SAMPLES)])
    # In no order: every so many of them are then as even as all.
    kept = np.random.default_rng(0).permutation(kept)
    flat = np.column_stack([places, np.zeros(len(places))])
    beside: Mask = (places < inside.min()) | (places > inside.max())
    kinds = (is_inside, ~is_inside & beside, ~is_inside & ~beside)
    return ScanSamples(*(flat[kept[kind[kept]]] for kind in kinds))
