"""The planar patch of a point cloud around a seed, and the point that a ray meets."""

from __future__ import annotations

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from regionpose.progress import Progress
from regionpose.regions.plane_samples import plane_samples
from regionpose.segment.narrow_parts import without_narrow_parts
from regionpose.segment.patch import ANGLE_DEG, Indices, Patch, grown, nearest_points, start_patch
from regionpose.validation.arrays import Array, check_coordinates, finite_rows, row_array

SEED_CROWD = 96
"""A seed's nearest point has this many neighbors nearer than the seed when that marks nothing: about five spacings.
Measured on six clouds of 16 to 64 scan lines and a depth camera, the largest gap of a surface is that wide in 1 of 100
neighborhoods."""


def grow_plane(
    points: ArrayLike,
    seed: ArrayLike | int,
    *,
    distance_m: float | None = None,
    radius_m: float | None = None,
    angle_deg: float = ANGLE_DEG,
    min_width_m: float | None = None,
    progress: Progress | None = None,
) -> Indices:
    """Indices, ascending, of the points on the connected planar patch around a seed.

    Points that aren't finite are passed over.

    Parameters
    ----------
    points : (n, 3) array
        Meters.
    seed : int or (3,) array
        The index of a point, or a position.
    distance_m : float, optional
        Largest distance of members from the plane; three standard deviations of the noise around the seed by
        default.
    radius_m : float, optional
        Gaps up to this width are crossed; from the spacing around the seed across scan lines by default.
    angle_deg : float
        Largest angle between the patch's normal and that of its parts, degrees.
    min_width_m : float, optional
        Parts of the patch narrower than this are left out, such as posts in the plane of a panel, and what
        only they connect.
    progress : callable, optional
        Called with a fraction in [0, 1].

    Raises
    ------
    ValueError
        For arguments out of range, a seed away from all points, one around which the points lie on no plane, or a patch
        that is nowhere `min_width_m` wide.
    """
    cloud = checked_cloud(points)
    check_positive(angle_deg=angle_deg)
    check_optional_positive(distance_m=distance_m, radius_m=radius_m, min_width_m=min_width_m)
    start, patch = started_patch(cloud, seed, distance_m, radius_m)
    members = np.sort(grown(cloud, patch, start, angle_deg, progress).members)
    return members if min_width_m is None else members[without_narrow_parts(cloud[members], start, min_width_m)]


def points_on_plane(points: Array, members: Indices, sensor_origin: ArrayLike | None) -> Indices:
    """Indices, ascending, of the points (n, 3) that noise alone may put off the plane of some of them.

    The plane and its noise are those that classify a scan's samples (`WorldRegion.from_scan`). ValueError for
    members that span no plane.
    """
    plane = plane_samples(points[members], sensor_origin)
    heights = points @ plane.axes[2] - plane.origin @ plane.axes[2]
    near: Indices = np.flatnonzero(np.abs(heights) <= plane.noise)
    return near


def nearest_to_ray(points: ArrayLike, origin: ArrayLike, direction: ArrayLike) -> int:
    """Index of the point (n, 3) that a ray from `origin` (3,) along `direction` (3,) meets first.

    Of the points seen within twice the least angle off the ray it is the one nearest to the origin, since a surface
    behind another may pass closer to the ray. ValueError when no point lies ahead.
    """
    cloud = checked_cloud(points)
    ahead = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(ahead))
    if ahead.shape != (3,) or not (np.isfinite(length) and length > 0.0):
        raise ValueError(f"direction is {ahead.tolist()}; needed 3 finite numbers, not all 0")
    offsets = cloud - np.asarray(origin, dtype=np.float64)
    depth = offsets @ (ahead / length)
    ranges = np.linalg.norm(offsets, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        angles = np.where(depth > 0.0, np.sqrt(np.maximum(ranges**2 - depth**2, 0.0)) / depth, np.inf)
    least = float(np.nanmin(angles))
    if not np.isfinite(least):
        raise ValueError(f"none of {len(cloud)} points lies ahead of the ray; needed at least one")
    return int(np.argmin(np.where(angles <= 2.0 * least + np.finfo(float).eps, depth, np.inf)))


def checked_cloud(points: ArrayLike) -> Array:
    """The points as an (n, 3) array of floats; ValueError for another shape or type, fewer than 3 finite points, or one
    that is too far away to be calculated with.
    """
    cloud = row_array(points, "points", 3)
    finite = int(finite_rows(cloud).sum())
    if finite < 3:
        raise ValueError(f"{finite} of {len(cloud)} points are finite; needed at least 3")
    check_coordinates(cloud)
    return cloud


def check_positive(**values: float) -> None:
    """Check that each value is a positive and finite number; ValueError that names the others."""
    for name, value in values.items():
        if not (isinstance(value, Real) and np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value}; needed a positive number")


def check_optional_positive(**values: float | None) -> None:
    """As `check_positive`, for values that are not None."""
    check_positive(**{name: value for name, value in values.items() if value is not None})


def started_patch(
    cloud: Array, given: ArrayLike | int, distance: float | None = None, radius: float | None = None
) -> tuple[Array, Patch]:
    """The seed's position and the plane around it; ValueError for a seed away from all points, or on no plane."""
    seed = _seed_position(cloud, given)
    nearest = nearest_points(cloud, seed)
    if not len(nearest):
        found = f"seed {seed.tolist()} is so far from all {len(cloud)} points that no number holds it"
        raise ValueError(f"{found}; needed a seed on a surface of the cloud")
    try:
        patch = start_patch(cloud, seed, nearest, distance, radius)
    except ValueError:
        _check_reach(cloud, seed, nearest, 0.0)
        raise
    _check_reach(cloud, seed, nearest, patch.cell)
    return seed, patch


def _check_reach(cloud: Array, seed: Array, nearest: Indices, gap: float) -> None:
    """ValueError where a seed lies farther from its nearest point than many others do, and than gaps are wide.

    `nearest`: the points nearest to the seed, the nearest first.
    """
    point = cloud[nearest[0]]
    reach = float(np.linalg.norm(seed - point))
    distances = np.sort(np.linalg.norm(cloud[nearest] - point, axis=1))[: SEED_CROWD + 1]
    # Points beyond those nearest to the seed may be nearer to its nearest point, unless the crowd is within them.
    if not distances[-1] + reach < float(np.linalg.norm(cloud[nearest[-1]] - seed)):
        distances = np.sort(np.linalg.norm(cloud[nearest_points(cloud, point)] - point, axis=1))[: SEED_CROWD + 1]
    around = float(distances[-1])
    if reach > max(around, gap):
        raise ValueError(
            f"seed {seed.tolist()} is {reach:.3g} m from the nearest point {point.round(4).tolist()}, which has"
            f" {SEED_CROWD} others within {around:.3g} m; needed a seed on a surface of the cloud"
        )


def _seed_position(cloud: Array, seed: ArrayLike | int) -> Array:
    """The seed's position (3,); an index stands for its point."""
    try:
        given = np.asarray(seed)
    except ValueError as error:
        raise ValueError(f"seed is {seed!r}; needed an index or 3 finite coordinates") from error
    if given.ndim == 0 and given.dtype.kind in "iu":
        index = int(given)
        if not 0 <= index < len(cloud):
            raise ValueError(f"seed is {index}; needed an index from 0 to {len(cloud) - 1}")
        given = cloud[index]
    if given.shape != (3,) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
        raise ValueError(f"seed is {np.asarray(seed).tolist()}; needed an index or 3 finite coordinates")
    return given.astype(np.float64)
