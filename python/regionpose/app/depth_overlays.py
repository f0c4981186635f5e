"""The cloud over the photo by its distance from the camera, at a pose and at the next likeliest one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionpose.app.outcome import Outcome
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud
from regionpose.scene.sensors import Picture
from regionpose.solve.status import PoseStatus
from regionpose.viz.overlays import overlay_depth

Bytes = NDArray[np.uint8]

AT_POSE, AT_RUNNER_UP = "depth.jpg", "runner_up.jpg"
"""Names of the pictures."""


def overlay_poses(outcome: Outcome) -> dict[str, Pose]:
    """The poses `camera_from_world` at which the cloud is drawn, by the pictures' names: that of the outcome and,
    unless it is trusted, the next likeliest one.
    """
    if outcome.run is None:
        return {}
    estimate = outcome.run.estimate
    poses = {AT_POSE: estimate.pose}
    if estimate.status != PoseStatus.TRUSTED and estimate.diagnostics.alternatives:
        poses[AT_RUNNER_UP] = estimate.diagnostics.alternatives[0].pose
    return poses


def depth_overlay(image: Picture, camera: Camera, cloud: Cloud, pose: Pose) -> Bytes:
    """The photo (h, w, 3) in gray with a cloud's points in the colors of their distances, at a pose in the world."""
    drawn = overlay_depth(camera, image, cloud.local_points, pose.rebase(cloud.origin))
    # Without the strip beside it, which has the scale: pixels stay where they are.
    return np.ascontiguousarray(drawn[:, : image.shape[1]])
