"""An estimate of regions at a pose, and of a covariance, that further evidence such as edges gave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.core_inputs import core_problem
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.options import Solver
from regionpose.solve.warning import PoseWarning, warning_from_core
from regionpose.solve.warning_code import WarningCode

Array = NDArray[np.float64]


def estimate_at(
    estimate: PoseEstimate,
    pose: Pose,
    covariance: Array,
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    solver: Solver,
) -> PoseEstimate:
    """The estimate with a pose near its own, of this covariance (6, 6): overlap errors, and whether the standard
    deviations are within the solver's limits, are evaluated at it.
    """
    problem = core_problem(camera, image_regions, world_regions, solver)
    whole, errors = problem.overlap_errors(pose.rotation_matrix, pose.translation)
    return replace(
        estimate,
        pose=pose,
        covariance=covariance,
        diagnostics=replace(estimate.diagnostics, overlap_error=whole, region_overlap_errors=errors),
        warnings=_with_geometry(estimate.warnings, problem, pose, covariance, solver.limits),
    )


def scattered_estimate(
    estimate: PoseEstimate,
    pose: Pose,
    covariance: Array,
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    solver: Solver,
) -> PoseEstimate:
    """The estimate of frames that scatter, with the pose and covariance (6, 6) that allow for it, and what follows from
    them: probabilities and confidences (docs/math.md, eq. 15.1), and the covariances of other solutions, larger by the
    same factor on the mean.
    """
    near = _core.rotation_confidence(covariance) / _core.rotation_confidence(estimate.covariance)
    factor = max(
        1.0, float(np.trace(np.linalg.pinv(estimate.covariance, hermitian=True) @ covariance)) / len(covariance)
    )
    reevaluated = estimate_at(estimate, pose, covariance, camera, image_regions, world_regions, solver)
    alternatives = tuple(
        replace(
            other,
            covariance=factor * other.covariance,
            confidence=min(1.0, near * other.confidence),
            mode_probability=min(1.0, near * other.mode_probability),
        )
        for other in estimate.diagnostics.alternatives
    )
    mode_probability = min(1.0, near * estimate.diagnostics.mode_probability)
    diagnostics = replace(reevaluated.diagnostics, mode_probability=mode_probability, alternatives=alternatives)
    return replace(reevaluated, confidence=min(1.0, near * estimate.confidence), diagnostics=diagnostics)


def _with_geometry(
    warnings: Sequence[PoseWarning],
    problem: _core.Problem,
    pose: Pose,
    covariance: Array,
    limits: tuple[float, float],
) -> tuple[PoseWarning, ...]:
    """The warnings, whether the standard deviations are within the limits evaluated at the pose."""
    kept = [warning for warning in warnings if warning.code != WarningCode.WEAK_GEOMETRY]
    weak = problem.weak_geometry(pose.rotation_matrix, pose.translation, covariance, limits=limits)
    if weak is not None:
        kept.append(warning_from_core(weak))
    return tuple(kept)
