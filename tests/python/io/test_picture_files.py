"""Image files as they come: deep gray, turned by their EXIF data, and of formats that are not to be read."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.masks.readers import coverage_from_file
from regionpose.io.reading import FileError, read_turn
from regionpose.scene.document import SceneError
from regionpose.scene.exposure import scene_sides
from regionpose.scene.loading import load_scene
from regionpose.scene.sensors import read_picture
from regionpose.validation.arrays import checked_image, eight_bits
from scene_files import HEIGHT, WIDTH, scene_values, write_scene

PACKAGE = Path(rp.__file__).parent

SHADES = np.arange(256, dtype=np.uint8).reshape(8, 32)
"""Each level of 8 bits once."""

ORIENTATION = 0x0112

SHOWN: dict[int, Callable[[NDArray[np.uint8]], NDArray[np.uint8]]] = {
    1: lambda stored: stored,
    2: lambda stored: stored[:, ::-1],
    3: lambda stored: stored[::-1, ::-1],
    4: lambda stored: stored[::-1],
    5: lambda stored: stored.T,
    6: lambda stored: stored[::-1].T,
    7: lambda stored: stored[::-1, ::-1].T,
    8: lambda stored: stored.T[::-1],
}
"""By Exif 2.32, table of the tag 274: 6 says that the stored first row is the right side of what is shown."""


def turned(path: Path, stored: NDArray[np.uint8], orientation: int, **options: Any) -> Path:
    """The path of a picture whose EXIF data say how it is turned."""
    exif = Image.Exif()
    exif[ORIENTATION] = orientation
    Image.fromarray(stored).save(path, exif=exif, **options)
    return path


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.pgm"])
def test_gray_of_more_than_8_bits_keeps_its_upper_ones(bits: int, name: str, tmp_path: Path) -> None:
    deep = (SHADES.astype(np.uint16) << (bits - 8)) + np.uint16((1 << (bits - 8)) - 1)
    Image.fromarray(deep).save(tmp_path / name)
    expected = np.repeat(SHADES[..., None], 3, axis=2)
    np.testing.assert_array_equal(read_picture(tmp_path / name), expected)
    np.testing.assert_array_equal(checked_image(deep), expected)


def test_numbers_of_32_bits_are_samples_of_their_depth(tmp_path: Path) -> None:
    Image.fromarray(SHADES.astype(np.int32) * 257).save(tmp_path / "a.tif")
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tif")[..., 1], SHADES)


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (SHADES / 255.0, SHADES),
        (SHADES / 510.0, np.round(SHADES / 2.0)),
        (SHADES - 20.0, SHADES),
        (20.0 + SHADES / 10.0, SHADES),
        (np.full((2, 3), 7.5), np.zeros((2, 3))),
    ],
    ids=["in [0, 1]", "half of it", "beyond", "temperatures", "one"],
)
def test_floats_by_0_to_1_or_by_their_range(
    values: NDArray[np.float64], expected: NDArray[np.float64], tmp_path: Path
) -> None:
    Image.fromarray(values.astype(np.float32)).save(tmp_path / "a.tif")
    assert np.abs(read_picture(tmp_path / "a.tif")[..., 0] - expected).max() <= (1.0 if len(values) > 2 else 0.0)


def test_whole_numbers_below_0_by_their_range() -> None:
    np.testing.assert_array_equal(eight_bits(np.array([[-1000, 0, 1550]])), [[0, 100, 255]])


def test_levels_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0.0, np.nan]], dtype=np.float32)).save(tmp_path / "a.tif")
    with pytest.raises(FileError, match=r"a.tif: found levels from nan to nan; needed finite ones"):
        read_picture(tmp_path / "a.tif")


def test_a_region_grows_alike_in_samples_of_12_and_16_bits() -> None:
    image = np.full((60, 80), 400, dtype=np.uint16)
    image[20:40, 25:60] = 3200
    expected = np.zeros((60, 80), dtype=np.bool_)
    expected[20:40, 25:60] = True
    for shift in (0, 4):
        np.testing.assert_array_equal(rp.segment.grow_image_region(image << np.uint16(shift), (40, 30)), expected)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_shares_of_a_deep_mask(bits: int, tmp_path: Path) -> None:
    whole = (1 << bits) - 1
    levels = np.array([[0, whole // 4, whole]], dtype=np.uint16)
    Image.fromarray(levels).save(tmp_path / "a.png")
    np.testing.assert_allclose(coverage_from_file(tmp_path / "a.png", (1, 3)), levels / whole, rtol=1e-6)


def test_shares_in_floats_are_taken_as_they_are(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0.0, 0.3, 0.6]], dtype=np.float32)).save(tmp_path / "a.tif")
    np.testing.assert_allclose(coverage_from_file(tmp_path / "a.tif", (1, 3)), [[0.0, 0.3, 0.6]], rtol=1e-6)
    Image.fromarray(np.array([[0.0, 0.3, 60.0]], dtype=np.float32)).save(tmp_path / "a.tif")
    with pytest.raises(ValueError, match=r"a.tif: found fractions from 0.0 to 60.0; needed them in \[0, 1\]"):
        coverage_from_file(tmp_path / "a.tif", (1, 3))


@pytest.mark.parametrize("orientation", SHOWN)
@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.webp"])
def test_photos_and_masks_are_read_as_viewers_show_them(orientation: int, name: str, tmp_path: Path) -> None:
    stored = np.zeros((30, 40), dtype=np.uint8)
    stored[:10, :15] = 1
    options = {"lossless": True} if name.endswith("webp") else {}
    path = turned(tmp_path / name, stored, orientation, **options)
    expected = SHOWN[orientation](stored)
    np.testing.assert_array_equal(read_picture(path)[..., 0], expected)
    if not name.endswith("webp"):  # Which holds colors, so that 1 is one of them.
        np.testing.assert_array_equal(rp.io.mask_from_file(path, 1), expected == 1)
    assert (read_turn(path) is not None) == (expected.shape != stored.shape)


def test_a_calibration_of_the_photo_as_stored_is_told_of_the_turn(tmp_path: Path) -> None:
    shown = np.full((WIDTH, HEIGHT), 128, dtype=np.uint8)
    path = write_scene(tmp_path)
    turned(tmp_path / "image.png", SHOWN[8](shown), 6)
    with pytest.raises(SceneError, match=r"scene.yaml:\d+: image: found 240 x 320 .* EXIF .* calibrate with photos as"):
        scene_sides(load_scene(path))
    # A photo that is shown as the camera took it, however it is stored.
    turned(tmp_path / "image.png", SHOWN[8](shown.T), 6)
    assert scene_sides(load_scene(path)).image.shape == (HEIGHT, WIDTH, 3)


def test_a_mask_of_the_photo_as_stored_is_told_of_the_turn(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["image"] = {"mask": "mask.png"}
    path = write_scene(tmp_path, values)
    mask = np.zeros((WIDTH, HEIGHT), dtype=np.uint8)
    mask[50:90, 60:100] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    with pytest.raises(SceneError, match=r"found masks of 240 x 320 pixels; needed 320 x 240, as the image, .* EXIF"):
        scene_sides(load_scene(path))


def test_a_photo_of_several_is_read_as_its_first_and_is_no_mask(tmp_path: Path) -> None:
    first, second = (Image.fromarray(np.full((40, 60, 3), level, dtype=np.uint8)) for level in (200, 20))
    first.save(tmp_path / "phone.jpg", format="MPO", save_all=True, append_images=[second])
    assert np.abs(read_picture(tmp_path / "phone.jpg").astype(int) - 200).max() <= 2
    with pytest.raises(ValueError, match="is a JPEG, which changes the labels"):
        rp.io.masks_from_file(tmp_path / "phone.jpg")


@pytest.mark.parametrize("read", [read_picture, rp.io.masks_from_file, lambda path: coverage_from_file(path, (48, 64))])
def test_no_picture_starts_another_program(
    read: Callable[[Path], object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, gs = tmp_path / "log", tmp_path / "gs"
    gs.write_text(f'#!/bin/sh\necho "$@" >> {log}\n[ "$1" = --version ] && echo 10.0\nexit 0\n', encoding="utf-8")
    gs.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    # Pillow asks once whether it is there.
    monkeypatch.setattr("PIL.EpsImagePlugin.gs_binary", None)
    path = tmp_path / "photo.jpg"
    path.write_text("%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 64 48\n%%EndComments\nshowpage\n%%EOF\n")
    with pytest.raises(FileError, match=r"photo.jpg: found no picture"):
        read(path)
    assert not log.exists()


def test_one_place_opens_pictures() -> None:
    opening = re.compile(r"\bImage\.open\(")
    held = {path.name for path in PACKAGE.rglob("*.py") if opening.search(path.read_text(encoding="utf-8"))}
    assert held == {"reading.py"}
