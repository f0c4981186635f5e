"""The two sides of the published equations: moments of what is observed and of what a pose predicts (paper eq. 5 to 8,
14, 15).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose import kernels
from regionpose.cameras import Camera

from benchmarks.published.moments import (
    Array,
    planar_monomials,
    spherical_monomials,
    spherical_triangle_moments,
    triangle_moments,
)

System = Literal["plane", "sphere"]
Integration = Literal["pixels", "mesh", "quadrature"]

SCHEMES: tuple[tuple[System, Integration], ...] = (
    ("plane", "pixels"),
    ("plane", "mesh"),
    ("sphere", "pixels"),
    ("sphere", "mesh"),
    ("sphere", "quadrature"),
)
"""What is built: the plane's triangles are integrated exactly, so that a quadrature rule is of the sphere alone."""

SPHERE_TRIANGLES = 500
"""Triangles a region at the least where a rule of the sphere integrates: its error falls with their size."""

QUADRATURE_SUBDIVISION = 2
"""Net of the subdivided rule: 4 parts a triangle."""

WORLD_CELLS = 10_000
"""Cells that a 3D region is divided into for pixel-wise sums: about 7 mm wide on the benchmark's templates."""

GRID_TURN = 0.5
"""Turn (rad) of the cells, so that no edge of a drawn shape runs along them: it would win or lose half a cell."""


class WorldSide(Protocol):
    """A 3D region that can be integrated over as seen from a pose."""

    def moments(self, rotation: Array, translation: Array, system: System) -> Array:
        """The right-hand side of the region's equations at the pose `camera_from_world`."""


@dataclass(frozen=True)
class MeshSide:
    """A region as (k, 3, 3) triangles, projected corner by corner (paper section 2.1, 2.2)."""

    vertices: Array
    triangles: NDArray[np.int64]
    subdivision: int = 1

    def moments(self, rotation: Array, translation: Array, system: System) -> Array:
        """Sums over the projected triangles (paper eq. 10, 16)."""
        points = self.vertices @ rotation.T + translation
        if system == "plane":
            return triangle_moments((points[:, :2] / points[:, 2:])[self.triangles])
        bearings = points / np.linalg.norm(points, axis=1, keepdims=True)
        return spherical_triangle_moments(bearings[self.triangles], self.subdivision)


@dataclass(frozen=True)
class CellSide:
    """A planar region as equal cells: centers (n, 3), the vector area (3,) of one; the paper's reference 46."""

    centers: Array
    cell: Array

    def moments(self, rotation: Array, translation: Array, system: System) -> Array:
        """Sums over the cells of value times projected area: `a . P / P_z^3` on the plane, `a . P / |P|^3` on the
        sphere, a being the cell's vector area.
        """
        points = self.centers @ rotation.T + translation
        depth = points[:, 2] if system == "plane" else np.linalg.norm(points, axis=1)
        seen = points / depth[:, None]
        areas = points @ (rotation @ self.cell) / depth**3
        values = planar_monomials(seen[:, :2]) if system == "plane" else spherical_monomials(seen)
        moments: Array = values @ areas
        return moments


def world_side(rings: Sequence[Array], system: System, integration: Integration) -> WorldSide:
    """A planar region of (n, 3) rings, divided for the scheme.

    The outer ring comes first and turns counter-clockwise in the image: the seen side is known, as in the paper.
    """
    plane = SeenPlane.of_rings(rings)
    flat = [plane.flat(ring) for ring in rings]
    if integration == "pixels":
        return CellSide(*plane.cells(flat))
    vertices, triangles = _mesh(flat, system, integration)
    subdivision = QUADRATURE_SUBDIVISION if integration == "quadrature" else 1
    return MeshSide(plane.lifted(vertices), triangles, subdivision)


def _mesh(rings: Sequence[Array], system: System, integration: Integration) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and triangles of flat rings: a plain Delaunay mesh where triangles are exact, else a fine one."""
    if system == "plane":
        return kernels.triangulate(rings)
    return kernels.triangulate(rings, max_area=_area(rings) / SPHERE_TRIANGLES)


def _area(rings: Sequence[Array]) -> float:
    return shapely.Polygon(rings[0], rings[1:]).area


@dataclass(frozen=True)
class SeenPlane:
    """A plane `X = origin + axes (u, v)`, axes (3, 2), in which the region's outer ring is counter-clockwise."""

    origin: Array
    axes: Array

    @classmethod
    def of_rings(cls, rings: Sequence[Array]) -> SeenPlane:
        """The plane of the first ring."""
        origin = rings[0].mean(axis=0)
        outer = rings[0] - origin
        normal = np.cross(outer, np.roll(outer, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal)
        first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        first /= np.linalg.norm(first)
        return cls(origin, np.column_stack([first, np.cross(normal, first)]))

    @property
    def normal(self) -> Array:
        """(3,) unit normal, away from the camera."""
        return np.cross(self.axes[:, 0], self.axes[:, 1])

    def flat(self, points: Array) -> Array:
        """(n, 2) plane coordinates of (n, 3) points."""
        flat: Array = (points - self.origin) @ self.axes
        return flat

    def lifted(self, points: Array) -> Array:
        """(n, 3) points of (n, 2) plane coordinates."""
        lifted: Array = self.origin + points @ self.axes.T
        return lifted

    def cells(self, rings: Sequence[Array]) -> tuple[Array, Array]:
        """Centers (n, 3) of the cells inside flat rings and the vector area (3,) of one."""
        turn = np.array([[np.cos(GRID_TURN), -np.sin(GRID_TURN)], [np.sin(GRID_TURN), np.cos(GRID_TURN)]])
        polygon = shapely.Polygon(rings[0] @ turn, [ring @ turn for ring in rings[1:]])
        size = np.sqrt(polygon.area / WORLD_CELLS)
        left, low, right, high = polygon.bounds
        u, v = np.meshgrid(np.arange(left + size / 2, right, size), np.arange(low + size / 2, high, size))
        centers = np.column_stack([u.ravel(), v.ravel()])
        centers = centers[shapely.contains_xy(polygon, centers)]
        return self.lifted(centers @ turn.T), self.normal * size**2


def observed_moments(camera: Camera, region: rp.ImageRegion, system: System, integration: Integration) -> Array:
    """The left-hand side of a region's equations: integrals over what the image shows (paper eq. 5, 14)."""
    if integration == "pixels":
        return _pixel_sums(camera, region, system)
    parts = _ring_groups(region.rings)
    moments: Array = np.sum([_observed_mesh(camera, rings, system, integration) for rings in parts], axis=0)
    return moments


def _observed_mesh(camera: Camera, rings: Sequence[Array], system: System, integration: Integration) -> Array:
    vertices, triangles = _mesh(rings, system, integration)
    bearings = camera.bearings(vertices)
    subdivision = QUADRATURE_SUBDIVISION if integration == "quadrature" else 1
    side = MeshSide(bearings, triangles, subdivision)
    return side.moments(np.eye(3), np.zeros(3), system)


def _ring_groups(rings: Sequence[Array]) -> list[list[Array]]:
    """Each outer ring followed by the holes inside it."""
    outers = [ring for ring in rings if shapely.LinearRing(ring).is_ccw]
    holes = [ring for ring in rings if not shapely.LinearRing(ring).is_ccw]
    return [[outer, *(hole for hole in holes if _inside(hole, outer))] for outer in outers]


def _inside(hole: Array, outer: Array) -> bool:
    return bool(shapely.Polygon(outer).contains(shapely.Point(hole[0])))


def _pixel_sums(camera: Camera, region: rp.ImageRegion, system: System) -> Array:
    """Sums over the mask's pixels of value times area element (paper eq. 6, 7; reference 46)."""
    if region.mask is None:
        raise ValueError("the image region is a polygon; pixel-wise sums need a region from a mask")
    pixels, coverage = region.mask.covered_pixels()
    bearings = camera.bearings(pixels)
    half = 0.5 * np.eye(2)
    across, down = (camera.bearings(pixels + step) - camera.bearings(pixels - step) for step in half)
    areas = np.linalg.norm(np.cross(across, down), axis=1) * coverage
    if system == "plane":
        # A patch of the sphere is 1 / z^3 as large on the plane z = 1.
        moments: Array = planar_monomials(bearings[:, :2] / bearings[:, 2:]) @ (areas / bearings[:, 2] ** 3)
        return moments
    moments = spherical_monomials(bearings) @ areas
    return moments
