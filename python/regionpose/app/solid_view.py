"""The cloud in 3D for a browser: a sample of its points as one buffer, and the full cloud's point that a ray meets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from regionpose.segment.cloud import nearest_to_ray
from regionpose.validation.arrays import Array

Bytes = NDArray[np.uint8]
Indices = NDArray[np.int64]

MOST_SHOWN = 400_000
"""Points of the sample: what a browser without a graphics card turns smoothly, 6.4 MB."""

CELLS_ACROSS = 256
"""Cells along the longest side of the cloud, so that a ray passes by few points of the others."""


def sample_indices(count: int, seed: int = 0) -> Indices:
    """Indices, ascending, of the points of a cloud of `count` that are shown: all, or a random part."""
    if count <= MOST_SHOWN:
        return np.arange(count, dtype=np.int64)
    return np.sort(np.random.default_rng(seed).choice(count, MOST_SHOWN, replace=False))


def point_buffer(points: Array, middle: Array) -> bytes:
    """Points (n, 3) about `middle` as float32, as the page reads them."""
    return np.ascontiguousarray(points - middle, dtype="<f4").tobytes()


@dataclass(frozen=True, eq=False)
class RayIndex:
    """The points of a cloud by cells, so that a ray asks those beside it alone.

    `points`: (n, 3). `order`: their indices by cell. `starts`: where each cell begins in it. `middles`: (k, 3).
    `radius`: of the balls around the cells.
    """

    points: Array
    order: Indices
    starts: Indices
    middles: Array
    radius: float

    @classmethod
    def of(cls, points: Array) -> Self:
        """The index of points (n, 3)."""
        low, high = points.min(axis=0), points.max(axis=0)
        side = max(float((high - low).max()) / CELLS_ACROSS, 1e-9)
        cells = ((points - low) / side).astype(np.int64)
        keys = (cells[:, 0] * (CELLS_ACROSS + 1) + cells[:, 1]) * (CELLS_ACROSS + 1) + cells[:, 2]
        order = np.argsort(keys, kind="stable")
        starts = np.flatnonzero(np.diff(keys[order], prepend=-1))
        middles = low + (cells[order[starts]] + 0.5) * side
        return cls(points, order, starts, middles, float(np.sqrt(0.75)) * side)

    def nearest(self, origin: Array, direction: Array) -> int:
        """Index of the point that a ray meets first, as of `nearest_to_ray`; ValueError where none lies ahead."""
        candidates = self._beside(origin, direction)
        return int(candidates[nearest_to_ray(self.points[candidates], origin, direction)])

    def _beside(self, origin: Array, direction: Array) -> Indices:
        """Points of the cells that may hold what `nearest_to_ray` looks for: within twice the least angle."""
        ahead = direction / np.linalg.norm(direction)
        offsets = self.middles - origin
        depth = offsets @ ahead
        off = np.sqrt(np.maximum(np.sum(offsets**2, axis=1) - depth**2, 0.0))
        # The largest angle to a point of the cell that is seen under the least one bounds what is looked for.
        sure = depth > 2.0 * self.radius
        if not sure.any():
            return np.arange(len(self.points), dtype=np.int64)
        least = float(np.min((off[sure] + self.radius) / (depth[sure] - self.radius)))
        near = (depth + self.radius > 0.0) & (off - self.radius <= 2.0 * least * (depth + self.radius))
        ends = np.append(self.starts[1:], len(self.order))
        beside = [self.order[start:end] for start, end in zip(self.starts[near], ends[near], strict=True)]
        # A cloud has three points at least; what lies off the ray doesn't change what it meets.
        return np.unique(np.concatenate([*beside, self.order[:3]]))
