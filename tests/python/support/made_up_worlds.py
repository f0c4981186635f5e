"""Made-up worlds of boxes in a hall, as a camera and a scanner near each other see them."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

CAMERA = rp.PinholeCamera(260.0, 260.0, 239.5, 159.5, width=480, height=320)
HEADING_DEG = 40.0
"""Of the rig's camera, about z from x."""

RINGS, AZIMUTHS = 64, 600
RANGE_NOISE_M = 0.01
HALF_SIZE_M, FLOOR_M, CEILING_M = 14.0, -1.7, 6.0
"""Of the hall, about the scanner."""

BOXES = 40
PANEL_M = np.array([2.3, 2.9, 1.7])
PAINTS = np.random.default_rng(7).uniform(-60.0, 60.0, 97)
"""What panels of the faces, of these sizes, are brighter by."""


class World(NamedTuple):
    """A photo (h, w), points (n, 3) about the scanner and their intensity (n,), and the camera's true pose."""

    photo: NDArray[np.uint8]
    points: Array
    intensity: Array
    pose: rp.Pose

    def frame(self) -> rp.Frame:
        return rp.Frame(image=self.photo, points=self.points, intensity=self.intensity)


def pose_of(heading_deg: float) -> rp.Pose:
    """A camera that looks along a heading, a little down and rolled, beside and below the scanner."""
    heading = np.radians(heading_deg)
    forward = np.array([np.cos(heading), np.sin(heading), 0.0])
    level = np.stack([np.cross(forward, [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], forward])
    rotation = Rotation.from_rotvec(np.radians([-2.0, 0.0, 1.5])) * Rotation.from_matrix(level)
    return rp.Pose(rotation, -rotation.apply([0.3, -0.2, -0.15]))


@cache
def made_world(seed: int, heading_deg: float = HEADING_DEG, scale: float = 1.0) -> World:
    """The world of a seed, about a scanner in the middle of the same hall unless another scale is given; made once in a
    process, its arrays read-only.
    """
    rng = np.random.default_rng(seed)
    lows, highs, shades = _boxes(rng)
    lows, highs = scale * lows, scale * highs
    pose = pose_of(heading_deg)
    elevations = np.radians(np.linspace(-25.0, 13.0, RINGS))[:, None]
    azimuths = np.linspace(-np.pi, np.pi, AZIMUTHS, endpoint=False)
    # Uneven, as a scanner's: of neighbors that are equally far, rounding would choose.
    azimuths = azimuths + rng.normal(0.0, 5e-4, (RINGS, AZIMUTHS))
    up, flat = np.sin(elevations) + 0.0 * azimuths, np.cos(elevations)
    rays = np.stack([flat * np.cos(azimuths), flat * np.sin(azimuths), up], axis=-1).reshape(-1, 3)
    depth, shade = _cast(np.zeros(3), rays, lows, highs, shades)
    points = rays * (depth + rng.normal(0.0, RANGE_NOISE_M, depth.shape))[:, None]
    # Sums with whole numbers are exact.
    points = np.round(points * 2.0**20) / 2.0**20
    x, y = np.meshgrid(np.arange(480.0), np.arange(320.0))
    seen = pose.rotation.inv().apply(CAMERA.bearings(np.column_stack([x.ravel(), y.ravel()])))
    _, brightness = _cast(pose.camera_center, seen, lows, highs, shades)
    levels = np.clip(brightness + rng.normal(0.0, 3.0, brightness.shape), 0.0, 255.0).astype(np.uint8)
    world = World(levels.reshape(320, 480), points, 0.3 * shade + rng.normal(0.0, 1.0, shade.shape), pose)
    for array in (world.photo, world.points, world.intensity):
        array.setflags(write=False)
    return world


def _boxes(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Corners (n, 3) of boxes, the hall itself first, and the shades (n, 3, 2) of their faces."""
    around = 2.0 * np.pi * (np.arange(BOXES) + rng.uniform(0.0, 1.0, BOXES)) / BOXES
    away = rng.uniform(3.0, 9.0, BOXES)
    half = rng.uniform([0.2, 0.2, 0.4], [0.6, 0.6, 2.2], (BOXES, 3))
    high = FLOOR_M + half[:, 2] + rng.choice([0.0, 0.0, 1.5], BOXES)
    middles = np.column_stack([away * np.cos(around), away * np.sin(around), high])
    hall = np.array([HALF_SIZE_M, HALF_SIZE_M, CEILING_M])
    floor = np.array([-HALF_SIZE_M, -HALF_SIZE_M, FLOOR_M])
    shades = rng.uniform(60.0, 195.0, (1 + BOXES, 3, 2))
    return np.vstack([floor, middles - half]), np.vstack([hall, middles + half]), shades


def _cast(start: Array, rays: Array, lows: Array, highs: Array, shades: Array) -> tuple[Array, Array]:
    """Distances (n,) along rays (n, 3), and the shades there."""
    # Column by column: along rows of three it takes several times as long.
    along = np.ascontiguousarray(rays.T)
    inverse = 1.0 / np.where(np.abs(along) < 1e-12, 1e-12, along)
    depth = np.full(len(rays), np.inf)
    shade = np.zeros(len(rays))
    for index, (low, high, faces) in enumerate(zip(lows, highs, shades, strict=True)):
        near, far = (low - start)[:, None] * inverse, (high - start)[:, None] * inverse
        enters, leaves = np.minimum(near, far), np.maximum(near, far)
        first, last = enters.max(axis=0), leaves.min(axis=0)
        # The hall is seen from within.
        found = last if index == 0 else first
        hit = np.flatnonzero((found < depth) & (found > 0.0) & ((index == 0) | (first <= last)))
        axis = leaves[:, hit].argmin(axis=0) if index == 0 else enters[:, hit].argmax(axis=0)
        side = (along[axis, hit] > 0.0).astype(int)
        places = start + rays[hit] * found[hit, None]
        panels = np.floor((places - low) / PANEL_M + 0.37).astype(int) @ [13, 29, 7] + 5 * index
        depth[hit] = found[hit]
        shade[hit] = faces[axis, side] + PAINTS[panels % len(PAINTS)]
    return depth, shade
