"""Whether the confidence is what it says: how many poses of each confidence are right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.synthetic.studies.rows import Results
from benchmarks.synthetic.studies.trust import RIGHT_DEG, WRONG_DEG

Array = NDArray[np.float64]

EDGES = (0.0, 0.05, 0.15, 0.3, 0.6, 0.8, 0.9, 0.97, 0.99, 1.0)
"""Bounds of the confidences that are counted together: more of them where a few in a hundred matter."""


@dataclass(frozen=True)
class Reliability:
    """Poses whose confidence is between two bounds.

    `count` of them have the mean confidence `stated`; the share `held` is not wrong, as the confidence states (within
    5 deg of the truth), the share `right` is within 1 deg.
    """

    least: float
    most: float
    count: int
    stated: float
    held: float
    right: float


@dataclass(frozen=True)
class Ranking:
    """How well confidences tell poses within 5 deg of the truth from those beyond: the area under the ROC curve.

    That is the share of pairs of both in which the former has the greater confidence, ties counting half; `expected` is
    the same if each confidence were right exactly as often as it says.
    """

    found: float
    expected: float


def ranking(results: Results) -> Ranking | None:
    """That of the rows that have an answer, the pose itself; None where all are right, or none."""
    stated, errors = _answered(results)
    held = (errors < WRONG_DEG).astype(np.float64)
    return Ranking(_ordered(stated, held), _ordered(stated, stated)) if 0.0 < held.sum() < len(held) else None


def _ordered(stated: Array, right: Array) -> float:
    """The share of pairs that confidences (n,) order rightly, by the probabilities (n,) that poses are right."""
    _, place = np.unique(stated, return_inverse=True)
    rights, wrongs = np.bincount(place, right), np.bincount(place, 1.0 - right)
    return float(rights @ (np.cumsum(wrongs) - 0.5 * wrongs) / (rights.sum() * wrongs.sum()))


def reliability(results: Results) -> list[Reliability]:
    """The counts of the rows that have an answer, bin by bin, without empty bins; the pose itself, not the nearest."""
    stated, errors = _answered(results)
    place = np.clip(np.searchsorted(EDGES, stated, side="right") - 1, 0, len(EDGES) - 2)
    found = []
    for index in range(len(EDGES) - 1):
        inside = place == index
        if inside.any():
            held, right = (float((errors[inside] < limit).mean()) for limit in (WRONG_DEG, RIGHT_DEG))
            bounds = EDGES[index], EDGES[index + 1]
            found.append(Reliability(*bounds, int(inside.sum()), float(stated[inside].mean()), held, right))
    return found


def _answered(results: Results) -> tuple[Array, Array]:
    """Confidences (n,) and errors of the rotation (n,), degrees, of the rows that have an answer."""
    answered = Results(results.settings, [row for row in results.rows if not row["error"]])
    stated, errors = (answered.column(name).astype(np.float64) for name in ("confidence", "rotation_deg"))
    return stated[np.isfinite(stated)], errors[np.isfinite(stated)]
