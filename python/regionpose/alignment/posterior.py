"""The poses near a given one, and focal lengths if these are unknown, by what the edges of the rest of the scene say
(docs/math.md, eq. 18.7 to 18.9).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from regionpose.alignment.descent import Ends, descended
from regionpose.alignment.evidence import Evidence
from regionpose.alignment.steps import SEED
from regionpose.arrays import real_array
from regionpose.pose import Pose
from regionpose.progress import check_wanted

Array = NDArray[np.float64]

FREEDOM = 4.0
"""Degrees of freedom of Student's distribution of the given pose's error: its covariance is known but roughly."""

SPREADS_PX = (8.0, 4.0, 2.0)
"""How far edges are spread, coarse to fine: from what a pose may be off to what steps of a scan are."""

SAME = 0.05
"""Increments nearer to one another, in the prior's deviations, are one: far less than peaks are apart."""

DRAWS, COARSE, LED = 2000, 12, 4
"""Poses drawn from the prior, how many of the best are led to a coarse maximum, and how many of the best of these on to
a fine one. Of poses 2.4 deg and 15 cm off, nine in twelve reach the truth by these, and seven by 500, 4 and 4, in four
fifths of the time (`test_refinement.py::test_a_wide_prior_is_searched`)."""

SIEVE_STEPS, SIEVE_DRAWS = 4, 8
"""One step in so many chooses one draw in so many, of which all steps then choose: of the draws' time it leaves three
eighths."""

COARSELY_SAME = 0.3
"""Coarse maxima nearer to one another, in the prior's deviations, lead to one: a convention, a third of a deviation."""

PRIOR_STEP = 1e-6
"""Least deviation that the prior is taken to have, rad and meters: below what any calibration knows."""

LEAST_CURVATURE = 0.2
"""Curvature of the log posterior in units of the prior's: no direction is known much worse than beforehand."""

STEP_UNITS, STEP_SPREADS = 0.1, 0.5
"""Longest steps that tell the curvature, in the prior's deviations and in the finest spread: a bell's curvature is told
an eighth too small by half its deviation, and by steps of several of them as none."""

ENDS = Ends(flat=0.05, level=1e-6, tries=10)
"""A maximum is reached at this slope of the log density, a deviation of the prior's, which at the least curvature is
0.006 below it; or where a step gains less than this share, or so many tries along a line find none that gains enough.
Values between pixels have kinks, at which slopes do not vanish. The last two are conventions: without such ends refined
poses are no nearer to the true ones (`python -m benchmarks.refinement`)."""


class Peak(NamedTuple):
    """A maximum of the posterior: its pose, covariance (d, d) of the increment, the logarithm of the mass about it over
    the prior's, and that of its focal lengths over the given ones.
    """

    pose: Pose
    covariance: Array
    mass: float
    log_focal: float = 0.0


class Posterior:
    """The log density of poses, as increments in units of the prior's deviations (`root` (d, d): a square root of its
    covariance).

    Of d = 7 the last is the logarithm of the focal lengths over those of the frames' cameras.
    """

    def __init__(self, prior: Pose, root: Array, frames: Sequence[Evidence], shares: Sequence[float]) -> None:
        """Take the prior's pose, and what steps of each frame count, 0 to 1."""
        self._frames, self._shares, self._count = frames, shares, len(root)
        self._prior, self._root, self._base = prior, root, np.zeros(len(root))

    def peaks(self, known: Sequence[Pose] = ()) -> list[Peak]:
        """The maxima that the best of some poses drawn from the prior lead to, and those near poses that are `known`
        to be near one, with the cameras' focal lengths.
        """
        rng = np.random.default_rng(SEED)
        scales = np.sqrt(rng.chisquare(FREEDOM, (DRAWS, 1)) / FREEDOM)
        draws = np.vstack([np.zeros(self._count), rng.normal(size=(DRAWS, self._count)) / scales])
        some = self._likeliest(draws, len(draws) // SIEVE_DRAWS, every=SIEVE_STEPS)
        led = np.array([self._led(draw, SPREADS_PX[0]) for draw in self._likeliest(some, COARSE)])
        led = self._likeliest(led, COARSE)
        starts = [self._root @ start for start in led[_distinct(led, COARSELY_SAME)[:LED]]]
        return self._peaks([*starts, *map(self._increment, known)])

    def near(self, known: Sequence[Pose | Peak]) -> list[Peak]:
        """The maxima near poses that are `known` to be near one, with the cameras' focal lengths, and near other
        maxima.
        """
        return self._peaks([self._increment(place) for place in known])

    def _increment(self, place: Pose | Peak) -> Array:
        """The increment (d,) from the prior's pose to a pose, with the cameras' focal lengths, or to a maximum."""
        return self._root @ self.units(_View(place) if isinstance(place, Pose) else place)

    def _likeliest(self, units: Array, count: int, every: int = 1) -> Array:
        """So many of increments (t, d), by every so manyth step, coarsely seen; the likeliest first."""
        costs, _ = self._costs(units, SPREADS_PX[0], every)
        return np.asarray(units[np.argsort(costs)[:count]])

    def _peaks(self, increments: Sequence[Array]) -> list[Peak]:
        """The maxima near increments (d,) of the prior's pose, each once."""
        peaks = [self._peak(increment) for increment in increments]
        return [peaks[number] for number in _distinct([self.units(peak) for peak in peaks], SAME)]

    def _peak(self, increment: Array) -> Peak:
        """The maximum that an increment (d,) of the prior's pose leads to, coarse to fine."""
        view = _View(self._prior).moved(increment)
        for spread in SPREADS_PX[1:]:
            self._move_to(view)
            view = view.moved(self._root @ self._led(np.zeros(self._count), spread))
        self._move_to(view)
        height = -float(self._costs(np.zeros((1, self._count)), SPREADS_PX[-1])[0][0])
        whole = self._curvature()
        prior_curvature = (FREEDOM + self._count) / FREEDOM
        mass = height - 0.5 * float(np.log(_eigen(whole)[0] / prior_curvature).sum())
        values, axes = _eigen(whole + self._surplus())
        half = self._root @ axes / np.sqrt(values)
        return Peak(view.pose, half @ half.T, mass, view.log_focal)

    def _move_to(self, view: _View) -> None:
        for frame in self._frames:
            frame.move_to(view.pose, view.log_focal)
        self._base = self.units(view)

    def units(self, view: _View | Peak) -> Array:
        """The increment (d,) from the prior's pose in units of its deviations."""
        increment = np.append(self._prior.increment_to(view.pose), view.log_focal)[: self._count]
        return np.asarray(np.linalg.solve(self._root, increment), dtype=np.float64)

    def is_nearer(self, peak: Peak, other: Posterior) -> bool:
        """Whether a peak is nearer to the prior's pose than to that of another one."""
        return bool(np.linalg.norm(self.units(peak)) <= np.linalg.norm(other.units(peak)))

    def has(self, peaks: Sequence[Peak], other: Peak) -> bool:
        """Whether another peak is one of these."""
        return any(np.linalg.norm(self.units(peak) - self.units(other)) <= COARSELY_SAME for peak in peaks)

    def _costs(self, units: Array, spread_px: float, every: int = 1) -> tuple[Array, Array]:
        """Negative log densities (t,) of increments (t, d) in units of the prior's deviations, and their slopes; by
        every so manyth step.
        """
        check_wanted()
        at, weight = self._base + units, FREEDOM + self._count
        squares = (at * at).sum(axis=1)
        costs = 0.5 * weight * np.log1p(squares / FREEDOM)
        slopes = weight * at / (FREEDOM + squares)[:, None]
        for frame, share in zip(self._frames, self._shares, strict=True):
            values, by_increment = frame.at(units @ self._root.T, spread_px, every)
            costs -= share * values
            slopes -= share * by_increment @ self._root
        return costs, slopes

    def _led(self, units: Array, spread_px: float) -> Array:
        """The increment (d,) at the maximum near one."""

        def cost(at: Array) -> tuple[float, Array]:
            costs, slopes = self._costs(at[None], spread_px)
            return float(costs[0]), slopes[0]

        return descended(cost, units, ENDS)

    def _curvature(self) -> Array:
        """The curvature (d, d) of the negative log density at the pose of increments, in the prior's units."""
        values, axes = np.linalg.eigh(self._per_step())
        ways, back = axes / np.sqrt(values), axes * np.sqrt(values)
        _, slopes = self._costs(np.vstack([ways.T, -ways.T]), SPREADS_PX[-1])
        differences = 0.5 * (slopes[: self._count] - slopes[self._count :]) @ ways
        return np.asarray(back @ (0.5 * (differences + differences.T)) @ back.T)

    def _per_step(self) -> Array:
        """The matrix (d, d) of the squares of increments in the longest ones that tell the curvature: a share of the
        prior's deviations, and of the finest spread as the steps in the photos move by it, as a root mean square.
        """
        squares = np.eye(self._count) / STEP_UNITS**2
        for frame in self._frames:
            squares += self._root.T @ frame.square_moves() @ self._root / (STEP_SPREADS * SPREADS_PX[-1]) ** 2
        return np.asarray(squares)

    def _surplus(self) -> Array:
        """How much the prior's information (d, d), at most that of a normal distribution, exceeds its curvature."""
        spread = FREEDOM + float(self._base @ self._base)
        weight, one = (FREEDOM + self._count) / spread, np.eye(self._count)
        curvature = weight * (one - 2.0 / spread * np.outer(self._base, self._base))
        return np.asarray(min(weight, 1.0) * one - curvature)


class _View(NamedTuple):
    """A pose, and the logarithm of the focal lengths over the given ones."""

    pose: Pose
    log_focal: float = 0.0

    def moved(self, increment: Array) -> _View:
        """After an increment of the pose (6,), and of both (7,)."""
        return _View(self.pose.moved(increment[:6]), self.log_focal + float(increment[6:].sum()))


def _distinct(places: Sequence[Array] | Array, same: float) -> list[int]:
    """The numbers of those places (d,) that are farther than this from each one kept before."""
    kept: list[int] = []
    for number, place in enumerate(places):
        if all(np.linalg.norm(place - places[other]) > same for other in kept):
            kept.append(number)
    return kept


def _eigen(matrix: Array) -> tuple[Array, Array]:
    """The eigenvalues (d,) of a curvature, none of them below what is left of the prior's, and their axes."""
    values, axes = np.linalg.eigh(matrix)
    return np.maximum(values, LEAST_CURVATURE), axes


def log_odds_of(peaks: Sequence[Peak]) -> float:
    """The log odds that edges lie where poses about the prior's put the steps, rather than by chance."""
    return float(logsumexp([peak.mass for peak in peaks])) if peaks else -np.inf


class Seen(NamedTuple):
    """The evidence of frames by the steps that their cameras see somewhere, what steps of each count, and the maxima to
    which these lead.
    """

    frames: Sequence[Evidence]
    shares: Sequence[float]
    peaks: list[Peak]

    @classmethod
    def of(cls, frames: Sequence[Evidence], about: About, known: Sequence[Pose] = ()) -> Seen:
        """The maxima about the prior's pose and near poses that are `known` to be near one."""
        shares = _shares(frames)
        return cls(frames, shares, about(frames, shares).peaks(known))

    def or_likelier(self, about: About) -> Seen:
        """What the maxima lead to by the steps that are seen from the best of them, if that is likelier: from a pose
        that is meters off the camera sees partly other ones.
        """
        best = max(self.peaks, key=lambda peak: peak.mass).pose
        frames = [frame.seen_from(best) for frame in self.frames]
        shares = _shares(frames)
        led = about(frames, shares).near(self.peaks)
        return max(self, Seen(frames, shares, led), key=lambda seen: log_odds_of(seen.peaks))


About = Callable[[Sequence[Evidence], Sequence[float]], Posterior]
"""The posterior about a pose by frames, and by what steps of each count."""


def _shares(frames: Sequence[Evidence]) -> list[float]:
    """What steps of each frame count (eq. 18.7)."""
    return [frame.share(SPREADS_PX[-1]) for frame in frames]


def root_of(covariance: ArrayLike) -> Array:
    """The Cholesky factor of a covariance; ValueError for what is none."""
    given = real_array(covariance, "covariance", "(6, 6)").astype(np.float64)
    if given.shape != (6, 6) or not np.isfinite(given).all():
        raise ValueError(f"covariance has shape {given.shape}; needed (6, 6), finite")
    try:
        return np.asarray(np.linalg.cholesky(0.5 * (given + given.T) + PRIOR_STEP**2 * np.eye(6)), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise ValueError("covariance has negative eigenvalues; needed a covariance") from error
