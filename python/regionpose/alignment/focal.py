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
from regionpose.alignment.pose_search import Density
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

NEARBY_M, NEARBY_DEG = 0.1, 2.0
"""Distance and turn within which a camera is taken to see the same edges: what they move by is less than focal lengths
do, and what it sees is within the margin of the field."""

CLOSER = 3
"""How many of them, the likeliest, are refined."""


@dataclass(frozen=True, eq=False)
class ByFocal:
    """The maxima near a pose by the focal lengths: in what a prior allows, or about the solution of regions, which
    moves with them.
    """

    frames: Sequence[EdgeFrame]
    about: Prior | PoseEstimate
    best: Hypothesis

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
            return cls(frames, prior, best)
        return cls(frames, regions, best) if is_covariance(regions.covariance) else None

    def visible_at(self, pose: Pose) -> list[_core.AlignmentFrame]:
        """The frames with the edges that are seen at a pose, or from nearby."""
        local = pose.rebase(self.frames[0].origin)
        for known, cores in self._viewed:
            turned_deg = np.degrees((local.rotation * known.rotation.inv()).magnitude())
            if np.linalg.norm(known.camera_center - local.camera_center) < NEARBY_M and turned_deg < NEARBY_DEG:
                return cores
        whole = isinstance(self.about, Prior)
        cores = [frame.visible_from(local.camera_center, [local], with_regions=whole) for frame in self.frames]
        self._viewed.append((local, cores))
        return cores

    @cached_property
    def _viewed(self) -> list[tuple[Pose, list[_core.AlignmentFrame]]]:
        """Poses at which edges were detected, and these."""
        return []

    def maximum(
        self, cores: Sequence[_core.AlignmentFrame], log_focal: float, start: Pose, spread: int = 3
    ) -> EdgeMode | None:
        """The one reached from a start with focal lengths of this logarithm over the given ones, by edges no finer
        than a spread, by its number. All are by the same weights: what these are off by decides nothing.
        """
        pairs = zip(self.frames, cores, strict=True)
        zoomed = [frame.zoomed(core.at_spread(spread), log_focal) for frame, core in pairs]
        return self._density(log_focal).maximum(zoomed, start, self._weights(spread))

    def _weights(self, spread: int) -> _core.LocalWeights:
        """Weights of edges no finer than a spread, with the given focal lengths at the best pose."""
        if spread not in self._made_weights:
            cores, local = self.visible_at(self.best.pose), self.best.pose.rebase(self.frames[0].origin)
            coarse = [core.at_spread(spread) for core in cores]
            self._made_weights[spread] = _core.LocalWeights(coarse, local.rotation.as_matrix(), local.translation)
        return self._made_weights[spread]

    @cached_property
    def _made_weights(self) -> dict[int, _core.LocalWeights]:
        """Weights by spread."""
        return {}

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


def focal_evidence(by_focal: ByFocal, progress: Progress | None = None) -> FocalEvidence:
    """What the edges show of the focal lengths of the camera of all frames."""
    pose = by_focal.best.pose
    cores, shift = by_focal.visible_at(pose), _derivative(by_focal)
    way, given = np.nan_to_num(shift), _gain(by_focal.maximum(cores, 0.0, pose))

    found: dict[float, EdgeMode | None] = {}
    for numbers, _ in with_progress(GROUPS, part(progress, 0.0, 0.6)):
        # Longer focal lengths move the camera, which then sees other edges.
        middle = pose.retract(float(np.mean(numbers)) * STEPS[0] * way)
        there = by_focal.visible_at(middle)
        for step in (number * STEPS[0] for number in numbers):
            found[step] = by_focal.maximum(there, step, pose.retract(step * way), 2)
    gains: dict[float, float] = {}
    likeliest = sorted(found, key=lambda step: _gain(found[step]), reverse=True)[:CLOSER]
    for step, _ in with_progress(likeliest, part(progress, 0.6, 1.0)):
        gains |= _closer(by_focal, step, found[step], given)
    factor = max(gains, key=lambda step: gains[step], default=0.0)
    count = len(found) * STEPS[0] / STEPS[2]
    prior = np.log(1.0 - SHARED_ERROR_PRIOR) - np.log(SHARED_ERROR_PRIOR / count)
    log_odds = float(prior - np.logaddexp.reduce([0.0, *gains.values()]))
    return FocalEvidence(log_odds, float(np.exp(factor)) if gains.get(factor, 0.0) > 0.0 else 1.0, 0.01 * shift)


def _gain(mode: EdgeMode | None) -> float:
    """Logarithm of the odds of a maximum and chance over chance: less likely than that it decides nothing."""
    return 0.0 if mode is None else float(np.logaddexp(0.0, mode.log_mass))


def _closer(by_focal: ByFocal, log_focal: float, mode: EdgeMode | None, given: float) -> dict[float, float]:
    """By how much the finest edges about a logarithm of the focal lengths exceed a gain of the given ones, by coarse
    maxima there and the edges that are seen from these.
    """
    if mode is None:
        return {}
    cores = by_focal.visible_at(mode.pose)
    steps = [log_focal + sign * STEPS[1] for sign in (-1, 0, 1)]
    middles = {step: by_focal.maximum(cores, step, mode.pose, 2) for step in steps}
    middle = max(middles, key=lambda each: _gain(middles[each]))
    coarse = middles[middle]
    if coarse is None:
        return {}
    # Edges that are visible from elsewhere may agree better for any focal lengths.
    given = max(given, _gain(by_focal.maximum(cores, 0.0, by_focal.best.pose)))
    ends = (middle - STEPS[2], middle, middle + STEPS[2])
    return {each: _gain(by_focal.maximum(cores, each, coarse.pose)) - given for each in ends}


def _derivative(by_focal: ByFocal) -> Array:
    """The derivative (6,) of the pose by the logarithm of the focal lengths; NaN where that is not found."""
    if by_focal.best.mode is None:
        return by_focal.shift
    pose, steps = by_focal.best.pose, (-FOCAL_STEP, FOCAL_STEP)
    cores = by_focal.visible_at(pose)
    ends = [by_focal.maximum(cores, step, pose.retract(step * by_focal.shift)) for step in steps]
    low, high = (None if mode is None else pose.local_coordinates(mode.pose) for mode in ends)
    return np.full(6, np.nan) if low is None or high is None else np.asarray((high - low) / (2.0 * FOCAL_STEP))
