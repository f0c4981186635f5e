"""A photo and a cloud as the core compares their edges."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.views import (
    EDGE_FRACTION,
    cell_and_gap,
    half_field,
    pixel_angle,
    region_mask,
)
from regionpose.cameras import Camera
from regionpose.cameras.matrix import MatrixCamera
from regionpose.geometry.pose import Pose
from regionpose.progress import check_wanted

Array = NDArray[np.float64]

MOST_POINTS = 20_000
"""Most points of which a median distance is taken."""

FIELD_MARGIN_DEG = 12.0
"""How far beyond a photo's field edges are looked for: by what poses are refined, and by what focal lengths that are a
fifth shorter show more of, 6 degrees beside a field of 90."""

LEAST_LOG_FOCAL = -0.25
"""The logarithm of the shortest focal lengths over the given ones: below all that are compared."""

REDUCTIONS = (8, 4, 2, 1)
"""Pixels over which pictures are averaged, by spread: half a spread, between which they are interpolated."""


class EdgeFrame:
    """A photo's log likelihood ratios and a cloud's edges, as the core searches with them.

    `origin` (3,): the place of the world about which the core has points and poses.
    """

    def __init__(self, frame: PhotoCloud, origin: Array) -> None:
        """Keep points about an origin (3,) of the world, such as the scanner's place: far from the world's own, turns
        about it are moves of kilometers.
        """
        self.origin, self._frame = origin, frame
        self._points = frame.points - origin if origin.any() else frame.points

    @cached_property
    def core(self) -> _core.AlignmentFrame:
        """The whole photo with the edges that are visible from the origin."""
        return self._made(None)

    def visible_from(
        self, center: Array, poses: Sequence[Pose], *, margin_deg: float = FIELD_MARGIN_DEG, with_regions: bool = True
    ) -> _core.AlignmentFrame:
        """The photo with the edges that are visible from a center (3,) to cameras within a margin of these poses, all
        about the origin; what regions show can be left out of it: that is evidence of theirs.
        """
        check_wanted()
        frame = self.core if with_regions else self._core_beside_regions
        angle = float(self._half_field + np.radians(margin_deg))
        axes = np.array([pose.rotation.as_matrix()[2] for pose in poses])
        # What a pose is found by is asked for again by what is compared with it.
        key = center.tobytes(), axes.tobytes(), angle
        if key not in self._visible_edges:
            self._visible_edges[key] = self._edges(center, axes, angle)
        return frame.with_edges(self._visible_edges[key])

    def zoomed(self, frame: _core.AlignmentFrame, log_focal: float) -> _core.AlignmentFrame:
        """One of these frames as a camera of longer focal lengths would have it, by their logarithm over the given
        ones, at least `LEAST_LOG_FOCAL`.
        """
        camera, photo = self.camera, self._frame.photo
        assert isinstance(camera, MatrixCamera)
        (principal,) = photo.places(np.array([[camera.cx, camera.cy]]))
        projection = self._widest_projection.zoomed(float(np.exp(log_focal - LEAST_LOG_FOCAL)), principal)
        return frame.with_projection(projection, half_field(camera.zoomed(float(np.exp(log_focal))), photo))

    @property
    def camera(self) -> Camera:
        """That took the photo."""
        return self._frame.camera

    @cached_property
    def covered(self) -> NDArray[np.bool_] | None:
        """Which pixels (h, w) of the reduced photo regions cover; None without any."""
        return region_mask(self._frame.photo, self.camera, self._frame.frame.image_regions)

    @property
    def edge_count(self) -> int:
        """How many edges the cloud has, as seen from the origin."""
        return len(self._near_edges)

    @property
    def point_count(self) -> int:
        """How many points the cloud has that are finite."""
        return int(np.isfinite(self._points).all(axis=1).sum())

    @property
    def pixel_angle_rad(self) -> float:
        """The angle of a pixel of the original photo in its middle."""
        return pixel_angle(self.camera, self._frame.photo) / self._frame.photo.reduction

    def distance_m(self, pose: Pose) -> float:
        """The median distance of the points that the camera may see at a pose, meters; NaN where there are none."""
        local = pose.rebase(self.origin).transform(self._points[:: max(1, len(self._points) // MOST_POINTS)])
        distances = np.linalg.norm(local, axis=1)
        reach = np.cos(self._half_field)
        shown = distances[local[:, 2] > reach * distances]
        return float(np.median(shown)) if len(shown) else float("nan")

    @cached_property
    def _core_beside_regions(self) -> _core.AlignmentFrame:
        return self.core if self.covered is None else self._made(self.covered)

    def _made(self, covered: NDArray[np.bool_] | None) -> _core.AlignmentFrame:
        """The frame with the edges that are visible from the origin, its photo showing nothing where it is covered."""
        check_wanted()
        photo = self._frame.photo
        pictures = [photo.log_ratios(spread) for spread in _core.edge_spreads()]
        if covered is not None:
            pictures = [np.where(covered, np.float32(0.0), picture) for picture in pictures]
        ratios = list(zip(pictures, REDUCTIONS, strict=True))
        return _core.AlignmentFrame(*self._projection(self.camera), ratios, self._near_edges, np.zeros(3))

    def _projection(self, camera: Camera) -> tuple[_core.Projection, float]:
        """A camera's projection onto the photo, and the largest angle from its axis that this shows, rad."""
        photo = self._frame.photo
        height, width = photo.luminance.shape
        projection = _core.Projection([width, height], lambda bearings: photo.places(camera.project(bearings)))
        return projection, half_field(camera, photo)

    @cached_property
    def _widest_projection(self) -> _core.Projection:
        """That of a camera with the shortest focal lengths, which has bearings of all that longer ones show."""
        camera = self.camera
        assert isinstance(camera, MatrixCamera)
        return self._projection(camera.zoomed(float(np.exp(LEAST_LOG_FOCAL))))[0]

    @cached_property
    def _half_field(self) -> float:
        return half_field(self.camera, self._frame.photo)

    @cached_property
    def _visible_edges(self) -> dict[tuple[bytes, bytes, float], _core.CloudEdges]:
        """Edges by the center and the axes that they were detected for, and the angle about these."""
        return {}

    @cached_property
    def _near_edges(self) -> _core.CloudEdges:
        return self._edges(np.zeros(3))

    def _edges(self, center: Array, axes: Array | None = None, angle: float = np.pi) -> _core.CloudEdges:
        """The edges around a center (3,), about the origin, within an angle, rad, of axes (n, 3)."""
        cell, gap = cell_and_gap(self.camera, self._frame.photo, len(self._points), 4.0 * np.pi)
        return _core.CloudEdges(self._points, center, cell, gap, EDGE_FRACTION, self._frame.intensity, axes, angle)
