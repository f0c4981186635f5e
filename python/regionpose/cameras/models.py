"""Names of the camera models, as scene files and calibrations write them, and cameras from their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from regionpose.cameras.base import Camera
from regionpose.cameras.equirectangular import EquirectangularCamera
from regionpose.cameras.fisheye import FisheyeCamera
from regionpose.cameras.fov import FovCamera
from regionpose.cameras.ocam import OcamCamera
from regionpose.cameras.pinhole import PinholeCamera
from regionpose.cameras.unified import UnifiedCamera

CameraModel = Literal["pinhole", "fisheye", "unified", "fov", "ocam", "equirectangular"]

CAMERA_CLASSES: dict[CameraModel, type[Camera]] = {
    "pinhole": PinholeCamera,
    "fisheye": FisheyeCamera,
    "unified": UnifiedCamera,
    "fov": FovCamera,
    "ocam": OcamCamera,
    "equirectangular": EquirectangularCamera,
}


def model_name(camera: Camera) -> CameraModel:
    """The name of a camera's model."""
    return next(name for name, kind in CAMERA_CLASSES.items() if isinstance(camera, kind))


def camera_of_model(model: CameraModel, parameters: Mapping[str, object]) -> Camera:
    """The camera of a model with its constructor's parameters, lists taken as tuples; errors as of its class."""
    return CAMERA_CLASSES[model](**{name: _as_tuple(value) for name, value in parameters.items()})


def _as_tuple(value: object) -> object:
    """Lists as tuples, also inside of these."""
    return tuple(_as_tuple(item) for item in value) if isinstance(value, list) else value
