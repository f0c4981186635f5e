"""How well photo and cloud agree at a pose, and pictures of a photo's edges."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE, cards, painted, turned
from numpy.typing import NDArray
from regionpose.alignment.photo import Photo, blurred
from scipy.ndimage import gaussian_filter

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]


@pytest.mark.parametrize("seed", range(2))
def test_photo_and_cloud_agree_at_the_pose_alone(seed: int) -> None:
    photo, points = cards(seed)
    right = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), POSE)
    assert right.log_odds > 20.0 and right.edge_fraction > 0.9
    others = [
        rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), turned(degrees))
        for degrees in (-20.0, -10.0, 9.0, 15.0)
    ]
    # Single cards may fall on others' edges.
    assert (
        max(other.log_odds for other in others) < 0.2 * right.log_odds
        and max(other.edge_fraction for other in others) < 0.7
    )


def test_the_nearest_pose_undoes_a_turn() -> None:
    photo, points = cards(0)
    alignment = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), turned(0.5))
    assert alignment.log_odds > 20.0
    found = alignment.nearest.rotation * turned(0.5).rotation.inv()
    assert found.as_rotvec(degrees=True) == pytest.approx([0.0, -0.5, 0.0], abs=0.2)
    assert np.linalg.norm(alignment.nearest.camera_center - POSE.camera_center) < 0.05


def test_where_the_world_lies_does_not_matter() -> None:
    photo, points = cards(1)
    moved = rp.Pose(POSE.rotation, POSE.translation - POSE.rotation.apply([431_999.0, 5_400_000.0, 119.0]))
    here = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), POSE)
    there = rp.check_alignment(
        CAMERA, rp.Frame(image=photo, points=points + np.array([431_999.0, 5_400_000.0, 119.0])), moved
    )
    assert there.log_odds == pytest.approx(here.log_odds, rel=0.1)


def test_edges_beside_the_regions_are_left_out() -> None:
    photo, points = cards(2)
    whole = rp.ImageRegion.from_polygon([[100.0, 100.0], [400.0, 100.0], [400.0, 300.0], [100.0, 300.0]])
    alignment = rp.check_alignment(CAMERA, rp.Frame([whole], image=photo, points=points), POSE)
    within = (alignment.places > [89.0, 89.0]).all(axis=1) & (alignment.places < [411.0, 311.0]).all(axis=1)
    corner = np.hypot(*(np.abs(alignment.places - [250.0, 200.0]) - [150.0, 100.0])[within].clip(0.0).T)
    assert (corner > 9.0).all()
    everywhere = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), POSE).places
    assert (np.abs(everywhere - [250.0, 200.0]) < [150.0, 100.0]).all(axis=1).sum() > 100


def test_a_photo_is_prepared_once_for_further_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    photo, points = cards(0)
    photo = photo.copy()
    made: list[Photo] = []
    prepare = Photo.of

    def counted(image: Any) -> Photo:
        made.append(prepare(image))
        return made[-1]

    monkeypatch.setattr(Photo, "of", counted)
    for count in (1, 2):
        # Another photo, by one pixel.
        photo[0, 0] = 100 + count
        odds = {rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), POSE).log_odds for _ in range(2)}
        assert (len(odds), len(made)) == (1, count)


def test_large_photos_are_reduced() -> None:
    image, points = cards(0)
    large = np.kron(image, np.ones((3, 3), dtype=np.uint8))
    camera = rp.PinholeCamera(1500.0, 1500.0, 959.5, 719.5, width=1920, height=1440)
    photo = Photo.of(large)
    assert photo.reduction == 2 and photo.luminance.shape == (720, 960)
    alignment = rp.check_alignment(camera, rp.Frame(image=large, points=points), POSE)
    assert alignment.log_odds > 10.0 and alignment.places.max() > 960.0
    np.testing.assert_allclose(photo.pixels(photo.places(alignment.places)), alignment.places, atol=1e-9)


@pytest.mark.parametrize("shape", [(40, 53), (64, 32), (3, 7), (1, 1)])
def test_pictures_are_filtered_as_by_scipy_to_the_last_bit(shape: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).uniform(size=shape).astype(np.float32)
    for spread, reach in ((2.0, 3.0), (8.0, 3.0), (30.0, 2.0)):
        np.testing.assert_array_equal(blurred(picture, spread, reach), gaussian_filter(picture, spread, truncate=reach))


def test_intensity_adds_edges_where_surfaces_change_their_shade() -> None:
    photo, points, intensity = painted(0)
    by_depth = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points), POSE)
    assert len(by_depth.places) == 0 and by_depth.log_odds == 0.0
    right = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points, intensity=intensity), POSE)
    assert right.log_odds > 10.0 and right.edge_fraction > 0.9
    scaled = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points, intensity=4.0 - 0.25 * intensity), POSE)
    np.testing.assert_array_equal(scaled.places, right.places)
    wrong = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points, intensity=intensity), turned(12.0))
    assert wrong.log_odds < 0.0


def test_nothing_in_view_says_nothing() -> None:
    photo, points = cards(0)
    for pose, cloud in ((turned(180.0), points), (POSE, points[:5]), (POSE, np.full((7, 3), np.nan))):
        alignment = rp.check_alignment(CAMERA, rp.Frame(image=photo, points=cloud), pose)
        assert len(alignment.places) == 0 and np.isnan(alignment.edge_fraction) and alignment.log_odds == 0.0
        assert alignment.nearest is pose


def test_a_photo_of_one_shade_says_nothing() -> None:
    _, points = cards(0)
    alignment = rp.check_alignment(
        CAMERA, rp.Frame(image=np.full((480, 640), 128, dtype=np.uint8), points=points), POSE
    )
    assert (
        len(alignment.places) > 100
        and alignment.edge_fraction == 0.0
        and alignment.log_odds == pytest.approx(0.0, abs=0.5)
    )


def test_wrong_shapes_are_named() -> None:
    photo, points = cards(0)
    with pytest.raises(ValueError, match=r"points has shape \(5, 2\); needed \(n, 3\)"):
        rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points[:5, :2]), POSE)
    with pytest.raises(ValueError, match=r"image has shape \(3,\)"):
        rp.check_alignment(CAMERA, rp.Frame(image=[1.0, 0.5, 0.25], points=points), POSE)
    with pytest.raises(ValueError, match=r"intensity has shape \(4,\); needed \(\d+,\), one value a point"):
        rp.check_alignment(CAMERA, rp.Frame(image=photo, points=points, intensity=np.ones(4)), POSE)
