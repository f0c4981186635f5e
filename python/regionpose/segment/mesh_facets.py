"""Planar facets of a triangle mesh, such as the faces of a CAD model, as world regions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from regionpose.regions.world import TriangleMesh, WorldRegion, mesh_parts
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array

Indices = NDArray[np.intp]

WELD_FRACTION = 1e-7
"""Vertices closer than this fraction of the mesh's extent are one: files of triangles repeat each one to seven
digits."""

STRAIGHT_FRACTION = 1e-6
"""Vertices of an outline are left out where this fraction of the extent is all that they bend it by."""

FLAT_FRACTION = 1e-3
"""A facet's vertices lie within this fraction of the mesh's extent of the plane of its largest triangle."""


@checked_arguments
def regions_from_mesh(
    mesh: TriangleMesh, *, angle_deg: float = 1.0, min_area_fraction: float = 0.01
) -> list[WorldRegion]:
    """The planar facets of a mesh as regions, the largest first.

    A facet is grown from its largest triangle over shared edges. Of a closed mesh each region is seen from outside
    alone (`WorldRegion.with_viewpoint`); of an open one the side is left open.

    Parameters
    ----------
    mesh : TriangleMesh
        With `vertices` (n, 3), meters, and `faces` or `triangles` (k, 3), as of trimesh and Open3D; or a `Cloud` with
        triangles.
    angle_deg : float
        Largest angle between a triangle and the facet's largest one.
    min_area_fraction : float
        Facets below this fraction of the mesh's area are left out.

    Returns
    -------
    list of WorldRegion
        Their holes are kept.

    Raises
    ------
    ValueError
        For arrays of another shape, indices that aren't there, an angle or a fraction out of range, and where no facet
        is left.
    """
    if not 0.0 < angle_deg < 90.0:
        raise ValueError(f"angle_deg is {angle_deg}; needed an angle above 0 and below 90")
    if not 0.0 <= min_area_fraction <= 1.0:
        raise ValueError(f"min_area_fraction is {min_area_fraction}; needed a fraction")
    vertices, given = mesh_parts(mesh)
    triangles = np.asarray(given, dtype=np.intp)
    if not triangles.size or triangles.min() < 0 or triangles.max() >= len(vertices):
        raise ValueError(f"mesh has triangles of {len(vertices)} vertices that aren't there; needed indices below that")
    triangles = _welded(vertices, triangles)
    shapes = _Triangles.of(vertices, triangles)
    facets = [
        _Facet.of(vertices, shapes, members) for members in _grown(vertices, shapes, np.cos(np.radians(angle_deg)))
    ]
    least = min_area_fraction * shapes.areas.sum()
    kept = sorted((facet for facet in facets if facet.area >= least), key=lambda facet: -facet.area)
    if not kept:
        raise ValueError(
            f"mesh has {len(facets)} facets, none of {min_area_fraction:.2g} of its area; needed a larger one"
        )
    outward = _outward_sign(vertices, shapes.corners)
    return [facet.region(outward) for facet in kept]


class _Triangles(NamedTuple):
    """Triangles with an area: corners (k, 3), unit normals (k, 3), areas (k,)."""

    corners: Indices
    normals: Array
    areas: Array

    @classmethod
    def of(cls, vertices: Array, corners: Indices) -> _Triangles:
        a, b, c = (vertices[corners[:, column]] for column in range(3))
        crossed = np.cross(b - a, c - a)
        doubled = np.linalg.norm(crossed, axis=1)
        flat = doubled > 0.0
        return cls(corners[flat], crossed[flat] / doubled[flat, None], 0.5 * doubled[flat])


class _Facet(NamedTuple):
    """An outline on a plane: its polygon in the axes (2, 3) about an origin (3,), and the normal of its triangles."""

    origin: Array
    axes: Array
    normal: Array
    polygon: Any

    @property
    def area(self) -> float:
        return float(self.polygon.area)

    @classmethod
    def of(cls, vertices: Array, shapes: _Triangles, members: Indices) -> _Facet:
        normal = shapes.areas[members] @ shapes.normals[members]
        normal /= np.linalg.norm(normal)
        corners = vertices[shapes.corners[members]]
        origin = corners.reshape(-1, 3).mean(axis=0)
        along = corners[0, 1] - corners[0, 0]
        along -= (along @ normal) * normal
        along /= np.linalg.norm(along)
        axes = np.stack([along, np.cross(normal, along)])
        flat = (corners - origin) @ axes.T
        whole = shapely.union_all(shapely.polygons(flat))
        # Triangles that touch in a corner alone are parts of their own: the largest is the facet.
        largest = max(shapely.get_parts(whole), key=lambda part: part.area)
        return cls(
            origin, axes, normal, shapely.simplify(largest, STRAIGHT_FRACTION * float(np.ptp(flat, axis=(0, 1)).max()))
        )

    def region(self, outward: float | None) -> WorldRegion:
        """The region, seen from the side of the normal times `outward` where that is given."""
        rings = (self.polygon.exterior, *self.polygon.interiors)
        region = WorldRegion.from_polygon([self.origin + np.asarray(ring.coords)[:-1] @ self.axes for ring in rings])
        if outward is None:
            return region
        return region.with_viewpoint(self.origin + outward * np.sqrt(self.area) * self.normal)


def _welded(vertices: Array, triangles: Indices) -> Indices:
    """The triangles by the first of the vertices that lie at one place."""
    extent = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    if extent == 0.0 or not np.isfinite(extent):
        raise ValueError(f"mesh has {len(vertices)} vertices with an extent of {extent:g}; needed finite ones apart")
    places = np.round(vertices / (WELD_FRACTION * extent))
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return np.asarray(first[inverse.ravel()][triangles])


def _edges(corners: Indices) -> Indices:
    """Directed edges (3 k, 2) of triangles, all first ones first."""
    return np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])


def _grown(vertices: Array, shapes: _Triangles, least_cosine: float) -> Iterator[Indices]:
    """The triangles of each facet."""
    neighbors = _neighbors(shapes.corners)
    distance = FLAT_FRACTION * float(np.ptp(vertices, axis=0).max())
    free = np.ones(len(shapes.corners), dtype=np.bool_)
    for seed in np.argsort(-shapes.areas, kind="stable").tolist():
        if not free[seed]:
            continue
        normal, place = shapes.normals[seed], vertices[shapes.corners[seed, 0]]
        members, waiting = [], [seed]
        free[seed] = False
        while waiting:
            members += waiting
            beside = np.array(
                sorted({other for one in waiting for other in neighbors[one] if free[other]}), dtype=np.intp
            )
            off = np.abs((vertices[shapes.corners[beside]] - place) @ normal).max(axis=1, initial=0.0)
            found = beside[(shapes.normals[beside] @ normal >= least_cosine) & (off <= distance)]
            free[found] = False
            waiting = found.tolist()
        yield np.array(members)


def _neighbors(corners: Indices) -> list[list[int]]:
    """For each triangle those that share an edge with it."""
    count = len(corners)
    edges = np.sort(_edges(corners), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order][1:] == edges[order][:-1]).all(axis=1)
    neighbors: list[list[int]] = [[] for _ in range(count)]
    for left, right in zip((order[:-1][same] % count).tolist(), (order[1:][same] % count).tolist(), strict=True):
        neighbors[left].append(right)
        neighbors[right].append(left)
    return neighbors


def _outward_sign(vertices: Array, corners: Indices) -> float | None:
    """1 where the normals of a closed mesh point outward, -1 where they point inward; None for an open one."""
    edges = _edges(corners)
    forth = {tuple(edge) for edge in edges.tolist()}
    if len(forth) < len(edges) or any((end, start) not in forth for start, end in forth):
        return None
    a, b, c = (vertices[corners[:, column]] - vertices[0] for column in range(3))
    return float(np.sign(np.einsum("ij,ij->", a, np.cross(b, c))))
