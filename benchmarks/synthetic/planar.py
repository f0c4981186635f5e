"""Geometry of planar regions given by (n, 3) rings: area vector, centroid, viewing angle, the plane's own frame.

Rings follow `scenes.SyntheticScene`: outer rings turn counter-clockwise in the image when the front is seen, holes
the other way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

Array = NDArray[np.float64]

# share of a region's area; smaller pieces are rounding leftovers of polygon operations, and dropped.
SLIVER_SHARE = 1e-9


def area_vector(rings: Sequence[Array]) -> Array:
    """(3,) normal of a planar region times its area, m^2: half the sum of cross products along its (n, 3) rings.

    Rings are oriented as in `SyntheticScene`, so that the vector points away from a camera that sees the front.
    """
    base = rings[0][0]
    total = np.zeros(3)
    for ring in rings:
        arms = ring - base
        total += 0.5 * np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)
    return total


def region_centroid(rings: Sequence[Array]) -> Array:
    """(3,) area centroid of a planar region given by (n, 3) rings, holes turning the other way."""
    base = rings[0][0]
    normal = area_vector(rings)
    area = float(np.linalg.norm(normal))
    weighted = np.zeros(3)
    for ring in rings:
        start, end = ring - base, np.roll(ring, -1, axis=0) - base
        weighted += (start + end).T @ (np.cross(start, end) @ (normal / area)) / 6.0
    centroid: Array = base + weighted / area
    return centroid


def view_angle(rings: Sequence[Array], rotation: Array, translation: Array) -> float:
    """Angle in degrees at the region's centroid between the line of sight and the direction its back faces.

    0 when the front is seen straight on, 90 edge-on, above 90 from behind.
    """
    sight = rotation @ region_centroid(rings) + translation
    normal = rotation @ area_vector(rings)
    cosine = sight @ normal / (np.linalg.norm(sight) * np.linalg.norm(normal))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def axes_across(normal: Array) -> Array:
    """(3, 2) orthonormal directions u, v with u x v along a vector (3,)."""
    unit = normal / np.linalg.norm(normal)
    first = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(unit, first)])


@dataclass(frozen=True)
class PlaneFrame:
    """A plane's own coordinates: `X = origin + axes @ (u, v)`, (3, 2) orthonormal axes, u x v along the area vector.

    The solver's plane has an arbitrary side; this one keeps the region's front, which scenes and noise need.
    """

    origin: Array
    axes: Array

    @classmethod
    def of_region(cls, rings: Sequence[Array]) -> PlaneFrame:
        """The frame with its origin at the region's centroid, in which outer rings turn counter-clockwise."""
        normal = area_vector(rings)
        area = float(np.linalg.norm(normal))
        if not area > 0.0:
            raise ValueError(f"the region's area is {area} m^2; a region with a positive area is needed")
        return cls(region_centroid(rings), axes_across(normal))

    def flat(self, points: Array) -> Array:
        """(n, 2) plane coordinates of (n, 3) points."""
        flat: Array = (points - self.origin) @ self.axes
        return flat

    def lifted(self, points: Array) -> Array:
        """(n, 3) points of (n, 2) plane coordinates."""
        lifted: Array = self.origin + points @ self.axes.T
        return lifted

    def polygon(self, rings: Sequence[Array]) -> shapely.MultiPolygon:
        """The region in plane coordinates."""
        return as_multipolygon(even_odd_shape([self.flat(ring) for ring in rings]))

    def rings(self, polygon: BaseGeometry) -> list[Array]:
        """(n, 3) rings of a polygon in plane coordinates: outer rings as in `of_region`, each followed by its holes."""
        rings = []
        for part in as_multipolygon(polygon).geoms:
            oriented = orient(part)
            rings += [self.lifted(np.asarray(ring.coords)[:-1]) for ring in (oriented.exterior, *oriented.interiors)]
        return rings


def even_odd_shape(rings: Sequence[Array]) -> BaseGeometry:
    """The region inside an odd number of the (n, 2) rings; a ring that crosses itself is mended first."""
    shape: BaseGeometry = shapely.Polygon()
    for ring in rings:
        shape = shape.symmetric_difference(shapely.make_valid(shapely.Polygon(ring)))
    return shape


def as_multipolygon(geometry: BaseGeometry) -> shapely.MultiPolygon:
    """The polygons of any geometry, without lines, points and slivers."""
    parts = [part for part in shapely.get_parts(geometry, return_index=False) if isinstance(part, shapely.Polygon)]
    least = SLIVER_SHARE * sum(part.area for part in parts)
    return shapely.MultiPolygon([part for part in parts if part.area > least])
