"""The clicks that lead to a pose of a real frame, counted, where the data is at hand."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from regionpose.scene.verdict import TRUSTED

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
FRAME = DATA / "natural" / "kitti_001112"

MOST_CLICKS = 20
"""Of `python -m benchmarks.picking --only natural`, which counts 16 for this frame."""


@pytest.mark.skipif(not FRAME.is_dir(), reason="needs the real scenes, beside the checkout")
def test_clicks_on_a_street_lead_to_a_trusted_pose(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "benchmarks"))
    row = importlib.import_module("picking").picked(FRAME, tmp_path)
    assert row.level == TRUSTED and row.clicks <= MOST_CLICKS
    assert row.rotation_deg < 1.0 and row.center_m < 0.5
