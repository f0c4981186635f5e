"""Whether other focal lengths explain the edges of photo and cloud better than the given ones, and what these do to the
pose (docs/math.md, eq. 18.13 to 18.15).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from regionpose.cameras import Camera
from regionpose.cameras.matrix import MatrixCamera
from regionpose.estimation.answer import PoseEstimate
from regionpose.pose import Pose
from regionpose.witness.evidence import Evidence
from regionpose.witness.frame import SceneFrame
from regionpose.witness.odds import COMMON, DECISIVE
from regionpose.witness.posterior import Peak, Posterior, Seen, log_odds_of, root_of

Array = NDArray[np.float64]
Estimated = Callable[[Camera, Pose], PoseEstimate]
"""The estimate of the same regions with another camera, started at a pose."""

REACH = 0.2
"""Logarithm of the longest focal lengths, over the given ones, with which the regions' pose is asked for, and the
shortest: 22 % off, as another setting of a zoom lens or a data sheet may be."""

NODES = (-0.2, -0.1, 0.0, 0.1, 0.2)
"""Logarithms about which the edges are asked, and of which the poses follow from those three."""

SPREAD = 0.05
"""Standard deviation of the logarithm about each: such normal distributions, half as wide as they are apart, add up to
an even one, up to 28 % off."""

GIVEN_SPREAD = 0.01
"""Standard deviation of the logarithm about the given ones, if these are right: a percent, twice what a calibration is
good for (`estimation.intrinsics.WEAK_SHARE`)."""

OTHER = 2.0 * GIVEN_SPREAD
"""Logarithm beyond which focal lengths are others than the given ones."""


@dataclass(frozen=True, eq=False)
class FocalEvidence:
    """What the edges of photo and cloud say of the focal lengths.

    Parameters
    ----------
    log_odds : float
        Logarithm of the odds that they are the given ones, against others.
    factor : float
        By which the given ones are multiplied where photo and cloud agree best.
    shift : (6,) array
        Left increment of the pose, rad and meters, if they are a percent longer: what no covariance holds. To first
        order; of the refined pose where photo and cloud refined it.

    """

    log_odds: float
    factor: float
    shift: Array

    @property
    def shift_m(self) -> float:
        """How far a percent moves the camera center, meters."""
        return float(np.linalg.norm(self.shift[3:]))


def focal_evidence(
    estimate: PoseEstimate, scene: Sequence[SceneFrame], estimated: Estimated, refined: Pose | None = None
) -> FocalEvidence | None:
    """What the edges say of the focal lengths of the camera of all frames; None of a camera that has no matrix, and
    where no pose is found with other ones.

    With focal lengths up to a quarter longer or shorter the regions' pose is another one; about each the edges are
    asked as in `refine_with_scene`, the focal lengths unknown beside the pose. The pose that this led to with the given
    ones, `refined`, is one of the maxima there.
    """
    camera = scene[0].camera
    if not isinstance(camera, MatrixCamera):
        return None
    curve = _Curve.of(camera, estimate, estimated)
    if curve is None:
        return None
    compared = list(_compared(curve, scene, [] if refined is None else [refined]))
    # Where steps count less they tell less, not another thing.
    found = max(compared, key=lambda each: (_mass(each.best) - _log_odds(each.given)) / each.share).best
    # Less likely than chance they would decide nothing.
    if not (abs(found[0]) > OTHER and _mass(found) > 0.0 and _agrees(camera, found, scene)):
        compared = [each._replace(others=[]) for each in compared]
    ratios = [_log_odds(each.others) - _log_odds(each.given) for each in compared]
    log_odds = np.log1p(-COMMON) - np.log(COMMON / len(compared)) - logsumexp(ratios)
    given = [peak for each in compared for peak in each.given]
    slope = curve.slope if refined is None or not given else _slope_at(refined, given)
    return FocalEvidence(float(log_odds), float(np.exp(found[0])), 0.01 * slope)


def _slope_at(pose: Pose, peaks: Sequence[Peak]) -> Array:
    """The derivative (6,) of the likeliest pose by the logarithm of the focal lengths, where both are unknown, at the
    maximum nearest to a pose.
    """

    def variances(peak: Peak) -> float:
        increment = peak.pose.increment_to(pose)
        return float(increment @ np.linalg.solve(peak.covariance[:6, :6], increment))

    covariance = min(peaks, key=variances).covariance
    return np.asarray(covariance[:6, 6] / covariance[6, 6])


class _Compared(NamedTuple):
    """The maxima about the given focal lengths, and about others; the best of all there with its logarithm, and what
    steps count, of all frames together; 1 where there are none.
    """

    given: list[Peak]
    others: list[Peak]
    best: tuple[float, Peak]
    share: float


def _compared(curve: _Curve, scene: Sequence[SceneFrame], refined: Sequence[Pose]) -> Iterator[_Compared]:
    """The given focal lengths, with which maxima near the refined pose are known, and those about each node."""
    frames = curve.evidence(0.0, scene)
    given = curve.seen(0.0, GIVEN_SPREAD, frames, refined)
    for node in NODES:
        if node in curve:
            about = curve.evidence(node, scene, frames) if node else frames
            other = curve.seen(node, SPREAD, about, [] if node else refined)
            # One photo and one scan: a step counts the same for both, and for neither more than it may.
            shares = [min(pair) for pair in zip(given.shares, other.shares, strict=True)]
            right = curve.peaks(0.0, GIVEN_SPREAD, given, shares)
            peaks = [(node + peak.log_focal, peak) for peak in curve.peaks(node, SPREAD, other, shares)]
            yield _Compared(
                [peak for peak in right if abs(peak.log_focal) <= OTHER],
                [peak for log_focal, peak in peaks if abs(log_focal) > OTHER],
                max(peaks, key=_mass),
                sum(shares) or 1.0,
            )


def _log_odds(peaks: Sequence[Peak]) -> float:
    """Those of the edges, or of chance, which any focal lengths do as well as where the photo shows no steps."""
    return float(np.logaddexp(0.0, log_odds_of(peaks)))


def _mass(found: tuple[float, Peak]) -> float:
    return found[1].mass


def _agrees(camera: MatrixCamera, found: tuple[float, Peak], scene: Sequence[SceneFrame]) -> bool:
    """Whether photos and points agree by odds of 9 to 1 at a maximum, as is asked of refined poses."""
    log_focal, peak = found
    alignments = [_zoomed(camera, log_focal, frame).alignment(peak.pose) for frame in scene]
    return sum(alignment.edge_log_odds for alignment in alignments) > DECISIVE


def _zoomed(camera: MatrixCamera, log_focal: float, frame: SceneFrame) -> SceneFrame:
    """The frame with other focal lengths; the same one, with the steps that it keeps, at the given ones."""
    if not log_focal:
        return frame
    return replace(frame, image=frame.photo, camera=camera.zoomed(float(np.exp(log_focal))))


@dataclass(frozen=True, eq=False)
class _Curve:
    """How the regions' pose follows the logarithm of the focal lengths: its increments (6,) from the given one by the
    logarithm and by its square, and covariances (6, 6) at the ends of the reach and in the middle.
    """

    camera: MatrixCamera
    pose: Pose
    slope: Array
    bend: Array
    covariances: dict[float, Array]

    @classmethod
    def of(cls, camera: MatrixCamera, estimate: PoseEstimate, estimated: Estimated) -> _Curve | None:
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

    def evidence(self, log_focal: float, scene: Sequence[SceneFrame], likes: Sequence[Evidence] = ()) -> list[Evidence]:
        """That of each frame about the pose there; `likes`: that of each about another one."""
        frames, (pose, *_) = [_zoomed(self.camera, log_focal, frame) for frame in scene], self._at(log_focal)
        pairs = zip_longest(frames, likes)
        return [Evidence(frame, pose, with_focal=True, like=like) for frame, like in pairs]

    def seen(self, log_focal: float, spread: float, frames: Sequence[Evidence], known: Sequence[Pose]) -> Seen:
        """What steps say there, by those of frames or by likelier ones; maxima near poses are `known`."""
        about = partial(self._posterior, log_focal, spread)
        return Seen.of(frames, about, known).or_likelier(about)

    def peaks(self, log_focal: float, spread: float, seen: Seen, shares: Sequence[float]) -> list[Peak]:
        """The maxima there if steps count but so much."""
        if shares == seen.shares:
            return seen.peaks
        return self._posterior(log_focal, spread, seen.frames, shares).near(seen.peaks)

    def _posterior(
        self, log_focal: float, spread: float, frames: Sequence[Evidence], shares: Sequence[float]
    ) -> Posterior:
        """That of the pose and of a logarithm that is normally distributed about this one."""
        pose, slope, covariance = self._at(log_focal)
        root = np.zeros((7, 7))
        root[:6, :6], root[:6, 6], root[6, 6] = root_of(covariance), spread * slope, spread
        # Peaks of another spread have moved the frames.
        for frame in frames:
            frame.move_to(pose)
        return Posterior(pose, root, frames, shares)

    def _at(self, log_focal: float) -> tuple[Pose, Array, Array]:
        """The pose, its derivative (6,) and its covariance (6, 6)."""
        pose = self.pose.moved(log_focal * (self.slope + log_focal * self.bend))
        share, end = abs(log_focal) / REACH, float(np.copysign(REACH, log_focal))
        outer = self.covariances[end] if log_focal else 0.0
        return pose, self.slope + 2.0 * log_focal * self.bend, (1.0 - share) * self.covariances[0.0] + share * outer
