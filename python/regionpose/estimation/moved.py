"""An estimate whose pose something else than its regions has made better known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.estimation.answer import PoseEstimate
from regionpose.estimation.options import Solver
from regionpose.estimation.sides import core_problem
from regionpose.estimation.warning import PoseWarning
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion

Array = NDArray[np.float64]


def moved_estimate(
    estimate: PoseEstimate,
    pose: Pose,
    covariance: Array,
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
) -> PoseEstimate:
    """The estimate with a pose near its own, of this covariance (6, 6): overlap errors, and whether the geometry is
    weak, are told anew.
    """
    problem = core_problem(camera, image_regions, world_regions, Solver())
    parts = pose.rotation_matrix, pose.translation
    whole, errors = problem.overlap_errors(*parts)
    weak = problem.weak_geometry(*parts, covariance)
    kept = [warning for warning in estimate.warnings if warning.code != "weak-geometry"]
    if weak is not None:
        code, text, regions, values = weak
        kept.append(PoseWarning(code, text, tuple(regions), values))
    return replace(
        estimate,
        pose=pose,
        covariance=covariance,
        overlap_error=whole,
        region_overlap_errors=errors,
        warnings=tuple(kept),
    )
