"""What the rest of a scene, its photo and its cloud away from the regions, says of the answers of an estimate."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, expit

from regionpose import _core
from regionpose.alignment.agreement import Alignment
from regionpose.alignment.focal import FocalEvidence
from regionpose.alignment.odds import COMMON, DECISIVE, weighed
from regionpose.alignment.refinement import SceneRefinement
from regionpose.alignment.visibility import Occlusion
from regionpose.estimation.answer import Alternative, PoseEstimate
from regionpose.estimation.warning import PoseWarning
from regionpose.pose import Pose

Array = NDArray[np.float64]

OF_OTHERS = {"ambiguous", "ambiguous-region"}
"""Warnings of other answers."""

MOST_MOVED = float(np.sqrt(chdtri(6.0, 0.0027)))
"""Mahalanobis distance of six parameters that chance exceeds as rarely as three standard deviations of one."""

OF_CONFIDENCE = {*OF_OTHERS, "low-confidence"}
"""Warnings that say no more than that the confidence is low."""


@dataclass(frozen=True, eq=False, repr=False)
class SceneWitness:
    """How photo and cloud agree at the pose, and what that led to.

    Parameters
    ----------
    alignments : tuple of Alignment or None
        Frame by frame, None of a frame without a cloud.
    confidence_before : float
        Of the pose, by the regions alone.
    place : int
        Where the regions alone had put the pose among the answers: 0 where photo and cloud chose no other.
    answers : int
        How many there are.
    refinement : SceneRefinement or None
        What the edges near the chosen answer did to the pose; None where they were not asked.

    """

    alignments: tuple[Alignment | None, ...]
    confidence_before: float
    place: int
    answers: int
    refinement: SceneRefinement | None = None

    @property
    def told(self) -> tuple[Alignment, ...]:
        """Those of the frames with a cloud."""
        return tuple(alignment for alignment in self.alignments if alignment is not None)

    @property
    def log_odds(self) -> float:
        """Logarithm of the odds for the pose that all frames make: each saw the scene by itself."""
        return _log_odds(self.alignments)

    @property
    def edge_log_odds(self) -> float:
        """The same of edges alone, whatever the pose hides."""
        return _edge_log_odds(self.alignments)

    def __repr__(self) -> str:
        """What photo and cloud said, in numbers."""
        parts = f"confidence_before={self.confidence_before:.3f}, place={self.place}, answers={self.answers}"
        return f"SceneWitness(log_odds={self.log_odds:.2f}, {parts})"

    def of_frame(self, index: int) -> SceneWitness:
        """What one frame said."""
        return replace(self, alignments=(self.alignments[index],))


class Witnessed(NamedTuple):
    """An estimate after the rest of the scene was heard, and what it said.

    Parameters
    ----------
    estimate : PoseEstimate
        With the answer first that photo and cloud agree with, refined if they say enough; its confidences and warnings
        are those after that.
    witness : SceneWitness
        How well they agree.

    """

    estimate: PoseEstimate
    witness: SceneWitness


def witnessed(
    estimate: PoseEstimate,
    align: Callable[[Pose], Sequence[Alignment | None]],
    settle: Callable[[Pose], PoseEstimate],
    refine: Callable[[PoseEstimate], tuple[PoseEstimate, SceneRefinement]] | None = None,
    counts: Sequence[int] = (),
) -> Witnessed:
    """The estimate with the answer first that photo and cloud agree with, and the confidences that follow.

    `align`: how well they agree at a pose, frame by frame; `settle`: the estimate that has the answer nearest to a pose
    first; `refine`: an estimate with its pose refined by them if they say enough, and what they said, of the focal
    lengths too, whose probability all shares are multiplied by; `counts`: how many regions each of several frames has.
    The evidence decides between answers and may lower the probability that one of them is right. It raises that for a
    refined pose alone, since photo and cloud may agree at one that is some degrees off (docs/math.md, eq. 18.5, 18.10
    and 18.14).
    """
    alignments, shares = _heard(estimate, align)
    place = _likeliest(estimate, shares)
    if place:
        estimate = settle(estimate.alternatives[place - 1].pose)
        alignments, shares = _heard(estimate, align)
    before, refinement = estimate.confidence, None
    moved: list[PoseWarning] = []
    if refine is not None and np.isfinite(estimate.covariance).all():
        given = estimate
        estimate, refinement = refine(given)
        moved = _contradiction(given, estimate)
        if refinement.refined:
            told = iter(refinement.alignments)
            alignments[0] = [None if frame is None else next(told) for frame in alignments[0]]
            shares = _of_refined(given, estimate, alignments)
    if refinement is not None and refinement.focal is not None:
        shares = shares * expit(refinement.focal.log_odds)
    witness = SceneWitness(tuple(alignments[0]), before, place, len(alignments), refinement)
    judged = _with_shares(estimate, shares)
    lead = witness.log_odds - max((_log_odds(other) for other in alignments[1:]), default=np.inf)
    # Before the rest: a low confidence is told where nothing else is.
    judged = replace(judged, warnings=(*judged.warnings, *moved))
    warnings = (*_warnings(judged, witness, lead), *_hidden_regions(witness.alignments, counts))
    return Witnessed(replace(judged, warnings=warnings), witness)


def _heard(
    estimate: PoseEstimate, align: Callable[[Pose], Sequence[Alignment | None]]
) -> tuple[list[Sequence[Alignment | None]], Array]:
    """How well photo and cloud agree at each answer, and the answers' shares (n,) after that."""
    alignments = [align(answer.pose) for answer in _answers(estimate)]
    before, edges = _shares(estimate), np.array([_edge_log_odds(frames) for frames in alignments])
    after = weighed(before, [_log_odds(frames) for frames in alignments] - edges)
    if edges.any():
        bound = 1.0 - COMMON
        after = weighed(after * bound / max(float(after.sum()), bound), edges)
    most, total = float(before.sum()), float(after.sum())
    return alignments, after * (most / total) if total > most else after


def _of_refined(given: PoseEstimate, refined: PoseEstimate, alignments: Sequence[Sequence[Alignment | None]]) -> Array:
    """The answers' shares (n,) after the first one's pose was refined: that it is the right place, which
    alignments speak for, and that the noise leaves it near the true pose, which the refined covariance says.
    """
    near = _core.nearness(given.covariance)
    after = weighed(_shares(given) / near, [_log_odds(frames) for frames in alignments])
    return np.asarray(after * np.array([_core.nearness(refined.covariance)] + [near] * (len(after) - 1)))


def _answers(estimate: PoseEstimate) -> list[PoseEstimate | Alternative]:
    return [estimate, *estimate.alternatives]


def _shares(estimate: PoseEstimate) -> Array:
    return np.array([answer.share for answer in _answers(estimate)])


def _confidences(estimate: PoseEstimate, shares: Array) -> Array:
    """The answers' confidences (n,) by shares (n,)."""
    turns = [answer.pose.rotation.as_quat() for answer in _answers(estimate)]
    return _core.together(np.stack(turns), shares)


def _likeliest(estimate: PoseEstimate, shares: Array) -> int:
    """The place of the answer of the largest confidence, and of those of the largest share among them."""
    return int(np.lexsort((-shares, -_confidences(estimate, shares)))[0])


def _with_shares(estimate: PoseEstimate, shares: Array) -> PoseEstimate:
    """The estimate with other shares (n,), and confidences by them."""
    first, *rest = zip(_confidences(estimate, shares).tolist(), shares.tolist(), strict=True)
    others = tuple(
        replace(other, confidence=confidence, share=share)
        for other, (confidence, share) in zip(estimate.alternatives, rest, strict=True)
    )
    return replace(estimate, confidence=first[0], share=first[1], alternatives=others)


def _log_odds(alignments: Sequence[Alignment | None]) -> float:
    return sum(alignment.log_odds for alignment in alignments if alignment is not None)


def _edge_log_odds(alignments: Sequence[Alignment | None]) -> float:
    return sum(alignment.edge_log_odds for alignment in alignments if alignment is not None)


def _warnings(estimate: PoseEstimate, witness: SceneWitness, lead: float) -> tuple[PoseWarning, ...]:
    """The warnings of an estimate, its confidence being that after the rest of the scene was heard; `lead`: the
    logarithm of the odds of its pose to the best of the others.
    """
    sure = estimate.confidence > _core.TRUSTED
    settled = OF_CONFIDENCE if sure else OF_OTHERS if lead >= DECISIVE else set()
    kept = [warning for warning in estimate.warnings if warning.code not in settled]
    focal = None if witness.refinement is None else witness.refinement.focal
    if focal is not None and focal.log_odds < -DECISIVE:
        kept.append(_other_focal_lengths(focal, witness.confidence_before))
    if witness.edge_log_odds < -DECISIVE:
        kept.append(_disagreement(witness))
    elif not sure and not kept:
        text = f"the confidence is {100.0 * estimate.confidence:.1f} %"
        kept.append(PoseWarning("low-confidence", text, values={"confidence": estimate.confidence}))
    return tuple(kept)


def _disagreement(witness: SceneWitness) -> PoseWarning:
    told = [alignment for alignment in witness.told if len(alignment.turned)]
    agrees = np.concatenate([alignment.agrees for alignment in told])
    share, steps, before = float(np.mean(agrees)), len(agrees), witness.confidence_before
    z = sum(alignment.lead for alignment in told) / float(np.hypot.reduce([one.deviation for one in told]))
    text = (
        f"away from the regions photo and cloud do not agree: {100.0 * share:.0f} % of {steps} steps of the cloud"
        f" lie on edges of the photo, {z:.1f} standard deviations above turned poses; the confidence falls"
        f" from {100.0 * before:.1f} %"
    )
    values = {"share": share, "steps": steps, "z": z, "confidence_before": before}
    return PoseWarning("scene-disagrees", text, values=values)


def _contradiction(given: PoseEstimate, refined: PoseEstimate) -> list[PoseWarning]:
    """A warning where the rest of the scene moved a pose by more than the regions leave open: one of them is wrong."""
    increment = given.pose.increment_to(refined.pose)
    sigmas = float(np.sqrt(increment @ np.linalg.solve(given.covariance, increment)))
    if sigmas <= MOST_MOVED:
        return []
    turned, shift = float(np.degrees(np.linalg.norm(increment[:3]))), float(np.linalg.norm(increment[3:]))
    text = (
        f"photo and cloud away from the regions lead to a pose {turned:.2f} deg and {shift:.3f} m from that of the"
        f" regions, {sigmas:.1f} of its standard deviations: one of them is wrong"
    )
    values = {"rotation_deg": turned, "shift_m": shift, "sigmas": sigmas}
    return [PoseWarning("regions-contradicted", text, values=values)]


def _other_focal_lengths(focal: FocalEvidence, before: float) -> PoseWarning:
    text = (
        f"photo and cloud agree better with {focal.factor:.3f} times the focal lengths of the camera, by odds of"
        f" {np.exp(-focal.log_odds):.3g} to 1; the confidence falls from {100.0 * before:.1f} %"
    )
    values = {"factor": focal.factor, "log_odds": focal.log_odds, "confidence_before": before}
    return PoseWarning("focal-contradicted", text, values=values)


def _hidden_regions(alignments: Sequence[Alignment | None], counts: Sequence[int]) -> Iterator[PoseWarning]:
    """A warning for each region that a pose hides, by its place among those of all frames."""
    firsts = np.cumsum([0, *counts])
    for first, alignment in zip(firsts.tolist(), alignments, strict=False):
        for place, occlusion in enumerate(() if alignment is None else alignment.occlusions):
            if occlusion.is_hidden:
                yield _hidden_region(first + place, occlusion)


def _hidden_region(region: int, occlusion: Occlusion) -> PoseWarning:
    text = (
        "the photo shows {0}, but at this pose {percent:.0f} % of it would be hidden by what the cloud has"
        " {distance_m:.1f} m from the camera, before the region at {region_distance_m:.1f} m"
    )
    values = {
        "percent": 100.0 * occlusion.share,
        "distance_m": occlusion.distance_m,
        "region_distance_m": occlusion.region_distance_m,
    }
    return PoseWarning("hidden-region", text, (region,), values)
