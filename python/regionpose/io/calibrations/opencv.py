"""Calibrations that OpenCV's FileStorage writes as YAML or XML, and JSON or YAML of others with the same keys."""

from __future__ import annotations

from functools import partial

from regionpose.cameras import Camera
from regionpose.io.calibrations.models import matrix_camera
from regionpose.io.calibrations.yaml_items import YamlMapping

COEFFICIENT_KEYS = ("distortion_coefficients", "dist_coeffs", "distCoeffs", "Distortion_Coefficients", "dist", "D")
MATRIX_KEYS = {
    "camera_matrix": COEFFICIENT_KEYS,
    "Camera_Matrix": COEFFICIENT_KEYS,
    "cameraMatrix": COEFFICIENT_KEYS,
    "K": COEFFICIENT_KEYS,
    "M1": ("D1",),
    "M2": ("D2",),
    "K1": ("D1",),
    "K2": ("D2",),
}
"""Names under which OpenCV's samples write the matrix, with those of its distortion."""

WIDTH_KEYS = ("image_width", "image_Width", "width")
HEIGHT_KEYS = ("image_height", "image_Height", "height")


def describes(document: YamlMapping) -> bool:
    """Whether there is a camera matrix under one of OpenCV's names, or one in the item `camera`."""
    return _holder(document).get(*MATRIX_KEYS) is not None


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera whose matrix is called `name`."""
    holder = _holder(document)
    builders = {key: partial(_camera, holder, key) for key in MATRIX_KEYS if key in holder}
    return document.source.camera(builders, name)


def _holder(document: YamlMapping) -> YamlMapping:
    """The mapping that holds the matrix: livox_camera_calib has it in an item `camera`."""
    inner = document.get("camera")
    if document.get(*MATRIX_KEYS) is None and inner is not None and inner.is_mapping:
        return inner.mapping()
    return document


def _camera(document: YamlMapping, key: str) -> Camera:
    size = document.size(WIDTH_KEYS, HEIGHT_KEYS)
    return matrix_camera(document, document.need(key), document.need(*MATRIX_KEYS[key]), size)
