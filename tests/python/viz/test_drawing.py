from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image
from regionpose.io import png
from regionpose.io.outputs.whole_file import whole_file
from regionpose.io.png import save_png
from regionpose.viz.overlays import OBSERVED, PROJECTED, depth_colors, overlay_depth, overlay_regions
from scene_files import CAMERA, HEIGHT, PLATES, POSE, WIDTH
from scipy.spatial.transform import Rotation
from skimage.color import rgb2lab

Array = NDArray[np.float64]
AT_ORIGIN = rp.Pose(Rotation.identity(), np.zeros(3))
GRAY = np.full((HEIGHT, WIDTH, 3), 128, dtype=np.uint8)
WORLD = [rp.WorldRegion.from_polygon([plate]) for plate in PLATES.values()]
SEEN = [rp.ImageRegion.from_polygon([CAMERA.project(POSE.transform(plate))]) for plate in PLATES.values()]
STEP_RATIO = 1.25
"""Largest over smallest step of the color table: rounding to 8 bits moves a color by up to half a unit of CIELAB."""

BARREL = rp.PinholeCamera(150.0, 150.0, 159.5, 119.5, width=WIDTH, height=HEIGHT, distortion=(-0.2, 0.02, 0.0, 0.0))


def like(picture: NDArray[np.uint8], color: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Pixels (h, w) of about a color."""
    return np.asarray((np.abs(picture.astype(int) - color) < 60).all(axis=2))


def along(ring: Array, camera: rp.PinholeCamera, pose: rp.Pose) -> Array:
    """Pixels (n, 2), densely, on a ring's edges as the camera's formula maps them."""
    share = np.linspace(0.0, 1.0, 200)[:, None]
    edges = [start + share * (end - start) for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True)]
    return camera.project(pose.transform(np.concatenate(edges)))


@pytest.mark.parametrize("camera", [CAMERA, BARREL], ids=["pinhole", "barrel distortion"])
def test_contours_lie_where_the_camera_projects_them(camera: rp.PinholeCamera) -> None:
    picture = overlay_regions(camera, GRAY, None, WORLD[:1], POSE, [""])
    exact = along(WORLD[0].rings[0], camera, POSE)
    rows, columns = np.nonzero(like(picture, PROJECTED))
    drawn = np.column_stack([columns, rows])
    # The legend's line sample, near a corner, has the color too.
    drawn = drawn[np.linalg.norm(drawn - exact.mean(axis=0), axis=1) < 80.0]
    apart = np.linalg.norm(drawn[:, None] - exact[None], axis=2)
    assert apart.min(axis=1).max() < 2.0, "a pixel is drawn off the contour"
    assert np.percentile(apart.min(axis=0), 99) < 1.5, "a part of the contour isn't drawn"


def test_observed_contours_lie_under_projected_ones() -> None:
    moved = rp.Pose(POSE.rotation, POSE.translation + np.array([0.3, 0.0, 0.0]))
    picture = overlay_regions(CAMERA, GRAY, SEEN, WORLD, moved)
    for color, rings in (
        (OBSERVED, [region.rings[0] for region in SEEN]),
        (PROJECTED, [along(region.rings[0], CAMERA, moved) for region in WORLD]),
    ):
        x, y = np.rint(np.concatenate(rings)).astype(int).T
        near = [
            like(picture[max(b - 2, 0) : b + 3, max(a - 2, 0) : a + 3], color).any() for a, b in zip(x, y, strict=True)
        ]
        assert np.mean(near) > 0.9


@pytest.mark.parametrize("turn", [0.0, 60.0, 90.0, 180.0])
def test_regions_out_of_view_and_behind_the_camera_are_left_out(turn: float) -> None:
    away = rp.Pose(Rotation.from_euler("y", turn, degrees=True) * POSE.rotation, POSE.translation * [1.0, 1.0, 0.02])
    picture = overlay_regions(CAMERA, GRAY, SEEN, WORLD, away, ["floor", "wall"])
    assert picture.shape == GRAY.shape and (picture != GRAY).any()


@settings(max_examples=12, deadline=None)
@given(
    st.floats(-180.0, 180.0),
    st.floats(-90.0, 90.0),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.sampled_from([1, 7, 40, 200]),
)
def test_no_pose_and_no_size_breaks_a_drawing(yaw: float, pitch: float, shift: tuple[float, ...], size: int) -> None:
    pose = rp.Pose(Rotation.from_euler("yx", [yaw, pitch], degrees=True), np.array(shift))
    image, unsized = np.zeros((size, 2 * size), dtype=np.uint8), replace(CAMERA, width=None, height=None)
    assert overlay_regions(unsized, image, SEEN, WORLD, pose, ["a long name 12.3 %", ""]).shape == (size, 2 * size, 3)
    height, width, _ = overlay_depth(unsized, image, np.concatenate(list(PLATES.values())), pose).shape
    assert height == size and width > 2 * size


def test_labels_cover_no_contour_where_there_is_room() -> None:
    bare, named = (
        overlay_regions(CAMERA, GRAY, SEEN, WORLD, POSE, labels)
        for labels in (["", ""], ["floor  1.2 %", "wall  3.4 %"])
    )
    drawn = like(bare, PROJECTED) | like(bare, OBSERVED)
    kept = like(named, PROJECTED) | like(named, OBSERVED)
    assert not (drawn & ~kept).any()


def test_the_given_image_is_left_alone_and_drawings_repeat() -> None:
    image = GRAY.copy()
    points = np.concatenate(list(PLATES.values()))
    pictures = [
        (overlay_regions(CAMERA, image, SEEN, WORLD, POSE), overlay_depth(CAMERA, image, points, POSE))
        for _ in range(2)
    ]
    np.testing.assert_array_equal(image, GRAY)
    for first, again in zip(*pictures, strict=True):
        np.testing.assert_array_equal(first, again)


@pytest.mark.parametrize(("observed", "labels"), [(SEEN[:1], ()), (SEEN, ("a",))])
def test_numbers_that_differ_are_named(observed: list[rp.ImageRegion], labels: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=r"there are 1 (image regions|labels) and 2 world regions"):
        overlay_regions(CAMERA, GRAY, observed, WORLD, POSE, labels)


def test_near_dots_are_light_far_ones_dark_and_lie_on_their_pixels() -> None:
    pixels = np.array([[60.0, 50.0], [100.0, 180.0], [140.0, 120.0]])
    depths = np.array([2.0, 5.0, 20.0])
    bearings = CAMERA.bearings(pixels)
    picture = overlay_depth(CAMERA, np.zeros_like(GRAY), bearings * depths[:, None], AT_ORIGIN, limits_m=(2.0, 20.0))
    near, middle, far = picture[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    table = depth_colors()
    np.testing.assert_array_equal(near, table[255])
    np.testing.assert_array_equal(far, table[0])
    np.testing.assert_array_equal(middle, table[int(255 * np.log(20.0 / 5.0) / np.log(10.0))])


def test_a_point_behind_a_wall_is_not_drawn() -> None:
    axis = np.linspace(-1.0, 1.0, 81)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    wall = np.column_stack([x, y, np.full(x.size, 3.0)])
    hidden = np.array([[0.004, 0.005, 9.0]])
    with_it, without = (
        overlay_depth(CAMERA, GRAY, points, AT_ORIGIN, limits_m=(2.0, 10.0))
        for points in (np.concatenate([wall, hidden]), wall)
    )
    np.testing.assert_array_equal(with_it, without)
    alone = overlay_depth(CAMERA, GRAY, hidden, AT_ORIGIN, limits_m=(2.0, 10.0))
    assert (alone != overlay_depth(CAMERA, GRAY, -hidden, AT_ORIGIN, limits_m=(2.0, 10.0))).any()


def test_equal_steps_of_the_depth_colors_look_equal() -> None:
    lab = rgb2lab(depth_colors()[None] / 255.0)[0]
    steps = np.linalg.norm(np.diff(lab[::8], axis=0), axis=1)
    assert (np.diff(lab[:, 0]) > -0.5).all(), "lightness falls"
    assert steps.max() < STEP_RATIO * steps.min()


@pytest.mark.parametrize("limits", [(0.0, 1.0), (2.0, 2.0), (3.0, 1.0), (1.0, np.inf), (np.nan, 1.0)])
def test_limits_that_give_no_scale_are_named(limits: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="needed 0 < nearest < farthest"):
        overlay_depth(CAMERA, GRAY, np.ones((1, 3)), AT_ORIGIN, limits_m=limits)


def test_a_picture_is_saved_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save_png(tmp_path / "a.png", GRAY)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), GRAY)
    with pytest.raises(FileExistsError, match=r"a\.png"):
        save_png(path, GRAY // 2)

    def fails(path: Path, *, overwrite: bool) -> None:
        with whole_file(path, overwrite=overwrite) as file:
            file.write(b"half")
            raise OSError("disk full")

    monkeypatch.setattr(png, "whole_file", fails)
    for name in ("a.png", "b.png"):
        with pytest.raises(OSError, match="disk full"):
            save_png(tmp_path / name, GRAY // 2, overwrite=True)
    monkeypatch.undo()
    assert [held.name for held in tmp_path.iterdir()] == ["a.png"]
    np.testing.assert_array_equal(np.asarray(Image.open(path)), GRAY)
    save_png(path, GRAY // 2, overwrite=True)
    np.testing.assert_array_equal(np.asarray(Image.open(path)), GRAY // 2)
