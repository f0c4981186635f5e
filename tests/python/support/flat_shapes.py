"""Flat shapes that tests of regions share."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]


def disc(radius: float, center: tuple[float, float], corners: int = 400) -> Array:
    """A regular polygon, by default as good as a circle."""
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return np.add(center, radius * np.column_stack([np.cos(angles), np.sin(angles)]))


def polygon_of(rings: list[Array] | tuple[Array, ...]) -> BaseGeometry:
    """The region under the even-odd rule."""
    shape: BaseGeometry = shapely.Polygon()
    for ring in rings:
        shape = shape.symmetric_difference(shapely.Polygon(ring))
    return shape


def centroid(rings: list[Array] | tuple[Array, ...]) -> Array:
    return np.array(shapely.centroid(polygon_of(rings)).coords[0])


def area(rings: list[Array] | tuple[Array, ...]) -> float:
    return float(polygon_of(rings).area)
