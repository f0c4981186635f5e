"""What regions say of the pose, before edges are looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.frame import SceneFrame
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.options import Solver
from regionpose.solve.prior import Prior
from regionpose.solve.reevaluate import moved_estimate
from regionpose.solve.rig import Frame, estimate_rig
from regionpose.solve.single import estimate_pose


@dataclass(frozen=True, eq=False)
class RegionEvidence:
    """The estimate of regions alone.

    `regions`: on both sides, of all frames, one frame after the other, as `camera` sees them. `starts`: for each frame
    with a photo and a cloud the place of its first region among them. `reestimate`: the estimate with the answer
    nearest to a pose first.
    """

    estimate: PoseEstimate
    camera: Camera
    regions: tuple[Sequence[ImageRegion], Sequence[WorldRegion]]
    starts: tuple[int, ...]
    reestimate: Callable[[Pose], PoseEstimate]

    @classmethod
    def of(cls, frames: Sequence[SceneFrame], prior: Prior, solver: Solver) -> RegionEvidence | None:
        """That of the regions of frames; None where these have none. Errors as of `estimate_pose`."""
        held = [frame for frame in frames if frame.regions]
        if not held:
            return None

        def estimated(known: Prior) -> PoseEstimate:
            if len(held) == 1:
                frame = held[0]
                return estimate_pose(frame.camera, frame.regions, frame.world_regions, prior=known, solver=solver)
            given = [Frame(frame.regions, frame.world_regions) for frame in held]
            return estimate_rig(held[0].camera, given, prior=known, solver=solver)

        images = [region for frame in frames for region in frame.regions]
        worlds = [region for frame in frames for region in frame.world_regions]
        starts = (0, *accumulate(len(frame.regions) for frame in frames[:-1]))
        return cls(
            estimated(prior),
            held[0].camera,
            (images, worlds),
            starts,
            lambda pose: estimated(prior.started_at(pose)),
        )

    def first_at(self, pose: Pose) -> RegionEvidence:
        """The same with the answer nearest to a pose first."""
        return replace(self, estimate=self.reestimate(pose))

    def moved(self, pose: Pose, covariance: NDArray[np.float64], solver: Solver) -> PoseEstimate:
        """The estimate with another pose, of this covariance (6, 6)."""
        return moved_estimate(self.estimate, pose, covariance, self.camera, *self.regions, solver)
