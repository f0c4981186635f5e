"""Straight lines of a photo around a pixel, and how much of each shows an edge."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from regionpose.segment.outlining import lab_of
from regionpose.validation.arrays import Array

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]

WINDOW_PIXELS = 400
"""Pixels of the longer side of a window at the most; larger ones are averaged down, so that all take as long."""

BLUR_PX = 1.0
"""Standard deviation of the smoothing before the gradient, pixels of the window: enough to determine its direction."""

LEAST_GRADIENT = 8.0
"""CIELAB units by Sobel's kernel: that of a step of 2 units. Below are noise and JPEG's blocks. A convention."""

FLAT_FRACTION = 60.0
"""Percentile of the gradients of a window that an edge exceeds, where all of it is textured. A convention."""

ANGLES = 90
"""Directions that lines are sorted into: one moves the end of a line of 100 px by less than 2 px."""

SPREAD = 2
"""Directions to either side that an edge votes for: its own is known to 4 deg."""

MOST_LINES = 60
"""Lines of a window that are kept, the longest. Chosen on the faces of `benchmarks/click_masks.py`: of the 19 that
are no chessboards, quadrilaterals of these meet 7, and 6 and 5 with 44 and 80 lines."""

NEAR_PX = 1.5
"""Distance of an edge from a line that it shows, pixels of the window."""

ALONG_DEG = 12.0
"""Angle between such an edge and the line."""


class Edges(NamedTuple):
    """Where a window shows edges (h, w), and the directions of their normals (h, w), radians."""

    there: Mask
    normals: Floats


class Lines(NamedTuple):
    """Lines of a window, and which of their pixels show an edge.

    `normals` (n, 2), `offsets` (n,): points x of a line have normal @ x = offset. `edge_counts` (n, 2 reach + 2): how
    many pixels of the line show an edge before each place along it, from -reach on; nan of lines where none can show.
    """

    normals: Array
    offsets: Array
    edge_counts: Array

    @property
    def reach(self) -> int:
        """The places along a line go from -reach to reach, pixels from the foot of the window's zero."""
        return int(self.edge_counts.shape[1] - 2) // 2

    def beside(self, normals: Array, offsets: Array) -> Lines:
        """The lines with others (m, 2), (m,) beside them at which no edge can show."""
        blank = np.full((len(offsets), self.edge_counts.shape[1]), np.nan)
        joined = [(self.normals, normals.reshape(-1, 2)), (self.offsets, offsets), (self.edge_counts, blank)]
        return Lines(*(np.concatenate(pair) for pair in joined))


class Window(NamedTuple):
    """A part of a photo around a pixel: its values, the pixels that each averages, and its first pixel (x, y)."""

    values: NDArray[np.uint8]
    factor: int
    corner: Array

    def inside(self, pixels: Array) -> Array:
        """Pixels of the photo (..., 2) as those of the window."""
        return np.asarray((pixels - self.corner + 0.5) / self.factor - 0.5)

    def outside(self, pixels: Array) -> Array:
        """Pixels of the window (..., 2) as those of the photo."""
        return np.asarray((pixels + 0.5) * self.factor - 0.5 + self.corner)

    def borders(self, shape: tuple[int, ...]) -> tuple[Array, Array]:
        """Normals (m, 2) and offsets (m,), pixels of the window, of the borders of a photo (h, w, ...) beside it."""
        size = np.array([shape[1], shape[0]], dtype=np.float64)
        edges = self.inside(np.stack([np.full(2, -0.5), size - 0.5]))
        inner = np.array(self.values.shape[1::-1])
        beside = np.stack([self.corner <= 0, edges[1] <= inner])
        which, axes = np.nonzero(beside)
        return np.eye(2)[axes], edges[which, axes]


def window_around(image: NDArray[np.uint8], seed: tuple[float, float], half: float) -> Window:
    """The part of a photo (h, w, 3) within `half` pixels of a pixel along both axes."""
    height, width = image.shape[:2]
    left, right = max(0, int(seed[0] - half)), min(width, int(seed[0] + half) + 1)
    top, bottom = max(0, int(seed[1] - half)), min(height, int(seed[1] + half) + 1)
    part = Image.fromarray(image[top:bottom, left:right])
    factor = max(1, round(max(part.size) / WINDOW_PIXELS))
    values = np.asarray(part.reduce(factor) if factor > 1 else part)
    return Window(values, factor, np.array([left, top], dtype=np.float64))


def smooth_lab(values: NDArray[np.uint8]) -> Floats:
    """Colors (h, w, 3) in CIELAB, smoothed for gradients."""
    return np.asarray(ndimage.gaussian_filter(lab_of(values), (BLUR_PX, BLUR_PX, 0.0)))


def edges_of(values: NDArray[np.uint8]) -> Edges:
    """The edges of a picture (h, w, 3): ridges of the gradient of its color (Di Zenzo 1986)."""
    lab = smooth_lab(values)
    across, down = ndimage.sobel(lab, axis=1), ndimage.sobel(lab, axis=0)
    xx, yy, xy = (across**2).sum(axis=2), (down**2).sum(axis=2), (across * down).sum(axis=2)
    normals = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    strength = np.sqrt(0.5 * (xx + yy + np.hypot(xx - yy, 2.0 * xy)))
    rows, columns = np.mgrid[: strength.shape[0], : strength.shape[1]]
    step = np.stack([np.sin(normals), np.cos(normals)])
    here = np.stack([rows, columns])
    ahead, behind = (ndimage.map_coordinates(strength, here + sign * step, order=1, mode="nearest") for sign in (1, -1))
    least = max(LEAST_GRADIENT, float(np.percentile(strength, FLAT_FRACTION)))
    return Edges((strength >= ahead) & (strength > behind) & (strength > least), normals)


def straight_lines(edges: Edges) -> Lines:
    """The lines along which most edges lie, at most `MOST_LINES` (Hough's transform, by the edges' own directions)."""
    reach = int(np.hypot(*edges.there.shape)) + 2
    votes = ndimage.gaussian_filter(_votes(edges, reach), (0.7, 1.0), mode=("wrap", "constant"))
    peaks = np.argwhere((votes == ndimage.maximum_filter(votes, 5, mode=("wrap", "constant"))) & (votes > 0.0))
    kept = peaks[np.argsort(-votes[tuple(peaks.T)], kind="stable")[:MOST_LINES]]
    angles = kept[:, 0] * np.pi / ANGLES
    normals, offsets = np.stack([np.cos(angles), np.sin(angles)], axis=1), (kept[:, 1] - reach).astype(np.float64)
    return Lines(normals, offsets, _edge_counts(edges, angles, normals, offsets, reach))


def _votes(edges: Edges, reach: int) -> Array:
    """How many edges lie along each direction and offset, (ANGLES, 2 reach)."""
    rows, columns = np.nonzero(edges.there)
    own = np.round((edges.normals[edges.there] % np.pi) / np.pi * ANGLES).astype(np.intp)
    votes = np.zeros((ANGLES, 2 * reach))
    for turn in range(-SPREAD, SPREAD + 1):
        bins = (own + turn) % ANGLES
        angles = bins * np.pi / ANGLES
        offsets = np.round(columns * np.cos(angles) + rows * np.sin(angles)).astype(np.intp) + reach
        votes += np.bincount(bins * 2 * reach + offsets, minlength=votes.size).reshape(votes.shape)
    return votes


def _edge_counts(edges: Edges, angles: Array, normals: Array, offsets: Array, reach: int) -> Array:
    """The counts of `Lines.edge_counts`."""
    distance, (rows, columns) = ndimage.distance_transform_edt(~edges.there, return_indices=True)
    along = np.arange(-reach, reach + 1)
    x = offsets[:, None] * normals[:, :1] - along * normals[:, 1:]
    y = offsets[:, None] * normals[:, 1:] + along * normals[:, :1]
    height, width = edges.there.shape
    column, row = np.round(x).astype(np.intp), np.round(y).astype(np.intp)
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    column, row = np.clip(column, 0, width - 1), np.clip(row, 0, height - 1)
    nearest = edges.normals[rows[row, column], columns[row, column]]
    turned = np.abs((nearest - angles[:, None] + np.pi / 2) % np.pi - np.pi / 2)
    shows = inside & (distance[row, column] <= NEAR_PX) & (turned <= np.radians(ALONG_DEG))
    return np.concatenate([np.zeros((len(angles), 1)), np.cumsum(shows, axis=1)], axis=1)
