"""Planar patches of clouds: dense, on the rings of an HDL-64 and on the far rings of a VLP-16."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.regions.outline import outline_of_points
from regionpose.segment.cloud import grow_plane, nearest_to_ray
from regionpose.segment.planes import MOST_THINNED, SEARCHED, find_planes
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.lidar import SpinningLidar, lidar_points

Array = NDArray[np.float64]

LIDARS = {
    "HDL-64": SpinningLidar(64, -13.4, 13.4, 0.17, 0.02),
    "VLP-16": SpinningLidar(16, -15.0, 15.0, 0.2, 0.01),
}


def rectangle(width: float, height: float, turn: Rotation, center: tuple[float, float, float]) -> list[Array]:
    corners = 0.5 * np.array(
        [[-width, -height, 0.0], [width, -height, 0.0], [width, height, 0.0], [-width, height, 0.0]]
    )
    return [turn.apply(corners) + center]


def labeled(parts: list[Array]) -> tuple[Array, NDArray[np.intp]]:
    """The parts joined, and which part each point is of."""
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def yard(lidar: SpinningLidar) -> tuple[Array, NDArray[np.intp]]:
    """A slanted board (0) 3 m before a wall (1) that is 6 m away, with a side wall (2) that meets it."""
    generator = np.random.default_rng(5)
    turned = Rotation.from_euler("xyz", [15.0, 20.0, 30.0], degrees=True)
    surfaces = [
        rectangle(1.2, 0.8, turned, (0.1, 0.2, 3.0)),
        rectangle(6.0, 3.0, Rotation.identity(), (0.0, 0.2, 6.0)),
        rectangle(4.0, 3.0, Rotation.from_euler("y", 90.0, degrees=True), (3.0, 0.2, 4.0)),
    ]
    return labeled([lidar_points(rings, np.zeros(3), generator, lidar) for rings in surfaces])


def room(count: int) -> tuple[Array, NDArray[np.intp]]:
    """A room of 10 m x 8 m x 3 m of `count` points with 3 mm noise: its walls 0 to 3, floor 4 and ceiling 5."""
    generator = np.random.default_rng(0)
    size = np.array([10.0, 8.0, 3.0])
    parts = []
    for axis in range(3):
        for side in (0.0, 1.0):
            share = np.prod(np.delete(size, axis)) / (2.0 * (24.0 + 30.0 + 80.0))
            part = generator.uniform(0.0, 1.0, (int(count * share), 3)) * size
            part[:, axis] = side * size[axis] + generator.normal(0.0, 0.003, len(part))
            parts.append(part)
    return labeled(parts)


def recall_and_precision(found: NDArray[np.intp], truth: NDArray[np.bool_]) -> tuple[float, float]:
    return float(truth[found].sum() / truth.sum()), float(truth[found].mean())


@pytest.mark.parametrize("lidar", LIDARS)
def test_board_before_a_wall_grows_from_any_of_its_points(lidar: str) -> None:
    points, labels = yard(LIDARS[lidar])
    board = np.flatnonzero(labels == 0)
    for seed in board[:: len(board) // 6]:
        recall, precision = recall_and_precision(grow_plane(points, int(seed)), labels == 0)
        assert recall > 0.95
        assert precision > 0.98


@pytest.mark.parametrize("lidar", LIDARS)
def test_wall_ends_at_the_corner(lidar: str) -> None:
    points, labels = yard(LIDARS[lidar])
    recall, precision = recall_and_precision(grow_plane(points, (-2.0, 0.2, 6.0)), labels == 1)
    assert recall > 0.9
    assert precision > 0.97


@pytest.mark.parametrize("lidar", LIDARS)
def test_grown_board_gives_its_outline(lidar: str) -> None:
    points, labels = yard(LIDARS[lidar])
    found = grow_plane(points, points[labels == 0].mean(axis=0))
    outline = outline_of_points(points[found])
    ring = outline.rings[0]
    area = 0.5 * float(ring[:, 0] @ np.roll(ring[:, 1], -1) - ring[:, 1] @ np.roll(ring[:, 0], -1))
    assert area == pytest.approx(0.96, rel=0.06)


@pytest.mark.parametrize("count", [4, 16, 64])
@pytest.mark.parametrize("seed", [(5.0, 0.1, 0.05), (5.0, 0.4, 0.4), (6.5, 1.5, 0.5)])
def test_scans_over_one_another_grow_whole_faces(count: int, seed: tuple[float, float, float]) -> None:
    """The same beams again and again with 1 cm noise: points nearer to each other than the noise."""
    generator = np.random.default_rng(1)
    azimuth, elevation = np.meshgrid(np.radians(np.arange(-20.0, 20.0, 0.3)), np.radians(np.linspace(-13.0, 13.0, 48)))
    beams = np.stack([np.ones(azimuth.size), np.tan(azimuth).ravel(), np.tan(elevation).ravel()], axis=1)
    on_board = (np.abs(5.0 * beams[:, 1:]) < 0.5).all(axis=1)
    ranges = np.tile(np.where(on_board, 5.0, 6.5), count) + generator.normal(0.0, 0.01, count * len(beams))
    points, board = np.tile(beams, (count, 1)) * ranges[:, None], np.tile(on_board, count)
    recall, precision = recall_and_precision(grow_plane(points, seed), board if seed[0] == 5.0 else ~board)
    assert recall > 0.98
    assert precision > 0.99


def test_small_faces_among_much_else_are_all_found() -> None:
    """Twelve faces of 80 points among 40 000 of clutter: one in 500 is a point of any of them."""
    generator = np.random.default_rng(3)
    clutter = generator.uniform(-20.0, 20.0, (40_000, 3))
    boards = []
    for k in range(12):
        board = generator.uniform(-0.5, 0.5, (80, 3))
        board[:, 2] = generator.normal(0.0, 0.003, 80)
        boards.append(board + np.array([3.0 * k - 18.0, 30.0, 0.0]))
    points, labels = labeled([*boards, clutter])
    found = find_planes(points)
    whole = [max(recall_and_precision(plane, labels == k)[0] for plane in found) for k in range(12)]
    assert min(whole) > 0.9


def test_all_planes_of_a_room_are_found_once() -> None:
    points, labels = room(60_000)
    found = find_planes(points, min_points=1000)
    assert len(found) == 6
    assert sorted(int(np.bincount(labels[plane]).argmax()) for plane in found) == list(range(6))
    for plane in found:
        recall, precision = recall_and_precision(plane, labels == np.bincount(labels[plane]).argmax())
        assert recall > 0.97
        assert precision > 0.97
    together = np.concatenate(found)
    assert len(np.unique(together)) == len(together)
    assert [len(plane) for plane in found] == sorted(map(len, found), reverse=True)


def test_thinned_cloud_gives_full_planes() -> None:
    points, labels = room(400_000)
    found = find_planes(points, min_points=100)
    assert len(found) == 6
    assert sum(map(len, found)) > 0.98 * len(points)
    for plane in found:
        assert recall_and_precision(plane, labels == np.bincount(labels[plane]).argmax())[1] > 0.97


@pytest.mark.parametrize("lidar", LIDARS)
def test_planes_of_a_scan_are_found_without_seeds(lidar: str) -> None:
    points, labels = yard(LIDARS[lidar])
    found = find_planes(points)
    for label in range(3):
        best = found[int(np.argmax([(labels[plane] == label).sum() for plane in found]))]
        recall, precision = recall_and_precision(best, labels == label)
        assert recall > 0.85
        assert precision > 0.95


def test_hedge_and_scattered_points_are_no_planes() -> None:
    # Beside a wall with 5 mm noise: a hedge 4 m x 1.5 m whose leaves lie within 20 cm, and a crown of 2 m.
    generator = np.random.default_rng(2)
    wall = generator.uniform(0.0, 1.0, (20_000, 3)) * [6.0, 0.0, 3.0] + [0.0, 8.0, 0.0]
    wall[:, 1] += generator.normal(0.0, 0.005, len(wall))
    hedge = generator.uniform(0.0, 1.0, (10_000, 3)) * [4.0, 0.2, 1.5] + [8.0, 3.0, 0.0]
    crown = generator.uniform(0.0, 2.0, (10_000, 3)) + np.array([2.0, 1.0, 2.0])
    points, labels = labeled([wall, hedge, crown])
    found = find_planes(points)
    assert len(found) == 1
    assert recall_and_precision(found[0], labels == 0) == pytest.approx((1.0, 1.0), abs=0.02)


def test_same_cloud_gives_the_same_planes() -> None:
    points, _ = yard(LIDARS["HDL-64"])
    first, second = find_planes(points), find_planes(points)
    assert len(first) == len(second)
    assert all(np.array_equal(one, other) for one, other in zip(first, second, strict=True))


def test_a_wall_of_millions_of_points_is_found_whole() -> None:
    points, labels = room(2_000_000)
    recall, precision = recall_and_precision(grow_plane(points, (0.0, 4.0, 1.5)), labels == 0)
    assert recall > 0.98
    assert precision > 0.98


def test_progress_rises_to_one() -> None:
    points, _ = room(20_000)
    shares: list[float] = []
    grow_plane(points, (0.0, 4.0, 1.5), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    shares.clear()
    find_planes(points, progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_progress_of_a_thinned_cloud_rises_to_one_once_its_planes_are_filled() -> None:
    points, _ = room(MOST_THINNED + 50_000)
    shares: list[float] = []
    found = find_planes(points, progress=shares.append)
    assert shares == sorted(shares) and shares.count(1.0) == 1
    assert len({share for share in shares if share > SEARCHED}) == len(found)


def test_patch_is_the_same_after_a_rigid_motion() -> None:
    points, labels = yard(LIDARS["VLP-16"])
    turn, shift = Rotation.from_euler("xyz", [50.0, -100.0, 200.0], degrees=True), np.array([30.0, -20.0, 5.0])
    seed = points[labels == 0].mean(axis=0)
    still, moved = grow_plane(points, seed), grow_plane(turn.apply(points) + shift, turn.apply(seed) + shift)
    assert len(np.intersect1d(still, moved)) > 0.97 * len(np.union1d(still, moved))


def test_points_that_are_not_finite_are_passed_over() -> None:
    points, labels = room(20_000)
    points[::7] = np.nan
    found = grow_plane(points, (0.0, 4.0, 1.5))
    assert np.isfinite(points[found]).all()
    assert recall_and_precision(found, (labels == 0) & np.isfinite(points[:, 0]))[0] > 0.97


def test_gap_wider_than_the_radius_parts_two_planes() -> None:
    flat = np.random.default_rng(0).uniform(0.0, 1.0, (8000, 2))
    points = np.column_stack([flat + np.where(flat[:, :1] > 0.5, [0.3, 0.0], 0.0), np.zeros(8000)])
    assert len(grow_plane(points, (0.2, 0.5, 0.0))) == (flat[:, 0] <= 0.5).sum()
    assert len(grow_plane(points, (0.2, 0.5, 0.0), radius_m=0.4)) == 8000


def test_ray_meets_the_surface_in_front() -> None:
    points, labels = yard(LIDARS["HDL-64"])
    target = points[np.flatnonzero(labels == 0)[100]]
    assert labels[nearest_to_ray(points, np.zeros(3), target)] == 0
    assert labels[nearest_to_ray(points, np.zeros(3), [-2.0, 0.2, 6.0])] == 1


@pytest.mark.parametrize(
    ("seed", "options", "message"),
    [
        (20_000_000, {}, "seed is 20000000; needed an index from 0"),
        ([1.0, 2.0], {}, "needed an index or 3 finite"),
        ([0.0, np.nan, 0.0], {}, "needed an index or 3 finite"),
        ([500.0, 0.0, 0.0], {}, "490 m from the nearest point"),
        ([0.0, 0.0, 1e300], {}, r"seed \[0.0, 0.0, 1e\+300\] is so far from all .* points"),
        ([[1.0, 2.0], 3.0], {}, "needed an index or 3 finite"),
        (0, {"distance_m": 0.0}, "distance_m is 0.0"),
        (0, {"distance_m": "far"}, "distance_m is far; needed a positive number"),
        (0, {"angle_deg": None}, "angle_deg is None"),
        (0, {"radius_m": -1.0}, "radius_m is -1.0"),
        (0, {"angle_deg": np.nan}, "angle_deg is nan"),
    ],
)
def test_bad_seed_or_option_is_named(seed: object, options: dict[str, float], message: str) -> None:
    points, _ = room(5000)
    with pytest.raises(ValueError, match=message):
        grow_plane(points, seed, **options)  # type: ignore[arg-type]


def test_bad_cloud_is_named() -> None:
    with pytest.raises(ValueError, match=r"shape \(4, 2\)"):
        grow_plane(np.zeros((4, 2)), 0)
    with pytest.raises(ValueError, match="0 of 5 points are finite"):
        find_planes(np.full((5, 3), np.nan))
    with pytest.raises(ValueError, match="lie on no plane"):
        grow_plane(np.random.default_rng(0).random((500, 3)), (0.5, 0.5, 0.5))
    for least in (2, 50.5, "many"):
        with pytest.raises(ValueError, match=f"min_points is {least}; needed a whole number of 3 or more"):
            find_planes(np.eye(3), min_points=least)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="lies ahead"):
        nearest_to_ray(np.eye(3), np.zeros(3), [-1.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="direction is"):
        nearest_to_ray(np.eye(3), np.zeros(3), [0.0, 0.0, 0.0])


def test_noise_that_grows_away_from_the_seed_does_not_widen_the_patch_step_by_step() -> None:
    # A smooth disc in a field that gets rougher outwards: by less than a third from one neighborhood to the next, but
    # fourfold in all. Points belong to the disc's plane by the disc's noise, 5 mm.
    generator = np.random.default_rng(0)
    flat = generator.uniform(-1.4, 1.4, (4000, 2))
    sigma = 0.005 * np.maximum(np.linalg.norm(flat, axis=1) / 0.3, 1.0) ** 0.9
    cloud = np.column_stack([flat, sigma * generator.standard_normal(4000)])
    members = grow_plane(cloud, [0.0, 0.0, 0.0])
    assert np.abs(cloud[members, 2]).max() < 0.022


def test_points_in_one_place_are_one_and_all_of_them_are_members() -> None:
    rng = np.random.default_rng(3)
    wall = np.column_stack([rng.uniform(0.0, 2.0, (2000, 2)), rng.normal(0.0, 0.003, 2000)])
    twice = np.concatenate([wall, wall[::2], np.tile([[5.0, 5.0, 5.0]], (50_000, 1))])
    (found,) = find_planes(twice)
    assert found.max() < 3000 and len(found) > 2900
    assert (np.isin(np.arange(0, 2000, 2), found) == np.isin(np.arange(2000, 3000), found)).all()
