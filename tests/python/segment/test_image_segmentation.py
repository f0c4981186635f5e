"""Regions grown from a seed: painted shapes come back, whatever the image's kind, noise and shading."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose import ImageRegion, _core
from regionpose.segment import grow_image_region
from skimage.morphology import reconstruction

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

HEIGHT, WIDTH = 120, 160
CENTER, RADIUS = (76.3, 57.6), 38.4
"""The disc of most tests, pixels."""

ORANGE, BLUE = (0.75, 0.45, 0.2), (0.25, 0.35, 0.6)


def disc_share(height: int = HEIGHT, width: int = WIDTH, radius: float = RADIUS) -> Array:
    """Share of each pixel that the disc covers, from 8 x 8 points in it."""
    total = np.zeros((height, width))
    for offset in (np.arange(8) + 0.5) / 8 - 0.5:
        for across in (np.arange(8) + 0.5) / 8 - 0.5:
            y, x = np.ogrid[:height, :width]
            total += np.hypot(x + across - CENTER[0], y + offset - CENTER[1]) < radius
    return total / 64


def encoded(light: Array) -> Array:
    """sRGB values in [0, 1] of linear light (IEC 61966-2-1)."""
    held = np.clip(light, 0.0, 1.0)
    return np.where(held <= 0.0031308, 12.92 * held, 1.055 * np.maximum(held, 1e-12) ** (1 / 2.4) - 0.055)


def linear(value: float | Array) -> Array:
    given_value = np.asarray(value, dtype=np.float64)
    return np.where(given_value <= 0.04045, given_value / 12.92, ((given_value + 0.055) / 1.055) ** 2.4)


def painted(
    share: Array,
    *,
    inner: tuple[float, float, float] = ORANGE,
    outer: tuple[float, float, float] = BLUE,
    noise: float = 2.0,
    seed: int = 0,
) -> NDArray[np.uint8]:
    """The image of a shape in a color on another: mixed as light, encoded, with noise in levels of 255."""
    weight = share[..., None]
    levels = 255.0 * encoded(weight * linear(np.array(inner)) + (1.0 - weight) * linear(np.array(outer)))
    noisy = levels + np.random.default_rng(seed).normal(0.0, noise, levels.shape)
    return np.clip(np.round(noisy), 0.0, 255.0).astype(np.uint8)


def overlap(first: Mask, second: Mask) -> float:
    return float((first & second).sum() / (first | second).sum())


def seed_pixel() -> tuple[int, int]:
    return round(CENTER[0]), round(CENTER[1])


@pytest.mark.parametrize("noise", [0.0, 2.0, 8.0])
def test_disc_on_flat_ground(noise: float) -> None:
    share = disc_share()
    mask = grow_image_region(painted(share, noise=noise), seed_pixel())
    assert mask.dtype == np.bool_
    assert overlap(mask, share >= 0.5) > 0.99


def test_coverage_places_the_outline_within_a_tenth_of_a_pixel() -> None:
    share = disc_share()
    coverage = grow_image_region(painted(share, noise=1.0), seed_pixel(), coverage=True)
    assert coverage.dtype == np.float32
    assert np.abs(coverage - share).max() < 0.1
    ring = ImageRegion.from_mask(coverage).rings[0]
    distances = np.hypot(*(ring - CENTER).T) - RADIUS
    assert abs(distances.mean()) < 0.02
    assert np.abs(distances).max() < 0.15


def test_linear_light_needs_no_decoding() -> None:
    share = disc_share()
    light = share[..., None] * linear(np.array(ORANGE)) + (1.0 - share[..., None]) * linear(np.array(BLUE))
    coverage = grow_image_region(light, seed_pixel(), coverage=True, linear_light=True)
    assert np.abs(coverage - share).max() < 0.02


def gray_of(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(image[..., 0])


@pytest.mark.parametrize("kind", ["gray", "uint16", "float32", "float64", "gray uint16", "view"])
def test_kinds_of_images(kind: str) -> None:
    share = disc_share()
    color = painted(share)
    image: NDArray[np.generic] = gray_of(color) if "gray" in kind else color
    if "uint16" in kind:
        image = image.astype(np.uint16) * np.uint16(257)
    if "float" in kind:
        image = image.astype(kind) / np.asarray(255.0, dtype=kind)
    if kind == "view":
        image = np.repeat(image, 2, axis=1)[:, ::2]
    assert overlap(grow_image_region(image, seed_pixel()), share >= 0.5) > 0.99


def test_same_levels_in_8_and_16_bits_and_as_floats_give_the_same_mask() -> None:
    image = painted(disc_share())
    first = grow_image_region(image, seed_pixel())
    assert np.array_equal(grow_image_region(image.astype(np.uint16) * np.uint16(257), seed_pixel()), first)
    assert np.array_equal(grow_image_region(image / 255.0, seed_pixel()), first)


def test_shading_across_the_region_stays_inside() -> None:
    share = disc_share()
    image = painted(share).astype(np.float64) / 255.0
    shaded = image * np.linspace(0.9, 1.1, WIDTH)[None, :, None]
    assert overlap(grow_image_region(np.clip(shaded, 0.0, 1.0), seed_pixel()), share >= 0.5) > 0.98


def test_joints_of_a_brick_wall_are_smoothed_away() -> None:
    # Bricks of 24 x 10 px with joints of 1 px, in a wall around which is plaster.
    y, x = np.mgrid[:300, :400]
    joint = (y % 10 == 0) | ((x + 12 * (y // 10 % 2)) % 24 == 0)
    wall = (x >= 80) & (x < 320) & (y >= 60) & (y < 240)
    levels = np.where(joint[..., None], (0.62, 0.5, 0.42), (0.58, 0.3, 0.22))
    image = np.where(wall[..., None], levels, (0.85, 0.85, 0.8))
    image = np.clip(image + np.random.default_rng(0).normal(0.0, 0.01, image.shape), 0.0, 1.0)
    assert overlap(grow_image_region(image, (203, 147), smoothing_px=3), wall) > 0.97


def test_small_region_in_a_large_image() -> None:
    share = np.zeros((4000, 6000), dtype=np.float32)
    share[1000 : 1000 + HEIGHT, 3000 : 3000 + WIDTH] = disc_share()
    image = np.full((4000, 6000, 3), 90, dtype=np.uint8)
    image[share >= 0.5] = (190, 110, 60)
    mask = grow_image_region(image, (3000 + seed_pixel()[0], 1000 + seed_pixel()[1]))
    assert overlap(mask, share >= 0.5) > 0.97


@pytest.mark.parametrize("corner", [(0, 0), (WIDTH - 1, HEIGHT - 1), (0, HEIGHT - 1), (-0.5, -0.5)])
def test_region_that_meets_the_border(corner: tuple[float, float]) -> None:
    y, x = np.ogrid[:HEIGHT, :WIDTH]
    share = (np.hypot(x - corner[0], y - corner[1]) < 60.0).astype(np.float64)
    mask = grow_image_region(painted(share), corner)
    assert overlap(mask, share >= 0.5) > 0.98
    assert mask[round(max(corner[1], 0)), round(max(corner[0], 0))]


def test_holes_are_filled_on_request_only() -> None:
    whole = disc_share() >= 0.5
    y, x = np.ogrid[:HEIGHT, :WIDTH]
    ring = whole & (np.hypot(x - CENTER[0], y - CENTER[1]) >= 15.0)
    image, seed = painted(ring.astype(np.float64)), (seed_pixel()[0] + 26, seed_pixel()[1])
    assert overlap(grow_image_region(image, seed, fill_holes=True), whole) > 0.98
    assert overlap(grow_image_region(image, seed, fill_holes=False), ring) > 0.97


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_a_hole_that_the_border_cuts_is_filled(turns: int) -> None:
    wall = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    wall[:90, 20:140] = True
    windowed = wall.copy()
    windowed[:30, 60:90] = False
    image = np.rot90(painted(windowed.astype(np.float64)), turns)
    y, x = np.argwhere(np.rot90(wall & (np.arange(HEIGHT)[:, None] == 60), turns))[60]
    assert overlap(grow_image_region(image, (int(x), int(y))), np.rot90(wall, turns)) > 0.98


def test_a_gap_wider_than_what_the_border_shows_stays_open() -> None:
    towers = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    towers[:90, 20:140] = True
    towers[:40, 40:120] = False
    assert overlap(grow_image_region(painted(towers.astype(np.float64)), (80, 65)), towers) > 0.97


def test_pieces_that_are_not_connected_stay_out() -> None:
    share = np.zeros((HEIGHT, WIDTH))
    share[20:100, 10:70] = share[20:100, 90:150] = 1.0
    mask = grow_image_region(painted(share), (40, 60))
    assert not mask[:, 80:].any()
    assert overlap(mask[:, :80], share[:, :80] >= 0.5) > 0.98


def test_tolerance_decides_what_belongs() -> None:
    # Three bands whose gray differs by about 12 and 12 CIELAB units of lightness.
    image = np.full((HEIGHT, WIDTH), 90, dtype=np.uint8)
    image[:, 70:115], image[:, 115:] = 120, 150
    assert grow_image_region(image, (20, 70), tolerance=4.0).sum() == pytest.approx(70 * HEIGHT, rel=0.02)
    assert grow_image_region(image, (20, 70), tolerance=60.0).all()


def test_flat_image_is_one_region() -> None:
    assert grow_image_region(np.full((40, 50), 80, dtype=np.uint8), (10, 10)).all()


@settings(max_examples=4, deadline=None)
@given(st.floats(0.55, 1.0), st.integers(0, 100))
def test_brightness_does_not_move_the_mask(scale: float, noise_seed: int) -> None:
    share = disc_share()
    image = painted(share, seed=noise_seed) / 255.0
    dimmed = encoded(scale * linear(image))
    assert overlap(grow_image_region(dimmed, seed_pixel()), grow_image_region(image, seed_pixel())) > 0.99


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 100))
def test_transposed_and_mirrored_images_give_transposed_and_mirrored_masks(noise_seed: int) -> None:
    image = painted(disc_share(), seed=noise_seed)
    x, y = seed_pixel()
    mask = grow_image_region(image, (x, y))
    assert overlap(grow_image_region(image.transpose(1, 0, 2), (y, x)), mask.T) > 0.995
    assert overlap(grow_image_region(image[:, ::-1], (WIDTH - 1 - x, y)), mask[:, ::-1]) > 0.995


@settings(max_examples=4, deadline=None)
@given(st.floats(0.0, 2.0 * np.pi), st.floats(0.0, 0.85))
def test_every_seed_inside_gives_the_same_mask(angle: float, share_of_radius: float) -> None:
    share = disc_share()
    reach = share_of_radius * RADIUS
    seed = (CENTER[0] + reach * np.cos(angle), CENTER[1] + reach * np.sin(angle))
    assert overlap(grow_image_region(painted(share), seed), share >= 0.5) > 0.99


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 100))
def test_growing_in_the_picture_of_a_mask_gives_the_mask(noise_seed: int) -> None:
    mask = grow_image_region(painted(disc_share(), seed=noise_seed, noise=6.0), seed_pixel())
    picture = np.where(mask, np.uint8(200), np.uint8(60))
    assert overlap(grow_image_region(picture, seed_pixel()), mask) > 0.995


IMAGE = np.full((HEIGHT, WIDTH, 3), 0.5)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((4, 4, 4), dtype=np.uint8), r"image has shape \(4, 4, 4\); needed \(h, w\) or \(h, w, 3\)"),
        (np.zeros((0, 4), dtype=np.uint8), r"image has shape \(0, 4\)"),
        (np.zeros(4, dtype=np.uint8), r"image has shape \(4,\)"),
        (np.zeros((4, 4), dtype=np.int64), "image has type int64; needed uint8, uint16 or floats"),
        (np.full((4, 4), np.nan), "image holds values from nan to nan; needed floats in"),
        (np.full((4, 4), 200.0), "image holds values from 200.0"),
    ],
)
def test_other_images(image: NDArray[np.generic], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        grow_image_region(image, (1, 1))


@pytest.mark.parametrize(
    "seed", [(-1, 5), (5, -0.6), (WIDTH, 5), (5, HEIGHT), (np.nan, 5), (5, np.inf), (WIDTH - 0.5, 5)]
)
def test_seed_outside(seed: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match=rf"outside the image, which has {WIDTH} x {HEIGHT} pixels"):
        grow_image_region(IMAGE, seed)


@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(1, 40), st.sampled_from([3, 40, 65_536]))
@settings(max_examples=50, deadline=None)
def test_a_flood_is_a_reconstruction_from_its_start(seed: int, rows: int, columns: int, most: int) -> None:
    generator = np.random.default_rng(seed)
    levels = generator.integers(0, most, (rows, columns)).astype(np.uint16)
    start = int(generator.integers(rows)), int(generator.integers(columns))
    marker = np.full_like(levels, levels.max())
    marker[start] = levels[start]
    expected = reconstruction(marker, levels, method="erosion")  # type: ignore[no-untyped-call]
    np.testing.assert_array_equal(_core.flood_levels(levels, start), expected)
    # As of an array whose rows do not follow one another.
    np.testing.assert_array_equal(_core.flood_levels(levels.T, start[::-1]), expected.T)


@pytest.mark.parametrize("start", [(3, 0), (0, 4), (2**62, 3)])
def test_a_flood_from_elsewhere_is_refused(start: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="flood"):
        _core.flood_levels(np.zeros((3, 4), dtype=np.uint16), start)


@pytest.mark.parametrize("shape", [(3, 4, 2), (4, 3, 3), (3, 4, 4)])
def test_colors_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    colors, arrivals = np.zeros(shape, dtype=np.float32), np.zeros((3, 4), dtype=np.uint16)
    with pytest.raises(ValueError, match="color"):
        _core.outline_sums(arrivals, colors, 5)
    if shape[2] != 3:
        with pytest.raises(ValueError, match="channels"):
            _core.color_levels(colors, [0.0, 0.0, 0.0], 1.0, 5)


def test_colors_whose_rows_do_not_follow_one_another_are_refused() -> None:
    colors, arrivals = np.zeros((4, 3, 3), dtype=np.float32), np.zeros((3, 4), dtype=np.uint16)
    with pytest.raises(ValueError, match="contiguous"):
        _core.color_levels(colors.transpose(1, 0, 2), [0.0, 0.0, 0.0], 1.0, 5)
    with pytest.raises(ValueError, match="contiguous"):
        _core.outline_sums(arrivals, colors.transpose(1, 0, 2), 5)


@pytest.mark.parametrize("seed", [(1, 2, 3), (1,), "ab", None, 5])
def test_seed_that_is_no_pixel(seed: object) -> None:
    with pytest.raises(ValueError, match=r"seed is .*; needed a pixel \(x, y\)"):
        grow_image_region(IMAGE, seed)  # type: ignore[call-overload]


@pytest.mark.parametrize("option", ["tolerance", "smoothing_px"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_options_below_zero(option: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{option} is .*; needed a finite number of at least 0"):
        grow_image_region(IMAGE, (5, 5), **{option: value})  # type: ignore[call-overload]


def test_a_region_of_single_pixels_says_what_is_needed() -> None:
    noise = np.random.default_rng(3).integers(0, 256, (60, 60, 3), dtype=np.uint8)
    with pytest.raises(ValueError, match="needed a larger tolerance"):
        grow_image_region(noise, (30, 30), tolerance=0.5, smoothing_px=0)
