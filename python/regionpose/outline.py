"""From points on a plane to the plane and the outline."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import Delaunay, QhullError, cKDTree
from shapely.geometry.base import BaseGeometry

from regionpose import _core
from regionpose.scan_lines import ScanLines, scan_lines

Array = NDArray[np.float64]

PLANE_POINTS = 100_000
"""Points to which the plane of an outline is fitted; more change it by less than a hundredth of the noise."""

PLANE_TRIALS = 200
"""Planes through three random points that are tried: 40 % of outliers leave a wrong best with odds of 1e-21."""

MEDIAN_POINTS = 2000
"""Points from which a trial plane's median distance is taken; more change it by under 3 %."""

MAD_TO_SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""

INLIER_SIGMAS = 3.0
"""Points farther from the plane than this many standard deviations have no part in it."""

REFITS = 10
"""Least squares fits to the inliers at the most; they settle in two or three."""

LINE_WIDTH_SHARE = 0.15
"""Width over length below which the points on a plane may be one scan line, which its beams' plane holds without any
error; range noise widens a short one to this much."""

WIDER = 1.3
"""Width over length of all points in that of such a line from which they show another plane."""

LINE_NOISES = 3.0
"""Noise of the plane of all points over the width of such a line at the most; outliers make it larger."""

LEAST_NOISE_SHARE = 0.02
"""Least width over length of a line that is compared with the noise, for range noise that leaves it in its plane."""

CONNECTED_SHARE = 0.98
"""Share of the points that the outline has to hold together; the rest counts as stray."""

RADIUS_FACTOR = 1.5
"""Radius of the alpha shape over the gap that has to be bridged: half of it would just touch."""


ROUNDING = 64.0
"""Rounding errors of a coordinate that a distance from a plane may hold."""

REGION_THICKNESS = 0.02
"""Distance from the plane, over the extent of the points, up to which points belong to the region: frames and mouldings
of a face stand out from it, and the image shows them as part of it."""

LEAST_APPROACH = 0.1
"""Sine of the least angle between beam and plane at which samples move along the beam: a flatter one takes them far."""

INNER_SHARE = 0.2
"""Least share of the points that lies inside the outline for them to be samples of its area, not the outline itself."""

MITRE_LIMIT = 2.0
"""Longest mitre of a grown corner over the growth: a right angle stays one, a spike is cut off."""

MOST_GROWTH = 2.0
"""Bound of the growth in spacings; half a spacing is expected."""


GROWTH_PRECISION = 1e-6
"""Precision of the growth in spacings; the spacing itself is known far less well."""

LONG_EDGE = 4.0
"""Triangulation edges longer than this many medians cross bays and holes, not the space between neighbours."""


LINE_SAMPLES = 5
"""Samples below which a parabola through them tells nothing."""

LINE_STEPS = 0.25
"""Root mean square distance from a parabola, in steps along it, below which samples are one scan line: two lines with a
tenth of the samples on one of them, two steps apart, are 0.6."""

RADIUS_MARGIN = 1e-6
"""Share by which a radius exceeds the circumradius of a triangle that it has to keep: far above rounding."""

MOST_SAMPLES = 50_000
"""Samples from which an outline is taken: 200 or more across the patch tell its area to a ten-thousandth."""

SPARSE_AREA = 0.05
"""Standard deviation of the area, as a share, above which too few scan lines cross a patch to tell its outline."""

LOST_SHARE = 0.05
"""Share of the samples beyond the outline above which parts of the patch are missing: limbs narrower than two gaps
between scan lines fall apart."""


class SparseSamplingWarning(UserWarning):
    """An outline of samples too sparse to show the patch."""


class Outline(NamedTuple):
    """A plane `origin + u axes[0] + v axes[1]`, axes (2, 3), and rings (n, 2) in its coordinates."""

    origin: Array
    axes: Array
    rings: list[Array]


class PlaneSamples(NamedTuple):
    """A plane and the samples of a region on it.

    `origin` (3,), `axes` (3, 3): rows u, v, normal. `thickness`: distance from the plane, metres, up to which points of
    the region belong to it; `noise`, up to which noise puts points of the plane. `flat`: the samples (n, 2) in its
    coordinates, moved onto it along the normal or their beams.
    """

    origin: Array
    axes: Array
    thickness: float
    noise: float
    flat: Array


def outline_of_points(
    points: ArrayLike,
    *,
    radius: float | None = None,
    correct_sampling: bool = True,
    sensor_origin: ArrayLike | None = None,
) -> Outline:
    """The robust plane of points (n, 3) and the outline of the patch of it that they sample, holes kept.

    The patch ends between the last sample and the next, which missed it. `correct_sampling` puts the outline there: on
    the scan lines of a lidar half a step beyond the last return and half a gap beyond the last line (`scan_lines`), for
    other samples as far out as gives each sample the area of one (`grown_rings`). Without it the outline runs through
    the outermost samples. `radius` (metres) is that of the alpha shape, gaps that a disc of this radius passes stay
    open; without it it is chosen from the spacing. With the scanner's position `sensor_origin` (3,) the samples are
    moved onto the plane along their beams, which range noise doesn't move sideways. A SparseSamplingWarning tells that
    the samples are too sparse to show the outline. ValueError for values that are not
    finite, fewer than 3 points, points that are identical, on one line or on a single scan line, or a radius that is
    not positive.
    """
    checked = None if radius is None else checked_radius(radius)
    plane = plane_samples(points, sensor_origin)
    rings = flat_outline(plane.flat, radius=checked, correct_sampling=correct_sampling)
    return Outline(plane.origin, plane.axes[:2], rings)


def plane_samples(points: ArrayLike, sensor_origin: ArrayLike | None = None) -> PlaneSamples:
    """The robust plane of points (n, 3) and those near it moved onto it; ValueError as of `outline_of_points`."""
    given = _checked_points(points)
    origin, axes, _ = robust_plane(given[:: max(1, len(given) // PLANE_POINTS)])
    samples = _flat_samples(given, origin, axes, sensor_origin)
    _refuse_one_line(_thinned(samples.flat if sensor_origin is None else _sights(given, sensor_origin)))
    return samples


def checked_radius(radius: object) -> float:
    """`radius` as a positive number, infinite for the convex hull; ValueError that says what was found otherwise."""
    if isinstance(radius, bool) or not isinstance(radius, int | float | np.integer | np.floating):
        raise ValueError(f"radius is a {type(radius).__name__}; needed a positive number of metres")
    if not radius > 0.0:
        raise ValueError(f"radius is {radius}; needed a positive number of metres")
    return float(radius)


def flat_outline(points: Array, *, radius: float | None = None, correct_sampling: bool = True) -> list[Array]:
    """The rings (m, 2) around samples (n, 2) of a plane: the outer one first, counter-clockwise, then its holes.

    A SparseSamplingWarning tells that few scan lines cross the patch, or that the outline misses a part of it.
    """
    points = _thinned(points)
    lines = scan_lines(points, radius) if correct_sampling else None
    if lines is not None:
        rings = lines.rings()
        _warn_of_few_lines(lines)
    else:
        rings = _main_part(_core.alpha_shape(points, _automatic_radius(points) if radius is None else radius))
        rings = grown_rings(points, rings) if correct_sampling else rings
    rings = _simple_rings(rings)
    if radius is None:
        _warn_of_lost_samples(points, rings)
    return rings


def _simple_rings(rings: list[Array]) -> list[Array]:
    """The rings, or where bending them onto the plane made them cross the largest part that they bound."""
    polygon = shapely.Polygon(rings[0], rings[1:])
    if polygon.is_valid:
        return rings
    return oriented_rings(shapely.make_valid(polygon, method="structure", keep_collapsed=False))


def _thinned(points: Array) -> Array:
    """The samples (n, 2), or where they are many one a cell of a grid, which keeps them even."""
    extent = np.ptp(points, axis=0)
    size = float(np.sqrt(np.prod(np.maximum(extent, extent.max() / MOST_SAMPLES)) / MOST_SAMPLES))
    if len(points) <= MOST_SAMPLES or size == 0.0:
        return points
    cells = np.floor((points - points.min(axis=0)) / size).astype(np.int64)
    return points[np.unique(cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1], return_index=True)[1]]


def _warn_of_few_lines(lines: ScanLines) -> None:
    """The patch's two ends lie anywhere in the gap beyond its outer lines: each has a variance of gap^2 / 12."""
    count = len(lines.levels)
    deviation = 1.0 / (np.sqrt(6.0) * count)
    if deviation > SPARSE_AREA:
        warnings.warn(
            f"{count} scan lines, {lines.gap:.2g} m apart, cross the patch: its area is known to"
            f" {100.0 * deviation:.0f} %, and parts narrower than {2.0 * lines.gap:.2g} m may be missing",
            SparseSamplingWarning,
            stacklevel=2,
        )


def _warn_of_lost_samples(points: Array, rings: list[Array]) -> None:
    region = shapely.Polygon(rings[0], rings[1:])
    around = region.buffer(np.sqrt(region.area / len(points)))
    shapely.prepare(around)
    lost = 1.0 - float(shapely.intersects_xy(around, points[:, 0], points[:, 1]).mean())
    if lost > LOST_SHARE:
        warnings.warn(
            f"{100.0 * lost:.0f} % of {len(points)} points lie outside the outline: the patch falls into parts where it"
            " is narrower than two gaps between samples",
            SparseSamplingWarning,
            stacklevel=2,
        )


def grown_rings(points: Array, rings: list[Array]) -> list[Array]:
    """The rings moved outwards until they hold the area that the samples (n, 2) stand for.

    A polygon through samples of a lattice holds `inner + boundary / 2 - 1 + holes` cells (Pick 1899), the patch as many
    as samples, whatever the lattice's spacing in either direction. The growth is even where the spacing is.
    """
    polygon = shapely.Polygon(rings[0], rings[1:])
    held = int(shapely.intersects_xy(polygon.buffer(1e-9 * np.sqrt(polygon.area)), points[:, 0], points[:, 1]).sum())
    boundary = sum(map(len, rings))
    if held - boundary < INNER_SHARE * held:
        return rings
    cell = polygon.area / (held - 0.5 * boundary - 1.0 + len(rings) - 1)
    squared = _spacing_squared(points)
    even = shapely.Polygon(rings[0] @ squared, [ring @ squared for ring in rings[1:]])
    spacing = np.sqrt(cell)

    def grown(distance: float) -> BaseGeometry:
        return even.buffer(distance, join_style="mitre", mitre_limit=MITRE_LIMIT)

    # The area that is missing at the largest growth would be that of a polygon thinner than a sample.
    if grown(MOST_GROWTH * spacing).area <= held * cell:
        return rings
    distance = brentq(
        lambda d: grown(d).area - held * cell, 0.0, MOST_GROWTH * spacing, xtol=GROWTH_PRECISION * spacing
    )
    return [ring @ np.linalg.inv(squared) for ring in oriented_rings(grown(distance))]


def oriented_rings(region: BaseGeometry) -> list[Array]:
    """The largest polygon's rings (n, 2): the outer one counter-clockwise, then its holes the other way."""
    largest = max(shapely.get_parts(region), key=lambda part: part.area)
    turned = shapely.geometry.polygon.orient(largest)
    return [np.array(ring.coords)[:-1] for ring in (turned.exterior, *turned.interiors)]


def _spacing_squared(points: Array) -> Array:
    """A symmetric matrix (2, 2) of determinant 1 after which samples are equally far apart in all directions, on
    average.
    """
    edges = _delaunay_edges(points)
    steps = points[edges[:, 0]] - points[edges[:, 1]]
    lengths = np.linalg.norm(steps, axis=1)
    # Along the hull edges are longer than any spacing.
    steps = steps[lengths <= LONG_EDGE * np.median(lengths)]
    spread, directions = np.linalg.eigh(steps.T @ steps / len(steps))
    if spread[0] <= 0.0:
        return np.eye(2)
    stretch = (spread[0] * spread[1]) ** 0.25 / np.sqrt(spread)
    matrix: Array = (directions * stretch) @ directions.T
    return matrix


def _flat_samples(points: Array, origin: Array, axes: Array, sensor_origin: ArrayLike | None) -> PlaneSamples:
    """The samples of the region near the plane, moved onto it along the normal or the beams."""
    heights = (points - origin) @ axes[2]
    sigma = MAD_TO_SIGMA * np.median(np.abs(heights))
    extent = float(np.ptp(points, axis=0).max())
    rounding = ROUNDING * float(np.finfo(float).eps * np.abs(points).max())
    noise = max(INLIER_SIGMAS * float(sigma), rounding)
    thickness = max(noise, REGION_THICKNESS * extent)
    near = np.abs(heights) <= thickness
    moved = points[near] - origin
    if sensor_origin is not None:
        sensor = np.asarray(sensor_origin, dtype=np.float64)
        if sensor.shape != (3,) or not np.isfinite(sensor).all():
            raise ValueError(f"sensor_origin is {np.asarray(sensor_origin).tolist()}; needed 3 finite coordinates")
        beams = points[near] - sensor
        beams /= np.maximum(np.linalg.norm(beams, axis=1, keepdims=True), np.finfo(float).tiny)
        approach = beams @ axes[2]
        steep = np.abs(approach) >= LEAST_APPROACH
        moved -= np.where(steep, heights[near] / np.where(steep, approach, 1.0), 0.0)[:, None] * beams
    return PlaneSamples(origin, axes, thickness, noise, moved @ axes[:2].T)


def _sights(points: Array, sensor_origin: ArrayLike) -> Array:
    """Where the beams of points (n, 3) pass a plane before the sensor, (n, 2): range noise leaves them in place."""
    beams = points - np.asarray(sensor_origin, dtype=np.float64)
    beams = beams[np.linalg.norm(beams, axis=1) > 0.0]
    ahead = np.sum(beams / np.linalg.norm(beams, axis=1, keepdims=True), axis=0)
    axes = _axes_of(ahead / np.linalg.norm(ahead))
    depth = np.maximum(beams @ axes[2], LEAST_APPROACH * np.linalg.norm(beams, axis=1))
    sights: Array = beams @ axes[:2].T / depth[:, None]
    return sights


def _refuse_one_line(points: Array) -> None:
    """Refuse points (n, 2) on one scan line, which is a conic in the plane and over a patch a parabola, or less."""
    if len(points) < LINE_SAMPLES:
        return
    centred = points - points.mean(axis=0)
    along, across = (centred @ np.linalg.svd(centred, full_matrices=False)[2].T).T
    parabola = np.vander(along / np.abs(along).max(), 3)
    off = across - parabola @ np.linalg.lstsq(parabola, across, rcond=None)[0]
    step = float(np.median(np.asarray(cKDTree(points).query(points, 2)[0])[:, 1]))
    if np.sqrt(np.mean(off**2)) < LINE_STEPS * step:
        raise ValueError(f"{len(points)} points lie on one scan line; needed points on lines across the patch")


def robust_plane(points: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """A plane through most of the points (n, 3): its origin (3,), axes u, v, normal as rows (3, 3), inliers' indices.

    Least squares over the points within three standard deviations until they stay the same, from two starts: all
    points, and the plane through three of them with the least median distance (Rousseeuw 1984). That one is right with
    outliers, but may lie askew along a single scan line; the better fit is the one under which the points are likelier,
    outliers being anywhere.
    """
    everything = _refitted(points, *_least_squares_plane(points))
    majority = _refitted(points, *_least_median_plane(points))
    if _is_line_of(points[majority[2]], points[everything[2]], everything):
        return everything
    return min(everything, majority, key=lambda fit: _code_length(points, *fit))


def _is_line_of(line: Array, points: Array, plane: tuple[Array, Array, NDArray[np.intp]]) -> bool:
    """Whether some points are a scan line of a plane that more show: narrow, no wider than its noise makes them."""
    (length, width), (whole_length, whole_width) = _extents(line), _extents(points)
    noise = float(np.std((points - plane[0]) @ plane[1][2]))
    narrow = width < LINE_WIDTH_SHARE * length and noise < LINE_NOISES * max(width, LEAST_NOISE_SHARE * length)
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


def _code_length(points: Array, origin: Array, axes: Array, inliers: NDArray[np.intp]) -> float:
    """Negative log likelihood per extent: inliers normal about the plane, outliers even over the extent (no cost)."""
    extent = float(np.ptp(points, axis=0).max())
    sigma = float(np.std((points[inliers] - origin) @ axes[2])) / extent
    return len(inliers) * (0.5 + float(np.log(max(sigma, np.finfo(float).eps) * np.sqrt(2.0 * np.pi))))


def bridging_radius(points: Array) -> float:
    """Radius of an alpha shape that holds 98 % of the points (n, 2) together, from the gaps of their spanning tree.

    Scan lines far apart count as much as the spacing within a line: the tree has to cross from each to the next.
    """
    try:
        edges = _delaunay_edges(points)
    except QhullError as error:
        raise ValueError(
            f"{len(points)} points are identical or on one line; needed points that span a plane"
        ) from error
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    graph = csr_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(points), len(points)))
    tree = minimum_spanning_tree(graph).tocoo()
    return RADIUS_FACTOR * _bridging_gap(len(points), tree.row, tree.col, tree.data)


def _automatic_radius(points: Array) -> float:
    """The bridging radius; where no triangle of the points (n, 2) is that small, the one that holds 98 % of them.

    A SparseSamplingWarning says so: such triangles are flat, as the samples are sparse in one direction.
    """
    radius = bridging_radius(points)
    triangles = Delaunay(points - points.mean(axis=0)).simplices
    circumradii = _circumradii(points[triangles])
    if circumradii.min() <= radius:
        return radius
    least = np.full(len(points), np.inf)
    np.minimum.at(least, triangles.ravel(), np.repeat(circumradii, 3))
    wider = (1.0 + RADIUS_MARGIN) * float(np.quantile(least, CONNECTED_SHARE, method="higher"))
    warnings.warn(
        f"{len(points)} points, most of them within {radius / RADIUS_FACTOR:.2g} m of the next, span flat triangles"
        f" alone: the outline joins points up to {2.0 * wider:.2g} m apart",
        SparseSamplingWarning,
        stacklevel=2,
    )
    return wider


def _circumradii(triangles: Array) -> Array:
    """Circumradii (k,) of triangles (k, 3, 2): the product of the sides over four times the area."""
    sides = np.roll(triangles, -1, axis=1) - triangles
    doubled = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    radii: Array = np.linalg.norm(sides, axis=2).prod(axis=1) / (2.0 * np.maximum(doubled, np.finfo(float).tiny))
    return radii


def _bridging_gap(count: int, first: NDArray[np.int32], second: NDArray[np.int32], lengths: Array) -> float:
    """The shortest edge of a spanning tree up to which one part holds the connected share of the points."""
    parent, size = np.arange(count), np.ones(count, dtype=np.int64)

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = int(parent[node])
        return node

    for edge in np.argsort(lengths, kind="stable"):
        a, b = root(int(first[edge])), root(int(second[edge]))
        parent[a] = b
        size[b] += size[a]
        if size[b] >= CONNECTED_SHARE * count:
            return float(lengths[edge])
    return float(lengths.max())


def _delaunay_edges(points: Array) -> NDArray[np.int32]:
    triangles = Delaunay(points - points.mean(axis=0)).simplices
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0)


def _main_part(rings: list[Array]) -> list[Array]:
    """The largest outer ring and the holes inside it; strays that the radius does not reach are left out."""
    areas = [
        0.5 * float(np.sum(ring[:, 0] * np.roll(ring[:, 1], -1) - ring[:, 1] * np.roll(ring[:, 0], -1)))
        for ring in rings
    ]
    outer = int(np.argmax(areas))
    low, high = rings[outer].min(axis=0), rings[outer].max(axis=0)
    holes = [ring for ring, area in zip(rings, areas, strict=True) if area < 0 and _within(ring, low, high)]
    return [rings[outer], *holes]


def _within(ring: Array, low: Array, high: Array) -> bool:
    return bool((ring >= low).all() and (ring <= high).all())


def _checked_points(points: ArrayLike) -> Array:
    given = np.asarray(points)
    if given.ndim != 2 or given.shape[1] != 3 or given.dtype.kind not in "iuf":
        raise ValueError(
            f"points have shape {given.shape} and type {given.dtype}; needed an (n, 3) array of real numbers"
        )
    given = given.astype(np.float64)
    wrong = np.flatnonzero(~np.isfinite(given).all(axis=1))
    if len(wrong):
        raise ValueError(f"point {wrong[0]} is {given[wrong[0]].tolist()}; needed finite coordinates")
    others = given[(given != given[0]).any(axis=1)] if len(given) else given
    if len(others) < 2 or (others == others[0]).all():
        raise ValueError(f"{len(given)} points are given, of which fewer than 3 differ; needed at least 3")
    return given


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
        return anchors[chosen], _axes_of(normals[chosen])
    return best


def _least_squares_plane(points: Array) -> tuple[Array, Array]:
    origin = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(points - origin, full_matrices=False)
    if spread[1] <= 1e-9 * spread[0]:
        raise ValueError(f"{len(points)} points are identical or on one line; needed points that span a plane")
    return origin, np.array([axes[0], axes[1], np.cross(axes[0], axes[1])])


def _axes_of(normal: Array) -> Array:
    """Right-handed axes u, v, normal as rows."""
    u = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    u /= np.linalg.norm(u)
    return np.array([u, np.cross(normal, u), normal])
