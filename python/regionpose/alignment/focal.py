"""Whether other focal lengths explain the edges of photos and clouds better than the given ones, and what these do to
the pose (docs/math.md, section 18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.explanations import is_covariance
from regionpose.alignment.hypotheses import Hypothesis
from regionpose.alignment.odds import SHARED_ERROR_PRIOR
from regionpose.alignment.pose_search import Density, log_mass
from regionpose.cameras.matrix import MatrixCamera
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, part, with_progress
from regionpose.solve.edge_diagnostics import EdgeMode, FocalEvidence
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.prior import Prior

Array = NDArray[np.float64]

FOCAL_STEP = 0.01
"""Change of the logarithm of the focal lengths over which the pose's derivative is taken: a percent."""

STEPS = (0.03, 0.015, 0.0075)
"""Steps of the logarithm by which others are tried: the first two by the edges of the spread of 4 pixels, within
which half a step moves most of what a photo of 1,000 pixels shows, the last by the finest ones. By 8 pixels right focal
lengths do not stand out."""

GROUPS = ((-7, -6, -5, -4), (-3, -2, -1), (1, 2, 3), (4, 5, 6, 7))
"""Which of the widest steps are tried, a fifth up and down, as another setting of a zoom lens or a data sheet may
be off; those of a group by the edges that are visible from the pose in its middle."""

NEARBY_M = 0.1
"""Distance within which a camera is taken to see the same edges: what they move by is less than focal lengths do."""

CLOSER = 3
"""How many of them, the likeliest, are refined."""


@dataclass(frozen=True, eq=False)
class ByFocal:
    """The maxima near a pose by the focal lengths: in what a prior allows, or about the solution of regions, which
    moves with them.
    """

    frames: Sequence[EdgeFrame]
    about: Prior | PoseEstimate

    @classmethod
    def of(
        cls, frames: Sequence[EdgeFrame], best: Hypothesis, prior: Prior, regions: PoseEstimate | None
    ) -> ByFocal | None:
        """About the best hypothesis; `regions`: the estimate whose first solution it may be about. None of cameras that
        have no focal lengths, and of regions that leave a direction free.
        """
        if not all(isinstance(frame.camera, MatrixCamera) for frame in frames):
            return None
        if best.solution is None or regions is None:
            return cls(frames, prior)
        return cls(frames, regions) if is_covariance(regions.covariance) else None

    def visible_at(self, pose: Pose) -> list[_core.AlignmentFrame]:
        """The frames with the edges that are visible at a pose, or from nearby."""
        center = pose.rebase(self.frames[0].origin).camera_center
        for known, cores in self._visible:
            if np.linalg.norm(known - center) < NEARBY_M:
                return cores
        cores = [frame.visible_from(center, with_regions=isinstance(self.about, Prior)) for frame in self.frames]
        self._visible.append((center, cores))
        return cores

    @cached_property
    def _visible(self) -> list[tuple[Array, list[_core.AlignmentFrame]]]:
        """Viewpoints of edges that were found, with their frames."""
        return []

    def maxima(
        self, cores: Sequence[_core.AlignmentFrame], log_focal: float, start: Pose, spread: int = 3
    ) -> list[EdgeMode]:
        """Those that the descent from a start reaches with focal lengths of this logarithm over the given ones, by
        edges no finer than a spread, by its number.
        """
        pairs = zip(self.frames, cores, strict=True)
        zoomed = [frame.zoomed(core.at_spread(spread), log_focal) for frame, core in pairs]
        return self._density(log_focal).maxima(zoomed, [start])

    def _density(self, log_focal: float) -> Density:
        origin, about = self.frames[0].origin, self.about
        if isinstance(about, Prior):
            return Density.of_prior(about, origin)
        pose = about.pose.retract(log_focal * self.shift)
        # The second order is as large as the first one for each unit of the logarithm: what is known of it.
        bend = log_focal**2 * self.shift
        return Density.student(pose, about.covariance + np.outer(bend, bend), origin)

    @property
    def shift(self) -> Array:
        """The derivative (6,) of the regions' pose by the logarithm; zero of a prior's, and where it isn't known."""
        return np.zeros(6) if isinstance(self.about, Prior) else np.nan_to_num(self.about.diagnostics.focal_shift)


def focal_evidence(by_focal: ByFocal, best: Hypothesis, progress: Progress | None = None) -> FocalEvidence:
    """The edges' evidence of the focal lengths of the camera of all frames."""
    cores = by_focal.visible_at(best.pose)
    shift = _derivative(by_focal, cores, best)
    way, given = np.nan_to_num(shift), _gain(by_focal.maxima(cores, 0.0, best.pose))

    found: dict[float, list[EdgeMode]] = {}
    for numbers, _ in with_progress(GROUPS, part(progress, 0.0, 0.6)):
        # Longer focal lengths move the camera, which then sees other edges.
        middle = best.pose.retract(float(np.mean(numbers)) * STEPS[0] * way)
        there = by_focal.visible_at(middle)
        for step in (number * STEPS[0] for number in numbers):
            found[step] = by_focal.maxima(there, step, best.pose.retract(step * way), 2)
    gains: dict[float, float] = {}
    likeliest = sorted(found, key=lambda step: _gain(found[step]), reverse=True)[:CLOSER]
    for step, _ in with_progress(likeliest, part(progress, 0.6, 1.0)):
        gains |= {each: gain - given for each, gain in _closer(by_focal, step, found[step]).items()}
    factor = max(gains, key=lambda step: gains[step], default=0.0)
    count = len(found) * STEPS[0] / STEPS[2]
    prior = np.log(1.0 - SHARED_ERROR_PRIOR) - np.log(SHARED_ERROR_PRIOR / count)
    log_odds = float(prior - np.logaddexp.reduce([0.0, *gains.values()]))
    return FocalEvidence(log_odds, float(np.exp(factor)) if gains.get(factor, 0.0) > 0.0 else 1.0, 0.01 * shift)


def _gain(modes: Sequence[EdgeMode]) -> float:
    """Logarithm of the odds of maxima and chance over chance: less likely than that they decide nothing."""
    return float(np.logaddexp(0.0, log_mass(modes)))


def _closer(by_focal: ByFocal, log_focal: float, modes: Sequence[EdgeMode]) -> dict[float, float]:
    """Gains by the finest edges about a logarithm of the focal lengths, by coarse maxima there and the edges that are
    visible from these.
    """
    if not modes:
        return {}
    pose, cores = modes[0].pose, by_focal.visible_at(modes[0].pose)
    middles = {
        log_focal + sign * STEPS[1]: by_focal.maxima(cores, log_focal + sign * STEPS[1], pose, 2) for sign in (-1, 0, 1)
    }
    middle = max(middles, key=lambda each: _gain(middles[each]))
    if not middles[middle]:
        return {}
    pose = middles[middle][0].pose
    return {each: _gain(by_focal.maxima(cores, each, pose)) for each in (middle - STEPS[2], middle, middle + STEPS[2])}


def _derivative(by_focal: ByFocal, cores: Sequence[_core.AlignmentFrame], best: Hypothesis) -> Array:
    """The derivative (6,) of the pose by the logarithm of the focal lengths; NaN where that is not found."""
    if best.mode is None:
        return by_focal.shift
    steps = (-FOCAL_STEP, FOCAL_STEP)
    ends = [by_focal.maxima(cores, step, best.pose.retract(step * by_focal.shift)) for step in steps]
    if not all(ends):
        return np.full(6, np.nan)
    low, high = (best.pose.local_coordinates(modes[0].pose) for modes in ends)
    return np.asarray((high - low) / (2.0 * FOCAL_STEP))
