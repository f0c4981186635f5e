"""The pictures that the picking page shows, and the points that clicks in them find."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from regionpose.app.range_view import BLOCK, RangeView, depth_and_intensity
from regionpose.app.solid_view import MOST_SHOWN, RayIndex, point_buffer, sample_indices
from regionpose.io.clouds import Cloud
from regionpose.segment.cloud import nearest_to_ray

ORIGIN = np.zeros(3)


def scanned_wall(distance: float = 5.0, lines: int = 24) -> Cloud:
    """A wall across x, as a scanner at zero with so many lines sees it: half a degree along them, two across."""
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-40, 40, 0.5)), np.radians(np.linspace(-24, 24, lines)))
    y, z = distance * np.tan(azimuth), distance * np.tan(elevation) / np.cos(azimuth)
    return Cloud(np.stack([np.full_like(y, distance), y, z], axis=-1).reshape(-1, 3))


def test_each_point_is_found_at_the_pixel_that_shows_it() -> None:
    cloud = scanned_wall()
    view = RangeView.of(cloud, ORIGIN)
    pixels = view.pixels(cloud.points)
    for index in range(0, len(cloud), 97):
        found = view.point_at(*pixels[index])
        assert found is not None
        assert np.linalg.norm(cloud.points[found] - cloud.points[index]) < 0.15


def test_left_in_the_picture_is_left_of_the_scanner_and_up_is_up() -> None:
    view = RangeView.of(scanned_wall(), ORIGIN)
    ahead, left, above = view.pixels(np.array([[5.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 1.0]]))
    assert left[0] < ahead[0]
    assert above[1] < ahead[1]
    assert left[1] == pytest.approx(ahead[1])


def test_gaps_between_scan_lines_are_filled_and_the_sky_is_not() -> None:
    view = RangeView.of(scanned_wall(), ORIGIN)
    rows, columns = view.indices.shape
    inner = view.indices[rows // 4 : -rows // 4, columns // 4 : -columns // 4]
    assert (inner >= 0).all()
    beside = Cloud(np.concatenate([scanned_wall().points, [[-5.0, 0.1, 0.0], [-5.0, 0.0, 0.1]]]))
    assert (RangeView.of(beside, ORIGIN).indices < 0).mean() > 0.3


def test_the_nearer_of_two_points_in_a_direction_is_shown() -> None:
    wall, board = scanned_wall(), scanned_wall(3.0).points
    nearer = board[(np.abs(board[:, 1]) < 0.5) & (np.abs(board[:, 2]) < 0.5)]
    cloud = Cloud(np.concatenate([wall.points, nearer]))
    view = RangeView.of(cloud, ORIGIN)
    found = view.point_at(*view.pixels(np.array([[3.0, 0.0, 0.0]]))[0])
    assert found is not None
    assert found >= len(wall)


@pytest.mark.slow
def test_each_pixel_shows_the_nearest_of_the_points_in_it() -> None:
    # More points than are worked on at a time, many of them in each direction.
    random = np.random.default_rng(5)
    directions = random.normal(0.0, 1.0, (BLOCK + 200_000, 3))
    cloud = Cloud(directions * random.uniform(2.0, 9.0, len(directions))[:, None])
    view = RangeView.of(cloud, ORIGIN)
    pixels = view.pixels(cloud.points)
    columns, rows = np.round(pixels).astype(np.int64).T
    # Nearer to a pixel's border than angles are held, a point may be counted to the next one.
    within = (np.abs(pixels - np.round(pixels)) < 0.49).all(axis=1)
    within &= (rows >= 0) & (rows < view.size[1]) & (columns >= 0) & (columns < view.size[0])
    ranges = np.linalg.norm(cloud.points, axis=1)
    shown = view.indices[rows[within], columns[within]]
    assert (shown >= 0).all()
    assert (ranges[shown] <= ranges[within] * (1.0 + 1e-6)).all()


def test_a_cloud_in_a_cameras_frame_is_shown_upright() -> None:
    wall = scanned_wall().points
    camera = np.stack([-wall[:, 1], -wall[:, 2], wall[:, 0]], axis=1)
    view = RangeView.of(Cloud(camera), ORIGIN)
    right, below = view.pixels(np.array([[1.0, 0.0, 5.0], [0.0, 1.0, 5.0]])) - view.pixels(np.array([[0.0, 0.0, 5.0]]))
    assert right[0] > 0.0
    assert below[1] > 0.0


def test_an_empty_direction_shows_no_point() -> None:
    assert RangeView.of(scanned_wall(), ORIGIN).point_at(-50.0, -50.0) is None


def test_the_picture_has_the_cloud_s_colors_where_it_is_flat() -> None:
    cloud = scanned_wall()
    view = RangeView.of(cloud, ORIGIN)
    colors = np.full((len(cloud), 3), 200, dtype=np.uint8)
    picture = view.picture(cloud.points, colors, view.indices.astype(np.int32))
    assert picture.shape == (*view.indices.shape, 3)
    rows, columns = view.indices.shape
    assert np.median(picture[rows // 4 : -rows // 4, columns // 4 : -columns // 4]) > 120
    assert depth_and_intensity(cloud, ORIGIN).shape == (len(cloud), 3)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(10, 4000))
def test_a_ray_meets_the_same_point_with_and_without_the_index(seed: int, count: int) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-10.0, 10.0, (count, 3)) * random.uniform(0.05, 1.0, 3)
    origin = random.uniform(-15.0, 15.0, 3)
    direction = points[random.integers(count)] - origin + random.normal(0.0, 0.05, 3)
    assert RayIndex.of(points).nearest(origin, direction) == nearest_to_ray(points, origin, direction)


def test_a_ray_away_from_the_cloud_is_an_error() -> None:
    with pytest.raises(ValueError, match="ahead of the ray"):
        RayIndex.of(scanned_wall().points).nearest(np.zeros(3), np.array([-1.0, 0.0, 0.0]))


def test_a_sample_has_as_many_points_as_a_browser_turns() -> None:
    assert len(sample_indices(100)) == 100
    many = sample_indices(3 * MOST_SHOWN)
    assert len(many) == MOST_SHOWN
    assert (np.diff(many) > 0).all()


def test_the_buffer_holds_the_points_about_their_middle() -> None:
    points = np.array([[1000.0, 2.0, 3.0], [1001.0, 2.0, 3.5]])
    read = np.frombuffer(point_buffer(points, points[0]), dtype="<f4").reshape(-1, 3)
    np.testing.assert_array_equal(read, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5]])
