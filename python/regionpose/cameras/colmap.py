"""COLMAP's camera models, which PoseLib and pycolmap share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import SupportsFloat

from regionpose.cameras.base import Camera, finite_numbers
from regionpose.cameras.fisheye import FisheyeCamera
from regionpose.cameras.pinhole import PinholeCamera
from regionpose.validation.arguments import checked_arguments

CORNER_TO_CENTER = 0.5
"""Pixels: COLMAP, nerfstudio and MeshLab count from the corner of the first pixel, OpenCV from its center."""

COLMAP_MODELS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}
"""Parameters of each model in COLMAP's order."""


def camera_from_colmap(
    model: str, width: int | None, height: int | None, params: Sequence[SupportsFloat]
) -> PinholeCamera | FisheyeCamera:
    """The camera of a COLMAP model, as pycolmap, PoseLib and cameras.txt have it.

    Parameters
    ----------
    model : str
        COLMAP's name, such as "OPENCV" or "OPENCV_FISHEYE".
    width, height : int or None
        Of the image, pixels.
    params : sequence of float
        In COLMAP's order; its center counts from the first pixel's corner, and is moved by half a pixel.

    Raises
    ------
    ValueError
        For an unknown model, another count of parameters, or numbers that make no camera.

    Examples
    --------
    >>> import regionpose as rp
    >>> camera = rp.cameras.camera_from_colmap("SIMPLE_RADIAL", 640, 480, [500.0, 320.0, 240.0, -0.1])
    >>> camera.cx, camera.distortion
    (319.5, (-0.1, 0.0, 0.0, 0.0))
    >>> rp.cameras.camera_to_colmap(camera)
    ('OPENCV', 640, 480, [500.0, 500.0, 320.0, 240.0, -0.1, 0.0, 0.0, 0.0])

    """
    if model not in COLMAP_MODELS:
        raise ValueError(f"model: found {model!r}; needed one of {', '.join(COLMAP_MODELS)}")
    names, numbers = COLMAP_MODELS[model].split(), finite_numbers("params", params)
    if len(numbers) != len(names):
        raise ValueError(f"params: found {len(numbers)} numbers; needed {len(names)} for {model} ({' '.join(names)})")
    parameters = dict(zip(names, numbers, strict=True))
    fx, fy = parameters.get("fx", parameters.get("f", 0.0)), parameters.get("fy", parameters.get("f", 0.0))
    center = parameters["cx"] - CORNER_TO_CENTER, parameters["cy"] - CORNER_TO_CENTER
    if model.endswith("FISHEYE"):
        coefficients = tuple(parameters.get(key, 0.0) for key in ("k1", "k2", "k3", "k4"))
        return FisheyeCamera(fx, fy, *center, distortion=coefficients, width=width, height=height)
    return PinholeCamera(fx, fy, *center, distortion=_distortion(parameters), width=width, height=height)


@checked_arguments
def camera_to_colmap(camera: Camera) -> tuple[str, int | None, int | None, list[float]]:
    """Model, width, height and parameters of a camera, as `camera_from_colmap` takes them.

    Parameters
    ----------
    camera : PinholeCamera or FisheyeCamera
        The others have no model in COLMAP.

    Raises
    ------
    ValueError
        For another camera.

    """
    if not isinstance(camera, PinholeCamera | FisheyeCamera):
        raise ValueError(f"COLMAP: found a {type(camera).__name__}; needed a pinhole or a fisheye camera")
    lens = [camera.fx, camera.fy, camera.cx + CORNER_TO_CENTER, camera.cy + CORNER_TO_CENTER]
    size = camera.width, camera.height
    if isinstance(camera, FisheyeCamera):
        return "OPENCV_FISHEYE", *size, [*lens, *camera.distortion]
    *first, k3, k4, k5, k6 = (*camera.distortion, *(0.0,) * (8 - len(camera.distortion)))
    if any((k3, k4, k5, k6)):
        return "FULL_OPENCV", *size, [*lens, *first, k3, k4, k5, k6]
    return ("OPENCV", *size, [*lens, *first]) if any(first) else ("PINHOLE", *size, lens)


def _distortion(values: dict[str, float]) -> tuple[float, ...]:
    """As many of OpenCV's coefficients as the model has."""
    count = 8 if "k6" in values else 4 if "k1" in values else 0
    return tuple(values.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")[:count])
