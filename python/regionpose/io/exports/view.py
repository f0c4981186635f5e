"""What is exported: a pose with the names of its frames, the camera and its photo."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import cast

import numpy as np
from scipy.spatial.transform import Rotation

from regionpose.cameras import Camera
from regionpose.cameras.models import CameraModel, camera_of_model, model_name
from regionpose.geometry.pose import Pose
from regionpose.validation.arrays import Array

BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of ROS (REP 103): body x forward, y left, z up; optical x right, y down, z forward."""


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

    def __post_init__(self) -> None:
        """Check the names of the frames."""
        checked_frame("world_frame", self.world_frame)
        checked_frame("camera_frame", self.camera_frame)

    @property
    def world_from_frame(self) -> tuple[Rotation, Array]:
        """Rotation and translation (3,) that take the camera frame's points to the world: its place there."""
        inverse = self.pose.inverse()
        turn = Rotation.from_matrix(BODY_FROM_OPTICAL.T if self.body else np.eye(3))
        return inverse.rotation * turn, inverse.translation

    def required_camera(self, tool: str) -> Camera:
        """The camera with its size; ValueError where it isn't given."""
        if self.camera is None:
            raise ValueError(f"{tool}: found no camera; needed one")
        if self.camera.width is None or self.camera.height is None:
            raise ValueError(f"{tool}: found a camera without its image's size; needed width and height")
        return self.camera

    def required_image(self, tool: str) -> str:
        """The photo's name; ValueError where it isn't given."""
        if self.image is None:
            raise ValueError(f"{tool}: found no name of the photo; needed image")
        return self.image


def camera_values(camera: Camera) -> dict[str, object]:
    """A camera as scene files write it out."""
    values: dict[str, object] = {"model": model_name(camera)}
    for field in fields(camera):  # type: ignore[arg-type]
        value = getattr(camera, field.name)
        if field.init and value is not None:
            values[field.name] = np.asarray(value).tolist()
    return values


def checked_frame(item: str, name: str) -> str:
    """A frame's name, which stands in commands and in XML; ValueError, naming the item, for one with other signs."""
    if not name or not all(letter.isalnum() or letter in "_/-." for letter in name):
        raise ValueError(f"{item}: found {name!r}; needed letters, digits, _, /, - and . alone")
    return name


def camera_of_values(values: dict[str, object]) -> Camera:
    """The camera that `camera_values` wrote; ValueError for something else."""
    parameters = dict(values)
    try:
        return camera_of_model(cast("CameraModel", parameters.pop("model")), parameters)
    except (KeyError, TypeError) as error:
        raise ValueError("found no camera of a supported model; needed one as scene files write it") from error
