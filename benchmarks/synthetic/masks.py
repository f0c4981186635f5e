"""Exact images of projected regions: boundary rings in pixels, binary masks, and area coverage.

Pixel coordinates are OpenCV's: an integer is the center of a pixel, so pixel (column i, row j) covers
[i - 1/2, i + 1/2] x [j - 1/2, j + 1/2]. Images are indexed [row, column].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from regionpose.cameras import Camera

Array = NDArray[np.float64]
Rings = Sequence[NDArray[np.float64]]

# px; the largest distance of a drawn edge from the true, curved boundary. Far below what a pixel mask can resolve.
BOUNDARY_TOLERANCE_PX = 1e-3
# Rounds of splitting: the first counts the parts of an edge from its bend, the second catches what that fell short of.
MAX_SPLITS = 4
# Parts of an edge in one round, at most; a smooth camera needs about 250 for an edge across the image.
MAX_PARTS = 1000
# Bends counted for each one that is seen at the probes: the edge may bend more between them.
BEND_MARGIN = 1.5
# Parameters at which an edge's image is compared with its chord; three of them also catch a curve with an inflection.
PROBES = (0.25, 0.5, 0.75)


class ProjectionError(ValueError):
    """A boundary point of a region has no image in the camera."""


class Window(NamedTuple):
    """A rectangle of whole pixels: columns left..right and rows top..bottom, the last of each excluded."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns), 0 where the window is empty."""
        return max(self.bottom - self.top, 0), max(self.right - self.left, 0)

    @property
    def block(self) -> tuple[slice, slice]:
        """The window's pixels in an image indexed [row, column]."""
        return slice(self.top, self.top + self.shape[0]), slice(self.left, self.left + self.shape[1])

    def seen_from(self, left: int, top: int) -> Window:
        """The window in an image whose first pixel is (left, top) of this one."""
        return Window(self.left - left, self.top - top, self.right - left, self.bottom - top)

    def grown(self, margin: int, width: int, height: int) -> Window:
        """The window and `margin` px around it, within an image."""
        left, top = max(self.left - margin, 0), max(self.top - margin, 0)
        return Window(left, top, min(self.right + margin, width), min(self.bottom + margin, height))


@dataclass(frozen=True, eq=False)
class MaskPatch:
    """The part of a mask that holds its region: `values` (rows, columns) of the pixels in `window`; others are empty.

    A whole mask of the benchmark's camera is 3.8 million pixels, of which a region covers a few per cent.
    """

    values: NDArray[Any]
    window: Window

    def whole(self, width: int, height: int) -> NDArray[Any]:
        """The (height, width) mask."""
        mask = np.zeros((height, width), dtype=self.values.dtype)
        mask[self.window.block] = self.values
        return mask


def to_camera(points: ArrayLike, rotation: ArrayLike, translation: ArrayLike) -> Array:
    """(n, 3) camera-frame points `R X + t` of (n, 3) world points."""
    world, turn, shift = (np.asarray(values, dtype=np.float64) for values in (points, rotation, translation))
    camera: Array = world @ turn.T + shift
    return camera


def image_size(camera: Camera) -> tuple[int, int]:
    """(width, height) of the camera's image in px; ValueError when the camera holds none."""
    if camera.width is None or camera.height is None:
        raise ValueError(f"camera has width {camera.width} and height {camera.height}; rendering needs both in pixels")
    return int(camera.width), int(camera.height)


def project_ring(camera: Camera, ring: ArrayLike, tolerance: float = BOUNDARY_TOLERANCE_PX) -> Array:
    """(m, 2) pixel ring of an (n, 3) camera-frame ring, with edges split until no chord is off by `tolerance` px.

    Every vertex is the exact image of a point of the 3D boundary, and the original vertices stay.
    ProjectionError when a point of the boundary isn't visible.
    """
    start = np.asarray(ring, dtype=np.float64)
    if start.ndim != 2 or start.shape[1] != 3 or len(start) < 3:
        raise ValueError(f"ring has shape {start.shape}; needed is (n, 3) with n >= 3")
    end = np.roll(start, -1, axis=0)
    parts = np.ones(len(start), dtype=np.int64)
    curved = np.ones(len(start), dtype=np.bool_)
    for _ in range(MAX_SPLITS):
        deviation = chord_deviation(camera, start[curved], end[curved])
        # A chord's distance from its arc falls with the square of its length.
        needed = np.where(deviation > tolerance, np.ceil(np.sqrt(BEND_MARGIN * deviation / tolerance)), 1.0)
        parts[curved] = np.minimum(needed, MAX_PARTS)
        if parts.max() == 1:
            break
        start, end = split_edges(start, end, parts)
        curved, parts = np.repeat(parts > 1, parts), np.ones(len(start), dtype=np.int64)
    return _visible_images(camera, start)


def chord_deviation(camera: Camera, start: Array, end: Array) -> Array:
    """(n,) largest distance in px of the image of each 3D edge from the chord between its ends, at the probes."""
    points = np.concatenate([start + s * (end - start) for s in (0.0, *PROBES, 1.0)])
    first, *probes, last = _visible_images(camera, points).reshape(-1, len(start), 2)
    chord = last - first
    length = np.maximum(np.hypot(chord[:, 0], chord[:, 1]), np.finfo(np.float64).tiny)
    offsets = np.array(probes) - first
    across: Array = np.abs(offsets[..., 0] * chord[:, 1] - offsets[..., 1] * chord[:, 0]) / length
    return np.asarray(across.max(axis=0), dtype=np.float64)


def split_edges(start: Array, end: Array, parts: NDArray[np.int64]) -> tuple[Array, Array]:
    """Start and end points, in ring order, of a ring's edges after each is split into its number of equal parts."""
    edge = np.repeat(np.arange(len(start)), parts)
    within = np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (within / parts[edge])[:, None]
    split_start: Array = start[edge] + share * (end - start)[edge]
    return split_start, np.roll(split_start, -1, axis=0)


def _visible_images(camera: Camera, points: Array) -> Array:
    pixels = np.asarray(camera.project(points), dtype=np.float64)
    hidden = ~np.isfinite(pixels).all(axis=1)
    if hidden.any():
        raise ProjectionError(
            f"{int(hidden.sum())} of {len(points)} boundary points have no image, the first at {points[hidden][0]} m"
            " in the camera frame; a region must be visible as a whole"
        )
    return pixels


def project_region(
    camera: Camera, rotation: ArrayLike, translation: ArrayLike, rings: Rings, tolerance: float = BOUNDARY_TOLERANCE_PX
) -> list[Array]:
    """Pixel rings, as of `project_ring`, of a region given by (n, 3) world rings, at the pose `camera_from_world`."""
    return [project_ring(camera, to_camera(ring, rotation, translation), tolerance) for ring in rings]


def rings_window(rings: Rings, width: int, height: int) -> Window:
    """The smallest window of the image that holds every pixel touched by the (n, 2) pixel rings; may be empty."""
    points = np.concatenate([_pixel_ring(ring, i) for i, ring in enumerate(rings)])
    low = np.floor(points.min(axis=0) + 0.5)
    high = np.floor(points.max(axis=0) + 0.5) + 1.0
    left, top = np.clip(low, 0, (width, height)).astype(int).tolist()
    right, bottom = np.clip(high, 0, (width, height)).astype(int).tolist()
    return Window(left, top, right, bottom)


def _pixel_ring(ring: ArrayLike, index: int) -> Array:
    points = np.asarray(ring, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise ValueError(f"ring {index} has shape {points.shape}; needed is (n, 2) with n >= 3")
    if not np.isfinite(points).all():
        raise ValueError(f"ring {index} holds NaN or infinite pixels; all must be finite")
    return points


def ring_edges(rings: Rings) -> tuple[Array, Array]:
    """(e, 2) start and (e, 2) end points of all edges of all rings."""
    checked = [_pixel_ring(ring, i) for i, ring in enumerate(rings)]
    return np.concatenate(checked), np.concatenate([np.roll(ring, -1, axis=0) for ring in checked])


def binary_mask(rings: Rings, width: int, height: int) -> NDArray[np.bool_]:
    """(height, width) mask of the pixels whose center lies inside the (n, 2) pixel rings by the even-odd rule.

    A center exactly on the boundary is in when the inside lies to its right (on a horizontal edge: below it), so masks
    of regions that share an edge neither overlap nor leave a gap.
    """
    return binary_patch(rings, width, height).whole(width, height)


def binary_patch(rings: Rings, width: int, height: int, margin: int = 0) -> MaskPatch:
    """The part of `binary_mask` that holds the region, with `margin` px around it."""
    window = rings_window(rings, width, height).grown(margin, width, height)
    return MaskPatch(
        _window_mask(rings, window) if min(window.shape) else np.zeros(window.shape, dtype=np.bool_), window
    )


def _window_mask(rings: Rings, window: Window) -> NDArray[np.bool_]:
    """Mask of one window: each row toggles at the first pixel center at or right of every crossing."""
    start, end = ring_edges(rings)
    edge, row = _crossed_lines(start[:, 1], end[:, 1], window.top, window.bottom - 1)
    # From its upper end, whichever way it goes: a shared edge is crossed at one place, rounding included.
    down = (start[:, 1] < end[:, 1])[:, None]
    a, b = np.where(down, start, end)[edge], np.where(down, end, start)[edge]
    crossing = a[:, 0] + (row - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    columns, rows = window.right - window.left, window.bottom - window.top
    toggle = np.clip(np.ceil(crossing) - window.left, 0, columns).astype(np.int64)
    toggles = np.zeros((rows, columns + 1), dtype=np.uint8)
    np.bitwise_xor.at(toggles, (row - window.top, toggle), 1)
    return np.bitwise_xor.accumulate(toggles[:, :columns], axis=1).view(np.bool_)


def _crossed_lines(first: Array, last: Array, low: int, high: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(edge, line) of each integer line in low..high with min <= line < max of an edge's two end values."""
    begin = np.maximum(np.ceil(np.minimum(first, last)), low).astype(np.int64)
    stop = np.minimum(np.ceil(np.maximum(first, last)), high + 1).astype(np.int64)
    counts = np.maximum(stop - begin, 0)
    edge = np.repeat(np.arange(len(first)), counts)
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return edge, begin[edge] + offset


def area_coverage(rings: Rings, width: int, height: int) -> Array:
    """(height, width) share in [0, 1] of each pixel's area inside the (n, 2) pixel rings, exact for straight edges.

    Signed areas are accumulated along the boundary, so holes must turn the other way than outer rings, and rings must
    not cross; all rings reversed give the same answer.
    """
    return coverage_patch(rings, width, height).whole(width, height)


def coverage_patch(rings: Rings, width: int, height: int, margin: int = 0) -> MaskPatch:
    """The part of `area_coverage` that holds the region, with `margin` px around it."""
    window = rings_window(rings, width, height).grown(margin, width, height)
    return MaskPatch(_window_coverage(rings, window) if min(window.shape) else np.zeros(window.shape), window)


def _window_coverage(rings: Rings, window: Window) -> Array:
    """Coverage of one window: each piece of an edge adds the signed area between it and the window's right side."""
    start, end = ring_edges(rings)
    corner = np.array([window.left, window.top]) - 0.5
    columns, rows = window.right - window.left, window.bottom - window.top
    first, last = _cell_pieces(start - corner, end - corner, columns, rows)
    middle = 0.5 * (first + last)
    column = np.clip(np.floor(middle[:, 0]), 0, columns).astype(np.int64)
    row = np.floor(middle[:, 1]).astype(np.int64)
    height = last[:, 1] - first[:, 1]
    right_share = np.clip(column + 1.0 - middle[:, 0], 0.0, 1.0)
    kept = (row >= 0) & (row < rows)
    cells = row[kept] * (columns + 2) + column[kept]
    size = rows * (columns + 2)
    sums = np.bincount(cells, weights=(height * right_share)[kept], minlength=size)
    sums += np.bincount(cells + 1, weights=(height * (1.0 - right_share))[kept], minlength=size)
    areas = np.cumsum(sums.reshape(rows, columns + 2), axis=1)[:, :columns]
    return np.clip(areas if areas.sum() >= 0.0 else -areas, 0.0, 1.0)


def _cell_pieces(start: Array, end: Array, columns: int, rows: int) -> tuple[Array, Array]:
    """First and last points of the edges' pieces after a cut at every integer line of the grid."""
    edges, parameters = [np.arange(len(start))] * 2, [np.zeros(len(start)), np.ones(len(start))]
    for axis, high in ((0, columns), (1, rows)):
        edge, line = _crossed_lines(start[:, axis], end[:, axis], 0, high)
        low, span = start[edge, axis], end[edge, axis] - start[edge, axis]
        edges.append(edge)
        parameters.append(np.clip((line - low) / span, 0.0, 1.0))
    edge, parameter = np.concatenate(edges), np.concatenate(parameters)
    order = np.lexsort((parameter, edge))
    edge, parameter = edge[order], parameter[order]
    points = start[edge] + parameter[:, None] * (end - start)[edge]
    points[parameter == 1.0] = end[edge[parameter == 1.0]]
    same = edge[1:] == edge[:-1]
    return points[:-1][same], points[1:][same]
