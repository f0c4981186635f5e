"""Photos and masks of another size than the camera's: no function takes them without a word."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE
from numpy.typing import NDArray

Photo = NDArray[np.uint8]

PHOTO = np.full((480, 640, 3), 90, dtype=np.uint8)
POINTS = POSE.inverse().transform([[0.1, 0.2, 4.0], [-0.2, 0.1, 5.0], [0.4, -0.3, 6.0]])
SIGN = np.array([[0.0, 0.0, 4.0], [0.8, 0.0, 4.0], [0.8, 0.4, 4.0], [0.4, 0.4, 4.0], [0.4, 1.0, 4.0], [0.0, 1.0, 4.0]])
IMAGES = [rp.ImageRegion.from_polygon(CAMERA.project(SIGN))]
WORLDS = [rp.WorldRegion.from_polygon(POSE.inverse().transform(SIGN))]
SMALL = rp.ImageRegion.from_mask(np.pad(np.ones((60, 90), dtype=np.bool_), ((40, 140), (80, 150))))

TAKE_PHOTOS: dict[str, Callable[[Photo, rp.cameras.Camera], object]] = {
    "check_alignment": lambda photo, camera: rp.check_alignment(camera, rp.Frame(image=photo, points=POINTS), POSE),
    "calibrate": lambda photo, camera: rp.calibrate(camera, [rp.Frame(image=photo, points=POINTS)]),
    "confirmed_regions": lambda photo, camera: rp.scene.confirmed_regions(
        camera, rp.Frame(image=photo, points=POINTS), POSE
    ),
    "colorize": lambda photo, camera: rp.colorize(camera, photo, POINTS, POSE),
    "blend_colors": lambda photo, camera: rp.fusion.blend_colors([(camera, photo, POSE)], POINTS),
    "overlay_regions": lambda photo, camera: rp.overlay_regions(camera, photo, IMAGES, WORLDS, POSE),
    "overlay_depth": lambda photo, camera: rp.overlay_depth(camera, photo, POINTS, POSE),
}

TAKE_MASKS: dict[str, Callable[[rp.ImageRegion], object]] = {
    "estimate_pose": lambda region: rp.estimate_pose(CAMERA, [region], WORLDS),
    "estimate_rig": lambda region: rp.estimate_rig(CAMERA, [rp.Frame([region], WORLDS)]),
    "match_regions": lambda region: rp.match_regions(CAMERA, [region], WORLDS),
    "overlap_errors": lambda region: rp.solve.overlap_errors(CAMERA, [region], WORLDS, POSE),
    "check_alignment": lambda region: rp.check_alignment(CAMERA, rp.Frame([region], image=PHOTO, points=POINTS), POSE),
    "calibrate": lambda region: rp.calibrate(CAMERA, [rp.Frame([region], WORLDS, image=PHOTO, points=POINTS)]),
    "overlay_regions": lambda region: rp.overlay_regions(CAMERA, PHOTO, [region], WORLDS, POSE),
}


@pytest.mark.parametrize("take", TAKE_PHOTOS.values(), ids=TAKE_PHOTOS)
@pytest.mark.parametrize(
    ("photo", "found"),
    [
        (PHOTO[::2, ::2], "found 320 x 240 pixels, 0.5 of the camera's; .*640 x 480, or camera.resized.320, 240"),
        (PHOTO.transpose(1, 0, 2), "found 480 x 640 pixels .turned by a quarter.* EXIF .*needed the calibrated 640"),
        (PHOTO[16:], "found 640 x 464 pixels .cut, .*; needed the calibrated 640 x 480$"),
        (PHOTO[:1, :1], "found 1 x 1 pixels"),
        (PHOTO[:, :-1], "found 639 x 480 pixels"),
    ],
    ids=["half", "turned", "cut", "one pixel", "a column less"],
)
def test_a_photo_of_another_size_is_refused(
    take: Callable[[Photo, rp.cameras.Camera], object], photo: Photo, found: str
) -> None:
    with pytest.raises(ValueError, match=f"image.*: {found}"):
        take(photo, CAMERA)


def test_each_view_is_compared_with_its_own_camera() -> None:
    small = (CAMERA.resized(320, 240), PHOTO[::2, ::2], POSE)
    rp.fusion.blend_colors([(CAMERA, PHOTO, POSE), small], POINTS)
    with pytest.raises(ValueError, match="image of view 1: found 320 x 240"):
        rp.fusion.blend_colors([(CAMERA, PHOTO, POSE), (CAMERA, small[1], POSE)], POINTS)


@pytest.mark.parametrize("take", TAKE_MASKS.values(), ids=TAKE_MASKS)
def test_a_mask_of_another_size_is_refused(take: Callable[[rp.ImageRegion], object]) -> None:
    with pytest.raises(ValueError, match=r"mask of image region 0: found 320 x 240 pixels.*; needed .* 640 x 480"):
        take(SMALL)


def test_a_camera_without_a_size_takes_any_photo() -> None:
    unsized = replace(CAMERA, width=None, height=None)
    for take in ("colorize", "overlay_regions", "overlay_depth", "check_alignment"):
        TAKE_PHOTOS[take](PHOTO[::2, ::2], unsized)


def test_a_camera_with_one_side_compares_that_one() -> None:
    wide = replace(CAMERA, height=None)
    wide.check_size((100, 640))
    with pytest.raises(ValueError, match="image: found 320 x 480 pixels"):
        wide.check_size((480, 320, 3))


@pytest.mark.parametrize("shape", [(8_000, 3), (3, 8_000), (1, 900), (900, 1)])
def test_a_long_narrow_photo_is_taken_like_any(shape: tuple[int, int]) -> None:
    height, width = shape
    camera = rp.PinholeCamera(500.0, 500.0, (width - 1) / 2, (height - 1) / 2, width=width, height=height)
    points = np.array([[0.0, 0.0, 4.0], [0.001, 0.001, 5.0]])
    photo = np.full(shape, 90, dtype=np.uint8)
    assert rp.colorize(camera, photo, points, rp.Pose.from_quat([0, 0, 0, 1], [0, 0, 0]))[1].any()
    drawn = rp.overlay_depth(camera, photo, points, rp.Pose.from_quat([0, 0, 0, 1], [0, 0, 0]))
    assert drawn.shape[0] == height and drawn.shape[1] > width
    assert rp.check_alignment(camera, rp.Frame(image=photo, points=points), POSE).log_odds == 0.0


def test_a_photo_in_whose_middle_the_camera_sees_no_ray_is_named() -> None:
    """The lens folds 0.9 of the focal length beside its axis, and nobody knows the size of its photos."""
    lens = rp.PinholeCamera(500.0, 500.0, 319.5, 239.5, distortion=(-0.4, 0.0, 0.0, 0.0))
    photo = np.full((40_960, 100), 90, dtype=np.uint8)
    with pytest.raises(
        ValueError, match=r"camera: found no ray at the middle of 100 x 40960 pixels, .* needed the camera"
    ):
        rp.check_alignment(lens, rp.Frame(image=photo, points=POINTS), POSE)
