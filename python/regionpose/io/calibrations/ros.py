"""ROS camera_info: the message as text, or the file of camera_calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping
from regionpose.validation.arrays import Array

MATRIX_KEYS = ("camera_matrix", "K", "k")
DISTORTION_KEYS = ("distortion_coefficients", "D", "d")
PROJECTION_KEYS = ("projection_matrix", "P", "p")
PINHOLE_MODELS = {"plumb_bob": (0, 4, 5, 8), "rational_polynomial": (8, 12, 14)}
FISHEYE_MODELS = ("fisheye", "equidistant")

MIDDLE_THIRD = (1.0 / 3.0, 2.0 / 3.0)
"""Where a center lies, as a fraction of each side, in the picture that its matrix is of; as in `sanity`."""


def describes(document: YamlMapping) -> bool:
    """Whether a distortion model is named next to a camera matrix."""
    return "distortion_model" in document and document.get(*MATRIX_KEYS) is not None


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the file, whose name is its `camera_name`, or `camera`; that of rectified photos if wanted."""
    named = document.get("camera_name")
    return document.source.camera({named.text() if named else "camera": partial(_camera, document)}, name)


def _camera(document: YamlMapping) -> Camera:
    matrix = document.need(*MATRIX_KEYS)
    if not any(matrix.counted(9)):
        raise matrix.error("zeros: the camera is not calibrated", "a calibration (ROS: camera_calibration)")
    window = _Window.of(document)
    if document.source.rectified:
        item = document.need(*PROJECTION_KEYS)
        projection = np.reshape(item.counted(12), (3, 4))
        if not projection.any():
            raise item.error("zeros", "the projection matrix P of rectified photos")
        return window.adapted(PinholeCamera.from_matrix(_exact(projection[:, :3])))
    return window.adapted(_raw(document, np.reshape(matrix.counted(9), (3, 3))))


def _raw(document: YamlMapping, matrix: Array) -> PinholeCamera | FisheyeCamera:
    """The camera of photos as they were taken, of the full picture."""
    model, coefficients = document.need("distortion_model"), document.need(*DISTORTION_KEYS)
    if model.text() in FISHEYE_MODELS:
        return FisheyeCamera.from_matrix(matrix, distortion=coefficients.counted(4))
    if not model.text() and not any(_numbers(coefficients)):
        return PinholeCamera.from_matrix(matrix)
    counts = PINHOLE_MODELS.get(model.text())
    if counts is None:
        raise model.error(repr(model.text()), f"one of {', '.join([*PINHOLE_MODELS, *FISHEYE_MODELS])}")
    values = _numbers(coefficients) if coefficients.is_scalar else coefficients.counted(*counts)
    if model.text() == "plumb_bob" and any(values[5:]):
        raise coefficients.error("8 numbers with k4, k5 or k6 other than 0", "5 numbers, or rational_polynomial")
    if len(values) > 8 and not any(values[8:]):
        values = values[:8]
    return PinholeCamera.from_matrix(matrix, distortion=values[:5] if model.text() == "plumb_bob" else values)


def _numbers(item: YamlItem) -> list[float]:
    """The numbers of a list, none where nothing is written (`d:`)."""
    return [] if item.is_scalar and item.text() in {"", "~", "null"} else item.numbers()


def _exact(matrix: Array) -> Array:
    """The matrix with the last row of a camera's, which drivers write with rounding."""
    return np.vstack([matrix[:2], [0.0, 0.0, 1.0]]) if np.allclose(matrix[2], [0, 0, 1], atol=1e-9) else matrix


@dataclass(frozen=True)
class _Window:
    """Which part of the full picture a photo is, and how many of its pixels make one of the photo's."""

    size: tuple[int | None, int | None]
    offset: tuple[int, int]
    binning: tuple[int, int]
    item: YamlItem | None

    @classmethod
    def of(cls, document: YamlMapping) -> _Window:
        """The window given by width, height, roi and binning."""
        size = document.size(("image_width", "width"), ("image_height", "height"))
        roi = document.get("roi")
        offset = (0, 0)
        if roi is not None and roi.is_mapping:
            window = roi.mapping()
            x, y, width, height = (_whole(window.get(key)) for key in ("x_offset", "y_offset", "width", "height"))
            offset = (x, y)
            if width and height:
                size = (width, height)
            elif x or y:
                raise roi.error(f"the offset {x}, {y} without width and height", "all four, or zeros: the full picture")
        binning = (max(1, _whole(document.get("binning_x"))), max(1, _whole(document.get("binning_y"))))
        item = document.get("binning_x", "binning_y")
        if item is not None and any(
            length is not None and length < by for length, by in zip(size, binning, strict=True)
        ):
            found = f"{binning[0]} x {binning[1]} pixels in one, of a picture of {size[0]} x {size[1]}"
            raise item.error(found, "binning that leaves a pixel at least of each row and column")
        return cls(size, offset, binning, item)

    def adapted(self, camera: PinholeCamera | FisheyeCamera) -> PinholeCamera | FisheyeCamera:
        """The camera of the photo: K and P are of the full picture (ROS, sensor_msgs/CameraInfo)."""
        (width, height), (x, y), (across, down) = self.size, self.offset, self.binning
        binned = (None if width is None else width // across, None if height is None else height // down)
        cropped = replace(camera, cx=camera.cx - x, cy=camera.cy - y, width=width, height=height)
        if self.binning == (1, 1):
            return cropped
        self._refuse_binned_matrix(cropped, binned)
        return cropped._scaled(1.0 / across, 1.0 / down, binned)

    def _refuse_binned_matrix(
        self, camera: PinholeCamera | FisheyeCamera, binned: tuple[int | None, int | None]
    ) -> None:
        """CalibrationError for a matrix that seems to be of the binned picture already."""
        sizes = (self.size, binned)
        if self.item is None or None in (*self.size, *binned):
            return
        inside = [_is_middle(camera.cx, width) and _is_middle(camera.cy, height) for width, height in sizes]
        if inside == [False, True]:
            width, height = binned
            center = f"({camera.cx:g}, {camera.cy:g})"
            found = f"binning beside a matrix whose center {center} is the middle of the binned picture"
            needed = (
                f"the matrix of the full picture, as ROS defines it; or, if this one is of {width} x {height}, these as"
                " width and height, and binning 1"
            )
            raise self.item.error(found, needed)


def _is_middle(center: float, length: int | None) -> bool:
    return length is not None and MIDDLE_THIRD[0] <= (center + 0.5) / length <= MIDDLE_THIRD[1]


def _whole(item: YamlItem | None) -> int:
    """A whole number of at least 0; 0 where there is none."""
    if item is None:
        return 0
    value = item.whole_number()
    if value < 0:
        raise item.error(value, "a number of at least 0")
    return value
