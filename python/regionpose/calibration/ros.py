"""ROS camera_info: the message as text, or the file of camera_calibration."""

from __future__ import annotations

from functools import partial

import numpy as np

from regionpose.calibration.yaml_items import YamlItem, YamlMapping
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera

MATRIX_KEYS = ("camera_matrix", "K", "k")
DISTORTION_KEYS = ("distortion_coefficients", "D", "d")
PINHOLE_MODELS = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,)}
FISHEYE_MODELS = ("fisheye", "equidistant")


def describes(document: YamlMapping) -> bool:
    """Whether a distortion model is named next to a camera matrix."""
    return "distortion_model" in document and document.get(*MATRIX_KEYS) is not None


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the file, whose name is its `camera_name`, or `camera`."""
    named = document.get("camera_name")
    return document.source.camera({named.text() if named else "camera": partial(_camera, document)}, name)


def _camera(document: YamlMapping) -> Camera:
    matrix = np.reshape(document.need(*MATRIX_KEYS).counted(9), (3, 3))
    width, height = document.size(("image_width", "width"), ("image_height", "height"))
    _check_full_image(document)
    model, coefficients = document.need("distortion_model"), document.need(*DISTORTION_KEYS)
    if model.text() in FISHEYE_MODELS:
        return FisheyeCamera.from_matrix(matrix, distortion=coefficients.counted(4), width=width, height=height)
    counts = PINHOLE_MODELS.get(model.text())
    if counts is None:
        raise model.error(repr(model.text()), f"one of {', '.join([*PINHOLE_MODELS, *FISHEYE_MODELS])}")
    return PinholeCamera.from_matrix(matrix, distortion=coefficients.counted(*counts), width=width, height=height)


def _check_full_image(document: YamlMapping) -> None:
    """CalibrationError for binned or cropped images, to which the matrix does not apply."""
    for name in ("binning_x", "binning_y"):
        _check_at_most(document.get(name), 1)
    roi = document.get("roi")
    if roi is not None and roi.is_mapping:
        for name in ("x_offset", "y_offset"):
            _check_at_most(roi.mapping().get(name), 0)


def _check_at_most(item: YamlItem | None, largest: int) -> None:
    if item is not None and item.whole_number() > largest:
        raise item.error(item.whole_number(), f"at most {largest}: the matrix is that of the full image")
