"""The regions' estimate of the pose, before edges are compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.options import Solver
from regionpose.solve.prior import Prior
from regionpose.solve.reevaluate import estimate_at
from regionpose.solve.rig import estimate_rig
from regionpose.solve.single import estimate_pose


@dataclass(frozen=True, eq=False)
class RegionEvidence:
    """The estimate of regions alone.

    `regions`: on both sides, of all frames, one frame after the other, as `camera` sees them. `starts`: for each frame
    with a photo and a cloud the place of its first region among them. `reestimate`: the estimate with the solution
    nearest to a pose first.
    """

    estimate: PoseEstimate
    camera: Camera
    regions: tuple[Sequence[ImageRegion], Sequence[WorldRegion]]
    starts: tuple[int, ...]
    reestimate: Callable[[Pose], PoseEstimate]

    @classmethod
    def of(cls, frames: Sequence[PhotoCloud], prior: Prior, solver: Solver) -> RegionEvidence | None:
        """That of the regions of frames; None where these have none. Errors as of `estimate_pose`."""
        given = [frame.frame for frame in frames]
        held = [frame for frame in given if frame.image_regions]
        if not held:
            return None
        camera = frames[0].camera

        def estimated(known: Prior) -> PoseEstimate:
            if len(held) == 1:
                frame = held[0]
                return estimate_pose(camera, frame.image_regions, frame.world_regions, prior=known, solver=solver)
            return estimate_rig(camera, held, prior=known, solver=solver)

        images = [region for frame in given for region in frame.image_regions]
        worlds = [region for frame in given for region in frame.world_regions]
        starts = (0, *accumulate(len(frame.image_regions) for frame in given[:-1]))
        return cls(
            estimated(prior),
            camera,
            (images, worlds),
            starts,
            lambda pose: estimated(prior.started_at(pose)),
        )

    def first_at(self, pose: Pose) -> RegionEvidence:
        """The same with the solution nearest to a pose first."""
        return replace(self, estimate=self.reestimate(pose))

    def estimate_at(self, pose: Pose, covariance: NDArray[np.float64], solver: Solver) -> PoseEstimate:
        """The estimate reevaluated at another pose, of this covariance (6, 6)."""
        return estimate_at(self.estimate, pose, covariance, self.camera, *self.regions, solver)
