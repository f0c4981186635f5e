"""Searches by edges that draw far fewer poses than are needed in general: enough for worlds that are made up."""

from __future__ import annotations

import pytest
from made_up_worlds import World, made_world
from regionpose.alignment import pose_search


def two_worlds() -> list[World]:
    """Two worlds whose pose few draws find."""
    return [made_world(5), made_world(3)]


def draw_fewer(monkeypatch: pytest.MonkeyPatch, draws: int = 1_000, kept: tuple[int, ...] = (40, 12, 4)) -> None:
    """Draw so many poses from a prior, and keep so many of the best by each spread."""
    monkeypatch.setattr(pose_search, "DRAWS", draws)
    monkeypatch.setattr(pose_search, "KEPT", kept)
