"""Frames of a rig, whose pose is `RIG`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import SyntheticScene, fisheye_scene, perspective_scene

RIG = rp.Pose(Rotation.from_rotvec([0.4, -0.2, 0.1]), np.array([0.1, -0.2, 0.05]))
"""The rig's camera_from_world: any rotation and decimeters."""


def frame_of(
    scene: SyntheticScene, disturb: Callable[[NDArray[np.bool_]], NDArray[np.bool_]] = lambda mask: mask
) -> rp.Frame:
    """The scene as a frame of the rig: its world moved to where the rig's camera sees it as the scene's does."""
    own = rp.Pose.from_parts(scene.rotation, scene.translation)
    worlds = [[RIG.inverse().transform(own.transform(ring)) for ring in rings] for rings in scene.regions]
    return rp.Frame(
        [rp.ImageRegion.from_mask(disturb(mask)) for mask in scene.masks()],
        [rp.WorldRegion.from_polygon(rings) for rings in worlds],
    )


@cache
def perspective_frame(seed: int) -> tuple[rp.PinholeCamera, rp.Frame]:
    """A frame of one region."""
    scene = perspective_scene(seed, 1, study="rig")
    assert isinstance(scene.camera, rp.PinholeCamera)
    return scene.camera, frame_of(scene)


@cache
def fisheye_frame(seed: int) -> tuple[rp.FisheyeCamera, rp.Frame]:
    """A frame of two regions."""
    scene = fisheye_scene(seed, 2, study="rig")
    assert isinstance(scene.camera, rp.FisheyeCamera)
    return scene.camera, frame_of(scene)


def perspective_frames(first: int, count: int) -> tuple[rp.PinholeCamera, list[rp.Frame]]:
    """Frames of one region each."""
    return perspective_frame(first)[0], [perspective_frame(seed)[1] for seed in range(first, first + count)]


def fisheye_frames(first: int, count: int) -> tuple[rp.FisheyeCamera, list[rp.Frame]]:
    """Frames of two regions each."""
    return fisheye_frame(first)[0], [fisheye_frame(seed)[1] for seed in range(first, first + count)]


def sides(frames: Sequence[rp.Frame]) -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """All regions, frame after frame."""
    images = [region for frame in frames for region in frame.image_regions]
    return images, [region for frame in frames for region in frame.world_regions]


def world_of(ring: NDArray[np.float64]) -> rp.WorldRegion:
    """The region inside one ring."""
    return rp.WorldRegion.from_polygon([ring])
