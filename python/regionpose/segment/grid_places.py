"""Pixels of places among and beyond the corners of a grid, however a lens bends it."""

from __future__ import annotations

import numpy as np

from regionpose.validation.arrays import Array


def placed(grid: Array, cells: Array) -> Array:
    """Pixels (..., 2) of places (..., 2), rows and columns, of a grid of corners (rows, columns, 2).

    Parabolas through the three nearest corners of each direction: the second order of perspective and of distortion. A
    square beyond the grid the corners' noise is 4 times as large, two squares beyond 10 times. A grid has 3 corners
    along each side at the least.
    """
    across, along = (_weights(cells[..., k], grid.shape[k]) for k in (0, 1))
    return np.asarray(np.einsum("...a,...b,abk->...k", across, along, grid, optimize=True))


def _weights(places: Array, count: int) -> Array:
    """Weights (..., count) of evenly spaced values at places among and beyond them."""
    middle = np.clip(np.round(places), 1, count - 2)
    off = places - middle
    parts = np.stack([off * (off - 1.0) / 2.0, 1.0 - off**2, off * (off + 1.0) / 2.0], axis=-1)
    which = (middle[..., None] + (-1, 0, 1)).astype(np.intp)
    weights = np.zeros((*places.shape, count))
    np.put_along_axis(weights, which, parts, axis=-1)
    return weights
