"""From the agreement of photo and cloud to odds, and from odds to probabilities (docs/math.md, eq. 18.4 and 18.5)."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp, ndtri

Array = NDArray[np.float64]

DECISIVE = float(np.log(9.0))
"""Logarithm of the odds from which on they decide, for a pose or against it or between two: a convention, 90 %."""

COMMON = float(1.0 / (1.0 + np.exp(2.0 * DECISIVE)))
"""Least probability that all regions share a mistake, such as a wrong frame, at which they fit as well: that at which
odds that decide against a pose leave it a confidence of 90 % at most, less than it needs."""

HIDDEN = -DECISIVE
"""Logarithm of the odds that a pose has which hides one of its regions: a convention. None of 104 right poses does, and
13 % of 964 wrong ones (`python -m benchmarks.visibility`): the odds are these if something that the photo does not show
stands before a region in one cloud of 70."""

RIGHT_MEDIAN, RIGHT_LOG_SIGMA = 0.05, 0.75
"""Median of how far right poses stand out, and the standard deviation of its logarithm, of 21 frames of cars, fisheyes
and rooms (`python -m benchmarks.witness`)."""

WRONG_FREEDOM = 6.0
"""Degrees of freedom of Student's distribution of the scores of wrong poses, which has room for the largest z of some
hundred, 3 to 4 (the same command)."""


def log_odds(lead: float, deviation: float) -> float:
    """Logarithm of the odds for a right pose, of a score that leads those of turned ones; their deviation."""
    # Below those of turned poses it says no more than among them.
    lead, deviation = max(lead, 0.0), max(deviation, 1e-9)
    nodes, log_weights = _nodes()
    right = logsumexp(_log_density((lead - nodes) / deviation) + log_weights)
    return float(right - _log_density(lead / deviation))


def _log_density(z: ArrayLike) -> Array:
    """Logarithm of Student's density, but for a constant."""
    return np.asarray(-0.5 * (WRONG_FREEDOM + 1.0) * np.log1p(np.square(z) / WRONG_FREEDOM))


@cache
def _nodes() -> tuple[Array, Array]:
    """How far right poses may stand out, and the logarithms of what each counts: the middles of equal shares."""
    shares = (np.arange(200) + 0.5) / 200.0
    return RIGHT_MEDIAN * np.exp(RIGHT_LOG_SIGMA * ndtri(shares)), np.full(200, -np.log(200.0))


def weighed(shares: ArrayLike, odds: ArrayLike) -> Array:
    """Probabilities (n,) of answers of which one at most is right, from those before and logarithms of odds since.

    What the answers leave of 1 is the probability that none is right, which no odds speak for.
    """
    before = np.clip(np.asarray(shares, dtype=np.float64), 0.0, 1.0)
    with np.errstate(divide="ignore"):
        logs = np.log(before) + np.asarray(odds, dtype=np.float64)
        none = np.log(max(1.0 - float(before.sum()), 0.0))
    return np.asarray(np.exp(logs - logsumexp([*logs, none])))
