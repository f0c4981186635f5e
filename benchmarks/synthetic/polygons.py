"""Random polygons: shapes that no template has, none of them symmetric but by chance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VERTICES = (4, 9)
"""Fewest and most vertices."""

RADII = (0.35, 1.0)
"""Distances of the vertices from the point that sees them all, shares of the largest."""

EVENNESS = 0.7
"""How far a vertex may lie from its even place, as a share of the turn to the next: vertices stay in order."""


def random_polygon(rng: np.random.Generator, longer_side: float = 1.0) -> Array:
    """(n, 2) star-shaped ring, counter-clockwise in (x, y), of that longer side, its area's centroid at 0."""
    count = int(rng.integers(VERTICES[0], VERTICES[1] + 1))
    places = np.arange(count) + EVENNESS * (rng.random(count) - 0.5) + rng.uniform(0.0, count)
    angles = 2.0 * np.pi * places / count
    radii = rng.uniform(*RADII, size=count)
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None]
    ring *= longer_side / np.ptp(ring, axis=0).max()
    after = np.roll(ring, -1, axis=0)
    areas = 0.5 * (ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0])
    centered: Array = ring - (areas[:, None] * (ring + after) / 3.0).sum(axis=0) / areas.sum()
    return centered
