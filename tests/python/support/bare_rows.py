"""Rows of bare numbers as lidars of several kinds give them: a street of ground and walls, scanned."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BEAMS = 32


def scanned_rows(count: int, *extra: str, seed: int = 0, interleaved: bool = False) -> NDArray[np.float32]:
    """Rows (count, 3 + extra columns) of x, y, z and the named: beam after beam, or interleaved as they fire."""
    random = np.random.default_rng(seed)
    order = np.arange(count)
    ring = order % BEAMS if interleaved else order * BEAMS // count
    azimuth = 2.0 * np.pi * (order // BEAMS * BEAMS if interleaved else order * BEAMS % count) / count
    elevation = np.radians(-25.0 + 35.0 * ring / BEAMS)
    wall = 8.0 / np.maximum(np.abs(np.sin(azimuth + 0.1)), 0.15) * random.choice([0.7, 1.0], count)
    ground = np.where(elevation < 0.0, 1.8 / np.maximum(-np.tan(elevation), 0.02), np.inf)
    distance = np.minimum(wall, ground) + random.normal(0.0, 0.02, count)
    columns: dict[str, NDArray[Any]] = {
        "x": distance * np.cos(azimuth),
        "y": distance * np.sin(azimuth),
        "z": distance * np.tan(elevation),
        "intensity": random.beta(1.0, 4.0, count),
        "reflectivity": np.floor(255.0 * random.beta(1.0, 4.0, count)),
        "zero": np.zeros(count),
        "one": np.ones(count),
        "ring": ring,
        "time": 0.1 * order / count,
        "elongation": random.exponential(0.05, count),
        "stamp": np.full(count, 1.5e3),
        **dict(zip(("red", "green", "blue"), random.integers(0, 256, (3, count)), strict=True)),
    }
    normals = random.normal(size=(3, count))
    columns |= dict(zip(("nx", "ny", "nz"), normals / np.linalg.norm(normals, axis=0), strict=True))
    return np.column_stack([columns[name] for name in ("x", "y", "z", *extra)]).astype("<f4")
