"""Searches by edges that draw fewer poses, and try fewer focal lengths, than most need: enough for made-up worlds."""

from __future__ import annotations

import pytest
from made_up_worlds import World, made_world
from regionpose.alignment import focal, pose_search


def two_worlds() -> list[World]:
    """Two worlds whose pose few draws find."""
    return [made_world(5), made_world(3)]


def draw_fewer(monkeypatch: pytest.MonkeyPatch, draws: int = 1_000, kept: tuple[int, ...] = (40, 12, 4)) -> None:
    """Draw so many poses from a prior, and keep so many of the best by each spread; try few focal lengths."""
    monkeypatch.setattr(pose_search, "draws_of", lambda _: (draws, kept))
    try_fewer_focal_lengths(monkeypatch)


def try_fewer_focal_lengths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Try a shorter and a longer one. All, as in test_focal, take two thirds of a calibration's time."""
    monkeypatch.setattr(focal, "GROUPS", ((-1,), (1,)))
    monkeypatch.setattr(focal, "CLOSER", 1)


def skip_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Confirm no planes at a pose, which takes longer than the pose does."""
    monkeypatch.setattr("regionpose.scene.estimate.region_check", lambda *_, **__: None)
