"""The whole plane around a seed: what lies on one plane, across windows and shadows, wherever on it the seed is.

A patch grown from a seed ends where a gap is wider than those around the seed, and takes its noise and its spacing
from there: another seed grows another patch. Here it is a start alone. Its plane is looked for in all of the cloud;
what lies on it falls into pieces; pieces that are near for their size belong together, since little but a common
surface puts two surfaces on one plane. Plane, noise and spacing are then those of all these pieces, until they stay.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from regionpose._core import cells_along
from regionpose.progress import Progress, part
from regionpose.regions.outline import bridging_radius
from regionpose.regions.plane_samples import MAD_TO_SIGMA
from regionpose.segment.cloud import checked_cloud, started_patch
from regionpose.segment.patch import (
    ANGLE_DEG,
    CELL_DISTANCES,
    DISTANCE_SIGMAS,
    FIT_POINTS,
    LEAST_DISTANCE_FRACTION,
    MOST_CELLS,
    RIM_CELLS,
    SPACING_POINTS,
    Indices,
    Mask,
    Patch,
    filled_cells,
    grown,
)
from regionpose.validation.arrays import Array

MOST_ROUNDS = 12
"""Rounds until a plane and its points stay the same, at the most; a convention, at which few points come and go."""

SAME_FRACTION = 2e-3
"""Fraction of the points that may come and go with the last digits of the plane."""

SPACINGS = 9
"""Places over a plane at which the gap between scan lines is looked at; the median of these is the plane's."""

TOGETHER = 32
"""Points of a plane that are off together, as those of a scan line are: so many count as one in the estimate of how
well the plane is known away from them. A convention, about what a line of a lidar has on a wall."""

WIDEST = 2.0
"""Distance from the plane, over that of its own points, at which points far from these are looked for at the most."""

LEAST_PIECE = 12
"""Points of a piece at the least: fewer lie on a plane by chance."""

LAYER, MOST_BESIDE = 3.0, 0.5
"""Distance from the plane, over that of its members, up to which points before and behind a piece count, and their
fraction of it at the most: a volume filled evenly, such as the crown of a tree that crosses the plane, has two."""

MOST_APART = 0.5
"""Gap between two pieces over the size of the smaller one up to which they are one plane; a convention."""


class Piece(NamedTuple):
    """A connected part of what lies on a plane: indices of its points, its cells (n, 2), and its size in cells."""

    members: Indices
    cells: Indices
    size: float


def whole_plane(points: ArrayLike, seed: ArrayLike | int, *, progress: Progress | None = None) -> Indices:
    """Indices, ascending, of the points on the plane around a seed: across gaps, and the same from each of its points.

    Parameters
    ----------
    points : (n, 3) array
        Meters.
    seed : int or (3,) array
        The index of a point, or a position.
    progress : callable, optional
        Called with a fraction in [0, 1].

    Raises
    ------
    ValueError
        As of `grow_plane`.
    """
    cloud = checked_cloud(points)
    start, patch = started_patch(cloud, seed)
    patch = grown(cloud, patch, start, ANGLE_DEG, part(progress, 0.0, 0.5))
    for round_ in range(MOST_ROUNDS):
        before = patch.members
        patch = _fitted(cloud, patch)
        members = _linked(cloud, patch)
        if len(members) < LEAST_PIECE:
            break
        patch = patch._replace(members=members)
        if progress is not None:
            progress(0.5 + 0.5 * (round_ + 1) / MOST_ROUNDS)
        changed = len(before) + len(members) - 2 * len(np.intersect1d(before, members, assume_unique=True))
        if changed <= SAME_FRACTION * len(members):
            break
    if progress is not None:
        progress(1.0)
    return np.sort(patch.members)


def _fitted(cloud: Array, patch: Patch) -> Patch:
    """The patch with the plane, the noise and the cell that all of its members ask for."""
    member_points = cloud[np.sort(patch.members)]
    used = member_points[:: max(1, len(member_points) // FIT_POINTS)]
    for _ in range(2):
        origin = used.mean(axis=0)
        axes = np.linalg.svd(used - origin, full_matrices=False)[2]
        heights = (member_points - origin) @ axes[2]
        sigma = MAD_TO_SIGMA * float(np.median(np.abs(heights)))
        kept = member_points[np.abs(heights) <= DISTANCE_SIGMAS * sigma]
        used = kept[:: max(1, len(kept) // FIT_POINTS)] if len(kept) >= LEAST_PIECE else used
    axes[1] = np.cross(axes[2], axes[0])
    gap = _spacing((member_points - origin) @ axes[:2].T)
    distance = max(DISTANCE_SIGMAS * sigma, LEAST_DISTANCE_FRACTION * gap)
    return patch._replace(
        origin=origin, axes=axes, sigma=sigma, distance=distance, cell=max(gap, CELL_DISTANCES * distance)
    )


def _spacing(flat: Array) -> float:
    """The usual gap between scan lines over points (n, 2) of a plane: the median of what a few places show."""
    order = np.argsort(flat[:, 0], kind="stable")
    places = flat[order[np.linspace(0, len(order) - 1, SPACINGS + 2).astype(np.intp)[1:-1]]]
    near = np.asarray(cKDTree(flat).query(places, min(SPACING_POINTS, len(flat)))[1], dtype=np.intp)
    return float(np.median([bridging_radius(flat[indices]) for indices in near]))


def _linked(cloud: Array, patch: Patch) -> Indices:
    """The points of all pieces of the plane that belong together with most of the members."""
    pieces = _pieces(cloud, patch)
    if not pieces:
        return patch.members[:0]
    labels = _together(pieces)
    shared = [np.isin(piece.members, patch.members, assume_unique=True).sum() for piece in pieces]
    fractions = np.bincount(labels, weights=np.array(shared, dtype=np.float64))
    chosen = int(np.argmax(fractions))
    return np.concatenate([piece.members for piece, label in zip(pieces, labels, strict=True) if label == chosen])


def _pieces(cloud: Array, patch: Patch) -> list[Piece]:
    """The connected parts of what lies on a plane with its normal, in cells; vegetation left out."""
    off = cloud @ patch.axes[2] - patch.origin @ patch.axes[2]
    layer = np.flatnonzero(np.abs(off) <= max(patch.cell, LAYER * patch.distance))
    local = (cloud[layer] - patch.origin) @ patch.axes.T
    flat, heights = local[:, :2], np.abs(local[:, 2])
    low, extent = flat.min(axis=0), float(np.ptp(flat, axis=0).max())
    cell = max(patch.cell, extent / MOST_CELLS)
    cells = np.floor((flat - low) / cell).astype(np.intp)
    rows, columns = (cells.max(axis=0) + 1).tolist()
    on_plane = heights <= _limits(cloud, patch, flat)
    thick = heights <= patch.cell
    occupied = filled_cells(cells[on_plane], (rows, columns))
    core = occupied & cells_along(local[thick], cells[thick], (rows, columns), ANGLE_DEG)
    numbered, count = ndimage.label(core, np.ones((3, 3)))
    labels = np.asarray(numbered, dtype=np.intp)
    # Edges between two planes mix normals there: points beside the core join by their distance.
    around = _spread(labels, occupied)
    own = np.where(on_plane, around[tuple(cells.T)], 0)
    beside = np.where(on_plane | (heights > LAYER * patch.distance), 0, around[tuple(cells.T)])
    members, beside_counts = (np.bincount(each, minlength=count + 1)[1:] for each in (own, beside))
    kept = np.flatnonzero((members >= LEAST_PIECE) & (beside_counts <= MOST_BESIDE * members)) + 1
    return [_piece(label, layer, own, labels) for label in kept.tolist()]


def _piece(label: int, layer: Indices, own: Indices, labels: Indices) -> Piece:
    cells = np.argwhere(labels == label)
    return Piece(layer[own == label], cells, float(np.sqrt(len(cells))))


def _spread(labels: Indices, occupied: Mask) -> Indices:
    """The labels of cells, and of occupied ones within the rim around them that of the nearest."""
    if not labels.any():
        return labels
    far, (rows, columns) = ndimage.distance_transform_cdt(labels == 0, metric="chessboard", return_indices=True)
    return np.where(occupied & (far <= RIM_CELLS), labels[rows, columns], 0)


def _limits(cloud: Array, patch: Patch, flat: Array) -> Array:
    """How far from the plane each place (n, 2) may show a point of it (n,): noise, and the uncertainty of the plane
    away from its members.
    """
    plane_points = (cloud[patch.members] - patch.origin) @ patch.axes[:2].T
    spread = np.maximum(plane_points.var(axis=0), np.finfo(float).tiny)
    leverage = TOGETHER / len(plane_points) * (1.0 + ((flat - plane_points.mean(axis=0)) ** 2 / spread).sum(axis=1))
    return np.asarray(patch.distance * np.minimum(np.sqrt(1.0 + leverage), WIDEST))


def _together(pieces: list[Piece]) -> Indices:
    """A label for each piece: the same for those that are near for the size of the smaller of them, and so on."""
    firsts, seconds = [], []
    trees = [cKDTree(piece.cells) for piece in pieces]
    for first, piece in enumerate(pieces):
        for second in range(first + 1, len(pieces)):
            most = max(1.0, MOST_APART * min(piece.size, pieces[second].size))
            small, large = sorted((first, second), key=lambda index: len(pieces[index].cells))
            found = trees[large].query(pieces[small].cells, distance_upper_bound=1.0 + most)[0]
            if np.isfinite(found).any():
                firsts.append(first)
                seconds.append(second)
    count = len(pieces)
    graph = coo_array((np.ones(len(firsts)), (firsts, seconds)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)
