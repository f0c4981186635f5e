"""What a scan knows of a planar region: places on its plane that beams found to be the region, and places that are not.

A lidar does not measure an outline. Each of its beams met the region, passed the plane beside it, or ended before the
plane and is no evidence.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError, cKDTree

from regionpose.regions.absent_beams import absent_places, scan_reach
from regionpose.regions.outline import bridging_radius
from regionpose.regions.plane_samples import LEAST_APPROACH, PlaneSamples
from regionpose.validation.arrays import Array

Mask = NDArray[np.bool_]
Kind = TypeVar("Kind", np.float64, np.intp)

BESIDE = 0.5
"""How far beside the region samples are looked for, over its extent: farther than a rough start is off."""

CHUNK = 1_000_000
"""Points of a cloud that are looked at at once, which bounds the memory."""

CLEARLY = 2.0
"""Distance beyond the plane, in those up to which points belong to it, from which a beam has passed it: range noise and
what stands back from a face, such as a joint, end sooner."""

EDGE_SAMPLES = 800
"""Samples of either kind together, next to one of the other kind, that are kept: a pose is known no better by more."""

OTHER_SAMPLES = 200
"""Other samples that are kept: far from all edges they only separate wrong poses from right ones."""

MOST_TRIANGULATED = 20_000
"""Samples that are joined to find neighbors; of more those near the edges alone, cell by cell."""

CELL_SAMPLES = 16
"""Samples of such a cell on average."""


LEAST_SURROUNDED = 0.5
"""Fraction of the outermost returns that need a neighbor on the plane where nothing else is known to be outside: with
less the outline, which takes the rest for the region's end, knows more. A convention: most of them."""


class ScanSamples(NamedTuple):
    """Places (n, 2), (m, 2) and (k, 2) in a plane's coordinates: inside a region, outside, and outside but enclosed."""

    inside: Array
    outside: Array
    enclosed: Array

    @classmethod
    def of(cls, inside: Array, outside: Array) -> ScanSamples:
        """Places inside (n, 2) and outside (m, 2), of which some are in holes or windows."""
        within = enclosed(inside, outside)
        return cls(inside, outside[~within], outside[within])


def scan_samples(
    points: Array,
    members: NDArray[np.intp],
    plane: PlaneSamples,
    rings: list[Array],
    sensor_origin: ArrayLike | None,
    extends: bool,
    absent: Array | None = None,
) -> ScanSamples | None:
    """The samples of a region whose returns are `members` of the points (n, 3), on its plane with the outline `rings`.

    Outside are the places where beams passed the plane, and returns on the plane that are no members; with `extends`
    not those that are joined to members without a gap. Beams without a return, directions `absent` (k, 3), passed the
    plane, too. Without `sensor_origin` only returns count. None where nothing is known to be outside, or these don't
    surround the region. Of many samples those next to the other kind are kept, and a few of the rest.
    """
    inside = plane.flat
    beside = BESIDE * float(np.ptp(inside, axis=0).max())
    window = (inside.min(axis=0) - beside, inside.max(axis=0) + beside)
    sensor = None if sensor_origin is None else np.asarray(sensor_origin, dtype=np.float64)
    passed, neighbors = other_places(points, members, Sight(plane, window, sensor), absent)
    if extends and len(neighbors):
        neighbors = neighbors[~joined(inside, neighbors)]
    outside = np.concatenate([passed, neighbors])
    if len(outside) == 0 or (sensor is None and not _surrounded(inside, outside, rings)):
        return None
    samples = _informative(inside, outside, rings)
    return samples if len(samples.outside) else None


class Sight(NamedTuple):
    """The points that are evidence for a window of a plane: of beams through it, or on the plane alone."""

    plane: PlaneSamples
    window: tuple[Array, Array]
    sensor: Array | None

    def reaches(self, points: Array) -> Mask:
        """Whether each of the points (k, 3) is on the plane, or beyond it as the sensor sees it."""
        normal, limit = self.plane.axes[2], self.plane.noise
        heights = points @ normal - self.plane.origin @ normal
        if self.sensor is None:
            near: Mask = np.abs(heights) <= limit
            return near
        ahead = (self.plane.origin - self.sensor) @ normal > 0.0
        reached: Mask = heights >= -limit if ahead else heights <= limit
        return reached

    def holds(self, points: Array) -> Mask:
        """Whether each of the points (k, 3) lies in a cone around the window from the sensor, or in a ball about it."""
        flat = np.array([(u, v) for u in self._sides(0) for v in self._sides(1)])
        corners = self.plane.origin + flat @ self.plane.axes[:2]
        middle = corners.mean(axis=0)
        if self.sensor is None:
            inside: Mask = np.sum((points - middle) ** 2, axis=1) <= np.max(np.sum((corners - middle) ** 2, axis=1))
            return inside
        ways, axis, offsets = corners - self.sensor, middle - self.sensor, points - self.sensor
        least = float((ways @ axis / np.linalg.norm(ways, axis=1)).min())
        is_within_cone: Mask = offsets @ axis >= least * np.linalg.norm(offsets, axis=1)
        return is_within_cone

    def _sides(self, axis: int) -> tuple[float, float]:
        return float(self.window[0][axis]), float(self.window[1][axis])


def other_places(
    points: Array, members: NDArray[np.intp], sight: Sight, absent: Array | None = None
) -> tuple[Array, Array]:
    """Places (n, 2) that the beams of points (k, 3) other than the members passed, and (m, 2) at which they ended.

    The former also of beams without a return, directions `absent` (j, 3).
    """
    is_member = np.zeros(len(points), dtype=np.bool_)
    is_member[members] = True
    passed, ended = [], []
    for first in range(0, len(points), CHUNK):
        part = slice(first, first + CHUNK)
        candidates = points[part][sight.reaches(points[part]) & ~is_member[part]]
        through, on_plane = _places(candidates[sight.holds(candidates)], sight)
        passed.append(through)
        ended.append(on_plane)
    if absent is not None and sight.sensor is not None:
        steep = absent[np.abs(absent @ sight.plane.axes[2]) >= LEAST_APPROACH]
        reach = scan_reach(points, sight.sensor)
        places = absent_places(steep, points[members], reach, sight.plane, sight.sensor)
        passed.append(_within(places, sight.window))
    return np.concatenate(passed), np.concatenate(ended)


def _places(points: Array, sight: Sight) -> tuple[Array, Array]:
    """Places in the window that the beams of points (k, 3) passed, and at which they ended on the plane."""
    plane, window, sensor = sight
    if sensor is None:
        return np.empty((0, 2)), _within((points - plane.origin) @ plane.axes[:2].T, window)
    normal = plane.axes[2]
    depth = float((plane.origin - sensor) @ normal)
    beams = points - sensor
    toward = beams @ normal
    steep = np.abs(toward) >= LEAST_APPROACH * np.linalg.norm(beams, axis=1)
    beams, toward = beams[steep], toward[steep]
    flat = (sensor - plane.origin + beams * (depth / toward)[:, None]) @ plane.axes[:2].T
    beyond = (toward - depth) * np.sign(depth)
    # What stands out or back by more than noise, such as a frame, may be the region's or not.
    on_plane = np.abs(beyond) <= plane.noise
    return _within(flat[beyond > CLEARLY * plane.thickness], window), _within(flat[on_plane], window)


def _within(flat: Array, window: tuple[Array, Array]) -> Array:
    low, high = window
    inside: Array = flat[((flat >= low) & (flat <= high)).all(axis=1)]
    return inside


def joined(inside: Array, neighbors: Array) -> Mask:
    """Whether each of the neighbors (m, 2) is joined to the samples (n, 2) by steps no longer than their gaps.

    The same of both on a line, (m, 1) and (n, 1).
    """
    reach = bridging_radius(subsample(inside, MOST_TRIANGULATED))
    near = cKDTree(inside).query(neighbors, distance_upper_bound=reach)[0] <= reach
    pairs = cKDTree(neighbors).query_pairs(reach, output_type="ndarray")
    count = len(neighbors)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    parts = connected_components(graph, directed=False)[1]
    is_joined: Mask = np.isin(parts, np.unique(parts[near]))
    return is_joined


def _surrounded(inside: Array, outside: Array, rings: list[Array]) -> bool:
    """Whether most of the outermost of the samples (n, 2) have one outside (m, 2) a gap away."""
    rim = inside[_on_rim(inside, np.ones(len(inside), dtype=np.bool_), rings)]
    reach = bridging_radius(subsample(inside, MOST_TRIANGULATED))
    near = cKDTree(outside).query(rim, distance_upper_bound=reach)[0] <= reach
    return bool(np.mean(near) >= LEAST_SURROUNDED)


def _informative(inside: Array, outside: Array, rings: list[Array]) -> ScanSamples:
    """The samples next to one of the other kind or to the outline, not too many, and a few others."""
    places = np.concatenate([inside, outside])
    is_inside = np.arange(len(places)) < len(inside)
    kept = _near_edges(places, is_inside)
    at_edge = _is_at_boundary(places[kept], is_inside[kept]) | _on_rim(places[kept], is_inside[kept], rings)
    edge = np.zeros(len(places), dtype=np.bool_)
    edge[kept[at_edge]] = True
    chosen = [subsample(np.flatnonzero(edge), EDGE_SAMPLES), subsample(np.flatnonzero(~edge), OTHER_SAMPLES)]
    # In no order: every so many of them are then as even as all.
    order = np.random.default_rng(0).permutation(np.concatenate(chosen))
    return ScanSamples.of(places[order[is_inside[order]]], places[order[~is_inside[order]]])


def enclosed(inside: Array, outside: Array) -> Mask:
    """Whether each of the places (m, 2) outside a region is surrounded by those (n, 2) inside: in a hole, or a window.

    No path of natural neighbors among those outside connects it to one of the outermost places.
    """
    places, count = np.concatenate([inside, outside]), len(inside)
    try:
        mesh = Delaunay(places - places.mean(axis=0))
    except QhullError:
        return np.zeros(len(outside), dtype=np.bool_)
    edges = mesh.simplices[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    first, second = edges[(edges >= count).all(axis=1)].T - count
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(outside), len(outside)))
    parts = connected_components(graph, directed=False)[1]
    rim = mesh.convex_hull[mesh.convex_hull >= count] - count
    surrounded: Mask = ~np.isin(parts, parts[rim])
    return surrounded


def subsample(items: NDArray[Kind], most: int) -> NDArray[Kind]:
    """At most so many of the items, chosen without order."""
    if len(items) <= most:
        return items
    chosen: NDArray[Kind] = items[np.sort(np.random.default_rng(0).choice(len(items), most, replace=False))]
    return chosen


def _near_edges(places: Array, is_inside: Mask) -> NDArray[np.intp]:
    """Indices of at most so many places as a triangulation takes, in cells where both kinds or none are near."""
    everything = np.arange(len(places))
    if len(places) <= MOST_TRIANGULATED:
        return everything
    low, extent = places.min(axis=0), np.ptp(places, axis=0)
    size = float(np.sqrt(np.prod(extent) * CELL_SAMPLES / len(places)))
    cells = np.floor((places - low) / size).astype(np.intp)
    shape = cells.max(axis=0) + 3
    number = (cells[:, 0] + 1) * shape[1] + cells[:, 1] + 1
    counts = [
        np.bincount(number[kind], minlength=int(np.prod(shape))).reshape(shape) > 0 for kind in (is_inside, ~is_inside)
    ]
    around = [_dilated(count) for count in counts]
    mixed = (around[0] & around[1]) | _dilated(~(counts[0] | counts[1]))
    near: NDArray[np.intp] = everything[mixed.ravel()[number]]
    if len(near) <= MOST_TRIANGULATED:
        return near
    # Whole cells, so that neighbors stay neighbors.
    used = np.unique(number[near])
    fraction = MOST_TRIANGULATED / len(near)
    thinned: NDArray[np.intp] = near[np.isin(number[near], subsample(used, int(fraction * len(used))))]
    return thinned


def _dilated(cells: Mask) -> Mask:
    grown = cells.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            grown |= np.roll(cells, step, axis=axis)
    return grown


def _is_at_boundary(places: Array, is_inside: Mask) -> Mask:
    """Whether each place (n, 2) has a natural neighbor of the other kind."""
    try:
        triangles = Delaunay(places - places.mean(axis=0)).simplices
    except QhullError:
        return np.ones(len(places), dtype=np.bool_)
    mixed = is_inside[triangles].any(axis=1) & ~is_inside[triangles].all(axis=1)
    beside = np.zeros(len(places), dtype=np.bool_)
    beside[triangles[mixed].ravel()] = True
    return beside


def _on_rim(places: Array, is_inside: Mask, rings: list[Array]) -> Mask:
    """Whether each place (n, 2) inside is an outermost one, beyond which nothing may be known."""
    region = shapely.Polygon(rings[0], rings[1:])
    inner = region.buffer(-np.sqrt(region.area / max(int(is_inside.sum()), 1)))
    shapely.prepare(inner)
    rim: Mask = is_inside & ~shapely.contains_xy(inner, places[:, 0], places[:, 1])
    return rim
