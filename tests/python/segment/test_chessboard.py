"""Chessboards around a pixel, drawn through cameras that bend them, against the corners as they were projected."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from PIL import Image
from regionpose.app.proposals import mask_choices
from regionpose.segment.chessboard import chessboard_around
from regionpose.segment.x_corners import x_corners
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Lens = Callable[[Array], Array]

SIZE = 480, 640
"""Rows and columns of the photos."""

FINE = 3
"""Each pixel of a photo averages this many samples squared."""

ROWS, COLUMNS = 6, 8
"""Squares of the board; it has a row and a column of corners less."""

MARGIN = 0.4
"""White beyond the squares, in squares."""


def straight(rays: Array) -> Array:
    """Pixels of a pinhole camera of 500 px."""
    return np.asarray(500.0 * rays[..., :2] / rays[..., 2:] + [319.5, 239.5])


def barrel(rays: Array) -> Array:
    """Pixels of an equidistant fisheye: 250 px a radian."""
    across = np.hypot(rays[..., 0], rays[..., 1])
    scale = 250.0 * np.arctan2(across, rays[..., 2]) / np.maximum(across, 1e-12)
    return np.asarray(scale[..., None] * rays[..., :2] + [319.5, 239.5])


def rays_of(pixels: Array, lens: Lens) -> Array:
    """The rays (..., 3) of pixels."""
    off = pixels - [319.5, 239.5]
    if lens is straight:
        return np.concatenate([off / 500.0, np.ones((*off.shape[:-1], 1))], axis=-1)
    away = np.hypot(off[..., 0], off[..., 1])
    share = (np.sin(away / 250.0) / np.maximum(away, 1e-12))[..., None]
    return np.concatenate([share * off, np.cos(away / 250.0)[..., None]], axis=-1)


def photo(turn: Array, middle: Array, lens: Lens, noise: float = 2.0) -> Bytes:
    """A board of squares of 1, turned by Euler angles x, y, z in degrees, its middle at a place before the camera."""
    fine = (np.mgrid[: SIZE[0] * FINE, : SIZE[1] * FINE][::-1].transpose(1, 2, 0) + 0.5) / FINE - 0.5
    rays = rays_of(fine, lens)
    frame = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    depth = (frame[:, 2] @ middle) / (rays @ frame[:, 2])
    on_plane = (rays * depth[..., None] - middle) @ frame[:, :2] + [COLUMNS / 2, ROWS / 2]
    light = np.full(fine.shape[:2], 90.0)
    beyond = np.maximum(np.maximum(-on_plane, on_plane - [COLUMNS, ROWS]), 0.0).max(axis=2)
    squares = np.floor(on_plane).astype(int).sum(axis=2) % 2 == 0
    light[(depth > 0.0) & (beyond <= MARGIN)] = 220.0
    light[(depth > 0.0) & (beyond == 0.0) & squares] = 30.0
    averaged = light.reshape(SIZE[0], FINE, SIZE[1], FINE).mean(axis=(1, 3))
    noisy = gaussian_filter(averaged, 0.7) + np.random.default_rng(0).normal(0.0, noise, SIZE)
    return np.repeat(np.clip(np.round(noisy), 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def outline(turn: Array, middle: Array, lens: Lens, grown: float) -> shapely.Polygon:
    """The projected outline of the inner rectangle, grown by some squares: 1 for the pattern."""
    low, right, bottom = 1.0 - grown, COLUMNS - 1.0 + grown, ROWS - 1.0 + grown
    ring = shapely.segmentize(shapely.Polygon([(low, low), (right, low), (right, bottom), (low, bottom)]), 0.05)
    on_plane = shapely.get_coordinates(ring)[:-1] - [COLUMNS / 2, ROWS / 2]
    frame = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    return shapely.Polygon(lens(on_plane @ frame[:, :2].T + middle))


def overlap(found: Array, expected: shapely.Geometry) -> float:
    """IoU of an outline with the expected one."""
    polygon = shapely.Polygon(found)
    return float(polygon.intersection(expected).area / polygon.union(expected).area)


def seen_at(middle: Array, lens: Lens) -> tuple[float, float]:
    """The pixel of the board's middle, a little off the corner that is there."""
    x, y = lens(middle) + 3.0
    return float(x), float(y)


VIEWS = [
    ([0, 0, 0], [0, 0, 12], straight),
    ([50, 0, 20], [0, 0, 12], straight),
    ([0, -60, 45], [0, 0, 10], straight),
    ([10, 20, 130], [2, -1, 30], straight),
    ([0, 0, 10], [0, 0, 5], barrel),
    ([20, -30, 30], [1, 1, 7], barrel),
    ([-20, 50, 80], [-4, 0, 6], barrel),
]
"""Turns, middles and lenses: near and far (squares of 130 to 12 px), to the side, and bent."""


@pytest.mark.slow
@pytest.mark.parametrize("view", VIEWS)
def test_rectangle_pattern_and_board_are_met(view: tuple[list[float], list[float], Lens]) -> None:
    turn, middle, lens = np.array(view[0], dtype=float), np.array(view[1], dtype=float), view[2]
    found = chessboard_around(photo(turn, middle, lens), seen_at(middle, lens))
    grown = (0.0, 1.0, 1.0 + MARGIN)
    assert len(found) == 3
    overlaps = [overlap(ring, outline(turn, middle, lens, more)) for ring, more in zip(found, grown, strict=True)]
    assert overlaps[0] > 0.99, overlaps
    assert min(overlaps) > 0.96, overlaps


def test_corners_are_found_to_a_tenth_of_a_pixel() -> None:
    turn, middle = np.array([30.0, 20.0, 15.0]), np.array([0.0, 0.0, 12.0])
    places = x_corners(photo(turn, middle, straight)[..., 0]).places
    grid = np.stack(np.meshgrid(np.arange(1, COLUMNS), np.arange(1, ROWS)), axis=-1).reshape(-1, 2)
    frame = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    true = straight((grid - [COLUMNS / 2, ROWS / 2]) @ frame[:, :2].T + middle)
    off = [np.hypot(*(places - corner).T).min() for corner in true]
    assert np.median(off) < 0.1
    assert max(off) < 0.25


def test_a_click_in_an_outer_square_finds_the_same_board() -> None:
    turn, middle = np.zeros(3), np.array([0.0, 0.0, 12.0])
    x, y = straight(np.array([COLUMNS / 2 - 0.5, ROWS / 2 - 0.5, 12.0]))
    found = chessboard_around(photo(turn, middle, straight), (float(x), float(y)))
    assert overlap(found[0], outline(turn, middle, straight, 0.0)) > 0.99


def test_of_a_board_that_the_photo_cuts_the_corners_inside_are_taken() -> None:
    turn, middle = np.zeros(3), np.array([0.0, 5.0, 12.0])
    x, y = straight(np.array([0.3, 4.0, 12.0]))
    found = chessboard_around(photo(turn, middle, straight), (float(x), float(y)))
    # Squares are 500 / 12 px wide; the last row of corners in the photo is that through the board's middle, at 447.8.
    whole = outline(turn, middle, straight, 0.0)
    expected = shapely.clip_by_rect(whole, 0.0, 0.0, 640.0, 447.8)
    assert overlap(found[0], expected) > 0.98


def test_without_an_edge_nearby_there_is_no_board() -> None:
    image = photo(np.zeros(3), np.array([0.0, 0.0, 12.0]), straight)
    image[image > 60] = 220
    assert len(chessboard_around(image, (322.0, 242.0))) == 2


def brick(image: Bytes) -> Bytes:
    """Bricks in rows that are shifted by half a brick."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    joints = (rows % 24 < 3) | ((columns + 30 * (rows // 24 % 2)) % 60 < 3)
    image[joints] = 200
    return image


def tiles(image: Bytes) -> Bytes:
    """Square tiles with joints: as periodic as a chessboard, but all of one color."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    image[(rows % 40 < 4) | (columns % 40 < 4)] = 200
    return image


def stripes(image: Bytes) -> Bytes:
    """Stripes of two colors."""
    image[:, np.arange(SIZE[1]) // 20 % 2 == 0] = 200
    return image


def noise(image: Bytes) -> Bytes:
    """Noise of strong contrast, coarse enough for corners."""
    coarse = gaussian_filter(np.random.default_rng(2).normal(size=SIZE), 3.0)
    image[...] = np.clip(120.0 + 600.0 * coarse, 0, 255).astype(np.uint8)[..., None]
    return image


def two_panes(image: Bytes) -> Bytes:
    """Four squares of alternating colors: a corner, but no board."""
    image[140:240, 220:320] = image[240:340, 320:420] = 200
    return image


@pytest.mark.slow
@pytest.mark.parametrize("texture", [brick, tiles, stripes, noise, two_panes])
def test_other_textures_are_no_chessboards(texture: Callable[[Bytes], Bytes]) -> None:
    image = texture(np.full((*SIZE, 3), 80, dtype=np.uint8))
    for x in range(100, 600, 90):
        assert chessboard_around(image, (float(x), 243.0)) == []


def test_a_click_in_the_margin_finds_the_board_around_it() -> None:
    x, y = straight(np.array([COLUMNS / 2 + 0.2, 0.0, 12.0]))
    image = photo(np.zeros(3), np.array([0.0, 0.0, 12.0]), straight)
    assert len(chessboard_around(image, (float(x), float(y)))) == 3


def test_a_click_beside_a_board_finds_none() -> None:
    image = photo(np.zeros(3), np.array([0.0, 0.0, 30.0]), straight)
    assert chessboard_around(image, (100.0, 100.0)) == []


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (20, 20)])
def test_tiny_photos_have_none_and_no_error(size: tuple[int, int]) -> None:
    image = np.random.default_rng(1).integers(0, 256, (*size, 3), dtype=np.uint8)
    assert chessboard_around(image, (0.0, 0.0)) == []


@pytest.mark.slow
def test_a_photo_larger_than_is_worked_on_gives_the_same_outline() -> None:
    turn, middle = np.array([30.0, 0.0, 20.0]), np.array([0.0, 0.0, 12.0])
    large = np.asarray(Image.fromarray(photo(turn, middle, straight)).resize((2560, 1920), Image.Resampling.BICUBIC))
    x, y = seen_at(middle, straight)
    found = chessboard_around(large, (4.0 * x + 1.5, 4.0 * y + 1.5))
    assert overlap((found[0] + 0.5) / 4.0 - 0.5, outline(turn, middle, straight, 0.0)) > 0.99


def test_a_click_on_a_board_takes_the_board() -> None:
    turn, middle = np.array([20.0, 30.0, 10.0]), np.array([0.0, 0.0, 12.0])
    choices = mask_choices(photo(turn, middle, straight), seen_at(middle, straight))
    assert len(choices) <= 6
    assert choices.chosen.label == "chessboard"
    assert overlap(np.array(choices.chosen.rings[0]), outline(turn, middle, straight, 1.0 + MARGIN)) > 0.96
