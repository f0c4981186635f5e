"""The regions' pose by the focal lengths, and what the edges of photo and cloud make of both where these are unknown
(docs/math.md, eq. 18.13).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.evidence import Evidence
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.posterior import Peak, Posterior, Seen, root_of
from regionpose.cameras import Camera
from regionpose.cameras.matrix import MatrixCamera
from regionpose.estimation.answer import PoseEstimate
from regionpose.pose import Pose

Array = NDArray[np.float64]

Estimated = Callable[[Camera, Pose], PoseEstimate]
"""The estimate of the same regions with another camera, started at a pose."""

REACH = 0.2
"""Logarithm of the longest focal lengths, over the given ones, with which the regions' pose is asked for, and the
shortest: 22 % off, as another setting of a zoom lens or a data sheet may be."""


def zoomed(camera: MatrixCamera, log_focal: float, frame: SceneFrame) -> SceneFrame:
    """The frame with other focal lengths; the same one, with the steps that it keeps, at the given ones."""
    if not log_focal:
        return frame
    return replace(frame, image=frame.photo, camera=camera.zoomed(float(np.exp(log_focal))))


@dataclass(frozen=True, eq=False)
class FocalCurve:
    """How the regions' pose follows the logarithm of the focal lengths: its increments (6,) from the given one by the
    logarithm and by its square, and covariances (6, 6) at the ends of the reach and in the middle.
    """

    camera: MatrixCamera
    pose: Pose
    slope: Array
    bend: Array
    covariances: dict[float, Array]

    @classmethod
    def of(cls, camera: MatrixCamera, estimate: PoseEstimate, estimated: Estimated) -> FocalCurve | None:
        """By the estimates at both ends, of one alone where the other has none; None without any."""
        ways, covariances = [], {0.0: estimate.covariance}
        for end in (-REACH, REACH):
            try:
                found = estimated(camera.zoomed(float(np.exp(end))), estimate.pose)
            except ValueError:  # No pose, or no ray of such a camera where a region is.
                continue
            if np.isfinite(found.covariance).all():
                ways.append(estimate.pose.increment_to(found.pose) / end)
                covariances[end] = found.covariance
        if not ways:
            return None
        bend = (ways[-1] - ways[0]) / (2.0 * REACH)
        return cls(camera, estimate.pose, np.mean(ways, axis=0), bend, covariances)

    def __contains__(self, log_focal: float) -> bool:
        """Whether a pose is known there."""
        return min(self.covariances) <= log_focal <= max(self.covariances)

    def at(self, log_focal: float) -> tuple[Pose, Array, Array]:
        """The pose, its derivative (6,) and its covariance (6, 6)."""
        pose = self.pose.moved(log_focal * (self.slope + log_focal * self.bend))
        share, end = abs(log_focal) / REACH, float(np.copysign(REACH, log_focal))
        outer = self.covariances[end] if log_focal else 0.0
        return pose, self.slope + 2.0 * log_focal * self.bend, (1.0 - share) * self.covariances[0.0] + share * outer


@dataclass(frozen=True, eq=False)
class FocalPrior:
    """The prior of poses and focal lengths about those of one logarithm over the given ones, whose own is normally
    distributed (eq. 18.13).
    """

    curve: FocalCurve
    scene: Sequence[SceneFrame]
    log_focal: float
    spread: float

    def seen(self, known: Sequence[Pose]) -> Seen:
        """What the steps say that are seen with these, maxima near poses being `known`."""
        pose, *_ = self.curve.at(self.log_focal)
        frames = [Evidence(frame, pose, with_focal=True) for frame in self._frames]
        return Seen.of(frames, self._posterior, known).or_likelier(self._posterior)

    def maxima_by(self, seen: Seen, near: Sequence[Peak]) -> list[Peak]:
        """The maxima near these by the steps that are seen with other focal lengths."""
        frames = [held.of_frame(frame) for held, frame in zip(seen.frames, self._frames, strict=True)]
        return self._posterior(frames, seen.shares).near(near)

    @cached_property
    def _frames(self) -> list[SceneFrame]:
        return [zoomed(self.curve.camera, self.log_focal, frame) for frame in self.scene]

    def _posterior(self, frames: Sequence[Evidence], shares: Sequence[float]) -> Posterior:
        """That of the pose and of the logarithm over this one."""
        pose, slope, covariance = self.curve.at(self.log_focal)
        root = np.zeros((7, 7))
        root[:6, :6], root[:6, 6], root[6, 6] = root_of(covariance), self.spread * slope, self.spread
        # Peaks of another spread have moved the frames.
        for frame in frames:
            frame.move_to(pose)
        return Posterior(pose, root, frames, shares)
