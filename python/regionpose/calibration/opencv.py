"""Calibrations that OpenCV's FileStorage writes as YAML, and JSON with the same keys."""

from __future__ import annotations

from functools import partial

from regionpose.calibration.models import matrix_camera
from regionpose.calibration.yaml_items import YamlMapping
from regionpose.cameras import Camera

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


def describes(document: YamlMapping) -> bool:
    """Whether there is a camera matrix under one of OpenCV's names."""
    return document.get(*MATRIX_KEYS) is not None


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera whose matrix is called `name`."""
    builders = {key: partial(_camera, document, key) for key in MATRIX_KEYS if key in document}
    return document.source.camera(builders, name)


def _camera(document: YamlMapping, key: str) -> Camera:
    size = document.size(WIDTH_KEYS, HEIGHT_KEYS)
    return matrix_camera(document, document.need(key), document.need(*MATRIX_KEYS[key]), size)
