"""The chessboard around a pixel of a photo: its inner rectangle, its pattern and the board that it is printed on.

The corners of its squares are followed from one to the next, so that a lens may bend it as it likes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.spatial import cKDTree

from regionpose.segment.board_edge import BEYOND, board_around
from regionpose.segment.grid_places import placed
from regionpose.segment.x_corners import Corners, x_corners
from regionpose.validation.arrays import Array
from regionpose.validation.content import Content

Cell = tuple[int, int]
Indices = NDArray[np.intp]

WORK_PIXELS = 2_500_000
"""Pixels of the picture in which corners are looked for, about; larger photos are averaged down to it. A
convention: a square of 8 of these pixels fills 1/200 of the photo's width."""

SCALES = 3
"""Times that the picture is looked at, halved each time: a board out of focus shows its corners in a smaller one."""

STARTS = 300
"""Corners nearest to the click from which a grid is begun: more than noise makes within a square. Most end at once."""

NEAREST = 24
"""Corners around each one among which its neighbors are looked for: the rows of a board seen at 80 deg are a sixth of a
step apart, so that ten corners of a column are nearer than the next column; noise adds some."""

NEIGHBORS = 12
"""The same around the first one of a grid."""

STEP_TOLERANCE = 0.35
"""Distance of a corner from where it is predicted, in steps. A step is a fifth longer than the next where the board is
seen at 70 deg from eight squares away; another corner of the right colors is a whole step off."""

CROSSING_DEG = 20.0
"""Least angle between both directions of the grid; a convention."""

EDGE_PLACES = np.array([0.25, 0.5, 0.75])
"""Places between two neighbors at which the edge is looked at."""

EDGE_REACH, LEAST_EDGE_REACH = 0.1, 2.0
"""Distance across the edge at which both sides are looked at, in steps and in pixels at the least. It is beyond the
bend of an edge by a fisheye, and within the next square of a board that is seen at 80 deg."""

LIKE_CONTRAST = 1 / 3
"""Contrast of a corner over that of its neighbor at the least: light falls off slowly along a board. A
convention."""

EDGE_FRACTION = 0.3
"""Contrast of the edge at the least, over that of its corners; a convention."""

FEWEST = 3
"""Corners along each side of a grid at the least; a checkered scrap has fewer by chance."""


class Links(NamedTuple):
    """Corners, a tree of them, the nearest (n, k) around each, nearest first, and to which of these the edge of a
    square runs (n, k).
    """

    corners: Corners
    tree: cKDTree
    near: Indices
    is_linked: NDArray[np.bool_]

    @classmethod
    def of(cls, corners: Corners) -> Links:
        """Those of corners."""
        tree, count = cKDTree(corners.places), min(NEAREST + 1, len(corners.places))
        if count < FEWEST**2:
            none = np.zeros((count, 0), dtype=np.intp)
            return cls(corners, tree, none, none.astype(np.bool_))
        near = np.asarray(tree.query(corners.places, count)[1], dtype=np.intp).reshape(-1, count)[:, 1:]
        ones = np.repeat(np.arange(len(near)), near.shape[1])
        return cls(corners, tree, near, _linked(corners, ones, near.ravel()).reshape(near.shape))


def chessboard_around(image: NDArray[np.uint8], seed: tuple[float, float]) -> list[Array]:
    """The outlines (n, 2), pixels, of the chessboard around a pixel (x, y) of a photo (h, w, 3) uint8.

    The rectangle of its outermost inner corners first, then all its squares, then the board around these where its edge
    shows. Each has a vertex for each square along it and so bends as the photo does. Empty where there's no chessboard.
    """
    finest = max(1, round(float(np.sqrt(image.shape[0] * image.shape[1] / WORK_PIXELS))))
    photo = Content.of(image)
    found = [grid for halved in range(SCALES) for grid in _grids_at(photo, seed, finest * 2**halved)]
    if not found:
        return []
    grid = max(found, key=np.size)
    pattern = _rectangle(grid, 1.0)
    board = board_around(image, grid, pattern)
    outlines = [_outline(grid, _rectangle(grid, 0.0)), _outline(grid, pattern)]
    outlines += [] if board is None else [_outline(grid, board)]
    return outlines if _holds(outlines[-1], np.array(seed)) else []


def _grids_at(photo: Content[np.uint8], seed: tuple[float, float], factor: int) -> Iterator[Array]:
    """Grids (rows, columns, 2) of pixels around one, found in a photo that is averaged down by a factor."""
    for grid in _grids_around(_links_at(photo, factor), (np.array(seed) + 0.5) / factor - 0.5):
        yield (grid + 0.5) * factor - 0.5


@lru_cache(maxsize=SCALES)
def _links_at(photo: Content[np.uint8], factor: int) -> Links:
    """The linked corners of a photo that is averaged down by a factor, found once for all clicks."""
    gray = Image.fromarray(photo.array).convert("L")
    return Links.of(x_corners(np.asarray(gray.reduce(factor) if factor > 1 else gray)))


def _grids_around(links: Links, place: Array) -> Iterator[Array]:
    """Full grids (rows, columns, 2) of corners whose boards may hold a place."""
    corners = links.corners
    if not links.near.size:
        return
    tried: set[int] = set()
    starts = np.atleast_1d(links.tree.query(place, min(STARTS, len(corners.places)))[1])
    for start, steps in _first_steps(links, starts):
        if start in tried:
            continue
        cells = _followed(links, start, steps)
        tried.update(cells.values())
        grid = _full_grid(corners, cells)
        if grid is not None and _holds(_outline(grid, _rectangle(grid, 1.0 + BEYOND)), place):
            yield grid


def _followed(links: Links, start: int, steps: Array) -> dict[Cell, int]:
    """The corners that are reached from one of them over the squares' edges, by their places in the grid; `steps`
    (2, 2): the first ones.
    """
    cells: dict[Cell, int] = {(0, 0): start}
    reached = {start}
    queue = deque([(0, 0)])
    while queue:
        cell = queue.popleft()
        for direction in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            beyond = (cell[0] + direction[0], cell[1] + direction[1])
            if beyond in cells:
                continue
            found = _neighbor(links, cells[cell], _step(links.corners, cells, cell, direction, steps))
            if found is not None and found not in reached:
                cells[beyond] = found
                reached.add(found)
                queue.append(beyond)
    return cells


def _first_steps(links: Links, starts: Indices) -> Iterator[tuple[int, Array]]:
    """Those of some corners (n,) that have neighbors in both directions of the grid, with the steps (2, 2) to these."""
    corners = links.corners
    near, linked = (each[starts, :NEIGHBORS] for each in (links.near, links.is_linked))
    steps = corners.places[near] - corners.places[starts][:, None]
    lengths, first = np.hypot(steps[..., 0], steps[..., 1]), np.argmax(linked, axis=1)
    x, y, length = (np.take_along_axis(each, first[:, None], axis=1) for each in (*np.moveaxis(steps, 2, 0), lengths))
    crosses = np.abs(x * steps[..., 1] - y * steps[..., 0]) >= np.sin(np.radians(CROSSING_DEG)) * length * lengths
    second = linked & crosses & (np.arange(near.shape[1]) > first[:, None])
    for row in np.flatnonzero(second.any(axis=1)).tolist():
        yield int(starts[row]), steps[row, [first[row], np.argmax(second[row])]]


def _step(corners: Corners, cells: dict[Cell, int], cell: Cell, direction: Cell, steps: Array) -> Array:
    """The step (2,) from a corner of the grid in a direction: the one before it, or beside it, or the first one."""
    (row, column), (down, right) = cell, direction
    pairs = [((row - down, column - right), cell)]
    pairs += [
        ((row + s * right, column + s * down), (row + s * right + down, column + s * down + right)) for s in (1, -1)
    ]
    for one, other in pairs:
        if one in cells and other in cells:
            return np.asarray(corners.places[cells[other]] - corners.places[cells[one]])
    return np.asarray((down + right) * steps[0 if down else 1])


def _neighbor(links: Links, corner: int, step: Array) -> int | None:
    """The corner about a step from another, over an edge of a square; None where there's none."""
    places, near = links.corners.places, links.near[corner][links.is_linked[corner]]
    if not len(near):
        return None
    off = places[near] - (places[corner] + step)
    squares = off[:, 0] ** 2 + off[:, 1] ** 2
    nearest = int(np.argmin(squares))
    is_there = squares[nearest] <= STEP_TOLERANCE**2 * (step[0] ** 2 + step[1] ** 2)
    return int(near[nearest]) if is_there else None


def _linked(corners: Corners, ones: Indices, others: Indices) -> NDArray[np.bool_]:
    """Whether an edge of a square runs from each of some corners (n,) to another one: their colors alternate."""
    linked = _alternate(corners, ones, others)
    if not linked.any():
        return linked
    ones, others = ones[linked], others[linked]
    start, steps = corners.places[ones], corners.places[others] - corners.places[ones]
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    left = (
        np.stack([-steps[:, 1], steps[:, 0]], axis=1)
        * (np.maximum(EDGE_REACH * lengths, LEAST_EDGE_REACH) / lengths)[:, None]
    )
    middles = start[:, None] + EDGE_PLACES[:, None] * steps[:, None]
    sides = np.stack([middles + left[:, None], middles - left[:, None]])
    shades = ndimage.map_coordinates(corners.picture, [sides[..., 1], sides[..., 0]], order=1, mode="nearest")
    # Turning from the edge towards its left, the bright axis comes before the dark one where the left is bright.
    is_left = (corners.bright[ones] - np.arctan2(steps[:, 1], steps[:, 0])) % np.pi < np.pi / 2
    contrast = np.where(is_left, 1.0, -1.0)[:, None] * (shades[0] - shades[1])
    least = EDGE_FRACTION * np.minimum(corners.contrasts[ones], corners.contrasts[others])
    linked[linked] = (contrast >= least[:, None]).all(axis=1)
    return linked


def _alternate(corners: Corners, ones: Indices, others: Indices) -> NDArray[np.bool_]:
    """Whether the colors of corners (n,) and others alternate, and their contrasts are like."""
    turned = np.abs((corners.bright[others] - corners.bright[ones]) % np.pi - np.pi / 2)
    contrasts = np.stack([corners.contrasts[ones], corners.contrasts[others]])
    alike = contrasts.min(axis=0) >= LIKE_CONTRAST * contrasts.max(axis=0)
    return np.asarray((turned <= np.pi / 4) & alike)


def _full_grid(corners: Corners, cells: dict[Cell, int]) -> Array | None:
    """The largest rectangle (rows, columns, 2) of the grid that lacks no corner; None where all are small."""
    places = np.array(list(cells))
    low = places.min(axis=0)
    numbers = np.full(places.max(axis=0) - low + 1, -1)
    numbers[tuple((places - low).T)] = list(cells.values())
    best = numbers[:0]
    for top in range(len(numbers)):
        for bottom in range(top + FEWEST, len(numbers) + 1):
            left, right = _longest_run(np.asarray((numbers[top:bottom] >= 0).all(axis=0)))
            if right - left >= FEWEST and (bottom - top) * (right - left) > best.size:
                best = numbers[top:bottom, left:right]
    return np.asarray(corners.places[best]) if best.size else None


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Where the longest run of true flags begins and ends."""
    turns = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    if not len(turns):
        return 0, 0
    longest = int(np.argmax(turns[1::2] - turns[::2]))
    return int(turns[2 * longest]), int(turns[2 * longest + 1])


def _rectangle(grid: Array, beyond: float) -> Array:
    """Corners (4, 2), rows and columns, of a grid (rows, columns, 2) that is grown by some squares on every side."""
    low, (bottom, right) = -beyond, np.array(grid.shape[:2]) - 1.0 + beyond
    return np.array([[low, low], [low, right], [bottom, right], [bottom, low]])


def _outline(grid: Array, corners: Array) -> Array:
    """The outline (n, 2) in pixels of a quadrilateral (4, 2) of rows and columns, with a vertex for each square."""
    sides = []
    for k in range(4):
        step = corners[(k + 1) % 4] - corners[k]
        pieces = max(round(float(np.abs(step).max())), 1)
        sides.append(corners[k] + np.arange(pieces)[:, None] / pieces * step)
    return placed(grid, np.concatenate(sides))


def _holds(outline: Array, place: Array) -> bool:
    """Whether a place (2,) is inside an outline (n, 2)."""
    return bool(shapely.contains_xy(shapely.Polygon(outline).buffer(0), *place))
