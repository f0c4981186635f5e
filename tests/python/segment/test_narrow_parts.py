"""Narrow parts of a patch: a panel with two posts, and what stays of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.segment.narrow_parts import without_narrow_parts
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


def grid(left: float, bottom: float, right: float, top: float, step: float = 0.04) -> Array:
    """Points of a grid on a rectangle in the plane z = 0."""
    across, up = np.meshgrid(np.arange(left, right + 1e-9, step), np.arange(bottom, top + 1e-9, step))
    return np.column_stack([across.ravel(), up.ravel(), np.zeros(across.size)])


PANEL = grid(-1.0, -0.4, 1.0, 0.4)
POSTS = np.concatenate([grid(-1.0, 0.44, -0.88, 1.4), grid(0.88, 0.44, 1.0, 1.4)])
TURN, SHIFT = Rotation.from_euler("xyz", [30.0, -20.0, 70.0], degrees=True), np.array([40.0, -12.0, 3.0])


def placed(points: Array) -> Array:
    return np.asarray(TURN.apply(points) + SHIFT)


def test_posts_on_a_panel_go_and_the_panel_stays() -> None:
    points = placed(np.concatenate([PANEL, POSTS]))
    kept = without_narrow_parts(points, placed(np.zeros((1, 3)))[0], 0.3)
    assert kept[: len(PANEL)].mean() > 0.98
    height = np.concatenate([PANEL, POSTS])[kept, 1]
    assert height.max() < 0.4 + 0.15 * 0.3 + 0.04


def test_a_patch_as_wide_everywhere_stays_whole() -> None:
    assert without_narrow_parts(placed(PANEL), placed(np.zeros((1, 3)))[0], 0.3).mean() > 0.99


def test_the_piece_at_the_seed_stays_of_two_that_a_narrow_bridge_joins() -> None:
    bridge, other = grid(1.04, -0.04, 2.0, 0.04), grid(2.04, -0.4, 3.0, 0.4)
    points = placed(np.concatenate([PANEL, bridge, other]))
    kept = without_narrow_parts(points, placed(np.array([[2.5, 0.0, 0.0]]))[0], 0.3)
    assert kept[-len(other) :].mean() > 0.97
    assert not kept[: len(PANEL)].any()


@pytest.mark.parametrize("width", [0.0, -1.0, np.nan, np.inf])
def test_a_width_must_be_positive(width: float) -> None:
    with pytest.raises(ValueError, match=r"min_width_m is .*; needed a positive number of meters"):
        without_narrow_parts(placed(PANEL), SHIFT, width)


def test_a_width_beyond_the_patch_says_so() -> None:
    with pytest.raises(ValueError, match=r"no part of the patch of \d+ points is 5.0 m wide"):
        without_narrow_parts(placed(PANEL), SHIFT, 5.0)
