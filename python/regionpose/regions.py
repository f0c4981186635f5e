"""The two sides of a region: its contour in the image and its shape in the world."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.hidden_edges import marked_edges, marked_lines, traced_beside
from regionpose.mask import MaskWindow, traced_mask
from regionpose.outline import SparseSamplingWarning, flat_outline, outline_of_points, plane_samples
from regionpose.pixel_edges import Border, border_lines, line_bearings, ring_bearings, seen_part, sides_of
from regionpose.scan_samples import scan_samples

Array = NDArray[np.float64]
Marks = NDArray[np.bool_]

ON_BORDER_PX = 1e-6
"""The contour of a mask that the border cuts runs along it, but for rounding."""

POLYGON_ON_BORDER_PX = 0.5
"""A polygon's edge within this distance (pixels) of the border was drawn along it: on the outermost centres, or half a
pixel outside of them."""

ALONG_BORDER = 0.5
"""Slope of an edge against the border up to which it runs along it; short ones that cross the border are steeper."""

PLANE_SHARE = 0.01
"""Distance of a vertex from the common plane of polygons, over their extent, up to which they count as planar."""

OVERLAP_SHARE = 1e-9
"""Share of the polygons' area up to which it may differ from the region's: rounding alone."""


class TriangleMesh(Protocol):
    """What `WorldRegion.from_mesh` reads; trimesh.Trimesh is one."""

    vertices: ArrayLike
    faces: ArrayLike


@dataclass(frozen=True, eq=False)
class ImageRegion:
    """A region of the image, bounded by closed rings of pixels (integer = pixel centre, x right, y down).

    `rings`: (n, 2) arrays, outer rings counter-clockwise in (x, y), holes the other way, the last vertex joined to
    the first.
    `mask`: the coverage that the rings were traced from, in its window of the image; None for a polygon.
    `border`: left, top, right and bottom of what the image shows, pixels: of a mask its own, half a pixel outside the
    outermost centres; None stands for the camera's.
    `hidden`: for each ring (n, 2), whether the edges that start at its vertices are hidden, (n,): edges of what stands
    before the region, or that nobody saw; None where none is.

    Edges of the rings along the border are not the region's own: they carry no weight, and the world region is
    compared cut at the border in the same way. Nor are hidden ones, behind which the region may go on: the pose is then
    that of the other edges alone (docs/math.md, section 14).
    """

    rings: tuple[Array, ...]
    mask: MaskWindow | None = None
    border: Border | None = None
    hidden: tuple[Marks, ...] | None = None

    @classmethod
    def from_polygon(
        cls,
        rings: ArrayLike | Sequence[ArrayLike],
        *,
        hidden_edges: Sequence[int] | Sequence[Sequence[int]] = (),
    ) -> ImageRegion:
        """The region inside the first ring and outside the others; vertices (n, 2) in pixels, turning either way.

        One (n, 2) array stands for one ring. Edges within half a pixel of a side of the camera's image count as on it,
        unless the region goes on beyond that side: it is then taken at its word. `hidden_edges`: indices of edges that
        are not the region's own but an occluder's, or were not seen; edge i of a ring goes from its vertex i to the
        next. Of several rings, a list of such lists. ValueError for a ring with fewer than 3 vertices, values that are
        not finite, crossing edges, no area, a hole that is not inside the first ring, or an edge that isn't there.
        """
        given = _ring_list(rings, 2)
        checked = tuple(_core.plane_rings(given, polygon=True))
        return cls(checked, hidden=marked_edges(given, checked, hidden_edges))

    @classmethod
    def from_mask(cls, mask: ArrayLike, *, unknown: ArrayLike | None = None) -> ImageRegion:
        """The region of a mask (h, w): bool, two-valued integers (0 and another), or coverage in [0, 1].

        The contour runs where the linearly interpolated coverage is 0.5, so that the edge of a binary mask lies midway
        between pixel centres; vertices within 0.01 px of a line are left out. A mask that meets the border of its array
        is cut there by the border of the image, half a pixel outside the outermost centres. `unknown` (h, w), bool or
        numbers that count where they aren't 0: pixels that may be the region's or not, whatever the mask says, such as
        an occluder's; the contour beside them is hidden. ValueError for another shape or type, a mask that is empty or
        wholly unknown, or values outside [0, 1].
        """
        if unknown is None:
            (rings, window), hidden = traced_mask(mask), None
        else:
            rings, window, hidden = traced_beside(mask, unknown)
        height, width = window.shape
        return cls(tuple(rings), window, (-0.5, -0.5, width - 0.5, height - 0.5), hidden)

    @cached_property
    def area(self) -> float:
        """Area in pixels."""
        return float(sum(_signed_area(ring) for ring in self.rings))

    @cached_property
    def _bounds(self) -> Border:
        """Left, top, right and bottom of the vertices, pixels."""
        vertices = self.rings[0] if len(self.rings) == 1 else np.concatenate(self.rings)
        left, top = np.minimum.reduce(vertices).tolist()
        right, bottom = np.maximum.reduce(vertices).tolist()
        return left, top, right, bottom

    def bearings(self, camera: Camera) -> list[Array]:
        """The rings as bearings (m, 3), split so that arcs between neighbours stay within 0.01 px of the pixel edges.

        Edges drawn along the border are moved onto it. ValueError where the camera sees no ray at a vertex.
        """
        return [ring_bearings(camera, ring, index) for index, ring in enumerate(self.rings_on_border(camera))]

    def rings_on_border(self, camera: Camera) -> Sequence[Array]:
        """The rings (n, 2), edges drawn along the border of the image moved onto it."""
        if self._is_clear_of(self._border(camera)):
            return self.rings
        return [self._on_sides(camera, ring)[0] for ring in self.rings]

    def on_border(self, camera: Camera) -> list[Marks]:
        """For each ring (n, 2), whether the edges that start at its vertices lie on the border of the image, (n,)."""
        return [np.any(self._on_sides(camera, ring)[1], axis=0) for ring in self.rings]

    def foreign_edges(self, camera: Camera) -> list[Marks]:
        """For each ring (n, 2), whether the edges that start at its vertices are not the region's own, (n,): they lie
        on the border of the image, or are hidden.
        """
        on_border = self.on_border(camera)
        return on_border if self.hidden is None else [a | b for a, b in zip(on_border, self.hidden, strict=True)]

    def hidden_bearings(self, camera: Camera) -> list[Array]:
        """The hidden edges as lines of bearings (m, 3), each as far as they go on; ValueError where the camera sees no
        ray.
        """
        if self.hidden is None:
            return []
        rings = zip(self.rings_on_border(camera), self.hidden, strict=True)
        lines = [line for ring, marks in rings for line in marked_lines(ring, marks)]
        return [line_bearings(camera, line, "a hidden edge") for line in lines]

    def border_bearings(self, camera: Camera) -> list[Array]:
        """The sides of the border along which the region is cut, as lines of bearings (m, 3).

        Sides that meet in a corner are one line, in the order of a counter-clockwise ring in (x, y). A line goes on
        beside the region, by the size of the region, as far as the camera sees rays; around the whole image it ends in
        its first bearing.
        """
        border = self._border(camera)
        if border is None or self._is_clear_of(border):
            return []
        sides = np.any([self._on_sides(camera, ring)[1].any(axis=1) for ring in self.rings], axis=0)
        if not sides.any():
            return []
        lines = border_lines(border, np.concatenate(self.rings), [bool(side) for side in sides])
        return [line_bearings(camera, part, "the image border") for line in lines for part in seen_part(camera, line)]

    def _border(self, camera: Camera) -> Border | None:
        if self.border is not None or camera.width is None or camera.height is None:
            return self.border
        return (-0.5, -0.5, camera.width - 0.5, camera.height - 0.5)

    @property
    def _within(self) -> float:
        """Distance from the border, pixels, up to which an edge may lie along it."""
        return POLYGON_ON_BORDER_PX if self.border is None else ON_BORDER_PX

    def _is_clear_of(self, border: Border | None) -> bool:
        """Whether all vertices are too far inside the border for an edge to lie along it."""
        if border is None or not self.rings:
            return True
        (left, top, right, bottom), within = self._bounds, self._within
        return min(left - border[0], top - border[1], border[2] - right, border[3] - bottom) > within

    def _on_sides(self, camera: Camera, ring: Array) -> tuple[Array, NDArray[np.bool_]]:
        """The ring with edges along the border moved onto it, and whether each edge lies on each side, (4, n)."""
        border, within = self._border(camera), self._within
        on_side = np.zeros((4, len(ring)), dtype=np.bool_)
        if border is None or self._is_clear_of(border):
            return ring, on_side
        moved = ring.copy()
        step = np.abs(np.roll(ring, -1, axis=0) - ring)
        for index, (axis, place, outward) in enumerate(sides_of(border)):
            if max(float((outward * (other[:, axis] - place)).max()) for other in self.rings) > within:
                continue
            near = np.abs(ring[:, axis] - place) <= within
            on_side[index] = near & np.roll(near, -1) & (step[:, axis] <= ALONG_BORDER * step[:, 1 - axis])
            beyond = outward * (ring[:, axis] - place) > 0.0
            if on_side[index].any():
                moved[on_side[index] | np.roll(on_side[index], 1) | beyond, axis] = place
        return moved, on_side

    def pixel_bearings(self, camera: Camera) -> tuple[Array, Array]:
        """Bearings (m, 3) of the mask's pixels and the solid angle (m,) of each that the mask covers (paper eq. 6, 7).

        The surface element is the solid angle between the rays of a pixel's four corners, so that neighbours tile the
        sphere. ValueError without a mask, or where the camera sees no ray.
        """
        if self.mask is None:
            raise ValueError("the image region is a polygon; integration over pixels needs a region from a mask")
        centres, coverage = self.mask.covered_pixels()
        offsets = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        corners = np.concatenate([camera.bearings(centres + offset) for offset in offsets])
        bearings = camera.bearings(centres)
        if not (np.isfinite(bearings).all() and np.isfinite(corners).all()):
            raise ValueError("the mask holds pixels along which the camera's model sees no ray")
        solid_angles = _core.quad_solid_angles(corners.reshape(4, -1, 3).transpose(1, 0, 2).reshape(-1, 3))
        return bearings, solid_angles * coverage


@dataclass(frozen=True, eq=False, repr=False)
class WorldRegion:
    """A region of the 3D data: a planar patch with holes, or an open triangulated surface; or samples of a patch."""

    core: _core.WorldRegion

    @classmethod
    def from_polygon(cls, rings: ArrayLike | Sequence[ArrayLike]) -> WorldRegion:
        """The planar region inside the first ring and outside the others; vertices (n, 3), metres, turning either way.

        One (n, 3) array stands for one ring. The vertices are moved onto their least squares plane. ValueError for
        fewer than 3 vertices, values that are not finite, a vertex farther from the plane than 1 % of the extent,
        crossing edges, no area, or a hole that is not inside the first ring.
        """
        return cls(_core.WorldRegion.from_rings(_ring_list(rings, 3)))

    @classmethod
    def from_polygons(cls, polygons: Sequence[Sequence[ArrayLike]]) -> WorldRegion:
        """The planar region of several polygons apart from one another, each a list of rings as in `from_polygon`.

        The vertices are moved onto one least squares plane. ValueError as of `from_polygon`, a message about one
        polygon led by its number; for vertices farther from the common plane than 1 % of the extent, and for polygons
        that overlap.
        """
        parts = _polygon_list(polygons)
        origin, axes = _common_plane(parts)
        flat = [[_counter_clockwise((ring - origin) @ axes.T) for ring in rings] for rings in parts]
        region = cls(_core.WorldRegion.from_outline(origin, axes, [ring for rings in flat for ring in rings]))
        given = sum(_signed_area(outer) - sum(map(_signed_area, holes)) for outer, *holes in flat)
        # Nesting decides what is a hole: a polygon inside another would become one.
        if region.area < (1.0 - OVERLAP_SHARE) * given:
            raise ValueError(
                f"polygons of {given:.6g} m^2 cover {region.area:.6g} m^2; needed ones apart from one another"
            )
        return region

    @classmethod
    def from_points(
        cls,
        points: ArrayLike,
        *,
        radius: float | None = None,
        correct_sampling: bool = True,
        sensor_origin: ArrayLike | None = None,
    ) -> WorldRegion:
        """The planar region that points (n, 3) sample: their robust plane and the outline of the patch.

        The outline is an alpha shape of `radius` (metres; chosen from the spacing of the points when None). A patch
        ends between its last sample and the next, which missed it: `correct_sampling` grows the outline to there;
        without, it runs through the outermost points. With the scanner's position `sensor_origin` (3,) range noise
        moves the points along their beams alone. ValueError for fewer than 3 points, values that are not finite, points
        that are identical, on one line or on a single scan line, or a radius that is not positive.
        """
        outline = outline_of_points(
            points, radius=radius, correct_sampling=correct_sampling, sensor_origin=sensor_origin
        )
        return cls(_core.WorldRegion.from_outline(outline.origin, outline.axes, outline.rings))

    @classmethod
    def from_samples(cls, inside: ArrayLike, outside: ArrayLike) -> WorldRegion:
        """The planar region of which places (n, 3) are known to be inside, and (m, 3) to be outside of it, metres.

        The plane is that of the places inside. The pose is then the mean of those that show each place on its side of
        the image's contour (docs/math.md, section 17); the outline around the places inside is a start. ValueError as
        of `from_points`, for no place outside, and for one off the plane by more than a tenth of the extent.
        """
        beside = _real_array(outside, "outside", "(m, 3)").astype(np.float64)
        if beside.ndim != 2 or beside.shape[1] != 3 or len(beside) == 0:
            raise ValueError(f"outside has shape {beside.shape}; needed (m, 3) with at least one place")
        plane = plane_samples(inside)
        region = cls._on_plane(plane.origin, plane.axes, _start_outline(plane.flat))
        return cls(region.core.with_samples(plane.origin + plane.flat @ plane.axes[:2], beside))

    @classmethod
    def from_scan(
        cls,
        points: ArrayLike,
        members: ArrayLike,
        *,
        sensor_origin: ArrayLike | None = None,
        extends: bool = False,
    ) -> WorldRegion:
        """The planar region of the returns `members` (k,) of a scan (n, 3), by index, and what is known beside it.

        `members` as `grow_plane` and `find_planes` give them. A beam from the scanner's position `sensor_origin` (3,)
        that ended beyond the plane passed it at a place outside of the region; so is a return on the plane that is no
        member, unless it joins members without a gap and the region `extends` there. Beams that ended before the plane
        say nothing. Without `sensor_origin` the returns on the plane alone tell; where they don't surround the region,
        or nothing is known beside it, it is that of `from_points`. Points that are not finite are left out. ValueError
        for indices that are no members of the scan, and as of `from_points`.
        """
        cloud = _cloud_array(points)
        numbers = _member_array(members, len(cloud))
        plane = plane_samples(cloud[numbers], sensor_origin)
        rings = _start_outline(plane.flat)
        region = cls._on_plane(plane.origin, plane.axes, rings)
        samples = scan_samples(cloud, numbers, plane, rings, sensor_origin, extends)
        if samples is None:
            return cls._on_plane(plane.origin, plane.axes, flat_outline(plane.flat))
        inside, outside = (plane.origin + flat @ plane.axes[:2] for flat in samples)
        return cls(region.core.with_samples(inside, outside))

    @classmethod
    def _on_plane(cls, origin: Array, axes: Array, rings: list[Array]) -> WorldRegion:
        return cls(_core.WorldRegion.from_outline(origin, axes[:2], rings))

    @classmethod
    def from_mesh(cls, mesh: TriangleMesh) -> WorldRegion:
        """The region covered by an open triangle mesh (`vertices` (n, 3), `faces` (k, 3)), planar or not.

        The surface must not hide itself from the camera. ValueError for a closed mesh, inconsistent triangles, or
        crossing boundaries.
        """
        if not (hasattr(mesh, "vertices") and hasattr(mesh, "faces")):
            raise ValueError(f"mesh is a {type(mesh).__name__}; needed one with vertices (n, 3) and faces (k, 3)")
        vertices = _real_array(mesh.vertices, "mesh.vertices", "(n, 3)").astype(np.float64)
        return cls(_core.WorldRegion.from_mesh(vertices, _real_array(mesh.faces, "mesh.faces", "(k, 3)")))

    def seen_from(self, viewpoint: ArrayLike) -> WorldRegion:
        """The same region of which `viewpoint` (3,), metres, lies on the side that the camera sees.

        Such as the place of the scanner that saw the region, if it stood on the camera's side. Of a surface that is not
        planar the mean plane's side counts. ValueError for a point that is on no side, within 0.06 deg of the plane.
        """
        return WorldRegion(self.core.seen_from(viewpoint))

    @property
    def viewpoint(self) -> Array | None:
        """A point (3,) on the side that the camera sees; None where it may be either."""
        return self.core.viewpoint

    @property
    def samples(self) -> tuple[Array, Array] | None:
        """Places (n, 3) inside the region and (m, 3) outside of it; None where the outline alone is known."""
        return self.core.samples

    @property
    def rings(self) -> list[Array]:
        """Boundary rings, (n, 3) each."""
        return self.core.rings

    @property
    def normal(self) -> Array:
        """Unit normal of the plane, (3,); its side is arbitrary."""
        return np.asarray(self.core.axes[2])

    @property
    def area(self) -> float:
        """Area in square metres, of a surface its projection along the normal."""
        return self.core.area

    @property
    def is_planar(self) -> bool:
        """Whether the region lies in one plane."""
        return self.core.is_planar

    def __repr__(self) -> str:
        """What it holds, in square metres and numbers."""
        samples = self.samples
        known = "" if samples is None else f", samples={len(samples[0])} inside, {len(samples[1])} outside"
        return f"WorldRegion(area={self.area:.6g}, vertices={sum(map(len, self.rings))}{known})"

    def __reduce__(self) -> tuple[Callable[..., WorldRegion], tuple[object, ...]]:
        """What pickling keeps: the plane, the outline and the samples, or the surface, and the viewpoint."""
        if self.core.surface is not None:
            return _surface_region, (*self.core.surface, self.viewpoint)
        return _planar_region, (self.core.origin, self.core.axes[:2], self.core.outline, self.samples, self.viewpoint)


def _planar_region(
    origin: Array, axes: Array, outline: list[Array], samples: tuple[Array, Array] | None, viewpoint: Array | None
) -> WorldRegion:
    core = _core.WorldRegion.from_outline(origin, axes, outline)
    region = WorldRegion(core if samples is None else core.with_samples(*samples))
    return region if viewpoint is None else region.seen_from(viewpoint)


def _surface_region(vertices: Array, triangles: NDArray[np.int64], viewpoint: Array | None) -> WorldRegion:
    region = WorldRegion(_core.WorldRegion.from_mesh(vertices, triangles))
    return region if viewpoint is None else region.seen_from(viewpoint)


def _start_outline(flat: Array) -> list[Array]:
    """The outline of samples (n, 2) that count themselves: how sparse they are is no matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SparseSamplingWarning)
        return flat_outline(flat)


def _cloud_array(points: ArrayLike) -> Array:
    cloud = _real_array(points, "points", "(n, 3)")
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise ValueError(f"points has shape {cloud.shape}; needed (n, 3)")
    return np.asarray(cloud, dtype=np.float64)


def _member_array(members: ArrayLike, count: int) -> NDArray[np.intp]:
    numbers = np.asarray(members)
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise ValueError(f"members has shape {numbers.shape} and type {numbers.dtype}; needed indices (k,)")
    wrong = np.flatnonzero((numbers < 0) | (numbers >= count))
    if len(wrong):
        raise ValueError(f"member {wrong[0]} is {numbers[wrong[0]]}; needed an index from 0 to {count - 1}")
    return np.unique(numbers.astype(np.intp))


def _polygon_list(polygons: object) -> list[list[Array]]:
    """Rings (n, 3) of each polygon; ValueError that names the one that is none."""
    if isinstance(polygons, str | bytes | Mapping) or not isinstance(polygons, Iterable):
        raise ValueError(f"polygons is a {type(polygons).__name__}; needed a list of polygons, each a list of rings")
    parts = []
    for index, polygon in enumerate(polygons):
        try:
            parts.append(_ring_list(polygon, 3))
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
    limit = PLANE_SHARE * float(np.ptp(vertices, axis=0).max())
    for index, rings in enumerate(parts):
        off = float(np.abs((np.concatenate(rings) - origin) @ axes[2]).max())
        if off > limit:
            raise ValueError(f"polygon {index} lies {off:.6g} m off the common plane; needed at most {limit:.6g} m")
    return origin, axes[:2]


def _ring_list(rings: ArrayLike | Sequence[ArrayLike], columns: int) -> list[Array]:
    """Rings as a list of arrays; one array of vertices is one ring."""
    unlisted = isinstance(rings, str | bytes | Mapping) or (isinstance(rings, np.ndarray) and rings.ndim == 0)
    if unlisted or not isinstance(rings, Iterable):
        raise ValueError(f"rings is a {type(rings).__name__}; needed a list of (n, {columns}) arrays")
    listed: list[object] = list(rings)
    if not listed:
        raise ValueError(f"rings is empty; needed at least one (n, {columns}) array")
    if _is_vertex(listed[0]):
        listed = [listed]
    return [_ring_array(ring, index, columns) for index, ring in enumerate(listed)]


def _is_vertex(item: object) -> bool:
    """Whether an item of a list is a row of numbers, so that the list is a ring."""
    try:
        return np.asarray(item).ndim == 1
    except ValueError:
        return False


def _ring_array(ring: object, index: int, columns: int) -> Array:
    array = _real_array(ring, f"ring {index}", f"(n, {columns})")
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"ring {index} has shape {array.shape}; needed (n, {columns})")
    return array.astype(np.float64)


def _real_array(values: object, item: str, needed: str) -> NDArray[np.generic]:
    """The values as an array of real numbers, of whatever kind they are."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{item} is not an array of numbers; needed {needed}") from error
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{item} has type {array.dtype}; needed real numbers {needed}")
    return array


def _signed_area(ring: Array) -> float:
    # The last edge adds nothing: it ends in the vertex that all are counted from.
    x, y = np.ascontiguousarray((ring - ring[0]).T)
    return 0.5 * float(x[:-1] @ y[1:] - y[:-1] @ x[1:])


def _counter_clockwise(ring: Array) -> Array:
    return ring if _signed_area(ring) > 0.0 else ring[::-1]
