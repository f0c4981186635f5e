"""Pixel edges as bearings, split where the camera bends them, and the border of the image beside a region."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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

MOST_VERTICES = 1 << 16
"""Vertices of rings that are mapped at once, at the most; a convention. Their places and bearings, and those of three
probes each, take 10 MB."""

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
    return _split_edges(camera, line, np.arange(1, len(line)), item, BORDER_BEND_TOLERANCE_PX)[0]


def ring_bearings(camera: Camera, ring: Array, index: int) -> Array:
    """Bearings (k, 3) along a ring of pixels (n, 2); ValueError, with its index, where the camera sees no ray."""
    return _split_edges(camera, ring, _following(len(ring)), f"ring {index}", BEND_TOLERANCE_PX)[0]


def bearings_of_rings(camera: Camera, rings: Sequence[Array]) -> list[Array] | None:
    """Those of many rings, mapped at once: a call for each takes longer than the mapping. None for no ring, and where
    the camera sees no ray.
    """
    mapped: list[Array] = []
    for block in _blocks(rings):
        first = [0, *accumulate(map(len, block[:-1]))]
        following = np.concatenate([start + _following(len(ring)) for start, ring in zip(first, block, strict=True)])
        try:
            bearings, parts = _split_edges(camera, np.concatenate(block), following, "a ring", BEND_TOLERANCE_PX)
        except ValueError:
            return None
        counts = np.add.reduceat(parts, first)
        mapped += [bearings[end - count : end] for count, end in zip(counts, np.cumsum(counts), strict=True)]
    return mapped or None


def _blocks(rings: Sequence[Array]) -> Iterator[list[Array]]:
    """The rings in blocks of `MOST_VERTICES`, or of one ring that has more."""
    block: list[Array] = []
    count = 0
    for ring in rings:
        if block and count + len(ring) > MOST_VERTICES:
            yield block
            block, count = [], 0
        block.append(ring)
        count += len(ring)
    if block:
        yield block


def _following(count: int) -> NDArray[np.intp]:
    """The index of the next vertex of each of a ring."""
    return np.roll(np.arange(count), -1)


def _split_edges(
    camera: Camera, pixels: Array, following: NDArray[np.intp], item: str, tolerance: float
) -> tuple[Array, NDArray[np.int64]]:
    """Bearings of pixels (n, 2), and of points between where the camera bends the edges; and in how many parts each
    edge is. Edges lead from the first ones, in their order, to those with the indices `following`.
    """
    edge_count = len(following)
    if camera.straight_lines:
        return _visible(camera, pixels, item), np.ones(edge_count, dtype=np.int64)
    starts, ends = pixels[:edge_count], pixels[following]
    # At once: a call for each takes longer than the mapping of a polygon.
    probes = [starts + fraction * (ends - starts) for fraction in PROBES]
    mapped = _visible(camera, np.concatenate([pixels, *probes]), item)
    bearings, between = mapped[: len(pixels)], mapped[len(pixels) :].reshape(len(PROBES), edge_count, 3)
    length = np.linalg.norm(ends - starts, axis=1)
    parts = _parts_of_edges(length, bearings[:edge_count], bearings[following], between, tolerance)
    first = np.repeat(np.arange(edge_count), parts)
    within = np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)
    is_new = within > 0
    split = bearings[first]
    if is_new.any():
        edge, fraction = first[is_new], (within / parts[first])[is_new, None]
        split[is_new] = _visible(camera, starts[edge] * (1.0 - fraction) + ends[edge] * fraction, item)
    return np.concatenate([split, bearings[edge_count:]]), parts


def _visible(camera: Camera, pixels: Array, item: str) -> Array:
    bearings = camera.bearings(pixels)
    if not np.isfinite(bearings).all():
        x, y = pixels[~np.isfinite(bearings).all(axis=1)][0]
        raise ValueError(f"{item} passes pixel ({x:.2f}, {y:.2f}), where the camera's model sees no ray")
    return bearings


def _parts_of_edges(length: Array, starts: Array, ends: Array, between: Array, tolerance: float) -> NDArray[np.int64]:
    """Number of parts of each pixel edge: their sagitta falls with its square (docs/math.md, eq. 9.11).

    `length` (n,): in pixels. Bearings: of both ends, (n, 3), and at each of the probes, (k, n, 3).
    """
    normal = np.cross(starts, ends)
    sine = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)
    sagitta = np.zeros(len(length))
    for fraction, probe in zip(PROBES, between, strict=True):
        off_arc = np.abs(np.sum(probe * normal, axis=1)) / sine
        sagitta = np.maximum(sagitta, off_arc * length / sine / (4.0 * fraction * (1.0 - fraction)))
    parts: Array = np.clip(np.ceil(np.sqrt(BEND_MARGIN * sagitta / tolerance)), 1, MOST_PARTS)
    return parts.astype(np.int64)
