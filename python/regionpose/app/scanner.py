"""The likely place of a cloud's scanner, inferred from its points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from regionpose.io.clouds import Cloud
from regionpose.validation.arrays import Array

MOST_POINTS = 120_000
"""Points that are looked at: those of a turn of a lidar with 64 beams."""

MOST_ASKED = 12_000
"""Points whose neighbors are looked at: the fractions below are then known to less than a hundredth."""

DEEPER = 0.1
"""Difference of the logarithm of the distance from which one of two points stands behind the other."""

STEP = 0.1
"""How far beside the place the other places are that it is compared with, over the points' median distance."""

MOST_BEHIND = 0.2
"""Fraction of points behind their neighbors from which a cloud is of several scans. Of 13 single scans (KITTI,
nuScenes, VLP-16, a depth camera, the demo) it is 0.001 to 0.09 from the scanner's place, of two scans merged 0.42."""


def proposed_scanner(cloud: Cloud) -> Array | None:
    """The zero (3,) of a cloud's world where the cloud looks like one scan around it, None otherwise.

    One beam meets one surface: from the scanner's place, few points stand behind others, and more do from places
    beside it. Of the 13 scans this finds 8; of 39 places beside their scanners it takes none.
    """
    points = cloud.local_points[_evenly_spaced(len(cloud), MOST_POINTS)]
    zero = -cloud.origin
    if len(points) < 2:
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    if not ((2.0 * low - high <= zero) & (zero <= 2.0 * high - low)).all():
        return None  # A scanner isn't farther off than its scan is long.
    behind = _fraction_behind(points, zero)
    if behind > MOST_BEHIND:
        return None
    reach = STEP * float(np.median(np.linalg.norm(points - zero, axis=1)))
    beside = (zero + sign * reach * axis for axis in np.eye(3) for sign in (1.0, -1.0))
    return np.zeros(3) if all(_fraction_behind(points, place) >= behind for place in beside) else None


def _fraction_behind(points: Array, place: Array) -> float:
    """Fraction of points that are much nearer or farther than the point beside them, seen from a place."""
    offsets = points - place
    ranges = np.linalg.norm(offsets, axis=1)
    has_range = ranges > 0.0
    directions, ranges = offsets[has_range] / ranges[has_range, None], ranges[has_range]
    queried = _evenly_spaced(len(ranges), MOST_ASKED)
    nearest = np.asarray(cKDTree(directions).query(directions[queried], k=2)[1])
    return float(np.mean(np.abs(np.log(ranges[queried] / ranges[nearest[:, 1]])) > DEEPER))


def _evenly_spaced(count: int, most: int) -> NDArray[np.int64]:
    """Indices of a random part of so many points, the same each time; of all where they are few."""
    if count <= most:
        return np.arange(count, dtype=np.int64)
    return np.asarray(np.random.default_rng(0).choice(count, most, replace=False), dtype=np.int64)
