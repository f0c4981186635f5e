"""What is exported: a pose with the names of its frames, the camera and its photo."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial.transform import Rotation

from regionpose.cameras import (
    Camera,
    EquirectangularCamera,
    FisheyeCamera,
    FovCamera,
    OcamCamera,
    PinholeCamera,
    UnifiedCamera,
)
from regionpose.geometry.pose import Pose
from regionpose.validation.arrays import Array

BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of ROS (REP 103): body x forward, y left, z up; optical x right, y down, z forward."""

MODEL_NAMES: dict[type[Camera], str] = {
    PinholeCamera: "pinhole",
    FisheyeCamera: "fisheye",
    UnifiedCamera: "unified",
    FovCamera: "fov",
    OcamCamera: "ocam",
    EquirectangularCamera: "equirectangular",
}


@dataclass(frozen=True, eq=False)
class ExportedView:
    """A pose `camera_from_world` (meters), the camera and the photo's name where they are known, and frames' names.

    `camera_frame` is the optical one, x right, y down, z forward, unless `body`: then it is ROS' x forward, y left, z
    up.
    """

    pose: Pose
    camera: Camera | None = None
    image: str | None = None
    world_frame: str = "lidar"
    camera_frame: str = "camera"
    body: bool = False

    @property
    def world_from_frame(self) -> tuple[Rotation, Array]:
        """Rotation and translation (3,) that take the camera frame's points to the world: its place there."""
        inverse = self.pose.inverse()
        turn = Rotation.from_matrix(BODY_FROM_OPTICAL.T if self.body else np.eye(3))
        return inverse.rotation * turn, inverse.translation

    def required_camera(self, tool: str) -> Camera:
        """The camera with its size; ValueError where it isn't known."""
        if self.camera is None:
            raise ValueError(f"{tool} wants the camera, too: found none; needed --camera")
        if self.camera.width is None or self.camera.height is None:
            raise ValueError(f"{tool} wants the image's size: found a camera without it; needed width and height")
        return self.camera

    def required_image(self, tool: str) -> str:
        """The photo's name; ValueError where it isn't known."""
        if self.image is None:
            raise ValueError(f"{tool} wants the photo's name, too: found none; needed --image")
        return self.image


def camera_values(camera: Camera) -> dict[str, object]:
    """A camera as scene files write it out."""
    values: dict[str, object] = {"model": MODEL_NAMES[type(camera)]}
    for field in fields(camera):  # type: ignore[arg-type]
        value = getattr(camera, field.name)
        if field.init and value is not None:
            values[field.name] = np.asarray(value).tolist()
    return values


def camera_of_values(values: dict[str, object]) -> Camera:
    """The camera that `camera_values` wrote; ValueError for something else."""
    kinds = {name: kind for kind, name in MODEL_NAMES.items()}
    given = {key: _tupled(value) for key, value in values.items() if key != "model"}
    try:
        return kinds[str(values.get("model"))](**given)
    except (KeyError, TypeError) as error:
        raise ValueError("found no camera of a known model; needed one as scene files write it") from error


def _tupled(value: object) -> object:
    return tuple(_tupled(item) for item in value) if isinstance(value, list) else value
