"""From clusters of hypotheses to an estimate: confidence, covariance, alternatives and warnings
(docs/math.md, section 18).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, expit

from regionpose import _core
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.hypotheses import Cluster, confidences_of, solutions_of
from regionpose.alignment.odds import DECISIVE
from regionpose.alignment.region_evidence import RegionEvidence
from regionpose.solve.edge_diagnostics import Alignment, FocalEvidence, Occlusion
from regionpose.solve.estimate import Alternative, Diagnostics, PoseEstimate
from regionpose.solve.options import Solver
from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode

Array = NDArray[np.float64]

AMBIGUOUS_PROBABILITY = 0.02
"""Probability of another cluster from which on a pose is ambiguous: a convention, less than the 3 % that a trusted pose
may lack."""

LISTED_PROBABILITY = 1e-3
"""Least probability of a cluster by edges alone that is listed beside solutions of regions: a convention."""

OF_AMBIGUITY = {WarningCode.AMBIGUOUS_POSE, WarningCode.AMBIGUOUS_REGION}
"""Warnings that other poses fit about as well."""

OF_CONFIDENCE = {*OF_AMBIGUITY, WarningCode.LOW_CONFIDENCE}
"""Warnings of a low confidence alone."""

MOST_SIGMAS = float(np.sqrt(chdtri(6.0, 0.0027)))
"""Mahalanobis distance of six parameters that chance exceeds as rarely as three standard deviations of one."""


@dataclass(frozen=True, eq=False)
class Assessment:
    """The hypotheses after edges were compared: `clusters`, the likeliest first, `none`, the weight of none of them,
    and the evidence of focal lengths.
    """

    frames: Sequence[EdgeFrame]
    clusters: Sequence[Cluster]
    none: float
    focal: FocalEvidence | None
    solver: Solver

    def by_edges(self) -> PoseEstimate:
        """The estimate of the likeliest cluster without regions."""
        shift = self._focal_shift(np.zeros(6))
        covariance, probabilities = self._covariance(shift, self._pixel_angle), self._probabilities
        diagnostics = Diagnostics(
            mode_probability=float(probabilities[0]),
            overlap_error=np.nan,
            region_overlap_errors=np.empty(0),
            boundary_noise_px=np.nan,
            outlier_fraction=None,
            alternatives=self._alternatives(None),
            converged=True,
            termination="a maximum of the posterior",
            evaluations=0,
            distance_m=float(np.median([frame.distance_m(self.clusters[0].best.pose) for frame in self.frames])),
            focal_shift=shift,
            pixel_angle_rad=self._pixel_angle,
        )
        confidence = float(probabilities[0]) * _core.rotation_confidence(covariance)
        estimate = PoseEstimate(self.clusters[0].best.pose, covariance, confidence, (), diagnostics)
        warnings = [*self._of_focal, *_ambiguity(estimate, None), *_weakness(estimate, self.solver)]
        return replace(estimate, warnings=(*warnings, *_doubt(estimate, warnings)))

    def with_regions(self, regions: RegionEvidence, solutions: PoseEstimate) -> PoseEstimate:
        """The estimate of the likeliest cluster; `regions`: with the solution first that is there, if any is;
        `solutions`: those by which clusters are numbered.
        """
        best, probabilities, base = self.clusters[0].best, self._probabilities, regions.estimate
        shift = self._focal_shift(base.diagnostics.focal_shift)
        covariance = self._covariance(shift, base.diagnostics.pixel_angle_rad)
        reevaluated = regions.estimate_at(best.pose, covariance, self.solver)
        near = _core.rotation_confidence(covariance) if np.isfinite(covariance).all() else 1.0
        confidence = float(probabilities[0]) * near
        diagnostics = replace(
            reevaluated.diagnostics,
            mode_probability=confidence,
            alternatives=self._alternatives(solutions),
            focal_shift=shift,
        )
        estimate = replace(reevaluated, confidence=confidence, diagnostics=diagnostics)
        kept = [warning for warning in reevaluated.warnings if warning.code not in OF_CONFIDENCE]
        warnings = [*kept, *self._of_focal, *_ambiguity(estimate, solutions), *self._contradiction(base)]
        warnings += self._disagreement(solutions, estimate.confidence)
        return replace(estimate, warnings=(*warnings, *_doubt(estimate, warnings)))

    @property
    def _probabilities(self) -> Array:
        """Probabilities (n,) of the clusters, with the given focal lengths."""
        given = 1.0 if self.focal is None else float(expit(self.focal.log_odds))
        return confidences_of(self.clusters, self.none) * given

    @property
    def _pixel_angle(self) -> float:
        return float(np.mean([frame.pixel_angle_rad for frame in self.frames]))

    @property
    def _of_focal(self) -> tuple[PoseWarning, ...]:
        """That other focal lengths are likelier, in spite of what a calibration counts."""
        if self.focal is None or self.focal.log_odds > -DECISIVE:
            return ()
        values = {"factor": self.focal.factor, "log_odds": -self.focal.log_odds}
        return (PoseWarning(WarningCode.FOCAL_LENGTH_CONFLICT, values=values),)

    def _focal_shift(self, default: Array) -> Array:
        """The derivative (6,) of the pose by the logarithm of the focal lengths."""
        return default if self.focal is None else 100.0 * self.focal.shift

    def _covariance(self, focal_shift: Array, pixel_angle_rad: float) -> Array:
        """The covariance (6, 6) of the likeliest cluster."""
        sigma = np.repeat([np.radians(self.solver.frame_sigma_deg), self.solver.frame_sigma_m], 3)
        exposure = np.diag(np.square(sigma)) / len(self.frames)
        exposure += self.solver.calibration_covariance(focal_shift, pixel_angle_rad)
        return self.clusters[0].covariance(exposure)

    def _alternatives(self, regions: PoseEstimate | None) -> tuple[Alternative, ...]:
        """The other clusters, likeliest first; with the regions' fit of those that are solutions of theirs."""
        solutions = [] if regions is None else solutions_of(regions)
        found = []
        for cluster, probability in zip(self.clusters[1:], self._probabilities[1:].tolist(), strict=True):
            solution = None if cluster.solution is None else solutions[cluster.solution]
            if regions is not None and solution is None and probability < LISTED_PROBABILITY:
                continue
            fit = solution.diagnostics if isinstance(solution, PoseEstimate) else solution
            errors = np.empty(0) if fit is None else fit.region_overlap_errors
            whole = np.nan if fit is None else fit.overlap_error
            covariance = cluster.covariance(np.zeros((6, 6)))
            found.append(Alternative(cluster.best.pose, covariance, probability, probability, whole, errors))
        return tuple(found)

    def _contradiction(self, regions: PoseEstimate) -> list[PoseWarning]:
        """A warning where the pose by edges is an outlier of the regions' covariance: one of them is wrong."""
        pose, covariance = self.clusters[0].best.pose, regions.covariance
        increment = regions.pose.local_coordinates(pose)
        if not np.isfinite(covariance).all():
            return []
        sigmas = float(np.sqrt(increment @ np.linalg.solve(covariance, increment)))
        if sigmas <= MOST_SIGMAS:
            return []
        turned, shift = float(np.degrees(np.linalg.norm(increment[:3]))), float(np.linalg.norm(increment[3:]))
        values = {"rotation_deg": turned, "shift_m": shift, "sigmas": sigmas}
        return [PoseWarning(WarningCode.REGION_EDGE_CONFLICT, values=values)]

    def _disagreement(self, regions: PoseEstimate, confidence: float) -> list[PoseWarning]:
        """A warning where edges are in view at the pose of regions and lie on those of the photo no better than by
        chance, which costs it its trust.
        """
        agreeing = [each.log_weight for each in self.clusters[0].hypotheses if each.mode is not None]
        if not (agreeing and self.clusters[0].best.mode is None and confidence < _core.TRUSTED <= regions.confidence):
            return []
        values = {"confidence_before": regions.confidence, "confidence": confidence}
        return [PoseWarning(WarningCode.EDGE_MISMATCH, values=values)]


def hidden_regions(alignments: Sequence[Alignment], starts: Sequence[int]) -> Iterator[PoseWarning]:
    """A warning for each region that a pose hides; `starts`: the index of each frame's first region among all."""
    for alignment, first in zip(alignments, starts, strict=True):
        for number, occlusion in enumerate(alignment.occlusions):
            if occlusion.is_hidden:
                yield _hidden_region(first + number, occlusion)


def _hidden_region(region: int, occlusion: Occlusion) -> PoseWarning:
    values = {
        "hidden_fraction": occlusion.hidden_fraction,
        "distance_m": occlusion.distance_m,
        "region_distance_m": occlusion.region_distance_m,
    }
    return PoseWarning(WarningCode.OCCLUDED_REGION, (region,), values)


def _ambiguity(estimate: PoseEstimate, regions: PoseEstimate | None) -> list[PoseWarning]:
    """That other clusters are about as likely; the regions' warning of that where there is one, which names the region
    at fault.
    """
    others = [other for other in estimate.diagnostics.alternatives if other.mode_probability > AMBIGUOUS_PROBABILITY]
    if not others:
        return []
    given = [] if regions is None else [each for each in regions.warnings if each.code in OF_AMBIGUITY]
    if given:
        return given
    turns = [np.degrees((other.pose.rotation * estimate.pose.rotation.inv()).magnitude()) for other in others]
    moves = [float(np.linalg.norm(other.pose.camera_center - estimate.pose.camera_center)) for other in others]
    values = {"others": len(others), "rotation_deg": float(min(turns)), "shift_m": min(moves)}
    return [PoseWarning(WarningCode.AMBIGUOUS_POSE, values=values)]


def _weakness(estimate: PoseEstimate, solver: Solver) -> list[PoseWarning]:
    """That the deviations of an estimate by edges are larger than those of a trusted pose."""
    most_deg, fraction = solver.limits
    turn, shift = float(estimate.sigma.rotation_deg.max()), float(estimate.sigma.translation_m.max())
    # So, for NaN, too.
    if turn <= most_deg and shift <= fraction * estimate.diagnostics.distance_m:
        return []
    values = {
        "rotation_sigma_deg": turn,
        "translation_sigma_m": shift,
        "max_rotation_sigma_deg": most_deg,
        "max_translation_sigma_m": fraction * estimate.diagnostics.distance_m,
    }
    return [PoseWarning(WarningCode.WEAK_GEOMETRY, values=values)]


def _doubt(estimate: PoseEstimate, warnings: Sequence[PoseWarning]) -> list[PoseWarning]:
    """A low confidence, where no other warning explains it."""
    causes = {*OF_AMBIGUITY, WarningCode.EDGE_MISMATCH, WarningCode.FOCAL_LENGTH_CONFLICT}
    if estimate.confidence >= _core.TRUSTED or any(warning.code in causes for warning in warnings):
        return []
    return [PoseWarning(WarningCode.LOW_CONFIDENCE, values={"confidence": estimate.confidence})]
