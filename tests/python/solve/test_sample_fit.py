"""Samples on the right and the wrong side of an observed contour, and how pictures show them."""

from __future__ import annotations

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from regionpose.solve.sample_fit import SampleFit, sample_fit
from regionpose.viz.overlays import OUTSIDE, PROJECTED
from scipy.spatial.transform import Rotation

CAMERA = rp.PinholeCamera(400.0, 400.0, 199.5, 149.5, width=400, height=300)
TRUE = rp.Pose(Rotation.identity(), np.zeros(3))
ASIDE = rp.Pose(Rotation.identity(), np.array([0.2, 0.0, 0.0]))
"""A board 5 m ahead moves to the right by 16 px."""


def region() -> rp.WorldRegion:
    """A board of 2 x 1.6 m with a window of 0.6 x 0.4 m, sampled every 10 cm, and as far again around it."""
    x, y = np.meshgrid(np.arange(-1.95, 2.0, 0.1), np.arange(-1.55, 1.6, 0.1))
    places = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    inside = within(places, 1.0, 0.8) & ~within(places, 0.3, 0.2)
    return rp.WorldRegion.from_samples(places[inside], places[~inside])


def within(places: NDArray[np.float64], x: float, y: float) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = np.abs(places[:, :2] / [x, y]).max(axis=1) < 1.0
    return inside


def rectangle(x: float, y: float) -> NDArray[np.float64]:
    corners = np.array([[-x, -y, 5.0], [x, -y, 5.0], [x, y, 5.0], [-x, y, 5.0]])
    return CAMERA.project(corners)


def fit(pose: rp.Pose, rings: list[NDArray[np.float64]], hidden: list[list[int]] | None = None) -> SampleFit:
    image = rp.ImageRegion.from_polygon(rings, hidden_edges=hidden or ())
    found = sample_fit(CAMERA, image, region(), pose)
    assert found is not None
    return found


def test_at_the_true_pose_all_samples_are_on_their_side() -> None:
    found = fit(TRUE, [rectangle(1.0, 0.8)])
    assert found.consistent_fraction == 1.0 and found.count == 40 * 32 - 6 * 4


def test_a_hole_of_the_image_shows_what_is_enclosed() -> None:
    assert fit(TRUE, [rectangle(1.0, 0.8), rectangle(0.3, 0.2)]).count == 40 * 32
    assert len(fit(TRUE, [rectangle(1.0, 0.8), rectangle(0.4, 0.2)]).beyond) == 2 * 4


def test_a_pose_aside_puts_rows_on_the_wrong_side() -> None:
    found = fit(ASIDE, [rectangle(1.0, 0.8)])
    assert len(found.beyond) == len(found.within) == 2 * 16
    assert found.consistent_fraction == pytest.approx(1.0 - 64 / found.count)


def test_a_hidden_edge_tells_nothing() -> None:
    left = [index for index, x in enumerate(rectangle(1.0, 0.8)[:, 0]) if x < 199.5]
    found = fit(ASIDE, [rectangle(1.0, 0.8)], [[left[1]]])
    assert len(found.beyond) == 32 and len(found.within) <= 4


def test_an_outline_has_no_fit() -> None:
    world = rp.WorldRegion.from_polygon([[-1.0, -0.8, 5.0], [1.0, -0.8, 5.0], [1.0, 0.8, 5.0]])
    assert sample_fit(CAMERA, rp.ImageRegion.from_polygon(rectangle(1.0, 0.8)), world, TRUE) is None


def test_pictures_show_samples_on_the_wrong_side_alone() -> None:
    image = rp.ImageRegion.from_polygon(rectangle(1.0, 0.8))
    gray = np.full((300, 400, 3), 128, dtype=np.uint8)
    counts = []
    for pose in (TRUE, ASIDE):
        picture = rp.overlay_regions(CAMERA, gray, [image], [region()], pose, [""])
        counts.append([int((picture == color).all(axis=2).sum()) for color in (PROJECTED, OUTSIDE)])
    # Beyond the outlines' and the legend's own: 32 dots of each color.
    assert counts[1][0] > counts[0][0] + 100
    assert counts[1][1] > counts[0][1] + 100
