"""Calibrations that OpenCV's FileStorage writes as YAML."""

from __future__ import annotations

from functools import partial

import numpy as np

from regionpose.calibration.yaml_items import YamlItem, YamlMapping
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera

MATRIX_KEYS = {
    "camera_matrix": ("distortion_coefficients", "dist_coeffs"),
    "Camera_Matrix": ("Distortion_Coefficients",),
    "cameraMatrix": ("distCoeffs",),
    "K": ("D",),
    "M1": ("D1",),
    "M2": ("D2",),
    "K1": ("D1",),
    "K2": ("D2",),
}
"""Names under which OpenCV's samples write the matrix, with those of its distortion."""

WIDTH_KEYS = ("image_width", "image_Width", "width")
HEIGHT_KEYS = ("image_height", "image_Height", "height")
FISHEYE_KEYS = ("fisheye_model", "useFisheye")


def describes(document: YamlMapping) -> bool:
    """Whether there is a camera matrix under one of OpenCV's names."""
    return document.get(*MATRIX_KEYS) is not None


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera whose matrix is called `name`."""
    builders = {key: partial(_camera, document, key) for key in MATRIX_KEYS if key in document}
    return document.source.camera(builders, name)


def _camera(document: YamlMapping, key: str) -> Camera:
    matrix = np.reshape(document.need(key).counted(9), (3, 3))
    coefficients = document.need(*MATRIX_KEYS[key])
    width, height = document.size(WIDTH_KEYS, HEIGHT_KEYS)
    fisheye = document.get(*FISHEYE_KEYS)
    if fisheye is not None and fisheye.text().lower() not in ("0", "false"):
        return FisheyeCamera.from_matrix(matrix, coefficients.counted(4), width, height)
    return PinholeCamera.from_matrix(matrix, radial_tangential(coefficients), width, height)


def radial_tangential(item: YamlItem) -> list[float]:
    """0, 4, 5 or 8 coefficients; 12 or 14 when the thin prism and tilt terms are zero."""
    values = item.counted(0, 4, 5, 8, 12, 14)
    if any(values[8:]):
        raise item.error("thin prism or tilt coefficients other than 0", "up to 8 coefficients")
    return values[:8]
