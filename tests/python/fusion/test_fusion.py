from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import regionpose as rp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.fusion.colors import PosedImage, blend_colors, colored_cloud, colorize, seen_points
from regionpose.io.clouds import Cloud
from regionpose.validation.arrays import checked_image
from scene_files import CAMERA, HEIGHT, WIDTH
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
AT_ORIGIN = rp.Pose(Rotation.identity(), np.zeros(3))
SENSOR_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""A camera's axes (x right, y down, z ahead) in a lidar's (x ahead, y left, z up)."""


def points_at(pixels: Array, depth: float = 2.0) -> Array:
    """Camera points (n, 3) that are seen at pixels (n, 2)."""
    bearings = CAMERA.bearings(pixels)
    return np.asarray(depth * bearings / bearings[:, 2:])


def noise(seed: int = 3, shape: tuple[int, ...] = (HEIGHT, WIDTH, 3)) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


def test_colors_are_scipys_bilinear_interpolation() -> None:
    image = noise()
    pixels = np.random.default_rng(4).uniform([-0.49, -0.49], [WIDTH - 0.51, HEIGHT - 0.51], (500, 2))
    colors, visible = colorize(CAMERA, image, points_at(pixels), AT_ORIGIN)
    assert visible.all()
    for channel in range(3):
        exact = map_coordinates(image[..., channel].astype(float), pixels.T[::-1], order=1, mode="nearest")
        np.testing.assert_allclose(colors[:, channel], exact, atol=0.51)


def test_a_pixels_center_has_the_pixels_color() -> None:
    image = noise()
    rows, columns = np.array([0, 7, HEIGHT - 1]), np.array([0, 100, WIDTH - 1])
    colors, _ = colorize(CAMERA, image, points_at(np.column_stack([columns, rows]).astype(float)), AT_ORIGIN)
    np.testing.assert_array_equal(colors, image[rows, columns])


def test_an_image_ends_half_a_pixel_beyond_its_outermost_centers() -> None:
    edges = np.array([[-0.499, 9.0], [WIDTH - 0.501, 9.0], [9.0, -0.499], [9.0, HEIGHT - 0.501]])
    beyond = np.array([[-0.501, 99.0], [WIDTH - 0.499, 99.0], [99.0, -0.501], [99.0, HEIGHT - 0.499]])
    colors, visible = colorize(CAMERA, noise(), points_at(np.concatenate([edges, beyond])), AT_ORIGIN)
    assert visible.tolist() == [True] * 4 + [False] * 4
    np.testing.assert_array_equal(colors[4:], 0)
    np.testing.assert_array_equal(
        colors[0], colorize(CAMERA, noise(), points_at(np.array([[0.0, 9.0]])), AT_ORIGIN)[0][0]
    )


def test_points_behind_the_camera_in_it_and_not_finite_are_not_seen() -> None:
    points = np.array([[0.0, 0.0, -2.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 2.0], [np.inf, 0.0, 2.0], [0.0, 0.0, 2.0]])
    colors, visible = colorize(CAMERA, noise(), points, AT_ORIGIN)
    assert visible.tolist() == [False, False, False, False, True]
    np.testing.assert_array_equal(colors[:4], 0)


def lidar_walls(rings: int, camera_center: Array, ground: bool) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """What a lidar at the origin scans of a wall 4 m ahead, another 9 m ahead and the ground, with 2 cm noise.

    Points (n, 3), whether they are on the front wall, and whether that stands between them and the camera, by ray
    casting.
    """
    elevations, azimuths = np.radians(np.linspace(-20.0, 20.0, rings)), np.radians(np.arange(-40.0, 40.0, 0.2))
    elevation, azimuth = (grid.ravel() for grid in np.meshgrid(elevations, azimuths, indexing="ij"))
    level = np.cos(elevation)
    beams = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    front = on_plate(np.zeros(3), beams, 4.0, (1.0, 0.9))
    below = np.where(ground & (beams[:, 2] < 0.0), -1.7 / np.minimum(beams[:, 2], -1e-9), np.inf)
    ranges = np.minimum.reduce([front, on_plate(np.zeros(3), beams, 9.0, (20.0, 4.0)), below])
    met = np.isfinite(ranges)
    points = ranges[met, None] * beams[met]
    shared = on_plate(camera_center, points - camera_center, 4.0, (1.0, 0.9))
    on_front = front[met] <= ranges[met]
    noisy = points + np.random.default_rng(rings).normal(0.0, 0.02, (len(points), 1)) * beams[met]
    return noisy, on_front, ~on_front & (shared < 1.0)


def on_plate(origin: Array, directions: Array, ahead: float, half: tuple[float, float]) -> Array:
    """Distance along each direction (n, 3) to an upright plate of half width and height about the x axis, or inf."""
    along = (ahead - origin[0]) / directions[:, 0]
    sides = np.abs(origin[1:] + along[:, None] * directions[:, 1:])
    return np.where((along > 0.0) & (sides < half).all(axis=1), along, np.inf)


@pytest.mark.parametrize("ground", [False, True], ids=["walls", "walls and ground"])
@pytest.mark.parametrize("center", [(0.0, 0.5, 0.0), (0.3, -0.6, 0.3)], ids=["beside", "ahead and above"])
@pytest.mark.parametrize(
    ("rings", "least_seen"), [(24, 0.94), (64, 0.97), (256, 0.99)], ids=["24 rings", "64 rings", "256 rings"]
)
def test_no_point_of_a_hidden_wall_is_colored_and_nearly_all_others_are(
    rings: int, least_seen: float, center: tuple[float, float, float], ground: bool
) -> None:
    camera = rp.PinholeCamera(721.5, 721.5, 620.0, 187.0, width=1242, height=375)
    points, on_front, is_hidden = lidar_walls(rings, np.array(center), ground)
    pose = rp.Pose(Rotation.from_matrix(SENSOR_AXES), -SENSOR_AXES @ np.array(center))
    pixels, _, _ = seen_points(camera, points, pose, (375, 1242))
    inside = np.isfinite(pixels).all(axis=1)
    _, visible = colorize(camera, np.full((375, 1242, 3), 200, np.uint8), points, pose)
    assert (inside & is_hidden).sum() > 50
    assert not (visible & is_hidden).any()
    assert visible[inside & on_front].all()
    assert visible[inside & ~is_hidden].mean() > least_seen


def test_a_road_keeps_its_colors_up_to_the_horizon() -> None:
    # 64 rings from 1.7 m above a level road; the camera is half a meter beside the lidar.
    elevations, azimuths = np.radians(np.linspace(-24.8, -2.2, 60)), np.radians(np.arange(-30.0, 30.0, 0.2))
    elevation, azimuth = (grid.ravel() for grid in np.meshgrid(elevations, azimuths, indexing="ij"))
    ranges = 1.7 / np.tan(-elevation)
    road = np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), np.full(len(ranges), -1.7)])
    camera = rp.PinholeCamera(721.5, 721.5, 620.0, 187.0, width=1242, height=375)
    pose = rp.Pose(Rotation.from_matrix(SENSOR_AXES), SENSOR_AXES @ np.array([0.27, 0.0, -0.1]))
    pixels, distances, seen = seen_points(camera, road, pose, (375, 1242))
    inside = np.isfinite(pixels).all(axis=1)
    assert distances[inside].max() > 40.0
    assert seen[inside].all()


def test_the_next_scan_line_on_a_road_is_not_behind_the_one_before() -> None:
    # 32 rings 1.33 degrees apart: from 15 m on, each is more than a fifth farther away than the one before.
    elevations, azimuths = np.radians(-4.6 - 1.33 * np.arange(18)), np.radians(np.arange(-30.0, 30.0, 0.33))
    elevation, azimuth = (grid.ravel() for grid in np.meshgrid(elevations, azimuths, indexing="ij"))
    ranges = 1.8 / np.tan(-elevation)
    road = np.column_stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth), np.full(len(ranges), -1.8)])
    camera = rp.PinholeCamera(1266.0, 1266.0, 816.0, 491.0, width=1600, height=900)
    pose = rp.Pose(Rotation.from_matrix(SENSOR_AXES), np.array([0.0, -0.33, -0.43]))
    _, distances, _ = seen_points(camera, road, pose, (900, 1600))
    _, visible = colorize(camera, np.zeros((900, 1600), np.uint8), road, pose)
    assert np.nanmax(distances) > 20.0
    assert visible[np.isfinite(distances)].all()


def test_colors_of_points_do_not_depend_on_their_order() -> None:
    points, _, _ = lidar_walls(32, np.array([0.0, 0.5, 0.0]), True)
    pose = rp.Pose(Rotation.from_matrix(SENSOR_AXES), -SENSOR_AXES @ np.array([0.0, 0.5, 0.0]))
    order = np.random.default_rng(0).permutation(len(points))
    colors, visible = colorize(CAMERA, noise(), points, pose)
    again, seen_again = colorize(CAMERA, noise(), points[order], pose)
    np.testing.assert_array_equal(again, colors[order])
    np.testing.assert_array_equal(seen_again, visible[order])
    np.testing.assert_array_equal(colorize(CAMERA, noise(), points, pose)[0], colors)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.5, 20.0), st.floats(0.5, 20.0), st.floats(-0.9, 0.9), st.integers(0, 255), st.integers(0, 255))
def test_two_images_blend_by_their_share_of_pixels(near: float, far: float, lean: float, one: int, two: int) -> None:
    # Two cameras look along z from the point's front; its normal leans towards x, the rays are (0, 0, 1).
    views = [
        PosedImage(
            CAMERA, np.full((HEIGHT, WIDTH), value, np.uint8), rp.Pose(Rotation.identity(), np.array([0.0, 0.0, at]))
        )
        for value, at in ((one, near), (two, far))
    ]
    normal = np.array([[lean, 0.0, -np.sqrt(1.0 - lean**2)]])
    exact = (one / near**2 + two / far**2) / (1.0 / near**2 + 1.0 / far**2)
    for normals in (None, 3.0 * normal, -normal, np.zeros((1, 3))):
        colors, visible = blend_colors(views, np.zeros((1, 3)), normals=normals)
        assert visible.all()
        np.testing.assert_allclose(colors, exact, atol=0.501)


def test_a_grazing_view_weighs_by_the_cosine() -> None:
    # One camera ahead of the point, one at its right; the normal is 30 degrees off the first ray, 60 off the other.
    ahead = rp.Pose(Rotation.identity(), np.array([0.0, 0.0, 3.0]))
    right = rp.Pose(Rotation.from_euler("y", 90.0, degrees=True), np.array([0.0, 0.0, 3.0]))
    views = [
        (CAMERA, np.full((HEIGHT, WIDTH), 200, np.uint8), ahead),
        (CAMERA, np.zeros((HEIGHT, WIDTH), np.uint8), right),
    ]
    normal = np.array([[0.5, 0.0, np.sqrt(0.75)]])
    colors, _ = blend_colors(views, np.zeros((1, 3)), normals=normal)
    np.testing.assert_allclose(colors, 200.0 * np.sqrt(0.75) / (np.sqrt(0.75) + 0.5), atol=0.51)


def test_a_point_that_one_image_shows_has_its_color_alone() -> None:
    away = rp.Pose(Rotation.from_euler("y", 180.0, degrees=True), np.zeros(3))
    points, image = points_at(np.array([[50.0, 60.0]])), noise()
    blended, visible = blend_colors([(CAMERA, image, AT_ORIGIN), (CAMERA, noise(9), away)], points)
    np.testing.assert_array_equal(blended, colorize(CAMERA, image, points, AT_ORIGIN)[0])
    assert visible.all()


def test_a_cloud_keeps_its_own_colors_where_it_is_not_seen() -> None:
    points = np.concatenate([points_at(np.array([[50.0, 60.0]])), [[0.0, 0.0, -3.0]]])
    image = noise()
    before = Cloud(points, colors=np.full((2, 3), 77, dtype=np.uint8))
    cloud, visible = colored_cloud([(CAMERA, image, AT_ORIGIN)], before)
    assert visible.tolist() == [True, False]
    assert cloud.colors is not None and cloud.colors.tolist() == [image[60, 50].tolist(), [77, 77, 77]]
    assert cloud.fields["visible"].tolist() == [1, 0]
    assert colored_cloud([(CAMERA, image, AT_ORIGIN)], Cloud(points))[0].colors[1].tolist() == [0, 0, 0]  # type: ignore[index]


def test_clouds_without_points_and_without_visible_points_work() -> None:
    colors, visible = colorize(CAMERA, noise(), np.empty((0, 3)), AT_ORIGIN)
    assert colors.shape == (0, 3) and visible.shape == (0,)
    assert not colorize(CAMERA, noise(), np.array([[0.0, 0.0, -1.0]]), AT_ORIGIN)[1].any()


def test_images_of_other_types_have_the_same_colors() -> None:
    image = noise()
    np.testing.assert_array_equal(checked_image(image.astype(np.uint16) << 8), image)
    np.testing.assert_array_equal(checked_image(image / 255.0), image)
    assert checked_image(image[..., 0]).shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"image": np.zeros((4, 4, 4), np.uint8)}, r"image has shape \(4, 4, 4\)"),
        ({"image": np.zeros((4, 4), np.int64)}, "image has type int64"),
        ({"image": np.full((4, 4), np.nan)}, "image holds values from nan"),
        ({"image": np.full((4, 4), 255.0)}, "needed floats in"),
        ({"points": np.zeros((3, 2))}, r"points has shape \(3, 2\)"),
        ({"points": np.array([["a", "b", "c"]])}, "points has type"),
        ({"depth_tolerance": -0.1}, "depth_tolerance is -0.1"),
        ({"depth_tolerance": np.nan}, "depth_tolerance is nan"),
    ],
)
def test_what_cannot_be_used_is_named(change: dict[str, Any], said: str) -> None:
    arguments: dict[str, Any] = {
        "points": np.zeros((1, 3)),
        "image": noise(),
        "camera": CAMERA,
        "pose": AT_ORIGIN,
    } | change
    with pytest.raises(ValueError, match=said):
        colorize(**arguments)


def test_no_views_and_wrong_normals_are_named() -> None:
    with pytest.raises(ValueError, match="there are 0 views"):
        blend_colors([], np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"normals have shape \(2, 3\); needed \(1, 3\)"):
        blend_colors([PosedImage(CAMERA, noise(), AT_ORIGIN)], np.zeros((1, 3)), normals=np.zeros((2, 3)))
