"""Quadrilaterals around a pixel whose sides a photo shows: doors, boards, posters and walls, windows and all."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from regionpose.segment.image_lines import (
    NEAR_PX,
    Floats,
    Lines,
    edges_of,
    smooth_lab,
    straight_lines,
    window_around,
)
from regionpose.validation.arrays import Array

Indices = NDArray[np.intp]

WINDOWS = (1 / 16, 1 / 8, 1 / 4, 1 / 2)
"""Half the sides of the windows around the seed that lines are looked for in, over the photo's longer side: the longest
lines of the whole photo aren't those of a small face."""

SMALLEST_WINDOW = 16
"""Pixels of a window's shorter side below which it is passed over."""

OPPOSITE_DEG, ADJACENT_DEG = 35.0, 25.0
"""Angles between the lines of opposite sides at the most, and of adjacent sides at the least: rectangles seen from the
side have wide ones. A convention."""

SHORTEST_SIDE = 8.0
"""Pixels of a window: shorter sides have edges by chance."""

BEYOND_PX = 3.0
"""Pixels of a window that a corner may lie beyond it."""

LEAST_FRACTION = 0.02
"""Fraction of a side that counts as shown at the least, so that one hidden side doesn't rule a quadrilateral out."""

BORDER_FRACTION = 0.5
"""Fraction that a side on the photo's border counts as: one that may be there or not, so that sides that show count
more. From 0.15 to 0.5 the same faces of `benchmarks/click_masks.py` are met."""

SIZE_POWER = 0.15
"""Power of the area by which a larger quadrilateral is preferred, among those that the photo's border doesn't cut.
Chosen on the faces of `benchmarks/click_masks.py`: of the 19 that are no chessboards, quadrilaterals meet 7, and 5, 6,
6 and 4 with 0, 0.06, 0.1 and 0.25. On other photos expect less."""

OTHER_OVERLAP = 0.75
"""Overlap (IoU) from which two quadrilaterals are the same proposal; plain to see."""

FEWEST_SHOWN = 2
"""Sides that aren't the photo's border, at the least: a corner of a face is seen."""

MOST_OF_WINDOW = 150
"""Quadrilaterals of a window that are looked at further, of either kind."""

REFINED_ROUNDS = 3
"""Times that the edges beside a side are looked for: first within `NEAR_PX` of the window, where those lie that showed
the line, at last within half of it."""

SIDE_SAMPLES = 200
"""Places along a side, at the most, at which its edge is looked for."""

MOST_ROUNDS, CONVERGED_PX = 100, 1e-4
"""Rounds of a side's fit at the most, and the change that ends it, pixels: far below what a mask shows."""


class Quads(NamedTuple):
    """Quadrilaterals that were found in windows of a photo.

    `corners` (n, 4, 2), pixels; `fractions` (n, 4): those of their sides that show an edge, nan of sides on the photo's
    border; `grain` (n,): pixels of the photo in one of the window.
    """

    corners: Array
    fractions: Array
    grain: Array

    @property
    def areas(self) -> Array:
        """Their areas (n,)."""
        x, y = np.moveaxis(self.corners, 2, 0)
        return np.asarray(0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)))

    @property
    def edge_fractions(self) -> Array:
        """How clearly they show (n,): the geometric mean of the fractions."""
        fractions = np.clip(np.nan_to_num(self.fractions, nan=BORDER_FRACTION), LEAST_FRACTION, 1.0)
        return np.asarray(np.exp(np.log(fractions).mean(axis=1)))

    @property
    def clear(self) -> Array:
        """How clearly the whole ones show (n,), times a power of the area; 0 of those that the photo's border cuts."""
        return np.where(np.isnan(self.fractions).any(axis=1), 0.0, self.edge_fractions * self.areas**SIZE_POWER)

    @property
    def cut(self) -> Array:
        """How clearly those show (n,) that the photo's border cuts; 0 of the others."""
        return np.where(np.isnan(self.fractions).any(axis=1), self.edge_fractions, 0.0)

    def selected(self, which: Indices) -> Quads:
        """The quadrilaterals at some indices."""
        return Quads(self.corners[which], self.fractions[which], self.grain[which])


def quads_around(image: NDArray[np.uint8], seed: tuple[float, float]) -> list[Array]:
    """Up to three quadrilaterals (4, 2), pixels, around a pixel (x, y) of a photo (h, w, 3) uint8.

    The one that shows most clearly, the one that does close around the pixel, and the one of those that the photo's
    border cuts. Their sides are refined on the photo.
    """
    reach = max(image.shape[:2])
    found = [_window_quads(image, seed, fraction * reach) for fraction in WINDOWS]
    quads = Quads(*(np.concatenate(parts) for parts in zip(*found, strict=True)))
    close = np.where(np.arange(len(quads.corners)) < len(found[0].corners), quads.clear, 0.0)
    chosen: list[int] = []
    for scores in (quads.clear, close, quads.cut):
        for index in np.argsort(-scores, kind="stable").tolist():
            others = (quads.corners[other] for other in chosen)
            if scores[index] > 0.0 and all(_overlap(quads.corners[index], other) < OTHER_OVERLAP for other in others):
                chosen.append(index)
                break
    return [_refined(image, quads.selected(np.array([index]))) for index in chosen]


def _window_quads(image: NDArray[np.uint8], seed: tuple[float, float], half: float) -> Quads:
    """The quadrilaterals of a window that show most clearly, whole ones and those that the photo's border cuts."""
    window = window_around(image, seed, half)
    if min(window.values.shape[:2]) < SMALLEST_WINDOW:
        return Quads(np.empty((0, 4, 2)), np.empty((0, 4)), np.empty(0))
    lines, place = straight_lines(edges_of(window.values)), window.inside(np.array(seed))
    lines = lines.beside(*window.borders(image.shape))
    quads = _quads(lines, _opposite(lines, place), place, np.array(window.values.shape[1::-1]))
    best = np.argsort(-np.stack([quads.clear, quads.cut]), axis=1, kind="stable")[:, :MOST_OF_WINDOW]
    kept = quads.selected(np.unique(best))
    return Quads(window.outside(kept.corners), kept.fractions, kept.grain * window.factor)


def _opposite(lines: Lines, place: Array) -> Indices:
    """Pairs of lines (m, 2) of about one direction, with a place between them."""
    alike = lines.normals @ lines.normals.T
    sides = np.sign(lines.normals @ place - lines.offsets)
    between = sides[:, None] * sides * np.sign(alike) < 0.0
    return np.argwhere(np.triu(between & (np.abs(alike) >= np.cos(np.radians(OPPOSITE_DEG))), 1))


def _quads(lines: Lines, pairs: Indices, place: Array, size: Array) -> Quads:
    """The quadrilaterals within a window of a size (width, height), between two pairs of lines, around a place."""
    first, second = np.triu_indices(len(pairs), 1)
    sides = np.stack([pairs[first, 0], pairs[second, 0], pairs[first, 1], pairs[second, 1]], axis=1)
    steep = np.abs(lines.normals @ lines.normals.T) <= np.cos(np.radians(ADJACENT_DEG))
    after = np.roll(sides, -1, axis=1)
    edge_fractions = ~np.isnan(lines.edge_counts[sides, 0])
    sides = sides[steep[sides, after].all(axis=1) & (edge_fractions.sum(axis=1) >= FEWEST_SHOWN)]
    corners = _corners(lines, sides)
    within = ((corners > -BEYOND_PX) & (corners < size + BEYOND_PX)).all(axis=(1, 2))
    edges, to_place = np.roll(corners, -1, axis=1) - corners, place - corners
    turns = edges[..., 0] * to_place[..., 1] - edges[..., 1] * to_place[..., 0]
    around = (turns > 0.0).all(axis=1) | (turns < 0.0).all(axis=1)
    kept = within & around & (np.hypot(edges[..., 0], edges[..., 1]).min(axis=1) > SHORTEST_SIDE)
    return Quads(corners[kept], _fractions(lines, sides[kept], corners[kept]), np.ones(int(kept.sum())))


def _corners(lines: Lines, sides: Indices) -> Array:
    """Where each side (n, 4) of a quadrilateral meets the one before it, (n, 4, 2)."""
    before = np.roll(sides, 1, axis=1)
    (x1, y1), (x2, y2) = np.moveaxis(lines.normals[before], 2, 0), np.moveaxis(lines.normals[sides], 2, 0)
    one, two = lines.offsets[before], lines.offsets[sides]
    turned = x1 * y2 - y1 * x2
    return np.stack([(one * y2 - two * y1) / turned, (x1 * two - x2 * one) / turned], axis=2)


def _fractions(lines: Lines, sides: Indices, corners: Array) -> Array:
    """The fraction (n, 4) of each side that shows an edge; side k begins at corner k."""
    normals = lines.normals[sides]
    tangents = np.stack([-normals[..., 1], normals[..., 0]], axis=2)
    ends = np.stack([(tangents * corners).sum(axis=2), (tangents * np.roll(corners, -1, axis=1)).sum(axis=2)])
    low, high = np.clip(np.sort(ends, axis=0) + lines.reach, 0, 2 * lines.reach).astype(np.intp)
    edge_fractions = lines.edge_counts[sides, high] - lines.edge_counts[sides, low]
    return np.asarray(np.minimum(edge_fractions / np.maximum(np.abs(ends[1] - ends[0]), 1.0), 1.0))


def _overlap(one: Array, other: Array) -> float:
    """IoU of two quadrilaterals."""
    import shapely

    first, second = shapely.Polygon(one), shapely.Polygon(other)
    return float(first.intersection(second).area / first.union(second).area)


def _refined(image: NDArray[np.uint8], quad: Quads) -> Array:
    """The only quadrilateral with its sides on the edges beside them; as it is where these don't make one around it.

    Sides on the photo's border stay.
    """
    corners, fixed = quad.corners[0], np.isnan(quad.fractions[0])
    reaches = float(quad.grain[0]) * NEAR_PX * np.linspace(1.0, 0.5, REFINED_ROUNDS)
    low = np.maximum(np.floor(corners.min(axis=0) - 2.0 * reaches[0]), 0.0).astype(np.intp)
    high = np.ceil(corners.max(axis=0) + 2.0 * reaches[0]).astype(np.intp) + 1
    lab = smooth_lab(image[low[1] : high[1], low[0] : high[0]])
    refined = corners - low
    for reach in reaches:
        ends = list(zip(refined, np.roll(refined, -1, axis=0), fixed, strict=True))
        lines = [
            _line(start, end) if is_fixed else _refined_side(lab, start, end, reach) for start, end, is_fixed in ends
        ]
        side_lines = Lines(np.array([n for n, _ in lines]), np.array([c for _, c in lines]), np.zeros((4, 2)))
        refined = _corners(side_lines, np.arange(4)[None])[0]
    refined = refined + low
    return np.asarray(refined if _overlap(refined, corners) >= OTHER_OVERLAP else corners)


def _refined_side(lab: Floats, start: Array, end: Array, reach: float) -> tuple[Array, float]:
    """Normal (2,) and offset of the line along the strongest edges within `reach` of a side, outliers weighted down."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    normal = np.array([-along[1], along[0]])
    places = np.linspace(0.05, 0.95, int(np.clip(length, SHORTEST_SIDE, SIDE_SAMPLES)))
    across = np.arange(-reach, reach + 0.25, 0.5)
    pixels = start + places[:, None, None] * (end - start) + across[:, None] * normal
    shades = [map_coordinates(lab[..., k], [pixels[..., 1], pixels[..., 0]], order=1, mode="nearest") for k in range(3)]
    steps = np.sqrt(sum(np.gradient(shade, axis=1) ** 2 for shade in shades))
    offs, strength = across[np.argmax(steps, axis=1)], steps.max(axis=1)
    weights = np.minimum(strength / max(float(np.median(strength)), 1e-9), 1.0)
    shift, slope = _robust_line(places - 0.5, offs, weights)
    return _line(start + (shift - 0.5 * slope) * normal, end + (shift + 0.5 * slope) * normal)


def _robust_line(lever: Array, offs: Array, weights: Array) -> Array:
    """Shift and slope (2,) of the line through offsets (n,) along a lever (n,), by Cauchy's loss of weighted residuals:
    least squares whose weights follow from the last residuals, which lower the loss at each round.
    """
    terms, line = np.stack([np.ones_like(lever), lever], axis=1), np.asarray([0.0, 0.0])
    for _ in range(MOST_ROUNDS):
        own = weights**2 / (1.0 + (weights * (terms @ line - offs)) ** 2)
        # Where nothing has a weight the side stays.
        before, line = line, np.linalg.lstsq((terms.T * own) @ terms, terms.T @ (own * offs), rcond=None)[0]
        if np.abs(line - before).max() < CONVERGED_PX:
            break
    return np.asarray(line)


def _line(start: Array, end: Array) -> tuple[Array, float]:
    """Normal (2,) and offset of the line through two places."""
    x, y = (end - start) / np.hypot(*(end - start))
    return np.array([-y, x]), float(x * start[1] - y * start[0])
