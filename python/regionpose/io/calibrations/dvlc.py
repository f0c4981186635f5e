"""calib.json of direct_visual_lidar_calibration: the camera beside its pose."""

from __future__ import annotations

from functools import partial

from regionpose.cameras import Camera, EquirectangularCamera, FisheyeCamera, FovCamera, PinholeCamera, UnifiedCamera
from regionpose.io.calibrations.yaml_items import YamlMapping

MODELS = ("plumb_bob", "fisheye", "equidistant", "omnidir", "equirectangular", "atan")


def describes(document: YamlMapping) -> bool:
    """Whether the item `camera` holds a model with intrinsics, and no distortion model as Kalibr's."""
    camera = document.get("camera")
    if camera is None or not camera.is_mapping:
        return False
    parameters = camera.mapping()
    return "camera_model" in parameters and "intrinsics" in parameters and "distortion_model" not in parameters


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the file, called `camera`; a photo's size is not in it but for a panorama's."""
    return document.source.camera({"camera": partial(_camera, document.need("camera").mapping())}, name)


def _camera(parameters: YamlMapping) -> Camera:
    model, intrinsics = parameters.need("camera_model"), parameters.need("intrinsics")
    if model.text() == "equirectangular":
        width, height = intrinsics.counted(2)
        if not (width.is_integer() and height.is_integer()):
            raise intrinsics.error(f"{width} by {height}", "whole numbers of pixels")
        return EquirectangularCamera(width=int(width), height=int(height))
    if model.text() not in MODELS:
        raise model.error(repr(model.text()), f"one of {', '.join(MODELS)}")
    fx, fy, cx, cy, *xi = intrinsics.counted(5 if model.text() == "omnidir" else 4)
    coefficients = parameters.need("distortion_coeffs")
    if model.text() == "atan":
        (omega,) = coefficients.counted(1)
        return FovCamera(fx, fy, cx, cy, omega=omega) if omega else PinholeCamera(fx, fy, cx, cy)
    if model.text() == "omnidir":
        return UnifiedCamera(fx, fy, cx, cy, xi=xi[0], distortion=tuple(coefficients.counted(0, 4)))
    if model.text() == "plumb_bob":
        return PinholeCamera(fx, fy, cx, cy, distortion=tuple(coefficients.counted(0, 4, 5)))
    return FisheyeCamera(fx, fy, cx, cy, distortion=tuple(coefficients.counted(4)))
