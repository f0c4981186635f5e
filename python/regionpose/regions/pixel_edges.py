"""Pixel edges as bearings, split where the camera bends them, and the border of the image beside a region."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.validation.arrays import Array

Border = tuple[float, float, float, float]

BEND_TOLERANCE_PX = 0.01
"""A straight pixel edge is split until the great-circle arcs between its parts are within this distance (pixels)."""

BEND_MARGIN = 1.5
"""Bends counted for each one that is seen at the probes: the edge may bend more between them."""

PROBES = (0.25, 0.5, 0.75)
"""Fractions of an edge at which its bend is looked at; the middle alone would miss one that changes sides."""

MOST_PARTS = 1000
"""Parts of one edge at the most; an edge that bends more lies where the camera's model ends."""

BORDER_BEND_TOLERANCE_PX = 0.02
"""As `BEND_TOLERANCE_PX`, for the image's border beside a region: predictions are clipped there for each pose."""

BORDER_SAMPLES = 128
"""Places of each side of the border at which a camera's rays are computed: a fisheye has none in the corners."""


def sides_of(border: Border) -> list[tuple[int, float, float]]:
    """Axis, place and outward sign of the top, right, bottom and left, as a counter-clockwise ring in (x, y)."""
    left, top, right, bottom = border
    return [(1, top, -1.0), (0, right, 1.0), (1, bottom, 1.0), (0, left, -1.0)]


def border_lines(border: Border, vertices: Array, sides: list[bool]) -> list[Array]:
    """Pixels (m, 2) of lines along the marked sides, longer at either end than vertices (n, 2) by their extent."""
    left, top, right, bottom = border
    corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    if all(sides):
        return [np.vstack([corners, corners[:1]])]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    reach = float((high - low).max())
    lines = []
    for first in range(4):
        if not sides[first] or sides[first - 1]:
            continue
        count = next(k for k in range(1, 4) if not sides[(first + k) % 4])
        line = [corners[(first + k) % 4].copy() for k in range(count + 1)]
        # Along the top x grows, along the right y, and back along the others.
        for end, side, before in ((line[0], first, True), (line[-1], (first + count - 1) % 4, False)):
            axis, grows = side % 2, side < 2
            end[axis] = low[axis] - reach if grows == before else high[axis] + reach
        lines.append(np.array(line))
    return lines


def visible_part(camera: Camera, line: Array) -> list[Array]:
    """The longest part of a line of pixels (m, 2) along which the camera sees rays; none where it is a point."""
    fractions = np.linspace(0.0, 1.0, BORDER_SAMPLES + 1)[:-1, None]
    samples = np.concatenate([*(a + fractions * (b - a) for a, b in pairwise(line)), line[-1:]])
    is_visible = np.isfinite(camera.bearings(samples)).all(axis=1)
    if is_visible.all():
        return [line]
    bounds = np.flatnonzero(np.diff(np.concatenate([[0], is_visible.astype(np.int8), [0]])))
    start, stop = max(zip(bounds[::2], bounds[1::2], strict=True), key=lambda run: run[1] - run[0], default=(0, 0))
    if stop - start < 2:
        return []
    corners = [k for k in range(start + 1, stop - 1) if k % BORDER_SAMPLES == 0]
    return [samples[[start, *corners, stop - 1]]]


def line_bearings(camera: Camera, line: Array, item: str) -> Array:
    """Bearings (k, 3) along a line of pixels (m, 2); ValueError, with its name, where the camera sees no ray."""
    split, _ = _split_edges(camera, line[:-1], line[1:], item, BORDER_BEND_TOLERANCE_PX)
    return np.vstack([split, _visible(camera, line[-1:], item)])


def ring_bearings(camera: Camera, ring: Array, index: int) -> Array:
    """Bearings (k, 3) along a ring of pixels (n, 2); ValueError, with its index, where the camera sees no ray."""
    return _split_edges(camera, ring, _following(ring), f"ring {index}", BEND_TOLERANCE_PX)[0]


def bearings_of_rings(camera: Camera, rings: Sequence[Array]) -> list[Array] | None:
    """Those of many rings, mapped at once: a call for each takes longer than the mapping. None for no ring, and where
    the camera sees no ray.
    """
    if not rings:
        return None
    starts, ends = np.concatenate(rings), np.concatenate([_following(ring) for ring in rings])
    try:
        bearings, parts = _split_edges(camera, starts, ends, "a ring", BEND_TOLERANCE_PX)
    except ValueError:
        return None
    counts = np.add.reduceat(parts, [0, *accumulate(map(len, rings[:-1]))])
    return [bearings[end - count : end] for count, end in zip(counts, np.cumsum(counts), strict=True)]


def _following(ring: Array) -> Array:
    """The next vertex of each of a ring."""
    return np.concatenate([ring[1:], ring[:1]])


def _split_edges(
    camera: Camera, starts: Array, ends: Array, item: str, tolerance: float
) -> tuple[Array, NDArray[np.int64]]:
    """Bearings of the starts (n, 2) of pixel edges, and of points between where the camera bends the edges; and in how
    many parts each edge is.
    """
    if camera.straight_lines:
        return _visible(camera, starts, item), np.ones(len(starts), dtype=np.int64)
    places = [starts, ends, *(starts + fraction * (ends - starts) for fraction in PROBES)]
    # At once: a call for each takes longer than the mapping of a polygon.
    bearings, *others = np.split(_visible(camera, np.concatenate(places), item), len(places))
    parts = _parts_of_edges(np.linalg.norm(ends - starts, axis=1), bearings, others, tolerance)
    if parts.max() == 1:
        return bearings, parts
    first = np.repeat(np.arange(len(starts)), parts)
    within = np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)
    fraction = (within / parts[first])[:, None]
    return _visible(camera, starts[first] * (1.0 - fraction) + ends[first] * fraction, item), parts


def _visible(camera: Camera, pixels: Array, item: str) -> Array:
    bearings = camera.bearings(pixels)
    if not np.isfinite(bearings).all():
        x, y = pixels[~np.isfinite(bearings).all(axis=1)][0]
        raise ValueError(f"{item} passes pixel ({x:.2f}, {y:.2f}), where the camera's model sees no ray")
    return bearings


def _parts_of_edges(length: Array, starts: Array, others: Sequence[Array], tolerance: float) -> NDArray[np.int64]:
    """Number of parts of each pixel edge: their sagitta falls with its square (docs/math.md, eq. 9.11).

    `length` (n,): in pixels. Bearings (n, 3): of the `starts`, and of `others`, the ends and each of the probes.
    """
    ends, *probes = others
    normal = np.cross(starts, ends)
    sine = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    sagitta = np.zeros(len(length))
    for fraction, between in zip(PROBES, probes, strict=True):
        off_arc = np.abs(np.sum(between * normal, axis=1)) / sine
        sagitta = np.maximum(sagitta, off_arc * length / sine / (4.0 * fraction * (1.0 - fraction)))
    parts: Array = np.clip(np.ceil(np.sqrt(BEND_MARGIN * sagitta / tolerance)), 1, MOST_PARTS)
    return parts.astype(np.int64)
