"""Quadrilaterals around a pixel, found by the edges along their sides."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose.app.proposals import mask_choices
from regionpose.segment.quads import quads_around

DOOR = [(140.0, 60.0), (260.0, 80.0), (250.0, 330.0), (130.0, 300.0)]
SEED = (170.0, 250.0)
SCALE = 4
"""Pictures are drawn this many times as large and averaged, so that edges lie between pixels."""


def picture(*, panes: bool = False, noise: float = 2.0) -> NDArray[np.uint8]:
    """A door (h, w, 3) seen from the side, with panes of other colors if asked for."""
    canvas = Image.new("RGB", (400 * SCALE, 400 * SCALE), (120, 110, 100))
    drawing = ImageDraw.Draw(canvas)
    drawing.polygon([((x + 0.5) * SCALE, (y + 0.5) * SCALE) for x, y in DOOR], fill=(200, 190, 170))
    for top in (110, 170) if panes else ():
        drawing.rectangle([160 * SCALE, top * SCALE, 230 * SCALE, (top + 40) * SCALE], fill=(40, 60, 90))
    drawn = np.asarray(canvas.reduce(SCALE), dtype=np.float64)
    return np.clip(drawn + np.random.default_rng(0).normal(0.0, noise, drawn.shape), 0, 255).astype(np.uint8)


def overlap(found: NDArray[np.float64] | list[list[float]], corners: list[tuple[float, float]]) -> float:
    """IoU of two quadrilaterals."""
    one, other = shapely.Polygon(found), shapely.Polygon(corners)
    return float(one.intersection(other).area / one.union(other).area)


@pytest.mark.slow
@pytest.mark.parametrize("panes", [False, True])
@pytest.mark.parametrize("noise", [0.0, 2.0, 6.0])
def test_a_face_is_met_with_its_windows(panes: bool, noise: float) -> None:
    found = quads_around(picture(panes=panes, noise=noise), SEED)
    assert max(overlap(corners, DOOR) for corners in found) > 0.98


def test_sides_lie_on_the_edges_between_pixels() -> None:
    found = max(quads_around(picture(), SEED), key=lambda corners: overlap(corners, DOOR))
    nearest = [min(np.hypot(x - u, y - v) for x, y in found) for u, v in DOOR]
    assert max(nearest) < 0.5


def test_a_photo_larger_than_the_windows_gives_the_same_face() -> None:
    large = np.asarray(Image.fromarray(picture()).resize((1600, 1600), Image.Resampling.BICUBIC))
    wider = [(4.0 * (x + 0.5) - 0.5, 4.0 * (y + 0.5) - 0.5) for x, y in DOOR]
    found = quads_around(large, (4.0 * SEED[0], 4.0 * SEED[1]))
    assert max(overlap(corners, wider) for corners in found) > 0.98


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_face_that_the_photo_cuts_ends_at_its_border(turns: int) -> None:
    photo = np.rot90(picture()[120:], turns)
    x, y = SEED[0], SEED[1] - 120.0
    door = shapely.clip_by_rect(shapely.Polygon(DOOR), -0.5, 119.5, 400.0, 400.0)
    corners = [(u, v - 120.0) for u, v in shapely.get_coordinates(door)[:-1]]
    for turned in range(turns):
        # A quarter turn to the left: (x, y) becomes (y, width - 1 - x).
        width = (400, 280)[turned % 2]
        x, y, corners = y, width - 1.0 - x, [(v, width - 1.0 - u) for u, v in corners]
    found = quads_around(np.ascontiguousarray(photo), (x, y))
    assert max(overlap(quad, corners) for quad in found) > 0.98


def test_a_sign_on_a_large_wall_is_met_and_so_is_the_wall() -> None:
    image = np.full((400, 900, 3), 90, dtype=np.uint8)
    image[30:370, 50:850] = (190, 180, 160)
    image[180:220, 400:450] = (60, 80, 140)
    image[190:210, 410:440] = (220, 220, 90)
    found = quads_around(image, (405.0, 185.0))
    for low, high in (((399.5, 179.5), (449.5, 219.5)), ((49.5, 29.5), (849.5, 369.5))):
        box = [low, (high[0], low[1]), high, (low[0], high[1])]
        assert max(overlap(corners, box) for corners in found) > 0.97


def test_where_nothing_is_straight_there_is_none() -> None:
    assert quads_around(np.full((300, 300, 3), 128, dtype=np.uint8), (150.0, 150.0)) == []


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (20, 20)])
def test_tiny_photos_give_none_or_some_and_no_error(size: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, (*size, 3), dtype=np.uint8)
    assert len(quads_around(image, (0.0, 0.0))) <= 3


def test_a_click_proposes_them_among_the_masks_in_order_of_size() -> None:
    choices = mask_choices(picture(panes=True), SEED)
    parts = [choices.at(index).chosen for index in range(len(choices))]
    areas = [part.region.area for part in parts]
    assert areas == sorted(areas)
    assert max(overlap(part.rings[0], DOOR) for part in parts if part.is_polygon) > 0.98
    assert not choices.chosen.is_polygon
