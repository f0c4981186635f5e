"""The poses at which the edges of clouds lie on those of photos, searched for in all that a prior allows (docs/math.md,
section 19).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.steps import (
    STEP_SHARE,
    cell_and_gap,
    checked_intensity,
    checked_points,
    half_field,
    pixel_angle,
)
from regionpose.arrays import KeptArrays
from regionpose.cameras import Camera
from regionpose.cameras.matrix import MatrixCamera
from regionpose.estimation.prior import Prior
from regionpose.pose import Pose
from regionpose.progress import Progress, check_wanted

Array = NDArray[np.float64]

DRAWS, KEPT = 60_000, (2_000, 400, 64)
"""Poses that are drawn from the prior, and how many of the best by each spread are led on to the next one. Measured: of
eight frames of four scanners, heading unknown, 200,000 and (6,000, 800, 64) find no other one, in 2.5 times the time.
"""

MOST_POINTS = 20_000
"""Points whose distances are looked at: a median needs no more."""

REDUCTIONS = (8, 4, 2, 1)
"""Pixels over which pictures are averaged, by spread: half a spread, between which they are interpolated."""


@dataclass(frozen=True, eq=False)
class EdgeMode(KeptArrays):
    """A maximum of the posterior of the pose by edges.

    Parameters
    ----------
    pose : Pose
        `camera_from_world`.
    covariance : (6, 6) array
        Of its left increment, rad and meters, by the edges' noise alone.
    log_mass : float
        Logarithm of the integral of the posterior about it, where that of the prior is 1: the log odds that photo and
        cloud agree there rather than by chance anywhere.
    log_ratio : float
        Logarithm of the likelihood ratio at the maximum itself.
    edges : int
        How many edges of the cloud the photo shows there, of all frames.
    """

    pose: Pose
    covariance: Array
    log_mass: float
    log_ratio: float
    edges: int


class EdgeFrame:
    """A photo's log likelihood ratios and a cloud's edges, as the core searches with them."""

    def __init__(self, frame: SceneFrame, place: Array) -> None:
        """Take the edges that are seen from a place (3,) of the world, such as the scanner's.

        Poses are those for points about that place: far from the world's origin, turns about it are moves of
        kilometers.
        """
        points = checked_points(frame.points)
        self._frame, self._points = frame, points - place if place.any() else points
        self._intensity = checked_intensity(frame.intensity, self._points)

    @cached_property
    def core(self) -> _core.AlignmentFrame:
        """The frame with the edges that are seen from the scanner."""
        check_wanted()
        photo = self._frame.photo
        spreads = zip(_core.edge_spreads(), REDUCTIONS, strict=True)
        ratios = [(photo.log_ratios(spread), reduction) for spread, reduction in spreads]
        return _core.AlignmentFrame(*self._projection(self.camera), ratios, self._near_edges, np.zeros(3))

    @property
    def edge_count(self) -> int:
        """How many edges the cloud has, as seen from the scanner."""
        return len(self._near_edges)

    @property
    def point_count(self) -> int:
        """How many points the cloud has that are finite."""
        return int(np.isfinite(self._points).all(axis=1).sum())

    def seen_from(self, place: Array) -> _core.AlignmentFrame:
        """The frame with the edges that are seen from another place (3,)."""
        check_wanted()
        return self.core.with_edges(self._edges(place))

    def zoomed(self, log_focal: float) -> _core.AlignmentFrame:
        """The frame as a camera of longer focal lengths would have it, by their logarithm over the given ones."""
        camera = self.camera
        if isinstance(camera, MatrixCamera) and log_focal:
            camera = camera.zoomed(float(np.exp(log_focal)))
        return self.core.with_projection(*self._projection(camera))

    @property
    def camera(self) -> Camera:
        """That took the photo."""
        return self._frame.camera

    @property
    def pixel_angle_rad(self) -> float:
        """The angle of a pixel of the original photo in its middle."""
        return pixel_angle(self.camera, self._frame.photo) / self._frame.photo.reduction

    def distance_m(self, pose: Pose) -> float:
        """The median distance of the points that the camera may see at a pose, meters; NaN where there are none."""
        local = pose.transform(self._points[:: max(1, len(self._points) // MOST_POINTS)])
        distances = np.linalg.norm(local, axis=1)
        reach = np.cos(half_field(self.camera, self._frame.photo))
        shown = distances[local[:, 2] > reach * distances]
        return float(np.median(shown)) if len(shown) else float("nan")

    def _projection(self, camera: Camera) -> tuple[_core.Projection, float]:
        """A camera's projection onto the photo, and the largest angle from its axis that this shows, rad."""
        photo = self._frame.photo
        height, width = photo.luminance.shape
        projection = _core.Projection([width, height], lambda bearings: photo.places(camera.project(bearings)))
        return projection, half_field(camera, photo)

    @cached_property
    def _near_edges(self) -> _core.CloudEdges:
        return self._edges(np.zeros(3))

    def _edges(self, place: Array) -> _core.CloudEdges:
        """The edges all around a place."""
        cell, gap = cell_and_gap(self.camera, self._frame.photo, len(self._points), 4.0 * np.pi)
        return _core.CloudEdges(self._points, place, cell, gap, STEP_SHARE, self._intensity)


def searched(
    frames: Sequence[EdgeFrame], prior: Prior, starts: Sequence[Pose] = (), *, progress: Progress | None = None
) -> list[EdgeMode]:
    """The maxima of the posterior of the pose that frames share, that of the largest mass first.

    `starts`: poses to look about beside those that are drawn from the prior. ValueError for a prior that says nothing
    of where the camera stands.
    """
    density, report = _core.Density.of_prior(prior.core), progress or (lambda share: None)
    cores = []
    for number, frame in enumerate(frames):
        cores.append(frame.core)
        report(0.3 * (number + 1) / len(frames))
    modes = _modes(cores, density, starts, DRAWS, KEPT)
    if not modes:
        return []
    report(0.8)
    # Edges seen from where the camera stands are other ones, the more the farther it is from the scanner.
    place = modes[0].pose.camera_center
    anew = maxima([frame.seen_from(place) for frame in frames], density, [mode.pose for mode in modes])
    report(1.0)
    return max(modes, anew, key=log_mass)


def maxima(frames: Sequence[_core.AlignmentFrame], density: _core.Density, starts: Sequence[Pose]) -> list[EdgeMode]:
    """The maxima that starts lead to, that of the largest mass first."""
    return _modes(frames, density, starts, 0, (len(starts),) * len(KEPT))


def log_mass(modes: Sequence[EdgeMode]) -> float:
    """Logarithm of the mass of all modes together."""
    return float(np.logaddexp.reduce([mode.log_mass for mode in modes])) if modes else -np.inf


def _modes(
    frames: Sequence[_core.AlignmentFrame],
    density: _core.Density,
    starts: Sequence[Pose],
    draws: int,
    kept: Sequence[int],
) -> list[EdgeMode]:
    check_wanted()
    given = [(start.rotation.as_matrix(), start.translation) for start in starts]
    found = _core.search_poses(list(frames), density, given, draws, list(kept))
    # Where photos show no edge, the prior is all that is known.
    return [
        EdgeMode(Pose(Rotation.from_matrix(rotation), translation), covariance, mass, ratio, edges)
        for rotation, translation, covariance, mass, ratio, edges in found
        if edges
    ]
