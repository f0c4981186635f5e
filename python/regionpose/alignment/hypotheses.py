"""Hypotheses of the pose by regions, by edges and by both, their clusters and probabilities (docs/math.md, section
18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.alignment.odds import HIDDEN, SHARED_ERROR_PRIOR
from regionpose.geometry.pose import Pose
from regionpose.solve.edge_diagnostics import EdgeMode
from regionpose.solve.estimate import Alternative, PoseEstimate

Array = NDArray[np.float64]

SAME_DEG, SAME_M = 5.0, 1.0
"""Poses within so much of one another are one cluster: the confidence is that of the rotation within 5 degrees, and
what moves the camera by a meter moves what it shows at 10 m by as much."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """An explanation of photos and clouds: a pose with its covariance (6, 6), and the logarithm of its probability but
    for a constant.

    `solution`: the number of the regions' solution that it is about; None of edges alone. `mode`: the edges' maximum,
    whose covariance is of their noise alone; None where these are taken to be uninformative.
    """

    pose: Pose
    covariance: Array
    log_weight: float
    solution: int | None = None
    mode: EdgeMode | None = None


@dataclass(frozen=True, eq=False)
class Cluster:
    """Hypotheses whose poses nearly agree, the likeliest first."""

    hypotheses: tuple[Hypothesis, ...]

    @property
    def best(self) -> Hypothesis:
        """The likeliest."""
        return self.hypotheses[0]

    @property
    def log_weight(self) -> float:
        """Of all of them."""
        return log_sum(self.hypotheses)

    def covariance(self, exposure: Array) -> Array:
        """That (6, 6) about the likeliest pose, each counting by its weight; `exposure`: what whole exposures and the
        calibration add to the noise of edges.
        """
        finite = [each for each in self.hypotheses if np.isfinite(each.covariance).all()]
        if self.best not in finite:
            return self.best.covariance
        probabilities = np.exp(np.array([each.log_weight for each in finite]) - log_sum(finite))
        total = np.zeros((6, 6))
        for probability, each in zip(probabilities, finite, strict=True):
            way = self.best.pose.local_coordinates(each.pose)
            total += probability * (each.covariance + np.outer(way, way) + (0.0 if each.mode is None else exposure))
        return total

    @property
    def solution(self) -> int | None:
        """The number of the regions' solution that is likeliest there; None where there is none."""
        return next((each.solution for each in self.hypotheses if each.solution is not None), None)


def log_sum(hypotheses: Sequence[Hypothesis]) -> float:
    """Logarithm of the weights of hypotheses together."""
    return float(np.logaddexp.reduce([each.log_weight for each in hypotheses])) if hypotheses else -np.inf


def clusters_of(hypotheses: Sequence[Hypothesis]) -> list[Cluster]:
    """Hypotheses grouped about likelier ones, the likeliest cluster first."""
    clusters: list[list[Hypothesis]] = []
    for each in sorted(hypotheses, key=lambda each: each.log_weight, reverse=True):
        own = next((cluster for cluster in clusters if is_same(cluster[0].pose, each.pose)), None)
        if own is None:
            clusters.append([each])
        else:
            own.append(each)
    return sorted((Cluster(tuple(own)) for own in clusters), key=lambda cluster: cluster.log_weight, reverse=True)


def is_same(pose: Pose, other: Pose) -> bool:
    """Whether two poses belong to one cluster."""
    turn = np.degrees((pose.rotation * other.rotation.inv()).magnitude())
    return bool(turn <= SAME_DEG and np.linalg.norm(pose.camera_center - other.camera_center) <= SAME_M)


def solutions_of(estimate: PoseEstimate) -> list[PoseEstimate | Alternative]:
    """The solutions of an estimate of regions, the likeliest first."""
    return [estimate, *estimate.diagnostics.alternatives]


def priors_of(estimate: PoseEstimate, hidden: Sequence[bool]) -> Array:
    """Probabilities (n,) of the solutions of an estimate before edges are compared: that each is right, of
    which some hide a region; what they leave of 1 is that none is.
    """
    others = [other.mode_probability for other in estimate.diagnostics.alternatives]
    probabilities = np.array([estimate.diagnostics.mode_probability, *others])
    near = np.array([_rotation_confidence(solution.covariance) for solution in solutions_of(estimate)])
    probabilities = np.clip(probabilities / np.maximum(near, 1e-12), 0.0, 1.0)
    probabilities /= max(float(probabilities.sum()), 1.0)
    none = 1.0 - float(probabilities.sum())
    weights = probabilities * np.exp(HIDDEN * np.array(hidden, dtype=np.float64))
    total = float(weights.sum()) + none
    probabilities = weights / total if total > 0.0 else weights
    return np.asarray(probabilities * min(1.0, (1.0 - SHARED_ERROR_PRIOR) / max(float(probabilities.sum()), 1e-12)))


def confidences_of(clusters: Sequence[Cluster], none: float) -> Array:
    """Probabilities (n,) that clusters are right, of one another and of none of them, whose weight is `none`."""
    weights = np.array([cluster.log_weight for cluster in clusters])
    rest = np.log(max(none, 1e-300))
    return np.asarray(np.exp(weights - np.logaddexp(np.logaddexp.reduce(weights), rest)))


def _rotation_confidence(covariance: Array) -> float:
    return float(_core.rotation_confidence(covariance)) if np.isfinite(covariance).all() else 1.0
