"""Borders of a cloud's planes as a camera sees them at a pose, and which parts of them are where a surface ends."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.views import EDGE_FRACTION, cell_and_gap, half_field, pixel_angle
from regionpose.geometry.pose import Pose
from regionpose.regions.outline import sparse_sampling_handler
from regionpose.regions.world import WorldRegion
from regionpose.validation.arrays import Array
from regionpose.viz.projections import projected_rings

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

MARGIN_DEG = 5.0
"""Points so far beside the photo are used, too: planes go on there."""

PIECE_PX = 2.0
"""Length of a border's pieces: the finest spread of edges."""

NEIGHBORS = 5
"""Points beside a piece of a border that decide what lies there."""

CONE = 0.5
"""Cosine of the angle from the outward normal within which a point lies beside a piece."""

OUT_OF_VIEW_PX = -1e9
"""Place of points that the camera does not see."""

BEFORE_FRACTION = 0.3 * EDGE_FRACTION
"""A point hides a border from this fraction before its plane on: parked cars stand nearer to walls than a step is
deep."""

MEETS_FRACTION, MEETS_M = 0.01, 0.1
"""Distance from another plane, over that from the camera and in meters, within which a border lies on it, too."""

STRAIGHT_GAPS = 0.5
"""Distance from a border within which its sides are straight, over the gap between neighboring points: outlines of scan
lines are stairs of half a gap."""

LEAST_SIDE_PX = 12.0
"""Square root of the area of the smallest plane that is tested: beside a gap between neighbors, what has a shape."""


class Pieces(NamedTuple):
    """Pieces of a ring's sides: places (m, 2), outward unit normals (m, 2), the sides (m,) that they belong to, and how
    far along these they are, (m,), 0 to 1.
    """

    places: Array
    normals: Array
    sides: Indices
    along: Array

    def chosen(self, among: Flags) -> Pieces:
        """Some of them, (m,)."""
        return Pieces(self.places[among], self.normals[among], self.sides[among], self.along[among])


class Border(NamedTuple):
    """The border of a plane in the photo: its ring (n, 2), counter-clockwise in (x, y), pixels of the reduced photo.

    For each side (n,), from a vertex to the next: whether the surface ends there, rather than the photo, the scan, or
    the view of it; and whether the photo does.
    """

    ring: Array
    is_end: Flags
    is_cut: Flags

    @property
    def pieces(self) -> Pieces:
        """The pieces of all sides."""
        return _pieces(self.ring)


class Outline(NamedTuple):
    """A plane of a cloud: its region by the outline of its points, and the indices (n,) of these."""

    region: WorldRegion
    members: Indices

    def heights(self, points: Array) -> Array:
        """Signed distances (n,) of points (n, 3) from the plane, meters."""
        return np.asarray((points - self.region.core.origin) @ self.region.normal)

    def along(self, points: Array, center: Array) -> Array:
        """How far rays from a center (3,) to points (n, 3) have come, over their way to the plane: 1 on it, below 0
        where they do not meet it.
        """
        height = float((self.region.core.origin - center) @ self.region.normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(((points - center) @ self.region.normal) / height)


@dataclass(frozen=True, eq=False)
class View:
    """The points of a frame as its camera sees them at a pose; `scanner` (3,): from where they were."""

    frame: PhotoCloud
    pose: Pose
    scanner: Array | None = None

    @cached_property
    def numbers(self) -> Indices:
        """Indices of the points in view."""
        local = self.pose.transform(self.frame.points)
        reach = np.cos(min(half_field(self.frame.camera, self.frame.photo) + np.radians(MARGIN_DEG), np.pi))
        with np.errstate(invalid="ignore"):
            ahead = local[:, 2] > reach * np.linalg.norm(local, axis=1)
        return np.flatnonzero(ahead)

    @cached_property
    def gap_rad(self) -> float:
        """Angle beyond which neighboring points leave open where between them a surface ends."""
        camera, photo = self.frame.camera, self.frame.photo
        angle = 2.0 * np.pi * (1.0 - np.cos(half_field(camera, photo)))
        return cell_and_gap(camera, photo, len(self.numbers), angle)[1]

    @cached_property
    def gap_px(self) -> float:
        """The same in the middle of the photo."""
        return self.gap_rad / pixel_angle(self.frame.camera, self.frame.photo)

    @cached_property
    def _scanner(self) -> Array:
        """From where the points were seen: the scanner, or the camera where that is not known."""
        return self.pose.camera_center if self.scanner is None else self.scanner

    @cached_property
    def _directions(self) -> Array:
        """Of the points in view from the scanner, unit vectors."""
        return _unit(self.frame.points[self.numbers] - self._scanner)

    @cached_property
    def _scanner_tree(self) -> cKDTree:
        return cKDTree(self._directions)

    @cached_property
    def _camera_tree(self) -> cKDTree:
        """The places of the points in view, far beside the photo where the camera does not see them."""
        photo = self.frame.photo
        places = photo.places(self.frame.camera.project(self.pose.transform(self.frame.points[self.numbers])))
        return cKDTree(np.where(np.isfinite(places).all(axis=1, keepdims=True), places, OUT_OF_VIEW_PX))

    def border(self, surface: Outline, other_surfaces: Sequence[Outline]) -> Border | None:
        """The border of a plane; None where the photo shows too little of it.

        `others`: planes that it may meet.
        """
        ring = self.ring(surface.region)
        if ring is None:
            return None
        pieces = _pieces(ring)
        return self._split(ring, pieces, self._ends(pieces, surface, other_surfaces))

    def _split(self, ring: Array, pieces: Pieces, ends: Flags) -> Border:
        """The border whose sides are split where the surface's ends begin and stop."""
        vertices, is_end = [], []
        width = max(round(0.5 * self.gap_px / PIECE_PX), 1)
        for side, (start, end) in enumerate(zip(ring, np.roll(ring, -1, axis=0), strict=True)):
            own = _majority(ends[pieces.sides == side], width)
            changes = [0, *(np.flatnonzero(np.diff(own.astype(np.int8))) + 1), len(own)]
            for first in changes[:-1]:
                vertices.append(start + first / len(own) * (end - start))
                is_end.append(bool(own[first]))
        found = np.array(vertices)
        size = np.array(self.frame.photo.luminance.shape[::-1]) - 0.5
        low, high = np.abs(found + 0.5) < 1.0, np.abs(found - size) < 1.0
        cut = np.logical_or.reduce((low & np.roll(low, -1, axis=0)) | (high & np.roll(high, -1, axis=0)), axis=1)
        return Border(found, np.asarray(np.array(is_end) & ~cut), np.asarray(cut))

    def ring(self, region: WorldRegion) -> Array | None:
        """The outer ring (n, 2) of what the photo shows of a region, by straight sides, counter-clockwise in (x, y);
        None where that is too little, or the camera does not see all of the region's outline.
        """
        photo = self.frame.photo
        height, width = photo.luminance.shape
        photo_area = shapely.box(-0.5, -0.5, width - 0.5, height - 0.5)
        parts: list[shapely.Polygon] = []
        for ring in projected_rings(self.frame.camera, region, self.pose):
            places = photo.places(ring[:-1])
            if not np.isfinite(places).all():
                return None
            cut = shapely.Polygon(places).buffer(0.0).intersection(photo_area)
            parts += [part for part in shapely.get_parts(cut) if isinstance(part, shapely.Polygon)]
        if not parts:
            return None
        largest = max(parts, key=lambda part: part.area)
        straight = shapely.Polygon(largest.exterior).simplify(STRAIGHT_GAPS * self.gap_px)
        if not isinstance(straight, shapely.Polygon) or straight.area < max(LEAST_SIDE_PX, 2.0 * self.gap_px) ** 2:
            return None
        return np.asarray(shapely.geometry.polygon.orient(straight).exterior.coords)[:-1]

    def _on_plane(self, surface: Outline, places: Array) -> Array:
        """Where the camera's rays through places (n, 2) of the photo meet a plane, (n, 3); not finite where they
        don't.
        """
        center, normal = self.pose.camera_center, surface.region.normal
        bearings = self.frame.camera.bearings(self.frame.photo.pixels(places)) @ self.pose.rotation.as_matrix()
        with np.errstate(divide="ignore", invalid="ignore"):
            lengths = (normal @ (surface.region.core.origin - center)) / (bearings @ normal)
            return np.asarray(center + bearings * np.where(lengths > 0.0, lengths, np.nan)[:, None])

    def _ends(self, pieces: Pieces, surface: Outline, other_surfaces: Sequence[Outline]) -> Flags:
        """Whether the surface ends at pieces of its border, (m,): the scanner's neighboring beams ended behind its
        plane, or on another that it meets there, and nothing hides this from the camera.
        """
        border = self._on_plane(surface, pieces.places)
        beyond = self._on_plane(surface, pieces.places + pieces.normals)
        finite = np.flatnonzero(np.isfinite(border).all(axis=1) & np.isfinite(beyond).all(axis=1))
        border, beyond = border[finite], beyond[finite]
        near = MEETS_M + MEETS_FRACTION * np.linalg.norm(border - self.pose.camera_center, axis=1)
        points = self.frame.points[self.numbers]
        # Points on a plane that the border lies on neither hide it nor leave it open.
        own_heights = np.abs(surface.heights(points))
        met = [(np.abs(other.heights(border)) <= near, np.abs(other.heights(points))) for other in other_surfaces]
        along = surface.along(points, self._scanner)
        behind = (along > 1.0 + EDGE_FRACTION) | (along < 0.0)
        before = (along >= 0.0) & (along < 1.0 - BEFORE_FRACTION)
        covers = surface.along(points, self.pose.camera_center)
        covers_border = (covers > 0.0) & (covers < 1.0 - BEFORE_FRACTION)
        is_member = np.isin(self.numbers, surface.members)
        around = self._camera_tree.query_ball_point(pieces.places[finite], self.gap_px)
        ends = np.zeros(len(pieces.places), dtype=np.bool_)
        for index, (beside, covering) in enumerate(zip(self._beside(border, beyond, is_member), around, strict=True)):
            in_front = np.array(covering, dtype=np.intp)
            in_front = in_front[covers_border[in_front]]
            both = np.concatenate([beside, in_front])
            on_met = np.zeros(len(both), dtype=np.bool_)
            for meets, heights in met:
                if meets[index]:
                    on_met |= heights[both] <= np.minimum(near[index], own_heights[both])
            beside_met, front_met = np.split(on_met, [len(beside)])
            is_hidden = not front_met.all() or bool((before[beside] & ~beside_met).any())
            open_count = np.count_nonzero(behind[beside] | beside_met)
            ends[finite[index]] = not is_hidden and 2 * open_count > len(beside)
        return ends

    def _beside(self, border: Array, beyond: Array, is_member: Flags) -> Iterator[Indices]:
        """For each place (m, 3) of a border the points, by their numbers in view, next to it as the scanner sees them
        and on the side of the places `beyond`, that are not its surface's.
        """
        middles, tips = (_unit(places - self._scanner) for places in (border, beyond))
        outward = _unit(tips - middles)
        near = self._scanner_tree.query_ball_point(middles, self.gap_rad)
        for middle, direction, numbers in zip(middles, outward, near, strict=True):
            beside = np.array(numbers, dtype=np.intp)
            beside = beside[~is_member[beside]]
            offsets = self._directions[beside] - middle
            lengths = np.linalg.norm(offsets, axis=1)
            ahead = np.flatnonzero(offsets @ direction > CONE * lengths)
            yield beside[ahead[np.argsort(lengths[ahead], kind="stable")[:NEIGHBORS]]]


def _unit(vectors: Array) -> Array:
    """Vectors (n, 3) of length one."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12))


def _majority(flags: Flags, width: int) -> Flags:
    """What most of the flags (n,) within so many of each are."""
    sums = np.concatenate([[0], np.cumsum(flags)])
    first = np.maximum(np.arange(len(flags)) - width, 0)
    last = np.minimum(np.arange(len(flags)) + width + 1, len(flags))
    return np.asarray(2 * (sums[last] - sums[first]) > last - first)


def _pieces(ring: Array) -> Pieces:
    """The pieces of a counter-clockwise ring (n, 2)."""
    steps = np.roll(ring, -1, axis=0) - ring
    lengths = np.linalg.norm(steps, axis=1)
    counts = np.maximum(np.round(lengths / PIECE_PX).astype(np.int64), 1)
    sides = np.repeat(np.arange(len(ring)), counts)
    along = (np.arange(len(sides)) - np.repeat(np.cumsum(counts) - counts, counts) + 0.5) / counts[sides]
    normals = np.column_stack([steps[:, 1], -steps[:, 0]]) / np.maximum(lengths, 1e-12)[:, None]
    return Pieces(ring[sides] + along[:, None] * steps[sides], normals[sides], sides, along)


def outlines(points: Array, planes: Sequence[Indices], scanner: Array | None) -> list[Outline]:
    """The planes of points (n, 3) that have an outline, by the indices of theirs; `scanner` (3,) saw them."""
    found = []
    with sparse_sampling_handler(lambda _: None):
        for members in planes:
            try:
                found.append(Outline(WorldRegion.from_points(points[members], sensor_origin=scanner), members))
            except ValueError:
                # Too few across, or on one scan line.
                continue
    return found
