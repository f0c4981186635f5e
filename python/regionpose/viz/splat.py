"""Pictures of a colored cloud from any viewpoint: each point a small square, the nearer ones in front."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from regionpose.validation.arrays import Array

Colors = NDArray[np.uint8]
Kind = TypeVar("Kind", bound=np.generic)

MOST_POINTS = 400_000
"""Points drawn at most, evenly chosen: more would not show in a picture of this size."""

BACKGROUND = (24, 27, 33)
NEAREST = 0.05
"""Points nearer than this fraction of the target's distance are left out: they would hide everything."""

LARGEST_SPLAT = 5
"""Side of the largest square, pixels."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A pinhole viewpoint: `eye` (3,) looks at `target` (3,), `up` (3,) is up in the picture, `field_deg` wide
    across.
    """

    eye: Array
    target: Array
    up: Array
    field_deg: float = 60.0

    @property
    def rotation(self) -> Array:
        """The rotation (3, 3) whose rows are the picture's right, down and forward."""
        forward = _unit(self.target - self.eye)
        right = np.cross(forward, self.up)
        if np.linalg.norm(right) < 1e-9 * max(1.0, float(np.linalg.norm(self.up))):
            right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
        right = _unit(right)
        return np.stack([right, np.cross(forward, right), forward])


def splatted(points: Array, colors: Colors, view: Viewpoint, width: int = 960, height: int = 600) -> Colors:
    """The picture (height, width, 3) of points (n, 3) with colors (n, 3), seen from `view`."""
    points, colors = drawn_points(points), drawn_points(colors)
    in_view = (points - view.eye) @ view.rotation.T
    distance = float(np.linalg.norm(view.target - view.eye))
    kept = in_view[:, 2] > NEAREST * distance
    in_view, colors = in_view[kept], colors[kept]
    focal = 0.5 * width / np.tan(np.radians(0.5 * view.field_deg))
    pixels = focal * in_view[:, :2] / in_view[:, 2:] + [0.5 * width, 0.5 * height]
    inside = ((pixels > -LARGEST_SPLAT) & (pixels < [width + LARGEST_SPLAT, height + LARGEST_SPLAT])).all(axis=1)
    pixels, depths, colors = pixels[inside], in_view[inside, 2], colors[inside]
    sides = np.clip(np.ceil(2.5 * distance / depths), 2, LARGEST_SPLAT).astype(np.int64)
    return _painted(pixels.astype(np.int64), depths, sides, colors, (height, width))


def drawn_points(values: NDArray[Kind]) -> NDArray[Kind]:
    """Those of values (n, ...) of points that belong to points that are drawn: at most `MOST_POINTS`."""
    return values[:: max(1, -(-len(values) // MOST_POINTS))]


def viewpoints(points: Array, camera_center: Array, up: Array) -> tuple[Viewpoint, Viewpoint]:
    """Two views of points (n, 3) that a camera sees: from its left and from its right, raised, both looking at their
    middle.
    """
    target = np.median(points, axis=0)
    arm = camera_center - target
    reach = float(np.percentile(np.linalg.norm(points - target, axis=1), 90))
    arm = _unit(arm) * max(float(np.linalg.norm(arm)), 1.5 * reach)
    return _orbited(target, arm, up, -35.0, 15.0), _orbited(target, arm, up, 30.0, 35.0)


def _orbited(target: Array, arm: Array, up: Array, turn_deg: float, raise_deg: float) -> Viewpoint:
    """The view from `arm` turned about `up` and raised towards it."""
    from scipy.spatial.transform import Rotation

    axis = _unit(up)
    turned = Rotation.from_rotvec(np.radians(turn_deg) * axis).apply(arm)
    tilt = np.cross(turned, axis)
    if np.linalg.norm(tilt) > 1e-6 * np.linalg.norm(turned):
        turned = Rotation.from_rotvec(np.radians(raise_deg) * _unit(tilt)).apply(turned)
    return Viewpoint(target + turned, target, axis)


def _painted(
    corners: NDArray[np.int64], depths: Array, sides: NDArray[np.int64], colors: Colors, shape: tuple[int, int]
) -> Colors:
    """Squares painted from the farthest to the nearest."""
    height, width = shape
    picture = np.empty((height, width, 3), dtype=np.uint8)
    picture[:] = BACKGROUND
    cells, ranks, owners = [], [], []
    order = np.argsort(-depths, kind="stable")
    for down in range(int(sides.max(initial=0))):
        for right in range(int(sides.max(initial=0))):
            owner = order[sides[order] > max(down, right)]
            column, row = corners[owner, 0] + right, corners[owner, 1] + down
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            cells.append(row[inside] * width + column[inside])
            ranks.append(depths[owner[inside]])
            owners.append(owner[inside])
    if cells:
        cell, rank, owner = np.concatenate(cells), np.concatenate(ranks), np.concatenate(owners)
        least = np.full(height * width, np.inf)
        np.minimum.at(least, cell, rank)
        # Of equal ones the first, which is written last.
        nearest = np.flatnonzero(rank == least[cell])[::-1]
        picture.reshape(-1, 3)[cell[nearest]] = colors[owner[nearest]]
    return picture


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))
