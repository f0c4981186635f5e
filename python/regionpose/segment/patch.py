"""A planar patch of a point cloud: its start around a seed, and its growth.

A patch grows outwards from a seed in a grid on its plane. A cell is wide enough to hold neighboring scan lines of a
sparse lidar, so that normals and connections take in both directions of sampling, however far apart the rings are.
Cells join by the normal of the points in and around them, points by their distance from the plane; the plane is fitted
recomputed after each step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from regionpose._core import cells_along, robust_plane
from regionpose.progress import Progress
from regionpose.regions.outline import bridging_radius
from regionpose.regions.plane_samples import ROUNDING
from regionpose.validation.arrays import Array

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

SEED_NEIGHBORS = (24, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536)
"""Neighbors that show the plane at the seed: more where the nearest all lie on one scan line, in steps fine enough for
one to end near the edge of a small face."""

WIDER = (2, 4, 8, 16, 32, 64)
"""How many times as many neighbors are looked at after that, thinned to as many as before: scans laid over one another
hold that many times the points of one, closer to each other than their noise. A face widens by `sqrt(2)` from one to
the next, as above."""

WIDER_THICKNESS = 0.05
"""Thickness over width of such a neighborhood at the most: those of half a street around faces of 300 points have
0.07 and more in KITTI's frames; a board of 1 m with 1 cm noise has 0.04."""

MOST_NEIGHBORS = SEED_NEIGHBORS[-1] * WIDER[-1]

SEED_WIDTH = 0.25
"""Least width of the seed's neighborhood over its length; a single scan line shows no plane."""

SEED_THICKNESS = 0.3
"""Largest thickness of the seed's neighborhood over its width, which a face five noises wide keeps; foliage is as
thick as wide, a corner half."""

SEED_FRACTION = 0.6
"""Least fraction of the neighbors on the plane; a seed near an edge has a good part of them beyond it."""

SAME_NOISE = 1.3
"""Ratio of the noise in a neighborhood and the least of smaller ones up to which they show the same plane. By steps
from each to the next it would creep up, as where a door stands back from its wall by less than scan lines disagree."""

NOISE_TELLING = 192
"""Neighbors below which the noise is undetermined: few points on two scan lines lie on a plane anyway."""

SEED_SIGMAS = 5.0
"""Distance of the seed's nearest point from the plane at the most: any point may be picked, the noisiest ones too."""

DISTANCE_SIGMAS = 3.0
"""Distance from the plane up to which a point belongs to it, in standard deviations of the noise around the seed."""

LEAST_DISTANCE_FRACTION = 0.02
"""Least such distance over the bridging radius, for clouds without noise."""

SPACING_POINTS = 384
"""Members nearest to the seed from which the gap between scan lines is taken; it holds for the surroundings alone."""

CELL_DISTANCES = 2.0
"""Least cell size in those distances: in narrower cells noise turns the normal."""

ANGLE_DEG = 20.0
"""Largest angle between the normals of cell and patch: noise turns that of a small cell by up to 15 deg, an edge by
45, posts beside a face by 30 to 60."""

LEAST_IN_BLOCK = 4
"""Distinct points of a neighborhood at the least: three lie on a plane anyway."""

RIM_CELLS = 2
"""Cells around those with the right normal in which points join by distance: edges between two planes mix normals
there."""

GROWTH_ROUNDS = 16
"""Most rounds of growth; each doubles the extent, so that they end when the patch does."""

FIT_POINTS = 20_000
"""Points of a patch to which its plane is fitted; more change it by less than a hundredth of the noise."""

MOST_CELLS = 2000
"""Cells across the grid at the most, which bounds its memory; beyond it cells are wider than needed."""

SETTLED_FRACTION = 5e-3
"""Change in the number of members below which a patch has stopped growing; points at the distance itself come and
go, most of them in small patches."""

SETTLED_POINTS = 2
"""The same as a number of points."""

SETTLED_REACH = 1.02
"""Growth of the extent below which it has."""


BLOCK = 1 << 14
"""Points whose distances are taken at a time, so that their temporaries stay in the processor's cache."""

FEW = 50_000
"""Distances from which that of the farthest neighbor is estimated, to 3 %."""


class Patch(NamedTuple):
    """A plane as origin (3,) and rows u, v, normal (3, 3), and the members' indices; in meters the noise around the
    seed, the distance of members from the plane at the most, and the size of a cell.
    """

    origin: Array
    axes: Array
    members: Indices
    sigma: float
    distance: float
    cell: float


def nearest_points(cloud: Array, position: Array) -> Indices:
    """Indices of the points nearest to a position, the nearest first, as many as a start may need."""
    squares = np.empty(len(cloud))
    for start in range(0, len(cloud), BLOCK):
        offsets = cloud[start : start + BLOCK] - position
        np.einsum("ij,ij->i", offsets, offsets, out=squares[start : start + BLOCK])
    count = min(MOST_NEIGHBORS, int(np.isfinite(squares).sum()))
    near = _least(squares, count)
    nearest = near[np.argpartition(squares[near], count - 1)[:count]]
    ordered: Indices = nearest[np.argsort(squares[nearest])]
    return ordered


def _least(values: Array, count: int) -> Indices:
    """Indices, ascending, of values (n,) among which are the `count` least ones, and not many others where some of the
    values show how large these are.
    """
    some = values[:: max(1, len(values) // FEW)]
    rank = min(int(1.2 * count * len(some) / len(values)) + 10, len(some) - 1)
    near: Indices = np.flatnonzero(values <= np.partition(some, rank)[rank])
    return near if len(near) >= count else np.arange(len(values))


def start_patch(cloud: Array, seed: Array, nearest: Indices, distance: float | None, radius: float | None) -> Patch:
    """The plane around the seed, from as many of its nearest points, nearest first, as lie on it.

    `distance`, `radius`: `distance_m`, `radius_m` of `grow_plane`. ValueError for a seed on no plane.
    """
    chosen: Patch | None = None
    noise = np.inf
    for size in SEED_NEIGHBORS:
        patch = _neighborhood_patch(cloud, nearest[:size])
        if patch is not None and patch.sigma > SAME_NOISE * noise:
            break
        chosen = patch or chosen
        if chosen is not None and size >= NOISE_TELLING:
            noise = min(noise, chosen.sigma)
        if size >= len(nearest):
            break
    if chosen is None or size < SEED_NEIGHBORS[-1] or patch is None:
        chosen = _wider_patch(cloud, nearest, chosen)
    if chosen is None:
        raise ValueError(
            f"{len(nearest)} points around seed {seed.tolist()} lie on no plane; needed a seed on a flat surface"
        )
    return _sized(cloud, chosen, distance, radius)


def _wider_patch(cloud: Array, nearest: Indices, narrower: Patch | None) -> Patch | None:
    """The plane of the first wider neighborhood, thinned evenly, that shows one and what the narrower one could not.

    The narrower one where there is none. In scans that lie over one another, few points are as thick as wide, or show a
    plane of beams that is thin across the surface.
    """
    count = SEED_NEIGHBORS[-1]
    for step in WIDER:
        if step * count > len(nearest):
            break
        patch = _neighborhood_patch(cloud, nearest[: step * count : step])
        if patch is not None and patch.sigma <= WIDER_THICKNESS * _width(cloud, patch):
            hidden = narrower is None or _is_hidden(cloud, narrower, patch)
            return patch if hidden else narrower
    return narrower


def _is_hidden(cloud: Array, narrower: Patch, wider: Patch) -> bool:
    """Whether the points of a narrower neighborhood lie within the noise of a wider one, and too close to show it."""
    heights = (cloud[narrower.members] - wider.origin) @ wider.axes[2]
    lies_within = float(np.sqrt(np.mean(heights**2))) <= SAME_NOISE * wider.sigma
    return lies_within and wider.sigma > SEED_THICKNESS * _width(cloud, narrower)


def _width(cloud: Array, patch: Patch) -> float:
    """Standard deviation of a patch's points across its longest direction, meters."""
    points = cloud[patch.members]
    return float(np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[1] / np.sqrt(len(points)))


def _rounding(points: Array) -> float:
    """What rounding puts points off their plane by, meters."""
    return float(np.finfo(float).eps * np.abs(points).max() * ROUNDING)


def _neighborhood_patch(cloud: Array, nearest: Indices) -> Patch | None:
    """The plane of the seed's neighbors, nearest first; None if they don't spread over one that passes the nearest."""
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
    least = SEED_SIGMAS * sigma + _rounding(near)
    if len(inliers) < SEED_FRACTION * len(near) or abs((near[0] - origin) @ axes[2]) > least:
        return None
    return Patch(origin, axes, nearest[inliers], sigma, 0.0, 0.0)


def _sized(cloud: Array, patch: Patch, distance: float | None, radius: float | None) -> Patch:
    """The patch with the distance and the cell that its noise and the spacing of its points ask for."""
    near = cloud[patch.members[:SPACING_POINTS]]
    gap = bridging_radius((near - patch.origin) @ patch.axes[:2].T) if radius is None else radius
    most = max(DISTANCE_SIGMAS * patch.sigma, LEAST_DISTANCE_FRACTION * gap) if distance is None else distance
    return patch._replace(distance=most, cell=max(gap, CELL_DISTANCES * most))


def grown(cloud: Array, patch: Patch, seed: Array, angle_deg: float, progress: Progress | None) -> Patch:
    """The patch after growing until it stays the same; each round looks as far again as the patch reaches."""
    reach = 0.0
    for round_ in range(GROWTH_ROUNDS):
        flat = (cloud[patch.members] - seed) @ patch.axes[:2].T
        reach = max(reach, float(np.abs(flat).max()))
        joined = _joined(cloud, patch, seed, 2.0 * reach + 2.0 * patch.cell, angle_deg)
        if progress is not None:
            progress(1.0 - 1.0 / (round_ + 2))
        if len(joined) < 3:
            break
        is_settled = abs(len(joined) - len(patch.members)) <= max(SETTLED_FRACTION * len(joined), SETTLED_POINTS)
        patch = _refitted(cloud, patch, joined)
        extent = float(np.abs((cloud[joined] - seed) @ patch.axes[:2].T).max())
        if is_settled and extent <= SETTLED_REACH * reach:
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
    cell = max(patch.cell, 2.0 * reach / MOST_CELLS)
    near, heights = _near_plane(cloud, patch, cell)
    flat = cloud[near] @ patch.axes[:2].T - patch.axes[:2] @ seed
    # Column by column: along rows of two it takes several times as long.
    within = np.flatnonzero((np.abs(flat[:, 0]) <= reach) & (np.abs(flat[:, 1]) <= reach))
    near, heights, flat = near[within], heights[within], flat[within]
    cells = ((flat + reach) / cell).astype(np.intp)
    on_plane = np.abs(heights) <= patch.distance
    middle = np.full(2, int(reach / cell))
    # Normals are taken where the patch can reach alone: the rest of the plane may be a hundred times as large.
    around = _surroundings(cells[on_plane], middle, int(np.ceil(2.0 * reach / cell)) + 1)
    low, shape = around.low, (around.cells.shape[0], around.cells.shape[1])
    cells -= low
    (rows, columns), (height, width) = cells.T, shape
    inside = np.flatnonzero((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width))
    inside = inside[around.cells[rows[inside], columns[inside]]]
    near, heights, on_plane, flat, cells = (each[inside] for each in (near, heights, on_plane, flat, cells))
    occupied = filled_cells(cells[on_plane], shape)
    core = occupied & cells_along(np.column_stack([flat, heights]), cells, shape, angle_deg)
    core = _connected(core, middle - low)
    rim = ndimage.binary_dilation(core, np.ones((3, 3), dtype=np.bool_), iterations=RIM_CELLS, mask=occupied)
    kept: Indices = near[on_plane & rim[tuple(cells.T)]]
    return kept


def _near_plane(cloud: Array, patch: Patch, distance: float) -> tuple[Indices, Array]:
    """Indices, ascending, of the points within a distance of a patch's plane, and their heights over it."""
    normal, parts = patch.axes[2], []
    offset = patch.origin @ normal
    for start in range(0, len(cloud), BLOCK):
        heights = cloud[start : start + BLOCK] @ normal - offset
        near = np.flatnonzero(np.abs(heights) <= distance)
        parts.append((near + start, heights[near]))
    near, heights = (np.concatenate(each) for each in zip(*parts, strict=True))
    return near, heights


class Surroundings(NamedTuple):
    """A window of cells, its lowest cell in the grid, and which of its cells are connected to the seed's or next to
    such.
    """

    low: Indices
    cells: Mask


def _surroundings(cells: Indices, seed: Indices, side: int) -> Surroundings:
    """Cells in and around the connected part of the filled cells (n, 2) of a square grid that is nearest to the
    seed's.
    """
    connected = _connected(filled_cells(cells, (side, side)), seed)
    rows, columns = (np.flatnonzero(connected.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return Surroundings(seed, np.zeros((1, 1), dtype=np.bool_))
    window = np.pad(connected[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1], 1)
    grown_window: Mask = ndimage.binary_dilation(window, np.ones((3, 3), dtype=np.bool_))
    return Surroundings(np.array([rows[0] - 1, columns[0] - 1]), grown_window)


def filled_cells(cells: Indices, shape: tuple[int, int]) -> Mask:
    """Which cells of a grid are among the cells (n, 2)."""
    found = np.zeros(shape, dtype=np.bool_)
    found[cells[:, 0], cells[:, 1]] = True
    return found


def _connected(cells: Mask, seed: Indices) -> Mask:
    """The connected cells that reach nearest to the seed's."""
    labels, count = ndimage.label(cells, np.ones((3, 3)))
    if count == 0:
        return cells
    filled = np.argwhere(cells)
    nearest = filled[np.argmin(((filled - seed) ** 2).sum(axis=1))]
    connected: Mask = labels == labels[nearest[0], nearest[1]]
    return connected
