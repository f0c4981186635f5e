"""A region of the 3D data: its plane and outline, its surface, or what a scan knows of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.validation.arrays import (
    Array,
    check_coordinates,
    counter_clockwise,
    real_array,
    ring_list,
    row_array,
    signed_area,
)

PLANE_FRACTION = 0.01
"""Distance of a vertex from the common plane of polygons, over their extent, up to which they count as planar."""

OVERLAP_FRACTION = 1e-9
"""Fraction of the polygons' area up to which it may differ from the region's: rounding alone."""


class TriangleMesh(Protocol):
    """What `WorldRegion.from_mesh` reads; trimesh.Trimesh is one."""

    vertices: ArrayLike
    faces: ArrayLike


Given = ArrayLike | list[Array]


class Step(NamedTuple):
    """A function of the core that made a region, or a method of it, and what it was given.

    Its own arrays are rounded: a region made from them would differ in the last digits.
    """

    name: str
    given: tuple[Given, ...]
    options: dict[str, bool]


@dataclass(frozen=True, eq=False, repr=False)
class WorldRegion:
    """A region of the 3D data: a planar patch with holes, or an open triangulated surface; or samples of a patch."""

    core: _core.WorldRegion
    steps: tuple[Step, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what one of the constructors takes."""
        if not isinstance(self.core, _core.WorldRegion):
            raise ValueError(
                f"found {type(self.core).__name__}; needed WorldRegion.from_polygon (corners), from_points (points on"
                " the region), from_scan (a scan with its members) or from_mesh"
            )

    @classmethod
    def from_polygon(cls, rings: ArrayLike | Sequence[ArrayLike]) -> WorldRegion:
        """The planar region inside the first ring and outside the others.

        Parameters
        ----------
        rings : (n, 3) array or sequence of such
            Meters, turning either way; the vertices are moved onto their least squares plane.

        Raises
        ------
        ValueError
            For fewer than 3 vertices, values that are not finite, a vertex farther from the plane than 1 % of the
            extent, crossing edges, no area, or a hole that is not inside the first ring.

        Examples
        --------
        >>> import regionpose as rp
        >>> rp.WorldRegion.from_polygon([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]])
        WorldRegion(area=2, vertices=4)
        """
        return cls._from_core("from_rings", ring_list(rings, 3))

    @classmethod
    def from_polygons(cls, polygons: Sequence[Sequence[ArrayLike]]) -> WorldRegion:
        """The planar region of several polygons apart from one another.

        Parameters
        ----------
        polygons : sequence of sequences of (n, 3) arrays
            Each a list of rings as in `from_polygon`, meters; the vertices are moved onto one least squares plane.

        Raises
        ------
        ValueError
            As of `from_polygon`, a message about one polygon begins with its number; for vertices farther from the
            common plane than 1 % of the extent, and for polygons that overlap.
        """
        parts = _polygon_list(polygons)
        origin, axes = _common_plane(parts)
        flat = [[counter_clockwise((ring - origin) @ axes.T) for ring in rings] for rings in parts]
        region = cls._on_plane(origin, axes, [ring for rings in flat for ring in rings])
        given = sum(signed_area(outer) - sum(map(signed_area, holes)) for outer, *holes in flat)
        # Nesting decides what is a hole: a polygon inside another would become one.
        if region.area < (1.0 - OVERLAP_FRACTION) * given:
            raise ValueError(
                f"polygons of {given:.6g} m^2 cover {region.area:.6g} m^2; needed ones apart from one another"
            )
        return region

    @classmethod
    def from_points(
        cls,
        points: ArrayLike,
        *,
        radius_m: float | None = None,
        correct_sampling: bool = True,
        sensor_origin: ArrayLike | None = None,
    ) -> WorldRegion:
        """The planar region that points sample: their robust plane and the outline of the patch.

        The outline is an alpha shape. A patch ends between its last sample and the next, which missed it.

        Parameters
        ----------
        points : (n, 3) array
            Meters.
        radius_m : float, optional
            Of the alpha shape; chosen from the spacing of the points when None.
        correct_sampling : bool
            Grow the outline to where the patch ends (default), or have it run through the outermost points.
        sensor_origin : (3,) array, optional
            The scanner's position; range noise moves the points along their beams alone then.

        Raises
        ------
        ValueError
            For fewer than 3 points, values that are not finite, points that are identical, on one line or on a single
            scan line, or a radius that is not positive.

        Warns
        -----
        SparseSamplingWarning
            Where the samples are too sparse to show the outline.
        """
        # Outlines need scipy and shapely, which polygons do without: they take longer to load than a pose to estimate.
        from regionpose.regions.outline import outline_of_points

        outline = outline_of_points(
            points, radius_m=radius_m, correct_sampling=correct_sampling, sensor_origin=sensor_origin
        )
        return cls._on_plane(outline.origin, outline.axes, outline.rings)

    @classmethod
    def from_samples(cls, inside: ArrayLike, outside: ArrayLike) -> WorldRegion:
        """The planar region of which some places are known to be inside, and others to be outside of it.

        The pose is then the mean of those that show each place on its side of the image's contour (docs/math.md,
        section 17); the outline around the places inside is a start.

        Parameters
        ----------
        inside : (n, 3) array
            Meters; the plane is theirs.
        outside : (m, 3) array
            Meters.

        Raises
        ------
        ValueError
            As of `from_points`, for no place outside, and for one off the plane by more than a tenth of the extent.
        """
        from regionpose.regions.plane_samples import plane_samples
        from regionpose.regions.scan_samples import enclosed

        beside = row_array(outside, "outside", 3)
        if not len(beside):
            raise ValueError(f"outside has shape {beside.shape}; needed (n, 3) with at least one place")
        check_coordinates(beside, "outside point")
        plane = plane_samples(inside)
        region = cls._on_plane(plane.origin, plane.axes, _start_outline(plane.flat)[0])
        within = enclosed(plane.flat, (beside - plane.origin) @ plane.axes[:2].T)
        inside = plane.origin + plane.flat @ plane.axes[:2]
        return region._derived("with_samples", inside, beside[~within], beside[within])

    @classmethod
    def from_scan(
        cls,
        points: ArrayLike,
        members: ArrayLike,
        *,
        sensor_origin: ArrayLike | None = None,
        extends: bool = False,
        absent_beams: ArrayLike | None = None,
    ) -> WorldRegion:
        """The planar region of some returns of a scan, and what the scan shows beside it.

        A beam that ended beyond the plane passed it at a place outside of the region; so is a return on the plane that
        is no member, unless it joins members without a gap and the region `extends` there. Beams that ended before the
        plane are no evidence. Where the returns on the plane don't surround the region, or nothing is known beside it,
        it is that of `from_points`. What the places beside it leave open, as before the sky, the outline of its returns
        constrains the pose as far as it is good.

        Members on a single scan line show a line of the region's plane alone. With `sensor_origin`, what the scan knows
        along it counts: where the region begins and ends there. A pose needs other regions beside it.

        Parameters
        ----------
        points : (n, 3) array
            The whole scan, meters.
        members : (k,) array of int
            Indices of the region's returns, as `grow_plane` and `find_planes` give them.
        sensor_origin : (3,) array, optional
            The scanner's position, meters; without it only the returns on the plane count.
        extends : bool
            Whether the region may go on beyond its members; False by default.
        absent_beams : (j, 3) array, optional
            Directions of the scan's beams that gave no return, as of `absent_beams`: they passed the plane,
            too, where it would have sent one. They count with `sensor_origin` alone.

        Raises
        ------
        ValueError
            For indices that are no members of the scan, directions without a length, and as of `from_points`.
        """
        from regionpose.regions.outline import warn_of_sampling
        from regionpose.regions.plane_samples import plane_samples
        from regionpose.regions.scan_line import line_samples
        from regionpose.regions.scan_samples import scan_samples

        cloud = row_array(points, "points", 3)
        check_coordinates(cloud)
        numbers = _member_array(members, len(cloud))
        absent = None if absent_beams is None else _unit_vectors(absent_beams, "absent_beams")
        line = line_samples(cloud, numbers, sensor_origin, extends, absent)
        if line is not None:
            strip = cls._on_plane(line.plane.origin, line.plane.axes, [line.strip])
            return strip._derived("with_samples", *line.plane.lifted(line.samples), is_line=True)
        plane = plane_samples(cloud[numbers], sensor_origin)
        rings, remarks = _start_outline(plane.flat)
        samples = scan_samples(cloud, numbers, plane, rings, sensor_origin, extends, absent)
        if samples is None:
            for remark in remarks:
                warn_of_sampling(remark)
            return cls._on_plane(plane.origin, plane.axes, rings)
        return cls._on_plane(plane.origin, plane.axes, rings)._derived("with_samples", *plane.lifted(samples))

    @classmethod
    def _on_plane(cls, origin: Array, axes: Array, rings: list[Array]) -> WorldRegion:
        return cls._from_core("from_outline", origin, axes[:2], rings)

    @classmethod
    def from_mesh(cls, mesh: TriangleMesh) -> WorldRegion:
        """The region covered by an open triangle mesh, planar or not; it must not hide itself from the camera.

        Parameters
        ----------
        mesh : TriangleMesh
            With `vertices` (n, 3), meters, and `faces` or `triangles` (k, 3), as of trimesh and Open3D.

        Raises
        ------
        ValueError
            For a closed mesh, inconsistent triangles, or crossing boundaries.
        """
        vertices, faces = mesh_parts(mesh)
        return cls._from_core("from_mesh", vertices, faces)

    def with_viewpoint(self, viewpoint: ArrayLike) -> WorldRegion:
        """The same region, of which a point lies on the side that the camera sees.

        Such as the place of the scanner that saw the region, if it stood on the camera's side. Of a surface that is not
        planar the mean plane's side counts.

        Parameters
        ----------
        viewpoint : (3,) array
            Meters.

        Raises
        ------
        ValueError
            For a point that is on no side, within 0.06 deg of the plane.
        """
        return self._derived("with_viewpoint", viewpoint)

    @property
    def viewpoint(self) -> Array | None:
        """A point (3,) on the side that the camera sees; None where it may be either."""
        return self.core.viewpoint

    @property
    def samples(self) -> tuple[Array, Array] | None:
        """Places (n, 3) inside the region and (m, 3) outside of it; None where the outline alone is known.

        Those outside that the region encloses come last; they count where the image's region has a hole, too.
        """
        samples = self.core.samples
        return None if samples is None else (samples[0], np.concatenate(samples[1:]))

    @property
    def is_line(self) -> bool:
        """Whether it is given by one scan line alone: its plane is any through that line."""
        return self.core.is_line

    @property
    def rings(self) -> list[Array]:
        """Boundary rings, (n, 3) each; of a line, a strip about it that faces the scanner."""
        return self.core.rings

    @property
    def normal(self) -> Array:
        """Unit normal of the plane, (3,); its side is arbitrary. Of a line, that of the strip."""
        return np.asarray(self.core.axes[2])

    @property
    def area(self) -> float:
        """Area in square meters, of a surface its projection along the normal."""
        return self.core.area

    @property
    def is_planar(self) -> bool:
        """Whether the region lies in one plane."""
        return self.core.is_planar

    def __repr__(self) -> str:
        """Area, square meters, and numbers of vertices and samples."""
        samples = self.samples
        details = "" if samples is None else f", samples={len(samples[0])} inside, {len(samples[1])} outside"
        details += ", is_line=True" if self.is_line else ""
        return f"WorldRegion(area={self.area:.6g}, vertices={sum(map(len, self.rings))}{details})"

    @classmethod
    def _from_core(cls, name: str, *given: Given) -> WorldRegion:
        """The region that a function of the core makes."""
        return _replayed((Step(name, tuple(map(_copied, given)), {}),))

    def _derived(self, name: str, *given: Given, **options: bool) -> WorldRegion:
        """What a method of the core makes of it."""
        return _replayed((*self.steps, Step(name, tuple(map(_copied, given)), options)))

    def __reduce__(self) -> tuple[Callable[..., WorldRegion], tuple[object, ...]]:
        """What pickling keeps."""
        return _replayed, (self.steps,)

    def __deepcopy__(self, _: object) -> WorldRegion:
        """Itself: nothing of it changes."""
        return self


def mesh_parts(mesh: object) -> tuple[Array, NDArray[Any]]:
    """Vertices (n, 3) and triangles (k, 3) of a mesh of trimesh, Open3D or `Cloud`; ValueError for what has none."""
    for points, triangles in (("vertices", "faces"), ("vertices", "triangles"), ("points", "triangles")):
        if getattr(mesh, points, None) is not None and getattr(mesh, triangles, None) is not None:
            vertices = real_array(getattr(mesh, points), f"mesh.{points}", "(n, 3)").astype(np.float64)
            return vertices, real_array(getattr(mesh, triangles), f"mesh.{triangles}", "(k, 3)")
    raise ValueError(f"mesh is a {type(mesh).__name__}; needed one with vertices (n, 3) and faces (k, 3)")


def _replayed(steps: tuple[Step, ...]) -> WorldRegion:
    """The region after some steps."""
    core: Any = _core.WorldRegion
    for step in steps:
        core = getattr(core, step.name)(*step.given, **step.options)
    return WorldRegion(core, steps)


def _copied(given: Given) -> Given:
    """A copy of an array, or of several."""
    return [np.array(each) for each in given] if isinstance(given, list) else np.array(given)


def _start_outline(flat: Array) -> tuple[list[Array], list[str]]:
    """The outline of samples (n, 2), and what is to be warned of unless they count themselves: how sparse they are is
    no matter then.
    """
    from regionpose.regions.outline import flat_outline, sparse_sampling_handler

    remarks: list[str] = []
    with sparse_sampling_handler(remarks.append):
        return flat_outline(flat), remarks


def _unit_vectors(values: ArrayLike, name: str) -> Array:
    """Directions (n, 3) of length one; ValueError for one without a length."""
    ways = row_array(values, name, 3)
    check_coordinates(ways, f"{name} direction")
    lengths = np.linalg.norm(ways, axis=1)
    if not lengths.all():
        raise ValueError(f"{name} direction {int(np.argmin(lengths))} is zero; needed directions of some length")
    units: Array = ways / lengths[:, None]
    return units


def _member_array(members: ArrayLike, count: int) -> NDArray[np.intp]:
    numbers = np.asarray(members)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ValueError(f"members has shape {numbers.shape} and type {numbers.dtype}; needed indices (k,)")
    wrong = np.flatnonzero((numbers < 0) | (numbers >= count))
    if len(wrong):
        raise ValueError(f"member {wrong[0]} is {numbers[wrong[0]]}; needed an index from 0 to {count - 1}")
    is_member = np.zeros(count, dtype=np.bool_)
    is_member[numbers] = True
    return np.flatnonzero(is_member)


def _polygon_list(polygons: object) -> list[list[Array]]:
    """Rings (n, 3) of each polygon; ValueError that names the one that is none."""
    if isinstance(polygons, str | bytes | Mapping) or not isinstance(polygons, Iterable):
        raise ValueError(f"polygons is a {type(polygons).__name__}; needed a list of polygons, each a list of rings")
    parts = []
    for index, polygon in enumerate(polygons):
        try:
            parts.append(ring_list(polygon, 3))
            _core.WorldRegion.from_rings(parts[-1])
        except ValueError as error:
            raise ValueError(f"polygon {index}: {error}") from error
    if not parts:
        raise ValueError("polygons is empty; needed at least one list of (n, 3) rings")
    return parts


def _common_plane(parts: list[list[Array]]) -> tuple[Array, Array]:
    """Origin (3,) and axes (2, 3) of the least squares plane of the polygons' vertices."""
    vertices = np.concatenate([ring for rings in parts for ring in rings])
    origin = vertices.mean(axis=0)
    axes = np.linalg.svd(vertices - origin, full_matrices=False)[2]
    limit = PLANE_FRACTION * float(np.ptp(vertices, axis=0).max())
    for index, rings in enumerate(parts):
        off = float(np.abs((np.concatenate(rings) - origin) @ axes[2]).max())
        if off > limit:
            raise ValueError(f"polygon {index} lies {off:.6g} m off the common plane; needed at most {limit:.6g} m")
    return origin, axes[:2]
