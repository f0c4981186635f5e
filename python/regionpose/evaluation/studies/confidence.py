"""Whether the confidence is what it says: how many poses of each confidence are right."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionpose.evaluation.studies.rows import Results
from regionpose.evaluation.studies.trust import RIGHT_DEG, WRONG_DEG

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


def reliability(results: Results) -> list[Reliability]:
    """The counts of the rows that have an answer, bin by bin, without empty bins; the pose itself, not the nearest."""
    answered = Results(results.settings, [row for row in results.rows if not row["error"]])
    stated = answered.column("confidence").astype(np.float64)
    errors = answered.column("rotation_deg").astype(np.float64)
    place = np.clip(np.searchsorted(EDGES, stated, side="right") - 1, 0, len(EDGES) - 2)
    found = []
    for index in range(len(EDGES) - 1):
        inside = (place == index) & np.isfinite(stated)
        if inside.any():
            held, right = (float((errors[inside] < limit).mean()) for limit in (WRONG_DEG, RIGHT_DEG))
            bounds = EDGES[index], EDGES[index + 1]
            found.append(Reliability(*bounds, int(inside.sum()), float(stated[inside].mean()), held, right))
    return found
