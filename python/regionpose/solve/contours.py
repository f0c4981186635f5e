"""Distances in pixels between observed contours and projected outlines, with derivatives by pose and camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
CameraAt = Callable[[Array], tuple[Camera, Pose]]
"""Camera and pose at some variables, each of which changes the image by about a fraction of itself."""

BEND_TOLERANCE_PX = 0.02
"""Projected edges are split until they are within this distance (pixels) of the curves they stand for."""

BEND_PROBES = (0.25, 0.5, 0.75)
"""Fractions of an edge at which its bend is evaluated; the middle alone would miss one that changes sides."""

BEND_MARGIN = 2.0
"""Bends counted for each one that is found at the probes: parts that are even in the world aren't so in the image."""

MOST_PARTS = 200
"""Parts of one edge at most; a square that fills a fisheye's image needs 30."""

STRETCH = 30
"""Neighboring pieces that may err alike, about 90 px: steps of an edge that nearly follows the pixels are long."""

DIFFERENCE = 1e-6
"""Step of central differences, in radians and fractions: pixels are then exact to 1e-7 of themselves for a step of
one."""

SIGMA_OVER_MEDIAN = 1.482602218505602
"""Standard deviation of a normal distribution over its median absolute value."""


@dataclass(frozen=True, eq=False)
class Contours:
    """The two sides of some regions, one after the other.

    `pieces`: means (m, 2) of equally long parts of the observed contours, pixels, without those that touch the image's
    border or a hidden edge. `vertices`: (v, 3) of the world regions' boundaries, split where the camera bends their
    edges; `following` (v,): index of the vertex after each on its ring. `rings`: number of pieces of each observed
    ring. `regions`: the slices of pieces and vertices of each region; `world_rings`: those of the vertices of each of
    its rings.
    """

    pieces: Array
    vertices: Array
    following: Indices
    rings: tuple[int, ...]
    regions: tuple[tuple[slice, slice], ...]
    world_rings: tuple[tuple[slice, ...], ...]

    def by_ring(self, values: Array) -> list[Array]:
        """Values of the pieces, (m, ...), ring by ring."""
        return np.split(values, np.cumsum(self.rings)[:-1])


class Distances(NamedTuple):
    """Signed distances (m,) of pieces from the projected outlines, pixels, and what they were measured from.

    `edges` (m,): index of the nearest edge's first vertex; `fractions` (m,): where on it the foot is; `normals` (m, 2):
    unit direction in which the distance grows, `value = normal . (piece - foot)`.
    """

    values: Array
    edges: Indices
    fractions: Array
    normals: Array


def contours_of(camera: Camera, images: Sequence[ImageRegion], worlds: Sequence[WorldRegion], pose: Pose) -> Contours:
    """The contours of region pairs; edges are split for this camera at this pose."""
    means = [_core.contour_pieces(image.rings, image.excluded_edges(camera)) for image in images]
    rings = [[_split_ring(camera, pose, ring) for ring in world.rings] for world in worlds]
    all_rings = [ring for region in rings for ring in region]
    slices = _slices([[ring] for ring in all_rings])
    following = [np.roll(np.arange(part.start, part.stop), -1) for part in slices]
    unassigned = iter(slices)
    return Contours(
        pieces=np.concatenate([ring for region in means for ring in region]),
        vertices=np.concatenate(all_rings),
        following=np.concatenate(following),
        rings=tuple(len(ring) for region in means for ring in region),
        regions=tuple(zip(_slices(means), _slices(rings), strict=True)),
        world_rings=tuple(tuple(islice(unassigned, len(region))) for region in rings),
    )


def distances_of(camera: Camera, contours: Contours, pose: Pose) -> Distances | None:
    """Distances of the pieces from their region's outline at a pose; None where a vertex is not visible."""
    pixels = _projected(camera, pose, contours)
    if not np.isfinite(pixels).all():
        return None
    ends = pixels[contours.following]
    edges = np.concatenate(
        [
            own.start + _core.nearest_edges([pixels[ring] for ring in rings], contours.pieces[part])
            for (part, own), rings in zip(contours.regions, contours.world_rings, strict=True)
        ]
    )
    start, step = pixels[edges], ends[edges] - pixels[edges]
    square = np.maximum((step * step).sum(axis=1), np.finfo(float).tiny)
    fractions = np.clip(((contours.pieces - start) * step).sum(axis=1) / square, 0.0, 1.0)
    offset = contours.pieces - start - fractions[:, None] * step
    normals = np.column_stack([step[:, 1], -step[:, 0]]) / np.sqrt(square)[:, None]
    # Beyond an end the distance is that from the vertex, and its direction the offset's own.
    length = np.hypot(*offset.T)
    beyond = ((fractions == 0.0) | (fractions == 1.0)) & (length > 0.0)
    normals[beyond] = offset[beyond] / length[beyond, None]
    return Distances((normals * offset).sum(axis=1), edges, fractions, normals)


def outline_derivatives(view: CameraAt, at: Array, contours: Contours) -> Array:
    """Derivatives (v, 2, p) of the projected vertices by the variables (p,) of a view, by central differences."""
    pixels = [
        [_projected(*view(at + sign * DIFFERENCE * unit), contours) for sign in (1.0, -1.0)] for unit in np.eye(len(at))
    ]
    derivatives = np.stack([(ahead - behind) / (2.0 * DIFFERENCE) for ahead, behind in pixels], axis=2)
    # A vertex on the very rim of the view is seen from one side only, and holds nothing.
    return np.nan_to_num(derivatives, nan=0.0)


def distance_derivatives(contours: Contours, distances: Distances, by_vertices: Array) -> Array:
    """Derivatives (m, p) of the distances, from those of the projected vertices, (v, 2, p).

    Exact for the polyline: the foot's slide along its edge is at right angles to the normal, so `d value =
    -n . ((1 - s) dq_a + s dq_b)`.
    """
    fractions = distances.fractions[:, None, None]
    first, second = by_vertices[distances.edges], by_vertices[contours.following[distances.edges]]
    derivatives: Array = -np.einsum("mc,mcp->mp", distances.normals, (1.0 - fractions) * first + fractions * second)
    return derivatives


def robust_sigma(distances: Array) -> float:
    """Standard deviation of a normal distribution about zero with the same median size."""
    return SIGMA_OVER_MEDIAN * float(np.median(np.abs(distances)))


def correlation_length(values: Sequence[Array]) -> float:
    """How many neighbors on closed rings vary as one: `1 + 2 sum of the autocorrelations` up to the first below 0.

    `values`: about zero, one array for each ring. The autocorrelation of a lag is the ratio of the sums over all rings;
    a ring counts for lags up to half its length. The crate's `correlation` takes contours for open and stops at a
    quarter of the longest: up to a third less where whole sides are put off, the same elsewhere.
    """
    square = sum(float(ring @ ring) for ring in values)
    total, lag = 1.0, 1
    while square > 0.0:
        product = sum(float(ring @ np.roll(ring, lag)) for ring in values if 2 * lag <= len(ring))
        if product <= 0.0:
            break
        total, lag = total + 2.0 * product / square, lag + 1
    return total


def neighbor_scatter(gradients: Sequence[Array]) -> Array:
    """Sum (p, p) of the products of gradients with each other's neighbors on closed rings, (n, p) each.

    Bartlett's weights (Newey and West 1987): the mean over all windows of the outer square of the sum in a window, of
    `STRETCH` gradients or half a ring.
    """
    total = np.zeros((gradients[0].shape[1],) * 2)
    for ring in gradients:
        length = max(min(STRETCH, len(ring) // 2), 1)
        sums = np.cumsum(np.vstack([np.zeros((1, ring.shape[1])), ring, ring[: length - 1]]), axis=0)
        windows = sums[length:] - sums[:-length]
        total += windows.T @ windows / length
    return total


def _projected(camera: Camera, pose: Pose, contours: Contours) -> Array:
    points = pose.transform(contours.vertices)
    if camera.period is None:
        return camera.project(points)
    columns = [float(np.mean(contours.pieces[part][:, 0])) for part, _ in contours.regions]
    parts = zip(contours.regions, columns, strict=True)
    return np.concatenate([camera.project_near(points[own], column) for (_, own), column in parts])


def _slices(regions: Sequence[Sequence[Array]]) -> list[slice]:
    """Where the rows of each region's rings are among those of all."""
    ends = np.cumsum([0, *(sum(map(len, rings)) for rings in regions)]).tolist()
    return [slice(start, end) for start, end in pairwise(ends)]


def _split_ring(camera: Camera, pose: Pose, ring: Array) -> Array:
    """The ring with vertices added where the camera bends its edges; all of them where it is not in view."""
    if camera.straight_lines:
        return ring
    step = np.roll(ring, -1, axis=0) - ring
    column = camera.project(pose.transform(ring[:1]))[0, 0]
    ends = camera.project_near(pose.transform(ring), column)
    chord = np.roll(ends, -1, axis=0) - ends
    length = np.maximum(np.hypot(*chord.T), np.finfo(float).tiny)
    sagitta = np.zeros(len(ring))
    for fraction in BEND_PROBES:
        x, y = (camera.project_near(pose.transform(ring + fraction * step), column) - ends).T
        off_chord = np.abs(chord[:, 0] * y - chord[:, 1] * x) / length
        sagitta = np.fmax(sagitta, off_chord / (4.0 * fraction * (1.0 - fraction)))
    parts = np.clip(np.ceil(np.sqrt(BEND_MARGIN * sagitta / BEND_TOLERANCE_PX)), 1, MOST_PARTS).astype(np.int64)
    first = np.repeat(np.arange(len(ring)), parts)
    within = np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)
    split: Array = ring[first] + (within / parts[first])[:, None] * step[first]
    return split
