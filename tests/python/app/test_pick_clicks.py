"""The clicks that lead to a pose of a real frame, counted, where the data is at hand."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from regionpose.solve.status import PoseStatus

pytestmark = pytest.mark.slow

DATA = Path(__file__).resolve().parents[4] / "shared" / "data"
NATURAL = DATA / "natural"

MOST_CLICKS = 12
"""Of `python -m benchmarks.picking --only natural`, which counts 8 for this frame, 15 and 25 for others."""


@pytest.mark.skipif(not NATURAL.is_dir(), reason="needs the real scenes, beside the checkout")
def test_clicks_on_a_street_lead_to_a_trusted_pose(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[3] / "benchmarks"))
    row = importlib.import_module("picking").picked(NATURAL / "kitti_000741", tmp_path)
    assert row.level == PoseStatus.TRUSTED and row.clicks <= MOST_CLICKS
    assert row.rotation_deg < 1.0 and row.center_m < 0.5
