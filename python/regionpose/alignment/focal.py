"""Whether other focal lengths explain the edges of photo and cloud better than the given ones, and what these do to the
pose (docs/math.md, eq. 18.13 to 18.15).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from regionpose.alignment.focal_curve import Estimated, FocalCurve, FocalPrior, zoomed
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.odds import COMMON, DECISIVE
from regionpose.alignment.posterior import Peak, Seen, log_odds_of
from regionpose.arrays import KeptArrays
from regionpose.cameras.matrix import MatrixCamera
from regionpose.estimation.answer import PoseEstimate
from regionpose.pose import Pose

Array = NDArray[np.float64]

NODES = (-0.2, -0.1, 0.0, 0.1, 0.2)
"""Logarithms about which the edges are asked, and of which the poses follow from those at three."""

SPREAD = 0.05
"""Standard deviation of the logarithm about each: such normal distributions, half as wide as they are apart, add up to
an even one, up to 28 % off."""

GIVEN_SPREAD = 0.01
"""Standard deviation of the logarithm about the given ones, if these are right: a percent, twice what a calibration is
good for (`estimation.intrinsics.WEAK_SHARE`)."""

OTHER = 2.0 * GIVEN_SPREAD
"""Logarithm beyond which focal lengths are others than the given ones."""


@dataclass(frozen=True, eq=False)
class FocalEvidence(KeptArrays):
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
    asked as in `refine_with_scene`, the focal lengths unknown beside the pose, and so are the given ones by the same
    steps. The pose that this led to with the given ones, `refined`, is one of the maxima there.
    """
    camera = scene[0].camera
    if not isinstance(camera, MatrixCamera):
        return None
    curve = FocalCurve.of(camera, estimate, estimated)
    if curve is None:
        return None
    known = [] if refined is None else [refined]
    given = FocalPrior(curve, scene, 0.0, GIVEN_SPREAD)
    seen = given.seen(known)
    others = [FocalPrior(curve, scene, node, SPREAD) for node in NODES if node in curve]
    compared = [_Compared.of(given, seen, other, [] if other.log_focal else known) for other in others]
    # Where steps count less they tell less, not another thing.
    found = max(compared, key=lambda each: (_mass(each.best) - each.given) / each.share).best
    # Less likely than chance they would decide nothing.
    if not (abs(found[0]) > OTHER and _mass(found) > 0.0 and _agrees(camera, found, scene)):
        compared = [each._replace(others=0.0) for each in compared]
    ratios = logsumexp([each.others - each.given for each in compared])
    log_odds = np.log1p(-COMMON) - np.log(COMMON / len(compared)) - ratios
    slope = curve.slope if refined is None else _slope_at(refined, seen.peaks)
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
    """Log odds of the given focal lengths and of others, by the same steps; of maxima about these the best one, its
    logarithm first; and what the steps count, of all frames together; 1 where there are none.
    """

    given: float
    others: float
    best: tuple[float, Peak]
    share: float

    @classmethod
    def of(cls, given: FocalPrior, seen: Seen, other: FocalPrior, known: Sequence[Pose]) -> _Compared:
        """The given focal lengths, with which steps are `seen`, and others, with which maxima near poses are known."""
        about = other.seen(known)
        right, peaks, shares = seen.peaks, about.peaks, about.shares
        # Other steps are other data: both are asked of those that are likelier where they are seen from.
        if log_odds_of(peaks) > log_odds_of(right):
            right = given.maxima_by(about, right)
        else:
            peaks, shares = other.maxima_by(seen, peaks), seen.shares
        return cls(
            _log_odds(right, 0.0, given=True),
            _log_odds(peaks, other.log_focal, given=False),
            max(((other.log_focal + peak.log_focal, peak) for peak in peaks), key=_mass),
            sum(shares) or 1.0,
        )


def _log_odds(peaks: Sequence[Peak], log_focal: float, *, given: bool) -> float:
    """Those of maxima about a logarithm that are the given focal lengths', or others'; or those of chance, which any do
    as well as where the photo shows no steps.
    """
    held = [peak for peak in peaks if (abs(log_focal + peak.log_focal) <= OTHER) is given]
    return float(np.logaddexp(0.0, log_odds_of(held)))


def _mass(found: tuple[float, Peak]) -> float:
    return found[1].mass


def _agrees(camera: MatrixCamera, found: tuple[float, Peak], scene: Sequence[SceneFrame]) -> bool:
    """Whether photos and points agree by odds of 9 to 1 at a maximum, as is asked of refined poses."""
    log_focal, peak = found
    alignments = [zoomed(camera, log_focal, frame).alignment(peak.pose) for frame in scene]
    return sum(alignment.edge_log_odds for alignment in alignments) > DECISIVE
