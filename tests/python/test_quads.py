"""Quadrilaterals around a pixel, found by the edges along their sides."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose.pick.proposals import mask_choices
from regionpose.segmentation.quads import quads_around

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


def test_where_nothing_is_straight_there_is_none() -> None:
    assert quads_around(np.full((300, 300, 3), 128, dtype=np.uint8), (150.0, 150.0)) == []


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (20, 20)])
def test_tiny_photos_give_none_or_some_and_no_error(size: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, (*size, 3), dtype=np.uint8)
    assert len(quads_around(image, (0.0, 0.0))) <= 2


def test_a_click_proposes_them_among_the_masks_in_order_of_size() -> None:
    choices = mask_choices(picture(panes=True), SEED)
    parts = [choices.at(index).chosen for index in range(len(choices))]
    areas = [part.region.area for part in parts]
    assert areas == sorted(areas)
    assert max(overlap(part.rings[0], DOOR) for part in parts if part.is_polygon) > 0.98
    assert not choices.chosen.is_polygon
