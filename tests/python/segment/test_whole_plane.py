"""The whole plane around a seed: across windows and shadows, and the same from each of its points."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.segment.cloud import grow_plane
from regionpose.segment.whole_plane import whole_plane

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

WALL, LEFT, RIGHT, FOOT, TOP = 12.0, -6.0, 5.0, -1.7, 2.6
WINDOWS = ((-4.5, -2.6, -0.6, 1.5), (-0.6, 1.6, -1.7, 1.9), (2.4, 4.2, -0.6, 1.5))
"""Left, right, foot and top of two windows and a door, which let the beams through to a room."""

NEAR = 0.95


@cache
def scan(seed: int, turn_deg: float = 0.0, bias_m: float = 0.02) -> tuple[Array, Bools]:
    """A lidar's turn of 32 lines before a house: points (n, 3), and which of them are on its front.

    Before the front stands a post, which parts it from foot to top; its right end meets another wall. Ranges are off by
    1.5 cm, those of each line together by `bias_m`.
    """
    rng = np.random.default_rng(seed)
    elevation, azimuth = np.meshgrid(np.radians(np.linspace(-14.0, 14.0, 32)), np.radians(np.arange(-45.0, 45.0, 0.2)))
    beams = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    beams = beams.reshape(-1, 3)
    lines = np.broadcast_to(np.arange(32), elevation.shape).ravel()
    with np.errstate(divide="ignore", invalid="ignore"):
        front, room, ground = WALL / beams[:, 0], (WALL + 3.0) / beams[:, 0], FOOT / beams[:, 2]
        side = RIGHT / beams[:, 1]
    y, z = front * beams[:, 1], front * beams[:, 2]
    is_hole = np.any([(y > a) & (y < b) & (z > c) & (z < d) for a, b, c, d in WINDOWS], axis=0)
    is_front = (y > LEFT) & (y < RIGHT) & (z < TOP) & ~is_hole
    ranges = np.full(len(beams), np.inf)
    ranges[is_front] = front[is_front]
    ranges[is_hole] = room[is_hole]
    is_side = (side > 0.0) & (side * beams[:, 0] < WALL) & (side * beams[:, 0] > 9.0) & (side * beams[:, 2] < TOP)
    ranges[is_side] = side[is_side]
    post = np.abs(7.0 * beams[:, 1] / beams[:, 0] - 1.15) < 0.12
    ranges[post] = 7.0 / beams[post, 0]
    low = (ground > 0.0) & (ground < ranges)
    ranges[low] = ground[low]
    held = np.isfinite(ranges)
    noise = rng.normal(0.0, 0.015, len(beams)) + rng.normal(0.0, bias_m, 32)[lines]
    points = beams[held] * (ranges + noise)[held, None]
    angle = np.radians(turn_deg)
    rotation = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return points @ rotation.T, (is_front & ~post & ~low)[held]


def shared(one: NDArray[np.intp], other: NDArray[np.intp]) -> float:
    """Intersection over union."""
    return len(np.intersect1d(one, other)) / len(np.union1d(one, other))


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "turn_deg", "bias_m"), [(0, 0.0, 0.02), (1, 37.0, 0.0), (2, -80.0, 0.03)])
def test_any_two_seeds_on_one_wall_give_the_same_points(seed: int, turn_deg: float, bias_m: float) -> None:
    points, is_front = scan(seed, turn_deg, bias_m)
    front = np.flatnonzero(is_front)
    seeds = np.random.default_rng(seed).choice(front, 12, replace=False)
    found = [whole_plane(points, points[index]) for index in seeds]
    assert min(shared(one, other) for one, other in combinations(found, 2)) >= NEAR
    assert min(shared(one, front) for one in found) >= 0.9


def test_a_patch_grown_from_a_seed_is_not_the_same_from_each() -> None:
    """Or the law above would say nothing."""
    points, is_front = scan(0)
    front = np.flatnonzero(is_front)
    seeds = np.random.default_rng(0).choice(front, 12, replace=False)
    grown = [grow_plane(points, points[index]) for index in seeds]
    assert min(shared(one, other) for one, other in combinations(grown, 2)) < NEAR


def test_the_wall_around_the_corner_and_the_ground_are_other_planes() -> None:
    points, is_front = scan(0)
    is_side = (np.abs(points[:, 1] - RIGHT) < 0.1) & (points[:, 0] < WALL - 0.5)
    side = whole_plane(points, points[np.flatnonzero(is_side)[len(np.flatnonzero(is_side)) // 2]])
    front = whole_plane(points, points[np.flatnonzero(is_front)[200]])
    ground = whole_plane(points, np.array([9.0, 0.0, FOOT]))
    assert len(np.intersect1d(side, front)) < 0.02 * len(front)
    assert len(np.intersect1d(ground, front)) < 0.02 * len(front)
    assert is_side[side].mean() > 0.8


def test_the_order_of_the_points_does_not_matter() -> None:
    points, is_front = scan(1)
    seed = points[np.flatnonzero(is_front)[300]]
    order = np.random.default_rng(0).permutation(len(points))
    assert shared(np.sort(order[whole_plane(points[order], seed)]), whole_plane(points, seed)) >= 0.99


def test_a_seed_on_no_plane_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="plane"):
        whole_plane(rng.normal(size=(4000, 3)), np.zeros(3))
