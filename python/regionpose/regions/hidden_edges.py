"""Edges of an image region that are not its own: those that a polygon marks, and the contour beside unknown pixels."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.regions.mask import MaskWindow, checked_mask, traced_mask
from regionpose.validation.arrays import Array
from regionpose.validation.foreign import as_array

Marks = NDArray[np.bool_]

PART_PX = 0.5
"""Parts of a contour's edges that are looked at one by one are this long at most, pixels: no pixel is passed over."""


def marked_edges(
    given: Sequence[ArrayLike], rings: Sequence[Array], edges: Sequence[int] | Sequence[Sequence[int]]
) -> tuple[Marks, ...] | None:
    """For each checked ring (n, 2), whether its edges are among the marked ones of the given rings; None without any.

    `edges`: indices of the first ring's edges, or a list of them for each ring; checking may have turned a ring round.
    ValueError for indices that name no edge.
    """
    lists = _edge_lists(edges, len(given))
    if not any(lists):
        return None
    marked = []
    for index, (own, ring, chosen) in enumerate(zip(given, rings, lists, strict=True)):
        vertices = np.asarray(own, dtype=np.float64)
        for edge in chosen:
            if not 0 <= edge < len(vertices):
                raise ValueError(f"hidden_edges holds {edge}; ring {index} has edges 0 to {len(vertices) - 1}")
        ends = {_ends(vertices[edge], vertices[(edge + 1) % len(vertices)]) for edge in chosen}
        pairs = zip(ring, np.roll(ring, -1, axis=0), strict=True)
        marked.append(np.array([_ends(start, end) in ends for start, end in pairs]))
    return tuple(marked)


def marked_lines(ring: Array, marks: Marks) -> list[Array]:
    """Lines (m, 2) along the marked edges of a ring (n, 2), one for each run of neighbors."""
    count = len(ring)
    if marks.all():
        return [np.vstack([ring, ring[:1]])]
    starts = np.flatnonzero(marks & ~np.roll(marks, 1))
    ends = [next(k for k in range(start, start + count) if not marks[k % count]) for start in starts]
    return [ring[np.arange(start, end + 1) % count] for start, end in zip(starts, ends, strict=True)]


def _edge_lists(edges: object, count: int) -> list[list[int]]:
    """A list of indices for each of so many rings."""
    needed = "a list of edge indices, or one for each ring"
    if not isinstance(edges, Sequence | np.ndarray) or isinstance(edges, str):
        raise ValueError(f"hidden_edges is a {type(edges).__name__}; needed {needed}")
    nested = len(edges) > 0 and all(isinstance(each, Sequence | np.ndarray) for each in edges)
    lists = [list(each) for each in edges] if nested else [list(edges), *([[]] * (count - 1))]
    if len(lists) != count:
        raise ValueError(f"hidden_edges has {len(lists)} lists; needed one for each ring, {count}")
    try:
        return [[operator.index(edge) for edge in each] for each in lists]
    except TypeError as error:
        raise ValueError(f"hidden_edges holds what is no index; needed {needed}") from error


def _ends(start: Array, end: Array) -> frozenset[tuple[float, ...]]:
    return frozenset((tuple(start.tolist()), tuple(end.tolist())))


def traced_beside(mask: ArrayLike, unknown: ArrayLike) -> tuple[list[Array], MaskWindow, tuple[Marks, ...] | None]:
    """Contours and window, as of `traced_mask`, of what a mask (h, w) holds beside unknown pixels, and for each ring
    (n, 2) whether its edges run along these, (n,); None where none does.

    A contour runs among four pixels' centers everywhere; it is hidden where one of the four is unknown, and has a
    vertex where that begins. ValueError for arrays of other shapes or types, and where nothing is left.
    """
    certain, unknown_pixels = checked_mask(mask).copy(), _unknown_pixels(unknown)
    if certain.shape != unknown_pixels.shape:
        raise ValueError(f"unknown has shape {unknown_pixels.shape}; needed the mask's, {certain.shape}")
    if not np.any(certain[~unknown_pixels]):
        raise ValueError("no pixel of the mask is known to be the region's; needed one that unknown leaves")
    certain[unknown_pixels] = 0
    rings, window = traced_mask(certain)
    split = [_split_at_unknown(ring, unknown_pixels) for ring in rings]
    if not any(marks.any() for _, marks in split):
        return rings, window, None
    return [ring for ring, _ in split], window, tuple(marks for _, marks in split)


def _unknown_pixels(unknown: ArrayLike) -> Marks:
    given = as_array(unknown, "unknown", "(h, w)")
    if given.dtype.kind not in "biuf" or given.ndim != 2:
        raise ValueError(f"unknown has type {given.dtype} and shape {given.shape}; needed numbers of shape (h, w)")
    pixels: Marks = given != 0
    return pixels


def _split_at_unknown(ring: Array, unknown: Marks) -> tuple[Array, Marks]:
    """The ring (n, 2) with vertices where it meets and leaves unknown pixels, and which edges are beside these."""
    step = np.roll(ring, -1, axis=0) - ring
    parts = np.maximum(np.ceil(np.hypot(*step.T) / PART_PX), 1).astype(np.int64)
    first = np.repeat(np.arange(len(ring)), parts)
    within = np.arange(len(first)) - np.repeat(np.cumsum(parts) - parts, parts)
    fraction = within / parts[first]
    marks = _is_beside(ring[first] + (fraction + 0.5 / parts[first])[:, None] * step[first], unknown)
    # Vertices stay, and parts of one edge begin where the mark changes.
    kept = (within == 0) | (marks != np.roll(marks, 1))
    return ring[first[kept]] + fraction[kept, None] * step[first[kept]], marks[kept]


def _is_beside(points: Array, unknown: Marks) -> Marks:
    """Whether one of the four pixels whose centers surround each of the points (m, 2) is unknown."""
    height, width = unknown.shape
    low = np.floor(points).astype(np.int64)
    found = np.zeros(len(points), dtype=np.bool_)
    for right in (0, 1):
        for down in (0, 1):
            columns, rows = low[:, 0] + right, low[:, 1] + down
            inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
            found[inside] |= unknown[rows[inside], columns[inside]]
    return found
