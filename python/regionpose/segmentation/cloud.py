"""The planar patches of a point cloud: the one around a seed, or all of them.

A patch grows outwards from a seed in a grid on its plane. A cell is wide enough to hold neighbouring scan lines of a
sparse lidar, so that normals and connections take in both directions of sampling, however far apart the rings are.
Cells join by the normal of the points in and around them, points by their distance from the plane; the plane is fitted
anew after each step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from regionpose.outline import bridging_radius, robust_plane

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Progress = Callable[[float], None]

SEED_NEIGHBOURS = (24, 48, 96, 192, 384, 768, 1536)
"""Neighbours that show the plane at the seed: more where the nearest all lie on one scan line."""

SEED_WIDTH = 0.25
"""Least width of the seed's neighbourhood over its length; a single scan line shows no plane."""

SEED_THICKNESS = 0.17
"""Largest thickness of the seed's neighbourhood over its width; foliage and corners are thicker."""

SEED_SHARE = 0.6
"""Least share of the neighbours on the plane; a seed near an edge has a good part of them beyond it."""

SAME_NOISE = 2.0
"""Ratio of the noise in a neighbourhood and the one half its size up to which they show the same plane."""

NOISE_TELLING = 192
"""Neighbours up to which the smaller neighbourhood's noise tells nothing: few points on two scan lines lie on a plane
anyway."""

SEED_REACH = 20.0
"""Largest distance from a seed to its nearest point in spacings around that point; beyond it marks nothing."""

SEED_SIGMAS = 5.0
"""Distance of the seed's nearest point from the plane at the most: any point may be picked, the noisiest ones too."""

DISTANCE_SIGMAS = 3.0
"""Distance from the plane up to which a point belongs to it, in standard deviations of the noise around the seed."""

LEAST_DISTANCE_SHARE = 0.05
"""Least such distance over the bridging radius, for clouds without noise."""

SPACING_POINTS = 384
"""Members nearest to the seed from which the gap between scan lines is taken; it holds for the surroundings alone."""

ROUNDING = 64.0
"""Rounding errors of a coordinate that a distance from a plane may hold."""

CELL_DISTANCES = 2.0
"""Least cell size in those distances: in narrower cells noise turns the normal."""

ANGLE_DEG = 30.0
"""Largest angle between the normals of cell and patch: noise turns that of a small cell by up to 15 deg, an edge by
45."""

LEAST_IN_BLOCK = 4
"""Points in and around a cell below which its normal is unknown, and the cell joins by distance alone."""

RIM_CELLS = 2
"""Cells around those with the right normal in which points join by distance: edges between two planes mix normals
there."""

GROWTH_ROUNDS = 40
"""Most rounds of growth; each doubles the extent, so that they end when the patch does."""

FIT_POINTS = 20_000
"""Points of a patch to which its plane is fitted; more change it by less than a hundredth of the noise."""

MOST_THINNED = 150_000
"""Points to which a cloud is thinned to look for planes; the patches found are filled with all points afterwards."""

LEAST_PATCH = 50
"""Points below which a patch isn't reported unless asked for."""

SEED_LOT = 60
"""Seeds tried together; a plane that holds 5 % of what is left is missed by all with odds of 5 %, which ends the
search."""

MOST_CELLS = 2000
"""Cells across the grid at the most, which bounds its memory; beyond it cells are wider than needed."""

SETTLED_SHARE = 1e-3
"""Change in the number of members below which a patch has stopped growing; points at the distance itself come and
go."""

SETTLED_REACH = 1.02
"""Growth of the extent below which it has."""


class Patch(NamedTuple):
    """A plane as origin (3,) and rows u, v, normal (3, 3), and the members' indices; in metres the noise around the
    seed, the distance of members from the plane at the most, and the size of a cell.
    """

    origin: Array
    axes: Array
    members: Indices
    sigma: float
    distance: float
    cell: float


def grow_plane(
    points: ArrayLike,
    seed: ArrayLike | int,
    *,
    distance: float | None = None,
    radius: float | None = None,
    angle_deg: float = ANGLE_DEG,
    progress: Progress | None = None,
) -> Indices:
    """Indices, ascending, of the points (n, 3) on the connected planar patch around a seed.

    `seed`: the index of a point, or a position (3,), metres. `distance`: of members from the plane at the most, else
    three standard deviations of the noise around the seed. `radius`: gaps up to this width are crossed, else from the
    spacing around the seed across scan lines. `angle_deg`: largest angle between the patch's normal and that of its
    parts. `progress` is called with a share in [0, 1]. Points that aren't finite are passed over. ValueError for
    arguments out of range, a seed away from all points, or one around which the points lie on no plane.
    """
    cloud = checked_cloud(points)
    _check_positive(distance=distance, radius=radius, angle_deg=angle_deg)
    start = _seed_position(cloud, seed)
    members = _grown(cloud, _seed_patch(cloud, start, distance, radius), start, angle_deg, progress).members
    return np.sort(members)


def find_planes(
    points: ArrayLike,
    *,
    min_points: int = LEAST_PATCH,
    distance: float | None = None,
    radius: float | None = None,
    angle_deg: float = ANGLE_DEG,
    progress: Progress | None = None,
) -> list[Indices]:
    """Index arrays, ascending, of the planar patches of points (n, 3), the largest first; no point is in two.

    A cloud of more than 150 000 points is thinned to one point a voxel, on which patches grow from random seeds; then
    each is filled with the points around it. `min_points`: of a patch at the least. The other arguments are those of
    `grow_plane`.
    """
    cloud = checked_cloud(points)
    _check_positive(distance=distance, radius=radius, angle_deg=angle_deg)
    if min_points < 3:
        raise ValueError(f"min_points is {min_points}; needed 3 or more")
    thinned = _thinned(cloud)
    least = max(3, int(min_points * len(thinned) / len(cloud)))
    patches = _patches(cloud[thinned], least, (distance, radius, angle_deg), progress)
    patches = [patch._replace(members=thinned[patch.members]) for patch in patches]
    found = _filled(cloud, patches) if len(thinned) < len(cloud) else [np.sort(patch.members) for patch in patches]
    return sorted((members for members in found if len(members) >= min_points), key=len, reverse=True)


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
    """The points as an (n, 3) array of floats; ValueError for another shape or type, or fewer than 3 finite points."""
    given = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3 or given.dtype.kind not in "iuf":
        raise ValueError(f"points have shape {given.shape} and type {given.dtype}; needed (n, 3) real numbers")
    cloud = given.astype(np.float64, copy=False)
    finite = int(np.isfinite(cloud).all(axis=1).sum())
    if finite < 3:
        raise ValueError(f"{finite} of {len(cloud)} points are finite; needed at least 3")
    return cloud


def _check_positive(**values: float | None) -> None:
    for name, value in values.items():
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value}; needed a positive number")


def _seed_position(cloud: Array, seed: ArrayLike | int) -> Array:
    """The seed's position (3,); an index stands for its point."""
    given = np.asarray(seed)
    if given.ndim == 0 and given.dtype.kind in "iu":
        index = int(given)
        if not 0 <= index < len(cloud):
            raise ValueError(f"seed is {index}; needed an index from 0 to {len(cloud) - 1}")
        given = cloud[index]
    if given.shape != (3,) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
        raise ValueError(f"seed is {np.asarray(seed).tolist()}; needed an index or 3 finite coordinates")
    return given.astype(np.float64)


def _seed_patch(cloud: Array, seed: Array, distance: float | None, radius: float | None) -> Patch:
    """The plane around the seed, from as many neighbours as lie on it."""
    squares = ((cloud - seed) ** 2).sum(axis=1)
    count = min(SEED_NEIGHBOURS[-1], int(np.isfinite(squares).sum()))
    nearest = np.argpartition(np.where(np.isfinite(squares), squares, np.inf), count - 1)[:count]
    nearest = nearest[np.argsort(squares[nearest])]
    chosen: Patch | None = None
    for size in SEED_NEIGHBOURS:
        patch = _neighbourhood_patch(cloud, nearest[:size])
        noisier = patch is not None and chosen is not None and patch.sigma > SAME_NOISE * chosen.sigma
        if noisier and size > NOISE_TELLING:
            break
        chosen = patch or chosen
        if size >= count:
            break
    if chosen is None:
        raise ValueError(f"{count} points around seed {seed.tolist()} lie on no plane; needed a seed on a flat surface")
    sized = _sized(cloud, chosen, distance, radius)
    reach = float(np.sqrt(squares[nearest[0]]))
    if reach > SEED_REACH * sized.cell:
        raise ValueError(f"the nearest point is {reach:.3g} m from the seed; needed one within {sized.cell:.3g} m")
    return sized


def _neighbourhood_patch(cloud: Array, nearest: Indices) -> Patch | None:
    """The plane of the seed's neighbours, nearest first; None if they don't spread over one that passes the nearest."""
    near = cloud[nearest]
    if len(np.unique(near, axis=0)) < LEAST_IN_BLOCK:
        return None
    try:
        origin, axes, inliers = robust_plane(near)
    except ValueError:
        return None
    spread = np.linalg.svd(near[inliers] - origin, compute_uv=False)
    if spread[1] < SEED_WIDTH * spread[0] or spread[2] > SEED_THICKNESS * spread[1]:
        return None
    sigma = float(np.std((near[inliers] - origin) @ axes[2]))
    least = np.finfo(float).eps * np.abs(near).max() * ROUNDING
    if len(inliers) < SEED_SHARE * len(near) or abs((near[0] - origin) @ axes[2]) > SEED_SIGMAS * sigma + least:
        return None
    return Patch(origin, axes, nearest[inliers], sigma, 0.0, 0.0)


def _sized(cloud: Array, patch: Patch, distance: float | None, radius: float | None) -> Patch:
    """The patch with the distance and the cell that its noise and the spacing of its points ask for."""
    near = cloud[patch.members[:SPACING_POINTS]]
    gap = bridging_radius((near - patch.origin) @ patch.axes[:2].T) if radius is None else radius
    most = max(DISTANCE_SIGMAS * patch.sigma, LEAST_DISTANCE_SHARE * gap) if distance is None else distance
    return patch._replace(distance=most, cell=max(gap, CELL_DISTANCES * most))


def _grown(cloud: Array, patch: Patch, seed: Array, angle_deg: float, progress: Progress | None) -> Patch:
    """The patch after growing until it stays the same; each round looks as far again as the patch reaches."""
    reach = 0.0
    for round_ in range(GROWTH_ROUNDS):
        flat = (cloud[patch.members] - seed) @ patch.axes[:2].T
        reach = max(reach, float(np.abs(flat).max()))
        grown = _joined(cloud, patch, seed, 2.0 * reach + 2.0 * patch.cell, angle_deg)
        if progress is not None:
            progress(1.0 - 1.0 / (round_ + 2))
        if len(grown) < 3:
            break
        settled = abs(len(grown) - len(patch.members)) <= SETTLED_SHARE * len(grown)
        patch = _refitted(cloud, patch, grown)
        extent = float(np.abs((cloud[grown] - seed) @ patch.axes[:2].T).max())
        if settled and extent <= SETTLED_REACH * reach:
            break
    if progress is not None:
        progress(1.0)
    return patch


def _refitted(cloud: Array, patch: Patch, members: Indices) -> Patch:
    """The patch with new members and the plane through them, its normal on the old side."""
    used = members[:: max(1, len(members) // FIT_POINTS)]
    origin = cloud[used].mean(axis=0)
    directions = np.linalg.svd(cloud[used] - origin, full_matrices=False)[2]
    normal = directions[2] * np.sign(directions[2] @ patch.axes[2] or 1.0)
    axes = np.array([directions[0], np.cross(normal, directions[0]), normal])
    return patch._replace(origin=origin, axes=axes, members=members)


def _joined(cloud: Array, patch: Patch, seed: Array, reach: float, angle_deg: float) -> Indices:
    """Members of the patch within `reach` of the seed along its plane: connected to the seed by cells of its normal."""
    heights = cloud @ patch.axes[2] - patch.origin @ patch.axes[2]
    cell = max(patch.cell, 2.0 * reach / MOST_CELLS)
    near = np.flatnonzero(np.abs(heights) <= cell)
    flat = (cloud[near] - seed) @ patch.axes[:2].T
    within = (np.abs(flat) <= reach).all(axis=1)
    near, flat = near[within], flat[within]
    on_plane = np.abs(heights[near]) <= patch.distance
    cells = np.floor((flat + reach) / cell).astype(np.intp) + RIM_CELLS
    side = int(np.ceil(2.0 * reach / cell)) + 2 * RIM_CELLS + 1
    occupied = _counts(cells[on_plane], side) > 0
    normals_agree = _cells_along(np.column_stack([flat, heights[near]]), cells, side, angle_deg)
    core = _connected(occupied & normals_agree, np.full(2, int(reach / cell) + RIM_CELLS))
    rim = (
        ndimage.binary_dilation(core, np.ones((3, 3), dtype=np.bool_), iterations=RIM_CELLS, mask=occupied)
        if core.any()
        else core
    )
    kept: Indices = near[on_plane & rim[cells[:, 0], cells[:, 1]]]
    return kept


def _counts(cells: Indices, side: int, weights: Array | None = None) -> Array:
    counts = np.bincount(cells[:, 0] * side + cells[:, 1], weights=weights, minlength=side * side)
    return counts.reshape(side, side).astype(np.float64)


def _cells_along(local: Array, cells: Indices, side: int, angle_deg: float) -> Mask:
    """Cells (side, side) whose points, with those of the cells around, have a normal along the patch's.

    The normal is the direction of least spread of the points (u, v, height) in the block of nine cells.
    """

    def block(weights: Array | None) -> Array:
        return ndimage.uniform_filter(_counts(cells, side, weights), 3, mode="constant") * 9.0

    count = block(None)
    filled = np.argwhere(count > 0.5)
    rows, columns = filled.T
    total = count[rows, columns]
    mean = np.stack([block(local[:, a])[rows, columns] for a in range(3)], axis=1) / total[:, None]
    spread = np.empty((len(filled), 3, 3))
    for a in range(3):
        for b in range(a, 3):
            product = block(local[:, a] * local[:, b])[rows, columns] / total - mean[:, a] * mean[:, b]
            spread[:, a, b] = spread[:, b, a] = product
    normals = np.linalg.eigh(spread)[1][:, :, 0]
    agree = np.zeros((side, side), dtype=np.bool_)
    agree[rows, columns] = (np.abs(normals[:, 2]) >= np.cos(np.radians(angle_deg))) | (total < LEAST_IN_BLOCK)
    return agree


def _connected(cells: Mask, seed: Indices) -> Mask:
    """The connected cells that reach nearest to the seed's."""
    labels, count = ndimage.label(cells, np.ones((3, 3)))
    if count == 0:
        return cells
    filled = np.argwhere(cells)
    nearest = filled[np.argmin(((filled - seed) ** 2).sum(axis=1))]
    connected: Mask = labels == labels[nearest[0], nearest[1]]
    return connected


def _thinned(cloud: Array) -> Indices:
    """Indices of the finite points, one a voxel where they are many; the voxels are as small as their number allows."""
    finite = np.flatnonzero(np.isfinite(cloud).all(axis=1))
    if len(finite) <= MOST_THINNED:
        return finite
    low, high = np.percentile(cloud[finite], [1.0, 99.0], axis=0)
    # Surfaces fill a layer of voxels: start as if all points were spread over one of the extent's size.
    size = float(np.linalg.norm(high - low)) / np.sqrt(MOST_THINNED)
    while True:
        kept = finite[np.unique(_voxels(cloud[finite], size), return_index=True)[1]]
        if len(kept) <= MOST_THINNED:
            return kept
        size *= 1.2 * np.sqrt(len(kept) / MOST_THINNED)


def _voxels(points: Array, size: float) -> NDArray[np.int64]:
    """One number for each point's voxel."""
    cells = np.floor(points / size).astype(np.int64)
    cells -= cells.min(axis=0)
    spans = cells.max(axis=0) + 1
    numbers: NDArray[np.int64] = (cells[:, 0] * spans[1] + cells[:, 1]) * spans[2] + cells[:, 2]
    return numbers


def _patches(
    cloud: Array, least: int, settings: tuple[float | None, float | None, float], progress: Progress | None
) -> list[Patch]:
    """Patches of a finite cloud from random seeds, each without the points of those before.

    Of each lot of seeds the ones with the least noise grow first, before hedges and the like claim parts of clean
    planes.
    """
    generator = np.random.default_rng(0)
    rest, untried = cloud.copy(), np.ones(len(cloud), dtype=np.bool_)
    patches: list[Patch] = []
    found = True
    while found and untried.any():
        found = False
        for index, start in _seed_lot(rest, untried, settings, generator):
            patch = _regrown(rest, start, cloud[index], settings[2]) if np.isfinite(rest[index, 0]) else None
            if patch is None:
                continue
            untried[patch.members] = False
            if len(patch.members) >= least:
                found = True
                patches.append(patch)
                rest[patch.members] = np.nan
                if progress is not None:
                    progress(float(np.isnan(rest[:, 0]).mean()))
    if progress is not None:
        progress(1.0)
    return patches


def _seed_lot(
    rest: Array, untried: Mask, settings: tuple[float | None, float | None, float], generator: np.random.Generator
) -> list[tuple[int, Patch]]:
    """Random seeds among the untried points and the planes around them, the least noisy first; all are marked as
    tried.
    """
    choice = np.flatnonzero(untried)
    starts = []
    for index in generator.choice(choice, min(SEED_LOT, len(choice)), replace=False):
        untried[index] = False
        try:
            starts.append((int(index), _seed_patch(rest, rest[index], settings[0], settings[1])))
        except ValueError:
            continue
    return sorted(starts, key=lambda start: start[1].sigma)


def _regrown(rest: Array, start: Patch, seed: Array, angle_deg: float) -> Patch | None:
    """The patch grown from what earlier patches left of its start."""
    left = start.members[np.isfinite(rest[start.members, 0])]
    return _grown(rest, start._replace(members=left), seed, angle_deg, None) if len(left) >= LEAST_IN_BLOCK else None


def _filled(cloud: Array, patches: list[Patch]) -> list[Indices]:
    """The patches, found on some of the cloud, with all its points in the same cells; earlier patches first."""
    rest = np.flatnonzero(np.isfinite(cloud).all(axis=1))
    remaining = cloud[rest]
    found = []
    for patch in patches:
        near = _in_same_cells(remaining, patch, cloud[patch.members])
        found.append(rest[near])
        kept = np.ones(len(rest), dtype=np.bool_)
        kept[near] = False
        rest, remaining = rest[kept], remaining[kept]
    return found


def _in_same_cells(points: Array, patch: Patch, members: Array) -> Indices:
    """Indices of points on the patch's plane in the cells that its members occupy."""
    heights = points @ patch.axes[2] - patch.origin @ patch.axes[2]
    near = np.flatnonzero(np.abs(heights) <= patch.distance)
    flat, sought = ((given - patch.origin) @ patch.axes[:2].T for given in (members, points[near]))
    low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
    cell = max(patch.cell, float(extent.max()) / MOST_CELLS)
    filled = np.zeros(np.floor(extent / cell).astype(np.intp) + 1, dtype=np.bool_)
    filled[tuple(np.floor((flat - low) / cell).astype(np.intp).T)] = True
    cells = np.floor((sought - low) / cell).astype(np.intp)
    inside = np.flatnonzero(((cells >= 0) & (cells < filled.shape)).all(axis=1))
    chosen: Indices = near[inside[filled[tuple(cells[inside].T)]]]
    return chosen
