"""Whether the estimate's covariance is right: how often the true pose lies inside its ellipsoids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from benchmarks.synthetic.studies.rows import AXES, NEAREST, Results

Array = NDArray[np.float64]

LEVELS = (0.5, 0.9, 0.99)
"""Nominal shares of the ellipsoids that tables show."""

FREEDOM = 6


@dataclass(frozen=True)
class Coverage:
    """How the covariance of solved problems agrees with their errors.

    `count`: problems whose pose is solved and the nearest of the answers, with a finite covariance. `inside`: share of
    the true poses in the ellipsoid of each of `LEVELS`. `median_ratio`: median of the squared Mahalanobis distance over
    that of chi-squared, the factor by which a typical variance is too small. `rotation_ratio`: root of the mean square
    of the rotation's errors about the camera's axes, each over its own standard deviation. NaN without any.
    """

    count: int
    inside: tuple[float, ...]
    median_ratio: float
    rotation_ratio: float


def coverage(results: Results) -> Coverage:
    """The coverage of the rows."""
    solved = solved_and_finite(results)
    squares = solved.column("mahalanobis_squared")
    if len(squares) == 0:
        return Coverage(0, (float("nan"),) * len(LEVELS), float("nan"), float("nan"))
    inside = tuple(float((squares <= chi2.ppf(level, FREEDOM)).mean()) for level in LEVELS)
    errors = [solved.column(f"{NEAREST}rotation_{a}_deg") / solved.column(f"sigma_rotation_{a}_deg") for a in AXES]
    ratio = float(np.sqrt(np.mean(np.square(errors))))
    return Coverage(len(squares), inside, float(np.median(squares) / chi2.ppf(0.5, FREEDOM)), ratio)


def coverage_curve(results: Results) -> tuple[Array, Array]:
    """(n,) nominal shares in rising order, and the share of true poses inside the ellipsoid of each."""
    squares = np.sort(solved_and_finite(results).column("mahalanobis_squared").astype(np.float64))
    nominal: Array = chi2.cdf(squares, FREEDOM)
    return nominal, (np.arange(len(squares)) + 0.5) / max(len(squares), 1)


def solved_and_finite(results: Results) -> Results:
    """The rows whose pose is solved and the nearest answer, and whose covariance says something.

    The covariance is that of the pose: others that fit may hold differently, as the four that see a triangle alike.
    """
    solved = [row for row in results.rows if row["solved"] and row["nearest_rank"] == 0]
    rows = [row for row in solved if np.isfinite(float(row["mahalanobis_squared"] or 0.0))]
    return Results(results.settings, rows)


def bound_ratios(results: Results, name: str) -> Array:
    """(n,) errors of the nearest answers over their bounds, of the rows that are solved and have one.

    `name`: "rotation_deg" or "translation_m".
    """
    rows = [row for row in results.rows if row[f"{NEAREST}solved"] and row[f"bound_{name}"] is not None]
    pairs = np.array([(row[f"{NEAREST}{name}"], row[f"bound_{name}"]) for row in rows], dtype=np.float64).reshape(-1, 2)
    bounded = pairs[np.isfinite(pairs[:, 1])]
    ratios: Array = bounded[:, 0] / bounded[:, 1]
    return ratios
