"""A study of small images, and its rows for comparison."""

from __future__ import annotations

import math
from collections.abc import Iterable

from regionpose.cameras import FisheyeCamera, PinholeCamera

from benchmarks.synthetic import setups
from benchmarks.synthetic.studies import Study
from benchmarks.synthetic.studies.conditions import Value
from benchmarks.synthetic.studies.rows import TIMES, Row

WIDTH, HEIGHT = 360, 240
PERSPECTIVE = setups.Setup(
    PinholeCamera(288.0, 288.0, 179.5, 119.5, width=WIDTH, height=HEIGHT), setups.perspective_setup().poses
)
FISHEYE = setups.Setup(
    FisheyeCamera(76.0, 76.0, 179.5, 119.5, width=WIDTH, height=HEIGHT), setups.PoseRange((0.25, 0.5), (1.0, 2.0))
)
SMALL = {"perspective": PERSPECTIVE, "omnidirectional": FISHEYE, "fisheye": FISHEYE}
"""Small images, so that a study takes seconds; the perspective one keeps the benchmark's field of view."""

QUICK = Study("quick", "Two conditions.", [{"planes": (2,), "noise": (0.0, 0.05)}], setups=SMALL)


def comparable(rows: Iterable[Row]) -> list[Row]:
    """Rows without times, NaN made equal to itself."""
    return [{name: equal_to_itself(value) for name, value in row.items() if name not in TIMES} for row in rows]


def equal_to_itself(value: Value) -> Value:
    """The value, or a text in place of NaN."""
    return "nan" if isinstance(value, float) and math.isnan(value) else value
