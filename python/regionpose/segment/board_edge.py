"""The edge of the board that a chessboard is printed on, beyond its squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from regionpose.segment.grid_places import placed
from regionpose.segment.image_lines import Floats, smooth_lab
from regionpose.validation.arrays import Array

BEYOND = 1.5
"""Squares beyond the pattern within which the board's edge is looked for; a convention."""

TILT = 0.3
"""Squares by which the margin may widen along a side: prints are glued on by hand. A convention."""

SIDE_SAMPLES = 80
"""Places along a side at which its edge is looked for."""

MOST_STEPS = 200
"""Steps beyond a side at the most: that of a square of 133 px is a pixel."""

CLEAR_STEP = 1.5
"""CIELAB units a pixel at which an edge is half as clear as it can be: that of a step of 5 units in a smoothed photo.
Ones far stronger count little more, so that an edge beyond the board doesn't win over the board's own. A convention."""

LEAST_CLEAR = 0.6
"""How clear a side's edge is on average at the least. Dark squares end at half of the pattern's own side."""

OUTWARD = np.array([[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, -1.0]])
"""The rows and columns that lead out of a pattern's sides, in the order of its corners."""


def board_around(image: NDArray[np.uint8], grid: Array, pattern: Array) -> Array | None:
    """The corners (4, 2), rows and columns, of the board around the pattern (4, 2) of a chessboard.

    `grid` (rows, columns, 2) holds the pixels of its inner corners. None where a side shows no edge within `BEYOND`
    squares of the pattern in the photo (h, w, 3).
    """
    around = placed(grid, pattern + BEYOND * (OUTWARD + np.roll(OUTWARD, 1, axis=0)))
    low = np.maximum(np.floor(around.min(axis=0)), 0.0).astype(np.intp)
    high = np.maximum(np.ceil(around.max(axis=0)).astype(np.intp) + 1, low + 2)
    lab = smooth_lab(image[low[1] : high[1], low[0] : high[0]])
    lines = []
    for start, end, outward in zip(pattern, np.roll(pattern, -1, axis=0), OUTWARD, strict=True):
        margins = _margins(lab, grid - low, np.stack([start, end]), outward)
        if margins is None:
            return None
        first, last = np.stack([start, end]) + np.array(margins)[:, None] * outward
        lines.append(np.cross([*first, 1.0], [*last, 1.0]))
    meets = np.array([np.cross(lines[k - 1], lines[k]) for k in range(4)])
    return np.asarray(meets[:, :2] / meets[:, 2:])


def _margins(lab: Floats, grid: Array, side: Array, outward: Array) -> tuple[float, float] | None:
    """The squares from both ends (2, 2) of a pattern's side out to the board's edge; None where there's no edge."""
    profiles, step = _edges_beyond(lab, grid, side, outward)
    count, samples = profiles.shape
    first, last = np.divmod(np.arange(count**2), count)
    kept = np.abs(first - last) * step <= TILT
    first, last = first[kept], last[kept]
    fraction = np.linspace(0.0, 1.0, samples)
    levels = np.round(first[:, None] * (1.0 - fraction) + last[:, None] * fraction).astype(np.intp)
    means = profiles[levels, np.arange(samples)].mean(axis=1)
    best = int(np.argmax(means))
    return (float(first[best] * step), float(last[best] * step)) if means[best] >= LEAST_CLEAR else None


def _edges_beyond(lab: Floats, grid: Array, side: Array, outward: Array) -> tuple[Array, float]:
    """How clear an edge is (n, samples), 0 to 1, at steps beyond places along a side, and the step in squares."""
    middle = side.mean(axis=0)
    length = float(np.hypot(*np.subtract(*placed(grid, np.stack([middle, middle + outward])))))
    count = int(np.clip(BEYOND * length, 8, MOST_STEPS))
    beyond = np.linspace(0.0, BEYOND, count)
    fraction = np.linspace(0.0, 1.0, SIDE_SAMPLES)[:, None]
    cells = side[0] * (1.0 - fraction) + side[1] * fraction + beyond[:, None, None] * outward
    x, y = np.moveaxis(placed(grid, cells), 2, 0)
    shades = [ndimage.map_coordinates(lab[..., k], [y, x], order=1, mode="nearest") for k in range(3)]
    steps = np.sqrt(sum(np.gradient(shade, axis=0) ** 2 for shade in shades)) * (count / (BEYOND * length))
    return steps / (steps + CLEAR_STEP), float(beyond[1])
