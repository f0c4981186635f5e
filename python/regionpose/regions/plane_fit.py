"""The plane through most of some points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionpose.validation.arrays import Array

PLANE_TRIALS = 200
"""Planes through three random points that are tried: 40 % of outliers leave a wrong best with odds of 1e-21."""

MEDIAN_POINTS = 2000
"""Points from which a trial plane's median distance is taken; more change it by under 3 %."""

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

INLIER_SIGMAS = 3.0
"""Points farther from the plane than this many standard deviations have no part in it."""

REFITS = 10
"""Least squares fits to the inliers at the most; they converge in two or three."""

LINE_WIDTH_FRACTION = 0.15
"""Width over length below which the points on a plane may be one scan line, which its beams' plane holds without any
error; range noise widens a short one to this much."""

WIDER = 1.3
"""Width over length of all points in that of such a line from which they show another plane."""

LINE_NOISES = 3.0
"""Noise of the plane of all points over the width of such a line at the most; outliers make it larger."""

LEAST_NOISE_FRACTION = 0.02
"""Least width over length of a line that is compared with the noise, for range noise that leaves it in its plane."""


def robust_plane(points: Array, sensor: Array | None = None) -> tuple[Array, Array, NDArray[np.intp]]:
    """A plane through most of the points (n, 3): its origin (3,), axes u, v, normal as rows (3, 3), inliers' indices.

    Least squares over the points within three standard deviations until they stay the same, from two starts: all
    points, and the plane through three of them with the least median distance (Rousseeuw 1984). That one is right with
    outliers, but may lie askew along a single scan line; the better fit is the one under which the points are likelier,
    outliers being anywhere. Of points that a sensor at (3,) saw, distances along their beams count: the plane of the
    beams themselves holds a scan line without any error, and no beam meets it.
    """
    everything = _refitted(points, *_least_squares_plane(points))
    majority = _refitted(points, *_least_median_plane(points))
    if _is_line_of(points[majority[2]], points[everything[2]], everything):
        return everything
    return min(everything, majority, key=lambda fit: _code_length(points, sensor, *fit))


def _is_line_of(line: Array, points: Array, plane: tuple[Array, Array, NDArray[np.intp]]) -> bool:
    """Whether some points are a scan line of a plane that more show: narrow, no wider than its noise makes them."""
    (length, width), (whole_length, whole_width) = _extents(line), _extents(points)
    noise = float(np.std((points - plane[0]) @ plane[1][2]))
    narrow = width < LINE_WIDTH_FRACTION * length and noise < LINE_NOISES * max(width, LEAST_NOISE_FRACTION * length)
    return narrow and len(points) > len(line) and whole_width * length > WIDER * width * whole_length


def _extents(points: Array) -> tuple[float, float]:
    """Standard deviations of the points along their first two directions."""
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    return float(spread[0]), float(spread[1])


def _refitted(points: Array, origin: Array, axes: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    inliers = np.arange(len(points))
    extent = float(np.ptp(points, axis=0).max())
    for _ in range(REFITS):
        distances = np.abs((points - origin) @ axes[2])
        sigma = MAD_TO_SIGMA * np.median(distances)
        kept = np.flatnonzero(distances <= max(INLIER_SIGMAS * sigma, np.finfo(float).eps * extent * 64))
        if len(kept) < 3:
            break
        origin, axes = _least_squares_plane(points[kept])
        if np.array_equal(kept, inliers):
            break
        inliers = kept
    return origin, axes, inliers


def _code_length(points: Array, sensor: Array | None, origin: Array, axes: Array, inliers: NDArray[np.intp]) -> float:
    """Negative log likelihood per extent: inliers normal about the plane, outliers even over the extent (no cost)."""
    extent = float(np.ptp(points, axis=0).max())
    distances = (points[inliers] - origin) @ axes[2]
    if sensor is not None:
        beams = points[inliers] - sensor
        distances *= np.linalg.norm(beams, axis=1) / np.maximum(np.abs(beams @ axes[2]), np.finfo(float).tiny)
    sigma = float(np.std(distances)) / extent
    return len(inliers) * (0.5 + float(np.log(max(sigma, np.finfo(float).eps) * np.sqrt(2.0 * np.pi))))


def _least_median_plane(points: Array) -> tuple[Array, Array]:
    """The plane with the least median distance among those through three random points and least squares over all."""
    generator = np.random.default_rng(0)
    triples = points[generator.integers(len(points), size=(PLANE_TRIALS, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    norms = np.linalg.norm(normals, axis=1)
    proper = norms > np.finfo(float).tiny
    anchors, normals = triples[proper, 0], normals[proper] / norms[proper, None]
    best = _least_squares_plane(points)
    judges = points if len(points) <= MEDIAN_POINTS else points[generator.integers(len(points), size=MEDIAN_POINTS)]
    least = np.median(np.abs((judges - best[0]) @ best[1][2]))
    medians = np.median(np.abs(judges @ normals.T - np.sum(anchors * normals, axis=1)), axis=0)
    if len(medians) and medians.min() < least:
        chosen = int(np.argmin(medians))
        return anchors[chosen], axes_of(normals[chosen])
    return best


def _least_squares_plane(points: Array) -> tuple[Array, Array]:
    origin = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - origin, full_matrices=False)
    if spread[1] <= 1e-9 * spread[0]:
        raise ValueError(f"{len(points)} points are identical or on one line; needed points that span a plane")
    return origin, np.array([axes[0], axes[1], np.cross(axes[0], axes[1])])


def axes_of(normal: Array) -> Array:
    """Right-handed axes u, v, normal as rows (3, 3)."""
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(normal, u), normal])
