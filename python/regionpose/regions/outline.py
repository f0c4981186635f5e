"""From points on a plane to the plane and the outline."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike

from regionpose import _core
from regionpose.regions.plane_samples import plane_samples, thinned
from regionpose.validation.arrays import Array, signed_area

RADIUS_FACTOR = 1.5
"""Radius of the alpha shape over the gap that has to be bridged: half of it would just touch; at 1.2 a third of lost
returns leaves holes."""

INNER_FRACTION = 0.2
"""Least fraction of the points that lies inside the outline for them to be samples of its area, not the outline
itself."""

MITRE_LIMIT = 2.0
"""Longest mitre of a grown corner over the growth: a right angle stays one, a spike is cut off."""

GROWTH_STEPS = 4
"""Steps of Newton's method in which an outline grows; its area is all but quadratic, so that three suffice."""

SPARSE_FRACTION = 0.05
"""Fraction of the patch that samples may miss, or by which its area is uncertain, before a warning. A convention."""


PACKAGE = __name__.partition(".")[0]


class SparseSamplingWarning(UserWarning):
    """An outline of samples too sparse to show the patch."""


_handler: ContextVar[Callable[[str], object] | None] = ContextVar("_handler", default=None)


@contextmanager
def sparse_sampling_handler(handle: Callable[[str], object]) -> Iterator[None]:
    """In the block, in this thread, `handle` gets the messages that would otherwise be a SparseSamplingWarning.

    Filters of warnings are the whole process's: threads that change and restore them leave them changed.
    """
    token = _handler.set(handle)
    try:
        yield
    finally:
        _handler.reset(token)


def warn_of_sampling(message: str) -> None:
    """Pass a message on sparse samples to the handler, else warn at the calling line outside of the package."""
    handle = _handler.get()
    if handle is not None:
        handle(message)
        return
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == PACKAGE:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, SparseSamplingWarning, stacklevel=level)


class Outline(NamedTuple):
    """A plane `origin + u axes[0] + v axes[1]`, axes (2, 3), and rings (n, 2) in its coordinates."""

    origin: Array
    axes: Array
    rings: list[Array]


def outline_of_points(
    points: ArrayLike,
    *,
    radius_m: float | None = None,
    correct_sampling: bool = True,
    sensor_origin: ArrayLike | None = None,
) -> Outline:
    """The robust plane of points (n, 3) and the outline of the patch of it that they sample, holes kept.

    The patch ends between the last sample and the next, which missed it. `correct_sampling` puts the outline halfway:
    half a step beyond the last return of a lidar's line and half a gap beyond its last line. Without it the outline
    runs through the outermost samples. `radius_m` is that of the alpha shape: gaps that a disc of this radius
    passes stay open; without it it is chosen from the spacing. With the scanner's position `sensor_origin` (3,) the
    samples are moved onto the plane along their beams, which range noise doesn't move sideways. A SparseSamplingWarning
    reports samples too sparse to show the outline. ValueError for values that are not finite, fewer than 3
    points, points that are identical, on one line or on a single scan line, or a radius that is not positive.
    """
    checked = None if radius_m is None else checked_radius(radius_m)
    plane = plane_samples(points, sensor_origin)
    rings = flat_outline(plane.flat, radius=checked, correct_sampling=correct_sampling)
    return Outline(plane.origin, plane.axes[:2], rings)


def checked_radius(radius: object) -> float:
    """`radius` as a positive number, infinite for the convex hull; ValueError otherwise."""
    if isinstance(radius, bool) or not isinstance(radius, int | float | np.integer | np.floating):
        raise ValueError(f"radius_m is a {type(radius).__name__}; needed a positive number of meters")
    if not radius > 0.0:
        raise ValueError(f"radius_m is {radius}; needed a positive number of meters")
    return float(radius)


def flat_outline(points: Array, *, radius: float | None = None, correct_sampling: bool = True) -> list[Array]:
    """The rings (m, 2) around samples (n, 2) of a plane: the outer one first, counter-clockwise, then its holes.

    They are taken where the samples are equally far apart in all directions: along the lines of a scan and across them.
    A SparseSamplingWarning reports few rows of samples across the patch, or an outline that misses a part of it.
    """
    points = thinned(points)
    squared = _core.even_spacing(points)
    even = points @ squared
    if radius is None:
        rings = _main_part(_joined(even))
    else:
        rings = [ring @ squared for ring in _main_part(_core.alpha_shape(points, radius))]
    area = _area(even, rings)
    if correct_sampling and area is not None:
        _warn_of_few_rows(even, np.sqrt(area / len(even)), float(np.linalg.norm(squared, -2)))
        rings = _grown(rings, area)
    if radius is None:
        _warn_of_lost_samples(even, rings)
    return [ring @ np.linalg.inv(squared) for ring in rings]


def _joined(even: Array) -> list[Array]:
    """Rings of the alpha shape that holds evenly spaced samples (n, 2) together."""
    try:
        return _core.alpha_shape(even, bridging_radius(even))
    except ValueError:
        # They span flat triangles alone, of which none is that small: their hull.
        return _core.alpha_shape(even, np.inf)


def _area(even: Array, rings: list[Array]) -> float | None:
    """The area that evenly spaced samples (n, 2) stand for, one cell each.

    A polygon through samples of a lattice holds `inner + boundary / 2 - 1 + holes` cells (Pick 1899), the patch as many
    as samples. None where the samples are the outline itself rather than in it.
    """
    polygon = shapely.Polygon(rings[0], rings[1:])
    rounded = polygon.buffer(np.sqrt(np.finfo(float).eps * polygon.area))
    sample_count = int(shapely.intersects_xy(rounded, even[:, 0], even[:, 1]).sum())
    boundary = sum(map(len, rings))
    if sample_count - boundary < INNER_FRACTION * sample_count:
        return None
    return sample_count * float(polygon.area) / (sample_count - 0.5 * boundary - 1.0 + len(rings) - 1)


def _grown(rings: list[Array], area: float) -> list[Array]:
    """The rings (m, 2) moved outwards to hold an area (Newton's method); of what falls apart the largest part."""
    polygon, distance = shapely.Polygon(rings[0], rings[1:]), 0.0
    grown = polygon
    for _ in range(GROWTH_STEPS):
        distance += (area - grown.area) / grown.length
        grown = polygon.buffer(distance, join_style="mitre", mitre_limit=MITRE_LIMIT)
    largest = max(shapely.get_parts(grown), key=lambda part: part.area)
    turned = shapely.geometry.polygon.orient(largest)
    return [np.array(ring.coords)[:-1] for ring in (turned.exterior, *turned.interiors)]


def _warn_of_few_rows(even: Array, spacing: float, shrunk: float) -> None:
    """The patch's two ends lie anywhere in the gap beyond its outer rows: each has a variance of gap^2 / 12."""
    width = np.linalg.svd(even - even.mean(axis=0), full_matrices=False)[2]
    rows = round(float(np.ptp((even - even.mean(axis=0)) @ width.T, axis=0).min()) / spacing) + 1
    deviation = 1.0 / (np.sqrt(6.0) * rows)
    if deviation > SPARSE_FRACTION:
        warn_of_sampling(
            f"about {rows} rows of samples, {spacing / shrunk:.2g} m apart, cross the patch: its area is known to"
            f" {100.0 * deviation:.0f} %, and parts narrower than {2.0 * spacing / shrunk:.2g} m may be missing"
        )


def _warn_of_lost_samples(even: Array, rings: list[Array]) -> None:
    region = shapely.Polygon(rings[0], rings[1:])
    around = region.buffer(np.sqrt(region.area / len(even)))
    shapely.prepare(around)
    lost = 1.0 - float(shapely.intersects_xy(around, even[:, 0], even[:, 1]).mean())
    if lost > SPARSE_FRACTION:
        warn_of_sampling(
            f"{100.0 * lost:.0f} % of {len(even)} points lie outside the outline: the patch falls into parts where it"
            " is narrower than two gaps between samples"
        )


def _main_part(rings: list[Array]) -> list[Array]:
    """The largest outer ring and the holes inside it; strays that the radius does not reach are left out."""
    outer = max(rings, key=signed_area)
    low, high = outer.min(axis=0), outer.max(axis=0)
    inside = [ring for ring in rings if signed_area(ring) < 0.0 and (ring >= low).all() and (ring <= high).all()]
    return [outer, *inside]


def bridging_radius(points: Array) -> float:
    """Radius of an alpha shape that connects 98 % of the points (n, 2), also across the gaps between scan lines.

    Of points on a line, (n, 1), it is the way from one to the next.
    """
    flat = points if points.shape[1] > 1 else np.column_stack([points, np.zeros(len(points))])
    return RADIUS_FACTOR * _core.bridging_gap(flat)
