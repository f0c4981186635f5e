"""A photo of cards before a wall and its points: edges all over, none of them a region's."""

from __future__ import annotations

from functools import cache

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

CAMERA = rp.PinholeCamera(500.0, 500.0, 319.5, 239.5, width=640, height=480)
WALL = 8.0
SHAPE = np.array(
    [[0.0, 0.0, 0.0], [1.2, 0.0, 0.0], [1.2, 0.5, 0.2], [0.5, 0.5, 0.2], [0.5, 1.2, 0.48], [0.0, 1.2, 0.48]]
)
PLACES = ([-1.6, -0.8, 5.5], [0.6, -0.2, 5.0])
"""A region, and where two of it stand, in the camera's axes."""
POSE = rp.Pose(Rotation.from_rotvec([0.1, -0.2, 0.3]), np.array([0.3, -0.1, 0.2]))


@cache
def cards(seed: int) -> tuple[NDArray[np.uint8], Array]:
    """A photo of cards before a wall, each of a shade of its own, and points of every third pixel, in the world."""
    rays, depth, shade, rng = _drawn(seed)
    return _photo(shade, rng), _points(rays, depth, rng)


@cache
def painted(seed: int) -> tuple[NDArray[np.uint8], Array, Array]:
    """The same photo of cards that are painted on the wall, points of it, and their intensity (n,): half the shade."""
    rays, depth, shade, rng = _drawn(seed)
    photo, points = _photo(shade, rng), _points(rays, np.full_like(depth, WALL), rng)
    return photo, points, 0.5 * shade[::3, ::3].ravel() + rng.uniform(0.0, 1.0, len(points))


def _drawn(seed: int) -> tuple[Array, Array, Array, np.random.Generator]:
    """Rays (h, w, 3) of pixels, their depths and shades (h, w), and the numbers drawn on."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    rays = np.stack([(x - 319.5) / 500.0, (y - 239.5) / 500.0, np.ones_like(x)], axis=-1)
    depth, shade = np.full(x.shape, WALL), np.full(x.shape, 120.0)
    for _ in range(14):
        center, half, near = rng.uniform([-0.6, -0.45], [0.6, 0.45]), rng.uniform(0.04, 0.12, 2), rng.uniform(2.0, 5.0)
        card = (np.abs(rays[..., :2] - center) < half).all(axis=-1) & (near < depth)
        depth[card], shade[card] = near, rng.uniform(0.0, 255.0)
    return rays, depth, shade, rng


def _photo(shade: Array, rng: np.random.Generator) -> NDArray[np.uint8]:
    return np.clip(shade + rng.normal(0.0, 2.0, shade.shape), 0.0, 255.0).astype(np.uint8)


def _points(rays: Array, depth: Array, rng: np.random.Generator) -> Array:
    """Points of every third pixel, in the world."""
    # Range noise and uneven rays, as a scan has: neighbors that are equally far would be chosen by rounding.
    uneven = rays + rng.normal(0.0, 2e-4, rays.shape)
    return POSE.inverse().transform((uneven * depth[..., None])[::3, ::3].reshape(-1, 3))


def turned(degrees: float, axis: tuple[float, float, float] = (0.0, 1.0, 0.0)) -> rp.Pose:
    """The pose, the camera turned about one of its axes in its place."""
    turn = Rotation.from_rotvec(np.radians(degrees) * np.asarray(axis))
    return rp.Pose(turn * POSE.rotation, turn.as_matrix() @ POSE.translation)
