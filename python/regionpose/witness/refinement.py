"""A pose refined by the edges of the rest of the scene, what the regions say being its prior (docs/math.md, section
18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp

from regionpose import _core
from regionpose.arrays import real_array
from regionpose.pose import Pose
from regionpose.witness.alignment import Alignment
from regionpose.witness.evidence import Evidence
from regionpose.witness.frame import SceneFrame
from regionpose.witness.odds import DECISIVE
from regionpose.witness.steps import SEED, far_turns

Array = NDArray[np.float64]

COMPARED = 9
"""Turned poses at all of which chance may not do as well: as many as those odds are."""

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution of the given pose's error: its covariance is known but roughly."""

PRIOR_CURVATURE = (FREEDOM + 6.0) / FREEDOM
"""Curvature of that distribution's log density at its center."""

SPREADS_PX = (8.0, 4.0, 2.0)
"""How far edges are spread, coarse to fine: from what a pose may be off to what steps of a scan are."""

SAME = 0.05
"""Increments nearer to one another, in the prior's deviations, are one: far less than peaks are apart."""

DRAWS, LED = 500, 4
"""Poses drawn from the prior, and how many of the best are led to a maximum: some for each of 6 dimensions."""

PRIOR_STEP = 1e-6
"""Least deviation that the prior is taken to have, rad and meters: below what any calibration knows."""

LEAST_CURVATURE = 0.2
"""Curvature of the log posterior in units of the prior's: no direction is known much worse than beforehand."""

FLAT = 0.05
"""Slope of the log density, a deviation of the prior's, at which a maximum is reached: at the least curvature that is
0.006 below it."""


@dataclass(frozen=True, eq=False)
class SceneRefinement:
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
    """

    pose: Pose
    covariance: Array
    before: Pose
    log_odds: float
    chance: float
    refined: bool
    steps: tuple[int, ...]
    alignments: tuple[Alignment, ...] = ()

    @property
    def turned_deg(self) -> float:
        """The angle between both poses, degrees."""
        return float(np.degrees((self.pose.rotation * self.before.rotation.inv()).magnitude()))

    @property
    def moved_m(self) -> float:
        """The distance between both camera centers, meters."""
        return float(np.linalg.norm(self.pose.camera_center - self.before.camera_center))


def refine_with_scene(pose: Pose, covariance: ArrayLike, scene: Sequence[SceneFrame]) -> SceneRefinement:
    """The pose near a given one at which steps of the frames' points lie on the edges of their photos.

    The edges' likelihood and the given pose's distribution are maximized together. The refined pose is taken if the
    edges under the steps are 9 times as likely about the given pose as by chance, likelier than about each of 9 turned
    poses, and if photo and cloud agree at it by odds of 9 to 1 (docs/math.md, eq. 18.6 to 18.9).

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
    root, frames = _root(covariance), [Evidence(frame, pose) for frame in scene]
    shares = [frame.share(SPREADS_PX[-1]) for frame in frames]
    peaks = _Posterior(pose, root, frames, shares).peaks()
    log_odds = _log_odds(peaks)
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
    best = max(peaks, key=lambda peak: peak.mass)
    told = replace(left, alignments=tuple(frame.alignment(best.pose) for frame in scene))
    if not sum(alignment.log_odds for alignment in told.alignments) > DECISIVE:
        return told
    chance = max(_about_turned(turn, pose, root, frames, shares) for turn in far_turns()[:COMPARED])
    if not log_odds > chance:
        return replace(told, chance=chance)
    return replace(told, pose=best.pose, covariance=_spread_of(peaks, best), chance=chance, refined=True)


class _Peak(NamedTuple):
    """A maximum of the posterior: its pose, covariance (6, 6) of the left increment, and the logarithm of the mass
    about it, over that of the prior.
    """

    pose: Pose
    covariance: Array
    mass: float


class _Posterior:
    """The log density of poses, as increments in units of the prior's deviations (`root`, its Cholesky factor)."""

    def __init__(self, prior: Pose, root: Array, frames: Sequence[Evidence], shares: Sequence[float]) -> None:
        self._frames, self._shares = frames, shares
        self._prior, self._root, self._base = prior, root, np.zeros(6)

    def peaks(self) -> list[_Peak]:
        """The maxima that the best of some poses drawn from the prior lead to."""
        rng = np.random.default_rng(SEED)
        scales = np.sqrt(rng.chisquare(FREEDOM, (DRAWS, 1)) / FREEDOM)
        draws = np.vstack([np.zeros(6), rng.normal(size=(DRAWS, 6)) / scales])
        costs, _ = self._costs(draws, SPREADS_PX[0])
        starts = [self._led(draws[number], SPREADS_PX[0]) for number in np.argsort(costs)[:LED]]
        return self._distinct([self._peak(moved(self._prior, self._root @ start)) for start in starts])

    def _distinct(self, peaks: Sequence[_Peak]) -> list[_Peak]:
        """Those that none before is the same as."""
        kept: dict[int, Array] = {}
        for number, peak in enumerate(peaks):
            place = self.units(peak.pose)
            if all(np.linalg.norm(place - other) > SAME for other in kept.values()):
                kept[number] = place
        return [peaks[number] for number in kept]

    def _peak(self, pose: Pose) -> _Peak:
        """The maximum that a pose leads to, coarse to fine."""
        for spread in SPREADS_PX[1:]:
            self._move_to(pose)
            pose = moved(pose, self._root @ self._led(np.zeros(6), spread))
        self._move_to(pose)
        height = -float(self._costs(np.zeros((1, 6)), SPREADS_PX[-1])[0][0])
        whole = self._curvature()
        mass = height - 0.5 * float(np.log(_eigen(whole)[0] / PRIOR_CURVATURE).sum())
        values, axes = _eigen(whole + self._surplus())
        half = self._root @ axes / np.sqrt(values)
        return _Peak(pose, half @ half.T, mass)

    def _move_to(self, pose: Pose) -> None:
        for frame in self._frames:
            frame.move_to(pose)
        self._base = self.units(pose)

    def units(self, pose: Pose) -> Array:
        """The increment (6,) from the prior's pose in units of its deviations."""
        return np.asarray(np.linalg.solve(self._root, self._prior.increment_to(pose)), dtype=np.float64)

    def _costs(self, units: Array, spread_px: float) -> tuple[Array, Array]:
        """Negative log densities (t,) of increments (t, 6) in units of the prior's deviations, and their slopes."""
        at = self._base + units
        squares = (at * at).sum(axis=1)
        costs = 0.5 * (FREEDOM + 6.0) * np.log1p(squares / FREEDOM)
        slopes = (FREEDOM + 6.0) * at / (FREEDOM + squares)[:, None]
        for frame, share in zip(self._frames, self._shares, strict=True):
            values, by_increment = frame.at(units @ self._root.T, spread_px)
            costs -= share * values
            slopes -= share * by_increment @ self._root
        return costs, slopes

    def _led(self, units: Array, spread_px: float) -> Array:
        """The increment (6,) at the maximum near one."""

        def cost(at: Array) -> tuple[float, Array]:
            costs, slopes = self._costs(at[None], spread_px)
            return float(costs[0]), slopes[0]

        return np.asarray(minimize(cost, units, jac=True, method="BFGS", options={"gtol": FLAT}).x)

    def _curvature(self) -> Array:
        """The curvature (6, 6) of the negative log density at the pose of increments, in the prior's units."""
        step = 0.1
        units = step * np.vstack([np.eye(6), -np.eye(6)])
        _, slopes = self._costs(units, SPREADS_PX[-1])
        matrix = (slopes[:6] - slopes[6:]) / (2.0 * step)
        return np.asarray(0.5 * (matrix + matrix.T))

    def _surplus(self) -> Array:
        """How much the prior's information (6, 6), at most that of a normal distribution, exceeds its curvature."""
        spread = FREEDOM + float(self._base @ self._base)
        weight = (FREEDOM + 6.0) / spread
        curvature = weight * (np.eye(6) - 2.0 / spread * np.outer(self._base, self._base))
        return np.asarray(min(weight, 1.0) * np.eye(6) - curvature)


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """The eigenvalues (6,) of a curvature, none of them below what is left of the prior's, and their axes."""
    values, axes = np.linalg.eigh(matrix)
    return np.maximum(values, LEAST_CURVATURE), axes


def _about_turned(turn: Array, pose: Pose, root: Array, frames: Sequence[Evidence], shares: Sequence[float]) -> float:
    """The log odds about a pose turned by a rotation vector, without peaks that belong to the pose itself."""
    for frame in frames:
        turned = frame.turn(Rotation.from_rotvec(turn))
    posterior = _Posterior(turned, root, frames, shares)
    own = _Posterior(pose, root, (), ())
    others = [
        peak
        for peak in posterior.peaks()
        if np.linalg.norm(posterior.units(peak.pose)) < np.linalg.norm(own.units(peak.pose))
    ]
    return _log_odds(others)


def _log_odds(peaks: Sequence[_Peak]) -> float:
    return float(logsumexp([peak.mass for peak in peaks])) if peaks else -np.inf


def _spread_of(peaks: Sequence[_Peak], best: _Peak) -> Array:
    """The covariance (6, 6) about the best of peaks, each of which counts by its mass."""
    masses = np.array([peak.mass for peak in peaks])
    shares = np.exp(masses - logsumexp(masses))
    ways = [best.pose.increment_to(peak.pose) for peak in peaks]
    return np.asarray(
        sum(
            share * (peak.covariance + np.outer(way, way)) for share, peak, way in zip(shares, peaks, ways, strict=True)
        )
    )


def _root(covariance: ArrayLike) -> Array:
    """The Cholesky factor of a covariance; ValueError for what is none."""
    given = real_array(covariance, "covariance", "(6, 6)").astype(np.float64)
    if given.shape != (6, 6) or not np.isfinite(given).all():
        raise ValueError(f"covariance has shape {given.shape}; needed (6, 6), finite")
    try:
        return np.asarray(np.linalg.cholesky(0.5 * (given + given.T) + PRIOR_STEP**2 * np.eye(6)), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise ValueError("covariance has negative eigenvalues; needed a covariance") from error


def moved(pose: Pose, increment: Array) -> Pose:
    """The pose after a left increment (6,): a rotation vector, rad, then a translation, meters."""
    rotation, translation = _core.moved_pose(pose.rotation.as_matrix(), pose.translation, increment)
    return Pose.from_parts(rotation, translation)
