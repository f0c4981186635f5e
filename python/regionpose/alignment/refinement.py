"""A pose refined by the edges of the rest of the scene, what the regions say being its prior (docs/math.md, section
18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from regionpose.alignment.agreement import Alignment
from regionpose.alignment.evidence import Evidence
from regionpose.alignment.focal import FocalEvidence
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.odds import DECISIVE
from regionpose.alignment.posterior import Peak, Posterior, Seen, log_odds_of, root_of
from regionpose.alignment.steps import far_turns
from regionpose.arguments import checked_arguments
from regionpose.arrays import KeptArrays
from regionpose.pose import Pose

Array = NDArray[np.float64]

COMPARED = 9
"""Turned poses at all of which chance may not do as well: as many as those odds are."""


@dataclass(frozen=True, eq=False)
class SceneRefinement(KeptArrays):
    """A pose refined by the rest of the scene, if that says enough.

    Parameters
    ----------
    pose : Pose
        The refined one if `refined`, else the given one.
    covariance : (6, 6) array
        Of its left increment, rad and meters.
    before : Pose
        The given one.
    log_odds : float
        Logarithm of the odds that edges lie where a pose about the given one puts the steps, rather than by chance.
    chance : float
        The largest about poses that are turned by 3 to 8 degrees, NaN where none was tried.
    refined : bool
        Whether the edges say enough.
    steps : tuple of int
        How many steps of each frame were looked at.
    alignments : tuple of Alignment
        How well photo and cloud of each frame agree at the pose that the edges lead to; empty where these say too
        little to look.
    focal : FocalEvidence or None
        What they say of the focal lengths; None where they were not asked, and of a camera that has none.
    """

    pose: Pose
    covariance: Array
    before: Pose
    log_odds: float
    chance: float
    refined: bool
    steps: tuple[int, ...]
    alignments: tuple[Alignment, ...] = ()
    focal: FocalEvidence | None = None

    @property
    def turned_deg(self) -> float:
        """The angle between both poses, degrees."""
        return float(np.degrees((self.pose.rotation * self.before.rotation.inv()).magnitude()))

    @property
    def moved_m(self) -> float:
        """The distance between both camera centers, meters."""
        return float(np.linalg.norm(self.pose.camera_center - self.before.camera_center))


@checked_arguments
def refine_with_scene(pose: Pose, covariance: ArrayLike, scene: Sequence[SceneFrame]) -> SceneRefinement:
    """The pose near a given one at which steps of the frames' points lie on the edges of their photos.

    The edges' likelihood and the given pose's distribution are maximized together. The refined pose is taken if the
    edges under the steps are 9 times as likely about the given pose as by chance and as about each of 9 turned poses,
    and if photo and cloud agree at it by odds of 9 to 1 (docs/math.md, eq. 18.6 to 18.9).

    Parameters
    ----------
    pose : Pose
        Of an estimate of the regions, or of a rig.
    covariance : (6, 6) array
        Of its left increment, rad and meters.
    scene : sequence of SceneFrame
        All of which share the pose.

    Raises
    ------
    ValueError
        For other shapes.
    """
    root, frames = root_of(covariance), [Evidence(frame, pose) for frame in scene]
    about = partial(Posterior, pose, root)
    given = Seen.of(frames, about)
    peaks = given.or_likelier(about).peaks
    log_odds = log_odds_of(peaks)
    left = SceneRefinement(
        pose=pose,
        covariance=np.asarray(covariance, dtype=np.float64),
        before=pose,
        log_odds=log_odds,
        chance=float("nan"),
        refined=False,
        steps=tuple(frame.count for frame in frames),
    )
    if not log_odds > DECISIVE:
        return left
    best = max(peaks, key=_mass)
    told = replace(left, alignments=tuple(frame.alignment(best.pose) for frame in scene))
    if not sum(alignment.log_odds for alignment in told.alignments) > DECISIVE:
        return told
    chance = _by_chance(pose, root, given, peaks)
    if not log_odds - chance > DECISIVE:
        return replace(told, chance=chance)
    return replace(told, pose=best.pose, covariance=_spread_of(peaks, best), chance=chance, refined=True)


def _by_chance(pose: Pose, root: Array, given: Seen, found: Sequence[Peak]) -> float:
    """The largest log odds about turned poses, without peaks that belong to the pose itself: that are nearer to it, or
    those that are found about it.
    """
    own = Posterior(pose, root, (), ())

    def others(about: Posterior, peaks: Sequence[Peak]) -> list[Peak]:
        return [peak for peak in peaks if not (own.is_nearer(peak, about) or own.has(found, peak))]

    likeliest: tuple[float, Pose, list[Peak]] = (-np.inf, pose, [])
    for turn in far_turns()[:COMPARED]:
        for frame in given.frames:
            turned = frame.turn(Rotation.from_rotvec(turn))
        about = Posterior(turned, root, given.frames, given.shares)
        peaks = others(about, about.peaks())
        likeliest = max(likeliest, (log_odds_of(peaks), turned, peaks), key=lambda each: each[0])
    chance, turned, peaks = likeliest
    if not peaks:
        return chance
    # It is looked at as the pose is.
    anew = given._replace(peaks=peaks).or_likelier(partial(Posterior, turned, root))
    return max(chance, log_odds_of(others(Posterior(turned, root, (), ()), anew.peaks)))


def _mass(peak: Peak) -> float:
    return peak.mass


def _spread_of(peaks: Sequence[Peak], best: Peak) -> Array:
    """The covariance (6, 6) about the best of peaks, each of which counts by its mass."""
    masses = np.array([peak.mass for peak in peaks])
    shares = np.exp(masses - logsumexp(masses))
    ways = [best.pose.increment_to(peak.pose) for peak in peaks]
    return np.asarray(
        sum(
            share * (peak.covariance + np.outer(way, way)) for share, peak, way in zip(shares, peaks, ways, strict=True)
        )
    )
