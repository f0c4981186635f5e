"""Focal lengths that photo and cloud contradict: told, and by which factor, and right ones left alone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, cards
from diagnostics import edges_of, focal_of
from numpy.typing import NDArray

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]


def worlds() -> list[rp.WorldRegion]:
    """Two regions before the cards."""
    return [rp.WorldRegion.from_polygon(POSE.inverse().transform(SHAPE + place)) for place in PLACES]


def images(seed: int, noise_px: float = 0.5) -> list[rp.ImageRegion]:
    """The same as the photo shows them, by corners that are some pixels off."""
    rng = np.random.default_rng(seed)
    rings = [CAMERA.project(SHAPE + place) for place in PLACES]
    return [rp.ImageRegion.from_polygon(ring + rng.normal(0.0, noise_px, ring.shape)) for ring in rings]


@cache
def judged(factor: float, seed: int, photo: int | None = None, frames: int = 1) -> rp.PoseEstimate:
    """The pose with the camera's focal lengths times a factor, by regions and edges; tests share it."""
    camera = CAMERA.zoomed(factor)
    held = []
    for number in range(seed, seed + frames):
        _, points = cards(number)
        picture, _ = cards(number if photo is None else photo)
        sides = (images(seed), worlds()) if number == seed else ()
        held.append(rp.Frame(*sides, image=picture, points=points))
    return rp.calibrate(camera, held)


@pytest.mark.parametrize(("seed", "factor"), [(0, 0.85), (1, 1.2)])
def test_wrong_focal_lengths_are_named_with_the_right_ones(factor: float, seed: int) -> None:
    found = judged(factor, seed)
    focal = focal_of(found)
    assert focal.log_odds < -np.log(9.0) and focal.factor * factor == pytest.approx(1.0, abs=0.03)
    warning = {warning.code: warning for warning in found.warnings}[rp.WarningCode.FOCAL_LENGTH_CONFLICT]
    assert warning.values["factor"] == focal.factor
    assert found.confidence < 0.2


def test_right_focal_lengths_are_left_alone() -> None:
    found = judged(1.0, 0)
    assert focal_of(found).log_odds > np.log(9.0) and focal_of(found).factor == 1.0
    assert "focal-length-conflict" not in {warning.code for warning in found.warnings}
    # As good as a calibration is, too.
    assert focal_of(judged(1.005, 1)).log_odds > 0.0


def test_a_photo_that_shows_none_of_the_edges_says_nothing() -> None:
    assert focal_of(judged(0.9, 1, photo=11)).log_odds > 0.0


def test_a_percent_moves_the_pose_as_stated() -> None:
    focal = focal_of(judged(1.0, 0))
    shorter, longer = (judged(factor, 0).pose for factor in (0.99, 1.01))
    found = 0.5 * shorter.local_coordinates(longer)
    assert np.linalg.norm(focal.shift[3:] - found[3:]) < 0.2 * np.linalg.norm(found[3:])
    assert focal.shift_m == pytest.approx(np.linalg.norm(longer.camera_center - shorter.camera_center) / 2.0, rel=0.2)


def test_a_camera_without_focal_lengths_has_no_such_evidence() -> None:
    camera = rp.cameras.EquirectangularCamera(1000, 500)
    photo, points = np.zeros((500, 1000), dtype=np.uint8), cards(0)[1]
    rings = [camera.project(SHAPE + place) for place in PLACES]
    regions = [rp.ImageRegion.from_polygon(ring) for ring in rings]
    assert edges_of(rp.calibrate(camera, [rp.Frame(regions, worlds(), image=photo, points=points)])).focal is None


def test_frames_of_one_pose_count_together() -> None:
    both, one = focal_of(judged(0.85, 0, frames=2)), focal_of(judged(0.85, 0))
    assert both.log_odds < one.log_odds < 0.0


def test_a_factor_is_above_zero() -> None:
    zoomed = CAMERA.zoomed(1.25)
    assert (zoomed.fx, zoomed.fy, zoomed.cx, zoomed.width) == (625.0, 625.0, CAMERA.cx, 640)
    for factor in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="factor: found"):
            CAMERA.zoomed(factor)
