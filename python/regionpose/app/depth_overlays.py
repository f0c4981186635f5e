"""The cloud over the photo by its distance from the camera, at a pose and at the next likeliest one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionpose.app.outcome import Outcome
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud
from regionpose.scene.sensors import Picture
from regionpose.scene.verdict import TRUSTED
from regionpose.viz.overlays import overlay_depth

Bytes = NDArray[np.uint8]

AT_POSE, AT_RUNNER_UP = "depth.jpg", "runner_up.jpg"
"""Names of the pictures."""


def overlay_poses(outcome: Outcome) -> dict[str, Pose]:
    """The poses `camera_from_world` at which the cloud is drawn, by the pictures' names: that of the outcome and,
    unless it is trusted, the next likeliest one.
    """
    if outcome.run is None or outcome.verdict is None:
        return {}
    estimate = outcome.run.estimate
    poses = {AT_POSE: estimate.pose}
    if outcome.verdict.level != TRUSTED and estimate.alternatives:
        poses[AT_RUNNER_UP] = estimate.alternatives[0].pose
    return poses


def depth_overlay(image: Picture, camera: Camera, cloud: Cloud, pose: Pose) -> Bytes:
    """The photo (h, w, 3) in gray with a cloud's points in the colors of their distances, at a pose in the world."""
    drawn = overlay_depth(image, camera, pose.rebase(cloud.origin), cloud.local_points)
    # Without the strip beside it, which has the scale: pixels stay where they are.
    return np.ascontiguousarray(drawn[:, : image.shape[1]])
