"""The cloud as seen from one place: a picture of directions whose pixels know the points that they show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from regionpose.io.clouds import Cloud
from regionpose.validation.arrays import Array
from regionpose.viz.overlays import depth_colors

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]
Cells = NDArray[np.int32]
Indices = NDArray[np.int64]
Mask = NDArray[np.bool_]

MOST_COLUMNS, MOST_ROWS = 4096, 2048
"""Pixels of the picture at the most: a browser's textures hold them, and a pixel is 0.09 degrees of a full turn."""

PIXELS_PER_SPACING = 1.5
"""Pixels between neighboring points along the picture's sides: enough to click on each of them."""

NEAR_POLE = 60.0
"""Degrees above or below the horizon from which directions crowd at a pole of the picture; a convention."""

STRAYS = 0.1
"""Percent of the points above and below the picture that it leaves out."""

MARGIN_DEG = 0.5
"""Degrees of empty border, so that outlines at the edge are seen."""

GAP_SLACK = 1.5
"""Gaps up to this many times the usual one between scan lines are filled."""

BLOCK = 1 << 20
"""Points worked on at a time, so that a large cloud's temporaries stay small beside it."""

BACKGROUND = (22, 26, 33)

SHADING = 60.0
"""Strength with which a pixel darkens for how much nearer its neighbors are, on a logarithmic scale: a step of 1 %
takes a third of the light (after Boucheny 2009, eye-dome lighting)."""

LARGEST_STEP = 0.02
"""Step of the logarithm of the distance beyond which a neighbor takes no more light: an edge is an edge."""

SHADED_LEAST = 0.35
"""Light that is left in the deepest shade."""


class Axes(NamedTuple):
    """Rows: the picture's middle, its left, and up, unit vectors in the world."""

    ahead: Array
    left: Array
    up: Array

    @property
    def matrix(self) -> Array:
        """World directions to these axes (3, 3)."""
        return np.stack(self)


class Directions(NamedTuple):
    """Where points are seen: azimuth and elevation (n,), degrees, and distances (n,)."""

    azimuth: Floats
    elevation: Floats
    ranges: Floats


@dataclass(frozen=True, eq=False)
class RangeView:
    """A picture of the directions from `place` (3,), about the cloud's local origin, to its points.

    `axes`: what its columns and rows are counted along. `start`: azimuth of the left border and elevation of the upper
    one, degrees, azimuth growing to the left. `step`: degrees of a pixel. `indices` (h, w): the point that each pixel
    shows, -1 for none.
    """

    place: Array
    axes: Axes
    start: tuple[float, float]
    step: float
    indices: Indices

    @classmethod
    def of(cls, cloud: Cloud, place: Array, up: Array | None = None) -> RangeView:
        """The picture of a whole cloud from a place; `up`: the world's upward direction where it is known."""
        axes = _axes(cloud.local_points, place, up)
        directions = _directions(cloud.local_points, place, axes)
        cut = _widest_gap(directions.azimuth)
        np.remainder(np.subtract(cut, directions.azimuth, out=directions.azimuth), 360.0, out=directions.azimuth)
        top, bottom = np.percentile(directions.elevation, [100.0 - STRAYS, STRAYS])
        across, down = float(directions.azimuth.max()) + 2 * MARGIN_DEG, float(top - bottom) + 2 * MARGIN_DEG
        step = _step(across, down, len(cloud))
        shape = (int(np.ceil(down / step)), int(np.ceil(across / step)))
        nearest = _nearest(directions, float(top), step, shape)
        return cls(place, axes, (cut + MARGIN_DEG, float(top) + MARGIN_DEG), step, _filled(nearest))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.indices.shape[1], self.indices.shape[0]

    @property
    def visible_points(self) -> Indices:
        """Indices, ascending, of the points that the picture shows."""
        return np.unique(self.indices[self.indices >= 0])

    def point_at(self, x: float, y: float) -> int | None:
        """Index of the point that the pixel at (x, y) shows, an integer being a pixel's center; None where it is empty.

        Clicks beside a point by a pixel or two find it.
        """
        column, row = round(x), round(y)
        top, left = max(row - 2, 0), max(column - 2, 0)
        around = self.indices[top : max(row + 3, 0), left : max(column + 3, 0)]
        rows, columns = np.nonzero(around >= 0)
        if not len(rows):
            return None
        nearest = np.argmin((rows + top - row) ** 2 + (columns + left - column) ** 2)
        return int(around[rows[nearest], columns[nearest]])

    def pixels(self, points: Array) -> Array:
        """Pixels (n, 2) of points (n, 3) about the cloud's local origin."""
        angles, _ = _angles(points, self.place, self.axes)
        azimuth = (self.start[0] - MARGIN_DEG - angles[:, 0]) % 360.0 + MARGIN_DEG
        # What lies just left of the border is not a turn to the right of it.
        width = self.size[0] * self.step
        azimuth = np.where(azimuth > 0.5 * (360.0 + width), azimuth - 360.0, azimuth)
        return np.stack([azimuth / self.step - 0.5, (self.start[1] - angles[:, 1]) / self.step - 0.5], axis=1)

    def inside(self, ring: Sequence[Sequence[float]], points: Array) -> Mask:
        """Which of some points (n, 3) about the cloud's local origin are seen inside a ring (k, 2) of pixels.

        A ring that crosses itself, as one drawn by hand may where its ends meet, holds all that it goes around.
        ValueError for one without area.
        """
        import shapely

        outline = shapely.make_valid(shapely.Polygon(ring)) if len(ring) > 2 else shapely.Polygon()
        if not outline.area:
            raise ValueError(f"found {len(ring)} corners around no area; needed an outline of 3 corners or more")
        is_inside = np.empty(len(points), dtype=np.bool_)
        for block in _blocks(len(points)):
            is_inside[block] = shapely.contains_xy(outline, self.pixels(points[block]))
        return is_inside

    def picture(self, points: Array, colors: Bytes, visible_points: Cells) -> Bytes:
        """The picture (h, w, 3) of points (n, 3) in colors (n, 3), edges of depth shaded.

        `shown` (h, w): which of these points each pixel shows, -1 for none.
        """
        has_point = visible_points >= 0
        own = visible_points[has_point]
        drawn = np.empty((*self.indices.shape, 3), dtype=np.uint8)
        drawn[:] = BACKGROUND
        ranges = np.full(self.indices.shape, np.inf, dtype=np.float32)
        ranges[has_point] = np.linalg.norm(points[own] - self.place, axis=1)
        drawn[has_point] = np.round(colors[own] * _light(ranges)[has_point, None]).astype(np.uint8)
        return drawn


def depth_and_intensity(cloud: Cloud, place: Array) -> Bytes:
    """Colors (n, 3) of a cloud's points: hue by their distance from a place, brightness by their intensity."""
    ranges = np.linalg.norm(cloud.local_points - place, axis=1)
    near, far = np.percentile(ranges, [1.0, 99.0])
    table = depth_colors()
    fraction = np.clip(np.log(np.maximum(ranges, near) / near) / max(np.log(far / near), 1e-9), 0.0, 1.0)
    colors = table[np.round((1.0 - fraction) * (len(table) - 1)).astype(np.int64)]
    if cloud.intensity is None:
        return np.asarray(colors, dtype=np.uint8)
    shaded: Bytes = np.round(colors * (0.55 + 0.45 * grays(cloud))[:, None]).astype(np.uint8)
    return shaded


def grays(cloud: Cloud) -> Array:
    """The intensity (n,) of a cloud's points in [0, 1], by rank: scanners have scales of their own."""
    if cloud.intensity is None:
        return np.ones(len(cloud))
    levels, inverse = np.unique(cloud.intensity, return_inverse=True)
    if len(levels) == 1:
        return np.ones(len(cloud))
    counts = np.bincount(inverse.ravel())
    rank = (np.cumsum(counts) - 0.5 * counts) / len(cloud)
    return np.asarray(rank[inverse.ravel()])


def _light(ranges: Floats) -> Floats:
    """The light (h, w) that the nearer neighbors leave to pixels of these distances, infinite ones being empty."""
    height = np.log(np.maximum(ranges, np.float32(1e-9)))
    padded = np.pad(height, 2, constant_values=np.inf)
    steps = np.zeros_like(height)
    rows, columns = height.shape
    for down, right in ((0, 2), (0, -2), (2, 0), (-2, 0)):
        other = padded[2 + down : 2 + down + rows, 2 + right : 2 + right + columns]
        both = np.isfinite(other) & np.isfinite(height)
        steps[both] += np.clip(height[both] - other[both], 0.0, LARGEST_STEP)
    return np.maximum(np.exp(-SHADING * steps / 4.0), np.float32(SHADED_LEAST))


def _axes(points: Array, place: Array, up: Array | None) -> Axes:
    """Axes whose poles the points keep clear of: up as given, else along z, else along -y as of a camera's frame."""
    step = max(1, len(points) // 20_000)
    directions = points[::step] - place
    directions = directions / np.maximum(np.linalg.norm(directions, axis=1), 1e-12)[:, None]
    crowded = np.mean(np.abs(directions[:, 2]) > np.sin(np.radians(NEAR_POLE))) > 0.5
    upward = np.array([0.0, -1.0, 0.0] if crowded else [0.0, 0.0, 1.0]) if up is None else up / np.linalg.norm(up)
    ahead = np.array([0.0, 0.0, 1.0]) if abs(upward[1]) > 0.9 else np.array([1.0, 0.0, 0.0])
    ahead = ahead - upward * (ahead @ upward)
    ahead = ahead / np.linalg.norm(ahead)
    return Axes(ahead, np.cross(upward, ahead), upward)


def _angles(points: Array, place: Array, axes: Axes) -> tuple[Array, Array]:
    """Azimuth and elevation (n, 2), degrees, of points from a place, and their distances (n,)."""
    ahead, left, up = ((points - place) @ axes.matrix.T).T
    across = ahead**2 + left**2
    angles = np.stack([np.arctan2(left, ahead), np.arctan2(up, np.sqrt(across))], axis=1)
    return np.degrees(angles), np.sqrt(across + up**2)


def _directions(points: Array, place: Array, axes: Axes) -> Directions:
    """Where points (n, 3) are seen from a place."""
    components = np.empty((3, len(points)), dtype=np.float32)
    for block in _blocks(len(points)):
        angles, components[2, block] = _angles(points[block], place, axes)
        components[:2, block] = angles.T
    return Directions(*components)


def _blocks(count: int) -> Iterator[slice]:
    """So many points, a block at a time."""
    return (slice(start, start + BLOCK) for start in range(0, count, BLOCK))


def _widest_gap(azimuth: Floats) -> float:
    """The azimuth, degrees, right of which the picture begins: the left end of the widest gap, or behind."""
    counts = np.zeros(360, dtype=np.int64)
    for block in _blocks(len(azimuth)):
        counts += np.bincount(np.floor(azimuth[block]).astype(np.int64) % 360, minlength=360)
    occupied = np.flatnonzero(counts)
    if not len(occupied) or len(occupied) == 360:
        return 180.0
    gaps = np.diff(np.append(occupied, occupied[0] + 360))
    widest = int(np.argmax(gaps))
    return float(occupied[widest] + 1) if gaps[widest] > 5 else 180.0


def _step(across: float, down: float, count: int) -> float:
    """Degrees of a pixel for so many points on so large a picture."""
    spacing = np.sqrt(across * down / max(count, 1))
    return float(max(spacing / PIXELS_PER_SPACING, across / MOST_COLUMNS, down / MOST_ROWS))


def _nearest(directions: Directions, top: float, step: float, shape: tuple[int, int]) -> Indices:
    """The nearest point of each pixel (h, w), -1 for none; `top`: the elevation a margin below the upper border."""
    # Distances are not negative, and the bits of such floats are ordered as they are: a word of a distance's bits and
    # the point's index is least for the nearest point, and of those as near for the first.
    none = np.iinfo(np.uint64).max
    least = np.full(shape[0] * shape[1], none, dtype=np.uint64)
    for block in _blocks(len(directions.ranges)):
        columns = ((directions.azimuth[block] + MARGIN_DEG) / step).astype(np.int64)
        rows = np.floor((np.float64(top + MARGIN_DEG) - directions.elevation[block]) / step).astype(np.int64)
        inside = np.flatnonzero((rows >= 0) & (rows < shape[0]) & (columns >= 0) & (columns < shape[1]))
        bits = directions.ranges[block][inside].view(np.uint32).astype(np.uint64)
        words = bits << np.uint64(32) | (block.start + inside).astype(np.uint64)
        np.minimum.at(least, rows[inside] * shape[1] + columns[inside], words)
    nearest = (least & np.uint64(0xFFFFFFFF)).astype(np.int64)
    return np.where(least == none, -1, nearest).reshape(shape)


def _filled(nearest: Indices) -> Indices:
    """The picture with the gaps between scan lines closed by the points beside them."""
    empty = nearest < 0
    if empty.all():
        return nearest
    distance, (rows, columns) = distance_transform_edt(empty, return_indices=True)
    return np.where(distance <= 0.5 * GAP_SLACK * _gap(~empty) + 1.0, nearest[rows, columns], -1)


def _gap(has_point: Mask) -> float:
    """The usual distance, pixels, from a has_point pixel to the next one below it."""
    rows, columns = np.nonzero(has_point.T)[::-1]
    steps = np.diff(rows)[np.diff(columns) == 0]
    return float(np.percentile(steps, 75)) if len(steps) else 1.0
