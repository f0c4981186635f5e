"""Planes whose borders a photo confirms at a pose."""

from __future__ import annotations

import numpy as np
import pytest
import regionpose as rp
from made_up_worlds import CAMERA, World, made_world
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.slow

SCANNER = (0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def world() -> World:
    return made_world(5)


@pytest.fixture(scope="module")
def planes(world: World) -> list[np.ndarray]:
    return rp.segment.find_planes(world.points)


@pytest.fixture(scope="module")
def found(world: World, planes: list[np.ndarray]) -> rp.scene.ConfirmedRegions:
    return rp.scene.confirmed_regions(CAMERA, world.frame(), world.pose, sensor_origin=SCANNER, planes=planes)


def turned(pose: rp.Pose, degrees: float) -> rp.Pose:
    turn = Rotation.from_rotvec(np.radians([0.3 * degrees, degrees, 0.0])) * pose.rotation
    return rp.Pose(turn, -turn.apply(pose.camera_center))


def test_planes_of_a_true_pose_are_confirmed(found: rp.scene.ConfirmedRegions, planes: list[np.ndarray]) -> None:
    assert len(found.regions) >= 3 and found.compared >= len(found.regions)
    assert found.log_odds >= np.log(9.0)
    assert [region.name for region in found.regions] == [f"plane {k}" for k in range(1, len(found.regions) + 1)]
    for region in found.regions:
        assert region.log_odds >= np.log(9.0) and 0.1 <= region.edge_fraction <= 1.0
        assert any(np.array_equal(region.indices, plane) for plane in planes)


def test_the_regions_give_the_pose(world: World, found: rp.scene.ConfirmedRegions) -> None:
    images, worlds = [r.image for r in found.regions], [r.world for r in found.regions]
    prior = rp.Prior(camera_near=SCANNER, camera_near_sigma_m=0.5, up=[0, 0, 1], up_sigma_deg=3.0)
    estimate = rp.estimate_pose(CAMERA, images, worlds, prior=prior)
    turn = np.degrees((estimate.pose.rotation * world.pose.rotation.inv()).magnitude())
    assert turn < 1.0 and np.linalg.norm(estimate.pose.camera_center - world.pose.camera_center) < 0.2


@pytest.mark.parametrize("degrees", [3.0, 6.0])
def test_a_turned_pose_is_confirmed_by_less(
    world: World, planes: list[np.ndarray], found: rp.scene.ConfirmedRegions, degrees: float
) -> None:
    wrong = rp.scene.confirmed_regions(
        CAMERA, world.frame(), turned(world.pose, degrees), sensor_origin=SCANNER, planes=planes
    )
    assert wrong.log_odds < np.log(9.0) and 2 * len(wrong.regions) < len(found.regions)


def test_regions_show_what_the_photo_does(world: World, found: rp.scene.ConfirmedRegions) -> None:
    for region in found.regions:
        # Polygons on the photo's own edges, not the projected outline.
        error, _ = rp.solve.overlap_errors(CAMERA, [region.image], [region.world], world.pose)
        assert 0.0 < error < 0.3
        assert region.image.area > 100.0 and np.concatenate(region.image.rings).min() >= -0.5


def test_a_photo_without_edges_confirms_nothing(world: World, planes: list[np.ndarray]) -> None:
    frame = rp.Frame(image=np.full_like(world.photo, 90), points=world.points)
    found = rp.scene.confirmed_regions(CAMERA, frame, world.pose, sensor_origin=SCANNER, planes=planes)
    assert found.regions == () and found.log_odds < np.log(9.0)


def test_planes_are_found_in_view_where_none_are_given(world: World, found: rp.scene.ConfirmedRegions) -> None:
    shares: list[float] = []
    own = rp.scene.confirmed_regions(CAMERA, world.frame(), world.pose, sensor_origin=SCANNER, progress=shares.append)
    assert len(own.regions) >= 3 and own.log_odds == found.log_odds
    assert shares == sorted(shares) and shares[-1] == 1.0


def test_without_points_in_view_nothing_is_compared(world: World) -> None:
    frame = rp.Frame(image=world.photo, points=world.points[:0])
    found = rp.scene.confirmed_regions(CAMERA, frame, world.pose)
    assert found.regions == () and found.compared == 0 and found.log_odds == 0.0


def test_the_scanner_need_not_be_known(world: World, planes: list[np.ndarray]) -> None:
    found = rp.scene.confirmed_regions(CAMERA, world.frame(), world.pose, planes=planes)
    assert found.log_odds >= np.log(9.0)


@pytest.mark.parametrize(
    ("planes", "message"),
    [
        ([[0.5, 1.0]], r"planes 0 is float64 of shape \(2,\); needed indices"),
        ([[0, 1, 2], [[0, 1]]], r"planes 1 is int64 of shape \(1, 2\); needed indices"),
        ([[0, 1, 38_400]], r"planes 0 has indices 0 to 38400; needed 0 to 38399"),
        ([[-1, 1, 2]], r"planes 0 has indices -1 to 2; needed 0 to 38399"),
    ],
)
def test_indices_that_are_none_are_refused(world: World, planes: list[list[float]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rp.scene.confirmed_regions(CAMERA, world.frame(), world.pose, planes=planes)


def test_a_place_of_another_shape_is_refused(world: World) -> None:
    with pytest.raises(ValueError, match="sensor_origin"):
        rp.scene.confirmed_regions(CAMERA, world.frame(), world.pose, sensor_origin=[0.0, 0.0])
