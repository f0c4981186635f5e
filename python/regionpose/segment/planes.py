"""All planar patches of a point cloud, without a seed.

Starts are looked for all over the cloud; the flattest grow first. A patch is one only if it shows it: thin for its
extent, with noise like that of the sensor, and with few points just before and behind it. Hedges and crowns of trees
fail these tests.
"""

from __future__ import annotations

from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from regionpose.progress import Progress, part
from regionpose.segment.cloud import check_optional_positive, check_positive, checked_cloud
from regionpose.segment.patch import (
    ANGLE_DEG,
    LEAST_IN_BLOCK,
    MOST_CELLS,
    SEED_THICKNESS,
    SEED_WIDTH,
    Indices,
    Patch,
    grown,
    start_patch,
)
from regionpose.validation.arrays import Array, finite_rows

MOST_THINNED = 150_000
"""Points to which a cloud is thinned to look for planes; the patches found are filled with all points afterwards."""

SEARCHED = 0.5
"""Fraction of the progress reported before patches of a thinned cloud are filled, which takes about as long."""

LEAST_PATCH = 50
"""Points below which a patch isn't reported by default."""

LEAST_THINNED = 24
"""Points of a patch in the thinned cloud at the least; fewer pass for flat by chance."""

SEED_LOT = 128
"""Seeds looked at together, of which the flattest grow first."""

SCALES = (32, 96, 384)
"""Neighbors of a seed from which its flatness is estimated; the first may all lie on one scan line."""

FLAT = 0.1
"""Thickness over width of a neighborhood whose noise is taken for the sensor's: beyond it the surface may be rough."""

LEAST_NOISE_FRACTION = 0.02
"""Least noise of the sensor over the distance between neighbors, for clouds without noise."""

ROUGHNESS = 10.0
"""Noise of a patch over that of the flattest surfaces at the most: a beam's noise counts along the beam, so that a road
met at 6 degrees shows a tenth of what a wall shows that is met frontally."""

MOST_THICKNESS = 0.15
"""Thickness of a patch over its width at the most; a face that is narrower than 24 standard deviations of the noise
cannot be distinguished from a strip of clutter."""

LAYER = 3.0
"""Distance from the plane, over that of its members at the most, up to which points before and behind it count."""

FRINGE = 1.5
"""Distance from the plane, over that of its members at the most, up to which noise puts points of the surface: no patch
is made of these."""

MOST_FRINGE = 0.5
"""Fraction of a patch that may be such points of patches found before."""

MOST_BESIDE = 0.25
"""Points before and behind a patch over its members at the most; a volume filled evenly has two."""


def find_planes(
    points: ArrayLike,
    *,
    min_points: int = LEAST_PATCH,
    distance_m: float | None = None,
    radius_m: float | None = None,
    angle_deg: float = ANGLE_DEG,
    progress: Progress | None = None,
) -> list[Indices]:
    """Index arrays, ascending, of the planar patches of a cloud, the largest first; no point is in two.

    A patch is thinner than 0.15 of its width, has noise of at most ten times that of the
    flattest neighborhoods, and has within three times its members' distance at most a quarter as many points before and
    behind it as members. A cloud of more than 150 000 points is thinned to one point a voxel, on which patches grow;
    then each is filled with the points around it. Random choices are seeded: the same cloud gives the same patches.

    Parameters
    ----------
    points : (n, 3) array
        Meters.
    min_points : int
        Of a patch at the least.
    distance_m, radius_m : float, optional
        As in `grow_plane`.
    angle_deg : float
        As in `grow_plane`.
    progress : callable, optional
        Called with a fraction in [0, 1].

    Raises
    ------
    ValueError
        For a cloud that isn't (n, 3) numbers with 3 finite points, or options out of range.
    """
    cloud = checked_cloud(points)
    check_positive(angle_deg=angle_deg)
    check_optional_positive(distance_m=distance_m, radius_m=radius_m)
    if not isinstance(min_points, Integral) or min_points < 3:
        raise ValueError(f"min_points is {min_points}; needed a whole number of 3 or more")
    finite = np.flatnonzero(finite_rows(cloud))
    settings = distance_m, radius_m, angle_deg
    if len(finite) <= MOST_THINNED:
        # Trees of neighbors take points in one place for one after the other.
        first, number = _distinct(cloud[finite])
        patches = Search(cloud[finite[first]], min_points, settings).patches(progress)
        whole = [patch.members for patch in patches if len(patch.members) >= min_points]
        found = [finite[np.isin(number, members)] for members in whole]
    else:
        thinned = _thinned(cloud, finite)
        search = Search(cloud[thinned], min_points * len(thinned) / len(finite), settings)
        patches = search.patches(part(progress, 0.0, SEARCHED))
        patches = [patch._replace(members=thinned[patch.members]) for patch in patches]
        found = _filled(cloud, finite, patches, part(progress, SEARCHED, 1.0))
    return sorted((members for members in found if len(members) >= min_points), key=len, reverse=True)


def _distinct(cloud: Array) -> tuple[Indices, Indices]:
    """The first point of each place of a cloud (n, 3), ascending, and which of these each point (n,) is."""
    # Equal points follow one another, in their order; few share the first coordinate, and only these need the others.
    order = np.argsort(cloud[:, 0], kind="stable")
    is_same = np.diff(cloud[order, 0]) == 0.0
    shared = np.flatnonzero(np.append(is_same, False) | np.append(False, is_same))
    order[shared] = order[shared][np.lexsort(cloud[order[shared]].T[::-1])]
    is_first = np.ones(len(order), dtype=bool)
    is_first[1:] = (cloud[order[1:]] != cloud[order[:-1]]).any(axis=1)
    first, number = order[is_first], np.empty_like(order)
    number[order] = np.cumsum(is_first) - 1
    rank = np.empty_like(first)
    rank[np.argsort(first)] = np.arange(len(first))
    return np.sort(first), rank[number]


class Search:
    """The patches of a finite cloud (n, 3), found one after the other, each without the points of those before."""

    def __init__(self, cloud: Array, least: float, settings: tuple[float | None, float | None, float]) -> None:
        """`least`: points of a patch. `settings`: distance, radius and angle of `grow_plane`."""
        self.left = np.arange(len(cloud))
        self.rest = cloud.copy()
        self.untried = np.ones(len(cloud), dtype=np.bool_)
        self.fringe = np.zeros(len(cloud), dtype=np.bool_)
        self.least = max(LEAST_THINNED, int(least))
        self.distance, self.radius, self.angle_deg = settings
        self.generator = np.random.default_rng(0)
        self.noise = np.inf

    def patches(self, progress: Progress | None) -> list[Patch]:
        """All patches, in the order in which they are found."""
        found: list[Patch] = []
        count = len(self.left)
        while self.untried.any():
            lot = self._patches_of_lot()
            found += [patch._replace(members=self.left[patch.members]) for patch in lot]
            self._shrink()
            if progress is not None:
                progress(1.0 - float(self.untried.sum()) / count)
        if progress is not None:
            progress(1.0)
        return found

    def _shrink(self) -> None:
        """Leave the points of patches out of what the following lots look at."""
        free = np.isfinite(self.rest[:, 0])
        self.left, self.rest = self.left[free], self.rest[free]
        self.untried, self.fringe = self.untried[free], self.fringe[free]

    def _patches_of_lot(self) -> list[Patch]:
        """Patches from one lot of random seeds, the flattest first."""
        choice = np.flatnonzero(self.untried)
        lot = choice[self.generator.permutation(len(choice))[:SEED_LOT]]
        near = _neighbors(self.rest, lot)
        thickness, sigma = _flatness(self.rest[near])
        if not np.isfinite(self.noise) and (thickness < FLAT).any():
            steps = np.linalg.norm(self.rest[near[:, 1]] - self.rest[near[:, 0]], axis=1)
            self.noise = float(max(np.median(sigma[thickness < FLAT]), LEAST_NOISE_FRACTION * np.median(steps)))
        flat = np.argsort(thickness, kind="stable")
        flat = flat[(thickness[flat] <= SEED_THICKNESS) & (sigma[flat] <= ROUGHNESS * self.noise)]
        found = [patch for row in flat if self.untried[lot[row]] and (patch := self._patch(near[row])) is not None]
        self.untried[near[:, :LEAST_THINNED]] = False
        return found

    def _patch(self, near: Indices) -> Patch | None:
        """The patch around the first of some neighboring points, if it is one; its points leave the rest."""
        near = near[np.isfinite(self.rest[near, 0])]
        if len(near) < LEAST_IN_BLOCK:
            return None
        seed = self.rest[near[0]].copy()
        try:
            start = start_patch(self.rest, seed, near, self.distance, self.radius)
        except ValueError:
            return None
        # Another seed on the same points would grow to much the same patch.
        self.untried[start.members] = False
        if start.sigma > ROUGHNESS * self.noise:
            return None
        patch = grown(self.rest, start, seed, self.angle_deg, None)
        self.untried[patch.members] = False
        if len(patch.members) < self.least or self._is_thick(patch) or self.fringe[patch.members].mean() > MOST_FRINGE:
            return None
        layer = _in_same_cells(self.rest, patch, self.rest[patch.members], LAYER * patch.distance)
        if len(layer) > (1.0 + MOST_BESIDE) * len(patch.members):
            return None
        fringe = _in_same_cells(self.rest, patch, self.rest[patch.members], FRINGE * patch.distance)
        self.fringe[fringe] = True
        self.untried[fringe] = False
        self.rest[patch.members] = np.nan
        return patch

    def _is_thick(self, patch: Patch) -> bool:
        """Whether the patch is too thick for its width, or for the noise of the sensor."""
        local = (self.rest[patch.members] - patch.origin) @ patch.axes.T
        thickness, width, _ = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(local.T)), 0.0))
        return bool(thickness > min(MOST_THICKNESS * width, ROUGHNESS * self.noise))


def _neighbors(cloud: Array, chosen: Indices) -> Indices:
    """Indices (m, k) of the points nearest to each of the chosen ones, itself first."""
    count = min(SCALES[-1], len(cloud))
    found: Indices = np.asarray(cKDTree(cloud).query(cloud[chosen], count)[1]).reshape(len(chosen), count)
    return found


def _flatness(near: Array) -> tuple[Array, Array]:
    """Least thickness over width of neighborhoods (m, k, 3), nearest point first, and its thickness in meters.

    Neighborhoods that are all but a line have none.
    """
    ratios, sigmas = [], []
    for size in SCALES:
        offsets = near[:, :size] - near[:, :size].mean(axis=1, keepdims=True)
        products = np.einsum("mka,mkb->mab", offsets, offsets) / offsets.shape[1]
        thickness, width, length = np.sqrt(np.maximum(np.linalg.eigvalsh(products), 0.0)).T
        spread = width > SEED_WIDTH * length
        ratios.append(np.divide(thickness, width, out=np.full(len(near), np.inf), where=spread))
        sigmas.append(thickness)
    best = np.argmin(ratios, axis=0), np.arange(len(near))
    return np.array(ratios)[best], np.array(sigmas)[best]


def _thinned(cloud: Array, finite: Indices) -> Indices:
    """Of indices of finite points one a voxel; the voxels are as small as the most points allow."""
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


def _filled(cloud: Array, finite: Indices, patches: list[Patch], progress: Progress | None) -> list[Indices]:
    """The patches, found on some of the cloud, with all its finite points in the same cells; earlier patches first."""
    rest, remaining = finite, cloud[finite]
    found = []
    for patch in patches:
        near = _in_same_cells(remaining, patch, cloud[patch.members], patch.distance)
        found.append(rest[near])
        kept = np.ones(len(rest), dtype=np.bool_)
        kept[near] = False
        rest, remaining = rest[kept], remaining[kept]
        if progress is not None:
            progress(len(found) / len(patches))
    return found


def _in_same_cells(points: Array, patch: Patch, members: Array, distance: float) -> Indices:
    """Indices of points within a distance of the patch's plane in the cells that its members occupy."""
    heights = points @ patch.axes[2] - patch.origin @ patch.axes[2]
    near = np.flatnonzero(np.abs(heights) <= distance)
    flat, sought = ((given - patch.origin) @ patch.axes[:2].T for given in (members, points[near]))
    low, extent = flat.min(axis=0), np.ptp(flat, axis=0)
    cell = max(patch.cell, float(extent.max()) / MOST_CELLS)
    filled = np.zeros(np.floor(extent / cell).astype(np.intp) + 1, dtype=np.bool_)
    filled[tuple(np.floor((flat - low) / cell).astype(np.intp).T)] = True
    cells = np.floor((sought - low) / cell).astype(np.intp)
    inside = np.flatnonzero(((cells >= 0) & (cells < filled.shape)).all(axis=1))
    chosen: Indices = near[inside[filled[tuple(cells[inside].T)]]]
    return chosen
