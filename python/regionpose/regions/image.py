"""A region of the image: its contour, and which of its edges are its own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.regions.hidden_edges import marked_edges, marked_lines, traced_beside
from regionpose.regions.mask import MaskWindow, seam_free, traced_mask
from regionpose.regions.pixel_edges import Border, border_lines, line_bearings, ring_bearings, sides_of, visible_part
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array, KeptArrays, counter_clockwise, read_only, ring_list, signed_area
from regionpose.validation.foreign import polygon_parts

if TYPE_CHECKING:
    import shapely

Marks = NDArray[np.bool_]

ON_BORDER_PX = 1e-6
"""The contour of a mask that the border cuts runs along it, but for rounding."""

POLYGON_ON_BORDER_PX = 0.5
"""A polygon's edge within this distance (pixels) of the border was drawn along it: on the outermost centers, or half a
pixel outside of them."""

ALONG_BORDER = 0.5
"""Slope of an edge against the border up to which it runs along it; short ones that cross the border are steeper."""


@dataclass(frozen=True, eq=False, repr=False)
class ImageRegion(KeptArrays):
    """A region of the image, bounded by closed rings of pixels (an integer is a pixel's center, x right, y down).

    Edges of the rings along the border are not the region's own: they carry no weight, and the world region is compared
    cut at the border in the same way. Nor are hidden ones, behind which the region may go on: the pose is then that of
    the other edges alone (docs/math.md, section 14). The arrays are read-only.

    Parameters
    ----------
    rings : tuple of (n, 2) arrays
        Pixels; the last vertex is joined to the first. They are kept with outer rings counter-clockwise in (x, y),
        holes the other way.
    mask : MaskWindow, optional
        The coverage that the rings were traced from, in its window of the image; None for a polygon.
    border : tuple of 4 float, optional
        Left, top, right and bottom of what the image shows, pixels: of a mask its own, half a pixel outside the
        outermost centers; None stands for the camera's.
    hidden : tuple of (n,) arrays of bool, optional
        For each ring, whether the edges that start at its vertices are hidden: edges of what stands before the region,
        or unobserved; None where none is.

    Raises
    ------
    ValueError
        For rings that cross or have no area, and marks of another shape.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.ImageRegion.from_polygon([[10, 10], [110, 10], [110, 60], [10, 60]])
    ImageRegion(area=5000 px, vertices=4, polygon)
    """

    rings: tuple[Array, ...]
    mask: MaskWindow | None = None
    border: Border | None = None
    hidden: tuple[Marks, ...] | None = None

    @classmethod
    def from_polygon(
        cls,
        rings: ArrayLike | Sequence[ArrayLike] | shapely.Geometry,
        *,
        hidden_edges: Sequence[int] | Sequence[Sequence[int]] = (),
    ) -> ImageRegion:
        """The region inside the first ring and outside the others.

        Edges within half a pixel of a side of the camera's image count as on it, unless the region goes on beyond that
        side: it is then taken at its word.

        Parameters
        ----------
        rings : (n, 2) array or sequence of such, or polygon
            Pixels, turning either way; contours (n, 1, 2) of OpenCV, and polygons and multipolygons of shapely, too.
        hidden_edges : sequence of int, or one for each ring
            Edges that are not the region's own but an occluder's, or were not seen; edge i of a ring goes from its
            vertex i to the next.

        Raises
        ------
        ValueError
            For a ring with fewer than 3 vertices, values that are not finite, crossing edges, no area, a hole that is
            not inside the first ring, or an edge that isn't there.
        """
        parts = polygon_parts(rings)
        if parts is not None and len(parts) > 1:
            turned = ((counter_clockwise(ring), place) for part in parts for place, ring in enumerate(part))
            rings = [ring[::-1] if place else ring for ring, place in turned]
        given = ring_list(rings, 2)
        checked = _core.plane_rings(given, polygon=parts is None or len(parts) == 1)
        return cls._valid(checked, hidden=marked_edges(given, checked, hidden_edges))

    def __post_init__(self) -> None:
        """Check rings and marks, and keep read-only copies."""
        given = ring_list(self.rings, 2)
        rings = _core.plane_rings(given, polygon=False)
        self._keep("rings", rings)
        if self.hidden is None:
            return
        marks = [np.asarray(marks) for marks in self.hidden]
        if [(each.dtype.kind, each.shape) for each in marks] != [("b", ring.shape[:1]) for ring in given]:
            raise ValueError("hidden has other shapes; needed (n,) of bool for each ring (n, 2)")
        edges = [np.flatnonzero(each).tolist() for each in marks]
        hidden = marked_edges(given, rings, edges if len(edges) > 1 else edges[0])
        self._keep("hidden", hidden)

    def _keep(self, name: str, arrays: Iterable[NDArray[Any]] | None) -> None:
        object.__setattr__(self, name, None if arrays is None else tuple(read_only(each) for each in arrays))

    @classmethod
    def _valid(
        cls,
        rings: Iterable[Array],
        mask: MaskWindow | None = None,
        border: Border | None = None,
        hidden: tuple[Marks, ...] | None = None,
    ) -> ImageRegion:
        """The region of rings that the core has made or checked."""
        region = object.__new__(cls)
        region._keep("rings", rings)
        region._keep("hidden", hidden)
        object.__setattr__(region, "mask", mask)
        object.__setattr__(region, "border", border)
        return region

    @classmethod
    def from_mask(cls, mask: ArrayLike, *, unknown: ArrayLike | None = None, panorama: bool = False) -> ImageRegion:
        """The region of a mask.

        The contour runs where the linearly interpolated coverage is 0.5, so that the edge of a binary mask lies midway
        between pixel centers; vertices within 0.01 px of a line are left out. A mask that meets the border of its array
        is cut there by the border of the image, half a pixel outside the outermost centers.

        Parameters
        ----------
        mask : (h, w) array
            Bool, two-valued integers (0 and another), or coverage in [0, 1].
        unknown : (h, w) array, optional
            Bool, or numbers that count where they aren't 0: pixels that may be the region's or not, whatever the mask's
            value, such as an occluder's; the contour beside them is hidden.
        panorama : bool
            Whether the left side of the mask continues its right side, as of an `EquirectangularCamera`: a region on
            both then goes on across the seam, its pixels beyond the right side, without a `mask` to take sums over.

        Raises
        ------
        ValueError
            For another shape or type, a mask that is empty or wholly unknown, or values outside [0, 1].

        Examples
        --------
        >>> import numpy as np, regionpose as rp
        >>> rp.ImageRegion.from_mask(np.pad(np.ones((20, 30), dtype=bool), 5))
        ImageRegion(area=599.5 px, vertices=8, mask of 40 x 30 px)
        """
        if panorama and (start := seam_free(mask)):
            return cls._across_seam(mask, unknown, start)
        if unknown is None:
            (rings, window), hidden = traced_mask(mask), None
        else:
            rings, window, hidden = traced_beside(mask, unknown)
        height, width = window.shape
        if panorama:
            return cls._valid(rings, window, (-np.inf, -0.5, np.inf, height - 0.5), hidden)
        return cls._valid(rings, window, (-0.5, -0.5, width - 0.5, height - 0.5), hidden)

    @classmethod
    def _across_seam(cls, mask: ArrayLike, unknown: ArrayLike | None, start: int) -> ImageRegion:
        """The region of a panorama's mask that begins at the column `start`, and goes on beyond the last."""
        turned = None if unknown is None else np.roll(np.asarray(unknown), -start, axis=1)
        found = cls.from_mask(np.roll(np.asarray(mask), -start, axis=1), unknown=turned)
        height = np.shape(mask)[0]
        rings = [ring + np.array([float(start), 0.0]) for ring in found.rings]
        return cls._valid(rings, None, (-np.inf, -0.5, np.inf, height - 0.5), found.hidden)

    def __repr__(self) -> str:
        """Its area and vertices, and what it is made of."""
        made = "polygon" if self.mask is None else "mask of {} x {} px".format(*self.mask.shape[::-1])
        hidden = 0 if self.hidden is None else int(sum(np.count_nonzero(marks) for marks in self.hidden))
        parts = [f"area={self.area:.6g} px", f"vertices={sum(map(len, self.rings))}", made]
        return f"ImageRegion({', '.join(parts + [f'{hidden} hidden edges'] * bool(hidden))})"

    @cached_property
    def area(self) -> float:
        """Area in pixels."""
        return float(sum(signed_area(ring) for ring in self.rings))

    @cached_property
    def _bounds(self) -> Border:
        """Left, top, right and bottom of the vertices, pixels."""
        vertices = self.rings[0] if len(self.rings) == 1 else np.concatenate(self.rings)
        left, top = np.minimum.reduce(vertices).tolist()
        right, bottom = np.maximum.reduce(vertices).tolist()
        return left, top, right, bottom

    @checked_arguments
    def bearings(self, camera: Camera) -> list[Array]:
        """The rings as bearings (m, 3), split so that arcs between neighbors stay within 0.01 px of the pixel edges.

        Edges drawn along the border are moved onto it. ValueError where the camera sees no ray at a vertex.
        """
        return [ring_bearings(camera, ring, index) for index, ring in enumerate(self.rings_on_border(camera))]

    @checked_arguments
    def rings_on_border(self, camera: Camera) -> Sequence[Array]:
        """The rings (n, 2), edges drawn along the border of the image moved onto it."""
        if self._is_clear_of(self._border(camera)):
            return self.rings
        return [self._on_sides(camera, ring)[0] for ring in self.rings]

    @checked_arguments
    def on_border(self, camera: Camera) -> list[Marks]:
        """For each ring (n, 2), whether the edges that start at its vertices lie on the border of the image, (n,)."""
        return [np.any(self._on_sides(camera, ring)[1], axis=0) for ring in self.rings]

    @checked_arguments
    def excluded_edges(self, camera: Camera) -> list[Marks]:
        """For each ring (n, 2), whether the edges that start at its vertices are not the region's own, (n,): they lie
        on the border of the image, or are hidden.
        """
        on_border = self.on_border(camera)
        return on_border if self.hidden is None else [a | b for a, b in zip(on_border, self.hidden, strict=True)]

    @checked_arguments
    def hidden_bearings(self, camera: Camera) -> list[Array]:
        """The hidden edges as lines of bearings (m, 3), each as far as they go on; ValueError where the camera sees no
        ray.
        """
        if self.hidden is None:
            return []
        rings = zip(self.rings_on_border(camera), self.hidden, strict=True)
        lines = [line for ring, marks in rings for line in marked_lines(ring, marks)]
        return [line_bearings(camera, line, "a hidden edge") for line in lines]

    @checked_arguments
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
        return [
            line_bearings(camera, part, "the image border") for line in lines for part in visible_part(camera, line)
        ]

    def _border(self, camera: Camera) -> Border | None:
        if self.border is not None or camera.width is None or camera.height is None:
            return self.border
        left, right = (-0.5, camera.width - 0.5) if camera.period is None else (-np.inf, np.inf)
        return (left, -0.5, right, camera.height - 0.5)

    @property
    def _within(self) -> float:
        """Distance from the border, pixels, up to which an edge may lie along it."""
        return POLYGON_ON_BORDER_PX if self.border is None else ON_BORDER_PX

    def _is_clear_of(self, border: Border | None) -> bool:
        """Whether all vertices are too far inside the border for an edge to lie along it."""
        if border is None or not self.rings:
            return True
        (left, top, right, bottom), within = self._bounds, self._within
        ahead = left - border[0] > within and top - border[1] > within
        return ahead and border[2] - right > within and border[3] - bottom > within

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

    @checked_arguments
    def pixel_bearings(self, camera: Camera) -> tuple[Array, Array]:
        """Bearings (m, 3) of the mask's pixels and the solid angle (m,) of each that the mask covers (paper eq. 6, 7).

        The surface element is the solid angle between the rays of a pixel's four corners, so that neighbors tile the
        sphere. ValueError without a mask, or where the camera sees no ray.
        """
        if self.mask is None:
            raise ValueError("the image region is a polygon; integration over pixels needs a region from a mask")
        centers, coverage = self.mask.covered_pixels()
        offsets = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        corners = np.concatenate([camera.bearings(centers + offset) for offset in offsets])
        bearings = camera.bearings(centers)
        if not (np.isfinite(bearings).all() and np.isfinite(corners).all()):
            raise ValueError("the mask holds pixels along which the camera's model sees no ray")
        solid_angles = _core.quad_solid_angles(corners.reshape(4, -1, 3).transpose(1, 0, 2).reshape(-1, 3))
        return bearings, solid_angles * coverage
